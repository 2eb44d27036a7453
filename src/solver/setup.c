#include "solver/setup.h"

#include "solver/fine_graph.h"
#include "solver/kernels.h"
#include "solver/memory.h"
#include "solver/packer.h"

#include "base/parallel.h"

#include <math.h>
#include <pthread.h>
#include <stdlib.h>

/* Triangles with an element bound above 2.5 (stiffness_bound in density.cl), of which the squared sines sum up to less
 * than 1.25: flatter than a right angle by far. Few do no harm, as a flat triangle damps its own nodes only. Those with
 * an angle below 5 degrees. And the largest cotangent. */
typedef struct needles {
    const dmk_mesh *mesh;
    int32_t begin, end; /* of its triangles */
    int64_t n_flat, n_sharp;
    double sharpest;
    pthread_mutex_t lock;
} needles;

static void needle_range(int32_t begin, int32_t end, void *data)
{
    needles *f = data;
    const dmk_mesh *m = f->mesh;
    int64_t n_flat = 0, n_sharp = 0;
    double sharpest = 0;
    for (int32_t t = f->begin + begin; t < f->begin + end; t++) {
        double c[3];
        dmk_cots(m, t, c);
        sharpest = dmk_max(sharpest, dmk_max(fabs(c[0]), dmk_max(fabs(c[1]), fabs(c[2]))));
        n_sharp += dmk_is_needle(c);
        n_flat += 1 / (1 + c[0] * c[0]) + 1 / (1 + c[1] * c[1]) + 1 / (1 + c[2] * c[2]) < 1.25;
    }
    pthread_mutex_lock(&f->lock);
    f->n_flat += n_flat;
    f->n_sharp += n_sharp;
    f->sharpest = fmax(f->sharpest, sharpest);
    pthread_mutex_unlock(&f->lock);
}

static void add_needles(void *data, double *sum)
{
    const needles *f = data;
    *sum += (double)f->n_flat;
}

static void take_sharpest(void *data, double *sharpest)
{
    const needles *f = data;
    *sharpest = fmax(*sharpest, f->sharpest);
}

/* What the smoother's degree and the levels hang on; with a part of the mesh here, of all ranks. */
static int look_at_angles(dmk_context *ctx, const dmk_ranks *ranks, const dmk_ground *g,
                          dmk_system *s)
{
    int rc = DMK_OK;
    needles f = {.mesh = g->mesh, .end = g->mesh->n_triangles};
    double n;
    if (g->element) {
        while (f.begin < f.end && g->element[f.begin] < g->bound[0][ranks->rank]) f.begin++;
        f.end = f.begin + (int32_t)(g->bound[0][ranks->rank + 1] - g->bound[0][ranks->rank]);
    }
    pthread_mutex_init(&f.lock, NULL);
    dmk_parallel(ctx, f.end - f.begin, needle_range, &f);
    pthread_mutex_destroy(&f.lock);
    n = (double)f.n_flat;
    s->sharpest = f.sharpest;
    s->of_needles = !g->element && dmk_device_real(s->device, DMK_OUTER) == sizeof(double) &&
                    dmk_fine_graph_pays(s->whole.n_elements, f.n_sharp, f.sharpest);
    if (s->of_needles) DMK_TRY(dmk_memory_check_needles(ctx, s->whole.n_elements));
    if (g->element) {
        n = 0;
        DMK_TRY(dmk_ranks_in_turn(ctx, ranks, &n, add_needles, &f));
        DMK_TRY(dmk_ranks_in_turn(ctx, ranks, &s->sharpest, take_sharpest, &f));
    }
    s->usual_degree = n / s->whole.n_elements > 0.05 ? 3 : 2;
done:
    return rc;
}

/* The hierarchy, made beside the packing of the fine level; each of its levels is packed at once. */
typedef struct coarsener {
    const packer *packer;
    dmk_hierarchy hierarchy;
    dmk_task task;    /* packs the level that came last */
    int32_t n_handed; /* levels that have come */
} coarsener;

static int pack_made(dmk_context *own, void *data)
{
    coarsener *c = data;
    packer p = *c->packer;
    p.ctx = own;
    return dmk_pack_level(&p, &c->hierarchy, c->n_handed - 1);
}

static int take_level(dmk_context *ctx, void *user, dmk_coarsening *level)
{
    coarsener *c = user;
    const int rc = dmk_task_end(ctx, &c->task, DMK_OK);
    if (rc != DMK_OK || !level) return rc;
    c->n_handed++;
    dmk_task_begin(ctx, &c->task, pack_made, c);
    return DMK_OK;
}

static int coarsen(dmk_context *own, void *data)
{
    coarsener *c = data;
    const dmk_level_taker taker = {take_level, c};
    return dmk_hierarchy_hand_over(own, c->packer->mesh, DMK_COARSEST, &taker, &c->hierarchy);
}

