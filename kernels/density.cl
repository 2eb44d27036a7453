/* The density's side: gradient energies, Newton's coefficients, density updates.
 * Element arrays are padded to blocks of 8 with elements of no weight (mu = 0, cot = 0, area = 1).
 *   index 6, cot 3, area 1, mu 1, q 1, g 6 per element; see operator.cl. */

/* The largest difference of an element's values to that at m0, and the sum of its flows' sizes. */
static realv farthest(six x)
{
    const realv top = fmax(fabs(x.v0 - x.m0), fmax(fabs(x.v1 - x.m0), fabs(x.v2 - x.m0)));
    return fmax(top, fmax(fabs(x.m1 - x.m0), fabs(x.m2 - x.m0)));
}

static realv total_flow(flows f)
{
    return fabs(f.f10) + fabs(f.f20) + fabs(f.f01) + fabs(f.f21) + fabs(f.f02) + fabs(f.f12) +
           fabs(f.fa) + fabs(f.fb) + fabs(f.fc);
}

static six scaled(realv k, six x)
{
    const six y = {k * x.v0, k * x.v1, k * x.v2, k * x.m0, k * x.m1, k * x.m2};
    return y;
}

/* The larger one, but x where it is no number: fmax would hide it, and with it that the iteration diverges. */
static realv at_least(realv x, realv lowest)
{
    return x < lowest ? lowest : x;
}

/* L = 1/2 log(alpha^2 q), kept in [-1, 1]. */
static realv log_slope(realv q)
{
    return clamp((real)0.5 * log(fmax(q, (realv)1e-30f)), (realv)-1, (realv)1);
}

/* The pseudo-time step of an element: D, but no more than changes y by 1 / bend by L alone. */
static realv local_step(float D, float bend, realv l)
{
    return (real)D / fmax((realv)1, (real)D * (real)bend * fabs(l));
}

/* mu after y has changed by dy, which is kept in [-1, 1]; elements without mu, the padding, have none. */
static realv grown(realv mu, realv dy, realv area, float lowest)
{
    const realv next = mu * exp(at_least(dy > 1 ? (realv)1 : dy, (realv)-1));
    return mu > 0 ? at_least(next, (real)lowest * sqrt(area)) : next;
}

/* Sums over elements: of mu u.g = u.Au, of area mu, and of this times L and L^2 at alpha = 1; and the largest q. */
typedef struct measures {
    sumv energy, mass, slope, square, top;
} measures;

/* What block b adds to them, where u.g = e, but L at alpha = scale; and q = e / area, the mean of |grad u|^2, stored if
 * it is to be kept. */
static void add_measures(int b, int keep, realv e, realv area, realv mu, real scale, global real *q,
                         measures *sum)
{
    const realv square = e / area, m = area * mu, l = log_slope(scale * scale * square);
    if (keep & DMK_KEEP_Q) STORE(square, q, AT(b));
    sum->energy += TO_SUM(mu * e);
    sum->mass += TO_SUM(m);
    sum->slope += TO_SUM(m * l);
    sum->square += TO_SUM(m * l * l);
    sum->top = fmax(sum->top, TO_SUM(square));
}

/* g = K u in block b, whose corners and midpoints are at x's six, and add_measures of it. slack > 0: u.g with its
 * rounding on top, `slack` times what its terms would be without cancellation: at large cotangents of both signs they
 * are up to cot^2 times as large as their sum. */
static void measure_block(int b, int keep, float slack, six x, global const real *cot, realv area,
                          realv mu, global real *g, global real *q, measures *sum)
{
    const flows f = flows_of(load_three(cot, b), x);
    const six y = divergence(f);
    if (keep & DMK_KEEP_G) store_six(y, g, b);
    realv e = at_least(dot_six(y, x), (realv)0);
    if (slack > 0) e += (real)slack * farthest(x) * total_flow(f);
    add_measures(b, keep, e, area, mu, 1, q, sum);
}

/* The four sums. */
static void leave_measures(sums s, int part, measures sum)
{
    leave_sum(s, 0, part, sum.energy);
    leave_sum(s, 1, part, sum.mass);
    leave_sum(s, 2, part, sum.slope);
    leave_sum(s, 3, part, sum.square);
}

