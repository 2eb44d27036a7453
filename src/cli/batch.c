/* dmkcl solve --sources: one source after another on one mesh, made ready once. */
#include "ranks.h"
#include "solve.h"

#include <stdlib.h>
#include <string.h>

typedef struct batch {
    const solve_request *request;
    const solve_source *source; /* n */
    size_t n, n_solved, n_kept, n_failed;
    bool summary, stop; /* stop: there is no device any more */
    solve_times shared; /* of mesh, device and solver; total: until they were ready */
    int code;           /* of the first failure; without any, of a missed gap */
} batch;

/* ---- the files of source k ------------------------------------------------------------------ */

/* "dir/name.vtp" -> "dir/name-0007.vtp", but a device stays; NULL without memory. */
static char *number_name(const char *path, size_t k)
{
    const size_t n = strlen(path);
    const char *slash = strrchr(path, '/');
    const char *dot = strrchr(slash ? slash : path, '.');
    if (cli_is_stream(path)) return strdup(path);
    const int stem = (int)(dot ? (size_t)(dot - path) : n);
    char *name = malloc(n + 32);
    if (name) snprintf(name, n + 32, "%.*s-%04zu%s", stem, path, k, path + stem);
    return name;
}

static bool number_files(cli_files *files, size_t k)
{
    bool good = true;
    for (int i = 0; i < files->n; i++) {
        files->path[i] = number_name(files->path[i], k);
        good = good && files->path[i];
    }
    return good;
}

static void free_files(cli_files *files)
{
    for (int i = 0; i < files->n; i++) free((char *)files->path[i]);
}

static void free_one(solve_request *one)
{
    free_files(&one->out);
    free_files(&one->locus);
    free_files(&one->tangent);
    if (solve_reports_to_file(one)) free((char *)one->report);
}

static void aim(solve_request *one, const solve_source *s)
{
    one->vertex = s->vertex;
    one->source.n = s->vertex < 0 ? 3 : 0;
    memcpy(one->source.value, s->xyz, sizeof s->xyz);
}

/* The request for source k alone, freed by free_one; false without memory. */
static bool request_one(const batch *b, size_t k, solve_request *one)
{
    *one = *b->request;
    aim(one, &b->source[k]);
    bool good = number_files(&one->out, k);
    good = number_files(&one->locus, k) && good;
    good = number_files(&one->tangent, k) && good;
    if (solve_reports_to_file(one)) one->report = number_name(one->report, k);
    return good && (one->report || !b->request->report);
}

/* Files are whole if they are there. */
static bool is_done(const solve_request *one)
{
    return solve_has_files(one) && (!solve_reports_to_file(one) || cli_is_file(one->report));
}

/* The exit code of a source that was done before, as far as its report says. */
static int code_of_kept(const solve_request *one)
{
    char text[8192];
    FILE *file = solve_reports_to_file(one) ? fopen(one->report, "r") : NULL;
    if (!file) return EXIT_OK;
    const size_t n = fread(text, 1, sizeof text - 1, file);
    text[n] = '\0';
    fclose(file);
    return solve_misses(one, solve_reported_gap(text, n)) ? EXIT_GAP : EXIT_OK;
}

/* ---- the run -------------------------------------------------------------------------------- */

static void print_line(size_t k, const solve_request *one, const solve_run *run)
{
    char point[CLI_TEXT_SIZE], steps[CLI_TEXT_SIZE], away[64] = "";
    double xyz[3] = {0};
    dmk_stats stats;
    dmk_locus_info info;
    dmk_result_get_stats(run->result, &stats);
    dmk_locus_get_info(run->locus, &info);
    dmk_mesh_point_xyz(run->context, run->mesh, &run->source, xyz);
    if (one->vertex < 0)
        snprintf(away, sizeof away, ", %.2g from the point asked for", solve_offset(one, run));
    printf("%04zu  (%s)%s: %s, cost %.8g, gap %.2g %%, cut locus %.6g, loops %lld, ends %zu, "
           "branch points %zu, %.2f s\n",
           k, cli_point(xyz, point), away, cli_counted(stats.steps, "step", "steps", steps),
           stats.cost_upper, 100 * stats.gap, info.length, (long long)info.loops, info.endpoints,
           info.branch_points, run->seconds.total);
}

enum { WHERE_SIZE = 300 };
static void tell_where(const solve_request *request, const solve_source *s, char where[WHERE_SIZE])
{
    snprintf(where, WHERE_SIZE, "%.250s:%lld: ", request->sources, (long long)s->line);
}

static int solve_one(const batch *b, size_t k, const solve_request *one, solve_run *run)
{
    char where[WHERE_SIZE], prefix[64];
    tell_where(one, &b->source[k], where);
    snprintf(prefix, sizeof prefix, "source %zu of %zu: ", k + 1, b->n);
    run->where = where;
    run->progress.prefix = prefix;
    int code = solve_place(one, run);
    if (code == EXIT_OK) code = solve_compute(one, run);
    if (code == EXIT_OK) code = solve_write(one, run);
    if (code == EXIT_OK && b->summary) {
        print_line(k, one, run);
        code = cli_flush();
    }
    if (code == EXIT_OK) code = solve_check_gap(one, run);
    run->where = "";
    run->progress.prefix = NULL;
    return code;
}

/* What is shared counts for the first source that is solved. */
static void begin_source(const batch *b, solve_run *run)
{
    run->seconds = b->n_solved == 0 ? b->shared : (solve_times){0};
    run->seconds.begin = cli_seconds() - run->seconds.total;
}

