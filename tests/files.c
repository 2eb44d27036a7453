#include "files.h"

#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

int files_setup(void **state)
{
    fixture *f = calloc(1, sizeof *f);
    const char *tmp = getenv("TMPDIR");
    *state = f;
    snprintf(f->folder, sizeof f->folder, "%s/io-XXXXXX", tmp ? tmp : "/tmp");
    return dmk_context_create(&f->ctx) || !mkdtemp(f->folder);
}

int files_teardown(void **state)
{
    fixture *f = *state;
    int rc = rmdir(f->folder); /* fails if a test left anything */
    dmk_context_destroy(&f->ctx);
    free(f);
    return rc;
}

const char *path_of(fixture *f, const char *name)
{
    snprintf(f->path, sizeof f->path, "%s/%s", f->folder, name);
    return f->path;
}

void put_file(fixture *f, const char *name, const void *content, size_t n)
{
    FILE *file = fopen(path_of(f, name), "wb");
    assert_non_null(file);
    assert_int_equal(fwrite(content, 1, n, file), n);
    assert_int_equal(fclose(file), 0);
}

char *get_file(fixture *f, const char *name, size_t *n)
{
    FILE *file = fopen(path_of(f, name), "rb");
    assert_non_null(file);
    assert_int_equal(fseek(file, 0, SEEK_END), 0);
    const size_t size = (size_t)ftell(file);
    rewind(file);
    char *content = calloc(1, size + 1);
    assert_non_null(content);
    *n = fread(content, 1, size, file);
    assert_int_equal(*n, size);
    fclose(file);
    return content;
}

void remove_file(fixture *f, const char *name)
{
    assert_int_equal(unlink(path_of(f, name)), 0);
}

size_t count_files(const fixture *f)
{
    size_t n = 0;
    DIR *d = opendir(f->folder);
    assert_non_null(d);
    while (readdir(d)) n++;
    closedir(d);
    return n - 2;
}

dmk_mesh *read_mesh(fixture *f, const char *name)
{
    dmk_mesh *m = NULL;
    if (dmk_mesh_read(f->ctx, path_of(f, name), &m) != DMK_OK) {
        fail_msg("%s", dmk_context_message(f->ctx));
    }
    return m;
}

dmk_mesh *read_bytes(fixture *f, const char *name, const void *content, size_t n)
{
    put_file(f, name, content, n);
    dmk_mesh *m = read_mesh(f, name);
    remove_file(f, name);
    return m;
}

dmk_mesh *read_text(fixture *f, const char *name, const char *text)
{
    return read_bytes(f, name, text, strlen(text));
}

void check_refusals(fixture *f, const refusal *refusals, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        const refusal *r = &refusals[i];
        dmk_mesh *m = NULL;
        put_file(f, r->name, r->text, strlen(r->text));
        int rc = dmk_mesh_read(f->ctx, f->path, &m);
        const char *message = dmk_context_message(f->ctx);
        if (rc != r->status || !strstr(message, r->message) || m) {
            fail_msg("%zu: status %d, '%s' without '%s'", i, rc, message, r->message);
        }
        remove_file(f, r->name);
    }
}

const double square_xyz[12] = {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0};
const int32_t square_triangles[6] = {0, 1, 2, 0, 2, 3};

void check_square(dmk_mesh *m)
{
    assert_int_equal(m->n_vertices, 4);
    assert_int_equal(m->n_triangles, 2);
    assert_memory_equal(m->xyz, square_xyz, sizeof square_xyz);
    assert_memory_equal(m->triangle, square_triangles, sizeof square_triangles);
    dmk_mesh_destroy(&m);
}
