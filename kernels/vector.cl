/* Vectors, and the steps of conjugate gradients; `state`: its scalars, see base.cl. */

/* scalars[at] = a.b
 * reads a, b; writes scalars; moves 2 real R bytes, 2 R flops
 * shape blocks of R; numerics in sum_t, in the order of parts */
KERNEL dot_real(int n, global const real *restrict a, global const real *restrict b,
                volatile global sum_t *partial, int at, global sum_t *restrict scalars,
                volatile global int *done, volatile global int *shares, int4 launch)
{
    local group_memory group;
    const sums s = {partial, scalars, done, &group, at, launch.s3};
    FOR_PARTS(part, shares, launch)
    {
        sumv sum = 0;
        FOR_PART_BLOCKS(i, n, part) { sum += TO_SUM(LOAD(a, AT(i))) * TO_SUM(LOAD(b, AT(i))); }
        leave_sum(s, 0, part, sum);
        finish_sums(s, part, 1, 0);
    }
}

/* r.z and Ap.z, z in single precision, and beta of them.
 * reads r, ap, z; writes scalars, which are the state; moves 2 real R + 4 R bytes, 4 R flops
 * shape blocks of R; numerics in sum_t, in the order of parts */
KERNEL cg_dots(int n, int first, global const real *restrict r, global const real *restrict ap,
               global const float *restrict z, volatile global sum_t *partial, int at,
               global sum_t *restrict scalars, volatile global int *done,
               volatile global int *shares, int4 launch)
{
    local group_memory group;
    const sums s = {partial, scalars, done, &group, at, launch.s3};
    FOR_PARTS(part, shares, launch)
    {
        sumv rz = 0, apz = 0;
        FOR_PART_BLOCKS(i, n, part)
        {
            const sumv zi = TO_SUM(LOAD(z, AT(i)));
            rz += TO_SUM(LOAD(r, AT(i))) * zi;
            apz += TO_SUM(LOAD(ap, AT(i))) * zi;
        }
        leave_sum(s, 0, part, rz);
        leave_sum(s, 1, part, apz);
        cg_beta_of(s, first, is_last_part(s, part, 2, 0));
    }
}

/* The largest u and the largest -u (padding rows count as 0).
 * reads u; writes scalars; moves real R bytes, 3 R flops
 * shape blocks of R; numerics exact, but u is rounded to sum_t */
KERNEL rows_range(int n, global const real *restrict u, volatile global sum_t *partial, int at,
                  global sum_t *restrict scalars, volatile global int *done,
                  volatile global int *shares, int4 launch)
{
    local group_memory group;
    const sums s = {partial, scalars, done, &group, at, launch.s3};
    FOR_PARTS(part, shares, launch)
    {
        sumv top = 0, bottom = 0;
        FOR_PART_BLOCKS(i, n, part)
        {
            top = fmax(top, TO_SUM(LOAD(u, AT(i))));
            bottom = fmax(bottom, -TO_SUM(LOAD(u, AT(i))));
        }
        leave_max(s, 0, part, top);
        leave_max(s, 1, part, bottom);
        finish_sums(s, part, 2, 2);
    }
}

/* The next three: what the last part of another kernel does, by itself: partial sums of all ranks, or of
 * their blocks, are there now. parts: how many there are.
 * reads partial; writes scalars; moves at most 24 bytes and 3 flops a part
 * shape one work-group; numerics the order of parts */
KERNEL sum_partials(int parts, int count, int maxima, volatile global sum_t *partial,
                    global sum_t *restrict scalars, int at, volatile global int *shares,
                    int4 launch)
{
    local group_memory group;
    const sums s = {partial, scalars, 0, &group, at, parts, 1};
    tell_sums(s, count, maxima, 1);
}

/* reads partial, scalars; writes scalars; moves 16 bytes and 2 flops a part; shape one work-group */
KERNEL cg_beta(int parts, int first, volatile global sum_t *partial, global sum_t *restrict scalars,
               volatile global int *shares, int4 launch)
{
    local group_memory group;
    const sums s = {partial, scalars, 0, &group, 0, parts, 1};
    cg_beta_of(s, first, 1);
}

/* reads partial, scalars; writes scalars; moves 8 bytes, flops 1, a part; shape one work-group */
KERNEL cg_alpha(int parts, volatile global sum_t *partial, global sum_t *restrict scalars,
                volatile global int *shares, int4 launch)
{
    local group_memory group;
    const sums s = {partial, scalars, 0, &group, 0, parts, 1};
    cg_alpha_of(s, 1);
}

