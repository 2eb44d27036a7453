/* The V-cycle, in single precision: transfers, smoothing on the graph levels, refresh of the coarse
 * operators. Finest is T/2 (operator.cl), which has no number; level 0 is T, its edges the mesh's edges; deeper
 * levels are graphs. A graph operator is y_i = sum_j w_ij (x_i - x_j): zero row sums also in rounding.
 * Rows lie in slices of 8: columns slice[s]..slice[s+1] hold neighbours (short rows: the row itself
 * with weight 0) and the numbers of their edges. */

/* The slot among 3 numbers per element of what has slot p among 6: corner k, or side k at 3 + k. */
#define CORNER_PLACE(p) ((p) - 3 * DMK_WIDTH * ((p) / (6 * DMK_WIDTH)))
#define SIDE_PLACE(p) (CORNER_PLACE(p) - 3 * DMK_WIDTH)

#if !DMK_DOUBLE

/* The sums of the elements' numbers at their corners, at vertices of block b; first: the slice of vertex 0. */
static floatv corner_sum(int b, int first, global const int *slice, global const int *corner, GATHERED float *x)
{
    floatv sum = 0;
    for (int j = slice[first + SLICE(b)], end = slice[first + SLICE(b) + 1]; j < end; j++) {
        const intv p = LOAD(corner, COLUMN(b, j));
        const intv i = CORNER_PLACE(p);
        sum += (floatv)(GATHER(x, i));
    }
    return sum;
}

/* x = step D^-1 b: the first Chebyshev step from 0.
 * reads inv_diag, rhs; writes x
 * moves 12 R bytes, 2 R flops
 * shape blocks of R */
KERNEL smooth_first(int n, float step, global const float *restrict inv_diag,
                    global const float *restrict rhs, global float *restrict x,
                    volatile global int *shares, int4 launch)
{
    FOR_BLOCKS(b, n, shares, launch)
    {
        STORE(step * LOAD(inv_diag, AT(b)) * LOAD(rhs, AT(b)), x, AT(b));
    }
}

/* First phase of A x (M x with newton != 0) where only the restriction to T of its result is wanted: each
 * element's parts, those of the midpoints half to each end, 3 per element.
 * reads index, weight, g, x (gathered); writes out
 * moves 36 E + 24 E + 4 R + 12 E bytes, 65 E flops; 24 E of them with newton
 * shape blocks of E */
KERNEL element_down(int n, int newton, global const int *restrict index,
                    global const float *restrict weight, global const float *restrict g,
                    GATHERED float *restrict x, global float *restrict out,
                    volatile global int *shares, int4 launch)
{
    FOR_BLOCKS(b, n, shares, launch)
    {
        const six at = gather_six(x, load_rows(index, b));
        six y = stiffness(load_three(weight, b), at);
        if (newton) y = add_rank_one(y, load_six(g, b), at);
        STORE(y.v0 + 0.5f * (y.m1 + y.m2), out, AT_K(b, 0, 3));
        STORE(y.v1 + 0.5f * (y.m0 + y.m2), out, AT_K(b, 1, 3));
        STORE(y.v2 + 0.5f * (y.m0 + y.m1), out, AT_K(b, 2, 3));
    }
}

/* First phase of A (x + P c), c on T: a vertex takes its own value, a midpoint the mean of its edge's ends.
 * reads index, weight, g, x and coarse (gathered); writes out
 * moves 36 E + 24 E + 4 R + 4 V + 24 E bytes, 71 E flops; 24 E of them with newton
 * shape blocks of E */
KERNEL element_up(int n, int newton, int vertex_row, global const int *restrict index,
                  global const float *restrict weight, global const float *restrict g,
                  GATHERED float *restrict x, GATHERED float *restrict coarse,
                  global float *restrict out, volatile global int *shares, int4 launch)
{
    FOR_BLOCKS(b, n, shares, launch)
    {
        const six_rows i = load_rows(index, b);
        const intv j0 = i.v0 - vertex_row, j1 = i.v1 - vertex_row, j2 = i.v2 - vertex_row;
        const floatv c0 = (floatv)(GATHER(coarse, j0)), c1 = (floatv)(GATHER(coarse, j1)),
                     c2 = (floatv)(GATHER(coarse, j2));
        six at = gather_six(x, i);
        at.v0 += c0;
        at.v1 += c1;
        at.v2 += c2;
        at.m0 += 0.5f * (c1 + c2);
        at.m1 += 0.5f * (c0 + c2);
        at.m2 += 0.5f * (c0 + c1);
        six y = stiffness(load_three(weight, b), at);
        if (newton) y = add_rank_one(y, load_six(g, b), at);
        store_six(y, out, b);
    }
}

