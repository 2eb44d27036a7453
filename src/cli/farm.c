/* The workers of a batch. Each takes one mesh after another, reads it, solves, writes, and reports: so
 * meshes are read and written while others are solved, and each worker's host stages need one thread.
 * Meshes that are large have all threads, one mesh at a time, or memory would not do. */
#include "batch.h"
#include "ranks.h"

#include <math.h>
#include <pthread.h>
#include <sched.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

/* Bytes of a mesh file from which on it has all threads: about half a million triangles, of which a run
 * takes half a gigabyte and keeps all threads busy. */
enum { LARGE = 32 << 20, MOST_WORKERS = 64 };

typedef struct farm {
    const batch_request *request;
    batch_list *list;
    batch_record *record;
    size_t n_sources; /* of each mesh */
    uint8_t *kept;    /* n_sources for each mesh: its line stays */
    int threads;      /* of the host; 0: one for each processor */
    bool summary;     /* a line for each source on the standard output */
    cli_progress progress;
    double begin;
    atomic_size_t next; /* mesh that nobody has taken */
    atomic_int code;    /* of the first failure */
    atomic_bool began;  /* a worker had memory to */
    atomic_bool missed; /* a gap; this changes the exit code of a run without failures */
    atomic_bool stop;   /* nothing can be done any more */
    size_t n_done, n_kept, n_failed;
    pthread_mutex_t large, opening, printing;
} farm;

typedef struct worker {
    farm *farm;
    dmk_context *context;
    dmk_device *device;
    cli_progress silent; /* for cancelling */
} worker;

/* ---- what is wanted ------------------------------------------------------------------------- */

enum { WANTED_SIZE = 96 };

static batch_entry entry_of(const farm *f, size_t mesh, size_t source, char wanted[WANTED_SIZE])
{
    const solve_request *each = &f->request->each;
    const double *x = each->source.value;
    if (f->request->samples > 0)
        snprintf(wanted, WANTED_SIZE, "sample %zu from vertex %lld", source,
                 (long long)each->vertex);
    else if (each->source.n > 0)
        snprintf(wanted, WANTED_SIZE, "%.17g,%.17g,%.17g", x[0], x[1], x[2]);
    else
        snprintf(wanted, WANTED_SIZE, "vertex %lld", (long long)each->vertex);
    return (batch_entry){mesh, source, wanted};
}

static uint8_t *kept(const farm *f, size_t mesh, size_t source)
{
    return &f->kept[mesh * f->n_sources + source];
}

/* A word on standard output, or on standard error where that is taken by the report. */
static void print_word(farm *f, const char *name, size_t source, const char *text)
{
    if (f->request->each.quiet) return;
    char number[BATCH_NUMBER_SIZE];
    batch_number(f->request->samples > 0, source, number);
    fprintf(f->summary ? stdout : stderr, "%s%s: %s\n", name, number, text);
}

/* Judge the lines of a mesh that was done before. */
static void check_mesh(worker *w, size_t k)
{
    farm *f = w->farm;
    batch_mesh *mesh = &f->list->mesh[k];
    /* Without one all its lines go, for its reader will say why. */
    cli_digest_file(mesh->path, mesh->digest);
    pthread_mutex_lock(&f->printing);
    for (size_t i = 0; i < f->n_sources; i++) {
        char wanted[WANTED_SIZE], text[96];
        const batch_entry entry = entry_of(f, k, i, wanted);
        double gap = NAN;
        const char *why = batch_record_check(f->record, &entry, &gap);
        if (!why && solve_misses(&f->request->each, gap)) atomic_store(&f->missed, true);
        *kept(f, k, i) = !why;
        f->n_kept += !why;
        if (!why || !*why) continue;
        snprintf(text, sizeof text, "done again: %s", why);
        print_word(f, mesh->name, i, text);
    }
    pthread_mutex_unlock(&f->printing);
}

/* ---- one source ----------------------------------------------------------------------------- */

/* The last error of this thread, without the file's name. */
static const char *error_of(const solve_run *run)
{
    const char *error = cli_last_error();
    const size_t n = strlen(run->where);
    return strncmp(error, run->where, n) == 0 ? error + n : error;
}

