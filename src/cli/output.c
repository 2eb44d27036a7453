/* Output files are looked at before the work begins: a slip in a name should not cost a long run.
 */
#include "cli.h"

#include <errno.h>
#include <limits.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>
#include <unistd.h>

static bool format_holds(const dmk_format_info *format, cli_what what)
{
    switch (what) {
    case CLI_MESH: return format->writes_mesh;
    case CLI_RESULT: return format->writes_result;
    case CLI_LOCUS: return format->writes_locus;
    case CLI_ANY: return true;
    }
    return false;
}

void cli_suffixes(cli_what what, char *text, size_t size)
{
    dmk_format_info format;
    text[0] = '\0';
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

static int check_folder(const char *option, const char *path)
{
    char folder[PATH_MAX] = ".";
    const char *slash = strrchr(path, '/');
    if (slash) snprintf(folder, sizeof folder, "%.*s", (int)(slash - path) + 1, path);
    struct stat file;
    if (stat(path, &file) == 0 && !S_ISREG(file.st_mode)) {
        /* A finished file takes the name's place: a device or a pipe would be gone. */
        return cli_error(EXIT_IO, "--%s: '%s' is there and not a regular file", option, path);
    }
    if (access(folder, W_OK | X_OK) != 0) {
        return cli_error(EXIT_IO, "--%s: cannot write into the folder of '%s': %s", option, path,
                         strerror(errno));
    }
    return EXIT_OK;
}

int cli_check_output(const char *option, const char *path, cli_what what)
{
    static const char *const words[] = {"a mesh", "a result", "a cut locus", ""};
    char suffixes[512];
    cli_suffixes(what, suffixes, sizeof suffixes);
    if (what != CLI_ANY && !has_suffix(path, suffixes)) {
        return cli_error(EXIT_USAGE,
                         "--%s: '%s' has no suffix of a format for %s; expected one of %s", option,
                         path, words[what], suffixes);
    }
    return check_folder(option, path);
}

/* ---- files that the tool writes itself ------------------------------------------------------ */

/* A temporary file beside file->path, with the permissions that a new file would have. */
static FILE *open_temporary(cli_file *file)
{
    if (snprintf(file->name, sizeof file->name, "%s.XXXXXX", file->path) >= PATH_MAX) {
        errno = ENAMETOOLONG;
        return NULL;
    }
    const int descriptor = mkstemp(file->name);
    if (descriptor < 0) return NULL;
    const mode_t mask = umask(0);
    umask(mask);
    FILE *stream = fchmod(descriptor, 0666 & ~mask) == 0 ? fdopen(descriptor, "w") : NULL;
    if (!stream) {
        close(descriptor);
        unlink(file->name);
    }
    return stream;
}

int cli_file_open(const char *path, cli_file *file)
{
    file->path = path;
    file->stream = open_temporary(file);
    if (file->stream) return EXIT_OK;
    return cli_error(EXIT_IO, "cannot write '%s': %s", path, strerror(errno));
}

int cli_file_close(cli_file *file)
{
    /* Some file systems cannot sync, and say so by these two. */
    const bool whole = !ferror(file->stream) && fflush(file->stream) == 0 &&
                       (fsync(fileno(file->stream)) == 0 || errno == EINVAL || errno == ENOTSUP);
    if (fclose(file->stream) == 0 && whole && rename(file->name, file->path) == 0) return EXIT_OK;
    const int error = errno;
    unlink(file->name);
    return cli_error(EXIT_IO, "cannot write '%s': %s", file->path, strerror(error));
}

int cli_check_outputs(const char *option, const cli_files *files, cli_what what)
{
    int code = EXIT_OK;
    for (int i = 0; i < files->n && code == EXIT_OK; i++) {
        code = cli_check_output(option, files->path[i], what);
    }
    return code;
}
