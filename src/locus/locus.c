/* The public object: numbering, polylines, counts. */
#include "base/sets.h"
#include "locus/net.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

struct dmk_locus {
    dmk_locus_info info;
    dmk_locus_vertex *vertex; /* info.n_vertices */
    dmk_locus_edge *edge;     /* info.n_edges */
    int32_t *offset;          /* info.n_polylines + 1 */
    int32_t *index;           /* offset[n_polylines]: vertices of the polylines */
};

/* Beams wider than this many edges cannot be one family seen through mesh noise; at the default
 * strength of 0.75. */
static const double default_strength = 0.75, default_width = 2.0;
static const double pi = 3.14159265358979323846;

void dmk_locus_options_init(dmk_locus_options *options)
{
    if (options) *options = (dmk_locus_options){.strength = default_strength};
}

/* Number the remaining nodes in order; angles are scaled to a full turn of 2 pi at the source. */
static int number_vertices(dmk_context *ctx, const dmk_locus_input *in, const dmk_chart *chart,
                           const dmk_net *net, int32_t *number, dmk_locus *l)
{
    int rc;
    double scale = chart->closed ? 2 * pi / chart->total : 1;
    DMK_TRY(DMK_NEW(ctx, l->vertex, (size_t)net->n));
    for (int32_t i = 0; i < net->n; i++) {
        number[i] = -1;
        if (net->node[i].at.degree == 0 && net->node[i].at.kind != DMK_LOCUS_POINT) continue;
        number[i] = (int32_t)l->info.n_vertices;
        dmk_locus_vertex *v = &l->vertex[l->info.n_vertices++];
        *v = net->node[i].at;
        dmk_net_set_place(in->mesh, v->place, v);
        v->mu = in->mu ? in->mu[v->place.triangle] : 0;
        v->strength *= scale;
        for (int k = 0; k < 2; k++) {
            double a = scale * v->angle[k];
            v->angle[k] = chart->closed ? a - 2 * pi * floor(a / (2 * pi)) : a;
        }
        if (v->degree == 1) v->kind = DMK_LOCUS_END;
        if (v->degree > 2) v->kind = DMK_LOCUS_BRANCH;
        l->info.endpoints += v->degree == 1;
        l->info.branch_points += v->degree > 2;
    }
done:
    return rc;
}

static void add_edge(dmk_locus *l, int32_t a, int32_t b)
{
    const dmk_locus_vertex *v = l->vertex;
    double length = 0;
    for (int k = 0; k < 3; k++) {
        length += (v[a].xyz[k] - v[b].xyz[k]) * (v[a].xyz[k] - v[b].xyz[k]);
    }
    l->info.length += sqrt(length);
    l->edge[l->info.n_edges++] = (dmk_locus_edge){{a, b}, fmin(v[a].strength, v[b].strength)};
}

/* Follow the branch that leaves `from` towards `to` up to a vertex of degree other than 2 or back
 * to the start; write its vertices and its edges. */
static int32_t write_branch(const dmk_net *net, const int32_t *number, int32_t from, int32_t to,
                            bool *seen, dmk_locus *l, int32_t at)
{
    int32_t first = from;
    l->index[at++] = number[from];
    for (;;) {
        add_edge(l, number[from], number[to]);
        l->index[at++] = number[to];
        seen[to] = true;
        if (net->node[to].at.degree != 2 || to == first) return at;
        int32_t next = dmk_net_onward(net, from, to);
        from = to;
        to = next;
    }
}

/* Branches between vertices of degree other than 2, each once, then closed curves without such. */
static int write_polylines(dmk_context *ctx, const dmk_net *net, const int32_t *number,
                           dmk_locus *l)
{
    int rc;
    bool *seen = NULL;
    int32_t at = 0;
    size_t links = 0;
    for (int32_t i = 0; i < net->n; i++)
        links += (size_t)net->node[i].at.degree;
    DMK_TRY(DMK_NEW(ctx, seen, (size_t)net->n));
    DMK_TRY(DMK_NEW(ctx, l->edge, links / 2));
    DMK_TRY(DMK_NEW(ctx, l->index, links + 1));
    DMK_TRY(DMK_NEW(ctx, l->offset, links + 2));
    for (int pass = 0; pass < 2; pass++) {
        for (int32_t i = 0; i < net->n; i++) {
            const dmk_node *n = &net->node[i];
            bool start = pass == 0 ? n->at.degree != 2 : n->at.degree == 2 && !seen[i];
            for (int32_t k = 0; start && k < (pass == 0 ? n->at.degree : 1); k++) {
                int32_t to = n->next[k], a = i, b = to;
                while (pass == 0 && net->node[b].at.degree == 2) {
                    int32_t c = dmk_net_onward(net, a, b);
                    a = b;
                    b = c;
                }
                /* Each branch is met from both its ends; write it from the smaller one. */
                if (pass == 0 && (b < i || (b == i && a < to))) continue;
                at = write_branch(net, number, i, to, seen, l, at);
                l->offset[++l->info.n_polylines] = at;
            }
        }
    }
done:
    free(seen);
    return rc;
}

