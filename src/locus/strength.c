/* Excess of the crossings, strength of the branches.
 *
 * Leaves are peeled off, the weakest first. A triangle with one crossing left hands on to it
 *     P(out) = max over the others of P(i) + (1 - cos(alpha / 2)) |c_i - c_out|,
 * the largest d(x) + |x c| - d(c) over the points x of the branch cut off: the length by which a path to
 * c must grow to be moved around the branch's end, from one of the two shortest to the other. Where d falls from c_i to
 * c_out it is 1 + cos, as paths go there and back. On a mesh's own branches d does either: falls count once a branch is
 * more than any of these, and then those since it had the least default by an excess of its own, which a joint need not
 * have. alpha is the harmonic mean of both crossings': between ends that several families part a single one is too
 * wide, and by their sum a branch of a coarse mesh has up to five times the excess of the mesh cut 1:4. Crossings on
 * loops are never peeled: their excess is infinite.
 *
 * A small piece with a large angle at the far end of a long line with a small one has much excess though the mesh
 * hardly shows where that line runs: on the way inwards a branch's worth is what it gains at angles above the one
 * of the rules less what it loses below. Without the loss 5.9 instead of 1.3 % of the worst scan's locus is false.
 *
 * Where branches join, the one with the largest worth goes on and the others end: a branch runs from a leaf to there,
 * and its strength is its worth there (the persistence of its end). All of a branch has this strength, but for what
 * lies beyond its end, where its worth is less than the default, which has its own worth: so whole branches come and go
 * with the strength asked for, and nothing else changes. */
#include "base/heading.h"
#include "base/heap.h"
#include "base/parallel.h"
#include "base/sort.h"
#include "base/vec3.h"
#include "locus/cotree.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* What one crossing of a triangle hands on to another. */
static dmk_crossing hand_on(const dmk_cotree *t, const dmk_crossing *from, const dmk_crossing *to)
{
    const double way = dmk_distance(from->xyz, to->xyz);
    const double sum = from->alpha + to->alpha, product = from->alpha * to->alpha;
    const double along = sum > 0 ? dmk_heading_of(product / sum).x : 1, growth = (1 - along) * way;
    const double loss = (1 - cos(0.5 * dmk_rules.angle)) * way;
    const double worth = dmk_max(0, from->worth + growth - loss);
    const double least = dmk_rules.strength * t->mean_edge;
    double fall = from->fall;
    if (dmk_min(from->worth, from->excess) >= least && from->distance > to->distance)
        fall += 2 * along * way;
    return (dmk_crossing){.excess = from->excess + growth, .worth = worth, .fall = fall};
}

/* What triangle `node` hands on to crossing i. The strongest of its other crossings is the heir of i's branch. Falls
 * count for all of them as soon as one is more than any of the mesh's own: a finger's wait for long. */
static dmk_crossing receive(dmk_cotree *t, int32_t i, int32_t node)
{
    const dmk_crossing *to = &t->crossing[i];
    dmk_crossing got = {.worth = to->kept ? t->strength : 0}, *heir = NULL, one[3], *from[3];
    double most = 0, strongest = 0;
    int n = 0;
    for (int k = 0; k < 3; k++) {
        const int32_t j = t->on[3 * node + k];
        if (j < 0 || j == i) continue;
        from[n] = &t->crossing[j];
        one[n] = hand_on(t, from[n], to);
        strongest = dmk_max(strongest, one[n++].worth);
    }
    for (int k = 0; k < n; k++) {
        if (strongest >= dmk_rules.gap * dmk_rules.strength * t->mean_edge) {
            one[k].excess += one[k].fall;
            one[k].worth += one[k].fall;
            one[k].fall = 0;
        }
        got.excess = dmk_max(got.excess, one[k].excess);
        got.worth = dmk_max(got.worth, one[k].worth);
        from[k]->onward = i;
        from[k]->heir = !heir || one[k].worth > most ||
                        (one[k].worth == most && from[k]->excess > heir->excess);
        if (!from[k]->heir) continue;
        if (heir) heir->heir = false;
        heir = from[k];
        most = one[k].worth;
        got.fall = one[k].fall;
    }
    return got;
}

/* The crossing of a leaf that is not peeled. */
static int32_t way_out(const dmk_cotree *t, int32_t leaf)
{
    for (int k = 2;; k--) {
        const int32_t i = t->on[3 * leaf + k];
        if (k == 0 || (i >= 0 && t->crossing[i].excess == HUGE_VAL)) return i;
    }
}

/* Leaves are peeled block by block, many blocks at once, as far as a block's own triangles will do; then in blocks that
 * begin in the middle of these, both again with blocks four times as large, and then all that is left, a tenth. Without
 * those that begin in the middle it takes 17 for 14 ms on 273,000 triangles. */
enum { BLOCK = 32768, ROUNDS = 5 }; /* odd: the last one has one block */

