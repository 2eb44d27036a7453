/* The approximate cut locus {mu <= eps} of a point, or a set of them, from mu and u alone. */
#ifndef DMK_ACL_H
#define DMK_ACL_H

#include "mesh/mesh.h"

/* A result on the ordered mesh, in its units. */
typedef struct dmk_acl_input {
    const dmk_mesh *mesh; /* with the metric that was computed with */
    /* n_triangles; NULL: unknown, or no length (then no threshold, and no crests: acl.c) */
    const double *mu;
    const double *u;     /* n_vertices */
    const double *u_mid; /* n_edges */
} dmk_acl_input;

/* acl[t] = 1 where mu <= threshold; threshold = 0: by the rule that needs none (acl.c). */
int dmk_acl_mark(dmk_context *context, const dmk_acl_input *in, double threshold, uint8_t *acl);

#endif