/* p = z + beta p; p is not read at the first iteration, when beta is 0.
 * reads state, z, p; writes p; moves 4 R + 2 real R bytes, 2 R flops; shape blocks of R */
KERNEL cg_direction(int n, global const sum_t *restrict state, global const float *restrict z,
                    global real *restrict p, volatile global int *shares, int4 launch)
{
    const real beta = (real)state[3];
    FOR_BLOCKS(i, n, shares, launch)
    {
        realv next = TO_REAL(LOAD(z, AT(i)));
        if (beta != 0) next += beta * LOAD(p, AT(i));
        STORE(next, p, AT(i));
    }
}

/* x += alpha p; unless it was the last step r -= alpha Ap, `narrow` is r for the
 * preconditioner (r itself in single precision), and z = step D^-1 r its first smoothing step from 0.
 * reads state, p, ap, x, r, inv_diag; writes x, r, narrow, z
 * moves 6 real R + 12 R bytes, 6 R flops; shape blocks of R */
KERNEL cg_step(int n, int last, global const sum_t *restrict state, global const real *restrict p,
               global const real *restrict ap, global real *restrict x, global real *r,
               global float *narrow, float step, global const float *restrict inv_diag,
               global float *restrict z, volatile global int *shares, int4 launch)
{
    const real alpha = (real)state[2];
    FOR_BLOCKS(i, n, shares, launch)
    {
        STORE(LOAD(x, AT(i)) + alpha * LOAD(p, AT(i)), x, AT(i));
        if (last) continue;
        const realv next = LOAD(r, AT(i)) - alpha * LOAD(ap, AT(i));
        const floatv single = TO_FLOAT(next);
        STORE(next, r, AT(i));
#if DMK_DOUBLE
        STORE(single, narrow, AT(i));
#endif
        STORE(step * LOAD(inv_diag, AT(i)) * single, z, AT(i));
    }
}

/* x = scale x.
 * reads x; writes x; moves 2 real R bytes, R flops; shape blocks of R */
KERNEL rows_scale(int n, float scale, global real *restrict x, volatile global int *shares, int4 launch)
{
    FOR_BLOCKS(i, n, shares, launch) { STORE((real)scale * LOAD(x, AT(i)), x, AT(i)); }
}

#if !DMK_DOUBLE
/* The inner solve, of Newton's matrix, goes by two kernels an iteration beside the V-cycle: the first one has w = A z,
 * and alpha and beta, the second one the vectors. These are the sums that alpha and beta are of. */
typedef struct products {
    sumv rz, apz, zaz;
} products;

/* What a block of w = A z adds to them. `first`: there is no ap yet. */
static void add_products(int b, int first, global const float *r, global const float *ap, floatv z,
                         floatv az, products *sum)
{
    const sumv zb = TO_SUM(z);
    sum->rz += TO_SUM(LOAD(r, AT(b))) * zb;
    if (!first) sum->apz += TO_SUM(LOAD(ap, AT(b))) * zb;
    sum->zaz += TO_SUM(az) * zb;
}

static void finish_products(sums s, int part, int first, products sum)
{
    leave_sum(s, 0, part, sum.rz);
    leave_sum(s, 1, part, sum.apz);
    leave_sum(s, 2, part, sum.zaz);
    cg_both_of(s, first, is_last_part(s, part, 3, 0));
}

/* w = A z from its elements' parts, and alpha and beta.
 * reads slice, slot, out (gathered), r, ap, z; writes w, scalars, which are the state
 * moves 4 P + 24 E + 16 R bytes, 6 E + 6 R flops
 * shape blocks of R; numerics the sums in sum_t, in the order of parts */
KERNEL inner_apply(int n, int first, global const int *restrict slice,
                   global const int *restrict slot, GATHERED float *restrict out,
                   global const float *restrict r, global const float *restrict ap,
                   global const float *restrict z, global float *restrict w,
                   volatile global sum_t *partial, int at, global sum_t *restrict scalars,
                   volatile global int *done, volatile global int *shares, int4 launch)
{
    local group_memory group;
    const sums s = {partial, scalars, done, &group, at, launch.s3};
    FOR_PARTS(part, shares, launch)
    {
        products sum = {0, 0, 0};
        FOR_PART_BLOCKS(b, n, part)
        {
            const floatv az = row_sum(slice, slot, out, b, launch);
            STORE(az, w, AT(b));
            add_products(b, first, r, ap, LOAD(z, AT(b)), az, &sum);
        }
        finish_products(s, part, first, sum);
    }
}