/* x + P c in block b of the rows: a vertex takes its own value, a midpoint the mean of its ends'. */
static floatv prolonged(int b, int vertex_row, global const int *ends, global const float *coarse,
                        global const float *x)
{
    GATHERED float *at_end = coarse;
    const floatv now = LOAD(x, AT(b));
    if (AT(b) >= vertex_row) return now + LOAD(coarse, AT(b) - vertex_row);
    const intv i = LOAD(ends, AT_K(b, 0, 2)), j = LOAD(ends, AT_K(b, 1, 2));
    return now + 0.5f * ((floatv)(GATHER(at_end, i)) + (floatv)(GATHER(at_end, j)));
}

/* Second phase: x += P c (ends: a midpoint's two vertices), and x_old = x + step D^-1 (b - A x). keep: x is
 * stored, too, as another step needs it.
 * reads slice, slot, out and coarse (gathered), rhs, inv_diag, ends, x; writes x, x_old
 * moves 4 P + 24 E + 8 R + 4 V + 20 R bytes, 6 E + 6 R flops
 * shape blocks of R */
KERNEL rows_up(int n, int keep, int vertex_row, global const int *restrict slice,
               global const int *restrict slot, GATHERED float *restrict out,
               global const float *restrict rhs, global const float *restrict inv_diag,
               global const int *restrict ends, global const float *restrict coarse,
               global float *restrict x, global float *restrict x_old, float step,
               volatile global int *shares, int4 launch)
{
    FOR_BLOCKS(b, n, shares, launch)
    {
        const floatv now = prolonged(b, vertex_row, ends, coarse, x);
        const realv a = row_sum(slice, slot, out, b, launch);
        if (keep) STORE(now, x, AT(b));
        STORE(now + step * LOAD(inv_diag, AT(b)) * (LOAD(rhs, AT(b)) - a), x_old, AT(b));
    }
}

/* Restriction of a residual from T/2 to T, b = P'(rhs - A x). edge: the midpoints of v's edges; down: the
 * elements' parts of P'A x, found by the rows' slots, first: slice of vertex 0 among the rows.
 * reads slice, edge, fine (gathered), corner_slice, corner, down (gathered); writes rhs
 * moves 4 L + 4 R + 24 E + 4 V bytes, L + 3 E + 2 V flops
 * shape blocks of V */
KERNEL restrict_midpoints(int n, int vertex_row, global const int *restrict slice,
                          global const int *restrict edge, GATHERED float *restrict fine, int first,
                          global const int *restrict corner_slice,
                          global const int *restrict corner, GATHERED float *restrict down,
                          global float *restrict rhs, volatile global int *shares, int4 launch)
{
    global const float *at_vertex = (global const float *)(fine + vertex_row);
    FOR_BLOCKS(b, n, shares, launch)
    {
        floatv sum = 0;
        for (int j = slice[SLICE(b)], e = slice[SLICE(b) + 1]; j < e; j++) {
            const intv i = LOAD(edge, COLUMN(b, j));
            sum += (floatv)(GATHER(fine, i));
        }
        const floatv ax = corner_sum(b, first, corner_slice, corner, down);
        STORE(LOAD(at_vertex, AT(b)) + 0.5f * sum - ax, rhs, AT(b));
    }
}

/* ---- graph levels: the work on a block of rows, for launches over a level and for the tail ---- */

/* The operator of a graph level. */
typedef struct graph {
    global const int *slice, *neighbour;
    global const float *weight;
} graph;

static floatv graph_sum(int b, graph g, global const float *x, floatv now)
{
    GATHERED float *x_read = x;
    floatv y = 0;
    for (int j = g.slice[SLICE(b)], e = g.slice[SLICE(b) + 1]; j < e; j++) {
        const intv i = LOAD(g.neighbour, COLUMN(b, j));
        y += LOAD(g.weight, COLUMN(b, j)) * (now - (floatv)(GATHER(x_read, i)));
    }
    return y;
}

