/* The V-cycle, in single precision: transfers, smoothing on the graph levels, refresh of the coarse
 * operators. Level 0 is T/2 (operator.cl); level 1 is T, its links the mesh's edges; deeper levels
 * are graphs. A graph operator is y_i = sum_j w_ij (x_i - x_j): zero row sums also in rounding.
 * Rows lie in slices of 8: columns slice[s]..slice[s+1] hold neighbours (short rows: the row itself
 * with weight 0) and the numbers of their links. */
#if !DMK_DOUBLE

/* x = step D^-1 b: the first Chebyshev step from 0. */
KERNEL smooth_first(int n, float step, global const float *inv_diag, global const float *rhs,
                    global float *x LAUNCH)
{
    FOR_BLOCKS(b, n) { STORE(step * LOAD(inv_diag, AT(b)) * LOAD(rhs, AT(b)), x, AT(b)); }
}

/* The place among 3 numbers per element of what has place p among 6: corner k, or side k at 3 + k. */
#define CORNER_PLACE(p) ((p) - 3 * DMK_WIDTH * ((p) / (6 * DMK_WIDTH)))
#define SIDE_PLACE(p) (CORNER_PLACE(p) - 3 * DMK_WIDTH)

/* First phase of A x (M x with newton != 0) where only the restriction to T of its result is wanted: each
 * element's parts, those of the midpoints half to each end, 3 per element.
 * moves 36 E + 24 E + 4 R + 12 E bytes, 65 E flops; 24 E of them with newton */
KERNEL element_down(int n, int newton, global const int *index, global const float *weight,
                    global const float *g, GATHERED float *x, global float *out LAUNCH)
{
    FOR_BLOCKS(b, n)
    {
        X6(x, index, b)
        const floatv w0 = LOAD(weight, AT_K(b, 0, 3)), w1 = LOAD(weight, AT_K(b, 1, 3)),
                     w2 = LOAD(weight, AT_K(b, 2, 3));
        STIFFNESS(w0, w1, w2)
        if (newton) RANK_ONE(g, b)
        STORE(y0 + 0.5f * (y4 + y5), out, AT_K(b, 0, 3));
        STORE(y1 + 0.5f * (y3 + y5), out, AT_K(b, 1, 3));
        STORE(y2 + 0.5f * (y3 + y4), out, AT_K(b, 2, 3));
    }
}

/* First phase of A (x + P c), c on T: a vertex takes its own value, a midpoint the mean of its edge's ends.
 * moves 36 E + 24 E + 4 R + 4 V + 24 E bytes, 71 E flops; 24 E of them with newton */
KERNEL element_up(int n, int newton, int vertex_row, global const int *index,
                  global const float *weight, global const float *g, GATHERED float *x,
                  GATHERED float *coarse, global float *out LAUNCH)
{
    FOR_BLOCKS(b, n)
    {
        X6(x, index, b)
        const intv j0 = i0 - vertex_row, j1 = i1 - vertex_row, j2 = i2 - vertex_row;
        const floatv c0 = (floatv)(GATHER(coarse, j0)), c1 = (floatv)(GATHER(coarse, j1)),
                     c2 = (floatv)(GATHER(coarse, j2));
        v0 += c0;
        v1 += c1;
        v2 += c2;
        m0 += 0.5f * (c1 + c2);
        m1 += 0.5f * (c0 + c2);
        m2 += 0.5f * (c0 + c1);
        const floatv w0 = LOAD(weight, AT_K(b, 0, 3)), w1 = LOAD(weight, AT_K(b, 1, 3)),
                     w2 = LOAD(weight, AT_K(b, 2, 3));
        STIFFNESS(w0, w1, w2)
        if (newton) RANK_ONE(g, b)
        STORE6(out, b)
    }
}

/* Second phase: x += P c (ends: a row's two vertices), and x_old = x + step D^-1 (b - A x).
 * moves 4 P + 24 E + 8 R + 4 V + 20 R bytes, 6 E + 6 R flops */
