#include "base/crew.h"

#include <sched.h>

/* `round` is one word, so that a part is taken together with the round that it is of: the next part in the lowest 20
 * bits, the number of parts in the 20 above, and the number of the round, modulo 2^23, above these. The highest bit
 * says that there are no more rounds. */
enum { BITS = 20 };
static const uint64_t part_mask = ((uint64_t)1 << BITS) - 1, round_one = (uint64_t)1 << 2 * BITS,
                      last = (uint64_t)1 << 63;

/* Looks before a thread lets others have the processor. Speed only. */
enum { SPINS = 2000 };

static void wait_a_little(int *looks)
{
    if (++*looks < SPINS) {
#if defined(__x86_64__) || defined(__i386__)
        __builtin_ia32_pause();
#endif
        return;
    }
    *looks = 0;
    sched_yield();
}

/* Do one part of the present round; false if nobody need begin one. */
static bool do_part(dmk_crew *crew, int member)
{
    uint64_t now = atomic_load(&crew->round);
    for (;;) {
        const uint64_t k = now & part_mask, n = now >> BITS & part_mask;
        if (k >= n) return false;
        if (!atomic_compare_exchange_weak(&crew->round, &now, now + 1)) continue;
        crew->part((int32_t)k, member, crew->data);
        atomic_fetch_add(&crew->done, 1);
        return true;
    }
}

static int stay(dmk_context *own, void *data)
{
    dmk_crew *crew = data;
    (void)own;
    const int member = 1 + atomic_fetch_add(&crew->joined, 1);
    int looks = 0;
    while (!(atomic_load(&crew->round) & last)) {
        if (do_part(crew, member))
            looks = 0;
        else
            wait_a_little(&looks);
    }
    return DMK_OK;
}

void dmk_crew_begin(dmk_context *ctx, dmk_crew *crew,
                    void (*part)(int32_t k, int member, void *data), void *data)
{
    crew->part = part;
    crew->data = data;
    crew->n_members = dmk_min_i(dmk_parallel_threads(ctx), DMK_MOST_CREW);
    atomic_init(&crew->round, 0);
    atomic_init(&crew->done, 0);
    atomic_init(&crew->joined, 0);
    for (int k = 0; k + 1 < crew->n_members; k++)
        dmk_task_begin_staying(ctx, crew->task + k, stay, crew);
}

void dmk_crew_round(dmk_crew *crew, int32_t n_parts)
{
    int looks = 0;
    if (crew->n_members == 1 || n_parts == 1) { /* nobody else need know */
        for (int32_t k = 0; k < n_parts; k++) crew->part(k, 0, crew->data);
        return;
    }
    const uint64_t before = atomic_load(&crew->round) >> 2 * BITS;
    atomic_store(&crew->done, 0);
    atomic_store(&crew->round, (before + 1) * round_one % last | (uint64_t)n_parts << BITS);
    while (do_part(crew, 0)) continue;
    while (atomic_load(&crew->done) < n_parts) wait_a_little(&looks);
}

void dmk_crew_end(dmk_context *ctx, dmk_crew *crew)
{
    atomic_store(&crew->round, last);
    for (int k = 0; k + 1 < crew->n_members; k++) (void)dmk_task_end(ctx, crew->task + k, DMK_OK);
}