/* What a block peels in a round, in order. */
typedef struct batch {
    int32_t *crossing;
    size_t n, room;
} batch;

typedef struct peeling {
    dmk_cotree *cotree;
    double least;    /* excess of a leaf that waits for the weaker ones */
    uint8_t *degree; /* n_triangles: crossings not peeled */
    int round;
    int32_t n_blocks;
    batch *batch; /* ROUNDS for each block */
    dmk_heap heap;
} peeling;

/* Where block b begins; from n_triangles on blocks are empty. */
static int32_t begin_of(const peeling *p, int32_t b)
{
    const int32_t n = p->cotree->geodesics->mesh->n_triangles;
    const int32_t size = p->round == ROUNDS - 1 ? n : BLOCK << (p->round & ~1);
    const int64_t at = (int64_t)b * size - p->round % 2 * (size / 2);
    return at < 0 ? 0 : at < n ? (int32_t)at : n;
}

/* Peel the leaf at a triangle. Returns the triangle behind it if that is a leaf now, else -1. */
static int32_t take_leaf(peeling *p, int32_t leaf, int32_t out, const dmk_crossing *got)
{
    dmk_crossing *c = &p->cotree->crossing[out];
    c->excess = got->excess;
    c->worth = got->worth;
    c->fall = got->fall;
    c->outer = c->node[1] == leaf;
    p->degree[leaf] = 0;
    const int32_t next = dmk_other_node(c, leaf);
    return next < p->cotree->geodesics->mesh->n_triangles && --p->degree[next] == 1 ? next : -1;
}

/* Leaves of less than the least in any order; in the end the others into the heap. */
__attribute__((flatten)) static int peel_block(dmk_context *ctx, int32_t b, void *data)
{
    int rc = DMK_OK;
    peeling *p = data;
    dmk_cotree *t = p->cotree;
    const int32_t all = t->geodesics->mesh->n_triangles, begin = begin_of(p, b),
                  end = begin_of(p, b + 1);
    batch peeled = p->batch[ROUNDS * b + p->round];
    peeled.n = 0;
    for (int32_t i = begin; i < end && p->round == 0; i++)
        p->degree[i] = (t->on[3 * i] >= 0) + (t->on[3 * i + 1] >= 0) + (t->on[3 * i + 2] >= 0);
    for (int32_t i = begin; i < end; i++) {
        for (int32_t leaf = p->degree[i] == 1 ? i : -1; leaf >= 0;) {
            const int32_t out = way_out(t, leaf), next = dmk_other_node(&t->crossing[out], leaf);
            if (next < all && (next < begin || next >= end)) break;
            const dmk_crossing got = receive(t, out, leaf);
            const bool waits = !(got.excess < p->least);
            if (waits && p->round == ROUNDS - 1)
                DMK_TRY(dmk_heap_push(ctx, &p->heap, got.excess, leaf));
            if (waits) break;
            DMK_TRY(DMK_GROW(ctx, peeled.crossing, peeled.n + 1, peeled.room));
            peeled.crossing[peeled.n++] = out;
            leaf = take_leaf(p, leaf, out, &got);
        }
    }
done:
    p->batch[ROUNDS * b + p->round] = peeled;
    return rc;
}

static int peel_weak(dmk_context *ctx, peeling *p)
{
    int rc = DMK_OK;
    for (p->round = 0; p->round < ROUNDS && rc == DMK_OK; p->round++)
        rc = dmk_parallel_pieces(ctx, p->n_blocks, peel_block, p);
    return rc;
}

/* The triangle at the last crossing's other end has nothing left: it hands on to that crossing, too. */
static void close_last(dmk_cotree *t, int32_t last)
{
    const dmk_crossing *c = &t->crossing[last];
    if (c->node[1] >= t->geodesics->mesh->n_triangles) return;
    for (int k = 0; k < 6; k++) {
        const int32_t j = t->on[3 * c->node[k / 3] + k % 3];
        if (j >= 0 && j != last && t->crossing[j].excess == HUGE_VAL) return;
    }
    for (int side = 0; side < 2; side++) receive(t, last, c->node[side]);
    t->crossing[last].onward = -1;
    t->last = last;
}

/* All in the order of strength. What is peeled and what it hands on does not depend on the order, only which crossing
 * is the last one of a tree: so most leaves, the mesh's own, are not sorted. */
