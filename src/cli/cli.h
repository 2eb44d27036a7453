/* The dmkcl tool: what its files share. It knows the library by the public header only, and writes files as the
 * library does. */
#ifndef DMK_CLI_H
#define DMK_CLI_H

#include "dmkcl.h"

#include "base/outfile.h"

#include <limits.h>
#include <stdbool.h>
#include <stdio.h>

/* ---- main.c: the commands; each lives in a file of its own, cmd_NAME.c ---------------------- */

/* argv[0] is the command's name; the result is the exit code. */
int cmd_solve(int argc, char **argv);
int cmd_batch(int argc, char **argv);
int cmd_distance(int argc, char **argv);
int cmd_transport(int argc, char **argv);
int cmd_path(int argc, char **argv);
int cmd_cut(int argc, char **argv);
int cmd_mesh(int argc, char **argv);
int cmd_info(int argc, char **argv);
int cmd_devices(int argc, char **argv);

/* ---- exit.c: exit codes and errors ---------------------------------------------------------- */

enum {
    EXIT_OK = 0,
    EXIT_USAGE = 1,
    EXIT_IO = 2,
    EXIT_DEVICE = 5,
    EXIT_MEMORY = 8,
    EXIT_GAP = 9,
    EXIT_INTERRUPTED = 130
};

/* The exit code of a library status. */
int cli_exit_code(int status);
void cli_print_exit_codes(FILE *file);
/* "dmkcl: text" on the standard error; the result is `code`. */
int cli_error(int code, const char *format, ...) __attribute__((format(printf, 2, 3)));
/* The same with the message of the context for the failed library call that gave `status`. */
int cli_library_error(const dmk_context *context, int status);
/* What the last of them said in this thread. */
const char *cli_last_error(void);
/* Errors that name this path, which must last, mean the standard output. */
void cli_call_stdout(const char *path);
/* Flush the standard output; EXIT_IO with a message if anything written there was lost. */
int cli_flush(void);

/* ---- options.c: the command line as a table ------------------------------------------------- */

enum { CLI_MAX_FILES = 16, CLI_MAX_OPTIONS = 40 };

typedef struct cli_files {
    const char *path[CLI_MAX_FILES];
    int n;
} cli_files;

/* Up to three numbers; n = 0: not given. */
typedef struct cli_numbers {
    double value[3];
    int n;
} cli_numbers;

typedef enum cli_kind {
    CLI_FLAG,    /* bool */
    CLI_INTEGER, /* int64_t in [lo, hi] */
    CLI_NUMBER,  /* double in [lo, hi] */
    CLI_POINT,   /* cli_numbers: exactly three */
    CLI_SIZES,   /* cli_numbers: one to three above zero */
    CLI_TEXT,    /* const char * */
    CLI_FILES,   /* cli_files; may be given again */
    CLI_CHOICE   /* int: index into choices */
} cli_kind;

typedef struct cli_option {
    const char *name;  /* without the dashes */
    const char *value; /* what stands for the value in the help; NULL for a flag */
    const char *help;
    cli_kind kind;
    void *target; /* of the type that goes with `kind`; untouched if the option is not given */
    double lo, hi;
    const char *expected;       /* of a bad number: "a number in (0, 1]"; of an integer its kind */
    const char *hint;           /* said right behind the error, or NULL */
    const char *const *choices; /* NULL-terminated */
} cli_option;

/* Operands, in the order of the command line. */
typedef struct cli_words {
    const char **word;
    size_t n;
} cli_words;

typedef struct cli_syntax {
    const char *command;
    const char *usage;   /* what follows the command */
    const char *summary; /* sentences */
    const char *operand; /* name of the one operand, or of each of many, or NULL for none */
    cli_words *operands; /* where there may be many: all of them */
    const char *notes;   /* after the options, or NULL */
    const cli_option *options;
    size_t n_options; /* at most CLI_MAX_OPTIONS */
} cli_syntax;

enum { CLI_GO_ON = -1 };

/* Fill the targets and *operand (the first one), or `operands` of the syntax with words of argv, whose
 * front they take. CLI_GO_ON, or the exit code when there is nothing more to do. */