static void chebyshev_block(int b, graph g, global const float *rhs, global const float *inv_diag,
                            global const float *x, global float *x_old, float momentum, float keep,
                            float step)
{
    const floatv now = LOAD(x, AT(b)), a = graph_sum(b, g, x, now);
    STORE(now + momentum * (now - keep * LOAD(x_old, AT(b))) +
              step * LOAD(inv_diag, AT(b)) * (LOAD(rhs, AT(b)) - a),
          x_old, AT(b));
}

/* Restriction with general weights (the transposed prolongation). */
static void restrict_block(int b, global const int *slice, global const int *fine,
                           global const float *weight, GATHERED float *r, global float *rhs)
{
    floatv sum = 0;
    for (int j = slice[SLICE(b)], e = slice[SLICE(b) + 1]; j < e; j++) {
        const intv i = LOAD(fine, COLUMN(b, j));
        sum += LOAD(weight, COLUMN(b, j)) * (floatv)(GATHER(r, i));
    }
    STORE(sum, rhs, AT(b));
}

/* The prolongation, and what it reads: three entries a row. */
typedef struct transfer {
    global const int *index;
    global const float *weight, *coarse;
} transfer;

static floatv prolonged_block(int b, transfer p)
{
    GATHERED float *coarse = p.coarse;
    floatv sum = 0;
    for (int k = 0; k < 3; k++) {
        const intv i = LOAD(p.index, AT_K(b, k, 3));
        sum += LOAD(p.weight, AT_K(b, k, 3)) * (floatv)(GATHER(coarse, i));
    }
    return sum;
}

/* The same in any rows. */
static floatv prolonged_rows(intv row, transfer p)
{
    GATHERED int *index = p.index;
    GATHERED float *weight = p.weight, *coarse = p.coarse;
    floatv sum = 0;
    for (int k = 0; k < 3; k++) {
        const intv at = row + 2 * DMK_WIDTH * (row / DMK_WIDTH) + DMK_WIDTH * k;
        const intv i = (intv)(GATHER(index, at));
        sum += (floatv)(GATHER(weight, at)) * (floatv)(GATHER(coarse, i));
    }
    return sum;
}

/* Coarsest level: x = inverse * b, the symmetric pseudo-inverse stored by columns of n_pad. */
static void coarse_block(int b, int n, int n_pad, global const float *inverse,
                         global const float *rhs, global float *x)
{
    floatv sum = 0;
    for (int j = 0; j < n; j++) sum += LOAD(inverse, j * n_pad + AT(b)) * rhs[j];
    STORE(sum, x, AT(b));
}

/* A Chebyshev step on a graph level, as rows_chebyshev.
 * reads slice, neighbour, weight, rhs, inv_diag, x (gathered), x_old; writes x_old
 * moves 8 L + 20 V bytes, 3 L + 7 V flops
 * shape blocks of V; numerics differences first, so that constants give 0 exactly */
KERNEL graph_chebyshev(int n, global const int *restrict slice,
                       global const int *restrict neighbour, global const float *restrict weight,
                       global const float *restrict rhs, global const float *restrict inv_diag,
                       global const float *restrict x, global float *restrict x_old, float momentum,
                       float keep, float step, volatile global int *shares, int4 launch)
{
    const graph g = {slice, neighbour, weight};
    FOR_BLOCKS(b, n, shares, launch)
    {
        chebyshev_block(b, g, rhs, inv_diag, x, x_old, momentum, keep, step);
    }
}

/* rhs = P'r of the next finer level.
 * reads slice, fine, weight, r (gathered); writes rhs
 * moves 8 C + 4 V bytes and the finer residual, 2 C flops
 * shape blocks of V */
KERNEL restrict_rows(int n, global const int *restrict slice, global const int *restrict fine,
                     global const float *restrict weight, GATHERED float *restrict r,
                     global float *restrict rhs, volatile global int *shares, int4 launch)
{
    FOR_BLOCKS(b, n, shares, launch) { restrict_block(b, slice, fine, weight, r, rhs); }
}

/* x = P coarse, three entries a row.
 * reads index, weight, coarse (gathered); writes x
 * moves 28 V bytes and the coarser x, 5 V flops
 * shape blocks of V, the finer level's */