static int pack_fine(const packer *p)
{
    int rc;
    const dmk_mesh *m = p->mesh;
    dmk_level *l = &p->sys->level[0];
    DMK_TRY(dmk_pack_mesh(p));
    DMK_TRY(dmk_pack_graph(p, m->n_vertices, m->n_edges, m->edge_vertex, l));
    rc = dmk_pack_vectors(p, l);
done:
    return rc;
}

/* Coarse levels of T/2 itself; nothing is made if it does not become coarse enough. */
static int pack_without_T(const packer *p)
{
    int rc;
    dmk_fine_graph f;
    dmk_system *s = p->sys;
    DMK_TRY(dmk_fine_graph_create(p->ctx, &s->whole, p->mesh, DMK_COARSEST, &f));
    s->without_T = f.hierarchy.n > 0;
    if (!s->without_T) goto done;
    s->elements_at = f.elements_at;
    DMK_TRY(dmk_pack_mesh(p));
    DMK_TRY(dmk_pack(p, 2 * (size_t)f.elements_at, sizeof *f.slot, f.slot, &s->share_slot));
    DMK_TRY(dmk_pack_graph(p, s->n_rows, f.n_edges, f.edge, &s->level[0]));
    rc = dmk_pack_levels(p, &f.hierarchy);
done:
    dmk_fine_graph_free(&f);
    return rc;
}

static int pack_all(const packer *p)
{
    int rc;
    dmk_task task;
    coarsener c = {.packer = p};
    if (p->sys->of_needles) {
        rc = pack_without_T(p);
        if (rc != DMK_OK || p->sys->without_T) return rc;
    }
    dmk_task_begin(p->ctx, &task, coarsen, &c);
    rc = pack_fine(p);
    DMK_TRY(dmk_task_end(p->ctx, &task, rc));
    DMK_TRY(dmk_pack_coarsest(p, &c.hierarchy));
done:
    dmk_hierarchy_free(&c.hierarchy);
    return rc;
}

static void set_counts(dmk_system *s, const dmk_mesh *packed)
{
    dmk_counts c = dmk_system_counts(s->device, packed);
    s->n_elements = c.n_elements;
    s->n_elements_pad = c.n_elements_pad;
    s->n_edges = c.n_edges;
    s->n_vertices = c.n_vertices;
    s->vertex_row = c.vertex_row;
    s->n_rows = c.n_rows;
    s->n_rows_pad = c.n_rows_pad;
}

/* The share in the mesh's place, whose neighbours are not known yet. */
static int pack_own(const packer *p, dmk_parts *parts)
{
    int rc;
    dmk_share *share = p->sys->share;
    dmk_local local = {.first_whole = 0};
    packer mine = *p;
    mine.spend = false; /* two hierarchies have the levels that are whole */
    mine.mesh = &share->mesh;
    DMK_TRY(dmk_share_levels(p->ctx, share, parts, &local));
    DMK_TRY(pack_fine(&mine));
    DMK_TRY(dmk_pack_levels(&mine, &local.hierarchy));
done:
    dmk_local_free(&local);
    return rc;
}

static int pack_whole(const packer *p, dmk_hierarchy *whole)
{
    int rc;
    dmk_share_destroy(&p->sys->share);
    DMK_TRY(pack_fine(p));
    DMK_TRY(dmk_pack_levels(p, whole));
done:
    return rc;
}

static int fill_share(const packer *p)
{
    const int rc = dmk_share_fill(p->ctx, p->sys->share, p->ground);
    if (rc == DMK_OK) set_counts(p->sys, &p->sys->share->mesh);
    return rc;
}

/* All ranks at the same step. */
static int pack_together(const packer *p, const dmk_system_dealt *dealt, dmk_parts *parts)
{
    int rc;
    dmk_share *share = p->sys->share;
    if (!share) {
        if (p->ground->element) return DMK_OK;
        DMK_TRY(dmk_hierarchy_create(p->ctx, p->mesh, DMK_COARSEST, &parts->whole));
        return pack_whole(p, &parts->whole);
    }
    DMK_TRY(dmk_share_coarsen(p->ctx, share, p->ground, DMK_COARSEST, parts));
    if (parts->whole.n == 0) {
        if (!p->ground->element) return pack_whole(p, &parts->whole);
        dmk_share_destroy(&p->sys->share);
        return DMK_OK;
    }
    DMK_TRY(dmk_share_deal(p->ctx, share, p->ground, parts));
    DMK_TRY(dmk_share_connect(p->ctx, share));
    DMK_TRY(fill_share(p));
    DMK_TRY(dealt->call(p->ctx, dealt->user, p->sys));
    rc = pack_own(p, parts);
    dmk_share_forget(share);
done:
    return rc;
}