int cli_parse(const cli_syntax *syntax, int argc, char **argv, const char **operand);
/* The entry of `names` (NULL-terminated) nearest to `word`, or NULL if none is near. */
const char *cli_nearest(const char *word, const char *const *names);

/* ---- pairs.c -------------------------------------------------------------------------------- */

/* Of the options that are given (for each of the syntax), whether all have an effect beside the others. CLI_GO_ON, or
 * EXIT_USAGE with the error printed. */
int cli_check_pairs(const cli_syntax *syntax, const bool *given);

/* ---- output.c: files to be written ---------------------------------------------------------- */

/* CLI_REPORT is JSON under any name but one of another format. */
typedef enum cli_what {
    CLI_MESH,
    CLI_RESULT,
    CLI_LOCUS,
    CLI_TANGENT,
    CLI_PICTURE,
    CLI_REPORT
} cli_what;

/* See before the work starts that `path` of --`option` can hold `what`, by its suffix, by `format` (of --format, or
 * NULL) or as a stream, and lies in a folder that can be written to. EXIT_OK, or the exit code with the error
 * printed. */
int cli_check_output(const char *option, const char *path, cli_what what, const char *format);
int cli_check_outputs(const char *option, const cli_files *files, cli_what what,
                      const char *format);
/* Of these the part that looks at a report's name. */
int cli_check_report(const char *path);
/* The row of --format, of a command that writes `what` and `other`, which may be the same. */
cli_option cli_format_option(const char **format, cli_what what, cli_what other);
/* Whether a path is the standard output: "-", /dev/stdout or the like, or a link to it; or nothing, as /dev/null; or
 * another pipe or device. */
bool cli_is_stdout(const char *path);
bool cli_is_sink(const char *path);
bool cli_is_stream(const char *path);
/* NAME_0003.vtp of NAME.pvtp, k = 3, which the caller frees; NULL of other files, and without memory. */
char *cli_name_piece(const char *path, int k);
/* Of the n characters of a piece's name without its suffix those before "_0003"; 0 if it does not end as pieces do. */
size_t cli_piece_stem(const char *name, size_t n);
/* Whether there is a regular file. */
bool cli_is_file(const char *path);
/* The name for the library of a path of the command line: that of the standard output as it was, where a file has
 * taken it. */
const char *cli_path(const char *path);
/* The files of a run, those that it reads before those that it writes. */
enum { CLI_MAX_USES = 5 * CLI_MAX_FILES };
typedef struct cli_uses {
    struct {
        const char *option; /* NULL: it is read */
        const char *path;
    } use[CLI_MAX_USES];
    int n;
} cli_uses;

/* `option` is NULL for a file that is read; a path of NULL is none. */
void cli_use(cli_uses *uses, const char *option, const char *path);
void cli_use_files(cli_uses *uses, const char *option, const cli_files *files);
/* No file is written that is read, and none is written twice, by whatever names. EXIT_OK or EXIT_USAGE. Where one is
 * the standard output, that carries nothing else from now on: what is printed goes to the standard error. */
int cli_check_uses(const cli_uses *uses);
/* Print the suffixes that hold `what`, as ".vtp .vtu", into `text`. */
void cli_suffixes(cli_what what, char *text, size_t size);

/* A file that comes into being whole or not at all, when it is closed. The results are exit codes, with
 * errors printed. */
typedef struct cli_file {
    FILE *stream;
    const char *path;
    dmk_outfile file;
} cli_file;

int cli_file_open(const char *path, cli_file *file);
/* A report's: "-" is the standard output. */
int cli_report_open(const char *path, cli_file *file);
int cli_file_close(cli_file *file);

/* ---- drawing.c ------------------------------------------------------------------------------ */

/* A cut mesh laid out in the plane, 2 coordinates per vertex: its triangles and its outline, as SVG. */
int cli_draw_plane(const dmk_mesh *cut, const double *plane, const char *path);

/* ---- interrupt.c: the end from outside ------------------------------------------------------ */

/* To be called first. From now on SIGINT and SIGTERM, if they were not ignored, ask the running call to stop, and end
 * the program half a second later, or at the second one, wherever it is: exit code 130. And a driver that crashes while
 * a device is opened, or ends the program itself, has the exit code of a device that failed, with a message. */
