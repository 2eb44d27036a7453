/* Sparse rows in sliced ELLPACK, SELL-8: 8 rows to a slice, all rows of a slice as long as its longest
 * (Monakov, Lokhmotov and Avetisyan, HiPEAC 2010; Kreutzer et al., SIAM J. Sci. Comput. 36(5), 2014). */
#ifndef DMK_SELL_H
#define DMK_SELL_H

#include "base/base.h"

typedef struct dmk_sell {
    int32_t n_slices;
    int32_t *slice; /* n_slices + 1: first column of each slice */
    int32_t *entry; /* 8 * slice[n_slices]: entry of row 8s + l in column j at 8j + l */
    float *weight;  /* the same slots; NULL where the rows have none */
} dmk_sell;

/* From compressed rows (row: n + 1, entry, weight or NULL). Places past a row's end get `filler`, or
 * the row's own number if filler is -1, and weight 0. Every slice has at least one column. */
int dmk_sell_create(dmk_context *context, int32_t n, const int32_t *row, const int32_t *entry,
                    const float *weight, int32_t filler, dmk_sell *sell);
void dmk_sell_free(dmk_sell *sell);

/* Round up to whole blocks of 8, with at least one spare slot. */
static inline int32_t dmk_padded(int32_t n)
{
    return (n / 8 + 1) * 8;
}

#endif
