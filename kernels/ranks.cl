/* Halos between ranks: what others read of a vector goes into one message, what they sent to its places.
 * Numbers of the program's working type, or integers of its size: they are only copied. */

#if DMK_DOUBLE
typedef ulong word_t;
#else
typedef uint word_t;
#endif

/* packed[k] = x[place[k]]; for each of n items reads a place and a number, and writes a number. */
KERNEL halo_pack(int n, global const int *place, global const word_t *x, global word_t *packed LAUNCH)
{
    FOR_ROWS(k, n) { packed[k] = x[place[k]]; }
}

/* x[place[k]] = packed[k]; the places differ. */
KERNEL halo_unpack(int n, global const int *place, global const word_t *packed, global word_t *x LAUNCH)
{
    FOR_ROWS(k, n) { x[place[k]] = packed[k]; }
}
