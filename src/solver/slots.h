/* Where the numbers of elements and rows lie in arrays on the device. */
#ifndef DMK_SLOTS_H
#define DMK_SLOTS_H

#include <stddef.h>
#include <stdint.h>

/* Items and slots of a mesh's system: see the head of system.h. */
typedef struct dmk_counts {
    int32_t n_elements, n_elements_pad, n_edges, n_vertices, vertex_row, n_rows, n_rows_pad;
} dmk_counts;

/* Where element t's k-th of K numbers lies. */
static inline size_t dmk_slot(int32_t t, int k, int K)
{
    return (size_t)(t / 8) * 8 * (size_t)K + 8 * (size_t)k + (size_t)(t % 8);
}

#endif