KERNEL rows_up(int n, global const int *slice, global const int *slot, GATHERED float *out,
               global const float *rhs, global const float *inv_diag, global const int *ends,
               GATHERED float *coarse, global float *x, global float *x_old, float step LAUNCH)
{
    FOR_BLOCKS(b, n)
    {
        ROW_SUM(a, b)
        const intv i = LOAD(ends, AT_K(b, 0, 2)), j = LOAD(ends, AT_K(b, 1, 2));
        const floatv now =
            LOAD(x, AT(b)) + 0.5f * ((floatv)(GATHER(coarse, i)) + (floatv)(GATHER(coarse, j)));
        STORE(now, x, AT(b));
        STORE(now + step * LOAD(inv_diag, AT(b)) * (LOAD(rhs, AT(b)) - a), x_old, AT(b));
    }
}

/* rows_chebyshev (operator.cl) at the end of a cycle, and with its result z the sums r.z and Ap.z of
 * conjugate gradients, r = rhs, and beta of them. */
KERNEL rows_chebyshev_dots(int n, int first, global const int *slice, global const int *slot,
                           GATHERED float *out, global const float *rhs, global const float *inv_diag,
                           global const float *x, global float *x_old, float momentum, float keep,
                           float step, global const float *ap, SUM_ARGS LAUNCH)
{
    SCRATCH
    FOR_PARTS
    {
        sumv rz = 0, apz = 0;
        FOR_PART_BLOCKS(b, n)
        {
            ROW_SUM(a, b)
            const floatv r = LOAD(rhs, AT(b)), now = LOAD(x, AT(b));
            const floatv next = now + momentum * (now - keep * LOAD(x_old, AT(b))) +
                                step * LOAD(inv_diag, AT(b)) * (r - a);
            STORE(next, x_old, AT(b));
            rz += TO_SUM(r) * TO_SUM(next);
            apz += TO_SUM(LOAD(ap, AT(b))) * TO_SUM(next);
        }
        REDUCE(partial, 0, rz);
        REDUCE(partial, 1, apz);
        const int when = LAST_PART;
        CG_BETA(PARTS)
    }
}

/* Restriction of a residual from T/2 to T, b = P'(rhs - A x), and the first smoothing step there. link:
 * the midpoints of v's edges; down: the elements' parts of P'A x, found by the rows' places, first: slice of
 * vertex 0 among the rows. */
KERNEL restrict_midpoints(int n, int vertex_row, global const int *slice, global const int *link,
                          GATHERED float *fine, int first, global const int *corner_slice,
                          global const int *corner, GATHERED float *down, float step,
                          global const float *inv_diag, global float *rhs, global float *x LAUNCH)
{
    global const float *at_vertex = (global const float *)(fine + vertex_row);
    FOR_BLOCKS(b, n)
    {
        floatv sum = 0, ax = 0;
        for (int j = slice[SLICE(b)], e = slice[SLICE(b) + 1]; j < e; j++) {
            const intv i = LOAD(link, COLUMN(b, j));
            sum += (floatv)(GATHER(fine, i));
        }
        for (int j = corner_slice[first + SLICE(b)], e = corner_slice[first + SLICE(b) + 1]; j < e; j++) {
            const intv p = LOAD(corner, COLUMN(b, j));
            const intv i = CORNER_PLACE(p);
            ax += (floatv)(GATHER(down, i));
        }
        sum = LOAD(at_vertex, AT(b)) + 0.5f * sum - ax;
        STORE(sum, rhs, AT(b));
        STORE(step * LOAD(inv_diag, AT(b)) * sum, x, AT(b));
    }
}

/* ---- graph levels: the work on a block of rows, for launches over a level and for the tail ---- */

#define GRAPH const global int *slice, const global int *neighbour, const global float *weight

static floatv graph_sum(int b, GRAPH, const global float *x, floatv now)
{
    GATHERED float *x_read = x;
    floatv y = 0;
    for (int j = slice[SLICE(b)], e = slice[SLICE(b) + 1]; j < e; j++) {
        const intv i = LOAD(neighbour, COLUMN(b, j));
        y += LOAD(weight, COLUMN(b, j)) * (now - (floatv)(GATHER(x_read, i)));
    }
    return y;
}