static void count_components(const dmk_net *net, int32_t *parent, dmk_locus *l)
{
    for (int32_t i = 0; i < net->n; i++)
        parent[i] = i;
    l->info.components = l->info.n_vertices;
    for (int32_t i = 0; i < net->n; i++) {
        for (int32_t k = 0; k < net->node[i].at.degree; k++) {
            if (dmk_set_unite(parent, i, net->node[i].next[k])) l->info.components--;
        }
    }
    l->info.loops =
        (int64_t)l->info.n_edges - (int64_t)l->info.n_vertices + (int64_t)l->info.components;
}

static int assemble(dmk_context *ctx, const dmk_locus_input *in, const dmk_chart *chart,
                    const dmk_net *net, dmk_locus **locus)
{
    int rc;
    dmk_locus *l = NULL;
    int32_t *number = NULL;
    DMK_TRY(DMK_NEW(ctx, l, 1));
    DMK_TRY(DMK_NEW(ctx, number, (size_t)net->n));
    DMK_TRY(number_vertices(ctx, in, chart, net, number, l));
    DMK_TRY(write_polylines(ctx, net, number, l));
    count_components(net, number, l);
    *locus = l;
    l = NULL;
done:
    free(number);
    dmk_locus_destroy(&l);
    return rc;
}

double dmk_locus_threshold(const dmk_locus_options *opt)
{
    double strength = opt && opt->strength > 0 ? opt->strength : default_strength;
    return default_width * strength / default_strength;
}

static int check_guide(dmk_context *ctx, const dmk_locus_input *in)
{
    for (int32_t v = 0; v < in->mesh->n_vertices; v++) {
        if (isfinite(in->distance[v])) continue;
        return dmk_fail(ctx, DMK_E_ARG, "the distance at vertex %d is not finite: solve first", v);
    }
    return DMK_OK;
}

int dmk_locus_trace(dmk_context *ctx, const dmk_locus_input *in, const dmk_locus_options *opt,
                    dmk_locus **locus)
{
    int rc;
    dmk_rays rays = {0};
    dmk_dual dual = {0};
    dmk_net net = {0};
    double threshold = dmk_locus_threshold(opt);
    DMK_TRY(check_guide(ctx, in));
    DMK_TRY(dmk_rays_create(ctx, in, &rays));
    DMK_TRY(dmk_dual_create(ctx, &rays, threshold, &dual));
    DMK_TRY(dmk_poll(ctx));
    DMK_TRY(dmk_net_create(ctx, &rays, &dual, threshold, &net));
    DMK_TRY(dmk_poll(ctx));
    dmk_net_tidy(&net);
    DMK_TRY(dmk_net_fit_tips(ctx, &rays, &net));
    DMK_TRY(dmk_net_shrink(ctx, &rays, &dual, &net));
    dmk_net_merge_branches(&rays, &net);
    DMK_TRY(assemble(ctx, in, &rays.chart, &net, locus));
done:
    dmk_rays_free(&rays);
    dmk_dual_free(&dual);
    dmk_net_free(&net);
    return rc;
}

void dmk_locus_destroy(dmk_locus **locus)
{
    dmk_locus *l = locus ? *locus : NULL;
    if (!l) return;
    free(l->vertex);
    free(l->edge);
    free(l->offset);
    free(l->index);
    free(l);
    *locus = NULL;
}

void dmk_locus_get_info(const dmk_locus *locus, dmk_locus_info *info)
{
    if (info) *info = locus ? locus->info : (dmk_locus_info){0};
}

const dmk_locus_vertex *dmk_locus_vertices(const dmk_locus *locus, size_t *n)
{
    if (n) *n = locus ? locus->info.n_vertices : 0;
    return locus ? locus->vertex : NULL;
}

const dmk_locus_edge *dmk_locus_edges(const dmk_locus *locus, size_t *n)
{
    if (n) *n = locus ? locus->info.n_edges : 0;
    return locus ? locus->edge : NULL;
}

const int32_t *dmk_locus_polylines(const dmk_locus *locus, const int32_t **offset, size_t *n)
{
    if (offset) *offset = locus ? locus->offset : NULL;
    if (n) *n = locus ? locus->info.n_polylines : 0;
    return locus ? locus->index : NULL;
}
