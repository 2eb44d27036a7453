/* Newton's steps with u linear on T, where between measures they begin: a quarter of the rows of T/2 and one
 * triangle for four. mu is the same, one number for each element. u's values are those of the vertices' rows among
 * those of T/2 (from vertex_row on), other vectors are level 0's. The operator is level 0's graph. */

/* Values at an element's corners. */
static three gather_corners(GATHERED real *u, global const int *index, int b)
{
    const intv i = LOAD(index, AT_K(b, 0, 6)), j = LOAD(index, AT_K(b, 1, 6)),
               k = LOAD(index, AT_K(b, 2, 6));
    const three x = {(realv)(GATHER(u, i)), (realv)(GATHER(u, j)), (realv)(GATHER(u, k))};
    return x;
}

/* K x of a linear element: half the cotangents are its edges' weights. */
static three linear_stiffness(three cot, three x)
{
    const realv f0 = (real)0.5 * cot.c0 * (x.c1 - x.c2), f1 = (real)0.5 * cot.c1 * (x.c2 - x.c0),
                f2 = (real)0.5 * cot.c2 * (x.c0 - x.c1);
    const three y = {f2 - f1, f0 - f2, f1 - f0};
    return y;
}

/* x.y, y's sum being 0. */
static realv linear_product(three y, three x)
{
    return y.c1 * (x.c1 - x.c0) + y.c2 * (x.c2 - x.c0);
}

/* load = P'f: a midpoint's f goes to its edge's ends. edge: the midpoints of v's edges.
 * reads slice, edge, f (gathered); writes load
 * moves 4 L + real R + real V bytes, L + V flops
 * shape blocks of V */
KERNEL nested_load(int n, int vertex_row, global const int *restrict slice,
                   global const int *restrict edge, GATHERED real *restrict f,
                   global real *restrict load, volatile global int *shares, int4 launch)
{
    global const real *at_vertex = (global const real *)(f + vertex_row);
    FOR_BLOCKS(b, n, shares, launch)
    {
        realv sum = 0;
        for (int j = slice[SLICE(b)], end = slice[SLICE(b) + 1]; j < end; j++) {
            const intv i = LOAD(edge, COLUMN(b, j));
            sum += (realv)(GATHER(f, i));
        }
        STORE(LOAD(at_vertex, AT(b)) + (real)0.5 * sum, load, AT(b));
    }
}

/* q = |grad u|^2, and element_energy's sums, L at a scale of u.
 * reads index, cot, area, mu, u (gathered); writes q, scalars
 * moves 12 E + 6 real E + real V bytes, 30 E flops
 * shape blocks of E; numerics the sums in sum_t, in the order of parts */
KERNEL nested_energy(int n, float scale, global const int *restrict index, global const real *restrict cot,
                     global const real *restrict area, global const real *restrict mu,
                     GATHERED real *restrict u, global real *restrict q,
                     volatile global sum_t *partial, int at, global sum_t *restrict scalars,
                     volatile global int *done, volatile global int *shares, int4 launch)
{
    local group_memory group;
    const sums s = {partial, scalars, done, &group, at, launch.s3};
    FOR_PARTS(part, shares, launch)
    {
        measures sum = {0, 0, 0, 0, 0};
        FOR_PART_BLOCKS(b, n, part)
        {
            const three x = gather_corners(u, index, b);
            add_measures(b, DMK_KEEP_Q, linear_product(linear_stiffness(load_three(cot, b), x), x),
                         LOAD(area, AT(b)), LOAD(mu, AT(b)), scale, q, &sum);
        }
        leave_measures(s, part, sum);
        leave_max(s, 4, part, sum.top);
        finish_sums(s, part, 5, 1);
    }
}

/* Newton's coefficients as newton_prepare's, on T alone: edge, diag_coarse and the parts of the right-hand side,
 * 3 per element.
 * reads index, cot, area, mu, q, u (gathered); writes edge, diag_coarse, out
 * moves 12 E + 6 real E + real V + 36 E bytes, 90 E flops
 * shape blocks of E; numerics as newton_prepare */
KERNEL nested_prepare(int n, float alpha, float D, float bend, global const int *restrict index,
                      global const real *restrict cot, global const real *restrict area,
                      global const real *restrict mu, global const real *restrict q,
                      GATHERED real *restrict u, global float *restrict edge,
                      global float *restrict diag_coarse, global float *restrict out,
                      volatile global int *shares, int4 launch)
{
    FOR_BLOCKS(b, n, shares, launch)
    {
        const realv m = LOAD(mu, AT(b)), e = (real)alpha * (real)alpha * LOAD(q, AT(b));
        const realv slope = log_slope(e), step = local_step(D, bend, slope);
        const three r = load_three(cot, b), g = linear_stiffness(r, gather_corners(u, index, b));
        const realv rhs = -(real)alpha * m * (1 + step * slope);
        STORE3(TO_FLOAT(rhs * g.c0), TO_FLOAT(rhs * g.c1), TO_FLOAT(rhs * g.c2), out, b)
        const realv root = (real)alpha * rank_one_root(step, m, LOAD(area, AT(b)), e);
        const floatv mf = TO_FLOAT(m);
        store_linear(mf * TO_FLOAT(r.c0), mf * TO_FLOAT(r.c1), mf * TO_FLOAT(r.c2),
                     mf * TO_FLOAT(r.c1 + r.c2), mf * TO_FLOAT(r.c0 + r.c2),
                     mf * TO_FLOAT(r.c0 + r.c1), TO_FLOAT(root * g.c0), TO_FLOAT(root * g.c1),
                     TO_FLOAT(root * g.c2), edge, diag_coarse, b);
    }
}

