/* What tests of files share: a folder of their own, putting and getting files. */
#ifndef TEST_FILES_H
#define TEST_FILES_H

#include "io/io.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

#define COUNT(a) (sizeof(a) / sizeof *(a))
#define TEST(name) cmocka_unit_test_setup_teardown(name, files_setup, files_teardown)

typedef struct fixture {
    dmk_context *ctx;
    char folder[200]; /* empty before and after each test */
    char path[300];   /* what path_of gave last */
} fixture;

int files_setup(void **state);
int files_teardown(void **state); /* fails if the test left a file */

/* The path of a file in the folder; put_file, get_file, remove_file and read_mesh also set it. */
const char *path_of(fixture *f, const char *name);
void put_file(fixture *f, const char *name, const void *content, size_t n);
char *get_file(fixture *f, const char *name, size_t *n);
void remove_file(fixture *f, const char *name);
size_t count_files(const fixture *f);

/* Read a mesh, which must succeed. read_bytes puts the file first and removes it after. */
dmk_mesh *read_mesh(fixture *f, const char *name);
dmk_mesh *read_bytes(fixture *f, const char *name, const void *content, size_t n);
dmk_mesh *read_text(fixture *f, const char *name, const char *text);

/* Text that must be refused when it stands in a file of that name. */
typedef struct refusal {
    const char *name, *text;
    int status;
    const char *message; /* part of it */
} refusal;

void check_refusals(fixture *f, const refusal *refusals, size_t n);

/* The unit square as two triangles, 0 1 2 and 0 2 3. */
extern const double square_xyz[12];
extern const int32_t square_triangles[6];
/* Just that, in this order; the mesh is freed. */
void check_square(dmk_mesh *mesh);

#endif
