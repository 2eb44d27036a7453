/* Ranks by MPI, where the tool is built with it (make MPI=1), else one process: see ranks.h. The only file that
 * knows MPI. */
#include "ranks.h"

int cli_ranks_error(int rc)
{
    if (rc != DMK_E_DEVICE || cli_interrupted()) return cli_library_error(NULL, rc);
    return cli_error(cli_exit_code(rc), "a rank was lost");
}

#ifndef DMK_MPI

#include <stdatomic.h>
#include <string.h>

void cli_ranks_begin(int *argc, char ***argv)
{
    (void)argc;
    (void)argv;
}

int cli_ranks_end(int code)
{
    return code;
}

const dmk_ranks *cli_ranks(void)
{
    return NULL;
}

bool cli_ranks_first(void)
{
    return true;
}

void cli_ranks_speak(void) {}

size_t cli_ranks_next(void)
{
    static atomic_size_t next;
    return atomic_fetch_add(&next, 1);
}

int cli_ranks_gather(const void *mine, void *all, size_t bytes)
{
    memcpy(all, mine, bytes);
    return DMK_OK;
}

#else

#include "life.h"

#include <fcntl.h>
#include <mpi.h>
#include <pthread.h>
#include <sched.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <time.h>
#include <unistd.h>

/* Seconds that a rank which failed waits for the others to fail in the same way. They do at the same call,
 * and are apart by no more than the time that one of them takes longer to read a file. */
enum { PATIENCE = 10 };

/* Seconds in which the ranks must have found each other. Of a rank that is killed just after its start mpirun
 * may not tell the others (Open MPI 4.1: 1 of 300 kills), which would wait for it for ever. A whole run of
 * `devices` takes 0.8 s, four ranks on two cores. */
enum { MEETING = 30 };

/* Seconds that mpirun has to end all ranks when one has been killed, before the others do so themselves: Open MPI 4.1
 * misses some kills (on one machine 4 of 60 in the first second), else it takes less than one. */
enum { GRACE = 3 };

static struct {
    dmk_ranks ranks;      /* size 1: alone */
    MPI_Comm work;        /* the solver's */
    MPI_Comm end;         /* of cli_ranks_end: a rank may come to it while others work */
    MPI_Win window;       /* with the first rank's counter */
    long long *next;      /* that counter */
    MPI_Request *request; /* room for 2 size: of the exchange that is under way */
    int n_requests;
    MPI_Win lives; /* with those of the ranks of this machine, which watch each other */
    cli_life **life;
    int n_lives, my_life;
    bool watched;
    pthread_t watcher;
    int held, output,
        error; /* a file of messages, and where to print; held -1: nothing is held back */
} self = {.ranks = {.size = 1}, .held = -1};

const dmk_ranks *cli_ranks(void)
{
    return self.ranks.size > 1 ? &self.ranks : NULL;
}

bool cli_ranks_first(void)
{
    return self.ranks.rank == 0;
}

/* ---- who speaks ------------------------------------------------------------------------------ */

/* Messages go into a file without a name, the standard output nowhere. */
static void hold_back(void)
{
    if (self.held >= 0) return;
    const int nowhere = open("/dev/null", O_WRONLY);
    self.held = memfd_create("dmkcl", 0);
    self.output = dup(STDOUT_FILENO);
    self.error = dup(STDERR_FILENO);
    if (self.held >= 0) dup2(self.held, STDERR_FILENO);
    if (nowhere >= 0) dup2(nowhere, STDOUT_FILENO);
    close(nowhere);
}

static void print_held(void)
{
    char text[4096];
    ssize_t n;
    if (self.held < 0 || cli_interrupted()) return;
    fflush(stderr);
    lseek(self.held, 0, SEEK_SET);
    while ((n = read(self.held, text, sizeof text)) > 0) {
        if (write(self.error, text, (size_t)n) != n) break;
    }
}

void cli_ranks_speak(void)
{
    if (self.held < 0) return;
    fflush(stdout);
    print_held();
    dup2(self.output, STDOUT_FILENO);
    dup2(self.error, STDERR_FILENO);
    close(self.held);
    self.held = -1;
}

/* ---- waiting --------------------------------------------------------------------------------- */

/* Until all requests are done; not 0 for a failure, DMK_E_CANCELLED when the user or mpirun wants an end. */
static int wait_all(int n, MPI_Request *request)
{
    int done = 0;
    while (!done) {
        if (MPI_Testall(n, request, &done, MPI_STATUSES_IGNORE) != MPI_SUCCESS) return 1;
        if (done) break;
        if (cli_interrupted()) {
            hold_back(); /* mpirun, or the rank that made it end us, says why */
            return DMK_E_CANCELLED;
        }
        sched_yield(); /* the device's threads may want this processor */
    }
    return 0;
}

