/* From a mesh to its system. Internal to src/solver. */
#ifndef DMK_SETUP_H
#define DMK_SETUP_H

#include "solver/system.h"

/* Pack an ordered, connected mesh with its hierarchy. What is
 * packed stays for all sources. The state and the work arrays, two fifths of the memory, come with
 * dmk_system_allocate and may go in between: the host's arrays for start and end have room then. */
int dmk_system_create(dmk_context *context, dmk_device *device, const dmk_mesh *mesh,
                      dmk_system **system);
/* With ranks, this one's share of it, and a call on all of them. */
typedef struct dmk_system_dealt {
    /* Not `handed`: as soon as the share is made, if there is one; the whole mesh is not read any more, and the call
     * may free its arrays. `handed`: when the first rank is there, which comes later than the others; they get their
     * levels from the last one, which has nothing left to do then but what the call gives it. */
    int (*call)(dmk_context *context, void *user, dmk_system *system);
    void *user;
    bool handed;
} dmk_system_dealt;
/* ground: the mesh, whose area need not be there if it is whole. Of a part of one that is too small to be dealt out, or
 * has no levels, nothing is made, *system stays as it is. */
int dmk_system_deal(dmk_context *context, dmk_device *device, const dmk_ground *ground,
                    const dmk_ranks *ranks, const dmk_system_dealt *dealt, dmk_system **system);

#endif
