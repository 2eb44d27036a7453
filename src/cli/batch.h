/* dmkcl batch: many meshes in one process. meshes.c lists them, record.c knows what is done, farm.c
 * does the rest on some threads; cmd_batch.c has the options. */
#ifndef DMK_CLI_BATCH_H
#define DMK_CLI_BATCH_H

#include "solve.h"

typedef struct batch_mesh {
    char *path;
    char *name;                   /* of its files: the path within the folder, without suffixes */
    int64_t bytes;                /* of the file; -1: unknown */
    char digest[CLI_DIGEST_SIZE]; /* of its content; "" if it could not be read, or is a pipe */
} batch_mesh;

typedef struct batch_list {
    batch_mesh *mesh;
    size_t n;
    const cli_words *operands; /* that it was made of */
} batch_list;

typedef struct batch_request {
    solve_request each; /* for every source; the files' names are suffixes here */
    const char *folder; /* for the files; NULL: none are written */
    int64_t samples;    /* farthest-point samples of each mesh; 0: one source */
} batch_request;

/* The meshes of the operands: mesh files, folders, and files with a list of either. The exit code, with
 * the error printed. batch_list_free in any case. */
int batch_list_create(const cli_words *operands, const char *out_folder, batch_list *list);
void batch_list_free(batch_list *list);

/* ---- names.c -------------------------------------------------------------------------------- */

/* The files of a source: names in `one`, freed by batch_free_files. false without memory. */
bool batch_name_files(const batch_request *request, const batch_mesh *mesh, size_t source,
                      solve_request *one);
void batch_free_files(solve_request *one);
/* Of several sources "-0007", which stands behind the mesh's name; of one "". */
enum { BATCH_NUMBER_SIZE = 32 };
void batch_number(bool several, size_t source, char number[BATCH_NUMBER_SIZE]);
/* The folders above a file. */
int batch_make_folders(const char *file);
/* No file of a result is a mesh or a list that is read, or the report, which is there. The exit code, with the error
 * printed. */
int batch_check_names(const batch_request *request, const batch_list *list);

/* ---- record.c: the report, which is also the record of what is done ------------------------- */

typedef struct batch_record batch_record;

/* One line of the report. */
typedef struct batch_entry {
    size_t mesh, source; /* numbers */
    const char *wanted;  /* how the source was chosen: "vertex 0" */
} batch_entry;

/* Open the report of `request` for appending, locked against others; with `resume` read what is in it. */
int batch_record_open(const batch_request *request, const batch_list *list, batch_record **record);
/* The same by another rank, to append to it, once the first one has begun it. */
int batch_record_join(const batch_request *request, const batch_list *list, batch_record **record);
/* Why a source must be done (again), or NULL if its line can stay: called once for each source, before
 * batch_record_begin. "" : it was never done. *gap: that of a line that stays. */
const char *batch_record_check(batch_record *record, const batch_entry *entry, double *gap);
/* Drop the lines that cannot stay. */
int batch_record_begin(batch_record *record);
/* Append a line, whole or not at all. Safe from several threads. */
int batch_record_append(batch_record *record, const char *line, size_t length);
/* The fields by which the line is found again, into an open object. */
void batch_record_fields(const batch_record *record, cli_json *json, const batch_entry *entry,
                         bool failed);
void batch_record_close(batch_record **record);

/* ---- farm.c --------------------------------------------------------------------------------- */

int batch_run(const batch_request *request, batch_list *list);

#endif
