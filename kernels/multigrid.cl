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

#define GRAPH_SUM(y, now, b)                                                                       \
    const floatv now = LOAD(x, AT(b));                                                             \
    floatv y = 0;                                                                                  \
    for (int j_ = slice[SLICE(b)], e_ = slice[SLICE(b) + 1]; j_ < e_; j_++) {                      \
        const intv i_ = LOAD(neighbour, COLUMN(b, j_));                                            \
        y += LOAD(weight, COLUMN(b, j_)) * (now - (floatv)(GATHER(x_read, i_)));                   \
    }

KERNEL graph_residual(int n, global const int *slice, global const int *neighbour,
                      global const float *weight, global const float *x, global const float *rhs,
                      global float *r LAUNCH)
{
    GATHERED float *x_read = x;
    FOR_BLOCKS(b, n)
    {
        GRAPH_SUM(a, now, b)
        STORE(LOAD(rhs, AT(b)) - a, r, AT(b));
    }
}

KERNEL graph_chebyshev(int n, global const int *slice, global const int *neighbour,
                       global const float *weight, global const float *rhs,
                       global const float *inv_diag, global const float *x, global float *x_old,
                       float momentum, float keep, float step LAUNCH)
{
    GATHERED float *x_read = x;
    FOR_BLOCKS(b, n)
    {
        GRAPH_SUM(a, now, b)
        STORE(now + momentum * (now - keep * LOAD(x_old, AT(b))) +
                  step * LOAD(inv_diag, AT(b)) * (LOAD(rhs, AT(b)) - a),
              x_old, AT(b));
    }
}

/* Restriction from T/2 to T: b_v = r_v + 1/2 sum of r over the midpoints of v's edges, and the first
 * smoothing step there. */
KERNEL restrict_midpoints(int n, int vertex_row, global const int *slice, global const int *link,
                          GATHERED float *r, float step, global const float *inv_diag,
                          global float *rhs, global float *x LAUNCH)
{
    global const float *at_vertex = (global const float *)(r + vertex_row);
    FOR_BLOCKS(b, n)
    {
        floatv sum = 0;
        for (int j = slice[SLICE(b)], e = slice[SLICE(b) + 1]; j < e; j++) {
            const intv i = LOAD(link, COLUMN(b, j));
            sum += (floatv)(GATHER(r, i));
        }
        sum = LOAD(at_vertex, AT(b)) + 0.5f * sum;
        STORE(sum, rhs, AT(b));
        STORE(step * LOAD(inv_diag, AT(b)) * sum, x, AT(b));
    }
}

/* Restriction with general weights (the transposed prolongation), and the first smoothing step. */
KERNEL restrict_rows(int n, global const int *slice, global const int *fine,
                     global const float *weight, GATHERED float *r, float step,
                     global const float *inv_diag, global float *rhs, global float *x LAUNCH)
{
    FOR_BLOCKS(b, n)
    {
        floatv sum = 0;
        for (int j = slice[SLICE(b)], e = slice[SLICE(b) + 1]; j < e; j++) {
            const intv i = LOAD(fine, COLUMN(b, j));
            sum += LOAD(weight, COLUMN(b, j)) * (floatv)(GATHER(r, i));
        }
        STORE(sum, rhs, AT(b));
        STORE(step * LOAD(inv_diag, AT(b)) * sum, x, AT(b));
    }
}

/* Prolongation from T to T/2: a midpoint takes the mean of its edge's ends, a vertex its own value
 * (both ends are itself). */
KERNEL prolong_midpoints(int n, global const int *ends, GATHERED float *coarse, global float *x LAUNCH)
{
    FOR_BLOCKS(b, n)
    {
        const intv i = LOAD(ends, AT_K(b, 0, 2)), j = LOAD(ends, AT_K(b, 1, 2));
        STORE(LOAD(x, AT(b)) +
                  0.5f * ((floatv)(GATHER(coarse, i)) + (floatv)(GATHER(coarse, j))),
              x, AT(b));
    }
}

KERNEL prolong_rows(int n, global const int *index, global const float *weight,
                    GATHERED float *coarse, global float *x LAUNCH)
{
    FOR_BLOCKS(b, n)
    {
        const intv i = LOAD(index, AT_K(b, 0, 3)), j = LOAD(index, AT_K(b, 1, 3)),
                   k = LOAD(index, AT_K(b, 2, 3));
        STORE(LOAD(x, AT(b)) + LOAD(weight, AT_K(b, 0, 3)) * (floatv)(GATHER(coarse, i)) +
                  LOAD(weight, AT_K(b, 1, 3)) * (floatv)(GATHER(coarse, j)) +
                  LOAD(weight, AT_K(b, 2, 3)) * (floatv)(GATHER(coarse, k)),
              x, AT(b));
    }
}