/* Those after a step, that of area |change of mu|, and the maximum. */
static void leave_update(sums s, int part, measures sum, sumv change)
{
    leave_measures(s, part, sum);
    leave_sum(s, 4, part, change);
    leave_max(s, 5, part, sum.top);
    finish_sums(s, part, 6, 1);
}

/* g = K u (without mu) and q, stored if they are to be kept; the sums, then the maximum: see measure_block.
 * reads index, cot, area, mu, u (gathered); writes g, q, scalars
 * moves 24 E + 12 real E + real R bytes, 60 E flops
 * shape blocks of E; numerics the sums in sum_t, in the order of parts */
KERNEL element_energy(int n, int keep, float slack, global const int *restrict index,
                      global const real *restrict cot, global const real *restrict area,
                      global const real *restrict mu, GATHERED real *restrict u,
                      global real *restrict g, global real *restrict q,
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
            measure_block(b, keep, slack, gather_six(u, load_rows(index, b)), cot, LOAD(area, AT(b)),
                          LOAD(mu, AT(b)), g, q, &sum);
        }
        leave_measures(s, part, sum);
        leave_max(s, 4, part, sum.top);
        finish_sums(s, part, 5, 1);
    }
}

/* The largest ratio of x'K_T x to x'D_T x of a stiffness element, D its diagonal: the sum of squared
 * sines over the three angles is 2 minus 2 times the product of cosines; the bound below is its exact
 * larger eigenvalue, 1.5 for the equilateral, 2 for the right-angled, below 3 always. */
static floatv stiffness_bound(floatv c0, floatv c1, floatv c2)
{
    const floatv s = 1 / (1 + c0 * c0) + 1 / (1 + c1 * c1) + 1 / (1 + c2 * c2);
    return 1.5f + sqrt(fmax(2.25f - s, (floatv)0));
}

/* Larger eigenvalue of D^-1 A for the 3x3 Laplacian with edge weights w (A positive semidefinite): in
 * [1.5, 3], whatever rounding and overflow make of it for needles. */
static floatv edge_bound(floatv w0, floatv w1, floatv w2, floatv d0, floatv d1, floatv d2)
{
    const floatv minor = w0 * w1 + w1 * w2 + w0 * w2;
    const floatv p = minor * (d0 + d1 + d2) / fmax(d0 * d1 * d2, (floatv)1e-37f);
    return 1.5f + sqrt(fmin(fmax(2.25f - p, (floatv)0), (floatv)2.25f));
}

typedef struct six_floats {
    floatv v0, v1, v2, m0, m1, m2;
} six_floats;

#define STORE3(a0, a1, a2, p, b)                                                                   \
    STORE(a0, p, AT_K(b, 0, 3));                                                                   \
    STORE(a1, p, AT_K(b, 1, 3));                                                                   \
    STORE(a2, p, AT_K(b, 2, 3));

/* Coefficients of A(mu) in single precision for the V-cycle: weight = mu cot (3), the elements'
 * weighted diagonals on T/2 (6) and T (3), and the edge weights on T (3). With an element's diagonal
 * weighted by its own bound lambda_T, sum lambda_T D_T >= A whatever mu is.
 * reads cot, mu; writes weight_real, weight, diag, edge, diag_coarse
 * moves 7 real E + 60 E bytes, 40 E flops
 * shape blocks of E; numerics the diagonals' sums in the program's precision, then single */