static void residual_block(int b, GRAPH, const global float *x, const global float *rhs, global float *r)
{
    const floatv now = LOAD(x, AT(b)), a = graph_sum(b, slice, neighbour, weight, x, now);
    STORE(LOAD(rhs, AT(b)) - a, r, AT(b));
}

static void chebyshev_block(int b, GRAPH, const global float *rhs, const global float *inv_diag,
                            const global float *x, global float *x_old, float momentum, float keep,
                            float step)
{
    const floatv now = LOAD(x, AT(b)), a = graph_sum(b, slice, neighbour, weight, x, now);
    STORE(now + momentum * (now - keep * LOAD(x_old, AT(b))) +
              step * LOAD(inv_diag, AT(b)) * (LOAD(rhs, AT(b)) - a),
          x_old, AT(b));
}

/* Restriction with general weights (the transposed prolongation), and the first smoothing step. */
static void restrict_block(int b, const global int *slice, const global int *fine,
                           const global float *weight, GATHERED float *r, float step,
                           const global float *inv_diag, global float *rhs, global float *x)
{
    floatv sum = 0;
    for (int j = slice[SLICE(b)], e = slice[SLICE(b) + 1]; j < e; j++) {
        const intv i = LOAD(fine, COLUMN(b, j));
        sum += LOAD(weight, COLUMN(b, j)) * (floatv)(GATHER(r, i));
    }
    STORE(sum, rhs, AT(b));
    STORE(step * LOAD(inv_diag, AT(b)) * sum, x, AT(b));
}

static void prolong_block(int b, const global int *index, const global float *weight,
                          GATHERED float *coarse, global float *x)
{
    const intv i = LOAD(index, AT_K(b, 0, 3)), j = LOAD(index, AT_K(b, 1, 3)),
               k = LOAD(index, AT_K(b, 2, 3));
    STORE(LOAD(x, AT(b)) + LOAD(weight, AT_K(b, 0, 3)) * (floatv)(GATHER(coarse, i)) +
              LOAD(weight, AT_K(b, 1, 3)) * (floatv)(GATHER(coarse, j)) +
              LOAD(weight, AT_K(b, 2, 3)) * (floatv)(GATHER(coarse, k)),
          x, AT(b));
}

/* Coarsest level: x = inverse * b, the symmetric pseudo-inverse stored by columns of n_pad. */
static void coarse_block(int b, int n, int n_pad, const global float *inverse, const global float *rhs,
                         global float *x)
{
    floatv sum = 0;
    for (int j = 0; j < n; j++) sum += LOAD(inverse, j * n_pad + AT(b)) * rhs[j];
    STORE(sum, x, AT(b));
}

/* moves 8 L + 12 V bytes, 3 L + V flops */
KERNEL graph_residual(int n, GRAPH, global const float *x, global const float *rhs,
                      global float *r LAUNCH)
{
    FOR_BLOCKS(b, n) { residual_block(b, slice, neighbour, weight, x, rhs, r); }
}

/* moves 8 L + 20 V bytes, 3 L + 7 V flops */
KERNEL graph_chebyshev(int n, GRAPH, global const float *rhs, global const float *inv_diag,
                       global const float *x, global float *x_old, float momentum, float keep,
                       float step LAUNCH)
{
    FOR_BLOCKS(b, n)
    {
        chebyshev_block(b, slice, neighbour, weight, rhs, inv_diag, x, x_old, momentum, keep, step);
    }
}

KERNEL restrict_rows(int n, global const int *slice, global const int *fine,
                     global const float *weight, GATHERED float *r, float step,
                     global const float *inv_diag, global float *rhs, global float *x LAUNCH)
{
    FOR_BLOCKS(b, n) { restrict_block(b, slice, fine, weight, r, step, inv_diag, rhs, x); }
}

KERNEL prolong_rows(int n, global const int *index, global const float *weight,
                    GATHERED float *coarse, global float *x LAUNCH)
{
    FOR_BLOCKS(b, n) { prolong_block(b, index, weight, coarse, x); }
}

KERNEL coarse_solve(int n, int n_pad, global const float *inverse, global const float *rhs,
                    global float *x LAUNCH)
{
    FOR_BLOCKS(b, n_pad) { coarse_block(b, n, n_pad, inverse, rhs, x); }
}

