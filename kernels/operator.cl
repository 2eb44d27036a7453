/* The macro-element operators on the mesh refined once (T/2).
 *
 * A macro-element is a triangle of T with its corners v0 v1 v2 and edge midpoints m0 m1 m2 (m_i
 * opposite v_i). Its stiffness is a graph Laplacian with nine links (cotangents c_i of T):
 *     v_i - m_j: c_j / 2  (i != j),    m_i - m_j: c_k.
 * An operator is applied in two phases without atomics: every element writes its six contributions,
 * then every row (unknown) sums those that belong to it, in a fixed order.
 *   index   6 per element: rows of v0 v1 v2 m0 m1 m2
 *   out     6 per element: contributions
 *   slice, slot   rows in slices of 8 (sliced ELLPACK): columns slice[s]..slice[s+1] of slice s hold
 *                 places in `out`; short rows are filled with a place that stays 0. */

#define X6(p, index, b)                                                                            \
    const intv i0 = LOAD(index, AT_K(b, 0, 6)), i1 = LOAD(index, AT_K(b, 1, 6)),                   \
               i2 = LOAD(index, AT_K(b, 2, 6)), i3 = LOAD(index, AT_K(b, 3, 6)),                   \
               i4 = LOAD(index, AT_K(b, 4, 6)), i5 = LOAD(index, AT_K(b, 5, 6));                   \
    realv v0 = (realv)(GATHER(p, i0)), v1 = (realv)(GATHER(p, i1)), v2 = (realv)(GATHER(p, i2)),   \
          m0 = (realv)(GATHER(p, i3)), m1 = (realv)(GATHER(p, i4)), m2 = (realv)(GATHER(p, i5));

/* y = K x with link weights from w_i = (density *) c_i. */
#define STIFFNESS(w0, w1, w2)                                                                      \
    const realv h0 = (real)0.5 * (w0), h1 = (real)0.5 * (w1), h2 = (real)0.5 * (w2);               \
    const realv f10 = h0 * (v1 - m0), f20 = h0 * (v2 - m0), f01 = h1 * (v0 - m1),                  \
                f21 = h1 * (v2 - m1), f02 = h2 * (v0 - m2), f12 = h2 * (v1 - m2);                  \
    const realv fa = (w0) * (m1 - m2), fb = (w1) * (m2 - m0), fc = (w2) * (m0 - m1);               \
    realv y0 = f01 + f02, y1 = f10 + f12, y2 = f20 + f21, y3 = (fc - fb) - (f10 + f20),            \
          y4 = (fa - fc) - (f01 + f21), y5 = (fb - fa) - (f02 + f12);

#define STORE6(out, b)                                                                             \
    STORE(y0, out, AT_K(b, 0, 6));                                                                 \
    STORE(y1, out, AT_K(b, 1, 6));                                                                 \
    STORE(y2, out, AT_K(b, 2, 6));                                                                 \
    STORE(y3, out, AT_K(b, 3, 6));                                                                 \
    STORE(y4, out, AT_K(b, 4, 6));                                                                 \
    STORE(y5, out, AT_K(b, 5, 6));

/* First phase of A(mu): weight = mu c_i, 3 per element.
 * moves 24 E + 9 real E + real R bytes, 33 E flops */
KERNEL element_stiffness(int n, global const int *index, global const real *weight, GATHERED real *x,
                         global real *out LAUNCH)
{
    FOR_BLOCKS(b, n)
    {
        X6(x, index, b)
        const realv w0 = LOAD(weight, AT_K(b, 0, 3)), w1 = LOAD(weight, AT_K(b, 1, 3)),
                    w2 = LOAD(weight, AT_K(b, 2, 3));
        STIFFNESS(w0, w1, w2)
        STORE6(out, b)
    }
}

/* y += g g'x, g the six numbers of each element. Differences to m0: the six g sum to 0, and large equal
 * parts of x cancel exactly. */