/* Counts are of type int: in words of 8 bytes where all lengths are made of them. */
static int units(const size_t *bytes, MPI_Datatype *type, int *count, int *offset)
{
    size_t sum = 0, word = 8;
    for (int k = 0; k < self.ranks.size; k++) word = bytes[k] % 8 == 0 ? word : 1;
    *type = word == 8 ? MPI_DOUBLE : MPI_BYTE;
    for (int k = 0; k < self.ranks.size; k++) {
        if ((sum + bytes[k]) / word > INT_MAX) return 1;
        count[k] = (int)(bytes[k] / word);
        offset[k] = (int)(sum / word);
        sum += bytes[k];
    }
    return 0;
}

static int unit(size_t bytes, MPI_Datatype *type, int *count)
{
    const size_t word = bytes % 8 == 0 ? 8 : 1;
    *type = word == 8 ? MPI_DOUBLE : MPI_BYTE;
    *count = (int)(bytes / word);
    return bytes / word > INT_MAX;
}

/* ---- the solver's calls ---------------------------------------------------------------------- */

static int begin(void *user, const void *const *send, const size_t *send_bytes,
                 void *const *receive, const size_t *receive_bytes)
{
    (void)user;
    int n = 0, status = 0;
    MPI_Request *request = self.request;
    MPI_Datatype type;
    int count;
    for (int k = 0; k < self.ranks.size && status == 0; k++) {
        if (receive_bytes[k] == 0) continue;
        status = unit(receive_bytes[k], &type, &count);
        if (status == 0)
            status = MPI_Irecv(receive[k], count, type, k, 0, self.work, &request[n++]);
    }
    for (int k = 0; k < self.ranks.size && status == 0; k++) {
        if (send_bytes[k] == 0) continue;
        status = unit(send_bytes[k], &type, &count);
        if (status == 0) status = MPI_Isend(send[k], count, type, k, 0, self.work, &request[n++]);
    }
    self.n_requests = n;
    return status;
}

static int finish(void *user)
{
    (void)user;
    return wait_all(self.n_requests, self.request);
}

static int exchange(void *user, const void *const *send, const size_t *send_bytes,
                    void *const *receive, const size_t *receive_bytes)
{
    const int status = begin(user, send, send_bytes, receive, receive_bytes);
    return status == 0 ? finish(user) : status;
}

static int gather(void *user, const void *mine, void *all, const size_t *bytes)
{
    (void)user;
    MPI_Datatype type;
    MPI_Request request;
    const size_t size = (size_t)self.ranks.size;
    int *count = malloc(2 * size * sizeof *count), status = 1;
    if (count && units(bytes, &type, count, count + size) == 0) {
        status = MPI_Iallgatherv(mine, count[self.ranks.rank], type, all, count, count + size, type,
                                 self.work, &request);
        if (status == MPI_SUCCESS) status = wait_all(1, &request);
    }
    free(count);
    return status;
}

static int largest(void *user, int32_t *value, size_t n)
{
    (void)user;
    MPI_Request request;
    if (n > INT_MAX) return 1;
    const int status =
        MPI_Iallreduce(MPI_IN_PLACE, value, (int)n, MPI_INT32_T, MPI_MAX, self.work, &request);
    return status == MPI_SUCCESS ? wait_all(1, &request) : status;
}

/* ---- pieces of work -------------------------------------------------------------------------- */

size_t cli_ranks_next(void)
{
    static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER; /* MPI serves one thread at a time */
    static long long alone;
    const long long one = 1;
    long long taken = 0;
    pthread_mutex_lock(&lock);
    if (self.ranks.size == 1) {
        taken = alone++;
    } else {
        MPI_Fetch_and_op(&one, &taken, MPI_LONG_LONG, 0, 0, MPI_SUM, self.window);
        MPI_Win_flush(0, self.window);
    }
    pthread_mutex_unlock(&lock);
    return (size_t)taken;
}

int cli_ranks_gather(const void *mine, void *all, size_t bytes)
{
    if (self.ranks.size == 1) {
        memcpy(all, mine, bytes);
        return DMK_OK;
    }
    MPI_Request request;
    if (MPI_Iallgather(mine, (int)bytes, MPI_BYTE, all, (int)bytes, MPI_BYTE, self.work,
                       &request) != MPI_SUCCESS) {
        return DMK_E_DEVICE;
    }
    const int status = wait_all(1, &request);
    return status == 0 || status == DMK_E_CANCELLED ? status : DMK_E_DEVICE;
}

