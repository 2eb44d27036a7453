/* Options that have no effect beside others, or without them. What hangs on their values, as --dt on the --method, is
 * seen where these are used; of the ways to give a source each command speaks itself. */
#include "cli.h"

#include <string.h>

/* Of the commands that have both. */
static const struct {
    const char *option, *beside;
    const char *why; /* "--option WHY: leave out --beside"; NULL: either may be meant */
} clashes[] = {
    {"quiet", "verbose", NULL},
    {"exact", "tolerance", NULL},
    {"to", "to-vertex", NULL},
    {"locus", "border", "needs points as sources"},
    {"density-only", "locus", "makes no cut locus"},
    {"density-only", "tangent", "makes no cut locus"},
    {"density-only", "strength", "makes no cut locus"},
    {"density-only", "threshold", "marks no approximate cut locus"},
    {"density-only", "start", "always starts from mu = 1"},
    {"density-only", "sources", "goes with one source"},
};

static const struct {
    const char *command; /* NULL: all that have the option */
    const char *option;
    const char *needs[2]; /* one of these, or the one */
} needs[] = {
    {NULL, "format", {"out", "locus"}},
    {NULL, "normalise", {"to", NULL}},
    {"distance", "strength", {"locus", NULL}},
    {"solve", "resume", {"sources", NULL}},
};

static bool has(const cli_syntax *syntax, const char *name, size_t *number)
{
    for (*number = 0; name && *number < syntax->n_options; ++*number) {
        if (strcmp(syntax->options[*number].name, name) == 0) return true;
    }
    return false;
}

static bool is_given(const cli_syntax *syntax, const bool *given, const char *name)
{
    size_t number;
    return has(syntax, name, &number) && given[number];
}

static int check_clashes(const cli_syntax *syntax, const bool *given)
{
    for (size_t i = 0; i < sizeof clashes / sizeof *clashes; i++) {
        const char *option = clashes[i].option, *beside = clashes[i].beside;
        if (!is_given(syntax, given, option) || !is_given(syntax, given, beside)) continue;
        if (!clashes[i].why)
            return cli_error(EXIT_USAGE, "%s: give --%s or --%s, not both", syntax->command, option,
                             beside);
        return cli_error(EXIT_USAGE, "%s: --%s %s: leave out --%s", syntax->command, option,
                         clashes[i].why, beside);
    }
    return CLI_GO_ON;
}

static int check_needs(const cli_syntax *syntax, const bool *given)
{
    for (size_t i = 0; i < sizeof needs / sizeof *needs; i++) {
        const char *command = needs[i].command, *const *other = needs[i].needs;
        if (command && strcmp(command, syntax->command) != 0) continue;
        if (!is_given(syntax, given, needs[i].option) || is_given(syntax, given, other[0]) ||
            is_given(syntax, given, other[1]))
            continue;
        size_t number;
        const bool either = has(syntax, other[1], &number);
        return cli_error(EXIT_USAGE, "%s: --%s has no effect without --%s%s%s", syntax->command,
                         needs[i].option, other[0], either ? " or --" : "", either ? other[1] : "");
    }
    return CLI_GO_ON;
}

int cli_check_pairs(const cli_syntax *syntax, const bool *given)
{
    const int code = check_clashes(syntax, given);
    return code == CLI_GO_ON ? check_needs(syntax, given) : code;
}