KERNEL element_prepare(int n, global const real *restrict cot, global const real *restrict mu,
                       global real *restrict weight_real, global float *restrict weight,
                       global float *restrict diag, global float *restrict edge,
                       global float *restrict diag_coarse, volatile global int *shares, int4 launch)
{
    FOR_BLOCKS(b, n, shares, launch)
    {
        const realv m = LOAD(mu, AT(b));
        const realv r0 = m * LOAD(cot, AT_K(b, 0, 3)), r1 = m * LOAD(cot, AT_K(b, 1, 3)),
                    r2 = m * LOAD(cot, AT_K(b, 2, 3));
        STORE3(r0, r1, r2, weight_real, b)
        const floatv w0 = TO_FLOAT(r0), w1 = TO_FLOAT(r1), w2 = TO_FLOAT(r2);
        STORE3(w0, w1, w2, weight, b)
        const floatv l = stiffness_bound(TO_FLOAT(LOAD(cot, AT_K(b, 0, 3))),
                                         TO_FLOAT(LOAD(cot, AT_K(b, 1, 3))),
                                         TO_FLOAT(LOAD(cot, AT_K(b, 2, 3))));
        /* At an angle near pi single precision would lose these sums. */
        const floatv v0 = TO_FLOAT(r1 + r2), v1 = TO_FLOAT(r0 + r2), v2 = TO_FLOAT(r0 + r1);
        const floatv d0 = 0.5f * l * v0, d1 = 0.5f * l * v1, d2 = 0.5f * l * v2,
                     dm = 0.5f * l * (v0 + v1 + v2);
        STORE3(d0, d1, d2, diag_coarse, b)
        STORE3(0.5f * w0, 0.5f * w1, 0.5f * w2, edge, b)
        const six_floats d = {d0, d1, d2, dm, dm, dm};
        STORE6(d, diag, b)
    }
}

/* Newton's weighted diagonals on T/2: cotangents, sums of two of them times mu, sizes of rank_one. */
static six_floats weighted_diagonals(floatv c0, floatv c1, floatv c2, floatv v0, floatv v1, floatv v2,
                                     six_floats s)
{
    const floatv l = 0.5f * stiffness_bound(c0, c1, c2);
    const floatv dm = l * (v0 + v1 + v2), size = s.v0 + s.v1 + s.v2 + s.m0 + s.m1 + s.m2;
    const six_floats d = {l * v0 + size * s.v0, l * v1 + size * s.v1, l * v2 + size * s.v2,
                          dm + size * s.m0,     dm + size * s.m1,     dm + size * s.m2};
    return d;
}

/* Newton's weights on T of an element: w mu times its cotangents, v their sums by corner, t the root of the rank-one
 * part; and the weighted diagonals. */
static void store_linear(floatv w0, floatv w1, floatv w2, floatv v0, floatv v1, floatv v2, floatv t0,
                         floatv t1, floatv t2, global float *edge, global float *diag_coarse, int b)
{
    const floatv k0 = 0.5f * w0 - t1 * t2, k1 = 0.5f * w1 - t0 * t2, k2 = 0.5f * w2 - t0 * t1;
    /* k1 + k2 and the like, without cancellation: t0 + t1 + t2 = 0. */
    const floatv d0 = 0.5f * v0 + t0 * t0, d1 = 0.5f * v1 + t1 * t1,
                 d2 = 0.5f * v2 + t2 * t2;
    const floatv bound = edge_bound(k0, k1, k2, d0, d1, d2);
    STORE3(k0, k1, k2, edge, b)
    STORE3(bound * d0, bound * d1, bound * d2, diag_coarse, b)
}

/* sqrt(c_T), see newton_prepare. */
static realv rank_one_root(realv step, realv mu, realv area, realv e)
{
    return sqrt(step * mu / (area * fmax(e, (realv)0.25f)));
}

/* Newton's coefficients at pseudo time D (implicit Euler in y = log mu), an element's by its local_step:
 *     M = A + sum_T c_T g_T g_T',  c_T = D_T mu_T / (|T| s_T),  s_T = max(q_T, 1/4),
 *     right-hand side  f - sum_T mu_T (1 + D_T L_T) g_T,
 * with u, hence g and sqrt(q), scaled by alpha. The rank-one part is bounded by |g_i| sum |g_j| on the
 * diagonal; on T the exact bound of the summed 3x3 element is used. rank_one = sqrt(c_T) g_T. The
 * right-hand side's parts take the place of g, and newton_diagonal, once they are summed up, that of them; or,
 * paired, in double precision, these parts rounded to single precision and the weighted diagonals side by side.
 * reads cot, area, mu, q, g_and_rhs; writes g_and_rhs, weight, rank_one, edge, diag_coarse
 * moves 18 real E + 60 E bytes, 145 E flops
 * shape blocks of E; numerics as element_prepare; sums that cancel are avoided */
