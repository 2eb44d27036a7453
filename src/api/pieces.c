/* A file read as a mesh in pieces. */
#include "io/dealt.h"
#include "ranks/pieces.h"

#include <stdlib.h>

int dmk_pieces_read(dmk_context *ctx, const char *path, const dmk_ranks *ranks, dmk_pieces **pieces)
{
    int rc;
    bool all;
    uint64_t bytes;
    dmk_dealt own = {0};
    if (dmk_missing(ctx, "path", path, "pieces", pieces)) return DMK_E_ARG;
    *pieces = NULL;
    if (ranks && dmk_ranks_given(ctx, ranks) != DMK_OK) return DMK_E_ARG;
    if (!ranks || ranks->size < 2) return DMK_OK;
    DMK_TRY(dmk_stage_begin(ctx, "read"));
    DMK_TRY(dmk_dealt_read(ctx, path, ranks, &own, &bytes, &all));
    if (!all) goto done;
    rc = dmk_pieces_adopt(ctx, ranks, (int64_t)own.all_vertices, own.xyz,
                          (int64_t)own.all_triangles, own.triangle, pieces);
    if (rc != DMK_OK) rc = dmk_name_file(ctx, path, rc);
done:
    dmk_stage_end(ctx);
    return rc;
}
