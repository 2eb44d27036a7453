/* The report of a batch: a line of JSON for each source, appended when its files are whole. It is the
 * record of what is done as well, so there are no two that a kill could leave at odds: a source whose
 * line is there has its files, and one without is done again. */
#include "batch.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

/* A line that was found in the report. */
typedef struct seen {
    char *name, *wanted;
    int64_t source;
    char digest[CLI_DIGEST_SIZE], options[CLI_DIGEST_SIZE];
    bool failed, drop;
    double gap;           /* NAN: none reported */
    size_t begin, length; /* in the text */
} seen;

struct batch_record {
    const batch_request *request;
    const batch_list *list;
    const char *path; /* NULL: the standard output */
    int fd;
    cli_file stream; /* whose `fd` is, where the report is no regular file */
    pthread_mutex_t lock;
    char options[CLI_DIGEST_SIZE]; /* digest of all that changes a result */
    char *text;                    /* of the report as it was */
    size_t size;                   /* of the text */
    bool torn;                     /* it has parts of lines, or blank ones */
    seen *line;
    size_t n, room;
};

/* ---- what a line must agree with ------------------------------------------------------------ */

static void digest_names(cli_digest *d, const cli_files *files)
{
    for (int i = 0; i < files->n; i++) cli_digest_add(d, files->path[i], strlen(files->path[i]));
    cli_digest_add(d, "", 0);
}

/* Every option of cmd_batch.c that changes a result, but the source, which a line names for itself. */
static void digest_options(const batch_request *request, char hex[CLI_DIGEST_SIZE])
{
    const dmk_solve_options *o = &request->each.solve;
    cli_digest d = {0};
    char text[512];
    snprintf(text, sizeof text, "%s %d %d %.17g %.17g %.17g %.17g %.17g %d %.17g %d %.17g %d;",
             dmk_version(), (int)o->method, (int)o->start, o->dt, o->inertia, o->tolerance,
             o->gap_tolerance, o->cg_tolerance, o->max_steps, o->threshold, request->each.single,
             request->each.trace.strength, request->each.repair);
    cli_digest_add(&d, text, strlen(text));
    digest_names(&d, &request->each.out);
    digest_names(&d, &request->each.locus);
    digest_names(&d, &request->each.tangent);
    cli_digest_print(&d, hex);
}

/* ---- reading -------------------------------------------------------------------------------- */

/* Step over `text`, if it stands at *at. */
static bool skip(const char **at, const char *text)
{
    const size_t n = strlen(text);
    if (strncmp(*at, text, n) != 0) return false;
    *at += n;
    return true;
}

/* The number of four hexadecimal digits; ULONG_MAX if they are not that. */
static unsigned long read_code(const char *at)
{
    char digits[5] = {0};
    if (strspn(at, "0123456789abcdefABCDEF") < 4) return ULONG_MAX;
    memcpy(digits, at, 4);
    return strtoul(digits, NULL, 16);
}

/* `"key": "value"`, with what comes before it; the value is the caller's to free, or NULL. */
static char *read_text(const char **at, const char *head)
{
    if (!skip(at, head) || !skip(at, "\"")) return NULL;
    char *value = malloc(strcspn(*at, "\n") + 1), *end = value;
    while (value && **at && **at != '"' && **at != '\n') {
        const unsigned long c = strncmp(*at, "\\u", 2) == 0 ? read_code(*at + 2) : ULONG_MAX;
        const char next = **at == '\\' ? (*at)[1] : **at;
        if (next == '\0' || next == '\n') break; /* cut off */
        if (**at != '\\')
            *end++ = *(*at)++;
        else if (c < 0x80 || (c >= 0xdc80 && c <= 0xdcff)) /* a byte that is no UTF-8: json.c */
            *end++ = (char)(c & 0xff), *at += 6;
        else
            *end++ = (*at)[1], *at += 2;
    }
    if (!value) return NULL;
    *end = '\0';
    if (skip(at, "\"")) return value;
    free(value);
    return NULL;
}

static bool read_hex(const char **at, const char *head, char hex[33])
{
    char *value = read_text(at, head);
    const bool good = value && strlen(value) < 33;
    if (good) memcpy(hex, value, strlen(value) + 1);
    free(value);
    return good;
}

