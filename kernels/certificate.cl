/* Lower bounds of the cost: bands of levels, and the repair. */

#define ELEMENT_BASE(t, K) (DMK_WIDTH * (K) * ((t) / DMK_WIDTH) + (t) % DMK_WIDTH)

/* ---- bands ------------------------------------------------------------------------------------ */

/* For the band bound: slope_max[l] = the largest sqrt(q) of the elements that meet level band l, as the
 * bits of a float (ordered like integers as it is >= 0).
 * reads index, u (gathered), q, slope_max; writes slope_max
 * moves 24 E + real E + real R bytes, 16 E flops
 * shape rows, one an element; numerics single precision, raised by 1e-6 for its rounding; maxima do not
 * hang on the order */
KERNEL band_slopes(int n, int n_bands, float u_low, float inv_band,
                   global const int *restrict index, global const real *restrict u,
                   global const real *restrict q, volatile global int *slope_max,
                   volatile global int *shares, int4 launch)
{
    FOR_ROWS(t, n, shares, launch)
    {
        const int base = ELEMENT_BASE(t, 6);
        real low = u[index[base]], high = low;
        for (int k = 1; k < 6; k++) {
            const real x = u[index[base + DMK_WIDTH * k]];
            low = x < low ? x : low;
            high = x > high ? x : high;
        }
        const int first = clamp((int)(((float)low - u_low) * inv_band) - 1, 0, n_bands - 1);
        const int last = clamp((int)(((float)high - u_low) * inv_band) + 1, 0, n_bands - 1);
        const int bits = as_int((float)sqrt(q[t]) * (1 + 1e-6f));
        for (int l = first; l <= last; l++) {
            if (slope_max[l] < bits) atomic_max(&slope_max[l], bits);
        }
    }
}

/* v = phi(u), phi piecewise linear with knots phi[0..n_bands] at u_low + l / inv_band.
 * reads phi (gathered), u; writes v
 * moves 2 real R bytes, 6 R flops
 * shape rows */
KERNEL band_map(int n, int n_bands, float u_low, float inv_band, global const real *restrict phi,
                global const real *restrict u, global real *restrict v, volatile global int *shares,
                int4 launch)
{
    FOR_ROWS(i, n, shares, launch)
    {
        const real s = (u[i] - (real)u_low) * (real)inv_band;
        const int l = clamp((int)s, 0, n_bands - 1);
        v[i] = phi[l] + (s - (real)l) * (phi[l + 1] - phi[l]);
    }
}

/* ---- the repair of a potential ---------------------------------------------------------------- */

/* Values that break |grad u| <= 1 move, all others stay. The work goes over lists of elements and rows, the hot ones;
 * their order has no effect on the result. */

/* y = K x of one element and the result x.y, its energy. */
static real energy_of(const real *c, const real *x, real *y)
{
    const real h0 = (real)0.5 * c[0], h1 = (real)0.5 * c[1], h2 = (real)0.5 * c[2];
    const real f10 = h0 * (x[1] - x[3]), f20 = h0 * (x[2] - x[3]), f01 = h1 * (x[0] - x[4]),
               f21 = h1 * (x[2] - x[4]), f02 = h2 * (x[0] - x[5]), f12 = h2 * (x[1] - x[5]);
    const real fa = c[0] * (x[4] - x[5]), fb = c[1] * (x[5] - x[3]), fc = c[2] * (x[3] - x[4]);
    y[0] = f01 + f02;
    y[1] = f10 + f12;
    y[2] = f20 + f21;
    y[3] = (fc - fb) - (f10 + f20);
    y[4] = (fa - fc) - (f01 + f21);
    y[5] = (fb - fa) - (f02 + f12);
    real e = 0;
    EACH(k, 6) e += y[k] * (x[k] - x[3]);
    return e;
}

/* ring = 1 on the rows of elements with q above the limit, or that have moved their rows, or have one that still
 * moves.
 * reads index, q, mark, u and before (gathered); writes ring
 * moves 28 E + real E + 2 real R + 4 R bytes, 0 flops
 * shape rows, one an element; all write the same 1 */
KERNEL repair_mark(int n, float limit, global const int *restrict index,
                   global const real *restrict q, global const int *restrict mark, global const real *restrict u,
                   global const real *restrict before, global int *restrict ring,
                   volatile global int *shares, int4 launch)
{
    FOR_ROWS(t, n, shares, launch)
    {
        const int base = ELEMENT_BASE(t, 6);
        int hot = mark[t] != 0 || q[t] > (real)limit;
        for (int k = 0; k < 6 && !hot; k++) {
            const int i = index[base + DMK_WIDTH * k];
            hot = u[i] != before[i];
        }
        for (int k = 0; k < 6 && hot; k++) ring[index[base + DMK_WIDTH * k]] = 1;
    }
}

static int is_hot(global const int *index, global const int *ring, int base, int round)
{
    int hot = 0;
    for (int k = 0; k < 6; k++) {
        const int r = ring[index[base + DMK_WIDTH * k]];
        hot |= r > 0 && r <= round;
    }
    return hot;
}

/* The elements at rows of a ring up to `round` put their other rows into the next one.
 * reads index, ring (gathered); writes ring
 * moves 24 E + 8 R bytes, 0 flops
 * shape rows, one an element; a row of the next ring is as little of this one as no ring is */
KERNEL repair_grow(int n, int round, global const int *restrict index, global int *restrict ring,
                   volatile global int *shares, int4 launch)
{
    FOR_ROWS(t, n, shares, launch)
    {
        const int base = ELEMENT_BASE(t, 6);
        if (!is_hot(index, ring, base, round)) continue;
        for (int k = 0; k < 6; k++) {
            const int i = index[base + DMK_WIDTH * k];
            if (ring[i] == 0) ring[i] = round + 1;
        }
    }
}

