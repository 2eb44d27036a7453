/* The macro-element operators on the mesh refined once (T/2).
 *
 * A macro-element is a triangle of T with its corners v0 v1 v2 and edge midpoints m0 m1 m2 (m_i
 * opposite v_i). Its stiffness is a graph Laplacian with nine edges (cotangents c_i of T):
 *     v_i - m_j: c_j / 2  (i != j),    m_i - m_j: c_k.
 * An operator is applied in two phases without atomics: every element writes its six contributions,
 * then every row (unknown) sums those that belong to it, in a fixed order.
 *   index   6 per element: rows of v0 v1 v2 m0 m1 m2
 *   out     6 per element: contributions
 *   slice, slot   rows in slices of 8 (sliced ELLPACK): columns slice[s]..slice[s+1] of slice s hold
 *                 slots in `out`; short rows are filled with a slot that stays 0. */

/* The rows of an element's (or a block's elements') six points, and numbers at these. */
typedef struct six_rows {
    intv v0, v1, v2, m0, m1, m2;
} six_rows;

typedef struct six {
    realv v0, v1, v2, m0, m1, m2;
} six;

typedef struct three {
    realv c0, c1, c2;
} three;

/* The nine flows along an element's edges: f_ij from v_i to m_j; fa between m1 and m2, and so on. */
typedef struct flows {
    realv f10, f20, f01, f21, f02, f12, fa, fb, fc;
} flows;

static six_rows load_rows(global const int *index, int b)
{
    const six_rows i = {LOAD(index, AT_K(b, 0, 6)), LOAD(index, AT_K(b, 1, 6)),
                        LOAD(index, AT_K(b, 2, 6)), LOAD(index, AT_K(b, 3, 6)),
                        LOAD(index, AT_K(b, 4, 6)), LOAD(index, AT_K(b, 5, 6))};
    return i;
}

static six gather_six(GATHERED real *p, six_rows i)
{
    const six x = {(realv)(GATHER(p, i.v0)), (realv)(GATHER(p, i.v1)), (realv)(GATHER(p, i.v2)),
                   (realv)(GATHER(p, i.m0)), (realv)(GATHER(p, i.m1)), (realv)(GATHER(p, i.m2))};
    return x;
}

static six load_six(global const real *p, int b)
{
    const six x = {LOAD(p, AT_K(b, 0, 6)), LOAD(p, AT_K(b, 1, 6)), LOAD(p, AT_K(b, 2, 6)),
                   LOAD(p, AT_K(b, 3, 6)), LOAD(p, AT_K(b, 4, 6)), LOAD(p, AT_K(b, 5, 6))};
    return x;
}

static three load_three(global const real *p, int b)
{
    const three x = {LOAD(p, AT_K(b, 0, 3)), LOAD(p, AT_K(b, 1, 3)), LOAD(p, AT_K(b, 2, 3))};
    return x;
}

#define STORE6(y, p, b)                                                                           \
    STORE(y.v0, p, AT_K(b, 0, 6)); STORE(y.v1, p, AT_K(b, 1, 6)); STORE(y.v2, p, AT_K(b, 2, 6)); \
    STORE(y.m0, p, AT_K(b, 3, 6)); STORE(y.m1, p, AT_K(b, 4, 6)); STORE(y.m2, p, AT_K(b, 5, 6));

static void store_six(six y, global real *out, int b) { STORE6(y, out, b) }

static flows flows_of(three w, six x)
{
    const realv h0 = (real)0.5 * w.c0, h1 = (real)0.5 * w.c1, h2 = (real)0.5 * w.c2;
    const flows f = {h0 * (x.v1 - x.m0),   h0 * (x.v2 - x.m0),   h1 * (x.v0 - x.m1),
                     h1 * (x.v2 - x.m1),   h2 * (x.v0 - x.m2),   h2 * (x.v1 - x.m2),
                     w.c0 * (x.m1 - x.m2), w.c1 * (x.m2 - x.m0), w.c2 * (x.m0 - x.m1)};
    return f;
}

static six divergence(flows f)
{
    const six y = {f.f01 + f.f02,
                   f.f10 + f.f12,
                   f.f20 + f.f21,
                   (f.fc - f.fb) - (f.f10 + f.f20),
                   (f.fa - f.fc) - (f.f01 + f.f21),
                   (f.fb - f.fa) - (f.f02 + f.f12)};
    return y;
}

/* K x with edge weights from w_i = (density *) c_i. */
static six stiffness(three w, six x)
{
    return divergence(flows_of(w, x));
}

/* First phase of A(mu): weight = mu c_i, 3 per element.
 * reads index, weight, x (gathered); writes out
 * moves 24 E + 9 real E + real R bytes, 33 E flops
 * shape blocks of E; numerics differences first, so that constants give 0 exactly */
