/* Loops on the host's threads. */
#ifndef DMK_PARALLEL_H
#define DMK_PARALLEL_H

#include <stdbool.h>
#include <stdint.h>

/* Call body(begin, end, data) on disjoint ranges that cover 0..n, on one thread per processor;
 * short loops stay on the calling thread. The result must not depend on how the range is cut. */
void dmk_parallel(int32_t n, void (*body)(int32_t begin, int32_t end, void *data), void *data);

/* The smallest i in 0..n with bad(i, data), or -1: a check of many items that names the first culprit. */
int32_t dmk_parallel_first(int32_t n, bool (*bad)(int32_t i, void *data), void *data);

#endif