void cli_catch_signals(void);
bool cli_interrupted(void);
/* Whether nobody has reported yet that the run was cancelled; after this somebody has. */
bool cli_first_to_tell(void);
/* From now on the caller reports an interruption, and nobody else does; if it does not come to it, the program ends
 * with this word, a static text. */
void cli_keep_last_word(const char *word);
/* Whether the report is still the caller's to make, in words of its own; after this it is made. */
bool cli_has_last_word(void);
/* dmk_device_list and dmk_device_open, with the driver's crashes named; see above. */
int cli_device_list(dmk_context *context, dmk_device_info *devices, size_t capacity, size_t *n);
int cli_device_open(dmk_context *context, const dmk_device_options *options, dmk_device **device);

/* ---- terminal.c: colour, progress ----------------------------------------------------------- */

typedef struct cli_moment {
    double seconds;
    double change; /* its logarithm */
} cli_moment;

typedef struct cli_progress {
    bool line;            /* one line that is rewritten, for terminals */
    bool steps;           /* a line for each step */
    double shown;         /* seconds of the last update */
    const char *stage;    /* and its stage */
    bool open;            /* the line is on the screen */
    const char *prefix;   /* of the line, for instance the number of the source; may be NULL */
    double gap;           /* the last that was computed, or NaN */
    cli_moment moment[2]; /* earlier in the iteration: for the estimate of the time left */
} cli_progress;

/* Bold on a terminal that can, else "". */
const char *cli_bold(void);
const char *cli_plain(void);
/* Reports of `context` go to the standard error as `progress` says, and Ctrl-C cancels. */
void cli_watch(dmk_context *context, cli_progress *progress);
/* Put `text` on the progress line, if there is one. */
void cli_progress_say(cli_progress *progress, const char *text);
/* Wipe the progress line. */
void cli_progress_end(cli_progress *progress);

/* ---- text.c: texts that are read, figures for people ----------------------------------------- */

enum { CLI_TEXT_SIZE = 48 };

/* What becomes of a line, which ends before its line end; counted from 1. EXIT_OK, or the code that ends the reading,
 * with the error printed. */
typedef int cli_take(char *line, int64_t number, void *data);
/* Hand on all lines of a text; "-" is the standard input. EXIT_OK, or the code with the error printed. */
int cli_read_lines(const char *path, cli_take *take, void *data);
/* As strtod, but in decimal digits alone, as whole numbers are: of "0x10" nothing is read, and *end == text. */
double cli_decimal(const char *text, char **end);
/* Behind blanks, tabs and their like. */
const char *cli_skip_blanks(const char *text);
/* Three finite numbers and nothing else, with commas or blanks between them, as 3,0,0. */
bool cli_read_point(const char *text, double xyz[3]);
/* 86784 -> "86,784" */
const char *cli_count(int64_t n, char text[CLI_TEXT_SIZE]);
/* "1 vertex", "86,784 vertices" */
const char *cli_counted(int64_t n, const char *one, const char *many, char text[CLI_TEXT_SIZE]);
/* ", 3 left", or nothing where none is. */
const char *cli_left(size_t n, char text[CLI_TEXT_SIZE]);
/* Bytes as "1.5 GiB". */
const char *cli_bytes(uint64_t bytes, char text[CLI_TEXT_SIZE]);
/* What a solve of a mesh takes, for a person: the rest of a line on the standard output. */
void cli_print_memory(const dmk_mesh *mesh, bool single);
/* "3, 0, 0.5" */
const char *cli_point(const double xyz[3], char text[CLI_TEXT_SIZE]);
/* Bytes of the largest resident size so far. */
uint64_t cli_peak_memory(void);
double cli_seconds(void);

/* ---- reading.c ------------------------------------------------------------------------------ */

typedef struct cli_reading {
    bool repair;
    bool quiet;             /* print nothing of it */
    cli_progress *progress; /* whose line gives way to what is printed, or NULL */
    const dmk_ranks *ranks; /* that all read it, or NULL */
    bool keep_memory;       /* also of a large mesh: see cli_keep_memory */
    bool shares;            /* a rank that gives the mesh back for its share of it */
} cli_reading;