/* The counts of all ranks. */
static int add_up(batch *b)
{
    const dmk_ranks *ranks = cli_ranks();
    const size_t n = ranks ? (size_t)ranks->size : 1,
                 mine[3] = {b->n_solved, b->n_kept, b->n_failed};
    size_t *all = malloc(n * sizeof mine);
    if (!all) return DMK_E_NOMEM;
    const int rc = cli_ranks_gather(mine, all, sizeof mine);
    for (size_t r = 0; r < n && rc == DMK_OK; r++) {
        if (r == 0) b->n_solved = b->n_kept = b->n_failed = 0;
        b->n_solved += all[3 * r];
        b->n_kept += all[3 * r + 1];
        b->n_failed += all[3 * r + 2];
    }
    free(all);
    return rc;
}

/* A device that failed, or had no room, may fail for ever: the next source has a new one. */
static int solve_next(batch *b, size_t k, const solve_request *one, solve_run *run)
{
    begin_source(b, run);
    int code = run->device ? EXIT_OK : solve_renew(b->request, run);
    b->stop = code != EXIT_OK;
    if (code == EXIT_OK) code = solve_one(b, k, one, run);
    const bool solved = code == EXIT_OK || code == EXIT_GAP;
    b->n_solved += solved;
    b->n_failed += !solved;
    if (code == EXIT_DEVICE || code == EXIT_MEMORY) solve_drop_device(run);
    return code;
}

/* All that is made goes to the standard output, which takes no more: whatever found that has said so. */
static bool is_unheard(const batch *b)
{
    const solve_request *r = b->request;
    return ferror(stdout) && !solve_reports_to_file(r) && r->out.n + r->locus.n + r->tangent.n == 0;
}

/* Each rank takes one source after another. */
static void solve_all(batch *b, solve_run *run)
{
    while (!cli_interrupted() && !b->stop && !is_unheard(b)) {
        const size_t k = cli_ranks_next();
        if (k >= b->n) break;
        solve_request one;
        int code = EXIT_OK;
        if (!request_one(b, k, &one)) {
            code = cli_library_error(NULL, DMK_E_NOMEM);
            b->n_failed++;
        } else if (one.resume && is_done(&one)) {
            if (b->summary) printf("%04zu  kept: its files are there\n", k);
            b->n_kept++;
            code = code_of_kept(&one);
        } else {
            code = solve_next(b, k, &one, run);
        }
        if (code != EXIT_OK && (b->code == EXIT_OK || b->code == EXIT_GAP)) b->code = code;
        free_one(&one);
    }
    const int rc = add_up(b);
    if (rc != DMK_OK && !cli_interrupted()) b->code = cli_ranks_error(rc);
    if (cli_interrupted()) {
        b->code = cli_error(cli_exit_code(DMK_E_CANCELLED), "interrupted; %zu of %zu sources left",
                            b->n - b->n_solved - b->n_kept, b->n);
    }
}

int solve_check_sources(const solve_request *request, solve_run *run, const solve_source *sources,
                        size_t n)
{
    int code = EXIT_OK;
    for (size_t k = 0; k < n && !cli_interrupted(); k++) {
        char where[WHERE_SIZE];
        solve_request one = *request;
        aim(&one, &sources[k]);
        tell_where(request, &sources[k], where);
        run->where = where;
        const int placed = solve_place(&one, run);
        run->where = "";
        if (code == EXIT_OK) code = placed;
    }
    return cli_interrupted() ? solve_fail(run, DMK_E_CANCELLED) : code;
}

static void print_end(const batch *b, double begin)
{
    char n[CLI_TEXT_SIZE], left[CLI_TEXT_SIZE];
    printf("of %s %zu solved, %zu kept, %zu failed%s, %.2f s\n",
           cli_counted((int64_t)b->n, "source", "sources", n), b->n_solved, b->n_kept, b->n_failed,
           cli_left(b->n - b->n_solved - b->n_kept - b->n_failed, left), cli_seconds() - begin);
}

/* The numbered names may be those of the mesh or the list. */
static int check_names(const batch *b)
{
    int code = EXIT_OK;
    for (size_t k = 0; k < b->n && code == EXIT_OK; k++) {
        solve_request one;
        cli_uses uses = {.n = 0};
        if (!request_one(b, k, &one)) code = cli_library_error(NULL, DMK_E_NOMEM);
        solve_request_uses(&one, &uses);
        if (code == EXIT_OK) code = cli_check_uses(&uses);
        free_one(&one);
    }
    return code;
}

int solve_batch(const solve_request *request)
{
    solve_run run;
    solve_source *sources;
    batch b = {
        .request = request,
        .summary = solve_prints_summary(request),
    };
    int code = solve_read_sources(request->sources, &sources, &b.n);
    if (code != EXIT_OK) return code;
    b.source = sources;
    code = check_names(&b);
    if (code != EXIT_OK) {
        free(sources);
        return code;
    }
    b.code = solve_begin(request, &run);
    if (b.code == EXIT_OK) {
        const double begin = run.seconds.begin;
        b.shared = run.seconds;
        b.shared.total = cli_seconds() - begin;
        cli_progress_end(&run.progress);
        if (b.summary) solve_summary_mesh(request, &run);
        code = cli_flush();
        cli_ranks_speak();
        solve_all(&b, &run);
        cli_progress_end(&run.progress);
        const bool said = is_unheard(&b);
        if (b.summary && cli_ranks_first()) print_end(&b, begin);
        if (code == EXIT_OK && !said) code = cli_flush();
    }
    solve_end(&run);
    free(sources);
    return b.code != EXIT_OK ? b.code : code;
}
