/* The right-hand side: a unit source at the point, a uniform sink of the same mass. */
#include "solver/iteration.h"

void dmk_point_weights(const double b[3], double w[6])
{
    for (int k = 0; k < 6; k++) w[k] = 0;
    for (int k = 0; k < 3; k++) {
        if (b[k] >= 0.5) { /* the sub-triangle at corner k */
            int i = (k + 1) % 3, j = (k + 2) % 3;
            w[k] = 2 * b[k] - 1;
            w[3 + j] = 2 * b[i]; /* m_j lies between corners k and i */
            w[3 + i] = 2 * b[j];
            return;
        }
    }
    for (int k = 0; k < 3; k++) w[3 + k] = 1 - 2 * b[k]; /* the middle one */
}

void dmk_fill_right_hand_side(const dmk_mesh *m, const dmk_space *elements, int32_t vertex_row,
                              double unit, int32_t source, const double weight[3], double *f)
{
    double w[6];
    for (int32_t t = 0; t < m->n_triangles; t++) {
        if (elements && dmk_space_whole(elements, t) < 0) continue;
        const double a = m->area[t] / (unit * unit);
        for (int k = 0; k < 3; k++) {
            f[vertex_row + m->triangle[3 * t + k]] -= a / 12;
            f[m->triangle_edge[3 * t + k]] -= a / 4;
        }
    }
    if (source < 0) return;
    dmk_point_weights(weight, w);
    for (int k = 0; k < 3; k++) {
        f[vertex_row + m->triangle[3 * source + k]] += w[k];
        f[m->triangle_edge[3 * source + k]] += w[3 + k];
    }
}

void dmk_right_hand_side(const dmk_mesh *m, const dmk_system *s, const dmk_point *p, double *f)
{
    for (int32_t i = 0; i < s->whole.n_rows_pad; i++) f[i] = 0;
    dmk_fill_right_hand_side(m, NULL, s->whole.vertex_row, s->unit, (int32_t)p->triangle, p->weight,
                             f);
}