KERNEL prolong_rows(int n, global const int *restrict index, global const float *restrict weight,
                    global const float *restrict coarse, global float *restrict x,
                    volatile global int *shares, int4 launch)
{
    const transfer p = {index, weight, coarse};
    FOR_BLOCKS(b, n, shares, launch) { STORE(prolonged_block(b, p), x, AT(b)); }
}

/* That and the first step of graph_chebyshev, x_next = x + step D^-1 (rhs - A x), at once: a row prolongs to its
 * neighbours, too.
 * reads slice, neighbour, weight, index and part and coarse (gathered), rhs, inv_diag; writes x, x_next
 * moves 8 L + 40 V bytes and the coarser x, 8 L + 10 V flops
 * shape blocks of V, the finer level's; numerics as graph_chebyshev */
KERNEL prolong_chebyshev(int n, global const int *restrict slice,
                         global const int *restrict neighbour, global const float *restrict weight,
                         global const int *restrict index, global const float *restrict part,
                         global const float *restrict coarse, global const float *restrict rhs,
                         global const float *restrict inv_diag, global float *restrict x,
                         global float *restrict x_next, float step, volatile global int *shares,
                         int4 launch)
{
    const transfer p = {index, part, coarse};
    FOR_BLOCKS(b, n, shares, launch)
    {
        const floatv now = prolonged_block(b, p);
        floatv a = 0;
        for (int j = slice[SLICE(b)], e = slice[SLICE(b) + 1]; j < e; j++) {
            const intv i = LOAD(neighbour, COLUMN(b, j));
            a += LOAD(weight, COLUMN(b, j)) * (now - prolonged_rows(i, p));
        }
        STORE(now, x, AT(b));
        STORE(now + step * LOAD(inv_diag, AT(b)) * (LOAD(rhs, AT(b)) - a), x_next, AT(b));
    }
}

/* x = inverse * rhs on the coarsest level.
 * reads inverse, rhs; writes x
 * moves 4 N^2 + 8 N bytes, 2 N^2 flops
 * shape blocks of V; numerics a column after the other */
KERNEL coarse_solve(int n, int n_pad, global const float *restrict inverse,
                    global const float *restrict rhs, global float *restrict x,
                    volatile global int *shares, int4 launch)
{
    FOR_BLOCKS(b, n_pad, shares, launch) { coarse_block(b, n, n_pad, inverse, rhs, x); }
}

/* ---- the tail: the coarsest levels in one launch of one work-group ---- */

/* Their arrays lie in one buffer; for each level a row of the table (dmk_shared.h) says where. */
typedef struct tail {
    global const int *table;
    global int *arena;
} tail;

static int tail_count(tail t, int l, int field)
{
    return t.table[l * DMK_TAIL_FIELDS + field];
}

static global int *tail_ints(tail t, int l, int field)
{
    return t.arena + tail_count(t, l, field);
}

static global float *tail_floats(tail t, int l, int field)
{
    return (global float *)tail_ints(t, l, field);
}

static graph tail_graph(tail t, int l)
{
    const graph g = {tail_ints(t, l, DMK_TAIL_SLICE), tail_ints(t, l, DMK_TAIL_NEIGHBOUR),
                     tail_floats(t, l, DMK_TAIL_WEIGHT)};
    return g;
}

/* to <- Chebyshev step from `from`; both are fields of the table. */
static void tail_chebyshev(tail t, int l, int from, int to, float momentum, float step)
{
    const graph g = tail_graph(t, l);
    FOR_ALL_BLOCKS(b, tail_count(t, l, DMK_TAIL_ROWS))
    {
        chebyshev_block(b, g, tail_floats(t, l, DMK_TAIL_RHS), tail_floats(t, l, DMK_TAIL_INV_DIAG),
                        tail_floats(t, l, from), tail_floats(t, l, to), momentum, 1, step);
    }
    TOGETHER
}

/* rhs from r, that of the level above */
static void tail_restrict(tail t, int l, int n, GATHERED float *r)
{
    FOR_ALL_BLOCKS(b, n)
    {
        restrict_block(b, tail_ints(t, l, DMK_TAIL_RESTRICT_SLICE),
                       tail_ints(t, l, DMK_TAIL_RESTRICT_ENTRY),
                       tail_floats(t, l, DMK_TAIL_RESTRICT_WEIGHT), r, tail_floats(t, l, DMK_TAIL_RHS));
    }
    TOGETHER
}

