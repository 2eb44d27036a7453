#ifndef DMK_RESULT_H
#define DMK_RESULT_H

#include "geodesic/geodesic.h"

#include <stdatomic.h>

/* The ordered component, shared by the solver and its results; the last one frees it. */
typedef struct dmk_shared_order {
    dmk_order order;
    atomic_int users;
} dmk_shared_order;

dmk_shared_order *dmk_shared_order_keep(dmk_shared_order *shared);
void dmk_shared_order_release(dmk_shared_order **shared);

struct dmk_result {
    size_t n_vertices, n_triangles, n_edges; /* of the input mesh */
    double *density;                         /* n_triangles */
    uint8_t *acl;                            /* n_triangles */
    double *potential, *distance;            /* n_vertices */
    double *potential_mid;                   /* n_edges */
    dmk_point source;                        /* on the input mesh */
    dmk_stats stats;
    dmk_shared_order *order;          /* of the source's component */
    int32_t source_triangle;          /* in that order */
    dmk_geodesics *geodesics;         /* of that mesh, from the source */
    _Atomic(struct dmk_seam *) *seam; /* locus/locus.h: of the cut locus that was traced first */
};

/* What a cut takes over from the tracing of the locus, or NULL. A result does not change for its readers: the first one
 * stays, and *seam becomes NULL then. */
void dmk_result_keep_seam(const dmk_result *result, struct dmk_seam **seam);
const struct dmk_seam *dmk_result_seam(const dmk_result *result);

/* For the input mesh, without its arrays. */
int dmk_result_create(dmk_context *context, const dmk_mesh *mesh, dmk_result **result);
/* These: mu = 0 and infinite distance until they are set; or neither distance nor acl. */
int dmk_result_allocate(dmk_context *context, dmk_result *result, bool with_distance);

/* For accessors: an array that is not there has length 0. */
static inline const double *dmk_borrow(const double *array, size_t length, size_t *n)
{
    if (n) *n = array ? length : 0;
    return array;
}

#endif