static int append(farm *f, const batch_entry *entry, const solve_request *one, const solve_run *run,
                  int code)
{
    char *line = NULL;
    size_t length = 0;
    FILE *stream = open_memstream(&line, &length);
    if (!stream) return cli_library_error(NULL, DMK_E_NOMEM);
    cli_json json = {.file = stream, .one_line = true};
    json_open(&json, NULL, '{');
    batch_record_fields(f->record, &json, entry, code != EXIT_OK);
    if (code == EXIT_OK) {
        solve_report_fields(&json, one, run);
    } else {
        json_text(&json, "file", one->mesh);
        json_integer(&json, "code", code);
        json_text(&json, "error", error_of(run));
    }
    json_close(&json, '{');
    int result = fclose(stream) == 0 ? EXIT_OK : cli_library_error(NULL, DMK_E_NOMEM);
    if (result == EXIT_OK) result = batch_record_append(f->record, line, length);
    free(line);
    return result;
}

static void tell_solved(farm *f, const batch_entry *entry, const solve_request *one,
                        const solve_run *run)
{
    char text[256], steps[CLI_TEXT_SIZE], away[64] = "";
    dmk_stats stats;
    dmk_locus_info info;
    dmk_result_get_stats(run->result, &stats);
    dmk_locus_get_info(run->locus, &info);
    if (one->source.n > 0)
        snprintf(away, sizeof away, ", source %.2g from the point asked for",
                 solve_offset(one, run));
    snprintf(text, sizeof text, "%s, cost %.8g, gap %.2g %%, cut locus %.6g%s, %.3f s",
             cli_counted(stats.steps, "step", "steps", steps), stats.cost_upper, 100 * stats.gap,
             info.length, away, run->seconds.total);
    if (f->summary) print_word(f, f->list->mesh[entry->mesh].name, entry->source, text);
}

static size_t count_kept(const farm *f, size_t mesh)
{
    size_t n = 0;
    for (size_t i = 0; i < f->n_sources; i++) n += *kept(f, mesh, i);
    return n;
}

/* The first one gives the exit code. */
static void note_failure(farm *f, int code)
{
    int none = EXIT_OK;
    atomic_compare_exchange_strong(&f->code, &none, code);
}

/* Count what became of a source, or of `n` in a mesh that failed, and put it down. */
static void finish(farm *f, const batch_entry *entry, size_t n, const solve_request *one,
                   const solve_run *run, int code)
{
    if (code == cli_exit_code(DMK_E_CANCELLED)) return;
    const int written = append(f, entry, one, run, code);
    if (written != EXIT_OK) atomic_store(&f->stop, true);
    note_failure(f, written != EXIT_OK ? written : code);
    if (code == EXIT_OK && solve_check_gap(one, run) != EXIT_OK) atomic_store(&f->missed, true);
    pthread_mutex_lock(&f->printing);
    f->n_done += code == EXIT_OK;
    f->n_failed += code != EXIT_OK ? n : 0;
    if (code == EXIT_OK && written == EXIT_OK) tell_solved(f, entry, one, run);
    if (f->progress.line) {
        char text[96];
        const size_t all = f->list->n * f->n_sources;
        snprintf(text, sizeof text, "%zu of %zu done, %zu failed, %.1f s", f->n_done + f->n_kept,
                 all, f->n_failed, cli_seconds() - f->begin);
        cli_progress_say(&f->progress, text);
    }
    pthread_mutex_unlock(&f->printing);
}

/* The sources of a mesh: run->source becomes number i. */
static int find_source(const farm *f, const int64_t *sample, size_t i, solve_run *run)
{
    const solve_request *each = &f->request->each;
    if (sample) return dmk_mesh_vertex_point(run->context, run->mesh, sample[i], &run->source);
    if (each->source.n > 0)
        return cli_project(run->context, run->mesh, each->source.value, each->quiet, &run->source);
    return dmk_repairs_vertex_point(run->context, run->mesh, &run->repairs, each->vertex,
                                    &run->source);
}

