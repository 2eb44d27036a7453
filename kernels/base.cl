/* Vocabulary of all kernels. One source, two work shapes:
 *   CPU: a work-item runs over DMK_CHUNK blocks of 8 elements, each block as an 8-vector;
 *   GPU: a work-item is one element; groups of DMK_GROUP.
 * In both, element t's k-th of K numbers lies at (t/8)*8K + 8k + t%8, so one packing serves both.
 *
 * Every kernel ends with the arguments `shares` and `launch`, the distribution of its work (below); those
 * that sum have `partial`, `at`, `scalars` and `done` before (see struct sums). Above each stands
 *   reads, writes   its arrays, but for these
 *   moves           the bytes of its streams once and of its vectors once (a gather counts as one pass over
 *                   the vector it gathers from), and the flops; `make bench-kernels` reads them. E elements,
 *                   R rows of T/2, P entries of their lists, V vertices of a level, L entries of its lists,
 *                   C entries of the lists of its transfer, K its edges, N what the first argument counts,
 *                   real: bytes of the program's number
 *   shape           what is handed out: blocks of 8, single rows, or all to one work-group
 *   numerics        precision and order, where it is not simply the program's and that of the lists
 * Arrays are `restrict`, but for those of atomic operations, and but for r and its
 * narrow copy, which are one where the program works in single precision.
 * Build options: DMK_CPU, DMK_CHUNK, DMK_DOUBLE (this program's real type), DMK_FP64 (the device's
 * double precision may be used for sums), DMK_POCL (the compiler is PoCL's), DMK_GATHERS (vector gathers, on a CPU),
 * DMK_LONE_GROUP (work-items of a kernel that one work-group does). */
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
/* Gathers through a volatile pointer: scalar loads, which most CPUs do faster than vector gathers. And with places
 * without sign, which need not be extended: 0.91 of the time of a smoothing step on T, 0.93 on T/2. */
#if DMK_GATHERS
#define GATHERED const global
#define PLACE(i) (i)
#else
#define GATHERED const volatile global
#define PLACE(i) ((uint)(i))
#endif
#define GATHER(p, i)                                                                               \
    (p)[PLACE(i.s0)], (p)[PLACE(i.s1)], (p)[PLACE(i.s2)], (p)[PLACE(i.s3)], (p)[PLACE(i.s4)],      \
        (p)[PLACE(i.s5)], (p)[PLACE(i.s6)], (p)[PLACE(i.s7)]
