/* Constants of both sides, host and device. */
#ifndef DMK_SHARED_H
#define DMK_SHARED_H

#define DMK_WIDTH 8     /* elements per block of the interleaved arrays */
#define DMK_LINE 32     /* ints apart that two threads may write without taking a cache line away */
#define DMK_GROUP 256   /* work-items per group in the GPU shape */
#define DMK_ABREAST 32  /* of these, that read a matrix' line together, or sum up one quantity */
#define DMK_MOST_SUMS 6 /* quantities that a kernel sums, at most DMK_GROUP / DMK_ABREAST */
/* Over more than DMK_FAR rows (of T/2; half a million triangles) a CPU's caches do not hold what rows gather from
 * elements, and no processor foresees it: the lines are asked for DMK_AHEAD columns of the lists before, by which these
 * are longer than they need be. A x of 1.09 million triangles takes 5.7 to 5.9 ms with 32 to 96 columns, 6.1 with 16
 * or 128, 7.2 with 8, 8.8 without; a whole solve 0.88. Others without and with: 273,000 triangles 1.01 and 1.25 ms,
 * 401,000 1.63 and 1.73, 524,000 2.71 and 2.35, 739,000 3.9 and 3.6. */
#ifndef DMK_FAR /* 0 in make check-kernels: all rows ask */
#define DMK_FAR 1000000
#endif
#define DMK_AHEAD 32
/* What an energy leaves beside its sums: bits of a mask. */
#define DMK_KEEP_Q 1
#define DMK_KEEP_G 2
/* Partial sums are added one after the other up to DMK_SUM_SHORT of them, which take a network of 20 GB/s no
 * longer than its latency of 3 us. Of more, DMK_SUM_BLOCK that follow each other are one sum first, and ranks
 * tell each other those: the fewest with which a work-group of a GPU has as many to add in turn as before. */
#define DMK_SUM_SHORT 8192
#define DMK_SUM_BLOCK (DMK_SUM_SHORT / DMK_GROUP)
/* Rows of the coarsest level that one work-group inverts; there are up to 96, or more where coarsening stalls. */
#define DMK_DENSE 160

/* The Galerkin tables' coefficients are whole numbers of 1 / this: the square of DMK_WEIGHT_PARTS. */
#define DMK_GALERKIN_PARTS 16384

/* Smoothing steps on levels of a few thousand rows, an even number up to 8: see multigrid.c. */
#define DMK_TAIL_STEPS 8

/* The levels of a few thousand rows, which one work-group does in one launch: their arrays lie in one buffer,
 * and a table has so many numbers for each level: its rows, edges and, counted in numbers of 4 bytes, where
 * its arrays begin. */
#define DMK_TAIL_ROWS 0
#define DMK_TAIL_PAD 1
#define DMK_TAIL_EDGES 2
#define DMK_TAIL_SLICE 3
#define DMK_TAIL_NEIGHBOUR 4
#define DMK_TAIL_NUMBER 5
#define DMK_TAIL_WEIGHT 6
#define DMK_TAIL_EDGE 7
#define DMK_TAIL_INV_DIAG 8
#define DMK_TAIL_RHS 9
#define DMK_TAIL_X 10
#define DMK_TAIL_X_OLD 11
#define DMK_TAIL_RESTRICT_SLICE 12
#define DMK_TAIL_RESTRICT_ENTRY 13
#define DMK_TAIL_RESTRICT_WEIGHT 14
#define DMK_TAIL_PROLONG_INDEX 15
#define DMK_TAIL_PROLONG_WEIGHT 16
#define DMK_TAIL_GALERKIN_ROW 17
#define DMK_TAIL_GALERKIN_EDGE 18
#define DMK_TAIL_GALERKIN_COEF 19
#define DMK_TAIL_FIELDS 20

#endif