static int do_source(farm *f, const int64_t *sample, size_t i, const solve_request *one,
                     solve_run *run)
{
    int code = EXIT_OK;
    const int rc = find_source(f, sample, i, run);
    if (rc != DMK_OK) return solve_fail(run, rc);
    for (int k = 0; k < one->out.n && code == EXIT_OK; k++)
        code = batch_make_folders(one->out.path[k]);
    for (int k = 0; k < one->locus.n && code == EXIT_OK; k++)
        code = batch_make_folders(one->locus.path[k]);
    for (int k = 0; k < one->tangent.n && code == EXIT_OK; k++)
        code = batch_make_folders(one->tangent.path[k]);
    if (code == EXIT_OK) code = solve_compute(one, run);
    if (code == EXIT_OK) code = solve_write(one, run);
    return code;
}

/* ---- one mesh ------------------------------------------------------------------------------- */

/* Mesh, solver, and the samples if they are wanted. */
static int make_ready(farm *f, const batch_mesh *mesh, solve_run *run, int64_t **sample)
{
    const double begin = cli_seconds();
    const size_t n = f->n_sources;
    const cli_reading how = {.repair = f->request->each.repair,
                             .quiet = f->request->each.quiet,
                             .progress = &run->progress};
    int rc = cli_read_mesh(run->context, mesh->path, &how, &run->repairs, &run->mesh);
    if (rc != DMK_OK) run->where = ""; /* the message names the file */
    if (rc == DMK_OK) rc = dmk_solver_create(run->context, run->device, run->mesh, &run->solver);
    if (rc == DMK_OK && f->request->samples > 0) {
        const int64_t first = f->request->each.vertex;
        const int32_t *now = run->repairs.vertex_new;
        *sample = calloc(n, sizeof **sample);
        if (!*sample) return cli_library_error(NULL, DMK_E_NOMEM);
        rc = dmk_repairs_vertex_point(run->context, run->mesh, &run->repairs, first, &run->source);
        if (rc == DMK_OK)
            rc = dmk_mesh_sample(run->context, run->mesh, n, now ? now[first] : first, *sample);
    }
    run->seconds.read = cli_seconds() - begin;
    return rc == DMK_OK ? EXIT_OK : solve_fail(run, rc);
}

/* Whether the device failed, or had no room. */
static bool do_sources(worker *w, size_t k, solve_run *run)
{
    farm *f = w->farm;
    bool lost = false;
    int64_t *sample = NULL;
    char wanted[WANTED_SIZE];
    solve_request one = {.mesh = f->list->mesh[k].path};
    int code = make_ready(f, &f->list->mesh[k], run, &sample);
    for (size_t i = 0; i < f->n_sources && !cli_interrupted() && !atomic_load(&f->stop); i++) {
        if (*kept(f, k, i)) continue;
        const batch_entry entry = entry_of(f, k, i, wanted);
        const bool bad_mesh = code != EXIT_OK;
        if (!bad_mesh && !batch_name_files(f->request, &f->list->mesh[k], i, &one))
            code = cli_library_error(NULL, DMK_E_NOMEM);
        if (!bad_mesh && code == EXIT_OK) code = do_source(f, sample, i, &one, run);
        finish(f, &entry, bad_mesh ? f->n_sources - count_kept(f, k) : 1, &one, run, code);
        lost = lost || code == EXIT_DEVICE || code == EXIT_MEMORY;
        batch_free_files(&one);
        if (bad_mesh) break; /* one line for all its sources */
        code = EXIT_OK;
        run->seconds = (solve_times){.begin = cli_seconds()};
    }
    free(sample);
    return lost;
}

static int open_device(worker *w)
{
    farm *f = w->farm;
    pthread_mutex_lock(&f->opening); /* kernels that the first one builds the next one finds */
    const int rc = cli_device_open(w->context, &f->request->each.device, &w->device);
    pthread_mutex_unlock(&f->opening);
    return rc == DMK_OK ? EXIT_OK : cli_library_error(w->context, rc);
}

