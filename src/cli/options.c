/* The command line as a table of options: parsing, checking, help. */
#include "cli.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* ---- nearest word --------------------------------------------------------------------------- */

static size_t smaller(size_t a, size_t b)
{
    return a < b ? a : b;
}

/* Edit distance (insert, delete, replace), for words shorter than 64; longer ones are far. */
static size_t edit_distance(const char *a, const char *b)
{
    const size_t n = strlen(a), m = strlen(b);
    if (n >= 64 || m >= 64) return 64;
    size_t row[64]; /* m + 1: distance of the first i letters of a to the first j of b */
    for (size_t j = 0; j <= m; j++) row[j] = j;
    for (size_t i = 1; i <= n; i++) {
        size_t diagonal = row[0];
        row[0] = i;
        for (size_t j = 1; j <= m; j++) {
            const size_t replace = diagonal + (a[i - 1] != b[j - 1]);
            diagonal = row[j];
            row[j] = smaller(replace, 1 + smaller(row[j], row[j - 1]));
        }
    }
    return row[m];
}

const char *cli_nearest(const char *word, const char *const *names)
{
    const char *nearest = NULL;
    size_t best = 1 + strlen(word) / 2; /* farther than that is not a slip of the finger */
    if (best > 4) best = 4;
    for (; *names; names++) {
        const size_t d = edit_distance(word, *names);
        if (d < best) {
            best = d;
            nearest = *names;
        }
    }
    return nearest;
}

/* ---- values --------------------------------------------------------------------------------- */

static const char *skip_blanks(const char *text)
{
    return text + strspn(text, " \t");
}

/* A whole, finite number up to `end_mark` (',' or 0); *next is then behind it. Around commas there may be blanks. */
static bool read_number(const char *text, char end_mark, double *value, const char **next)
{
    char *last;
    if (end_mark == ',') text = skip_blanks(text);
    if (*text == ' ' || *text == '\t') return false;
    *value = cli_decimal(text, &last);
    if (last == text || !isfinite(*value)) return false;
    const char *end = end_mark == ',' ? skip_blanks(last) : last;
    if (*end != end_mark && *end != '\0') return false;
    *next = *end ? end + 1 : end;
    return *end != ',' || **next != '\0';
}

static bool read_numbers(const char *text, cli_numbers *numbers)
{
    numbers->n = 0;
    do {
        if (numbers->n == 3 || !read_number(text, ',', &numbers->value[numbers->n], &text)) {
            return false;
        }
        numbers->n++;
    } while (*text);
    return true;
}

static bool read_integer(const char *text, double lo, double hi, int64_t *value)
{
    char *end;
    if (*text == ' ' || *text == '\t' || *text == '+') return false;
    const long long n = strtoll(text, &end, 10);
    if (end == text || *end || (double)n < lo || (double)n > hi) return false;
    *value = n;
    return true;
}

static bool read_choice(const char *text, const char *const *choices, int *value)
{
    for (int i = 0; choices[i]; i++) {
        if (strcmp(text, choices[i]) == 0) {
            *value = i;
            return true;
        }
    }
    return false;
}

static int bad_value(const cli_option *option, const char *text, const char *expected)
{
    return cli_error(EXIT_USAGE, "--%s: '%s' is not %s%s", option->name, text, expected,
                     option->hint ? option->hint : "");
}

/* The bounds are said with what is expected. */
static int set_integer(const cli_option *option, const char *text)
{
    char range[64];
    if (read_integer(text, option->lo, option->hi, option->target)) return CLI_GO_ON;
    snprintf(range, sizeof range, "%s from %.0f to %.0f", option->expected, option->lo, option->hi);
    return bad_value(option, text, range);
}