KERNEL newton_prepare(int n, int paired, float alpha, float D, float bend,
                      global const real *restrict cot, global const real *restrict area, global const real *restrict mu,
                      global const real *restrict q, global real *restrict g_and_rhs,
                      global float *restrict weight, global float *restrict rank_one,
                      global float *restrict edge, global float *restrict diag_coarse,
                      volatile global int *shares, int4 launch)
{
    FOR_BLOCKS(b, n, shares, launch)
    {
        const realv m = LOAD(mu, AT(b)), e = (real)alpha * (real)alpha * LOAD(q, AT(b));
        const six g = scaled((realv)((real)alpha), load_six(g_and_rhs, b));
        const realv slope = log_slope(e), step = local_step(D, bend, slope);
        const six rhs = scaled(-m * (1 + step * slope), g);
        if (!paired) store_six(rhs, g_and_rhs, b);

        const three r = load_three(cot, b);
        const floatv c0 = TO_FLOAT(r.c0), c1 = TO_FLOAT(r.c1), c2 = TO_FLOAT(r.c2), mf = TO_FLOAT(m);
        const floatv w0 = mf * c0, w1 = mf * c1, w2 = mf * c2;
        const floatv v0 = mf * TO_FLOAT(r.c1 + r.c2), v1 = mf * TO_FLOAT(r.c0 + r.c2),
                     v2 = mf * TO_FLOAT(r.c0 + r.c1);
        STORE3(w0, w1, w2, weight, b)
        const floatv root = TO_FLOAT(rank_one_root(step, m, LOAD(area, AT(b)), e));
        const six_floats p = {root * TO_FLOAT(g.v0), root * TO_FLOAT(g.v1), root * TO_FLOAT(g.v2),
                              root * TO_FLOAT(g.m0), root * TO_FLOAT(g.m1), root * TO_FLOAT(g.m2)};
        STORE6(p, rank_one, b)
#if DMK_DOUBLE
        if (paired) {
            global float *pairs = (global float *)g_and_rhs;
            const six_floats size = {fabs(p.v0), fabs(p.v1), fabs(p.v2),
                                     fabs(p.m0), fabs(p.m1), fabs(p.m2)};
            const six_floats d = weighted_diagonals(c0, c1, c2, v0, v1, v2, size);
            store_pairs(TO_FLOAT(rhs.v0), d.v0, pairs, AT_K(b, 0, 6));
            store_pairs(TO_FLOAT(rhs.v1), d.v1, pairs, AT_K(b, 1, 6));
            store_pairs(TO_FLOAT(rhs.v2), d.v2, pairs, AT_K(b, 2, 6));
            store_pairs(TO_FLOAT(rhs.m0), d.m0, pairs, AT_K(b, 3, 6));
            store_pairs(TO_FLOAT(rhs.m1), d.m1, pairs, AT_K(b, 4, 6));
            store_pairs(TO_FLOAT(rhs.m2), d.m2, pairs, AT_K(b, 5, 6));
        }
#endif

        /* On T: P'g takes half of each adjacent midpoint. */
        const floatv t0 = p.v0 + 0.5f * (p.m1 + p.m2), t1 = p.v1 + 0.5f * (p.m0 + p.m2),
                     t2 = p.v2 + 0.5f * (p.m0 + p.m1);
        store_linear(w0, w1, w2, v0, v1, v2, t0, t1, t2, edge, diag_coarse, b);
    }
}

/* The same where M itself is in the outer precision and has no levels through T: coefficients in both, and the
 * right-hand side's parts with the sign of A u.
 * reads cot, area, mu, q, g_and_rhs; writes g_and_rhs, weight, rank_one, weight_real, rank_one_real
 * moves 27 real E + 36 E bytes, 55 E flops
 * shape blocks of E */