/* The blocks of a part; of all parts that are this work-group's. */
#define FOR_PART_BLOCKS(b, n, part)                                                                \
    for (int b = (part) * DMK_CHUNK,                                                               \
             b##_end = min(b + DMK_CHUNK, ((n) + DMK_WIDTH - 1) / DMK_WIDTH);                      \
         b < b##_end; b++)
#define FOR_BLOCKS(b, n, shares, launch)                                                           \
    FOR_PARTS(b##_part, shares, launch) FOR_PART_BLOCKS(b, n, b##_part)
#define AT(b) (DMK_WIDTH * (b))
#define AT_K(b, k, K) (DMK_WIDTH * ((K) * (b) + (k)))
#define SLICE(b) (b)
#define COLUMN(b, j) (DMK_WIDTH * (j))
#define LOAD(p, at) vload8(0, (p) + (at))
#define STORE(v, p, at) vstore8((v), 0, (p) + (at))
#define SELECT(no, yes, when) select((no), (yes), (when))
/* One row at a time, for work that does not go in blocks. */
#define PART_ITEMS (DMK_CHUNK * DMK_WIDTH)
/* Ask for the lines of what is gathered soon. Other drivers' global pointers may not be the compiler's. */
#if DMK_POCL
#define FETCH(p, i) __builtin_prefetch((const void *)(size_t)((p) + (i)))
#else
#define FETCH(p, i) (void)(i)
#endif
#define GATHERS_LATER(p, i)                                                                        \
    FETCH(p, i.s0); FETCH(p, i.s1); FETCH(p, i.s2); FETCH(p, i.s3); FETCH(p, i.s4); FETCH(p, i.s5); \
    FETCH(p, i.s6); FETCH(p, i.s7)
/* Whether a launch over rows gathers from memory. */
#define IS_FAR(launch) ((launch).s3 > DMK_FAR / PART_ITEMS)
#define FOR_PART_ROWS(i, n, part)                                                                  \
    for (int i = (part) * PART_ITEMS, i##_end = min(i + PART_ITEMS, (n)); i < i##_end; i++)
#define FOR_ROWS(i, n, shares, launch)                                                             \
    FOR_PARTS(i##_part, shares, launch) FOR_PART_ROWS(i, n, i##_part)
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
#define FOR_PART_BLOCKS(b, n, part)                                                                \
    for (int b = (part) * DMK_GROUP + (int)get_local_id(0), b##_once = b < (n); b##_once;          \
         b##_once = 0)
#define FOR_BLOCKS(b, n, shares, launch)                                                           \
    FOR_PART_BLOCKS(b, n, part_of_group(shares, launch))
#define AT(b) (b)
#define AT_K(b, k, K) (DMK_WIDTH * ((K) * ((b) / DMK_WIDTH) + (k)) + (b) % DMK_WIDTH)
#define SLICE(b) ((b) / DMK_WIDTH)
#define COLUMN(b, j) (DMK_WIDTH * (j) + (b) % DMK_WIDTH)
#define LOAD(p, at) (p)[at]
#define STORE(v, p, at) (p)[at] = (v)
#define PART_ITEMS DMK_GROUP
#define GATHERS_LATER(p, i) (void)(i)
#define IS_FAR(launch) false
#define FOR_PART_ROWS(i, n, part) FOR_PART_BLOCKS(i, n, part)
#define FOR_ROWS(i, n, shares, launch) FOR_BLOCKS(i, n, shares, launch)
#endif

/* A short loop over a work-item's own arrays. They stay in registers only where it is unrolled: the repair's elements
 * take twice as long else. */
#define EACH(k, n) _Pragma("unroll") for (int k = 0; k < (n); k++)

/* Two numbers for each slot, side by side, so that both are found by one gather. */
typedef struct two {
    floatv first, second;
} two;

#if DMK_CPU
#if DMK_FP64
typedef double both_t; /* of both at once */
typedef double8 bothv;
#else
typedef long both_t;
typedef long8 bothv;
#endif

static void store_pairs(floatv a, floatv b, global float *p, int at)
{
    vstore16((float16)(a.s0, b.s0, a.s1, b.s1, a.s2, b.s2, a.s3, b.s3, a.s4, b.s4, a.s5, b.s5, a.s6,
                       b.s6, a.s7, b.s7),
             0, p + 2 * at);
}

static two gather_pairs(GATHERED float *p, intv i)
{
    const bothv both = (bothv)(GATHER((GATHERED both_t *)p, i));
    const float16 x = as_float16(both);
    const two found = {x.even, x.odd};
    return found;
}
#else
static void store_pairs(floatv a, floatv b, global float *p, int at)
{
    vstore2((float2)(a, b), at, p);
}

static two gather_pairs(GATHERED float *p, intv i)
{
    const float2 x = vload2(i, p);
    const two found = {x.x, x.y};
    return found;
}
#endif

static floatv inverse_of(floatv size)
{
    return size > 0 ? 1 / size : 0 * size;
}

/* Work distribution in the CPU shape. Drivers hand work-groups to their threads as they come, so that what
 * one core has written another reads in the next kernel; between cores that do not share a cache this
 * costs more than the work. Here the work is cut into parts (DMK_CHUNK blocks each), every thread has a
 * share of them, the same one in launch after launch, and a work-group does the parts of its thread's
 * share one by one. Then it helps where a thread has not come at all, or is far behind. Which thread
 * does a part changes no result: sums are kept by part.
 *   launch  the launch's tag, threads (0: the parts are divided among the work-groups, -1: those are that
 *           `shares` lists), parts of the first range (see dmk_range) or of the list, parts; the GPU shape,
 *           with a work-group for each part, needs but the list and the last
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
    if (threads <= 0) {
        const int n = threads < 0 ? launch.s2 : launch.s3;
        const long group = get_group_id(0), groups = get_num_groups(0);
        const int k = (int)(n * group / groups) + at[1]++;
        if (k >= (int)(n * (group + 1) / groups)) return -1;
        return threads < 0 ? shares[k] : k;
    }
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

/* The parts of this work-group, one after the other. */
#define FOR_PARTS(part, shares, launch)                                                            \
    for (int part##_at[2] = {-1, 0}, part = next_part(shares, launch, part##_at); part >= 0;       \
         part = next_part(shares, launch, part##_at))
#define KERNEL kernel __attribute__((reqd_work_group_size(1, 1, 1))) void
#define KERNEL_ALONE KERNEL
#else
static int part_of_group(volatile global int *shares, int4 launch)
{
    const int group = (int)get_group_id(0);
    return launch.s1 < 0 ? shares[group] : group;
}

#define FOR_PARTS(part, shares, launch) const int part = part_of_group(shares, launch);
#define KERNEL kernel __attribute__((reqd_work_group_size(DMK_GROUP, 1, 1))) void
/* Of a kernel that one work-group does: as large a one as there is. */
#define KERNEL_ALONE kernel __attribute__((reqd_work_group_size(DMK_LONE_GROUP, 1, 1))) void
#endif

/* What the work-items of a group share; a kernel that sums has one. In the GPU shape sum[k] has their numbers of quantity
 * k, and then its first the group's. */
typedef struct group_memory {
#if DMK_CPU
    sum_t sum[DMK_MOST_SUMS][1];
#else
    sum_t sum[DMK_MOST_SUMS][DMK_GROUP];
#endif
    int last;
} group_memory;

/* Sums: each part leaves one partial sum per quantity k at partial[k * parts + part], and the last one to be
 * done adds them up into scalars[at + k], unless at < 0: with ranks there are more of them elsewhere. The
 * order of additions is fixed by the number of items, so the same launch gives the same bits, on ranks as without.
 * Partial sums pass from group to group within a launch, so they are written and read by atomic operations, which
 * caches do not hide; on NVIDIA's devices by volatile ones, which they do not hide either, and of which many are under
 * way at once (1.09 million triangles on an H200: inner_apply 0.079 ms for 0.144). `done` counts the parts that are,
 * and is 0 again at the end. */
typedef struct sums {
    volatile global sum_t *partial;
    global sum_t *scalars;
    volatile global int *done;
    local group_memory *group;
    int at, parts;
    int joined; /* the partial sums are of blocks already */
} sums;

#ifndef __NV_CL_C_VERSION
static void put_sum(volatile global sum_t *at, sum_t x)
{
    volatile global int *word = (volatile global int *)at;
#if DMK_FP64
    const int2 bits = as_int2(x);
    atomic_xchg(word, bits.s0);
    atomic_xchg(word + 1, bits.s1);
#else
    atomic_xchg(word, as_int(x));
#endif
}

static sum_t take_sum(volatile global sum_t *at)
{
    volatile global int *word = (volatile global int *)at;
#if DMK_FP64
    const int low = atomic_or(word, 0), high = atomic_or(word + 1, 0);
    return as_double((int2)(low, high));
#else
    return as_float(atomic_or(word, 0));
#endif
}
#else
static void put_sum(volatile global sum_t *at, sum_t x)
{
    *at = x;
}

static sum_t take_sum(volatile global sum_t *at)
{
    return *at;
}
#endif

/* Between what other work-groups are to see, or have written, and the count of those that are done. NVIDIA's mem_fence is
 * one for the work-group alone. */
static void device_fence(void)
{
#ifdef __NV_CL_C_VERSION
    asm volatile("membar.gl;" ::: "memory");
#else
    mem_fence(CLK_GLOBAL_MEM_FENCE);
#endif
}

/* Partial sums that are added first: see DMK_SUM_SHORT. */
static int block_of(sums s)
{
    return !s.joined && s.parts > DMK_SUM_SHORT ? DMK_SUM_BLOCK : 1;
}

static int blocks_of(sums s)
{
    return (s.parts + block_of(s) - 1) / block_of(s);
}

/* The sum or, with top != 0, the maximum of x and every step-th of these numbers. */
static sum_t take_some(sum_t x, int top, volatile global sum_t *from, int begin, int end, int step)
{
    _Pragma("unroll 8") for (int g = begin; g < end; g += step)
    {
        const sum_t next = take_sum(from + g);
        x = top ? fmax(x, next) : x + next;
    }
    return x;
}

/* Quantity k's of block b. */
static sum_t take_block(sums s, int k, int top, int b)
{
    volatile global sum_t *x = s.partial + k * s.parts;
    const int begin = b * block_of(s), end = min(begin + block_of(s), s.parts);
    return take_some(top ? take_sum(x + begin) : 0, top, x, begin, end, 1);
}

/* Quantity k's of every step-th block from the first on. */
static sum_t take_blocks(sums s, int k, int top, int first, int step)
{
    volatile global sum_t *x = s.partial + k * s.parts;
    sum_t sum = top ? take_sum(x) : 0;
    if (block_of(s) == 1) return take_some(sum, top, x, first, s.parts, step);
    for (int b = first; b < blocks_of(s); b += step) {
        const sum_t next = take_block(s, k, top, b);
        sum = top ? fmax(sum, next) : sum + next;
    }
    return sum;
}

static int is_last(sums s)
{
    if (s.at < 0) return 0;
    device_fence();
    const int last = atomic_inc(s.done) == s.parts - 1;
    if (!last) return 0;
    atomic_xchg(s.done, 0);
    device_fence();
    return 1;
}

/* The functions from here to cg_both_of are for all work-items of a group: they wait for each other. Of `count`
 * quantities the last `maxima` are maxima.
 * leave_sum, leave_max: the part's sum or maximum of v is to become the partial sum of quantity k.
 * is_last_part: the part leaves its partial sums; whether all have.
 * add_up: where `when` holds, the sums of all partial sums, for `total` and the work-item that is_writer. */
#if DMK_CPU
static void leave_sum(sums s, int k, int part, sumv v)
{
    put_sum(s.partial + k * s.parts + part,
            ((v.s0 + v.s1) + (v.s2 + v.s3)) + ((v.s4 + v.s5) + (v.s6 + v.s7)));
}

static void leave_max(sums s, int k, int part, sumv v)
{
    put_sum(s.partial + k * s.parts + part,
            fmax(fmax(fmax(v.s0, v.s1), fmax(v.s2, v.s3)),
                 fmax(fmax(v.s4, v.s5), fmax(v.s6, v.s7))));
}

static int is_last_part(sums s, int part, int count, int maxima)
{
    return is_last(s);
}

static int is_writer(int when)
{
    return when;
}

static void add_up(sums s, int count, int maxima, int when)
{
    for (int k = 0; when && k < count; k++) {
        s.group->sum[k][0] = take_blocks(s, k, k >= count - maxima, 0, 1);
    }
}
#else
static void leave_sum(sums s, int k, int part, sum_t v)
{
    s.group->sum[k][get_local_id(0)] = v;
}

static void leave_max(sums s, int k, int part, sum_t v)
{
    leave_sum(s, k, part, v);
}

/* The group's sums and maxima, each quantity's by work-items of its own: of 256 numbers first 32, then 4 and 1. */
static void join_group(sums s, int count, int maxima)
{
    const int l = (int)get_local_id(0), k = l / DMK_ABREAST, j = l % DMK_ABREAST;
    barrier(CLK_LOCAL_MEM_FENCE);
    for (int from = DMK_GROUP, to = DMK_ABREAST; from > 1; from = to, to = max(to / 8, 1)) {
        if (k < count && j < to) {
            local sum_t *x = s.group->sum[k];
            sum_t sum = x[j];
            for (int i = j + to; i < from; i += to) {
                sum = k >= count - maxima ? fmax(sum, x[i]) : sum + x[i];
            }
            x[j] = sum;
        }
        barrier(CLK_LOCAL_MEM_FENCE);
    }
}

static int is_last_part(sums s, int part, int count, int maxima)
{
    const int l = (int)get_local_id(0);
    join_group(s, count, maxima);
    if (l < count) put_sum(s.partial + l * s.parts + part, s.group->sum[l][0]);
    device_fence();
    barrier(CLK_LOCAL_MEM_FENCE | CLK_GLOBAL_MEM_FENCE);
    if (l == 0) s.group->last = is_last(s);
    barrier(CLK_LOCAL_MEM_FENCE | CLK_GLOBAL_MEM_FENCE);
    return s.group->last;
}

static int is_writer(int when)
{
    return when && get_local_id(0) == 0;
}

static void add_up(sums s, int count, int maxima, int when)
{
#if !DMK_POCL /* which does not do a barrier within a branch right, even if the whole group takes it */
    if (!when) return;
#endif
    for (int k = 0; k < count; k++) {
        const sum_t sum =
            when ? take_blocks(s, k, k >= count - maxima, (int)get_local_id(0), DMK_GROUP) : 0;
        leave_sum(s, k, 0, sum);
    }
    join_group(s, count, maxima);
}
#endif

static sum_t total(sums s, int k)
{
    return s.group->sum[k][0];
}

/* scalars[at + k] = the sum of quantity k's partial sums, k < count. */
static void tell_sums(sums s, int count, int maxima, int when)
{
    add_up(s, count, maxima, when);
    for (int k = 0; is_writer(when) && k < count; k++) s.scalars[s.at + k] = total(s, k);
}

/* The same by the last part. */
static void finish_sums(sums s, int part, int count, int maxima)
{
    const int when = is_last_part(s, part, count, maxima);
    tell_sums(s, count, maxima, when);
}

/* The scalars of conjugate gradients, on the device: [0] r.z  [1] p.Ap  [2] alpha  [3] beta
 * [4] r.z at the start. */

/* From the partial sums of r.z and Ap.z: beta = (r - r_before).z / (r.z)_before
 * = -alpha Ap.z / (r.z)_before, or 0 at the first iteration. This form, unlike r.z / (r.z)_before, bears a
 * preconditioner with rounding errors. */
static void cg_beta_of(sums s, int first, int when)
{
    add_up(s, 2, 0, when);
    if (!is_writer(when)) return;
    const sum_t rz = total(s, 0), apz = total(s, 1);
    global sum_t *state = s.scalars;
    state[3] = first || !(state[0] > 0) ? 0 : -state[2] * apz / state[0];
    state[0] = rz;
    if (first) state[4] = rz;
}

/* From that of p.Ap: alpha = r.z / p.Ap; a direction without energy is not followed. */
static void cg_alpha_of(sums s, int when)
{
    add_up(s, 1, 0, when);
    if (!is_writer(when)) return;
    const sum_t pap = total(s, 0);
    global sum_t *state = s.scalars;
    state[1] = pap;
    state[2] = pap > 0 ? state[0] / pap : 0;
}

/* Both at once from the partial sums of r.z, (Ap).z and z.Az, where A z is known before the direction
 * p = z + beta p is made: p.Ap = z.Az + 2 beta z.(Ap) + beta^2 (p.Ap)_before (Chronopoulos and Gear, J. Comput. Appl.
 * Math. 25, 1989). */
static void cg_both_of(sums s, int first, int when)
{
    add_up(s, 3, 0, when);
    if (!is_writer(when)) return;
    const sum_t rz = total(s, 0), apz = total(s, 1), zaz = total(s, 2);
    global sum_t *state = s.scalars;
    const sum_t beta = first || !(state[0] > 0) ? 0 : -state[2] * apz / state[0];
    const sum_t pap = beta == 0 ? zaz : zaz + beta * (2 * apz + beta * state[1]);
    state[0] = rz;
    state[1] = pap;
    state[2] = pap > 0 ? rz / pap : 0;
    state[3] = beta;
    if (first) state[4] = rz;
}

/* All items of a loop by one work-group, or of a matrix, a line's numbers by work-items beside each other; and the wait
 * between two loops. */
#if DMK_CPU
#define ITEM_BEGIN 0
#define ITEM_STEP 1
#define TOGETHER
#define FOR_LINES(i, n) FOR_ITEMS(i, n)
#define FOR_ALONG(j, n) FOR_ITEMS(j, n)
#define FOR_ALL_BLOCKS(b, n) for (int b = 0; b < ((n) + DMK_WIDTH - 1) / DMK_WIDTH; b++)
#else
#define ITEM_BEGIN ((int)get_local_id(0))
#define ITEM_STEP ((int)get_local_size(0))
#define TOGETHER barrier(CLK_LOCAL_MEM_FENCE | CLK_GLOBAL_MEM_FENCE);
#define FOR_LINES(i, n)                                                                            \
    for (int i = ITEM_BEGIN / DMK_ABREAST; i < (n); i += ITEM_STEP / DMK_ABREAST)
#define FOR_ALONG(j, n) for (int j = ITEM_BEGIN % DMK_ABREAST; j < (n); j += DMK_ABREAST)
#define FOR_ALL_BLOCKS(b, n) FOR_ITEMS(b, n)
#endif
#define FOR_ITEMS(i, n) for (int i = ITEM_BEGIN; i < (n); i += ITEM_STEP)
