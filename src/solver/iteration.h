/* The nonlinear iteration: from a density and a potential to the optimal pair. */
#ifndef DMK_ITERATION_H
#define DMK_ITERATION_H

#include "solver/kernels.h"
#include "solver/pcg.h"

#include <float.h>

/* What there is of an operator on the device: its weights and inverse diagonal, and the coarse graphs'. Who changes mu
 * sets it back to nothing. */
typedef enum dmk_ready { DMK_NOTHING, DMK_DIAGONAL, DMK_HIERARCHY } dmk_ready;

/* One solve under way. Quantities are in the packed problem's units (area 1). */
typedef struct dmk_iteration {
    dmk_context *ctx;
    dmk_system *sys;
    const dmk_mesh *mesh;        /* that the system was made of */
    const int32_t *triangle_old; /* its triangles' numbers in the input */
    const dmk_solve_options *options;
    dmk_method asked; /* the caller's method: options may be those of another that takes over */
    dmk_stats *stats;
    double began;     /* dmk_seconds() */
    double fu, uau;   /* f.u and u.Au of the last energies */
    bool fresh;       /* fu, uau, q and out_real are u's */
    double tolerance; /* relative change of mu that ends the iteration */
    /* Of the last energies: the integral of mu, the means with weight mu of L and L^2, L = 1/2 log(scale^2 q), and the
     * largest q. */
    double mass, slope, square, scale, largest;
    double rho, top;   /* the root of that of L^2, and the largest, of q at a scale; see below */
    double floor;      /* mu stays above this many square roots of the element's area; */
    double mean_floor; /* in Newton's steps that do not begin at a distance: times mu's mean */
    bool between;      /* measures: see newton.c for what its steps do then */
    int before;        /* steps of the attempts before this one */
    bool goes_on;      /* a large gap will be answered by more steps */
    bool certified;    /* stats has the bounds of the present pair */
    dmk_ready ready;   /* of A(mu) of the present mu, on the device */
    bool loose; /* its u is far from solving A(mu) u = f: a few iterations of CG from mu = const */
    bool light; /* one smoothing step on T/2 is as good as two: see newton.c */
    /* Puts s->mu and s->u back to where they began, for another attempt. */
    int (*restart)(dmk_context *context, void *user);
    void *user;
    double *flux, *balance; /* of the upper bound's flux, see dmk_bound_upper; NULL: not wanted */
} dmk_iteration;

enum { DMK_NEWTON_STEPS = 60, DMK_EXPLICIT_STEPS = 2000 };
/* Relative L1 change of mu that ends the default method: the density's error is about as large. */
static const double DMK_DEFAULT_TOLERANCE = 3e-3;
/* The floor of mu to begin with, so that logarithms exist. */
static const double DMK_FLOOR = 1e-4;
/* The gap that is asked for, or 0. A tolerance below 1e-7 cannot be reached for rounding errors: it only asks for the
 * gap of each step, and changes nothing else. */
static inline double dmk_gap_asked(const dmk_solve_options *o)
{
    return o->gap_tolerance >= 1e-7 ? o->gap_tolerance : 0;
}

/* A density that has settled leaves a gap far below this, as the cost is right to the square of its
 * error; on meshes of a few triangles, or next to none of it moving, the change of mu may be small
 * too early. */
static const double DMK_SETTLED_GAP = 3e-3;

/* What rounding may make of u.K u of an element, relative to the sum of its terms' sizes: no term goes through
 * more than about 20 roundings of 2^-53, and the cotangents come with a few. */
static const double DMK_ENERGY_ROUNDING = 16 * DBL_EPSILON;
/* And of f, where the device has no double precision: of a float. */
static const double DMK_FLOAT_ROUNDING = 6e-8;

/* A mesh without small angles. */
bool dmk_is_shapely(const dmk_system *system);
/* g in out_real, q of s->u; fu, uau, mass and the like. */
int dmk_iteration_energies(dmk_iteration *o);
/* The last step of the inner solve (`first`: of one) and what follows: u, mu, its relative change, and their
 * energies. */
int dmk_iteration_update(dmk_iteration *o, dmk_items over, bool first, const dmk_newton_step *step,
                         double *change);
/* The same after an update with u linear on T and another change of mu, L at this scale of u. */
int dmk_iteration_measure_nested(dmk_iteration *o, double scale);
/* q, its largest in o->top, and f.v of any row vector in place of u, in double precision q with its rounding on top,
 * so that it is not below the true one. keep: DMK_KEEP_Q, or 0 if the array of q is to stay as it is, as out_real does.
 */
