/* Output files are looked at before the work begins: a slip in a name should not cost a long run. */
#include "cli.h"

#include <assert.h>
#include <ctype.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>
#include <unistd.h>

/* Of what the tool writes itself. */
static const char *const own_suffixes[CLI_REPORT + 1] = {
    [CLI_TANGENT] = ".csv .txt",
    [CLI_PICTURE] = ".svg",
};

static bool format_holds(const dmk_format_info *format, cli_what what)
{
    switch (what) {
    case CLI_MESH: return format->writes_mesh;
    case CLI_RESULT: return format->writes_result;
    case CLI_LOCUS: return format->writes_locus;
    case CLI_TANGENT:
    case CLI_PICTURE:
    case CLI_REPORT: break;
    }
    return false;
}

void cli_suffixes(cli_what what, char *text, size_t size)
{
    dmk_format_info format;
    snprintf(text, size, "%s", own_suffixes[what] ? own_suffixes[what] : "");
    for (size_t i = 0; dmk_format_get(i, &format) == DMK_OK; i++) {
        if (!format_holds(&format, what)) continue;
        const size_t used = strlen(text);
        snprintf(text + used, size - used, "%s%s", used ? " " : "", format.suffixes);
    }
}

/* Whether `path` ends in one of the blank-separated suffixes. */
static bool has_suffix(const char *path, const char *suffixes)
{
    const size_t n = strlen(path);
    while (*suffixes) {
        const size_t length = strcspn(suffixes, " ");
        if (length > 0 && n > length && strncasecmp(path + n - length, suffixes, length) == 0) {
            return true;
        }
        suffixes += length + (suffixes[length] == ' ');
    }
    return false;
}

/* ---- streams -------------------------------------------------------------------------------- */

/* The standard output as it was, once a file has taken it: see cli_check_uses. */
static int stdout_fd = -1;
static char stdout_path[32];

bool cli_is_stdout(const char *path)
{
    char *target = dmk_outfile_target(path); /* of a link to /dev/stdout, too */
    const bool is = target && dmk_outfile_descriptor(target) == STDOUT_FILENO;
    free(target);
    return is || strcmp(path, "-") == 0;
}

bool cli_is_stream(const char *path)
{
    return cli_is_stdout(path) || dmk_outfile_is_stream(path);
}

bool cli_is_sink(const char *path)
{
    struct stat file, null;
    return !cli_is_stdout(path) && stat(path, &file) == 0 && stat("/dev/null", &null) == 0 &&
           S_ISCHR(file.st_mode) && file.st_rdev == null.st_rdev;
}

char *cli_name_piece(const char *path, int k)
{
    const size_t room = strlen(path) + DMK_PIECE_ROOM;
    char *name = has_suffix(path, ".pvtp") ? malloc(room) : NULL;
    if (name) dmk_outfile_piece(path, k, name, room);
    return name;
}

size_t cli_piece_stem(const char *name, size_t n)
{
    size_t digits = 0;
    while (digits < n && isdigit((unsigned char)name[n - digits - 1])) digits++;
    return digits >= 4 && digits < n && name[n - digits - 1] == '_' ? n - digits - 1 : 0;
}

bool cli_is_file(const char *path)
{
    struct stat file;
    return stat(path, &file) == 0 && S_ISREG(file.st_mode);
}

const char *cli_path(const char *path)
{
    if (!cli_is_stdout(path)) return path;
    return stdout_fd < 0 ? "/dev/stdout" : stdout_path;
}

/* All that is printed goes to the standard error from now on. */
static int take_stdout(void)
{
    if (stdout_fd >= 0) return EXIT_OK;
    stdout_fd = fcntl(STDOUT_FILENO, F_DUPFD_CLOEXEC, STDERR_FILENO + 1);
    if (stdout_fd < 0 || dup2(STDERR_FILENO, STDOUT_FILENO) < 0) {
        return cli_error(EXIT_IO, "cannot write to the standard output: %s", strerror(errno));
    }
    snprintf(stdout_path, sizeof stdout_path, "/dev/fd/%d", stdout_fd);
    cli_call_stdout(stdout_path);
    return EXIT_OK;
}

/* ---- before the work ------------------------------------------------------------------------ */

/* Whether single files of the format are written. */
static bool is_written(const dmk_format_info *format)
{
    return (format->writes_mesh || format->writes_result || format->writes_locus) &&
           strcmp(format->name, "PVTP") != 0;
}