/* x_old = P x_old of the next level */
static void tail_prolong(tail t, int l)
{
    const transfer p = {tail_ints(t, l + 1, DMK_TAIL_PROLONG_INDEX),
                        tail_floats(t, l + 1, DMK_TAIL_PROLONG_WEIGHT),
                        tail_floats(t, l + 1, DMK_TAIL_X_OLD)};
    FOR_ALL_BLOCKS(b, tail_count(t, l, DMK_TAIL_ROWS))
    {
        STORE(prolonged_block(b, p), tail_floats(t, l, DMK_TAIL_X_OLD), AT(b));
    }
    TOGETHER
}

static void tail_solve(tail t, int l, global const float *inverse)
{
    const int n = tail_count(t, l, DMK_TAIL_ROWS), n_pad = tail_count(t, l, DMK_TAIL_PAD);
    FOR_ALL_BLOCKS(b, n_pad)
    {
        coarse_block(b, n, n_pad, inverse, tail_floats(t, l, DMK_TAIL_RHS),
                     tail_floats(t, l, DMK_TAIL_X_OLD));
    }
    TOGETHER
}

/* The V-cycle on the tail's levels, DMK_TAIL_STEPS on each on the way up: x_old of the first from its rhs or, where
 * `above` counts, from that of the level above, r.
 * reads table, arena, r (gathered), inverse; writes arena
 * moves 64 L + 192 V + 8 C bytes, 24 L + 61 V + 2 C flops at each level
 * shape one work-group, which waits between its loops */
KERNEL_ALONE tail_cycle(int levels, int above, global const int *restrict table,
                        global int *restrict arena, GATHERED float *restrict r,
                        global const float *restrict inverse, float8 momentum, float8 step,
                        volatile global int *shares, int4 launch)
{
    const int last = levels - 1, x = DMK_TAIL_X, x_old = DMK_TAIL_X_OLD;
    const tail t = {table, arena};
    float m[8], s[8];
    vstore8(momentum, 0, m);
    vstore8(step, 0, s);
    tail_restrict(t, 0, above ? tail_count(t, 0, DMK_TAIL_ROWS) : 0, r);
    for (int l = 1; l < levels; l++) {
        tail_restrict(t, l, tail_count(t, l, DMK_TAIL_ROWS), tail_floats(t, l - 1, DMK_TAIL_RHS));
    }
    tail_solve(t, last, inverse);
    for (int l = last - 1; l >= 0; l--) {
        tail_prolong(t, l);
        for (int k = 0; k < DMK_TAIL_STEPS; k += 2) {
            tail_chebyshev(t, l, x_old, x, m[k], s[k]);
            tail_chebyshev(t, l, x, x_old, m[k + 1], s[k + 1]);
        }
    }
}

/* The Laplacian of a graph level as a full matrix, n rows of n numbers. */
static void dense_laplacian(int n, graph g, global sum_t *a)
{
    FOR_LINES(i, n) { FOR_ALONG(j, n) a[i * n + j] = 0; }
    TOGETHER
    FOR_ITEMS(i, n)
    {
        sum_t diag = 0;
        for (int j = g.slice[i / DMK_WIDTH]; j < g.slice[i / DMK_WIDTH + 1]; j++) {
            const int k = DMK_WIDTH * j + i % DMK_WIDTH;
            a[i * n + g.neighbour[k]] -= g.weight[k];
            diag += g.weight[k];
        }
        a[i * n + i] += diag; /* short rows name the row itself, with weight 0 */
    }
}

/* The inverse for coarse_solve: the pseudo-inverse (L + c J)^-1 - J / (c n^2) of the coarsest graph's
 * Laplacian L, J all ones, c the mean of its diagonal over n. a: n rows of n numbers; row, column, least: room for n.
 * Gauss-Jordan steps in place without pivoting, for L + c J is positive definite; a pivot lost to rounding is left
 * out. All work-items go through it, and with n = 0 nothing is done. */