KERNEL newton_prepare_wide(int n, float alpha, float D, float bend, global const real *restrict cot,
                           global const real *restrict area, global const real *restrict mu,
                           global const real *restrict q, global real *restrict g_and_rhs,
                           global float *restrict weight, global float *restrict rank_one,
                           global real *restrict weight_real, global real *restrict rank_one_real,
                           volatile global int *shares, int4 launch)
{
    FOR_BLOCKS(b, n, shares, launch)
    {
        const realv m = LOAD(mu, AT(b)), e = (real)alpha * (real)alpha * LOAD(q, AT(b));
        const six g = scaled((realv)((real)alpha), load_six(g_and_rhs, b));
        const realv slope = log_slope(e), step = local_step(D, bend, slope);
        const three c = load_three(cot, b);
        const realv w0 = m * c.c0, w1 = m * c.c1, w2 = m * c.c2;
        const six p = scaled(rank_one_root(step, m, LOAD(area, AT(b)), e), g);
        const six_floats single = {TO_FLOAT(p.v0), TO_FLOAT(p.v1), TO_FLOAT(p.v2),
                                   TO_FLOAT(p.m0), TO_FLOAT(p.m1), TO_FLOAT(p.m2)};
        STORE3(w0, w1, w2, weight_real, b)
        STORE3(TO_FLOAT(w0), TO_FLOAT(w1), TO_FLOAT(w2), weight, b)
        store_six(p, rank_one_real, b);
        STORE6(single, rank_one, b)
        store_six(scaled(m * (1 + step * slope), g), g_and_rhs, b);
    }
}

/* M's weighted diagonals on T/2, with rank_one from newton_prepare.
 * reads cot, mu, rank_one; writes diag
 * moves 4 real E + 48 E bytes, 45 E flops
 * shape blocks of E; numerics as element_prepare */
KERNEL newton_diagonal(int n, global const real *restrict cot, global const real *restrict mu,
                       global const float *restrict rank_one, global float *restrict diag,
                       volatile global int *shares, int4 launch)
{
    FOR_BLOCKS(b, n, shares, launch)
    {
        const three r = load_three(cot, b);
        const floatv mf = TO_FLOAT(LOAD(mu, AT(b)));
        const floatv v0 = mf * TO_FLOAT(r.c1 + r.c2), v1 = mf * TO_FLOAT(r.c0 + r.c2),
                     v2 = mf * TO_FLOAT(r.c0 + r.c1);
        const six_floats size = {
            fabs(LOAD(rank_one, AT_K(b, 0, 6))), fabs(LOAD(rank_one, AT_K(b, 1, 6))),
            fabs(LOAD(rank_one, AT_K(b, 2, 6))), fabs(LOAD(rank_one, AT_K(b, 3, 6))),
            fabs(LOAD(rank_one, AT_K(b, 4, 6))), fabs(LOAD(rank_one, AT_K(b, 5, 6)))};
        const six_floats d = weighted_diagonals(TO_FLOAT(r.c0), TO_FLOAT(r.c1), TO_FLOAT(r.c2), v0, v1,
                                                v2, size);
        STORE6(d, diag, b)
    }
}

/* rhs = f + sum of the elements' parts, in single precision for the inner solve.
 * reads slice, slot, out (gathered), f; writes rhs
 * moves 4 P + 6 real E + real R + 4 R bytes, 6 E + R flops
 * shape blocks of R */
KERNEL rows_rhs(int n, global const int *restrict slice, global const int *restrict slot,
                GATHERED real *restrict out, global const real *restrict f,
                global float *restrict rhs, volatile global int *shares, int4 launch)
{
    FOR_BLOCKS(b, n, shares, launch)
    {
        const realv a = row_sum(slice, slot, out, b, launch);
        STORE(TO_FLOAT(LOAD(f, AT(b)) + a), rhs, AT(b));
    }
}

/* rows_rhs, inverse_diagonal and smooth_first at once, from the pairs of newton_prepare: rhs = f + the sum of the
 * elements' parts, the inverse of the sum of their diagonals, and z = step D^-1 rhs.
 * reads slice, slot, pairs (gathered), f; writes rhs, inv_diag, z
 * moves 4 P + 48 E + real R + 12 R bytes, 12 E + 4 R flops
 * shape blocks of R; numerics sums of the right-hand side in the program's precision */