/* The fields of batch_record_fields. */
static bool read_fields(const char *at, seen *line)
{
    char *state = NULL, *end;
    line->name = read_text(&at, "{\"name\": ");
    if (!line->name || !skip(&at, ", \"number\": ")) return false;
    line->source = strtoll(at, &end, 10);
    at = end;
    line->wanted = read_text(&at, ", \"wanted\": ");
    const bool good = line->wanted && read_hex(&at, ", \"digest\": ", line->digest) &&
                      read_hex(&at, ", \"options\": ", line->options) &&
                      (state = read_text(&at, ", \"state\": ")) != NULL;
    line->failed = good && strcmp(state, "done") != 0;
    line->gap = solve_reported_gap(at, strcspn(at, "\n"));
    free(state);
    return good;
}

/* A line, or none. */
static bool read_line(const char *at, seen *line)
{
    const bool good = read_fields(at, line);
    if (good) return true;
    free(line->name);
    free(line->wanted);
    line->name = line->wanted = NULL;
    return false;
}

/* By name and source; of two lines for one the later first. */
static int compare(const void *a, const void *b)
{
    const seen *x = a, *y = b;
    const int sign = strcmp(x->name, y->name);
    if (sign) return sign;
    if (x->source != y->source) return x->source < y->source ? -1 : 1;
    return (x->begin < y->begin) - (x->begin > y->begin);
}

/* How much of a line was torn before another rank appended one to it. */
static size_t torn_part(const char *text, size_t length, seen *line)
{
    for (size_t at = length; at-- > 1;) {
        if (text[at] == '{' && read_line(text + at, line)) return at;
    }
    return 0;
}

static int add_line(batch_record *r, size_t begin, size_t length)
{
    const char *text = r->text + begin;
    const size_t blank = strspn(text, " \t\r"), shown = strcspn(text, "\r\n");
    if (text[blank] == '\n') {
        r->torn = true; /* it goes when the rest is written anew */
        return EXIT_OK;
    }
    if (r->n == r->room) {
        seen *more = realloc(r->line, (2 * r->room + 64) * sizeof *more);
        if (!more) return cli_library_error(NULL, DMK_E_NOMEM);
        r->line = more;
        r->room = 2 * r->room + 64;
    }
    seen *line = &r->line[r->n];
    *line = (seen){.begin = begin, .length = length};
    const size_t torn = torn_part(text, length, line);
    line->begin += torn;
    line->length -= torn;
    r->torn |= torn > 0;
    if (torn > 0 || read_line(text, line)) {
        r->n++;
        return EXIT_OK;
    }
    return cli_error(
        cli_exit_code(DMK_E_FORMAT),
        "'%s' is not the report of a batch: a line begins with '%.*s'; choose another --report",
        r->path, shown < 40 ? (int)shown : 40, text);
}

static int read_lines(batch_record *r)
{
    int code = EXIT_OK;
    for (size_t begin = 0; begin < r->size && code == EXIT_OK;) {
        const char *end = memchr(r->text + begin, '\n', r->size - begin);
        r->torn |= !end; /* a kill in the middle of a write */
        if (!end) break;
        const size_t length = (size_t)(end - (r->text + begin)) + 1;
        code = add_line(r, begin, length);
        begin += length;
    }
    if (r->n > 0) qsort(r->line, r->n, sizeof *r->line, compare);
    for (size_t i = 1; i < r->n; i++) {
        const seen *a = &r->line[i - 1], *b = &r->line[i];
        r->line[i].drop = strcmp(a->name, b->name) == 0 && a->source == b->source;
    }
    return code;
}

static int read_report(batch_record *r)
{
    struct stat file;
    if (fstat(r->fd, &file) != 0)
        return cli_error(EXIT_IO, "cannot look at '%s': %s", r->path, strerror(errno));
    r->size = (size_t)file.st_size;
    r->text = calloc(r->size + 1, 1);
    if (!r->text) return cli_library_error(NULL, DMK_E_NOMEM);
    for (size_t got = 0; got < r->size;) {
        const ssize_t n = pread(r->fd, r->text + got, r->size - got, (off_t)got);
        if (n == 0) return cli_error(EXIT_IO, "'%s' is being made shorter", r->path);
        if (n < 0 && errno != EINTR)
            return cli_error(EXIT_IO, "cannot read '%s': %s", r->path, strerror(errno));
        if (n > 0) got += (size_t)n;
    }
    return read_lines(r);
}

