/* Boxes along the axes. Internal to src/mesh. */
#ifndef DMK_MESH_BOX_H
#define DMK_MESH_BOX_H

#include "mesh/mesh.h"

#include <math.h>

typedef struct dmk_box {
    double lo[3], hi[3];
} dmk_box;

/* Around nothing. */
static inline dmk_box dmk_box_none(void)
{
    return (dmk_box){{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};
}

/* Around what lies from lo to hi, too. */
static inline void dmk_box_take(dmk_box *b, const double lo[3], const double hi[3])
{
    for (int k = 0; k < 3; k++) {
        b->lo[k] = dmk_min(b->lo[k], lo[k]);
        b->hi[k] = dmk_max(b->hi[k], hi[k]);
    }
}

/* Squared distance from x: never more than that to what is in the box. */
static inline double dmk_box_distance2(const dmk_box *b, const double x[3])
{
    double sum = 0;
    for (int k = 0; k < 3; k++) {
        const double d = dmk_max(dmk_max(b->lo[k] - x[k], x[k] - b->hi[k]), 0);
        sum += d * d;
    }
    return sum;
}

#endif
