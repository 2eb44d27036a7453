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
#define FOR_BLOCKS(b, n)                                                                           \
    for (int b = (int)get_group_id(0) * DMK_CHUNK,                                                 \
             b##_end = min(b + DMK_CHUNK, ((n) + DMK_WIDTH - 1) / DMK_WIDTH);                      \
         b < b##_end; b++)
#define AT(b) (DMK_WIDTH * (b))
#define AT_K(b, k, K) (DMK_WIDTH * ((K) * (b) + (k)))
#define SLICE(b) (b)
#define COLUMN(b, j) (DMK_WIDTH * (j))
#define LOAD(p, at) vload8(0, (p) + (at))
#define STORE(v, p, at) vstore8((v), 0, (p) + (at))
#define SELECT(no, yes, when) select((no), (yes), (when))
/* One row at a time, for work that does not go in blocks. */
#define FOR_ROWS(i, n)                                                                             \
    for (int i = (int)get_group_id(0) * DMK_CHUNK * DMK_WIDTH,                                     \
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
#define AT(b) (b)
#define AT_K(b, k, K) (DMK_WIDTH * ((K) * ((b) / DMK_WIDTH) + (k)) + (b) % DMK_WIDTH)
#define SLICE(b) ((b) / DMK_WIDTH)
#define COLUMN(b, j) (DMK_WIDTH * (j) + (b) % DMK_WIDTH)
#define LOAD(p, at) (p)[at]
#define STORE(v, p, at) (p)[at] = (v)
#define FOR_ROWS(i, n) FOR_BLOCKS(i, n)
#endif

/* Sums: each work-group leaves one partial sum per quantity k at partial[k * groups + group]. The
 * order of additions is fixed by the launch, so the same launch gives the same bits. */
#if DMK_CPU
#define REDUCE(partial, k, v)                                                                      \
    (partial)[(k) * get_num_groups(0) + get_group_id(0)] =                                         \
        (((v).s0 + (v).s1) + ((v).s2 + (v).s3)) + (((v).s4 + (v).s5) + ((v).s6 + (v).s7))
#define REDUCE_MAX(partial, k, v)                                                                  \
    (partial)[(k) * get_num_groups(0) + get_group_id(0)] =                                         \
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
        for (int g_ = l_; g_ < (groups); g_ += DMK_GROUP) sum = OP(sum, (partial)[(k) * (groups) + g_]); \
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