/* ---- the tail: the coarsest levels in one launch of one work-group ---- */

/* Arrays of level l (dmk_shared.h). */
#define TAIL(l, what) table[(l) * DMK_TAIL_FIELDS + DMK_TAIL_##what]
#define TAIL_INTS(l, what) (arena + TAIL(l, what))
#define TAIL_NUMBERS(l, what) ((global float *)(arena + TAIL(l, what)))
#define TAIL_GRAPH(l) TAIL_INTS(l, SLICE), TAIL_INTS(l, NEIGHBOUR), TAIL_NUMBERS(l, WEIGHT)

/* x_to <- Chebyshev step from x_from. */
static void tail_chebyshev(int l, global const int *table, global int *arena, global const float *from,
                           global float *to, float momentum, float keep, float step)
{
    FOR_ALL_BLOCKS(b, TAIL(l, ROWS))
    {
        chebyshev_block(b, TAIL_GRAPH(l), TAIL_NUMBERS(l, RHS), TAIL_NUMBERS(l, INV_DIAG), from, to,
                        momentum, keep, step);
    }
    TOGETHER
}

static void tail_residual(int l, global const int *table, global int *arena)
{
    FOR_ALL_BLOCKS(b, TAIL(l, ROWS))
    {
        residual_block(b, TAIL_GRAPH(l), TAIL_NUMBERS(l, X_OLD), TAIL_NUMBERS(l, RHS),
                       TAIL_NUMBERS(l, X));
    }
    TOGETHER
}

/* n: its rows, or 0 where that has been done. */
static void tail_restrict(int l, int n, global const int *table, global int *arena, GATHERED float *r,
                          float step)
{
    FOR_ALL_BLOCKS(b, n)
    {
        restrict_block(b, TAIL_INTS(l, RESTRICT_SLICE), TAIL_INTS(l, RESTRICT_ENTRY),
                       TAIL_NUMBERS(l, RESTRICT_WEIGHT), r, step, TAIL_NUMBERS(l, INV_DIAG),
                       TAIL_NUMBERS(l, RHS), TAIL_NUMBERS(l, X));
    }
    TOGETHER
}

static void tail_prolong(int l, global const int *table, global int *arena)
{
    FOR_ALL_BLOCKS(b, TAIL(l - 1, ROWS))
    {
        prolong_block(b, TAIL_INTS(l, PROLONG_INDEX), TAIL_NUMBERS(l, PROLONG_WEIGHT),
                      TAIL_NUMBERS(l, X_OLD), TAIL_NUMBERS(l - 1, X_OLD));
    }
    TOGETHER
}

/* The V-cycle on the tail's levels: x_old of the first from its rhs or, where `above` counts, from the
 * residual r of the level above; steps as in multigrid.c. */
KERNEL tail_cycle(int levels, int above, global const int *table, global int *arena, GATHERED float *r,
                  global const float *inverse, float first, float momentum, float step LAUNCH)
{
    const int last = levels - 1;
    tail_restrict(0, above ? TAIL(0, ROWS) : 0, table, arena, r, first);
    for (int l = 0; l < last; l++) {
        tail_chebyshev(l, table, arena, TAIL_NUMBERS(l, X), TAIL_NUMBERS(l, X_OLD), momentum, 0, step);
        tail_residual(l, table, arena);
        tail_restrict(l + 1, TAIL(l + 1, ROWS), table, arena, TAIL_NUMBERS(l, X), first);
    }
    FOR_ALL_BLOCKS(b, TAIL(last, PAD))
    {
        coarse_block(b, TAIL(last, ROWS), TAIL(last, PAD), inverse, TAIL_NUMBERS(last, RHS),
                     TAIL_NUMBERS(last, X_OLD));
    }
    TOGETHER
    for (int l = last - 1; l >= 0; l--) {
        tail_prolong(l + 1, table, arena);
        tail_chebyshev(l, table, arena, TAIL_NUMBERS(l, X_OLD), TAIL_NUMBERS(l, X), 0, 1, first);
        tail_chebyshev(l, table, arena, TAIL_NUMBERS(l, X), TAIL_NUMBERS(l, X_OLD), momentum, 1, step);
    }
}