/* ---- the other ranks of this machine --------------------------------------------------------- */

/* How many ranks have ended without a word, *lost one of them; *first: whether no rank before this one is left. */
static int lost_ranks(int *lost, bool *first)
{
    int n = 0;
    *first = true;
    for (int k = 0; k < self.n_lives; k++) {
        if (k == self.my_life) continue;
        if (cli_life_lost(self.life[k])) {
            *lost = self.life[k]->rank;
            n++;
        } else if (k < self.my_life) {
            *first = false;
        }
    }
    return n;
}

/* A thread, as the others may be in a call that never comes back. The first rank that is left ends with a word, which
 * mpirun sees; if it does not, the next one. */
static void *watch(void *unused)
{
    (void)unused;
    const struct timespec pause = {.tv_nsec = 200000000};
    double since = 0;
    int lost = -1;
    bool first;
    for (int n, before = 0;; before = n) {
        n = lost_ranks(&lost, &first);
        if (n != before) since = cli_seconds();
        if (n > 0 && first && cli_seconds() - since > GRACE) break;
        nanosleep(&pause, NULL);
    }
    dprintf(self.held < 0 ? STDERR_FILENO : self.error,
            "dmkcl: rank %d has ended without a word: has it been killed? Start again\n", lost);
    _exit(EXIT_DEVICE);
}

static void watch_others(MPI_Comm machine)
{
    cli_life *mine;
    MPI_Aint bytes;
    int unit, ready;
    MPI_Comm_rank(machine, &self.my_life);
    MPI_Win_allocate_shared(sizeof *mine, sizeof *mine, MPI_INFO_NULL, machine, &mine, &self.lives);
    for (int k = 0; k < self.n_lives; k++)
        MPI_Win_shared_query(self.lives, k, &bytes, &unit, &self.life[k]);
    ready = cli_life_begin(mine, self.ranks.rank) == 0;
    MPI_Allreduce(MPI_IN_PLACE, &ready, 1, MPI_INT, MPI_MIN, machine); /* all hold theirs */
    self.watched = ready && pthread_create(&self.watcher, NULL, watch, NULL) == 0;
}

static void end_watch(void)
{
    if (self.watched) {
        pthread_cancel(self.watcher);
        pthread_join(self.watcher, NULL);
    }
    MPI_Barrier(self.end); /* nobody looks any more */
    cli_life_end(self.life[self.my_life]);
    MPI_Win_free(&self.lives);
    free(self.life);
}

/* ---- begin and end --------------------------------------------------------------------------- */

/* n ranks that share a machine share its processors, unless mpirun has bound each to its own or the user has
 * chosen: PoCL would take all of them for each rank. */
static void divide_processors(int n)
{
    cpu_set_t allowed;
    char text[32];
    if (getenv("POCL_MAX_PTHREAD_COUNT")) return;
    if (n < 2 || sched_getaffinity(0, sizeof allowed, &allowed) != 0) return;
    const long all = sysconf(_SC_NPROCESSORS_ONLN), mine = CPU_COUNT(&allowed);
    const long threads = mine < all ? mine : all / n > 1 ? all / n : 1;
    snprintf(text, sizeof text, "%ld", threads);
    setenv("POCL_MAX_PTHREAD_COUNT", text, 0);
}

/* By SIGALRM, in place of an end that the library's own waiting would never come to. */
static void miss_others(int number)
{
    static const char text[] =
        "dmkcl: the other ranks do not answer: has one been killed as it began? Start again\n";
    (void)number;
    (void)!write(STDERR_FILENO, text, sizeof text - 1);
    _exit(EXIT_DEVICE);
}

/* Until all ranks are there, or the program ends. */
static void watch_meeting(bool begin)
{
    signal(SIGALRM, begin ? miss_others : SIG_DFL);
    alarm(begin ? MEETING : 0);
}

#if defined OMPI_MAJOR_VERSION && OMPI_MAJOR_VERSION < 5
static const char *const through_memory = "self,vader";
#else
static const char *const through_memory = "self,sm";
#endif

/* Ranks of one machine talk through its memory. Without the first word Open MPI 4.1 looks for networks first: 0.22 s of
 * the 0.25 s that its start takes; without the second one it listens to sockets beside, and start and end of two ranks
 * take 0.13 s more than those of one process, with it 0.05 s. */