static void do_mesh(worker *w, size_t k)
{
    farm *f = w->farm;
    batch_mesh *mesh = &f->list->mesh[k];
    struct stat file;
    if (count_kept(f, k) == f->n_sources) return;
    const int opened = w->device ? EXIT_OK : open_device(w);
    if (opened != EXIT_OK) {
        note_failure(f, opened);
        atomic_store(&f->stop, true);
        return;
    }
    if (!mesh->digest[0]) cli_digest_file(mesh->path, mesh->digest);
    const bool large = stat(mesh->path, &file) == 0 && file.st_size >= LARGE;
    if (large) pthread_mutex_lock(&f->large);
    dmk_context_set_threads(w->context, large || f->list->n == 1 ? f->threads : 1);
    char where[320];
    snprintf(where, sizeof where, "%.300s: ", mesh->path);
    solve_run run = {.context = w->context,
                     .device = w->device,
                     .where = where,
                     .seconds.begin = cli_seconds(),
                     .progress.gap = NAN};
    dmk_device_get_info(run.device, &run.opened);
    const bool lost = do_sources(w, k, &run);
    dmk_locus_destroy(&run.locus);
    dmk_result_destroy(&run.result);
    dmk_solver_destroy(&run.solver);
    dmk_mesh_destroy(&run.mesh);
    dmk_repairs_free(&run.repairs);
    if (lost)
        dmk_device_destroy(&w->device); /* it may fail for ever: the next mesh has a new one */
    if (large) pthread_mutex_unlock(&f->large);
}

/* ---- workers -------------------------------------------------------------------------------- */

typedef struct pool {
    farm *farm;
    bool dealt; /* each mesh to one of the ranks, not to each of them */
    void (*task)(worker *w, size_t mesh);
} pool;

static void *work(void *argument)
{
    const pool *c = argument;
    farm *f = c->farm;
    worker w = {.farm = f, .silent.gap = NAN};
    if (dmk_context_create(&w.context) != DMK_OK) return NULL; /* the others do its part */
    atomic_store(&f->began, true);
    cli_watch(w.context, &w.silent);
    while (!cli_interrupted() && !atomic_load(&f->stop)) {
        const size_t k = c->dealt ? cli_ranks_next() : atomic_fetch_add(&f->next, 1);
        if (k >= f->list->n) break;
        c->task(&w, k);
    }
    dmk_device_destroy(&w.device);
    dmk_context_destroy(&w.context);
    return NULL;
}

static int count_workers(const farm *f)
{
    cpu_set_t allowed;
    int n = f->threads;
    if (n <= 0) n = sched_getaffinity(0, sizeof allowed, &allowed) == 0 ? CPU_COUNT(&allowed) : 1;
    if (n > MOST_WORKERS) n = MOST_WORKERS;
    return (size_t)n < f->list->n ? n : (int)f->list->n;
}

/* Call task for every mesh. */
static void for_all(farm *f, bool dealt, void (*task)(worker *w, size_t mesh))
{
    pthread_t thread[MOST_WORKERS];
    pool c = {f, dealt, task};
    const int n = count_workers(f);
    int started = 1;
    atomic_store(&f->next, 0);
    atomic_store(&f->began, false);
    while (started < n && pthread_create(&thread[started], NULL, work, &c) == 0) started++;
    work(&c);
    for (int i = 1; i < started; i++) pthread_join(thread[i], NULL);
}

static int end(farm *f)
{
    const size_t all = f->list->n * f->n_sources;
    const size_t left = all - f->n_done - f->n_kept - f->n_failed;
    cli_progress_end(&f->progress);
    if (f->summary) {
        char sources[CLI_TEXT_SIZE], meshes[CLI_TEXT_SIZE], rest[CLI_TEXT_SIZE];
        printf("of %s on %s %zu solved, %zu kept, %zu failed%s, %.2f s\n",
               cli_counted((int64_t)all, "source", "sources", sources),
               cli_counted((int64_t)f->list->n, "mesh", "meshes", meshes), f->n_done, f->n_kept,
               f->n_failed, cli_left(left, rest), cli_seconds() - f->begin);
    }
    const int flushed = cli_flush();
    if (cli_interrupted()) {
        if (cli_has_last_word())
            fprintf(stderr, "dmkcl: interrupted; %zu of %zu left%s\n", all - f->n_done - f->n_kept,
                    all,
                    solve_reports_to_file(&f->request->each) ? ": --resume does the rest" : "");
        return cli_exit_code(DMK_E_CANCELLED);
    }
    if (atomic_load(&f->code) != EXIT_OK) return atomic_load(&f->code);
    if (left > 0 && cli_ranks_first() && !atomic_load(&f->began))
        return cli_library_error(NULL, DMK_E_NOMEM);
    return flushed == EXIT_OK && atomic_load(&f->missed) ? EXIT_GAP : flushed;
}

