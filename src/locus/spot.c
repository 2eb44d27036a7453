/* A point of the surface as each of its triangles sees it: see dmk_spot in window.h. */
#include "locus/window.h"

#include <stdlib.h>

/* A weight below this puts the point on the edge or vertex itself, as in chart.c. */
static const double on_edge = 1e-9;

static void at_vertex(const dmk_vertex_stars *fan, int32_t v, dmk_spot *s)
{
    s->vertex = v;
    for (int32_t i = fan->row[v]; i < fan->row[v + 1]; i++) {
        int k = fan->triangle[i] % 4;
        s->in[s->n++] = (dmk_point){fan->triangle[i] / 4, {k == 0, k == 1, k == 2}};
    }
}

/* On edge k of its triangle, whose other side is `across`. */
static void at_edge(const dmk_point *p, int k, int32_t across, dmk_spot *s)
{
    int a = (k + 1) % 3, b = (k + 2) % 3;
    double sum = p->weight[a] + p->weight[b];
    dmk_point *in = s->in;
    in[0].triangle = p->triangle;
    in[0].weight[k] = 0;
    in[0].weight[a] = p->weight[a] / sum;
    in[0].weight[b] = p->weight[b] / sum;
    s->n = 1;
    if (across < 0) return;
    int j = across % 3;
    in[1].triangle = across / 3;
    in[1].weight[j] = 0;
    in[1].weight[(j + 1) % 3] = in[0].weight[b];
    in[1].weight[(j + 2) % 3] = in[0].weight[a];
    s->n = 2;
}

int dmk_spot_set(dmk_context *ctx, const dmk_mesh *m, const int32_t *across, const dmk_vertex_stars *fan,
                 const dmk_point *p, dmk_spot *s)
{
    int rc, big = 0, small = 0, n_small = 0;
    int32_t t = (int32_t)p->triangle, n = 2;
    for (int k = 0; k < 3; k++) {
        if (p->weight[k] > p->weight[big]) big = k;
        if (p->weight[k] < on_edge) n_small++, small = k;
    }
    int32_t v = m->triangle[3 * t + big];
    if (n_small == 2) n = fan->row[v + 1] - fan->row[v];
    free(s->in);
    *s = (dmk_spot){.vertex = -1};
    DMK_TRY(DMK_NEW(ctx, s->in, (size_t)n));
    if (n_small == 2)
        at_vertex(fan, v, s);
    else if (n_small == 1)
        at_edge(p, small, across[3 * t + small], s);
    else
        s->in[s->n++] = *p;
done:
    return rc;
}