KERNEL newton_rows(int n, float step, global const int *restrict slice,
                   global const int *restrict slot, GATHERED float *restrict pairs,
                   global const real *restrict f, global float *restrict rhs,
                   global float *restrict inv_diag, global float *restrict z,
                   volatile global int *shares, int4 launch)
{
    FOR_BLOCKS(b, n, shares, launch)
    {
        realv sum = 0;
        floatv diag = 0;
        for (int j = slice[SLICE(b)], end = slice[SLICE(b) + 1]; j < end; j++) {
            const intv s = LOAD(slot, COLUMN(b, j));
            const two p = gather_pairs(pairs, s);
            sum += TO_REAL(p.first);
            diag += p.second;
        }
        const floatv r = TO_FLOAT(LOAD(f, AT(b)) + sum), inverse = inverse_of(diag);
        STORE(r, rhs, AT(b));
        STORE(inverse, inv_diag, AT(b));
        STORE(step * inverse * r, z, AT(b));
    }
}

/* r = f - A u of the outer system from its elements' parts, both precisions.
 * reads slice, slot, out (gathered), f; writes r, narrow
 * moves 4 P + 6 real E + 2 real R + 4 R bytes, 6 E + R flops
 * shape blocks of R */
KERNEL rows_outer_residual(int n, global const int *restrict slice, global const int *restrict slot,
                           GATHERED real *restrict out, global const real *restrict f,
                           global real *r, global float *narrow, volatile global int *shares,
                           int4 launch)
{
    FOR_BLOCKS(b, n, shares, launch)
    {
        const realv a = row_sum(slice, slot, out, b, launch);
        const realv d = LOAD(f, AT(b)) - a;
        STORE(d, r, AT(b));
        STORE(TO_FLOAT(d), narrow, AT(b));
    }
}

/* dy = D (L + g.w / (area s)) = D L + sqrt(D / (mu area s)) sqrt(c) g.w, D the local_step, times relax, kept in
 * [-1, 1]; mu <- max(mu exp(dy), lowest sqrt(area)). gx: sqrt(c) g.w or, if `whole`, of u with w, of which
 * sqrt(c) area q were there before. Then the sums of element_energy of x, the element's u, which has w; returns
 * area |change of mu|. */
static sumv update_block(int b, int whole, float alpha, float D, float bend, float relax,
                         float lowest, realv gx, six x, global const real *cot, realv a,
                         global real *mu, global real *g, global real *q, measures *sum)
{
    const realv e = (real)alpha * (real)alpha * LOAD(q, AT(b)), old = LOAD(mu, AT(b));
    const realv s = fmax(e, (realv)0.25f), slope = log_slope(e), step = local_step(D, bend, slope);
    const realv ratio = sqrt(step / (fmax(old, (realv)1e-30f) * a * s));
    const realv along = whole ? ratio * gx - step * e / s : ratio * gx;
    const realv next = grown(old, (real)relax * (step * slope + along), a, lowest);
    STORE(next, mu, AT(b));
    measure_block(b, DMK_KEEP_Q | DMK_KEEP_G, 0, x, cot, a, next, g, q, sum);
    return TO_SUM(a * fabs(next - old));
}

/* mu of the next step, update_block, and of it and u the sums of element_energy, that of area |change of mu|, and the
 * maximum.
 * reads index, cot, area, rank_one, w and u (gathered), mu, q; writes mu, g, q, scalars
 * moves 48 E + 14 real E + real R + 4 R bytes, 100 E flops
 * shape blocks of E; numerics g.w in single precision by differences to m0; the sums in sum_t */
KERNEL newton_update(int n, float alpha, float D, float bend, float relax, float lowest,
                     global const int *restrict index, global const real *restrict cot,
                     global const real *restrict area,
                     global const float *restrict rank_one, GATHERED float *restrict w,
                     GATHERED real *restrict u, global real *restrict mu, global real *restrict g,
                     global real *restrict q, volatile global sum_t *partial, int at,
                     global sum_t *restrict scalars, volatile global int *done,
                     volatile global int *shares, int4 launch)
{
    local group_memory group;
    const sums s = {partial, scalars, done, &group, at, launch.s3};
    FOR_PARTS(part, shares, launch)
    {
        sumv change = 0;
        measures sum = {0, 0, 0, 0, 0};
        FOR_PART_BLOCKS(b, n, part)
        {
            const six_rows i = load_rows(index, b);
            const floatv w0 = (floatv)(GATHER(w, i.v0)), w1 = (floatv)(GATHER(w, i.v1)),
                         w2 = (floatv)(GATHER(w, i.v2)), w3 = (floatv)(GATHER(w, i.m0)),
                         w4 = (floatv)(GATHER(w, i.m1)), w5 = (floatv)(GATHER(w, i.m2));
            const floatv gw = LOAD(rank_one, AT_K(b, 0, 6)) * (w0 - w3) +
                              LOAD(rank_one, AT_K(b, 1, 6)) * (w1 - w3) +
                              LOAD(rank_one, AT_K(b, 2, 6)) * (w2 - w3) +
                              LOAD(rank_one, AT_K(b, 4, 6)) * (w4 - w3) +
                              LOAD(rank_one, AT_K(b, 5, 6)) * (w5 - w3);
            change += update_block(b, 0, alpha, D, bend, relax, lowest, TO_REAL(gw),
                                   gather_six(u, i), cot, LOAD(area, AT(b)), mu, g, q, &sum);
        }
        leave_update(s, part, sum, change);
    }
}

