/* Vectors, and the steps of conjugate gradients; `state`: see base.cl. */

/* a.b */
KERNEL dot_real(int n, global const real *a, global const real *b, SUM_ARGS LAUNCH)
{
    SCRATCH
    FOR_PARTS
    {
        sumv sum = 0;
        FOR_PART_BLOCKS(i, n) { sum += TO_SUM(LOAD(a, AT(i))) * TO_SUM(LOAD(b, AT(i))); }
        REDUCE(partial, 0, sum);
        SUMS(1, 0)
    }
}

/* r.z and Ap.z, z in single precision, and beta of them. */
KERNEL cg_dots(int n, int first, global const real *r, global const real *ap, global const float *z,
               SUM_ARGS LAUNCH)
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
        REDUCE(partial, 0, rz);
        REDUCE(partial, 1, apz);
        const int when = LAST_PART;
        CG_BETA(PARTS)
    }
}

/* The largest u and the largest -u (padding rows count as 0). */
KERNEL rows_range(int n, global const real *u, SUM_ARGS LAUNCH)
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
        REDUCE_MAX(partial, 0, top);
        REDUCE_MAX(partial, 1, bottom);
        SUMS(2, 2)
    }
}

/* What the last part of another kernel does, by itself: partial sums of all ranks are there now. */
KERNEL sum_partials(int parts, int count, int maxima, volatile global sum_t *partial,
                    global sum_t *scalars, int at LAUNCH)
{
    SCRATCH_ALONE
    const int when = 1;
    ADD_UP(parts, count, maxima)
}

KERNEL cg_beta(int parts, int first, volatile global sum_t *partial, global sum_t *scalars LAUNCH)
{
    SCRATCH_ALONE
    const int when = 1;
    CG_BETA(parts)
}

KERNEL cg_alpha(int parts, volatile global sum_t *partial, global sum_t *scalars LAUNCH)
{
    SCRATCH_ALONE
    const int when = 1;
    CG_ALPHA(parts)
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

/* x += alpha p; unless it was the last step r -= alpha Ap, `narrow` is r for the
 * preconditioner (r itself in single precision), and z = step D^-1 r its first smoothing step from 0. */
KERNEL cg_step(int n, int last, global const sum_t *state, global const real *p,
               global const real *ap, global real *x, global real *r, global float *narrow, float step,
               global const float *inv_diag, global float *z LAUNCH)
{
    const real alpha = (real)state[2];
    FOR_BLOCKS(i, n)
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

KERNEL narrow_copy(int n, global const real *from, global float *to LAUNCH)
{
    FOR_BLOCKS(i, n) { STORE(TO_FLOAT(LOAD(from, AT(i))), to, AT(i)); }
}

/* x <- alpha x + add, and f.x */
KERNEL scale_add(int n, float alpha, global real *x, global const float *add, global const real *f,
                 SUM_ARGS LAUNCH)
{
    SCRATCH
    FOR_PARTS
    {
        sumv sum = 0;
        FOR_PART_BLOCKS(i, n)
        {
            const realv next = (real)alpha * LOAD(x, AT(i)) + TO_REAL(LOAD(add, AT(i)));
            STORE(next, x, AT(i));
            sum += TO_SUM(LOAD(f, AT(i))) * TO_SUM(next);
        }
        REDUCE(partial, 0, sum);
        SUMS(1, 0)
    }
}
