/* How much memory the C library's heap keeps for what comes next. All of it is for speed, and for GNU's only. */
#include "cli.h"

#include <limits.h>
#include <stdint.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <sys/stat.h>

#ifdef __GLIBC__
#include <malloc.h>
#endif

/* Bytes. Beyond the first memory is taken from the system by the piece; beyond the second the heap gives back what is
 * free at its end. */
static void set_heap(int piece, int kept)
{
#ifdef __GLIBC__
    mallopt(M_MMAP_THRESHOLD, piece);
    mallopt(M_TRIM_THRESHOLD, kept);
#else
    (void)piece, (void)kept;
#endif
}

/* A solve of 273,000 triangles has 88,000 page faults, with halves of them 97,000, with the C library's own 108,000
 * (and 373 MB for 387). */
static const int piece = 64 << 20, kept = 128 << 20;

void cli_keep_memory(void)
{
#ifdef __GLIBC__
    /* What one thread frees another may use again: threads with heaps of their own keep it. */
    mallopt(M_ARENA_MAX, 1);
#endif
    set_heap(piece, kept);
}

void cli_trim_memory(void)
{
#ifdef __GLIBC__
    malloc_trim(0);
#endif
}

enum { LARGE = 500000 }; /* triangles */

/* Of a large mesh the larger arrays go back to the system when they are freed: a solve of 1,094,000 triangles takes
 * 901 MB and 3.26 s then, 956 MB and 3.39 s with 32 and 64 MB. */
static const int large_piece = 20 << 20, large_kept = 32 << 20;
/* Of ranks that have no more than a share of the mesh in the end, where memory counts most, all but the small ones: 290
 * MB for each of four, with the sizes above 318. One process takes 862 MB and 3.61 s so, and two ranks that have all of
 * the mesh 804,000 page faults for 505,000, and 0.3 s longer. */
static const int share_piece = 3 << 19, share_kept = 2 << 20;

void cli_save_memory(const dmk_mesh *mesh, bool shares)
{
    dmk_mesh_info info;
    dmk_mesh_get_info(mesh, &info);
    if (info.n_triangles < LARGE) return;
    set_heap(shares ? share_piece : large_piece, shares ? share_kept : large_kept);
    cli_trim_memory();
}

/* Space of the heap that is used next, in huge pages: memory is taken only where it is written, and then with a fault
 * for each 2 MB. */
static void make_room(size_t bytes)
{
#if defined(__GLIBC__) && defined(MADV_HUGEPAGE)
    enum { PAGE = 2 << 20, MOST = INT_MAX - 2 * PAGE };
    bytes = (bytes < MOST ? bytes : MOST) / PAGE * PAGE;
    if (bytes == 0) return;
    set_heap(INT_MAX, INT_MAX);
    char *heap = malloc(bytes + PAGE);
    if (heap) madvise(heap + PAGE - (uintptr_t)heap % PAGE, bytes, MADV_HUGEPAGE);
    free(heap);
#else
    (void)bytes;
#endif
}

void cli_make_room(const dmk_mesh *mesh)
{
    enum { PER_TRIANGLE = 1024 };
    dmk_mesh_info info;
    dmk_mesh_get_info(mesh, &info);
    const size_t size = info.n_triangles * PER_TRIANGLE;
    if (info.n_triangles >= LARGE) return;
    make_room(size);
    set_heap(piece, kept + (int)size);
}

/* Distances take 7 to 20 bytes for each of the file; what is not used costs nothing. */
void cli_make_room_for_file(const char *path)
{
    enum { PER_BYTE = 24 };
    struct stat file;
    if (stat(path, &file) == 0 && S_ISREG(file.st_mode)) make_room((size_t)file.st_size * PER_BYTE);
}
