/* Where strong parts are joined. Where families meet at a small angle, jumps are as small on the locus as beside it,
 * and one edge sends the tree's line around another way, 20 to 70 h long. So parts are told apart first: connected
 * crossings of the default strength where families meet at twice the angle of the rules or more, and border loops. The
 * least ways that connect all are their joints: lengths on the surface, longer off the first tree's lines, `off` times
 * where the ends of an edge do not differ either. A second tree takes none of the edges that parts and joints cross,
 * which have the default strength in any case. */
#include "base/parallel.h"
#include "base/sets.h"
#include "locus/cotree.h"

#include <stdlib.h>

typedef struct steps {
    const dmk_cotree *t;
    double *step;
} steps;

/* An edge across a line at which families meet at the angle alpha has the jump alpha times its length, whether the
 * tree takes it or not. step: the jumps, which steps take the place of. */
static void set_steps(int32_t begin, int32_t end, void *data)
{
    const steps *s = data;
    const dmk_cotree *t = s->t;
    const dmk_mesh *m = t->geodesics->mesh;
    for (int32_t e = begin; e < end; e++) {
        const int32_t h = dmk_half_edge_on(m, m->edge_triangle[2 * e], e);
        const bool on = t->on[h] >= 0 && t->crossing[t->on[h]].excess >= dmk_least_excess(t);
        const double seen = s->step[e] / m->length[e] / (0.5 * dmk_rules.angle);
        const double off = 1 + (dmk_rules.off - 1) / (1 + seen);
        s->step[e] = dmk_way_across(t->geodesics, h) * (on ? 1 : off);
    }
}

/* Returns the number of parts. */
static int32_t find_parts(const dmk_cotree *t, bool *in_part, int32_t *parent, bool *kept)
{
    const dmk_mesh *m = t->geodesics->mesh;
    int32_t n = t->n_loops;
    for (int32_t i = 0; i < m->n_triangles + t->n_loops; i++) parent[i] = i;
    for (int32_t i = 0; i < t->n; i++) {
        const dmk_crossing *c = &t->crossing[i];
        if (t->strength_of[i] < t->strength) continue;
        const int32_t e = m->triangle_edge[c->half];
        if (c->alpha < 2 * dmk_rules.angle && !dmk_parts_cells(t->geodesics, e)) continue;
        kept[e] = true;
        for (int k = 0; k < 2; k++) {
            n += c->node[k] < m->n_triangles && !in_part[c->node[k]];
            in_part[c->node[k]] = true;
        }
        n -= dmk_set_unite(parent, c->node[0], c->node[1]);
    }
    return n;
}

int dmk_cotree_join(dmk_context *ctx, dmk_cotree *t)
{
    int rc;
    const dmk_mesh *m = t->geodesics->mesh;
    const size_t n = (size_t)m->n_triangles + (size_t)t->n_loops;
    int32_t *parent = NULL;
    bool *in_part = NULL, *kept = NULL;
    double *step = NULL;
    DMK_TRY(DMK_NEW(ctx, parent, n));
    DMK_TRY(DMK_NEW(ctx, in_part, n));
    DMK_TRY(DMK_NEW(ctx, kept, (size_t)m->n_edges));
    const int32_t n_parts = find_parts(t, in_part, parent, kept);
    if (n_parts > 1) {
        DMK_TRY(DMK_NEW_UNSET(ctx, step, (size_t)m->n_edges));
        for (int32_t k = 0; k < m->n_edges; k++) step[t->order[k].item] = dmk_jump_of(t, k);
        dmk_parallel(ctx, m->n_edges, set_steps, &(steps){t, step});
        DMK_TRY(dmk_join_parts(ctx, t->geodesics, t->loop, step, in_part, n_parts, parent, kept));
        DMK_TRY(dmk_poll(ctx));
        DMK_TRY(dmk_cotree_keep(ctx, t, kept));
        rc = dmk_cotree_peel(ctx, t);
    }
done:
    free(parent);
    free(in_part);
    free(kept);
    free(step);
    return rc;
}