#define CLI_QUIET_HELP "print nothing but errors, no warnings either"

#define CLI_REPAIR_HELP                                                                            \
    "merge coincident vertices, drop zero-area and duplicate triangles,\n"                         \
    "orient triangles consistently, split non-manifold edges and vertices"

/* Collective: whether the mesh file is one and the same on all ranks that have it, each of which reads a part of it.
 * The exit code, with the error printed. */
int cli_check_same_file(const char *path);
/* Read a mesh file. On the standard error: what was repaired, and a warning of a mesh in pieces. The status of the
 * library; *did is the caller's to free, and zero without a repair. */
int cli_read_mesh(dmk_context *context, const char *path, const cli_reading *how, dmk_repairs *did,
                  dmk_mesh **mesh);
/* dmk_mesh_project; with a warning, unless quiet, if the surface is more than an edge away. */
int cli_project(dmk_context *context, const dmk_mesh *mesh, const double xyz[3], bool quiet,
                dmk_point *point);
void cli_warn_away(dmk_context *context, const dmk_mesh *mesh, const double xyz[3],
                   const dmk_point *point);
/* From a point of the surface to xyz. */
double cli_offset(dmk_context *context, const dmk_mesh *mesh, const double xyz[3],
                  const dmk_point *point);

/* ---- digest.c ------------------------------------------------------------------------------- */

enum { CLI_DIGEST_SIZE = 33 }; /* hexadecimal, with its end */

/* Two chains of multiplications and shifts with different odd factors: against changes by chance, not against forgers.
 * Begins as {0}. */
typedef struct cli_digest {
    uint64_t a, b;
} cli_digest;

void cli_digest_add(cli_digest *d, const char *bytes, size_t n);
void cli_digest_print(const cli_digest *d, char hex[CLI_DIGEST_SIZE]);
/* Of a file's content; false and "" if it cannot be read, or only once, as a pipe. */
bool cli_digest_file(const char *path, char hex[CLI_DIGEST_SIZE]);

/* ---- heap.c --------------------------------------------------------------------------------- */

/* Let freed memory be used again rather than go back to the system at once, for fresh pages cost time: 0.09 of
 * the 1.3 s of a solve of 273,000 triangles. This ends at cli_save_memory. */
void cli_keep_memory(void);
/* Once a mesh has been read: if it is large, what is freed goes back. shares: this rank gives it back for its share. */
void cli_save_memory(const dmk_mesh *mesh, bool shares);
/* What is free goes back to the system after all. */
void cli_trim_memory(void);
/* Before the work on a mesh that is not large: its heap in pages of 2 MB, where the system gives them to those who
 * ask. Of 68,000 triangles a solve has 9,400 page faults then in place of 25,000. What is not used takes no memory. */
void cli_make_room(const dmk_mesh *mesh);
/* The same before a mesh file is read for distances. */
void cli_make_room_for_file(const char *path);

/* ---- json.c --------------------------------------------------------------------------------- */

typedef struct cli_json {
    FILE *file;
    int depth;
    bool empty;    /* nothing yet in the innermost object or list */
    bool one_line; /* as JSON Lines want it */
} cli_json;

/* `key` is NULL inside lists and for the outermost value. `bracket` is '{' or '['. */
void json_open(cli_json *json, const char *key, char bracket);
void json_close(cli_json *json, char bracket);
void json_text(cli_json *json, const char *key, const char *value);
void json_integer(cli_json *json, const char *key, int64_t value);
void json_number(cli_json *json, const char *key, double value); /* not finite: null */
void json_bool(cli_json *json, const char *key, bool value);
void json_numbers(cli_json *json, const char *key, const double *values, size_t n);
/* Mesh counts and measures, as fields of the object that is open. */
void json_mesh(cli_json *json, const dmk_mesh_info *info);
/* What a solve takes, in bytes, as an object of its own. */
void json_memory(cli_json *json, const dmk_mesh *mesh, bool single);
/* What was repaired, as an object of its own; nothing without a repair. */
void json_repairs(cli_json *json, const dmk_repairs *did);

#endif
