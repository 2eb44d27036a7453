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
        finish_sums(s, 1, 0);
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
        cg_beta_of(s, first, is_last_part(s));
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
        finish_sums(s, 2, 2);
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
    add_up(s, count, maxima, 1);
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

/* to = from in single precision; the benchmark's copy.
 * reads from; writes to; moves real R + 4 R bytes, 0 flops; shape blocks of R */
KERNEL narrow_copy(int n, global const real *restrict from, global float *restrict to,
                   volatile global int *shares, int4 launch)
{
    FOR_BLOCKS(i, n, shares, launch) { STORE(TO_FLOAT(LOAD(from, AT(i))), to, AT(i)); }
}

/* x <- alpha x + add, and f.x
 * reads x, add, f; writes x, scalars; moves 3 real R + 4 R bytes, 4 R flops
 * shape blocks of R; numerics f.x in sum_t, in the order of parts */
KERNEL scale_add(int n, float alpha, global real *restrict x, global const float *restrict add,
                 global const real *restrict f, volatile global sum_t *partial, int at,
                 global sum_t *restrict scalars, volatile global int *done,
                 volatile global int *shares, int4 launch)
{
    local group_memory group;
    const sums s = {partial, scalars, done, &group, at, launch.s3};
    FOR_PARTS(part, shares, launch)
    {
        sumv sum = 0;
        FOR_PART_BLOCKS(i, n, part)
        {
            const realv next = (real)alpha * LOAD(x, AT(i)) + TO_REAL(LOAD(add, AT(i)));
            STORE(next, x, AT(i));
            sum += TO_SUM(LOAD(f, AT(i))) * TO_SUM(next);
        }
        leave_sum(s, 0, part, sum);
        finish_sums(s, 1, 0);
    }
}