static void invert_laplacian(int n, int n_pad, graph g, global sum_t *a, global float *inverse,
                             local sum_t *row, local sum_t *column, local sum_t *least)
{
    sum_t shift = 0;
    dense_laplacian(n, g, a);
    TOGETHER
    for (int i = 0; i < n; i++) shift += a[i * n + i];
    shift /= (sum_t)max(n, 1) * max(n, 1);
    if (!(shift > 0)) shift = 1;
    TOGETHER
    FOR_LINES(i, n) { FOR_ALONG(j, n) a[i * n + j] += shift; }
    TOGETHER
    /* rounding of the edges may leave a pivot at 0: it is left out */
    FOR_ITEMS(i, n) { least[i] = 1e-12f * a[i * n + i]; }
    for (int k = 0; k < n; k++) {
        TOGETHER
        const sum_t pivot = a[k * n + k] > least[k] ? 1 / a[k * n + k] : 0;
        FOR_ITEMS(i, n)
        {
            row[i] = i == k ? pivot : a[k * n + i] * pivot;
            column[i] = i == k ? 0 : a[i * n + k];
        }
        TOGETHER
        FOR_LINES(i, n)
        {
            const sum_t c = column[i];
            FOR_ALONG(j, n) a[i * n + j] = i == k ? row[j] : (j == k ? 0 : a[i * n + j]) - c * row[j];
        }
    }
    TOGETHER
    FOR_LINES(i, n)
    {
        FOR_ALONG(j, n) inverse[i * n_pad + j] = (float)(a[max(i, j) * n + min(i, j)] - 1 / (shift * n * n));
    }
}

/* The coarsest level's inverse, where it is not one of the tail's. n is at most DMK_DENSE.
 * reads slice, neighbour, weight, a; writes a, inverse; moves 2 n^3 numbers, 2 n^3 flops
 * shape one work-group; numerics in sum_t */
KERNEL_ALONE coarse_inverse(int n, int n_pad, global const int *restrict slice,
                            global const int *restrict neighbour, global const float *restrict weight,
                            global sum_t *restrict a, global float *restrict inverse,
                            volatile global int *shares, int4 launch)
{
    const graph g = {slice, neighbour, weight};
    local sum_t row[DMK_DENSE], column[DMK_DENSE], least[DMK_DENSE];
    invert_laplacian(n, n_pad, g, a, inverse, row, column, least);
}

/* ---- refresh --------------------------------------------------------------------------------- */

/* Level 0, T: an edge's weight is the sum over its two triangles. slot: the midpoints' two slots among
 * the elements' parts; a border edge's second one is of an element whose numbers stay 0.
 * reads slot, triangle_edge (gathered); writes edge
 * moves 12 K + 12 E bytes, K flops
 * shape blocks of K */
KERNEL edges_from_triangles(int n, global const int *restrict slot,
                            GATHERED float *restrict triangle_edge, global float *restrict edge,
                            volatile global int *shares, int4 launch)
{
    FOR_BLOCKS(b, n, shares, launch)
    {
        const intv p = LOAD(slot, AT_K(b, 0, 2)), q = LOAD(slot, AT_K(b, 1, 2));
        const intv i = SIDE_PLACE(p), j = SIDE_PLACE(q);
        STORE((floatv)(GATHER(triangle_edge, i)) + (floatv)(GATHER(triangle_edge, j)), edge, AT(b));
    }
}

/* The shares of elements in the edges of T/2's graph, fine_graph.h: of their own ones the weights, and the 9 of mesh
 * edges, from Newton's coefficients or without g A's.
 * reads weight, g; writes edge, part
 * moves 12 E + 60 E bytes, 27 E flops; 24 E and 45 E more with newton
 * shape blocks of E */
KERNEL fine_elements(int n, int newton, global const float *restrict weight,
                     global const float *restrict g, int elements_at, global float *restrict edge,
                     global float *restrict part, volatile global int *shares, int4 launch)
{
    global float *const own = edge + elements_at;
    FOR_BLOCKS(b, n, shares, launch)
    {
        for (int k = 0; k < 3; k++) {
            const int i = k == 2 ? 0 : k + 1, j = k == 0 ? 2 : k - 1;
            const floatv w = LOAD(weight, AT_K(b, k, 3));
            floatv middle = w, across = 0, first = 0.5f * w, second = first, ends = 0;
            if (newton) {
                const floatv vk = LOAD(g, AT_K(b, k, 6)), vi = LOAD(g, AT_K(b, i, 6)),
                             vj = LOAD(g, AT_K(b, j, 6)), mk = LOAD(g, AT_K(b, 3 + k, 6)),
                             mi = LOAD(g, AT_K(b, 3 + i, 6)), mj = LOAD(g, AT_K(b, 3 + j, 6));
                middle -= mi * mj;
                across -= vk * mk;
                first -= vi * mk;
                second -= vj * mk;
                ends -= vi * vj;
            }
            STORE(middle, own, AT_K(b, k, 6));
            STORE(across, own, AT_K(b, 3 + k, 6));
            STORE(first, part, AT_K(b, 3 * k, 9));
            STORE(second, part, AT_K(b, 3 * k + 1, 9));
            STORE(ends, part, AT_K(b, 3 * k + 2, 9));
        }
    }
}

