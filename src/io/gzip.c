/* Files packed by gzip, unpacked in memory by zlib. */
#include "io/io.h"

#include <stdlib.h>
#include <zlib.h>

#define CHUNK ((size_t)16 << 20) /* some 50 ms of work; zlib counts in 32 bits */
/* Meshes shrink to a hundredth at most. What unpacks to more than this is no mesh, and is not let to fill
 * the memory; short files may. */
#define MOST_TIMES 500
#define SHORT ((size_t)64 << 20)

/* Unpack all members of the file, one behind the other as gzip allows, with zeros behind them, into out. */
static int inflate_all(dmk_context *ctx, z_stream *z, const dmk_file *file, dmk_file *out)
{
    size_t room = 0, read = 0;
    int status = Z_OK;
    for (;;) {
        const int rc = dmk_poll(ctx);
        if (rc != DMK_OK) return rc;
        if (out->size > SHORT && out->size / MOST_TIMES > file->size) {
            return dmk_fail(ctx, DMK_E_FORMAT,
                            "%s: unpacks to more than %d times its size, as no mesh "
                            "does",
                            file->path, MOST_TIMES);
        }
        if (out->size == room) {
            room = room ? 2 * room : 4 * file->size + 1024;
            char *bigger = realloc(out->data, room + 1);
            if (!bigger) {
                return dmk_fail(ctx, DMK_E_NOMEM, "%s: out of memory: %zu bytes when unpacked",
                                file->path, room);
            }
            out->data = bigger;
        }
        size_t n_in = file->size - read, n_out = room - out->size;
        z->next_in = (Bytef *)file->data + read;
        z->avail_in = (uInt)(n_in < CHUNK ? n_in : CHUNK);
        z->next_out = (Bytef *)out->data + out->size;
        z->avail_out = (uInt)(n_out < CHUNK ? n_out : CHUNK);
        status = inflate(z, Z_NO_FLUSH);
        read = (size_t)((char *)z->next_in - file->data);
        out->size = (size_t)((char *)z->next_out - out->data);
        if (status == Z_STREAM_END) {
            while (read < file->size && file->data[read] == 0) read++;
            if (read == file->size) return DMK_OK;
            status = inflateReset(z);
        }
        if (status == Z_MEM_ERROR) return dmk_fail(ctx, DMK_E_NOMEM, "out of memory: unpacking");
        if (status != Z_OK && !(status == Z_BUF_ERROR && out->size == room)) {
            return dmk_fail(ctx, DMK_E_FORMAT, "%s: damaged: cannot unpack it (%s); get it again",
                            file->path, z->msg ? z->msg : "it is cut short");
        }
    }
}

bool dmk_gzip_sniff(const dmk_file *file)
{
    return file->size > 18 && (unsigned char)file->data[0] == 0x1f &&
           (unsigned char)file->data[1] == 0x8b;
}

int dmk_gzip_unpack(dmk_context *ctx, dmk_file *file)
{
    dmk_file out = {.path = file->path};
    z_stream z = {0};
    if (inflateInit2(&z, 15 + 16) != Z_OK) { /* 16: gzip's header, not zlib's */
        return dmk_fail(ctx, DMK_E_NOMEM, "out of memory: unpacking");
    }
    int rc = inflate_all(ctx, &z, file, &out);
    inflateEnd(&z);
    if (rc == DMK_OK && out.size == 0) {
        rc = dmk_fail(ctx, DMK_E_FORMAT, "%s: contains nothing", file->path);
    }
    if (rc != DMK_OK) {
        free(out.data);
        return rc;
    }
    out.data[out.size] = '\0';
    free(file->data);
    *file = out;
    return DMK_OK;
}