#define RANK_ONE(g, b)                                                                             \
    {                                                                                              \
        const realv g0 = LOAD(g, AT_K(b, 0, 6)), g1 = LOAD(g, AT_K(b, 1, 6)),                      \
                    g2 = LOAD(g, AT_K(b, 2, 6)), g3 = LOAD(g, AT_K(b, 3, 6)),                      \
                    g4 = LOAD(g, AT_K(b, 4, 6)), g5 = LOAD(g, AT_K(b, 5, 6));                      \
        const realv s_ = g0 * (v0 - m0) + g1 * (v1 - m0) + g2 * (v2 - m0) + g4 * (m1 - m0) +       \
                         g5 * (m2 - m0);                                                           \
        y0 += s_ * g0;                                                                             \
        y1 += s_ * g1;                                                                             \
        y2 += s_ * g2;                                                                             \
        y3 += s_ * g3;                                                                             \
        y4 += s_ * g4;                                                                             \
        y5 += s_ * g5;                                                                             \
    }

/* First phase of Newton's M = A + sum_T g_T g_T': g holds the six g_T times the root of its factor.
 * moves 24 E + 15 real E + real R bytes, 59 E flops */
KERNEL element_newton(int n, global const int *index, global const real *weight,
                      global const real *g, GATHERED real *x, global real *out LAUNCH)
{
    FOR_BLOCKS(b, n)
    {
        X6(x, index, b)
        const realv w0 = LOAD(weight, AT_K(b, 0, 3)), w1 = LOAD(weight, AT_K(b, 1, 3)),
                    w2 = LOAD(weight, AT_K(b, 2, 3));
        STIFFNESS(w0, w1, w2)
        RANK_ONE(g, b)
        STORE6(out, b)
    }
}

#define ROW_SUM(y, b)                                                                              \
    realv y = 0;                                                                                   \
    for (int j_ = slice[SLICE(b)], e_ = slice[SLICE(b) + 1]; j_ < e_; j_++) {                      \
        const intv s_ = LOAD(slot, COLUMN(b, j_));                                                 \
        y += (realv)(GATHER(out, s_));                                                             \
    }

/* Second phase, y = A x, and x.y: where it is summed up, at = 1, CG's step follows from it (vector.cl).
 * moves 4 P + 6 real E + 2 real R bytes, 6 E + 2 R flops */
KERNEL rows_apply(int n, global const int *slice, global const int *slot, GATHERED real *out,
                  global const real *x, global real *y, SUM_ARGS LAUNCH)
{
    SCRATCH
    FOR_PARTS
    {
        sumv sum = 0;
        FOR_PART_BLOCKS(b, n)
        {
            ROW_SUM(a, b)
            STORE(a, y, AT(b));
            sum += TO_SUM(a) * TO_SUM(LOAD(x, AT(b)));
        }
        REDUCE(partial, 0, sum);
        const int when = LAST_PART;
        CG_ALPHA(PARTS)
    }
}

/* Second phase of a Chebyshev step in three-term form, in place over the older iterate:
 *     x_old <- x + momentum (x - keep x_old) + step D^-1 (b - A x).
 * moves 4 P + 6 real E + 5 real R bytes, 6 E + 7 R flops */
KERNEL rows_chebyshev(int n, global const int *slice, global const int *slot, GATHERED real *out,
                      global const real *rhs, global const real *inv_diag, global const real *x,
                      global real *x_old, float momentum, float keep, float step LAUNCH)
{
    FOR_BLOCKS(b, n)
    {
        ROW_SUM(a, b)
        const realv now = LOAD(x, AT(b));
        const realv next = now + (real)momentum * (now - (real)keep * LOAD(x_old, AT(b))) +
                           (real)step * LOAD(inv_diag, AT(b)) * (LOAD(rhs, AT(b)) - a);
        STORE(next, x_old, AT(b));
    }
}
