/* Halos between ranks: what others read of a vector goes into one message, what they sent to its slots.
 * Numbers of the program's working type, or integers of its size: they are only copied. */

#if DMK_DOUBLE
typedef ulong word_t;
#else
typedef uint word_t;
#endif

/* packed[k] = x[slot[k]]
 * reads slot, x (gathered); writes packed; moves 4 N + 2 real N bytes, 0 flops; shape rows */
KERNEL halo_pack(int n, global const int *restrict slot, global const word_t *restrict x,
                 global word_t *restrict packed, volatile global int *shares, int4 launch)
{
    FOR_ROWS(k, n, shares, launch) { packed[k] = x[slot[k]]; }
}

/* x[slot[k]] = packed[k]; the slots differ.
 * reads slot, packed; writes x (scattered); moves 4 N + 2 real N bytes, 0 flops; shape rows */
KERNEL halo_unpack(int n, global const int *restrict slot, global const word_t *restrict packed,
                   global word_t *restrict x, volatile global int *shares, int4 launch)
{
    FOR_ROWS(k, n, shares, launch) { x[slot[k]] = packed[k]; }
}