static int deal_own(const packer *p, dmk_parts *parts)
{
    int rc;
    DMK_TRY(dmk_share_deal(p->ctx, p->sys->share, p->ground, parts));
    DMK_TRY(fill_share(p));
    rc = pack_own(p, parts);
done:
    return rc;
}

/* The last rank's, before the others come. */
static int make_first(const packer *p, dmk_parts *parts)
{
    int rc;
    dmk_share *share = p->sys->share;
    DMK_TRY(dmk_hierarchy_create(p->ctx, p->mesh, DMK_COARSEST, &parts->whole));
    if (!share || parts->whole.n == 0) return DMK_OK;
    DMK_TRY(dmk_share_bound(p->ctx, share, &parts->whole));
    DMK_TRY(dmk_share_cut(p->ctx, share, parts));
    rc = deal_own(p, parts);
done:
    return rc;
}

/* The first rank comes later: the last one has coarsened the mesh and packed its own share by then, and after the
 * call it has time, while the others do. */
static int pack_handed(const packer *p, const dmk_system_dealt *dealt, dmk_parts *parts)
{
    int rc = DMK_OK;
    dmk_share *share = p->sys->share;
    const bool makes = !share || share->ranks.rank == share->ranks.size - 1;
    if (makes) DMK_TRY(make_first(p, parts));
    if (share) DMK_TRY(dmk_share_hand(p->ctx, share, parts));
    if (dealt->call) DMK_TRY(dealt->call(p->ctx, dealt->user, p->sys));
    if (!share || parts->whole.n == 0) return pack_whole(p, &parts->whole);
    if (!makes) DMK_TRY(deal_own(p, parts));
    DMK_TRY(dmk_share_connect(p->ctx, share));
    dmk_share_forget(share);
done:
    return rc;
}

static int pack_share(const packer *p, const dmk_ranks *ranks, const dmk_system_dealt *dealt)
{
    int rc;
    dmk_parts *parts = NULL;
    if (p->sys->of_needles) { /* each rank has all of it: without T there are no shares */
        rc = pack_all(p);
        return rc == DMK_OK && dealt->handed && dealt->call
                   ? dealt->call(p->ctx, dealt->user, p->sys)
                   : rc;
    }
    DMK_TRY(DMK_NEW(p->ctx, parts, 1));
    DMK_TRY(dmk_share_begin(p->ctx, ranks, p->dev, p->ground, &p->sys->share));
    rc = dealt->handed ? pack_handed(p, dealt, parts) : pack_together(p, dealt, parts);
done:
    if (parts) dmk_parts_free(parts);
    free(parts);
    return rc;
}

static dmk_counts count_whole(const dmk_device *device, const dmk_ranks *ranks, const dmk_ground *g)
{
    if (!g->element) return dmk_system_counts(device, g->mesh);
    const dmk_mesh whole = {.n_triangles = (int32_t)g->bound[0][ranks->size],
                            .n_edges = (int32_t)g->bound[1][ranks->size],
                            .n_vertices = (int32_t)g->bound[2][ranks->size]};
    return dmk_system_counts(device, &whole);
}

int dmk_system_create(dmk_context *ctx, dmk_device *device, const dmk_mesh *mesh,
                      dmk_system **system)
{
    const dmk_ground ground = {.mesh = mesh};
    return dmk_system_deal(ctx, device, &ground, NULL, NULL, system);
}

int dmk_system_deal(dmk_context *ctx, dmk_device *device, const dmk_ground *given,
                    const dmk_ranks *ranks, const dmk_system_dealt *dealt, dmk_system **system)
{
    int rc;
    dmk_system *s = NULL;
    dmk_ground ground = *given;
    const dmk_mesh *mesh = ground.mesh;
    for (int32_t t = 0; t < mesh->n_triangles && !ground.element; t++) ground.area += mesh->area[t];
    DMK_TRY(DMK_NEW(ctx, s, 1));
    s->device = device;
    s->unit = sqrt(ground.area);
    s->whole = count_whole(device, ranks, &ground);
    DMK_TRY(look_at_angles(ctx, ranks, &ground, s));
    s->fine_degree = s->usual_degree;
    s->newton_degree = 2;
    set_counts(s, mesh);
    packer p = {ctx, device, mesh, &ground, s, true};
    if (dealt)
        DMK_TRY(pack_share(&p, ranks, dealt));
    else
        DMK_TRY(pack_all(&p));
    if (ground.element && !s->share) goto done;
    DMK_TRY(dmk_kernels_create(ctx, device, &s->kernels)); /* they may have been built meanwhile */
    *system = s;
    s = NULL;
done:
    dmk_system_destroy(&s);
    return rc;
}
