/* Excess of the crossings, strength of the branches.
 *
 * Leaves are peeled off, the weakest first. A triangle with one crossing left hands on to it
 *     P(out) = max over the others of P(i) + (1 - cos(alpha / 2)) |c_i - c_out|,
 * the largest d(x) + |x c| - d(c) over the points x of the branch cut off: the length by which a path to
 * c must grow to be moved around the branch's end, from one of the two shortest to the other. alpha is the harmonic
 * mean of both crossings': between ends that several families part a single one is too wide, and by their sum a
 * branch of a coarse mesh has up to five times the excess that it has where the mesh is cut 1:4. Crossings
 * on loops are never peeled: their excess is infinite.
 *
 * A small piece with a large angle at the far end of a long line with a small one has much excess though the mesh
 * hardly shows where that line runs: on the way inwards a branch's worth is what it gains at angles above the one
 * of the rules less what it loses below. Without the loss 5.9 instead of 1.3 % of the worst scan's locus is false.
 *
 * Where branches join, the one with the largest worth goes on and the others end: a branch runs from a leaf to
 * there, and its strength is its worth there (the persistence of its end). All of a branch has this strength, but
 * for what lies beyond its end, where its worth is less than the default, which has its own worth: so whole
 * branches come and go with the strength asked for, and nothing else changes. */
#include "base/parallel.h"
#include "base/sort.h"
#include "base/vec3.h"
#include "geodesic/heap.h"
#include "locus/cotree.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* What triangle `node` hands on to crossing i: excess and worth. The strongest of its other crossings is the heir of
 * i's branch. */