KERNEL element_stiffness(int n, global const int *restrict index,
                         global const real *restrict weight, GATHERED real *restrict x,
                         global real *restrict out, volatile global int *shares, int4 launch)
{
    FOR_BLOCKS(b, n, shares, launch)
    {
        store_six(stiffness(load_three(weight, b), gather_six(x, load_rows(index, b))), out, b);
    }
}

/* g.x, where the six numbers g of an element sum to 0: by differences to m0, so that large equal parts of x cancel
 * exactly. */
static realv dot_six(six g, six x)
{
    return g.v0 * (x.v0 - x.m0) + g.v1 * (x.v1 - x.m0) + g.v2 * (x.v2 - x.m0) +
           g.m1 * (x.m1 - x.m0) + g.m2 * (x.m2 - x.m0);
}

/* y + g g'x, g the six numbers of each element. */
static six add_rank_one(six y, six g, six x)
{
    const realv s = dot_six(g, x);
    y.v0 += s * g.v0;
    y.v1 += s * g.v1;
    y.v2 += s * g.v2;
    y.m0 += s * g.m0;
    y.m1 += s * g.m1;
    y.m2 += s * g.m2;
    return y;
}

/* First phase of Newton's M = A + sum_T g_T g_T': g holds the six g_T times the root of its factor.
 * reads index, weight, g, x (gathered); writes out
 * moves 24 E + 15 real E + real R bytes, 59 E flops
 * shape blocks of E; numerics as element_stiffness */
KERNEL element_newton(int n, global const int *restrict index, global const real *restrict weight,
                      global const real *restrict g, GATHERED real *restrict x,
                      global real *restrict out, volatile global int *shares, int4 launch)
{
    FOR_BLOCKS(b, n, shares, launch)
    {
        const six at = gather_six(x, load_rows(index, b));
        store_six(add_rank_one(stiffness(load_three(weight, b), at), load_six(g, b), at), out, b);
    }
}

/* The sum of what belongs to a row, in its list's order. */
static realv row_sum(global const int *slice, global const int *slot, GATHERED real *out, int b,
                     int4 launch)
{
    const bool far = IS_FAR(launch);
    realv y = 0;
    for (int j = slice[SLICE(b)], end = slice[SLICE(b) + 1]; j < end; j++) {
        const intv s = LOAD(slot, COLUMN(b, j));
        if (far) {
            const intv later = LOAD(slot, COLUMN(b, j + DMK_AHEAD));
            GATHERS_LATER(out, later);
        }
        y += (realv)(GATHER(out, s));
    }
    return y;
}

/* Second phase, y = A x, and x.y: where it is summed up, at = 1, CG's step follows from it (vector.cl).
 * reads slice, slot, out (gathered), x; writes y, scalars
 * moves 4 P + 6 real E + 2 real R bytes, 6 E + 2 R flops
 * shape blocks of R; numerics x.y in sum_t, in the order of parts */
KERNEL rows_apply(int n, global const int *restrict slice, global const int *restrict slot,
                  GATHERED real *restrict out, global const real *restrict x,
                  global real *restrict y, volatile global sum_t *partial, int at,
                  global sum_t *restrict scalars, volatile global int *done,
                  volatile global int *shares, int4 launch)
{
    local group_memory group;
    const sums s = {partial, scalars, done, &group, at, launch.s3};
    FOR_PARTS(part, shares, launch)
    {
        sumv sum = 0;
        FOR_PART_BLOCKS(b, n, part)
        {
            const realv a = row_sum(slice, slot, out, b, launch);
            STORE(a, y, AT(b));
            sum += TO_SUM(a) * TO_SUM(LOAD(x, AT(b)));
        }
        leave_sum(s, 0, part, sum);
        cg_alpha_of(s, is_last_part(s, part, 1, 0));
    }
}

/* Second phase of a Chebyshev step in three-term form, in place over the older iterate:
 *     x_old <- x + momentum (x - keep x_old) + step D^-1 (b - A x).
 * reads slice, slot, out (gathered), rhs, inv_diag, x, x_old; writes x_old
 * moves 4 P + 6 real E + 5 real R bytes, 6 E + 7 R flops
 * shape blocks of R */
KERNEL rows_chebyshev(int n, global const int *restrict slice, global const int *restrict slot,
                      GATHERED real *restrict out, global const real *restrict rhs,
                      global const real *restrict inv_diag, global const real *restrict x,
                      global real *restrict x_old, float momentum, float keep, float step,
                      volatile global int *shares, int4 launch)
{
    FOR_BLOCKS(b, n, shares, launch)
    {
        const realv a = row_sum(slice, slot, out, b, launch), now = LOAD(x, AT(b));
        const realv next = now + (real)momentum * (now - (real)keep * LOAD(x_old, AT(b))) +
                           (real)step * LOAD(inv_diag, AT(b)) * (LOAD(rhs, AT(b)) - a);
        STORE(next, x_old, AT(b));
    }
}
