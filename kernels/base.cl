/* Vocabulary of all kernels. One source, two work shapes:
 *   CPU: a work-item runs over DMK_CHUNK blocks of 8 elements, each block as an 8-vector;
 *   GPU: a work-item is one element; groups of DMK_GROUP.
 * In both, element t's k-th of K numbers lies at (t/8)*8K + 8k + t%8, so one packing serves both.
 * Build options: DMK_CPU, DMK_CHUNK, DMK_DOUBLE (this program's real type), DMK_FP64 (the device's
 * double precision may be used for sums). */
#if DMK_FP64
#pragma OPENCL EXTENSION cl_khr_fp64 : enable
typedef double sum_t;
#else
typedef float sum_t;
#endif
#if DMK_DOUBLE
typedef double real;
#else
typedef float real;
#endif

#if DMK_CPU
typedef int8 intv;
typedef float8 floatv;
#if DMK_DOUBLE
typedef double8 realv;
#define TO_REAL(v) convert_double8(v)
#else
typedef float8 realv;
#define TO_REAL(v) convert_float8(v)
#endif
#if DMK_FP64
typedef double8 sumv;
#define TO_SUM(v) convert_double8(v)
#else
typedef float8 sumv;
#define TO_SUM(v) convert_float8(v)
#endif
#define TO_FLOAT(v) convert_float8(v)
/* Gathers through a volatile pointer: scalar loads, which CPUs do faster than vector gathers. */
#define GATHERED const volatile global
#define GATHER(p, i)                                                                               \
    (p)[i.s0], (p)[i.s1], (p)[i.s2], (p)[i.s3], (p)[i.s4], (p)[i.s5], (p)[i.s6], (p)[i.s7]