/* The inverse for coarse_solve, by one work-group: the pseudo-inverse (L + c J)^-1 - J / (c n^2) of the
 * coarsest graph's Laplacian L, J all ones, c of the size of its diagonal; Gauss-Jordan steps in place, for
 * L + c J is positive definite. a: n rows of n numbers. n is at most DMK_DENSE. n^3 multiplications. */
static void dense_laplacian(int n, global const int *slice, global const int *neighbour,
                            global const float *weight, global sum_t *a)
{
    FOR_ITEMS(i, n)
    {
        sum_t diag = 0;
        for (int j = 0; j < n; j++) a[i * n + j] = 0;
        for (int j = slice[i / DMK_WIDTH]; j < slice[i / DMK_WIDTH + 1]; j++) {
            const int k = DMK_WIDTH * j + i % DMK_WIDTH;
            a[i * n + neighbour[k]] -= weight[k];
            diag += weight[k];
        }
        a[i * n + i] += diag; /* short rows name the row itself, with weight 0 */
    }
}

KERNEL coarse_inverse(int n, int n_pad, GRAPH, global sum_t *a, global float *inverse LAUNCH)
{
    local sum_t row[DMK_DENSE], column[DMK_DENSE], least[DMK_DENSE];
    sum_t shift = 0;
    dense_laplacian(n, slice, neighbour, weight, a);
    TOGETHER
    for (int i = 0; i < n; i++) shift += a[i * n + i];
    shift /= (sum_t)n * n;
    if (!(shift > 0)) shift = 1;
    TOGETHER
    FOR_ITEMS(i, n)
    {
        for (int j = 0; j < n; j++) a[i * n + j] += shift;
        least[i] = 1e-12f * a[i * n + i]; /* rounding of the links may leave a pivot at 0: it is left out */
    }
    for (int k = 0; k < n; k++) {
        TOGETHER
        const sum_t pivot = a[k * n + k] > least[k] ? 1 / a[k * n + k] : 0;
        FOR_ITEMS(i, n)
        {
            row[i] = i == k ? pivot : a[k * n + i] * pivot;
            column[i] = i == k ? 0 : a[i * n + k];
        }
        TOGETHER
        FOR_ITEMS(i, n)
        {
            const sum_t c = column[i];
            for (int j = 0; j < n && i != k; j++) a[i * n + j] = (j == k ? 0 : a[i * n + j]) - c * row[j];
            for (int j = 0; j < n && i == k; j++) a[i * n + j] = row[j];
        }
    }
    TOGETHER
    FOR_ITEMS(i, n)
    {
        for (int j = 0; j < n; j++) {
            inverse[i * n_pad + j] = (float)(a[max(i, j) * n + min(i, j)] - 1 / (shift * n * n));
        }
    }
}

/* ---- refresh --------------------------------------------------------------------------------- */

/* Level 1: an edge's link weight is the sum over its two triangles. slot: the midpoints' two places among
 * the elements' parts; a border edge's second one is of an element whose numbers stay 0. */
KERNEL links_from_triangles(int n, global const int *slot, GATHERED float *triangle_link,
                            global float *link LAUNCH)
{
    FOR_BLOCKS(b, n)
    {
        const intv p = LOAD(slot, AT_K(b, 0, 2)), q = LOAD(slot, AT_K(b, 1, 2));
        const intv i = SIDE_PLACE(p), j = SIDE_PLACE(q);
        STORE((floatv)(GATHER(triangle_link, i)) + (floatv)(GATHER(triangle_link, j)), link, AT(b));
    }
}

/* Deeper levels: w_coarse = R w_fine, the Galerkin product as a mesh-only table. */
static float link_sum(int i, global const int *row, global const int *fine, global const half *coef,
                      global const float *fine_link)
{
    float sum = 0;
    for (int j = row[i]; j < row[i + 1]; j++) sum += vload_half((size_t)j, coef) * fine_link[fine[j]];
    return sum;
}