static dmk_crossing receive(dmk_cotree *t, int32_t i, int32_t node)
{
    const dmk_crossing *to = &t->crossing[i];
    dmk_crossing got = {.worth = to->kept ? t->strength : 0}, *heir = NULL;
    double most = 0;
    for (int k = 0; k < 3; k++) {
        const int32_t j = t->on[3 * node + k];
        if (j < 0 || j == i) continue;
        dmk_crossing *from = &t->crossing[j];
        const double way = dmk_distance(from->xyz, to->xyz);
        const double sum = from->alpha + to->alpha, product = from->alpha * to->alpha;
        const double growth = sum > 0 ? (1 - cos(product / sum)) * way : 0;
        const double loss = (1 - cos(0.5 * dmk_rules.angle)) * way;
        const double worth = fmax(0, from->worth + growth - loss);
        got.excess = fmax(got.excess, from->excess + growth);
        got.worth = fmax(got.worth, worth);
        from->onward = i;
        from->heir = !heir || worth > most || (worth == most && from->excess > heir->excess);
        if (!from->heir) continue;
        if (heir) heir->heir = false;
        heir = from;
        most = worth;
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

/* Triangles are peeled block by block, many at once, as far as a block's own ones will do. */
enum { BLOCK = 32768 };

typedef struct peeling {
    dmk_cotree *cotree;
    double least;    /* excess of a leaf that waits for the weaker ones */
    uint8_t *degree; /* n_triangles: crossings not peeled */
    int32_t *early,
        *n_early; /* crossings peeled within the blocks, each block's from its first triangle's place on */
    int32_t *late, n_late; /* after that */
    dmk_heap heap;
} peeling;

static int32_t block_end(const dmk_cotree *t, int32_t b)
{
    return dmk_min_i((b + 1) * BLOCK, t->geodesics->mesh->n_triangles);
}

/* Peel the leaf at a triangle. Returns the triangle behind it if that is a leaf now, else -1. */
static int32_t take_leaf(peeling *p, int32_t leaf, int32_t out, const dmk_crossing *got)
{
    dmk_crossing *c = &p->cotree->crossing[out];
    c->excess = got->excess;
    c->worth = got->worth;
    c->outer = c->node[1] == leaf;
    p->degree[leaf] = 0;
    const int32_t next = dmk_other_node(c, leaf);
    return next < p->cotree->geodesics->mesh->n_triangles && --p->degree[next] == 1 ? next : -1;
}

/* Leaves of less than the least in any order. */
static int peel_block(dmk_context *ctx, int32_t b, void *data)
{
    peeling *p = data;
    dmk_cotree *t = p->cotree;
    const int32_t begin = b * BLOCK, end = block_end(t, b), all = t->geodesics->mesh->n_triangles;
    (void)ctx;
    for (int32_t i = begin; i < end; i++) {
        p->degree[i] = 0;
        for (int k = 0; k < 3; k++) p->degree[i] += t->on[3 * i + k] >= 0;
    }
    for (int32_t i = begin; i < end; i++) {
        for (int32_t leaf = p->degree[i] == 1 ? i : -1; leaf >= 0;) {
            const int32_t out = way_out(t, leaf), next = dmk_other_node(&t->crossing[out], leaf);
            if (next < all && (next < begin || next >= end)) break;
            const dmk_crossing got = receive(t, out, leaf);
            if (!(got.excess < p->least)) break;
            p->early[begin + p->n_early[b]++] = out;
            leaf = take_leaf(p, leaf, out, &got);
        }
    }
    return DMK_OK;
}

/* What the blocks have left: leaves of less than the least in any order, the others into the heap. */
static int peel_weak(dmk_context *ctx, peeling *p)
{
    int rc = DMK_OK;
    dmk_cotree *t = p->cotree;
    for (int32_t i = 0; i < t->geodesics->mesh->n_triangles; i++) {
        for (int32_t leaf = p->degree[i] == 1 ? i : -1; leaf >= 0;) {
            const int32_t out = way_out(t, leaf);
            const dmk_crossing got = receive(t, out, leaf);
            if (!(got.excess < p->least)) {
                DMK_TRY(dmk_heap_push(ctx, &p->heap, got.excess, leaf));
                break;
            }
            p->late[p->n_late++] = out;
            leaf = take_leaf(p, leaf, out, &got);
        }
    }
done:
    return rc;
}

/* All in the order of strength. What is peeled and what it hands on does not depend on the order, only which crossing
 * is the last one of a tree: so most leaves, the mesh's own, are not sorted. */
static int peel(dmk_context *ctx, peeling *p)
{
    int rc;
    dmk_cotree *t = p->cotree;
    const int32_t n_blocks = (t->geodesics->mesh->n_triangles + BLOCK - 1) / BLOCK;
    int32_t n = 0;
    DMK_TRY(dmk_parallel_pieces(ctx, n_blocks, peel_block, p));
    DMK_TRY(peel_weak(ctx, p));
    for (int32_t b = 0; b < n_blocks; b++) n += p->n_early[b];
    if (n + p->n_late == t->n) { /* a tree without a strong leaf: all of it by strength */
        for (int32_t i = 0; i < t->n; i++) t->crossing[i].excess = HUGE_VAL;
        p->least = 0;
        p->n_late = 0;
        memset(p->n_early, 0, (size_t)n_blocks * sizeof *p->n_early);
        DMK_TRY(dmk_parallel_pieces(ctx, n_blocks, peel_block, p));
        DMK_TRY(peel_weak(ctx, p));
    }
    while (p->heap.n > 0) {
        const dmk_heap_item leaf = dmk_heap_pop(&p->heap);
        if (p->degree[leaf.item] != 1) continue; /* the other end of the last crossing */
        const int32_t out = way_out(t, leaf.item);
        const dmk_crossing got = receive(t, out, leaf.item);
        const int32_t next = take_leaf(p, leaf.item, out, &got);
        p->late[p->n_late++] = out;
        if (next < 0) continue;
        DMK_TRY(dmk_heap_push(ctx, &p->heap, receive(t, way_out(t, next), next).excess, next));
    }
done:
    return rc;
}

/* The triangle at the last crossing's other end has nothing left: it hands on to that crossing, too. */
static void close_last(dmk_cotree *t, int32_t last)
{
    const dmk_crossing *c = &t->crossing[last];
    if (c->node[1] >= t->geodesics->mesh->n_triangles) return;
    for (int side = 0; side < 2; side++) {
        for (int k = 0; k < 3; k++) {
            const int32_t j = t->on[3 * c->node[side] + k];
            if (j >= 0 && j != last && t->crossing[j].excess == HUGE_VAL) return;
        }
    }
    for (int side = 0; side < 2; side++) receive(t, last, c->node[side]);
    t->crossing[last].onward = -1;
    t->last = last;
}

/* From the inside out: what lies behind a place of less worth has no more than that. */
static void set_branch(dmk_cotree *t, int32_t i)
{
    dmk_crossing *c = &t->crossing[i];
    c->strength = c->worth;
    if (c->onward >= 0) {
        const dmk_crossing *on = &t->crossing[c->onward];
        c->strength = c->heir ? on->strength : fmin(c->worth, on->strength);
        c->worth = fmin(c->worth, on->worth);
    }
    if (c->worth < t->strength) c->strength = c->worth;
}

static int set_block(dmk_context *ctx, int32_t b, void *data)
{
    const peeling *p = data;
    (void)ctx;
    for (int32_t i = p->n_early[b] - 1; i >= 0; i--) set_branch(p->cotree, p->early[b * BLOCK + i]);
    return DMK_OK;
}

double dmk_branch_at(const dmk_cotree *t, int32_t i)
{
    double least = HUGE_VAL;
    for (int k = 0; k < 3; k++) {
        if (t->on[3 * i + k] < 0) return 0;
        least = fmin(least, t->crossing[t->on[3 * i + k]].worth);
    }
    return least;
}

typedef struct branches {
    const dmk_cotree *cotree;
    double *at; /* n_triangles */
} branches;

static void find_branches(int32_t begin, int32_t end, void *data)
{
    const branches *b = data;
    for (int32_t i = begin; i < end; i++) b->at[i] = dmk_branch_at(b->cotree, i);
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
    DMK_TRY(DMK_NEW(ctx, branch, (size_t)n_triangles + 2));
    branch[n++] = least;
    if (t->last >= 0) branch[n++] = HUGE_VAL;
    dmk_parallel(ctx, n_triangles, find_branches, &(branches){t, branch + n});
    for (const double *b = branch + n, *end = b + n_triangles; b < end; b++) {
        if (*b > least && *b < HUGE_VAL) branch[n++] = *b;
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
    peeling p = {.cotree = t, .least = dmk_least_excess(t)};
    const int32_t n_triangles = t->geodesics->mesh->n_triangles;
    const int32_t n_blocks = (n_triangles + BLOCK - 1) / BLOCK;
    t->last = -1;
    DMK_TRY(DMK_NEW(ctx, p.degree, (size_t)n_triangles));
    DMK_TRY(DMK_NEW(ctx, p.early, (size_t)n_triangles));
    DMK_TRY(DMK_NEW(ctx, p.n_early, (size_t)n_blocks));
    DMK_TRY(DMK_NEW(ctx, p.late, (size_t)t->n));
    DMK_TRY(peel(ctx, &p));
    if (p.n_late > 0) close_last(t, p.late[p.n_late - 1]);
    if (!(t->strength > 0)) DMK_TRY(find_default(ctx, t));
    while (p.n_late > 0) set_branch(t, p.late[--p.n_late]);
    rc = dmk_parallel_pieces(ctx, n_blocks, set_block, &p);
done:
    free(p.degree);
    free(p.early);
    free(p.n_early);
    free(p.late);
    dmk_heap_free(&p.heap);
    return rc;
}
