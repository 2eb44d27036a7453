/* Whether a process of this machine still runs, as the ranks that share it see it. */
#include "../src/cli/life.c"

#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmocka.h>

typedef struct shared {
    cli_life life;
    atomic_int begun;
} shared;

/* A process that stays until it is killed, or ends as it should. */
static pid_t start(shared *s, bool stays)
{
    const pid_t child = fork();
    if (child == 0) {
        prctl(PR_SET_PDEATHSIG, SIGKILL); /* also where an assertion fails */
        const int rc = cli_life_begin(&s->life, 7);
        if (!stays) cli_life_end(&s->life);
        atomic_store(&s->begun, rc == 0 ? 1 : -1);
        if (!stays) _exit(0);
        for (;;) pause();
    }
    while (atomic_load(&s->begun) == 0) usleep(1000);
    return child;
}

/* What another process sees. */
static bool lost_to_another(shared *s)
{
    int status;
    const pid_t child = fork();
    if (child == 0) _exit(cli_life_lost(&s->life) ? 1 : 0);
    assert_int_equal(waitpid(child, &status, 0), child);
    assert_true(WIFEXITED(status));
    return WEXITSTATUS(status) == 1;
}

static shared *share(void)
{
    shared *s = mmap(NULL, sizeof *s, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    assert_true(s != MAP_FAILED);
    return s;
}

/* Seen by all that look, however often, but only once its owner is dead. */
static void killed(void **state)
{
    (void)state;
    shared *s = share();
    const pid_t child = start(s, true);
    assert_int_equal(atomic_load(&s->begun), 1);
    assert_int_equal(s->life.rank, 7);
    for (int i = 0; i < 3; i++) assert_false(cli_life_lost(&s->life) || lost_to_another(s));
    assert_int_equal(kill(child, SIGKILL), 0);
    assert_int_equal(waitpid(child, NULL, 0), child);
    for (int i = 0; i < 3; i++) {
        assert_true(lost_to_another(s));
        assert_true(cli_life_lost(&s->life));
    }
    munmap(s, sizeof *s);
}

/* A process that ends as it should is not missed. */
static void ended(void **state)
{
    (void)state;
    shared *s = share();
    const pid_t child = start(s, false);
    assert_int_equal(waitpid(child, NULL, 0), child);
    for (int i = 0; i < 3; i++) assert_false(lost_to_another(s) || cli_life_lost(&s->life));
    munmap(s, sizeof *s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(killed),
        cmocka_unit_test(ended),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