/* The elements at rows up to `round`, appended to list; count[0]: their number.
 * reads index, ring (gathered); writes count, list
 * moves 24 E + 4 R bytes, 0 flops
 * shape rows, one an element */
KERNEL repair_list_elements(int n, int round, global const int *restrict index,
                            global const int *restrict ring, volatile global int *count,
                            global int *restrict list, volatile global int *shares, int4 launch)
{
    FOR_ROWS(t, n, shares, launch)
    {
        if (is_hot(index, ring, ELEMENT_BASE(t, 6), round)) list[atomic_inc(&count[0])] = t;
    }
}

/* The rows of any ring, appended to list; their rings are cleared.
 * reads ring; writes ring, count, list
 * moves 8 R bytes, 0 flops
 * shape rows */
KERNEL repair_list_rows(int n, global int *restrict ring, volatile global int *count,
                        global int *restrict list, volatile global int *shares, int4 launch)
{
    FOR_ROWS(i, n, shares, launch)
    {
        if (ring[i] == 0) continue;
        ring[i] = 0;
        list[atomic_inc(&count[1])] = i;
    }
}

/* Listed elements above the target move their six values towards their own feasible set {q <= target^2},
 * along the gradient in the metric of inv_diag^-1/2: out = the moves. broken[sweep] is not 0 if any is above 1;
 * once a sweep has none, later ones do nothing.
 * reads list, index, cot, area, inv_diag and u (gathered), mark, broken; writes out, mark, moved, broken
 * moves 80 N + 16 real N bytes, 50 to 900 N flops
 * shape rows, one a listed element; numerics at most 12 steps, to 1e-4 of the target */
KERNEL repair_elements(int n, int sweep, int stamp, float target, global const int *restrict list,
                       global const int *restrict index, global const real *restrict cot,
                       global const real *restrict area, global const float *restrict inv_diag,
                       global const real *restrict u, global real *restrict out,
                       global int *restrict mark, global int *restrict moved,
                       volatile global int *broken, volatile global int *shares, int4 launch)
{
    const real s = target, enough = s * s * (real)1.0002f;
    FOR_ROWS(i, n, shares, launch)
    {
        if (sweep > 0 && broken[sweep - 1] == 0) continue;
        const int t = list[i], base = ELEMENT_BASE(t, 6), base3 = ELEMENT_BASE(t, 3);
        real c[3], x[6], y[6], metric[6];
        EACH(k, 3) c[k] = cot[base3 + DMK_WIDTH * k];
        EACH(k, 6) x[k] = u[index[base + DMK_WIDTH * k]];
        real e = energy_of(c, x, y);
        if (e > area[t] && broken[sweep] == 0) atomic_inc(&broken[sweep]);
        if (!(e > s * s * area[t])) {
            if (mark[t] == 0) continue;
            EACH(k, 6) out[base + DMK_WIDTH * k] = 0;
            mark[t] = 0;
            continue;
        }
        EACH(k, 6) metric[k] = (real)sqrt(inv_diag[index[base + DMK_WIDTH * k]]);
        for (int step = 0; step < 12 && e > enough * area[t]; step++) {
            real bottom = 0;
            EACH(k, 6) bottom += y[k] * y[k] * metric[k];
            const real part = e / bottom * (1 - s / sqrt(e / area[t]));
            EACH(k, 6) x[k] -= part * y[k] * metric[k];
            e = energy_of(c, x, y);
        }
        mark[t] = 1;
        EACH(k, 6) {
            const int r = index[base + DMK_WIDTH * k];
            out[base + DMK_WIDTH * k] = u[r] - x[k];
            moved[r] = stamp;
        }
    }
}

/* Listed rows take the mean of the moves of the elements that moved them, with Nesterov's momentum.
 * reads list, slice, slot, out (gathered), moved, broken, u, before; writes u, before
 * moves 40 N + 10 real N bytes, 12 N flops
 * shape rows, the listed ones */
KERNEL repair_rows(int n, int sweep, int stamp, float momentum, global const int *restrict list,
                   global const int *restrict slice, global const int *restrict slot,
                   global const real *restrict out, global const int *restrict moved,
                   global const int *restrict broken, global real *restrict u,
                   global real *restrict before, volatile global int *shares, int4 launch)
{
    FOR_ROWS(l, n, shares, launch)
    {
        if (broken[sweep] == 0) continue;
        const int i = list[l];
        const real now = u[i], was = before[i];
        real next = now;
        if (moved[i] == stamp) {
            real sum = 0;
            int movers = 0;
            for (int j = slice[i / DMK_WIDTH]; j < slice[i / DMK_WIDTH + 1]; j++) {
                const real move = out[slot[DMK_WIDTH * j + i % DMK_WIDTH]];
                sum += move;
                movers += move != 0;
            }
            if (movers > 0) next -= sum / movers;
        } else if (now == was) {
            continue;
        }
        u[i] = next + (real)momentum * (next - was);
        before[i] = next;
    }
}

/* u = scale * from, and `before` the same.
 * reads from; writes u, before
 * moves 3 real R bytes, R flops
 * shape blocks of R */
KERNEL repair_start(int n, float scale, global const real *restrict from, global real *restrict u,
                    global real *restrict before, volatile global int *shares, int4 launch)
{
    FOR_BLOCKS(b, n, shares, launch)
    {
        const realv x = (real)scale * LOAD(from, AT(b));
        STORE(x, u, AT(b));
        STORE(x, before, AT(b));
    }
}