/* "ply, vtp, ...": the formats of single files that hold one of these, bits 1 << cli_what. */
static void list_formats(unsigned kinds, char *text, size_t size)
{
    dmk_format_info format;
    text[0] = '\0';
    for (size_t i = 0; dmk_format_get(i, &format) == DMK_OK; i++) {
        bool holds = false;
        for (int what = CLI_MESH; what <= CLI_LOCUS; what++)
            holds = holds || ((kinds >> what & 1) && format_holds(&format, (cli_what)what));
        if (!holds || !is_written(&format)) continue;
        snprintf(text + strlen(text), size - strlen(text), "%s%s", *text ? ", " : "", format.name);
    }
    for (char *c = text; *c; c++) *c = (char)tolower((unsigned char)*c);
}

cli_option cli_format_option(const char **format, cli_what what, cli_what other)
{
    static char help[300];
    char names[128];
    list_formats(1U << what | 1U << other, names, sizeof names);
    snprintf(help, sizeof help,
             "format of files whose name has no suffix: %s;\n"
             "default: of pipes, devices and the standard output (-) vtp",
             names);
    return (cli_option){
        .name = "format",
        .value = "NAME",
        .help = help,
        .kind = CLI_TEXT,
        .target = (void *)format,
    };
}

/* The format of that name, if single files of it are written. */
static bool find_format(const char *name, dmk_format_info *format)
{
    for (size_t i = 0; dmk_format_get(i, format) == DMK_OK; i++) {
        if (strcasecmp(name, format->name) == 0) return is_written(format);
    }
    return false;
}

/* Whether files can be made in the folder: 0 or errno. */
static int try_folder(const char *folder)
{
    struct stat file;
    if (stat(folder, &file) != 0) return errno;
    if (!S_ISDIR(file.st_mode)) return ENOTDIR;
    return access(folder, W_OK | X_OK) == 0 ? 0 : errno;
}

static int check_folder(const char *option, const char *path)
{
    char folder[PATH_MAX] = ".";
    struct stat file;
    if (cli_is_stream(path)) return EXIT_OK;
    if (stat(path, &file) == 0 && !S_ISREG(file.st_mode)) {
        return cli_error(EXIT_IO,
                         "--%s: '%s' exists and is neither a regular file nor a pipe or character "
                         "device",
                         option, path);
    }
    char *target = dmk_outfile_target(path);
    const char *slash = target ? strrchr(target, '/') : NULL;
    int error = target ? 0 : errno;
    if (slash)
        snprintf(folder, sizeof folder, "%.*s", (int)(slash - target) + (slash == target), target);
    free(target);
    if (error == 0) error = try_folder(folder);
    if (error == ENOENT) {
        return cli_error(EXIT_IO, "--%s: the folder '%s' does not exist; make it first", option,
                         folder);
    }
    if (error == 0) return EXIT_OK;
    return cli_error(EXIT_IO, "--%s: cannot write into the folder of '%s': %s", option, path,
                     strerror(error));
}

int cli_check_report(const char *path)
{
    dmk_format_info format;
    if (!*path) return cli_error(EXIT_USAGE, "--report: '' is not a file name");
    bool other = has_suffix(path, own_suffixes[CLI_PICTURE]);
    for (size_t i = 0; dmk_format_get(i, &format) == DMK_OK; i++)
        other = other || has_suffix(path, format.suffixes);
    if (!other || cli_is_stream(path)) return EXIT_OK;
    return cli_error(EXIT_USAGE,
                     "--report: '%s' has the suffix of another format, and the report is JSON; "
                     "choose another name, as FILE.json",
                     path);
}

static int check_pieces(const char *option, const char *path, bool stream)
{
    if (stream) {
        return cli_error(EXIT_USAGE, "--%s: '%s': PVTP is several files, and this is one stream",
                         option, path);
    }
    if (dmk_outfile_can_index(path)) return EXIT_OK;
    return cli_error(
        EXIT_USAGE,
        "--%s: '%s': a PVTP file names its pieces, and can do so only in UTF-8 without "
        "control characters; choose another name",
        option, path);
}