/* The first rank's part: the report, and what of it can stay. */
static int begin(farm *f)
{
    const batch_request *request = f->request;
    int code = batch_record_open(request, f->list, &f->record);
    if (code == EXIT_OK) code = batch_check_names(request, f->list);
    if (code == EXIT_OK && request->each.resume) for_all(f, false, check_mesh);
    if (code == EXIT_OK && !cli_interrupted()) code = batch_record_begin(f->record);
    return code;
}

/* The other ranks learn the code that the first one's part came to and what is done already, and append to the same
 * report. */
static int join(farm *f, int code)
{
    const dmk_ranks *ranks = cli_ranks();
    if (!ranks) return code;
    const size_t n = f->list->n * f->n_sources + 1;
    f->kept[n - 1] = (uint8_t)code;
    size_t *bytes = calloc((size_t)ranks->size, sizeof *bytes);
    uint8_t *kept = malloc(n);
    int rc = DMK_E_NOMEM;
    if (bytes && kept) {
        bytes[0] = n;
        rc = ranks->gather(ranks->user, f->kept, kept, bytes);
        if (rc == DMK_OK) memcpy(f->kept, kept, n);
    }
    free(bytes);
    free(kept);
    if (rc != DMK_OK) return cli_ranks_error(rc < 0 ? rc : DMK_E_DEVICE);
    if (f->kept[n - 1] != EXIT_OK) return f->kept[n - 1];
    cli_ranks_speak();
    return cli_ranks_first() ? EXIT_OK : batch_record_join(f->request, f->list, &f->record);
}

/* The counts of all ranks, to the first one's. */
static int add_up(farm *f)
{
    const dmk_ranks *ranks = cli_ranks();
    const size_t n = ranks ? (size_t)ranks->size : 1, mine[2] = {f->n_done, f->n_failed};
    size_t *all = malloc(n * sizeof mine);
    int rc = all ? cli_ranks_gather(mine, all, sizeof mine) : DMK_E_NOMEM;
    for (size_t r = 1; r < n && rc == DMK_OK && cli_ranks_first(); r++) {
        f->n_done += all[2 * r];
        f->n_failed += all[2 * r + 1];
    }
    free(all);
    f->summary = f->summary && cli_ranks_first();
    return rc == DMK_OK || rc == DMK_E_CANCELLED ? EXIT_OK : cli_ranks_error(rc);
}

int batch_run(const batch_request *request, batch_list *list)
{
    const bool to_stdout = !solve_reports_to_file(&request->each);
    farm f = {.request = request,
              .list = list,
              .threads = request->each.device.threads,
              .n_sources = request->samples > 0 ? (size_t)request->samples : 1,
              .summary = !request->each.quiet && !to_stdout,
              .begin = cli_seconds()};
    f.progress = (cli_progress){.line = !request->each.quiet && isatty(STDERR_FILENO) &&
                                        (to_stdout || !isatty(STDOUT_FILENO)),
                                .gap = NAN};
    f.kept = calloc(list->n * f.n_sources + 1, 1);
    if (!f.kept) return cli_library_error(NULL, DMK_E_NOMEM);
    pthread_mutex_init(&f.large, NULL);
    pthread_mutex_init(&f.opening, NULL);
    pthread_mutex_init(&f.printing, NULL);
    int code = join(&f, cli_ranks_first() ? begin(&f) : EXIT_OK);
    if (code == EXIT_OK) {
        cli_keep_last_word(to_stdout ? "dmkcl: interrupted\n"
                                     : "dmkcl: interrupted: --resume does what is left\n");
        for_all(&f, true, do_mesh);
        code = add_up(&f);
        if (code == EXIT_OK) code = end(&f);
    }
    batch_record_close(&f.record);
    pthread_mutex_destroy(&f.large);
    pthread_mutex_destroy(&f.opening);
    pthread_mutex_destroy(&f.printing);
    free(f.kept);
    return code;
}
