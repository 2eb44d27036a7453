/* Constants of both sides, host and device. */
#ifndef DMK_SHARED_H
#define DMK_SHARED_H

#define DMK_WIDTH 8   /* elements per block of the interleaved arrays */
#define DMK_LINE 32   /* ints apart that two threads may write without taking a cache line away */
#define DMK_GROUP 256 /* work-items per group in the GPU shape */
#define DMK_DENSE                                                                                  \
    160 /* rows of the coarsest level that one work-group inverts; there are up to 96, or more
                         where coarsening stalls */

#endif