static int check_suffix(const char *option, const char *path, cli_what what, const char *format)
{
    static const char *const words[] = {"a mesh", "a result", "lines", "a tangent cut locus",
                                        "a drawing"};
    char suffixes[512];
    dmk_format_info chosen;
    if (what == CLI_REPORT) return cli_check_report(path);
    cli_suffixes(what, suffixes, sizeof suffixes);
    const bool by_name = format && find_format(format, &chosen) && format_holds(&chosen, what);
    const bool stream = cli_is_stream(path);
    if (has_suffix(path, ".pvtp")) {
        const int code = check_pieces(option, path, stream);
        if (code != EXIT_OK) return code;
    }
    if (has_suffix(path, suffixes)) return EXIT_OK;
    if (format && !by_name) {
        return cli_error(EXIT_USAGE,
                         "--format: %s cannot hold %s, and --%s: '%s' has no suffix of a format "
                         "that can; expected one of %s",
                         format, words[what], option, path, suffixes);
    }
    if (by_name || stream) return EXIT_OK;
    return cli_error(EXIT_USAGE, "--%s: '%s' has no suffix of a format for %s; expected one of %s",
                     option, path, words[what], suffixes);
}

int cli_check_output(const char *option, const char *path, cli_what what, const char *format)
{
    const int code = check_suffix(option, path, what, format);
    return code == EXIT_OK ? check_folder(option, path) : code;
}

/* ---- files that are one and the same -------------------------------------------------------- */

/* Where a file is, or would be: names may differ. */
typedef struct destination {
    dev_t device;
    ino_t inode;             /* of the file, or, if it does not exist, of its folder */
    char name[NAME_MAX + 1]; /* then its name there */
    bool exists, out, sink;  /* out: the standard output; sink: a device that takes anything */
} destination;

static destination find_destination(const char *path)
{
    struct stat st;
    char *target = dmk_outfile_target(path), folder[PATH_MAX] = ".";
    const char *at = target ? target : path, *slash = strrchr(at, '/');
    destination p = {.exists = stat(path, &st) == 0};
    p.out = cli_is_stdout(path);
    p.sink = cli_is_sink(path);
    if (slash) snprintf(folder, sizeof folder, "%.*s", (int)(slash - at) + 1, at);
    snprintf(p.name, sizeof p.name, "%s", slash ? slash + 1 : at);
    free(target);
    if (!p.exists && stat(folder, &st) != 0) return p; /* reported when it is used */
    p.device = st.st_dev;
    p.inode = st.st_ino;
    return p;
}

static bool same_destination(const destination *a, const destination *b)
{
    if (a->out && b->out) return true;
    if (a->out || b->out || a->sink) return false;
    if (a->exists != b->exists || a->device != b->device || a->inode != b->inode) return false;
    return a->exists || strcmp(a->name, b->name) == 0;
}

/* Whether it is the place of piece k of the PVTP file `path`; *there: whether there is such a piece. */
static bool is_piece_number(const destination *at, const char *path, int k, bool *there)
{
    char *name = cli_name_piece(path, k);
    const destination piece = name ? find_destination(name) : (destination){0};
    *there = piece.exists;
    const bool found = name && same_destination(&piece, at);
    free(name);
    return found;
}

/* Whether it is the place of a piece of the PVTP file `path`: of one that is there, or by its name. How many there will
 * be is not known yet. */
static bool is_piece(const destination *at, const char *path)
{
    bool there = true, found = false;
    const size_t end = strlen(at->name) - strlen(".vtp");
    const size_t n = has_suffix(at->name, ".vtp") ? cli_piece_stem(at->name, end) : 0;
    if (n > 0) found = is_piece_number(at, path, (int)strtol(at->name + n + 1, NULL, 10), &there);
    there = true;
    for (int k = 0; there && !found; k++) found = is_piece_number(at, path, k, &there);
    return found;
}

void cli_use(cli_uses *uses, const char *option, const char *path)
{
    if (!path) return;
    assert(uses->n < CLI_MAX_USES);
    uses->use[uses->n].option = option;
    uses->use[uses->n++].path = path;
}

void cli_use_files(cli_uses *uses, const char *option, const cli_files *files)
{
    for (int i = 0; i < files->n; i++) cli_use(uses, option, files->path[i]);
}

static bool is_stdin(const char *path)
{
    return strcmp(path, "-") == 0 || strcmp(path, "/dev/stdin") == 0 ||
           dmk_outfile_descriptor(path) == STDIN_FILENO;
}