/* The mesh edges' edges of T/2's graph, sums of two shares.
 * reads slot, part (gathered); writes edge
 * moves 36 K + 36 E bytes, 3 K flops
 * shape blocks of 3 K */
KERNEL fine_edges(int n, global const int *restrict slot, GATHERED float *restrict part,
                  global float *restrict edge, volatile global int *shares, int4 launch)
{
    FOR_BLOCKS(b, n, shares, launch)
    {
        const intv i = LOAD(slot, AT_K(b, 0, 2)), j = LOAD(slot, AT_K(b, 1, 2));
        STORE((floatv)(GATHER(part, i)) + (floatv)(GATHER(part, j)), edge, AT(b));
    }
}

/* Edge i of the coarser level. */
static float edge_sum(int i, global const int *row, global const int *fine, global const short *coef,
                      global const float *fine_edge)
{
    float sum = 0;
    for (int j = row[i]; j < row[i + 1]; j++) sum += (float)coef[j] * fine_edge[fine[j]];
    return sum * (1.0f / DMK_GALERKIN_PARTS);
}

/* Copy edge weights to rows; D = a_ii + sum |a_ij| bounds A by 1 (row sums of magnitudes), so the
 * smoother needs no eigenvalue estimate. number: edges by row, a short row's filler has weight 0. */
static floatv weights_block(int b, global const int *slice, global const int *number,
                            GATHERED float *edge, global float *weight)
{
    floatv diag = 0, size = 0;
    for (int j = slice[SLICE(b)], e = slice[SLICE(b) + 1]; j < e; j++) {
        const intv i = LOAD(number, COLUMN(b, j));
        const floatv w = (floatv)(GATHER(edge, i));
        STORE(w, weight, COLUMN(b, j));
        diag += w;
        size += fabs(w);
    }
    return size + fabs(diag);
}

/* A part of the next level's edges, if it is one of them. */
static void refresh_edges(int part, int n, global const int *row, global const int *fine,
                          global const short *coef, global const float *edge, global float *coarse_edge)
{
    if (part < 0) return;
    FOR_PART_ROWS(i, n, part) { coarse_edge[i] = edge_sum(i, row, fine, coef, edge); }
}

/* A graph level's weights by row and its inverse diagonal, from its edges; and the edges of the next level,
 * w_coarse = R w_fine, the Galerkin product as a table of the mesh alone.
 * reads slice, number, edge (gathered), row, fine, coef; writes weight, inv_diag, coarse_edge
 * moves 8 L + 4 K + 4 V + 10 C bytes, 2 L + 2 V + 2 C flops, and 8 bytes for each edge of the next level
 * shape blocks of V, then rows, one for each edge of the next level; numerics coefficients are exact, see
 * DMK_GALERKIN_PARTS */
KERNEL graph_refresh(int n, global const int *restrict slice, global const int *restrict number,
                     global const float *restrict edge, global float *restrict weight,
                     global float *restrict inv_diag, int n_coarse, global const int *restrict row,
                     global const int *restrict fine, global const short *restrict coef,
                     global float *restrict coarse_edge, volatile global int *shares, int4 launch)
{
    const int parts = (n + PART_ITEMS - 1) / PART_ITEMS;
    FOR_PARTS(part, shares, launch)
    {
        FOR_PART_BLOCKS(b, n, part)
        {
            STORE(inverse_of(weights_block(b, slice, number, edge, weight)), inv_diag, AT(b));
        }
        refresh_edges(part - parts, n_coarse, row, fine, coef, edge, coarse_edge);
    }
}

/* The same on T, where the elements' bound is sharper than the rows': the inverse diagonal is from theirs,
 * 3 per element. first: slice of vertex 0 among the rows.
 * reads slice, number, edge (gathered), corner_slice, corner, diag (gathered), row, fine, coef; writes weight,
 * inv_diag, coarse_edge
 * moves 8 L + 4 K + 24 E + 4 V + 10 C bytes, 3 E + V + 2 C flops, and 8 bytes for each edge of the next level
 * shape and numerics as graph_refresh */