static void stay_on_machine(void)
{
    const char *all = getenv("OMPI_COMM_WORLD_SIZE"), *here = getenv("OMPI_COMM_WORLD_LOCAL_SIZE");
    if (!all || !here || strcmp(all, here) != 0) return;
    setenv("OMPI_MCA_pml", "ob1", 0);
    setenv("OMPI_MCA_btl", through_memory, 0);
}

static void meet(int *argc, char ***argv)
{
    int support;
    MPI_Comm machine;
    stay_on_machine();
    if (MPI_Init_thread(argc, argv, MPI_THREAD_SERIALIZED, &support) != MPI_SUCCESS) return;
    MPI_Comm_set_errhandler(MPI_COMM_WORLD, MPI_ERRORS_RETURN);
    MPI_Comm_size(MPI_COMM_WORLD, &self.ranks.size);
    MPI_Comm_rank(MPI_COMM_WORLD, &self.ranks.rank);
    /* Open MPI has a terminal of its own for the standard output, wherever that goes in the end. */
    if (getenv("OMPI_COMM_WORLD_SIZE")) setenv("NO_COLOR", "1", 1);
    if (self.ranks.size == 1) return;
    self.ranks.exchange = exchange;
    self.ranks.gather = gather;
    self.ranks.largest = largest;
    self.ranks.begin = begin;
    self.ranks.finish = finish;
    if (MPI_Comm_split_type(MPI_COMM_WORLD, MPI_COMM_TYPE_SHARED, 0, MPI_INFO_NULL, &machine) !=
        MPI_SUCCESS)
        MPI_Abort(MPI_COMM_WORLD, EXIT_DEVICE);
    MPI_Comm_size(machine, &self.n_lives);
    self.life = calloc((size_t)self.n_lives, sizeof *self.life);
    self.request = calloc(2 * (size_t)self.ranks.size, sizeof *self.request);
    if (!self.request || !self.life) MPI_Abort(MPI_COMM_WORLD, EXIT_FAILURE);
    MPI_Comm_dup(MPI_COMM_WORLD, &self.work); /* both return errors, as their parent does */
    MPI_Comm_dup(MPI_COMM_WORLD, &self.end);
    MPI_Win_allocate(self.ranks.rank == 0 ? (MPI_Aint)sizeof *self.next : 0, sizeof *self.next,
                     MPI_INFO_NULL, self.work, &self.next, &self.window);
    if (self.ranks.rank == 0) *self.next = 0;
    MPI_Win_lock_all(0, self.window);
    watch_others(machine);
    MPI_Comm_free(&machine);
    MPI_Barrier(self.work);
    divide_processors(self.n_lives);
    if (self.ranks.rank > 0) hold_back();
}

void cli_ranks_begin(int *argc, char ***argv)
{
    watch_meeting(true);
    meet(argc, argv);
    watch_meeting(false);
}

/* Wait for the others' codes, for ever or with patience; whether they came. */
static bool gather_codes(int code, int *codes)
{
    const struct timespec pause = {.tv_nsec = 1000000};
    const double begin = cli_seconds();
    MPI_Request request;
    int done = 0;
    if (MPI_Iallgather(&code, 1, MPI_INT, codes, 1, MPI_INT, self.end, &request) != MPI_SUCCESS)
        return false;
    while (!done) {
        if (MPI_Test(&request, &done, MPI_STATUS_IGNORE) != MPI_SUCCESS) return false;
        if (!done && code != EXIT_OK && cli_seconds() - begin > PATIENCE) return false;
        if (!done) nanosleep(&pause, NULL);
    }
    return true;
}

int cli_ranks_end(int code)
{
    int first = 0, begun = 0;
    if (self.ranks.size == 1) {
        MPI_Initialized(&begun);
        if (begun) MPI_Finalize();
        return code;
    }
    int *codes = calloc((size_t)self.ranks.size, sizeof *codes);
    fflush(stdout);
    if (!codes || !gather_codes(code, codes)) {
        print_held();
        MPI_Abort(MPI_COMM_WORLD, code);
        _exit(code);
    }
    while (first < self.ranks.size - 1 && codes[first] == EXIT_OK) first++;
    if (code != EXIT_OK && self.ranks.rank == first) print_held(); /* the others say the same */
    code = codes[first];
    free(codes);
    /* mpirun ends ranks that leave later than the first one that failed: they have no more to tell. */
    if (code != EXIT_OK) cli_first_to_tell();
    end_watch();
    MPI_Win_unlock_all(self.window);
    MPI_Win_free(&self.window);
    MPI_Comm_free(&self.work);
    MPI_Comm_free(&self.end);
    free(self.request);
    MPI_Finalize();
    return code;
}

#endif