/* Whether the report is still the file that is open: a run that has just begun may have put a shorter one there. */
static bool is_named(const batch_record *r)
{
    struct stat here, there;
    return fstat(r->fd, &here) == 0 && stat(r->path, &there) == 0 &&
           dmk_is_same_file(&here, &there);
}

/* What is no regular file is opened for writing alone: who has a pipe open for reading as well is one of its readers,
 * and waits for himself where the other one has gone. */
static int open_stream(batch_record *r)
{
    const int code = cli_file_open(r->path, &r->stream);
    r->fd = code == EXIT_OK ? r->stream.file.fd : -1;
    return code;
}

static int open_locked(batch_record *r)
{
    struct stat there;
    if (stat(r->path, &there) == 0 && !S_ISREG(there.st_mode)) return open_stream(r);
    enum { TRIES = 3 }; /* one is lost only to another run that begins at that very moment */
    for (int i = 0; i < TRIES; i++) {
        r->fd = open(r->path, O_RDWR | O_CREAT | O_APPEND | O_CLOEXEC, 0666);
        if (r->fd < 0) return cli_error(EXIT_IO, "cannot write '%s': %s", r->path, strerror(errno));
        if (flock(r->fd, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK) break;
        if (is_named(r)) return EXIT_OK;
        close(r->fd);
        r->fd = -1;
    }
    return cli_error(EXIT_IO, "another run is writing '%s'", r->path);
}

/* A record without its file, whose path is NULL for the standard output; NULL without memory. */
static batch_record *new_record(const batch_request *request, const batch_list *list)
{
    batch_record *r = calloc(1, sizeof *r);
    if (!r) return NULL;
    *r = (batch_record){.request = request, .list = list, .fd = -1};
    pthread_mutex_init(&r->lock, NULL);
    digest_options(request, r->options);
    if (solve_reports_to_file(&request->each)) r->path = request->each.report;
    return r;
}

int batch_record_open(const batch_request *request, const batch_list *list, batch_record **record)
{
    batch_record *r = *record = new_record(request, list);
    if (!r) return cli_library_error(NULL, DMK_E_NOMEM);
    if (!r->path) return EXIT_OK;
    int code = open_locked(r);
    if (code == EXIT_OK) code = read_report(r);
    if (code == EXIT_OK && r->size > 0 && !request->each.resume) {
        code = cli_error(EXIT_USAGE,
                         "batch: '%s' exists: --resume goes on with what it lacks, or remove it",
                         r->path);
    }
    return code;
}

int batch_record_join(const batch_request *request, const batch_list *list, batch_record **record)
{
    batch_record *r = *record = new_record(request, list);
    if (!r) return cli_library_error(NULL, DMK_E_NOMEM);
    if (!r->path) return EXIT_OK;
    r->fd = open(r->path, O_WRONLY | O_APPEND | O_CLOEXEC);
    if (r->fd >= 0) return EXIT_OK;
    return cli_error(EXIT_IO, "cannot write '%s': %s", r->path, strerror(errno));
}

void batch_record_close(batch_record **record)
{
    batch_record *r = *record;
    if (!r) return;
    for (size_t i = 0; i < r->n; i++) {
        free(r->line[i].name);
        free(r->line[i].wanted);
    }
    free(r->line);
    free(r->text);
    if (r->stream.stream)
        cli_file_close(&r->stream);
    else if (r->fd >= 0)
        close(r->fd);
    pthread_mutex_destroy(&r->lock);
    free(r);
    *record = NULL;
}

/* ---- what can stay -------------------------------------------------------------------------- */

static const char *judge(const batch_record *r, const batch_entry *entry, const seen *line)
{
    solve_request one;
    const batch_mesh *mesh = &r->list->mesh[entry->mesh];
    if (line->failed) return "it failed";
    if (!mesh->digest[0]) return "the mesh is a pipe, or cannot be read";
    if (strcmp(line->digest, mesh->digest) != 0) return "the mesh has changed";
    if (strcmp(line->wanted, entry->wanted) != 0) return "the source is another";
    if (strcmp(line->options, r->options) != 0) return "the options are others";
    const bool there =
        batch_name_files(r->request, mesh, entry->source, &one) && solve_has_files(&one);
    batch_free_files(&one);
    return there ? NULL : "a file of it is missing";
}

/* The latest line of a source, or NULL. */
static seen *find_line(const batch_record *r, const char *name, size_t source)
{
    const seen key = {.name = (char *)name, .source = (int64_t)source, .begin = SIZE_MAX};
    size_t lo = 0, hi = r->n; /* the first line not before the key */
    while (lo < hi) {
        const size_t mid = lo + (hi - lo) / 2;
        if (compare(&r->line[mid], &key) < 0)
            lo = mid + 1;
        else
            hi = mid;
    }
    seen *line = lo < r->n ? &r->line[lo] : NULL;
    return line && strcmp(line->name, name) == 0 && line->source == key.source ? line : NULL;
}

/* The line of the source of another run whose files have the names of this one's, or NULL: sample 7 of the mesh "a" and
 * the one source of "a-0007". */
static seen *find_rival(const batch_record *r, const batch_entry *entry)
{
    static const char sample[] = "sample "; /* how `wanted` begins: see farm.c */
    const bool several = r->request->samples > 0;
    const char *name = r->list->mesh[entry->mesh].name, *dash = strrchr(name, '-');
    size_t source = several ? entry->source : dash ? strtoul(dash + 1, NULL, 10) : 0;
    char number[BATCH_NUMBER_SIZE], other[PATH_MAX];
    batch_number(true, source, number);
    if (several) {
        snprintf(other, sizeof other, "%s%s", name, number);
        source = 0;
    } else {
        if (!dash || strcmp(dash, number) != 0) return NULL;
        snprintf(other, sizeof other, "%.*s", (int)(dash - name), name);
    }
    seen *line = find_line(r, other, source);
    return line && (strncmp(line->wanted, sample, strlen(sample)) == 0) != several ? line : NULL;
}

const char *batch_record_check(batch_record *r, const batch_entry *entry, double *gap)
{
    seen *line = find_line(r, r->list->mesh[entry->mesh].name, entry->source);
    seen *rival = r->request->folder ? find_rival(r, entry) : NULL;
    if (rival) rival->drop = true; /* its files are written over, or were */
    if (!line) return "";
    const char *why = rival && rival->begin > line->begin
                          ? "files of another source have taken the names of its own"
                          : judge(r, entry, line);
    line->drop = why != NULL;
    *gap = line->gap;
    return why;
}

static int by_place(const void *a, const void *b)
{
    const seen *x = a, *y = b;
    return (x->begin > y->begin) - (x->begin < y->begin);
}

int batch_record_begin(batch_record *r)
{
    size_t dropped = 0;
    for (size_t i = 0; i < r->n; i++) dropped += r->line[i].drop;
    if (!r->path || (dropped == 0 && !r->torn)) return EXIT_OK;
    cli_file file;
    int code = cli_file_open(r->path, &file);
    if (code != EXIT_OK) return code;
    qsort(r->line, r->n, sizeof *r->line, by_place);
    for (size_t i = 0; i < r->n; i++) {
        if (!r->line[i].drop) fwrite(r->text + r->line[i].begin, 1, r->line[i].length, file.stream);
    }
    code = cli_file_close(&file);
    if (code != EXIT_OK) return code;
    const int old = r->fd; /* locked until the new one is */
    code = open_locked(r);
    close(old);
    return code;
}

/* ---- writing -------------------------------------------------------------------------------- */

void batch_record_fields(const batch_record *r, cli_json *json, const batch_entry *entry,
                         bool failed)
{
    const batch_mesh *mesh = &r->list->mesh[entry->mesh];
    json_text(json, "name", mesh->name);
    json_integer(json, "number", (int64_t)entry->source);
    json_text(json, "wanted", entry->wanted);
    json_text(json, "digest", mesh->digest);
    json_text(json, "options", r->options);
    json_text(json, "state", failed ? "failed" : "done");
}

int batch_record_append(batch_record *r, const char *line, size_t length)
{
    int code = EXIT_OK;
    pthread_mutex_lock(&r->lock);
    if (!r->path) {
        fwrite(line, 1, length, stdout);
        code = cli_flush();
    } else {
        const int error = dmk_outfile_append(r->fd, line, length);
        if (error != 0)
            code = cli_error(EXIT_IO, "cannot write '%s': %s", r->path, strerror(error));
    }
    pthread_mutex_unlock(&r->lock);
    return code;
}