int dmk_iteration_energies_of(dmk_iteration *o, const dmk_buffer *v, int keep, double *fv);
/* rho and top of the last energies' q scaled by alpha^2. rho as if no L, kept in [-1, 1], came to its bounds or left
 * them by that. */
void dmk_iteration_measure(dmk_iteration *o, double alpha);
/* That much of A(mu), unless it is there. cg[DMK_OUTER].p and .ap are scratch. */
int dmk_iteration_operator(dmk_iteration *o, dmk_ready wanted);
/* Solve A(mu) du = f - A(mu) u to `tolerance` of the energy f.u and add du to s->u. */
int dmk_iteration_solve(dmk_iteration *o, double tolerance, int max_iterations);
/* Read the first n scalars, once all that is queued is done. */
int dmk_iteration_scalars(dmk_iteration *o, size_t n, double *sums);
/* Report a step, which counts from 1 in an attempt; a change that is not a number or too large is divergence. */
int dmk_iteration_step_done(dmk_iteration *o, int step, int max_steps, int iterations,
                            double change);

/* The divergence at a step of all attempts, DMK_E_DIVERGED: what happened, the way out and the worst triangle. */
int dmk_iteration_diverged(const dmk_iteration *o, int step, const char *what);

/* The step limit of this attempt came before the tolerance: DMK_E_LIMIT with the last change, or what the method
 * compares. */
int dmk_iteration_limit(dmk_iteration *o, int max_steps, double change);
/* The methods: from the start in s->mu, s->u to convergence. Newton's: at least `effort` iterations of CG in a step,
 * and at most that many steps. */
int dmk_newton(dmk_iteration *o, bool from_distance, int effort, int max_steps);
int dmk_explicit(dmk_iteration *o);
/* Newton's, and where they fail again from the start, solved better: the best pair. See attempts.c. */
int dmk_attempts(dmk_iteration *o, bool from_distance);

/* certificate.c: stats->cost_upper, cost_lower and gap of the present pair (units of the packed
 * problem), which stays as it is. last: it is the pair that the iteration ends with; then nothing is done
 * if it has its bounds already, and u is repaired whatever gap was asked for. */
int dmk_certify(dmk_iteration *o, bool last);
/* stats->gap from the bounds, which differ by more than rounding in the right direction or not at all. */
void dmk_certify_gap(dmk_stats *stats);
/* bounds.c: lower bounds from a row vector: f.v / sqrt(max q), with q left in s->q and its maximum in o->top, and
 * the same of phi(v), which goes through q of v as dmk_bound_plain left it; it stays. cg[DMK_OUTER].p is scratch. */
int dmk_bound_plain(dmk_iteration *o, const dmk_buffer *v, double *bound);
int dmk_bound_banded(dmk_iteration *o, const dmk_buffer *v, double *bound);
/* Needles so sharp that rounding on the device would spoil the bounds. */
bool dmk_bound_is_rough(const dmk_iteration *o);

/* upper.c: an upper bound of the optimal cost, that of a flux which delivers f to rounding: mu grad u of the
 * present pair and a small remainder. If it is `enough` or less, and where they are not NULL, flux[3 t ..] becomes
 * minus its mean over triangle t, and *balance the most that it fails to deliver to a row, over the largest f. The pair
 * stays. */
int dmk_bound_upper(dmk_iteration *o, double *flux, double *balance, double enough, double *bound);

/* repair.c: raise stats->cost_lower by a repair of u until the gap to `upper` is at most goal[0], or goal[1] and more
 * would take long, or all triangles obey |grad u| <= 1, or more would not bring it there; `last`: no steps follow that
 * might, so that it is given up late. */
int dmk_repair(dmk_iteration *o, const double goal[2], double upper, bool last);

/* rhs.c: f+ - f- on the rows of T/2 for a source at `point` of the packed mesh. */
void dmk_right_hand_side(const dmk_mesh *mesh, const dmk_system *system, const dmk_point *point,
                         double *f);
/* The same added to f of a mesh whose vertices' rows begin at vertex_row; of a share's, `elements` tells the gaps,
 * which are left out (NULL: none). The source: its triangle, or -1 where it is not here, and weights. */
void dmk_fill_right_hand_side(const dmk_mesh *mesh, const dmk_space *elements, int32_t vertex_row,
                              double unit, int32_t source, const double weight[3], double *f);
/* Triangles of T/2 in one of T, by the nodes v0 v1 v2 m0 m1 m2; the middle one last. */
static const int dmk_quarter[4][3] = {{0, 5, 4}, {5, 1, 3}, {4, 3, 2}, {3, 4, 5}};
/* The weights of the six macro-element nodes (v0 v1 v2 m0 m1 m2) at a point. */
void dmk_point_weights(const double bary[3], double weight[6]);

#endif
