/* How the program ends when it is asked to, or when the OpenCL driver ends it.
 *
 * SIGINT and SIGTERM are blocked in all threads but one, which waits for them. So they come at any moment, also
 * while a driver compiles, which nobody can interrupt; and compilers that the driver starts inherit the block:
 * Ctrl-C, which the terminal sends to them too, does not make their failure the last word. */
#include "cli.h"

#include <pthread.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

enum {
    /* Milliseconds to come to an end with a word of how far it has come; all promise one second, and giving
     * back the memory of a large mesh takes its part. */
    GRACE = 500
};

static atomic_bool interrupted, reported;
static _Atomic(const char *) last_word;

static void say(const char *text)
{
    (void)!write(STDERR_FILENO, text, strlen(text));
}

bool cli_interrupted(void)
{
    return atomic_load(&interrupted);
}

bool cli_first_to_tell(void)
{
    return !atomic_exchange(&reported, true);
}

void cli_keep_last_word(const char *word)
{
    atomic_store(&last_word, word);
    atomic_store(&reported, true);
}

bool cli_has_last_word(void)
{
    return atomic_exchange(&last_word, NULL) != NULL;
}

/* What is written is whole or has no name: nothing is left behind. */
static void *wait_for_signal(void *user)
{
    const struct timespec grace = {GRACE / 1000, GRACE % 1000 * 1000000};
    sigset_t *set = user;
    int number;
    sigwait(set, &number);
    atomic_store(&interrupted, true);
    sigtimedwait(set, NULL, &grace); /* a second signal ends the grace */
    if (cli_first_to_tell())
        say(isatty(STDERR_FILENO) ? "\r\033[Kdmkcl: cancelled\n" : "dmkcl: cancelled\n");
    const char *word = atomic_exchange(&last_word, NULL);
    if (word) say(word);
    _exit(EXIT_INTERRUPTED);
}

/* What is ignored from the start stays so, as SIGINT by what a script runs with &: blocked, and nobody waits for it. */
static void add_unless_ignored(sigset_t *set, int number)
{
    struct sigaction before;
    if (sigaction(number, NULL, &before) != 0 || before.sa_handler != SIG_IGN)
        sigaddset(set, number);
}

static void catch_interrupt(void)
{
    static sigset_t set;
    sigset_t both;
    pthread_t thread;
    pthread_attr_t small;
    sigemptyset(&set);
    add_unless_ignored(&set, SIGINT);
    add_unless_ignored(&set, SIGTERM);
    sigemptyset(&both);
    sigaddset(&both, SIGINT);
    sigaddset(&both, SIGTERM);
    pthread_sigmask(SIG_BLOCK, &both, NULL);
    pthread_attr_init(&small);
    pthread_attr_setstacksize(&small, 1 << 16);
    pthread_attr_setdetachstate(&small, PTHREAD_CREATE_DETACHED);
    if (pthread_create(&thread, &small, wait_for_signal, &set) != 0) {
        pthread_sigmask(SIG_UNBLOCK, &set, NULL); /* then they end it where it is */
    }
    pthread_attr_destroy(&small);
}

/* ---- drivers that end the program ----------------------------------------------------------- */

/* The variables that steer the driver, for they are the usual reason, but for the one of main.c; and a bound of the
 * memory. */
static void say_reason(const char *what)
{
    static const char *const begin[] = {"POCL_",    "OCL_ICD_",       "OPENCL_",         "LP_",
                                        "RUSTICL_", "HWLOC_XMLFILE=", "HWLOC_SYNTHETIC="};
    struct rlimit space;
    bool any = false;
    say("dmkcl: the OpenCL driver ");
    say(what);
    say(" while the device was opened");
    for (char **e = environ; *e; e++) {
        for (size_t i = 0; i < sizeof begin / sizeof *begin; i++) {
            if (strncmp(*e, begin[i], strlen(begin[i])) != 0 ||
                strncmp(*e, "POCL_AFFINITY=", 14) == 0)
                continue;
            say(any ? " " : "; try without ");
            say(*e);
            any = true;
        }
    }
    if (getrlimit(RLIMIT_AS, &space) == 0 && space.rlim_cur != RLIM_INFINITY) {
        say(any ? " and without `ulimit -v`" : "; try without `ulimit -v`");
        say(", as drivers reserve up to 1 GB");
        any = true;
    }
    say(any ? "\n" : "; see that it is installed well, and that /proc and /sys are there\n");
}

/* A driver is being asked; else what crashes in the main thread is the program's own. */
static _Thread_local bool asking;

/* Threads of a driver crash together: the first one has the word, and ends the program. */
static void on_crash(int number)
{
    static _Thread_local bool telling;
    static atomic_flag told = ATOMIC_FLAG_INIT;
    const bool in_main = syscall(SYS_gettid) == getpid();
    if (dmk_devices_opening() > 0 && (asking || !in_main) && !telling) {
        telling = true;
        while (atomic_flag_test_and_set(&told)) pause();
        say_reason(number == SIGABRT ? "gave up" : "crashed");
        _exit(EXIT_DEVICE);
    }
    signal(number, SIG_DFL);
    raise(number);
}

static void on_exit_of_others(void)
{
    if (dmk_devices_opening() == 0) return;
    say_reason("ended the program");
    _exit(EXIT_DEVICE);
}

static void catch_crashes(void)
{
    static const int signals[] = {SIGSEGV, SIGBUS, SIGILL, SIGABRT};
    static atomic_bool ours[sizeof signals / sizeof *signals]; /* else a sanitizer's */
    const struct sigaction action = {.sa_handler = on_crash, .sa_flags = SA_NODEFER};
    for (size_t i = 0; i < sizeof signals / sizeof *signals; i++) {
        struct sigaction before;
        if (sigaction(signals[i], NULL, &before) != 0) continue;
        if (before.sa_handler == SIG_DFL) atomic_store(&ours[i], true);
        if (atomic_load(&ours[i])) sigaction(signals[i], &action, NULL);
    }
}

int cli_device_list(dmk_context *context, dmk_device_info *devices, size_t capacity, size_t *n)
{
    asking = true;
    const int rc = dmk_device_list(context, devices, capacity, n);
    asking = false;
    return rc;
}

/* Drivers may put handlers of their own in place when they are first asked, as PoCL's LLVM does. */
int cli_device_open(dmk_context *context, const dmk_device_options *options, dmk_device **device)
{
    size_t n;
    cli_device_list(context, NULL, 0, &n);
    catch_crashes();
    asking = true;
    const int rc = dmk_device_open(context, options, device);
    asking = false;
    return rc;
}

void cli_catch_signals(void)
{
    catch_crashes();
    atexit(on_exit_of_others);
    catch_interrupt();
}
