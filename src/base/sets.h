/* Disjoint sets of 0..n-1 (union-find): parent[i] = i at first. A set's name is its least member.
 */
#ifndef DMK_SETS_H
#define DMK_SETS_H

#include "base/base.h"

static inline int32_t dmk_set_find(int32_t *parent, int32_t i)
{
    while (parent[i] != i) i = parent[i] = parent[parent[i]];
    return i;
}

/* False if a and b were in one set already. */
static inline bool dmk_set_unite(int32_t *parent, int32_t a, int32_t b)
{
    a = dmk_set_find(parent, a);
    b = dmk_set_find(parent, b);
    if (a == b) return false;
    parent[dmk_max_i(a, b)] = dmk_min_i(a, b);
    return true;
}

#endif
