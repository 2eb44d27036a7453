/* Vectors and the scalars of conjugate gradients. `state` holds, on the device:
 * [0] r.z  [1] p.Ap  [2] alpha  [3] beta  [4] r.z at the start. */

/* Partial sums of a.b. */
KERNEL dot_real(int n, global const real *a, global const real *b, global sum_t *partial LAUNCH)
{
    SCRATCH
    FOR_PARTS
    {
        sumv sum = 0;
        FOR_PART_BLOCKS(i, n) { sum += TO_SUM(LOAD(a, AT(i))) * TO_SUM(LOAD(b, AT(i))); }
        REDUCE(partial, 0, sum)
        ;
    }
}

/* Partial sums of r.z and Ap.z, z in single precision. */
KERNEL cg_dots(int n, global const real *r, global const real *ap, global const float *z,
               global sum_t *partial LAUNCH)
{
    SCRATCH
    FOR_PARTS
    {
        sumv rz = 0, apz = 0;
        FOR_PART_BLOCKS(i, n)
        {
            const sumv zi = TO_SUM(LOAD(z, AT(i)));
            rz += TO_SUM(LOAD(r, AT(i))) * zi;
            apz += TO_SUM(LOAD(ap, AT(i))) * zi;
        }
        REDUCE(partial, 0, rz)
        ;
        REDUCE(partial, 1, apz)
        ;
    }
}

/* The largest u and the largest -u (padding rows count as 0). */
KERNEL rows_range(int n, global const real *u, global sum_t *partial LAUNCH)
{
    SCRATCH
    FOR_PARTS
    {
        sumv top = 0, bottom = 0;
        FOR_PART_BLOCKS(i, n)
        {
            top = fmax(top, TO_SUM(LOAD(u, AT(i))));
            bottom = fmax(bottom, -TO_SUM(LOAD(u, AT(i))));
        }
        REDUCE_MAX(partial, 0, top)
        ;
        REDUCE_MAX(partial, 1, bottom)
        ;
    }
}

/* out[at + k] = sum of quantity k's partial sums, k < count; the last `maxima` of them are maxima. */
KERNEL sum_partials(int parts, int count, int maxima, global const sum_t *partial,
                    global sum_t *out, int at LAUNCH)
{
    SCRATCH
    for (int k = 0; k < count; k++) {
        if (k >= count - maxima) {
            GATHER_MAX(m, partial, k, parts)
            if (FIRST_ITEM) out[at + k] = m;
        } else {
            GATHER_SUM(s, partial, k, parts)
            if (FIRST_ITEM) out[at + k] = s;
        }
    }
}

/* beta = (r - r_before).z / (r.z)_before = -alpha Ap.z / (r.z)_before, or 0 at the first iteration.
 * This form, unlike r.z / (r.z)_before, bears a preconditioner with rounding errors. */
KERNEL cg_beta(int parts, int first, global const sum_t *partial, global sum_t *state LAUNCH)
{
    SCRATCH
    GATHER_SUM(rz, partial, 0, parts)
    GATHER_SUM(apz, partial, 1, parts)
    if (FIRST_ITEM) {
        state[3] = first || !(state[0] > 0) ? 0 : -state[2] * apz / state[0];
        state[0] = rz;
        if (first) state[4] = rz;
    }
}

/* p = z + beta p; p is not read at the first iteration, when beta is 0. */
KERNEL cg_direction(int n, global const sum_t *state, global const float *z, global real *p LAUNCH)
{
    const real beta = (real)state[3];
    FOR_BLOCKS(i, n)
    {
        realv next = TO_REAL(LOAD(z, AT(i)));
        if (beta != 0) next += beta * LOAD(p, AT(i));
        STORE(next, p, AT(i));
    }
}

/* p.Ap has been summed: alpha = r.z / p.Ap; a direction without energy is not followed. */
KERNEL cg_alpha(int parts, global const sum_t *partial, global sum_t *state LAUNCH)
{
    SCRATCH
    GATHER_SUM(pap, partial, 0, parts)
    if (FIRST_ITEM) {
        state[1] = pap;
        state[2] = pap > 0 ? state[0] / pap : 0;
    }
}

/* x += alpha p, r -= alpha Ap; `narrow` is r for the preconditioner (r itself in single precision). */
KERNEL cg_step(int n, global const sum_t *state, global const real *p, global const real *ap,
               global real *x, global real *r, global float *narrow LAUNCH)
{
    const real alpha = (real)state[2];
    FOR_BLOCKS(i, n)
    {
        STORE(LOAD(x, AT(i)) + alpha * LOAD(p, AT(i)), x, AT(i));
        const realv next = LOAD(r, AT(i)) - alpha * LOAD(ap, AT(i));
        STORE(next, r, AT(i));
#if DMK_DOUBLE
        STORE(TO_FLOAT(next), narrow, AT(i));
#endif
    }
}

KERNEL narrow_copy(int n, global const real *from, global float *to LAUNCH)
{
    FOR_BLOCKS(i, n) { STORE(TO_FLOAT(LOAD(from, AT(i))), to, AT(i)); }
}

/* x <- alpha x + add. */
KERNEL scale_add(int n, float alpha, global real *x, global const float *add LAUNCH)
{
    FOR_BLOCKS(i, n) { STORE((real)alpha * LOAD(x, AT(i)) + TO_REAL(LOAD(add, AT(i))), x, AT(i)); }
}