static int set_choice(const cli_option *option, const char *text)
{
    if (read_choice(text, option->choices, option->target)) return CLI_GO_ON;
    char list[256] = "one of";
    for (int i = 0; option->choices[i]; i++) {
        strncat(list, i ? ", " : " ", sizeof list - strlen(list) - 1);
        strncat(list, option->choices[i], sizeof list - strlen(list) - 1);
    }
    return bad_value(option, text, list);
}

static int add_file(const cli_option *option, const char *text)
{
    cli_files *files = option->target;
    if (!*text) return bad_value(option, text, "a file name");
    if (files->n == CLI_MAX_FILES) {
        return cli_error(EXIT_USAGE, "--%s: given more than %d times", option->name, CLI_MAX_FILES);
    }
    files->path[files->n++] = text;
    return CLI_GO_ON;
}

static int set_point(const cli_option *option, const char *text)
{
    cli_numbers *numbers = option->target;
    numbers->n = 3;
    if (cli_read_point(text, numbers->value)) return CLI_GO_ON;
    return bad_value(option, text, "a point X,Y,Z; write three numbers joined by commas, as 3,0,0");
}

static int set_sizes(const cli_option *option, const char *text)
{
    cli_numbers *numbers = option->target;
    bool good = read_numbers(text, numbers);
    for (int i = 0; i < numbers->n; i++) good = good && numbers->value[i] > 0;
    return good ? CLI_GO_ON : bad_value(option, text, "one to three sizes above 0, as A[,B[,C]]");
}

/* CLI_GO_ON or EXIT_USAGE. */
static int set_value(const cli_option *option, const char *text)
{
    double number;
    const char *end;
    switch (option->kind) {
    case CLI_FLAG: *(bool *)option->target = true; return CLI_GO_ON;
    case CLI_INTEGER: return set_integer(option, text);
    case CLI_NUMBER:
        if (!read_number(text, '\0', &number, &end) || number < option->lo || number > option->hi) {
            return bad_value(option, text, option->expected);
        }
        *(double *)option->target = number;
        return CLI_GO_ON;
    case CLI_POINT: return set_point(option, text);
    case CLI_SIZES: return set_sizes(option, text);
    case CLI_TEXT: *(const char **)option->target = text; return CLI_GO_ON;
    case CLI_FILES: return add_file(option, text);
    case CLI_CHOICE: return set_choice(option, text);
    }
    return CLI_GO_ON;
}

/* ---- help ----------------------------------------------------------------------------------- */

static void print_option(const char *name, const char *value, const char *help)
{
    char left[64];
    snprintf(left, sizeof left, "--%s%s%s", name, value ? " " : "", value ? value : "");
    printf("  %-22s ", left);
    for (; *help; help++) { /* further lines of the help stand under the first */
        putchar(*help);
        if (*help == '\n') printf("%25s", "");
    }
    putchar('\n');
}

static int print_help(const cli_syntax *syntax)
{
    printf("usage: dmkcl %s %s\n\n%s\n\noptions:\n", syntax->command, syntax->usage,
           syntax->summary);
    for (size_t i = 0; i < syntax->n_options; i++) {
        const cli_option *o = &syntax->options[i];
        print_option(o->name, o->value, o->help);
    }
    print_option("help", NULL, "this text");
    if (syntax->notes) printf("\n%s\n", syntax->notes);
    return cli_flush();
}

/* ---- parsing -------------------------------------------------------------------------------- */

static int unknown_option(const cli_syntax *syntax, const char *name, size_t length)
{
    const char *names[CLI_MAX_OPTIONS + 1] = {NULL};
    for (size_t i = 0; i < syntax->n_options; i++) names[i] = syntax->options[i].name;
    char word[64];
    snprintf(word, sizeof word, "%.*s", (int)length, name);
    const char *nearest = cli_nearest(word, names);
    if (nearest) {
        return cli_error(EXIT_USAGE, "%s: no option '--%s'; did you mean '--%s'?", syntax->command,
                         word, nearest);
    }
    return cli_error(EXIT_USAGE, "%s: no option '--%s'; `dmkcl %s --help` lists them",
                     syntax->command, word, syntax->command);
}

