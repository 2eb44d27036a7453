/* Windows that threads give each other: see window.c. A thread that has none left waits, and one that sees others wait
 * gives away half of its stack, the older half, whose windows have the farthest to go. */
#include "geodesic/window_engine.h"

#include "base/base.h"
#include "base/spin.h"

#include <string.h>

static void lock(shares *s)
{
    for (int looks = 0; atomic_exchange(&s->locked, true);) dmk_spin(&looks);
}

static void unlock(shares *s)
{
    atomic_store(&s->locked, false);
}

/* The last n shared windows onto the stack. */
static int move(worker *me, shares *s, size_t n)
{
    if (n == 0) return DMK_OK;
    const int rc = DMK_GROW(me->ctx, me->stack, me->n_stack + n, me->capacity);
    if (rc != DMK_OK) return rc;
    s->n -= n;
    memcpy(me->stack + me->n_stack, s->window + s->n, n * sizeof *s->window);
    me->n_stack += n;
    return DMK_OK;
}

/* Neighbours on the stack are neighbours on the surface: each thread begins with a part of its own, so that they seldom
 * write to each other's cache lines. */
int dmk_shares_begin(worker *me, int n_threads)
{
    shares *s = me->shares;
    lock(s);
    const int rc = move(me, s, s->n / (size_t)(n_threads - s->n_begun++));
    s->n_working++;
    unlock(s);
    return rc;
}

/* Its part of what there is. */
int dmk_shares_take(worker *me)
{
    int rc = DMK_OK;
    shares *s = me->shares;
    if (s->n == 0) return rc;
    lock(s);
    if (s->n > 0) rc = move(me, s, 1 + (s->n - 1) / (size_t)(s->n_waiting + 1));
    unlock(s);
    return rc;
}

int dmk_shares_give(worker *me)
{
    int rc = DMK_OK;
    shares *s = me->shares;
    const size_t n = me->n_stack / 2;
    if (s->n_waiting == 0 || s->n > 0 || n == 0) return rc;
    lock(s);
    DMK_TRY(DMK_GROW(me->ctx, s->window, s->n + n, s->room));
    memcpy(s->window + s->n, me->stack, n * sizeof *me->stack);
    s->n += n;
    me->n_stack -= n;
    memmove(me->stack, me->stack + n, me->n_stack * sizeof *me->stack);
done:
    unlock(s);
    return rc;
}

int dmk_shares_wait(worker *me, bool *more)
{
    int rc = DMK_OK;
    bool done = false;
    shares *s = me->shares;
    lock(s);
    s->n_working--;
    s->n_waiting++;
    unlock(s);
    *more = false;
    for (int looks = 0; !done && !*more && rc == DMK_OK;) {
        const bool stops = s->stopped || dmk_windows_spent(me->e);
        if (s->n == 0 && s->n_working > 0 && !stops) {
            dmk_spin(&looks);
            if (looks == 0) rc = dmk_poll(me->ctx);
            continue;
        }
        lock(s);
        done = stops || (s->n == 0 && s->n_working == 0); /* nobody has a window any more */
        if (!done && s->n > 0) {
            rc = move(me, s, 1 + (s->n - 1) / (size_t)s->n_waiting);
            s->n_working++;
            s->n_waiting--;
            *more = true;
        }
        unlock(s);
    }
    return rc;
}

void dmk_shares_stop(shares *s)
{
    atomic_store(&s->stopped, true);
}