#define FOR_PART_BLOCKS(b, n)                                                                      \
    for (int b = part * DMK_CHUNK,                                                                 \
             b##_end = min(b + DMK_CHUNK, ((n) + DMK_WIDTH - 1) / DMK_WIDTH);                      \
         b < b##_end; b++)
#define FOR_BLOCKS(b, n) FOR_PARTS FOR_PART_BLOCKS(b, n)
#define AT(b) (DMK_WIDTH * (b))
#define AT_K(b, k, K) (DMK_WIDTH * ((K) * (b) + (k)))
#define SLICE(b) (b)
#define COLUMN(b, j) (DMK_WIDTH * (j))
#define LOAD(p, at) vload8(0, (p) + (at))
#define STORE(v, p, at) vstore8((v), 0, (p) + (at))
#define SELECT(no, yes, when) select((no), (yes), (when))
/* One row at a time, for work that does not go in blocks. */
#define FOR_ROWS(i, n)                                                                             \
    FOR_PARTS for (int i = part * DMK_CHUNK * DMK_WIDTH,                                           \
             i##_end = min(i + DMK_CHUNK * DMK_WIDTH, (n));                                        \
         i < i##_end; i++)
#else
typedef int intv;
typedef float floatv;
typedef real realv;
typedef sum_t sumv;
#define TO_REAL(v) ((real)(v))
#define TO_SUM(v) ((sum_t)(v))
#define TO_FLOAT(v) ((float)(v))
#define GATHERED const global
#define GATHER(p, i) (p)[i]
#define FOR_BLOCKS(b, n) for (int b = (int)get_global_id(0), b##_once = b < (n); b##_once; b##_once = 0)
#define FOR_PART_BLOCKS FOR_BLOCKS
#define AT(b) (b)
#define AT_K(b, k, K) (DMK_WIDTH * ((K) * ((b) / DMK_WIDTH) + (k)) + (b) % DMK_WIDTH)
#define SLICE(b) ((b) / DMK_WIDTH)
#define COLUMN(b, j) (DMK_WIDTH * (j) + (b) % DMK_WIDTH)
#define LOAD(p, at) (p)[at]
#define STORE(v, p, at) (p)[at] = (v)
#define FOR_ROWS(i, n) FOR_BLOCKS(i, n)
#endif

/* Work distribution in the CPU shape. Drivers hand work-groups to their threads as they come, so that what
 * one core has written another reads in the next kernel; between cores that do not share a cache this
 * costs more than the work. Here the work is cut into parts (DMK_CHUNK blocks each), every thread has a
 * share of them, the same one in launch after launch, and a work-group does the parts of its thread's
 * share one by one. Then it helps where a thread has not come at all, or is far behind. Which thread
 * does a part changes no result: sums are kept by part.
 *   launch  the launch's tag, threads (0: each work-group does the part of its number), parts of the
 *           first range (see dmk_range), parts
 *   shares  a word for each thread on a line of its own: tag << 21 | the thread has come << 20 | parts
 *           taken; then their keys */
#if DMK_CPU
static int take_part(volatile global int *word, int tag, int size, int mine)
{
    int old = *word;
    for (;;) {
        const bool fresh = old >> 21 == tag;
        const int taken = fresh ? old & 0xfffff : 0, come = mine || (fresh && (old >> 20 & 1));
        /* Who has come will do the last quarter of its share. */
        if (taken >= (mine || !come ? size : size - size / 4)) return -1;
        const int seen = atomic_cmpxchg(word, old, tag << 21 | come << 20 | (taken + 1));
        if (seen == old) return taken;
        old = seen;
    }
}

/* Threads are told apart by where their stacks lie; a mistake costs time only. */
static int thread_number(volatile global int *keys, int threads)
{
    int here;
    const int key = (int)((ulong)&here >> 20);
    for (int i = 0; i < threads; i++) {
        int seen = keys[i];
        if (seen == 0) seen = atomic_cmpxchg(&keys[i], 0, key);
        if (seen == 0 || seen == key) return i;
    }
    return (uint)key % (uint)threads;
}

/* The work-group's next part, or -1. `at`: its thread and how many shares it has been through. */
static int next_part(volatile global int *shares, int4 launch, int *at)
{
    const int tag = launch.s0, threads = launch.s1, first = launch.s2, second = launch.s3 - first;
    if (threads == 0) return at[1]++ == 0 ? (int)get_group_id(0) : -1;
    if (at[0] < 0) at[0] = thread_number(shares + DMK_LINE * threads, threads);
    for (; at[1] < threads; at[1]++) {
        const int t = (at[0] + at[1]) % threads;
        const int f = first * t / threads, n_f = first * (t + 1) / threads - f;
        const int s = second * t / threads, n_s = second * (t + 1) / threads - s;
        const int k = take_part(shares + DMK_LINE * t, tag, n_f + n_s, at[1] == 0);
        if (k >= 0) return k < n_f ? f + k : first + s + k - n_f;
    }
    return -1;
}

#define LAUNCH , volatile global int *shares_, int4 launch_
#define FOR_PARTS                                                                                  \
    for (int at_[2] = {-1, 0}, part = next_part(shares_, launch_, at_); part >= 0;                 \
         part = next_part(shares_, launch_, at_))
#else
#define LAUNCH
#define FOR_PARTS
#endif

/* Sums: each part (a work-group in the GPU shape) leaves one partial sum per quantity k at
 * partial[k * parts + part]. The order of additions is fixed by the number of items, so the same launch
 * gives the same bits. */
#if DMK_CPU
#define REDUCE(partial, k, v)                                                                      \
    (partial)[(k) * launch_.s3 + part] =                                                           \
        (((v).s0 + (v).s1) + ((v).s2 + (v).s3)) + (((v).s4 + (v).s5) + ((v).s6 + (v).s7))
#define REDUCE_MAX(partial, k, v)                                                                  \
    (partial)[(k) * launch_.s3 + part] =                                                           \
        fmax(fmax(fmax((v).s0, (v).s1), fmax((v).s2, (v).s3)),                                     \
             fmax(fmax((v).s4, (v).s5), fmax((v).s6, (v).s7)))
#define SCRATCH
#define KERNEL kernel __attribute__((reqd_work_group_size(1, 1, 1))) void
#else
#define TREE(partial, k, v, OP)                                                                    \
    {                                                                                              \
        int l_ = (int)get_local_id(0);                                                             \
        scratch[l_] = (v);                                                                         \
        for (int s_ = DMK_GROUP / 2; s_ > 0; s_ /= 2) {                                            \
            barrier(CLK_LOCAL_MEM_FENCE);                                                          \
            if (l_ < s_) scratch[l_] = OP(scratch[l_], scratch[l_ + s_]);                          \
        }                                                                                          \
        if (l_ == 0) (partial)[(k) * get_num_groups(0) + get_group_id(0)] = scratch[0];            \
        barrier(CLK_LOCAL_MEM_FENCE);                                                              \
    }
#define ADD(a, b) ((a) + (b))
#define REDUCE(partial, k, v) TREE(partial, k, v, ADD)
#define REDUCE_MAX(partial, k, v) TREE(partial, k, v, fmax)
#define SCRATCH local sum_t scratch[DMK_GROUP];
#define KERNEL kernel __attribute__((reqd_work_group_size(DMK_GROUP, 1, 1))) void
#endif

/* The sum of all partial sums of quantity k, by one work-group; the result is in every work-item. */
#if DMK_CPU
#define GATHER_SUM(sum, partial, k, groups)                                                        \
    sum_t sum = 0;                                                                                 \
    for (int g_ = 0; g_ < (groups); g_++) sum += (partial)[(k) * (groups) + g_];
#define GATHER_MAX(sum, partial, k, groups)                                                        \
    sum_t sum = (partial)[(k) * (groups)];                                                         \
    for (int g_ = 1; g_ < (groups); g_++) sum = fmax(sum, (partial)[(k) * (groups) + g_]);
#define FIRST_ITEM 1
#else
#define GATHER_TREE(sum, partial, k, groups, zero, OP)                                             \
    sum_t sum = zero;                                                                              \
    {                                                                                              \
        int l_ = (int)get_local_id(0);                                                             \
        for (int g_ = l_; g_ < (groups); g_ += DMK_GROUP) sum = OP(sum, (partial)[(k) * (groups) + g_]);\
        scratch[l_] = sum;                                                                         \
        for (int s_ = DMK_GROUP / 2; s_ > 0; s_ /= 2) {                                            \
            barrier(CLK_LOCAL_MEM_FENCE);                                                          \
            if (l_ < s_) scratch[l_] = OP(scratch[l_], scratch[l_ + s_]);                          \
        }                                                                                          \
        barrier(CLK_LOCAL_MEM_FENCE);                                                              \
        sum = scratch[0];                                                                          \
        barrier(CLK_LOCAL_MEM_FENCE);                                                              \
    }
#define GATHER_SUM(sum, partial, k, groups) GATHER_TREE(sum, partial, k, groups, 0, ADD)
#define GATHER_MAX(sum, partial, k, groups)                                                        \
    GATHER_TREE(sum, partial, k, groups, (partial)[(k) * (groups)], fmax)
#define FIRST_ITEM (get_local_id(0) == 0)
#endif
