#ifndef DMK_MEMORY_H
#define DMK_MEMORY_H

#include "device/device.h"

/* DMK_E_NOMEM if a solve on so many triangles, whose mesh has been read, cannot fit. */
int dmk_memory_check(dmk_context *context, const dmk_device *device, int64_t n_triangles);
/* The same of what levels without T take besides (fine_graph.h). */
int dmk_memory_check_needles(dmk_context *context, int64_t n_triangles);

#endif
