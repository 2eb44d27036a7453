/* What hwloc knows of the machine. */
#include "base/base.h"

#include <hwloc.h>

static uint64_t cache_bytes(hwloc_topology_t topology, hwloc_obj_type_t type)
{
    hwloc_obj_t o = hwloc_get_obj_by_type(topology, type, 0);
    return o ? o->attr->cache.size : 0;
}

static int count_of(hwloc_topology_t topology, hwloc_obj_type_t type)
{
    int n = hwloc_get_nbobjs_by_type(topology, type);
    return n > 0 ? n : 0;
}

int dmk_machine_get_info(dmk_context *ctx, dmk_machine_info *info)
{
    hwloc_topology_t topology;
    if (dmk_missing(ctx, "info", info)) return DMK_E_ARG;
    *info = (dmk_machine_info){0};
    if (hwloc_topology_init(&topology) != 0) {
        return dmk_fail(ctx, DMK_E_NOMEM, "hwloc cannot set up a topology");
    }
    if (hwloc_topology_load(topology) != 0) {
        hwloc_topology_destroy(topology);
        return dmk_fail(ctx, DMK_E_DEVICE, "hwloc cannot read the machine's topology");
    }
    info->packages = count_of(topology, HWLOC_OBJ_PACKAGE);
    info->numa_nodes = count_of(topology, HWLOC_OBJ_NUMANODE);
    info->cores = count_of(topology, HWLOC_OBJ_CORE);
    info->threads = count_of(topology, HWLOC_OBJ_PU);
    info->l1 = cache_bytes(topology, HWLOC_OBJ_L1CACHE);
    info->l2 = cache_bytes(topology, HWLOC_OBJ_L2CACHE);
    info->l3 = cache_bytes(topology, HWLOC_OBJ_L3CACHE);
    info->memory = hwloc_get_root_obj(topology)->total_memory;
    hwloc_topology_destroy(topology);
    return DMK_OK;
}