KERNEL links_from_links(int n, global const int *row, global const int *fine,
                        global const half *coef, global const float *fine_link,
                        global float *link LAUNCH)
{
    FOR_ROWS(i, n) { link[i] = link_sum(i, row, fine, coef, fine_link); }
}

/* Copy link weights to rows; D = a_ii + sum |a_ij| bounds A by 1 (row sums of magnitudes), so the
 * smoother needs no eigenvalue estimate. number: links by row, a short row's filler has weight 0. */
static floatv weights_block(int b, global const int *slice, global const int *number, GATHERED float *link,
                            global float *weight)
{
    floatv diag = 0, size = 0;
    for (int j = slice[SLICE(b)], e = slice[SLICE(b) + 1]; j < e; j++) {
        const intv i = LOAD(number, COLUMN(b, j));
        const floatv w = (floatv)(GATHER(link, i));
        STORE(w, weight, COLUMN(b, j));
        diag += w;
        size += fabs(w);
    }
    return size + fabs(diag);
}

static floatv inverse_of(floatv size)
{
    return size > 0 ? 1 / size : 0 * size;
}

KERNEL graph_weights(int n, global const int *slice, global const int *number, GATHERED float *link,
                     global float *weight, global float *inv_diag LAUNCH)
{
    FOR_BLOCKS(b, n)
    {
        STORE(inverse_of(weights_block(b, slice, number, link, weight)), inv_diag, AT(b));
    }
}

/* The same on T, where the elements' bound is sharper than the rows': the inverse diagonal is from theirs,
 * 3 per element. first: slice of vertex 0 among the rows. */
KERNEL mesh_weights(int n, global const int *slice, global const int *number, GATHERED float *link,
                    global float *weight, int first, global const int *corner_slice,
                    global const int *corner, GATHERED float *diag, global float *inv_diag LAUNCH)
{
    FOR_BLOCKS(b, n)
    {
        floatv sum = 0;
        weights_block(b, slice, number, link, weight);
        for (int j = corner_slice[first + SLICE(b)], e = corner_slice[first + SLICE(b) + 1]; j < e; j++) {
            const intv p = LOAD(corner, COLUMN(b, j));
            const intv i = CORNER_PLACE(p);
            sum += (floatv)(GATHER(diag, i));
        }
        STORE(inverse_of(sum), inv_diag, AT(b));
    }
}

/* 1 / (sum of the elements' weighted diagonals): see element_prepare. */
KERNEL inverse_diagonal(int n, global const int *slice, global const int *slot, GATHERED float *out,
                        global float *inv_diag LAUNCH)
{
    FOR_BLOCKS(b, n)
    {
        floatv sum = 0;
        for (int j = slice[SLICE(b)], e = slice[SLICE(b) + 1]; j < e; j++) {
            const intv s = LOAD(slot, COLUMN(b, j));
            sum += (floatv)(GATHER(out, s));
        }
        STORE(inverse_of(sum), inv_diag, AT(b));
    }
}

/* Weights of the tail's levels, and the links of all but the first. */
KERNEL tail_refresh(int levels, global const int *table, global int *arena LAUNCH)
{
    for (int l = 0; l < levels; l++) {
        const int n = l > 0 ? TAIL(l, LINKS) : 0, above = l > 0 ? l - 1 : 0;
        global const half *coef = (global const half *)TAIL_INTS(l, GALERKIN_COEF);
        global float *link = TAIL_NUMBERS(l, LINK);
        FOR_ITEMS(i, n)
        {
            link[i] = link_sum(i, TAIL_INTS(l, GALERKIN_ROW), TAIL_INTS(l, GALERKIN_LINK), coef,
                               TAIL_NUMBERS(above, LINK));
        }
        TOGETHER
        FOR_ALL_BLOCKS(b, TAIL(l, ROWS))
        {
            const floatv size = weights_block(b, TAIL_INTS(l, SLICE), TAIL_INTS(l, NUMBER),
                                              TAIL_NUMBERS(l, LINK), TAIL_NUMBERS(l, WEIGHT));
            STORE(inverse_of(size), TAIL_NUMBERS(l, INV_DIAG), AT(b));
        }
        TOGETHER
    }
}
#endif