static const cli_option *find_option(const cli_syntax *syntax, const char *name, size_t length)
{
    for (size_t i = 0; i < syntax->n_options; i++) {
        const cli_option *o = &syntax->options[i];
        if (strlen(o->name) == length && strncmp(o->name, name, length) == 0) return o;
    }
    return NULL;
}

/* Of two values one would be lost, without a word which; a flag says the same thing twice. */
static bool is_repeated(const cli_option *option, bool *given)
{
    const bool before = *given;
    *given = true;
    return before && option->kind != CLI_FLAG && option->kind != CLI_FILES;
}

/* argv[*i] begins with "--": take it, and its value from behind '=' or from the next argument. */
static int take_option(const cli_syntax *syntax, int argc, char **argv, int *i, bool *given)
{
    const char *name = argv[*i] + 2;
    const char *equals = strchr(name, '=');
    const size_t length = equals ? (size_t)(equals - name) : strlen(name);
    const cli_option *option = find_option(syntax, name, length);
    if (!option) return unknown_option(syntax, name, length);
    if (is_repeated(option, &given[option - syntax->options]))
        return cli_error(EXIT_USAGE, "--%s: given twice; give it once", option->name);
    if (option->kind == CLI_FLAG) {
        if (!equals) return set_value(option, NULL);
        return cli_error(EXIT_USAGE, "--%s: takes no value", option->name);
    }
    if (equals) return set_value(option, equals + 1);
    if (*i + 1 == argc) {
        return cli_error(EXIT_USAGE, "--%s: its value %s is missing", option->name, option->value);
    }
    *i += 1;
    return set_value(option, argv[*i]);
}

static int take_operand(const cli_syntax *syntax, const char *text, const char **operand)
{
    if (!*text) return cli_error(EXIT_USAGE, "%s: '' is not a name", syntax->command);
    if (!syntax->operands && strcmp(text, "-") == 0) text = "/dev/stdin";
    if (syntax->operands) syntax->operands->word[syntax->operands->n++] = text;
    if (syntax->operands && *operand) return CLI_GO_ON;
    if (!syntax->operand || *operand) {
        return cli_error(EXIT_USAGE, "%s: '%s' is one argument too many", syntax->command, text);
    }
    *operand = text;
    return CLI_GO_ON;
}

int cli_parse(const cli_syntax *syntax, int argc, char **argv, const char **operand)
{
    const char *none = NULL;
    if (!operand) operand = &none;
    *operand = NULL;
    if (syntax->operands) *syntax->operands = (cli_words){.word = (const char **)argv};
    bool only_operands = false; /* behind "--" */
    bool given[CLI_MAX_OPTIONS] = {false};
    for (int i = 1; i < argc; i++) {
        int code;
        if (!only_operands && strcmp(argv[i], "--") == 0) {
            only_operands = true;
            continue;
        } else if (!only_operands &&
                   (strcmp(argv[i], "--help") == 0 || strcmp(argv[i], "-h") == 0)) {
            return print_help(syntax);
        } else if (!only_operands && strncmp(argv[i], "--", 2) == 0) {
            code = take_option(syntax, argc, argv, &i, given);
        } else if (!only_operands && argv[i][0] == '-' && argv[i][1]) {
            code = cli_error(EXIT_USAGE, "%s: no option '%s'; options begin with two dashes",
                             syntax->command, argv[i]);
        } else {
            code = take_operand(syntax, argv[i], operand);
        }
        if (code != CLI_GO_ON) return code;
    }
    if (syntax->operand && !*operand) {
        return cli_error(EXIT_USAGE, "%s: %s is missing; usage: dmkcl %s %s", syntax->command,
                         syntax->operand, syntax->command, syntax->usage);
    }
    return cli_check_pairs(syntax, given);
}
