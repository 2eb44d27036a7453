/* Exit codes, one for each family of library statuses, and errors. */
#include "cli.h"

#include <errno.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <string.h>
#include <unistd.h>

typedef struct exit_code {
    int code;
    int status[2]; /* of the library; 0 where there is none */
    const char *text;
} exit_code;

enum { NO_STATUS = 1 }; /* the library knows none above 0 */

static const exit_code exit_codes[] = {
    {EXIT_OK, {DMK_OK, 0}, "success"},
    {EXIT_USAGE, {DMK_E_ARG, 0}, "a bad option or value"},
    {EXIT_IO, {DMK_E_IO, 0}, "a file cannot be opened, read or written"},
    {3, {DMK_E_FORMAT, 0}, "a malformed or unrecognised file"},
    {4, {DMK_E_MESH, 0}, "the mesh is not a surface this method can treat"},
    {EXIT_DEVICE, {DMK_E_DEVICE, DMK_E_BUILD}, "no OpenCL device, or it failed"},
    {6, {DMK_E_DIVERGED, 0}, "the iteration diverged"},
    {7, {DMK_E_LIMIT, 0}, "the step limit was reached before the tolerance"},
    {EXIT_MEMORY, {DMK_E_NOMEM, 0}, "out of memory"},
    {EXIT_GAP, {NO_STATUS, 0}, "done, but the gap asked for with --gap was not reached"},
    {EXIT_INTERRUPTED, {DMK_E_CANCELLED, 0}, "interrupted (Ctrl-C)"},
};
enum { N_EXIT_CODES = sizeof exit_codes / sizeof *exit_codes };

int cli_exit_code(int status)
{
    for (int i = 0; i < N_EXIT_CODES; i++) {
        const int *known = exit_codes[i].status;
        if (status == known[0] || (known[1] != 0 && status == known[1])) return exit_codes[i].code;
    }
    return EXIT_USAGE;
}

void cli_print_exit_codes(FILE *file)
{
    for (int i = 0; i < N_EXIT_CODES; i++) {
        fprintf(file, "  %-4d %s\n", exit_codes[i].code, exit_codes[i].text);
    }
}

/* As the library knows the standard output. */
static const char *stdout_path = "/dev/stdout";

void cli_call_stdout(const char *path)
{
    stdout_path = path;
}

/* What the library says for every language has names here. */
typedef struct phrase {
    const char *library, *tool;
} phrase;

/* Of a phrase that begins at `words` what the tool says, and how long it is; NULL if none does. */
static const char *translate(const char *words, size_t *length)
{
    const phrase phrases[] = {
        {"a repair does", "--repair does"},
        {"raise max_steps or tolerance", "raise --max-steps or --tolerance"},
        {"try a smaller dt", "try a smaller --dt"},
        {"try a smaller inertia", "try a smaller --inertia"},
        {": atom ", ": point "},
        {"unless a second measure is given", "unless --to is given"},
        {"give a point or line", "give a point, too"},
        {"do not ask for exact distances", "leave out --exact"},
        {"do not ask for that", "leave out --exact"},
        {"ask for the second to be scaled (normalise)", "scale the second one with --normalise"},
        {"the list of devices shows", "`dmkcl devices` shows"},
        {"has no size b; leave it 0", "has no size B; leave it out"},
        {"has no size c; leave it 0", "has no size C; leave it out"},
        {"size a of the", "size A of the"},
        {"size b of the", "size B of the"},
        {"size c of the", "size C of the"},
        {"the tube radius b must be smaller than a,", "the tube radius B must be smaller than A,"},
        {stdout_path, "the standard output"},
    };
    for (size_t i = 0; i < sizeof phrases / sizeof *phrases; i++) {
        *length = strlen(phrases[i].library);
        if (strncmp(words, phrases[i].library, *length) == 0) return phrases[i].tool;
    }
    return NULL;
}

static void print_words(const char *text)
{
    size_t length;
    while (*text) {
        const char *here = translate(text, &length);
        if (here)
            fputs(here, stderr);
        else
            fputc(*text, stderr);
        text += here ? length : 1;
    }
    fputc('\n', stderr);
}

static _Thread_local char words[4096]; /* of the last error */

const char *cli_last_error(void)
{
    return words;
}

int cli_error(int code, const char *format, ...)
{
    const bool colour = isatty(STDERR_FILENO);
    if (code == EXIT_INTERRUPTED && !cli_first_to_tell()) return code;
    flockfile(stderr); /* one line, whoever else has something to say */
    fprintf(stderr, "%sdmkcl:%s ", colour ? "\033[1;31m" : "", colour ? "\033[0m" : "");
    va_list args;
    va_start(args, format);
    vsnprintf(words, sizeof words, format, args);
    va_end(args);
    print_words(words);
    funlockfile(stderr);
    return code;
}

int cli_library_error(const dmk_context *context, int status)
{
    const char *message = context ? dmk_context_message(context) : "";
    if (cli_interrupted()) { /* whatever failed then */
        status = DMK_E_CANCELLED;
        message = "";
    }
    if (!*message) message = dmk_status_text(status);
    return cli_error(cli_exit_code(status), "%s", message);
}

int cli_flush(void)
{
    static atomic_int
        why; /* the first failure: later on the stream knows that there was one, not which */
    int none = 0;
    errno = EIO;
    if (fflush(stdout) == 0 && !ferror(stdout)) return EXIT_OK;
    atomic_compare_exchange_strong(&why, &none, errno);
    return cli_error(EXIT_IO, "cannot write to the standard output: %s", strerror(why));
}