KERNEL mesh_refresh(int n, global const int *restrict slice, global const int *restrict number,
                    global const float *restrict edge, global float *restrict weight, int first,
                    global const int *restrict corner_slice, global const int *restrict corner,
                    GATHERED float *restrict diag, global float *restrict inv_diag, int n_coarse,
                    global const int *restrict row, global const int *restrict fine,
                    global const short *restrict coef, global float *restrict coarse_edge,
                    volatile global int *shares, int4 launch)
{
    const int parts = (n + PART_ITEMS - 1) / PART_ITEMS;
    FOR_PARTS(part, shares, launch)
    {
        FOR_PART_BLOCKS(b, n, part)
        {
            weights_block(b, slice, number, edge, weight);
            STORE(inverse_of(corner_sum(b, first, corner_slice, corner, diag)), inv_diag, AT(b));
        }
        refresh_edges(part - parts, n_coarse, row, fine, coef, edge, coarse_edge);
    }
}

/* 1 / (sum of the elements' weighted diagonals): see element_prepare.
 * reads slice, slot, out (gathered); writes inv_diag
 * moves 4 P + 24 E + 4 R bytes, 6 E + R flops
 * shape blocks of R */
KERNEL inverse_diagonal(int n, global const int *restrict slice, global const int *restrict slot,
                        GATHERED real *restrict out, global float *restrict inv_diag,
                        volatile global int *shares, int4 launch)
{
    FOR_BLOCKS(b, n, shares, launch)
    {
        STORE(inverse_of(TO_FLOAT(row_sum(slice, slot, out, b, launch))), inv_diag, AT(b));
    }
}

static void tail_edges(tail t, int l)
{
    global const short *coef = (global const short *)tail_ints(t, l, DMK_TAIL_GALERKIN_COEF);
    global float *edge = tail_floats(t, l, DMK_TAIL_EDGE);
    const int n = tail_count(t, l, DMK_TAIL_EDGES);
    FOR_ITEMS(i, n)
    {
        edge[i] = edge_sum(i, tail_ints(t, l, DMK_TAIL_GALERKIN_ROW),
                           tail_ints(t, l, DMK_TAIL_GALERKIN_EDGE), coef,
                           tail_floats(t, l - 1, DMK_TAIL_EDGE));
    }
    TOGETHER
}

static void tail_weights(tail t, int l)
{
    FOR_ALL_BLOCKS(b, tail_count(t, l, DMK_TAIL_ROWS))
    {
        const floatv size = weights_block(b, tail_ints(t, l, DMK_TAIL_SLICE),
                                          tail_ints(t, l, DMK_TAIL_NUMBER),
                                          tail_floats(t, l, DMK_TAIL_EDGE),
                                          tail_floats(t, l, DMK_TAIL_WEIGHT));
        STORE(inverse_of(size), tail_floats(t, l, DMK_TAIL_INV_DIAG), AT(b));
    }
    TOGETHER
}

/* Weights of the tail's levels, the edges of all but the first as in graph_refresh, and the coarsest level's
 * inverse, if it is wanted.
 * reads table, arena, a; writes arena, a, inverse
 * moves 10 C + 4 K + 12 L + 4 V bytes, 2 C + 2 L + 2 V flops at each level, and what coarse_inverse moves
 * shape one work-group, which waits between its loops; numerics the inverse in sum_t */
KERNEL_ALONE tail_refresh(int levels, int inverted, global const int *restrict table,
                          global int *restrict arena, global sum_t *restrict a,
                          global float *restrict inverse, volatile global int *shares, int4 launch)
{
    const tail t = {table, arena};
    const int last = levels - 1;
    local sum_t row[DMK_DENSE], column[DMK_DENSE], least[DMK_DENSE];
    tail_weights(t, 0);
    for (int l = 1; l < levels; l++) {
        tail_edges(t, l);
        tail_weights(t, l);
    }
    invert_laplacian(inverted ? tail_count(t, last, DMK_TAIL_ROWS) : 0, tail_count(t, last, DMK_TAIL_PAD),
                     tail_graph(t, last), a, inverse, row, column, least);
}
#endif