/* What the last part does, by itself, from the partial sums of all ranks.
 * reads partial, scalars; writes scalars; moves 24 bytes and 3 flops a part; shape one work-group */
KERNEL inner_scalars(int parts, int first, volatile global sum_t *partial,
                     global sum_t *restrict scalars, volatile global int *shares, int4 launch)
{
    local group_memory group;
    const sums s = {partial, scalars, 0, &group, 0, parts, 1};
    cg_both_of(s, first, 1);
}

/* p = z + beta p, ap = w + beta ap, x += alpha p, r -= alpha ap, and w = step D^-1 r, the first smoothing step of the
 * next V-cycle. At the first iteration p, ap and x are not read: they are 0.
 * reads state, z, w, p, ap, x, r, inv_diag; writes p, ap, x, r, w
 * moves 48 R bytes, 10 R flops; shape blocks of R */
KERNEL inner_step(int n, int first, float step, global const sum_t *restrict state,
                  global const float *restrict z, global const float *restrict inv_diag,
                  global float *restrict p, global float *restrict ap, global float *restrict x,
                  global float *restrict r, global float *restrict w, volatile global int *shares,
                  int4 launch)
{
    const float alpha = (float)state[2], beta = (float)state[3];
    FOR_BLOCKS(b, n, shares, launch)
    {
        floatv along = LOAD(z, AT(b)), image = LOAD(w, AT(b)), sum = 0;
        if (!first) {
            along += beta * LOAD(p, AT(b));
            image += beta * LOAD(ap, AT(b));
            sum = LOAD(x, AT(b));
        }
        const floatv left = LOAD(r, AT(b)) - alpha * image;
        STORE(along, p, AT(b));
        STORE(image, ap, AT(b));
        STORE(sum + alpha * along, x, AT(b));
        STORE(left, r, AT(b));
        STORE(step * LOAD(inv_diag, AT(b)) * left, w, AT(b));
    }
}
#endif

/* to = from in single precision; the benchmark's copy.
 * reads from; writes to; moves real R + 4 R bytes, 0 flops; shape blocks of R */
KERNEL narrow_copy(int n, global const real *restrict from, global float *restrict to,
                   volatile global int *shares, int4 launch)
{
    FOR_BLOCKS(i, n, shares, launch) { STORE(TO_FLOAT(LOAD(from, AT(i))), to, AT(i)); }
}

/* The inner solve's last step, w += alpha p with p = z + beta p, and what follows from it: u <- scale u + w, and f.u.
 * `first`: that step is the only one, and w and p are 0. row: where u's values begin.
 * reads state, z, p, w, u, f; writes w, u, scalars; moves 3 real R + 16 R bytes, 8 R flops
 * shape blocks of R; numerics f.u in sum_t, in the order of parts */
KERNEL inner_finish(int n, int row, int first, float scale, global const sum_t *restrict state,
                    global const float *restrict z, global const float *restrict p,
                    global float *restrict w, global real *restrict u,
                    global const real *restrict f, volatile global sum_t *partial, int at,
                    global sum_t *restrict scalars, volatile global int *done,
                    volatile global int *shares, int4 launch)
{
    local group_memory group;
    const sums s = {partial, scalars, done, &group, at, launch.s3};
    const float alpha = (float)state[2], beta = (float)state[3];
    global real *values = u + row;
    FOR_PARTS(part, shares, launch)
    {
        sumv sum = 0;
        FOR_PART_BLOCKS(b, n, part)
        {
            floatv along = LOAD(z, AT(b)), whole = 0;
            if (!first) {
                along += beta * LOAD(p, AT(b));
                whole = LOAD(w, AT(b));
            }
            whole += alpha * along;
            const realv next = (real)scale * LOAD(values, AT(b)) + TO_REAL(whole);
            STORE(whole, w, AT(b));
            STORE(next, values, AT(b));
            sum += TO_SUM(LOAD(f, AT(b))) * TO_SUM(next);
        }
        leave_sum(s, 0, part, sum);
        finish_sums(s, part, 1, 0);
    }
}
