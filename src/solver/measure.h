/* Loads on T/2 from measures on the surface. */
#ifndef DMK_MEASURE_H
#define DMK_MEASURE_H

#include "solver/system.h"

/* Check both measures on the whole mesh (to may be NULL: then `from` is signed). *component: where they lie.
 * The masses are checked by dmk_measure_load. */
int dmk_measure_check(dmk_context *context, const dmk_mesh *mesh, const dmk_measure *from,
                      const dmk_measure *to, int32_t *component);
/* Atoms without masses take what the other measure has nearest to them. */
static inline bool dmk_measure_is_free(const dmk_measure *m)
{
    return m->n_atoms > 0 && !m->atom_mass;
}

/* f of the packed problem, whole.n_rows_pad numbers: from - to of total mass 1 each. n_triangles: of the mesh that the
 * order is of a component of. *mass: that of `from`. atom_mass: of free atoms, one each. Masses that differ are refused
 * unless `normalise`. */
int dmk_measure_load(dmk_context *context, size_t n_triangles, const dmk_order *order,
                     const dmk_system *system, const dmk_measure *from, const dmk_measure *to,
                     bool normalise, double *f, double *mass, double *atom_mass);

#endif