/* What the first of two readers leaves in a pipe is nothing. */
static int check_stdin(const cli_uses *uses)
{
    int n = 0;
    for (int i = 0; i < uses->n; i++) n += !uses->use[i].option && is_stdin(uses->use[i].path);
    if (n < 2) return EXIT_OK;
    return cli_error(EXIT_USAGE,
                     "the standard input can be read once, not %d times: name a file for the rest",
                     n);
}

static bool is_report(const char *option)
{
    return strcmp(option, "report") == 0 || strcmp(option, "json") == 0;
}

static int two_on_stdout(const char *report, const char *option)
{
    return cli_error(EXIT_USAGE,
                     "--%s%s and --%s - both write to the standard output; use --report FILE for "
                     "the figures",
                     report, strcmp(report, "report") == 0 ? " -" : "", option);
}

int cli_check_uses(const cli_uses *uses)
{
    destination at[CLI_MAX_USES];
    bool takes_stdout = false; /* by a file: reports are printed */
    const int code = check_stdin(uses);
    if (code != EXIT_OK) return code;
    for (int i = 0; i < uses->n; i++) {
        const char *option = uses->use[i].option, *path = uses->use[i].path;
        at[i] = find_destination(path);
        if (!option) at[i].out = false; /* read from the standard input */
        takes_stdout = takes_stdout || (at[i].out && !is_report(option));
        for (int j = 0; j < i && option; j++) {
            const char *other = uses->use[j].option;
            if (!same_destination(&at[i], &at[j]) && !is_piece(&at[j], path) &&
                (!other || !is_piece(&at[i], uses->use[j].path)))
                continue;
            if (!other) {
                return cli_error(EXIT_USAGE, "--%s: '%s' is read by this run; choose another name",
                                 option, path);
            }
            if (at[i].out && at[j].out && (is_report(option) || is_report(other)))
                return two_on_stdout(is_report(option) ? option : other,
                                     is_report(option) ? other : option);
            return cli_error(EXIT_USAGE, "--%s: '%s' is also a file of --%s; choose another name",
                             option, path, other);
        }
    }
    return takes_stdout ? take_stdout() : EXIT_OK;
}

/* ---- files that the tool writes itself ------------------------------------------------------ */

static int cannot_write(const char *path, int error)
{
    return cli_error(error == ENOMEM ? EXIT_MEMORY : EXIT_IO, "cannot write '%s': %s", path,
                     error == DMK_OUTFILE_NOT_REGULAR
                         ? "it exists and is neither a regular file nor a pipe or character device"
                         : strerror(error));
}

int cli_file_open(const char *path, cli_file *file)
{
    file->path = path;
    const int error = dmk_outfile_open(cli_path(path), &file->file);
    if (error != 0) return cannot_write(path, error);
    const int copy = dup(file->file.fd); /* which the stream closes */
    file->stream = copy < 0 ? NULL : fdopen(copy, "w");
    if (file->stream) return EXIT_OK;
    const int code = cannot_write(path, errno);
    if (copy >= 0) close(copy);
    dmk_outfile_discard(&file->file);
    return code;
}

int cli_report_open(const char *path, cli_file *file)
{
    if (strcmp(path, "-") != 0) return cli_file_open(path, file);
    *file = (cli_file){.stream = stdout, .path = path};
    return EXIT_OK;
}

int cli_file_close(cli_file *file)
{
    if (file->stream == stdout) return cli_flush();
    const bool whole = !ferror(file->stream);
    errno = EIO;
    if (fclose(file->stream) == 0 && whole) {
        const int error = dmk_outfile_commit(&file->file);
        return error == 0 ? EXIT_OK : cannot_write(file->path, error);
    }
    const int code = cannot_write(file->path, errno);
    dmk_outfile_discard(&file->file);
    return code;
}

int cli_check_outputs(const char *option, const cli_files *files, cli_what what, const char *format)
{
    int code = EXIT_OK;
    dmk_format_info chosen;
    if (format && !find_format(format, &chosen)) {
        char names[128];
        list_formats(~0U, names, sizeof names);
        return cli_error(EXIT_USAGE,
                         "--format: '%s' is not one of %s; PVTP, which is several files, is chosen "
                         "by the suffix .pvtp",
                         format, names);
    }
    for (int i = 0; i < files->n && code == EXIT_OK; i++) {
        code = cli_check_output(option, files->path[i], what, format);
    }
    return code;
}
