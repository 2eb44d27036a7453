/* Halos between ranks: what others read of a vector goes into one message, what they sent to its places.
 * Numbers of the program's working type, or integers of its size: they are only copied. */

#if DMK_DOUBLE
typedef ulong word_t;
#else
typedef uint word_t;
#endif

/* packed[k] = x[place[k]]
 * reads place, x (gathered); writes packed; moves 4 N + 2 real N bytes, 0 flops; shape rows */
KERNEL halo_pack(int n, global const int *restrict place, global const word_t *restrict x,
                 global word_t *restrict packed, volatile global int *shares, int4 launch)
{
    FOR_ROWS(k, n, shares, launch) { packed[k] = x[place[k]]; }
}

/* x[place[k]] = packed[k]; the places differ.
 * reads place, packed; writes x (scattered); moves 4 N + 2 real N bytes, 0 flops; shape rows */
KERNEL halo_unpack(int n, global const int *restrict place, global const word_t *restrict packed,
                   global word_t *restrict x, volatile global int *shares, int4 launch)
{
    FOR_ROWS(k, n, shares, launch) { x[place[k]] = packed[k]; }
}