/* rhs = load + the sums of the elements' parts. first: slice of vertex 0 among the rows.
 * reads corner_slice, corner, parts (gathered), load; writes rhs
 * moves 12 E + 12 E + real V + 4 V bytes, 3 E + V flops
 * shape blocks of V */
KERNEL nested_rhs(int n, int first, global const int *restrict corner_slice,
                  global const int *restrict corner, GATHERED float *restrict parts,
                  global const real *restrict load, global float *restrict rhs,
                  volatile global int *shares, int4 launch)
{
    FOR_BLOCKS(b, n, shares, launch)
    {
        realv sum = LOAD(load, AT(b));
        for (int j = corner_slice[first + SLICE(b)], end = corner_slice[first + SLICE(b) + 1]; j < end;
             j++) {
            const intv p = LOAD(corner, COLUMN(b, j));
            const intv i = CORNER_PLACE(p);
            sum += TO_REAL((floatv)(GATHER(parts, i)));
        }
        STORE(TO_FLOAT(sum), rhs, AT(b));
    }
}

/* newton_update on T, where dy = D (L + g.w / (area s)) with g = K (u - w), for u - w was alpha u before.
 * reads index, cot, area, u and w (gathered), mu, q; writes mu, q, scalars
 * moves 12 E + 8 real E + real V + 4 V bytes, 80 E flops
 * shape blocks of E; numerics the sums in sum_t, in the order of parts */
KERNEL nested_update(int n, int vertex_row, float alpha, float D, float bend, float lowest,
                     global const int *restrict index, global const real *restrict cot,
                     global const real *restrict area, GATHERED float *restrict w,
                     GATHERED real *restrict u, global real *restrict mu, global real *restrict q,
                     volatile global sum_t *partial, int at, global sum_t *restrict scalars,
                     volatile global int *done, volatile global int *shares, int4 launch)
{
    local group_memory group;
    const sums s = {partial, scalars, done, &group, at, launch.s3};
    FOR_PARTS(part, shares, launch)
    {
        sumv change = 0;
        measures sum = {0, 0, 0, 0, 0};
        FOR_PART_BLOCKS(b, n, part)
        {
            const intv i0 = LOAD(index, AT_K(b, 0, 6)) - vertex_row,
                       i1 = LOAD(index, AT_K(b, 1, 6)) - vertex_row,
                       i2 = LOAD(index, AT_K(b, 2, 6)) - vertex_row;
            const three r = load_three(cot, b), x = gather_corners(u, index, b),
                        moved = {TO_REAL((floatv)(GATHER(w, i0))), TO_REAL((floatv)(GATHER(w, i1))),
                                 TO_REAL((floatv)(GATHER(w, i2)))},
                        before = {x.c0 - moved.c0, x.c1 - moved.c1, x.c2 - moved.c2};
            const realv along = linear_product(linear_stiffness(r, before), moved);
            const realv a = LOAD(area, AT(b)), e = (real)alpha * (real)alpha * LOAD(q, AT(b)),
                        old = LOAD(mu, AT(b)), slope = log_slope(e);
            const realv dy =
                local_step(D, bend, slope) * (slope + along / (a * fmax(e, (realv)0.25f)));
            const realv next = grown(old, dy, a, lowest);
            STORE(next, mu, AT(b));
            change += TO_SUM(a * fabs(next - old));
            add_measures(b, DMK_KEEP_Q, linear_product(linear_stiffness(r, x), x), a, next, 1, q,
                         &sum);
        }
        leave_update(s, part, sum, change);
    }
}

/* u at the midpoints, the means of their ends' (ends: a midpoint's two vertices).
 * reads ends, u (gathered); writes u; moves 8 K + real V + real K bytes, 2 K flops
 * shape blocks of K */
KERNEL nested_refine(int n, int vertex_row, global const int *restrict ends, global real *restrict u,
                     volatile global int *shares, int4 launch)
{
    GATHERED real *at_end = u + vertex_row;
    FOR_BLOCKS(b, n, shares, launch)
    {
        const intv i = LOAD(ends, AT_K(b, 0, 2)), j = LOAD(ends, AT_K(b, 1, 2));
        STORE((real)0.5 * ((realv)(GATHER(at_end, i)) + (realv)(GATHER(at_end, j))), u, AT(b));
    }
}

#if !DMK_DOUBLE
/* inner_apply (vector.cl) on T.
 * reads slice, neighbour, weight, r, ap, z (gathered); writes w, scalars, which are the state
 * moves 8 L + 16 V bytes, 3 L + 6 V flops
 * shape blocks of V; numerics the sums in sum_t, in the order of parts */
KERNEL nested_apply(int n, int first, global const int *restrict slice,
                    global const int *restrict neighbour, global const float *restrict weight,
                    global const float *restrict r, global const float *restrict ap,
                    global const float *restrict z, global float *restrict w,
                    volatile global sum_t *partial, int at, global sum_t *restrict scalars,
                    volatile global int *done, volatile global int *shares, int4 launch)
{
    local group_memory group;
    const sums s = {partial, scalars, done, &group, at, launch.s3};
    const graph g = {slice, neighbour, weight};
    FOR_PARTS(part, shares, launch)
    {
        products sum = {0, 0, 0};
        FOR_PART_BLOCKS(b, n, part)
        {
            const floatv now = LOAD(z, AT(b)), az = graph_sum(b, g, z, now);
            STORE(az, w, AT(b));
            add_products(b, first, r, ap, now, az, &sum);
        }
        finish_products(s, part, first, sum);
    }
}
#endif