/* The same from u alone, in the outer precision.
 * reads index, cot, area, rank_one, u (gathered), mu, q; writes mu, g, q, scalars
 * moves 24 E + 20 real E + real R bytes, 105 E flops
 * shape blocks of E; numerics g.u by differences to m0; the sums in sum_t */
KERNEL newton_update_wide(int n, float alpha, float D, float bend, float relax, float lowest,
                          global const int *restrict index, global const real *restrict cot,
                          global const real *restrict area, global const real *restrict rank_one,
                          GATHERED real *restrict u, global real *restrict mu,
                          global real *restrict g, global real *restrict q,
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
            const six x = gather_six(u, load_rows(index, b));
            change += update_block(b, 1, alpha, D, bend, relax, lowest,
                                   dot_six(load_six(rank_one, b), x), x, cot, LOAD(area, AT(b)), mu,
                                   g, q, &sum);
        }
        leave_update(s, part, sum, change);
    }
}

/* The paper's explicit Euler step mu <- mu (1 + dt (sqrt(q) - 1)), or, with inertial != 0, a step in
 * y = log mu with inertia: y <- y + 1/2 log q + beta (y - y_before), where there is a step before, before > 0.
 * reads area, q, mu, before; writes mu, before, scalars
 * moves 6 real E bytes, 15 E flops
 * shape blocks of E; numerics the sums in sum_t, in the order of parts */
KERNEL explicit_update(int n, int inertial, float dt, float beta, float lowest,
                       global const real *restrict area, global const real *restrict q,
                       global real *restrict mu, global real *restrict before,
                       volatile global sum_t *partial, int at, global sum_t *restrict scalars,
                       volatile global int *done, volatile global int *shares, int4 launch)
{
    local group_memory group;
    const sums s = {partial, scalars, done, &group, at, launch.s3};
    FOR_PARTS(part, shares, launch)
    {
        sumv change = 0, mass = 0;
        FOR_PART_BLOCKS(b, n, part)
        {
            const realv a = LOAD(area, AT(b)), old = LOAD(mu, AT(b)),
                        slope = sqrt(LOAD(q, AT(b)));
            realv risen = old * (1 + (real)dt * (slope - 1));
            if (inertial) {
                const realv last = LOAD(before, AT(b)), ratio = last > 0 ? old / last : (realv)1;
                risen = old * slope * exp((real)beta * log(fmax(ratio, (realv)1e-30f)));
            }
            const realv next = old > 0 ? at_least(risen, (real)lowest * sqrt(a)) : risen;
            STORE(old, before, AT(b));
            STORE(next, mu, AT(b));
            change += TO_SUM(a * fabs(next - old));
            mass += TO_SUM(a * next);
        }
        leave_sum(s, 0, part, change);
        leave_sum(s, 1, part, mass);
        finish_sums(s, part, 2, 0);
    }
}

/* out = mu g: the elements' parts of A u (in place over g).
 * reads mu, g; writes g
 * moves 13 real E bytes, 6 E flops
 * shape blocks of E */
KERNEL element_scale(int n, global const real *restrict mu, global real *restrict g,
                     volatile global int *shares, int4 launch)
{
    FOR_BLOCKS(b, n, shares, launch)
    {
        store_six(scaled(LOAD(mu, AT(b)), load_six(g, b)), g, b);
    }
}
