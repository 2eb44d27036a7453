#ifndef DMK_MEMORY_H
#define DMK_MEMORY_H

#include "device/device.h"

/* Bytes that this process may still take, or UINT64_MAX where nobody says. */
uint64_t dmk_memory_available(void);
/* DMK_E_NOMEM if a solve on so many triangles, whose mesh has been read, cannot fit. */
int dmk_memory_check(dmk_context *context, const dmk_device *device, int64_t n_triangles);

#endif