static int peel(dmk_context *ctx, peeling *p)
{
    int rc;
    dmk_cotree *t = p->cotree;
    batch *late = &p->batch[ROUNDS - 1];
    DMK_TRY(peel_weak(ctx, p));
    if (p->heap.n == 0) { /* a tree without a strong leaf: all of it by strength */
        for (int32_t i = 0; i < t->n; i++) t->crossing[i].excess = HUGE_VAL;
        p->least = 0;
        DMK_TRY(peel_weak(ctx, p));
    }
    while (p->heap.n > 0) {
        const dmk_heap_item leaf = dmk_heap_pop(&p->heap);
        if (p->degree[leaf.item] != 1) continue; /* the other end of the last crossing */
        const int32_t out = way_out(t, leaf.item);
        const dmk_crossing got = receive(t, out, leaf.item);
        const int32_t next = take_leaf(p, leaf.item, out, &got);
        DMK_TRY(DMK_GROW(ctx, late->crossing, late->n + 1, late->room));
        late->crossing[late->n++] = out;
        if (next < 0) continue;
        DMK_TRY(dmk_heap_push(ctx, &p->heap, receive(t, way_out(t, next), next).excess, next));
    }
    if (late->n > 0) close_last(t, late->crossing[late->n - 1]);
done:
    return rc;
}

/* From the inside out: what lies behind a place of less worth has no more than that. */
static void set_branch(dmk_cotree *t, int32_t i)
{
    dmk_crossing *c = &t->crossing[i];
    double strength = c->worth;
    if (c->onward >= 0) {
        strength = t->strength_of[c->onward];
        if (!c->heir) strength = fmin(c->worth, strength);
        c->worth = fmin(c->worth, t->crossing[c->onward].worth);
    }
    t->strength_of[i] = c->worth < t->strength ? c->worth : strength;
}

static int set_block(dmk_context *ctx, int32_t b, void *data)
{
    const peeling *p = data;
    (void)ctx;
    const batch *peeled = &p->batch[ROUNDS * b + p->round];
    for (size_t i = peeled->n; i-- > 0;) set_branch(p->cotree, peeled->crossing[i]);
    return DMK_OK;
}

double dmk_branch_at(const dmk_cotree *t, int32_t i)
{
    const int32_t *on = t->on + 3 * i;
    if (on[0] < 0 || on[1] < 0 || on[2] < 0) return 0;
    return fmin(t->crossing[on[0]].worth, fmin(t->crossing[on[1]].worth, t->crossing[on[2]].worth));
}

/* The mesh's own branches are weak and many; on a noisy mesh some are stronger than the default. They
 * are told apart from the surface's by a gap: above the strongest of them, which is no lone one, the next
 * is `gap` times as strong, and is no loop; on a sphere the longest line always counts as next. The default is then
 * in the middle of the gap, on the side of the mesh's own. A scan's shape may leave such a gap, too, but noise that
 * makes a branch makes edges jump: the strongest is 15 to 40 medians of the jumps on noisy meshes, 50 to 265 on scans
 * where pruning it would leave out a part. */
static int find_default(dmk_context *ctx, dmk_cotree *t)
{
    int rc;
    const double fixed = dmk_rules.strength * t->mean_edge, least = fixed / sqrt(dmk_rules.gap);
    const double most = fmin(dmk_rules.gap * fixed, fmax(fixed, dmk_rules.noise * t->noise));
    double *branch = NULL;
    size_t n = 0;
    const int32_t n_triangles = t->geodesics->mesh->n_triangles;
    t->strength = fixed;
    DMK_TRY(DMK_NEW_UNSET(ctx, branch, (size_t)n_triangles + 2));
    branch[n++] = least;
    if (t->last >= 0) branch[n++] = HUGE_VAL;
    for (int32_t i = 0; i < n_triangles; i++) {
        const double found = dmk_branch_at(t, i);
        if (found > least && found < HUGE_VAL) branch[n++] = found;
    }
    dmk_sort_doubles(branch, n);
    for (size_t i = 0; i + 1 < n && branch[i] <= most; i++) {
        if (branch[i + 1] < dmk_rules.gap * branch[i]) continue;
        if (i > 0 && branch[i] > sqrt(dmk_rules.gap) * branch[i - 1]) continue;
        t->strength = fmax(t->strength, sqrt(dmk_rules.gap) * branch[i]);
        break;
    }
done:
    free(branch);
    return rc;
}

int dmk_cotree_peel(dmk_context *ctx, dmk_cotree *t)
{
    int rc;
    const int32_t n = t->geodesics->mesh->n_triangles;
    peeling p = {.cotree = t, .least = dmk_least_excess(t), .n_blocks = n / BLOCK + 2};
    const size_t n_batches = ROUNDS * (size_t)p.n_blocks;
    t->last = -1;
    DMK_TRY(DMK_NEW_UNSET(ctx, p.degree, (size_t)n));
    DMK_TRY(DMK_NEW(ctx, p.batch, n_batches));
    DMK_TRY(peel(ctx, &p));
    if (!(t->strength > 0)) DMK_TRY(find_default(ctx, t));
    while (p.round-- > 0) DMK_TRY(dmk_parallel_pieces(ctx, p.n_blocks, set_block, &p));
done:
    free(p.degree);
    for (size_t k = 0; k < n_batches && p.batch; k++) free(p.batch[k].crossing);
    free(p.batch);
    dmk_heap_free(&p.heap);
    return rc;
}