/* Coarsest level: x = inverse * b, the symmetric pseudo-inverse stored by columns of n_pad. */
KERNEL coarse_solve(int n, int n_pad, global const float *inverse, global const float *rhs,
                    global float *x LAUNCH)
{
    FOR_BLOCKS(b, n_pad)
    {
        floatv sum = 0;
        for (int j = 0; j < n; j++) sum += LOAD(inverse, j * n_pad + AT(b)) * rhs[j];
        STORE(sum, x, AT(b));
    }
}

/* The inverse for coarse_solve, by one work-group: the pseudo-inverse (L + c J)^-1 - J / (c n^2) of the
 * coarsest graph's Laplacian L, J all ones, c of the size of its diagonal; Gauss-Jordan steps in place, for
 * L + c J is positive definite. a: n rows of n numbers. n is at most DMK_DENSE. n^3 multiplications. */
#if DMK_CPU
#define ITEM_BEGIN 0
#define ITEM_STEP 1
#define TOGETHER
#else
#define ITEM_BEGIN ((int)get_local_id(0))
#define ITEM_STEP DMK_GROUP
#define TOGETHER barrier(CLK_LOCAL_MEM_FENCE | CLK_GLOBAL_MEM_FENCE);
#endif
#define FOR_ITEMS(i, n) for (int i = ITEM_BEGIN; i < (n); i += ITEM_STEP)

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

KERNEL coarse_inverse(int n, int n_pad, global const int *slice, global const int *neighbour,
                      global const float *weight, global sum_t *a, global float *inverse LAUNCH)
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

/* The place among 3 numbers per element of what has place p among 6: corner k, or side k at 3 + k. */
#define CORNER_PLACE(p) ((p) - 3 * DMK_WIDTH * ((p) / (6 * DMK_WIDTH)))
#define SIDE_PLACE(p) (CORNER_PLACE(p) - 3 * DMK_WIDTH)

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
KERNEL links_from_links(int n, global const int *row, global const int *fine,
                        global const half *coef, global const float *fine_link,
                        global float *link LAUNCH)
{
    FOR_ROWS(i, n)
    {
        float sum = 0;
        for (int j = row[i]; j < row[i + 1]; j++) sum += vload_half((size_t)j, coef) * fine_link[fine[j]];
        link[i] = sum;
    }
}

/* Copy link weights to rows; D = a_ii + sum |a_ij| bounds A by 1 (row sums of magnitudes), so the
 * smoother needs no eigenvalue estimate. number: links by row, a short row's filler has weight 0. */
KERNEL graph_weights(int n, global const int *slice, global const int *number,
                     GATHERED float *link, global float *weight, global float *inv_diag LAUNCH)
{
    FOR_BLOCKS(b, n)
    {
        floatv diag = 0, size = 0;
        for (int j = slice[SLICE(b)], e = slice[SLICE(b) + 1]; j < e; j++) {
            const intv i = LOAD(number, COLUMN(b, j));
            const floatv w = (floatv)(GATHER(link, i));
            STORE(w, weight, COLUMN(b, j));
            diag += w;
            size += fabs(w);
        }
        size += fabs(diag);
        STORE(size > 0 ? 1 / size : 0 * size, inv_diag, AT(b));
    }
}

/* 1 / (sum of the elements' weighted diagonals): see elements_prepare. */
KERNEL inverse_diagonal(int n, global const int *slice, global const int *slot,
                        GATHERED float *out, global float *inv_diag LAUNCH)
{
    FOR_BLOCKS(b, n)
    {
        floatv sum = 0;
        for (int j = slice[SLICE(b)], e = slice[SLICE(b) + 1]; j < e; j++) {
            const intv s = LOAD(slot, COLUMN(b, j));
            sum += (floatv)(GATHER(out, s));
        }
        STORE(sum > 0 ? 1 / sum : 0 * sum, inv_diag, AT(b));
    }
}

/* The same on T, from the elements' bounds there: 3 per element. first: slice of vertex 0 among the rows. */
KERNEL inverse_diagonal_corners(int n, int first, global const int *slice, global const int *slot,
                                GATHERED float *diag, global float *inv_diag LAUNCH)
{
    FOR_BLOCKS(b, n)
    {
        floatv sum = 0;
        for (int j = slice[first + SLICE(b)], e = slice[first + SLICE(b) + 1]; j < e; j++) {
            const intv p = LOAD(slot, COLUMN(b, j));
            const intv i = CORNER_PLACE(p);
            sum += (floatv)(GATHER(diag, i));
        }
        STORE(sum > 0 ? 1 / sum : 0 * sum, inv_diag, AT(b));
    }
}
#endif
