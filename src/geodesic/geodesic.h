/* Exact geodesic distances on the polyhedron, from points anywhere on it and from edges as a whole, here called lines.
 *
 * A shortest path is straight when the triangles it crosses are unfolded into the plane; it bends
 * at vertices only, at those with more than 2 pi around them and at those of a border with more
 * than pi: pseudo-sources. All shortest paths from one (pseudo-)source through the same row of
 * edges form a window on the last of them (Mitchell, Mount, Papadimitriou 1987). Here windows run
 * down depth first, without a queue: an upper bound of the distance is all that is needed to drop
 * the useless ones.
 *
 * - star.c: directions at every vertex.
 * - source.c: the triangles around a source, and where its rays enter the next ones.
 * - front.c: triangles as the engines read them, and what sources and pseudo-sources radiate.
 * - window.c: windows, depth first: exact distances.
 * - step.c, lanes.c: their steps, one by one and many at once; shares.c: what threads give each other.
 * - wave.c, envelope.c: merged windows: distances of large meshes; shard.c: where they wait.
 * - trace.c: paths, and distances anywhere.
 * - image.h: families of paths as an edge sees them.
 * - check.c: what must hold of the result; its integral.
 * - ways.c: the least ways that join parts of the mesh.
 * - finer.c: the same on finer triangles.
 * - geodesics.c: the object.
 *
 * Half-edge h = 3 t + k lies opposite corner k of triangle t and runs from corner k+1 to corner
 * k+2. */
#ifndef DMK_GEODESIC_H
#define DMK_GEODESIC_H

#include "mesh/mesh.h"

/* Directions at a vertex: corner c = 3t+k of the star spans [angle[c], angle[c] + corner_angle[c]],
 * counted counterclockwise from the star's first corner (at a border the clockwise-most one, else that in the first
 * triangle).
 * angle[c] is the direction of the edge towards corner k+1. */
typedef struct dmk_star {
    double *angle;        /* 3 n_triangles */
    double *corner_angle; /* 3 n_triangles */
    double *total;        /* n_vertices; 0 for a vertex in no triangle */
    int32_t *twin;        /* 3 n_triangles, -1 at a border */
    int32_t *first;       /* n_vertices: the star's first corner, -1 for a vertex in no triangle */
    bool *border;         /* n_vertices */
    double unit; /* a power of two near the mesh's extent: engines compute in it, so that no square
                    overflows */
} dmk_star;

/* old: n_triangles, the numbers by which the first corners are chosen, for a mesh in another order than the user's;
 * NULL: its own. */
int dmk_star_create(dmk_context *context, const dmk_mesh *mesh, const int32_t *old, dmk_star *star);
void dmk_star_free(dmk_star *star);
/* *loop: n_vertices, the border loop of each border vertex, counted from 0 to *n_loops, -1 inside; the caller frees
 * it. parent: n_vertices, for the work. */
int dmk_star_loops(dmk_context *context, const dmk_mesh *mesh, const dmk_star *star,
                   int32_t *parent, int32_t **loop, int32_t *n_loops);
/* Twice the area of triangle t, and at its corners the products of the sides there; in lengths times `scale`. */
void dmk_measure_corners(const dmk_mesh *mesh, double scale, int32_t t, double *area2,
                         double dot[3]);

/* The next corner of the star counterclockwise: -1 behind the last one at a border; inside the
 * first one follows the last. */
static inline int32_t dmk_star_next(const dmk_star *star, int32_t corner)
{
    int32_t o = star->twin[dmk_next(corner)];
    return o < 0 ? -1 : dmk_next(o);
}

/* What a source sees through one edge: half-edge `half` of a triangle that the source lies in, with
 * the source at (x, y), y > 0, of the frame that has the half-edge on its x axis from (0, 0). In
 * the source's chart the half-edge spans [angle, angle + span]. */
typedef struct dmk_sector {
    double x, y, angle, span;
    int32_t half;
} dmk_sector;

/* A source with its chart: at a vertex that of the star; on an edge, opposite corner k of its
 * point's triangle, angles count from the direction to corner k+2 counterclockwise; inside a
 * triangle from the direction to corner 0. */
typedef struct dmk_site {
    dmk_point point;
    double offset;  /* distance at the source */
    double total;   /* angle around it */
    bool on_border; /* directions do not go round then */
    int32_t vertex; /* that it lies at, or -1 */
    int32_t n_sectors;
    dmk_sector *sector; /* counterclockwise */
} dmk_site;

int dmk_site_create(dmk_context *context, const dmk_mesh *mesh, const dmk_star *star,
                    const dmk_point *point, double offset, dmk_site *site);
void dmk_site_free(dmk_site *site);

/* A second shortest path to a vertex, from another direction: the vertex lies on the cut locus, as many do on symmetric
 * meshes. */
typedef struct dmk_tie {
    int64_t vertex; /* so wide that no byte is left out: ranks hand ties around */
    dmk_arrival arrival;
} dmk_tie;

struct dmk_geodesics {
    const dmk_mesh *mesh; /* as it was handed in (in dmk_solve: the ordered component) */
    int32_t n_sources;
    dmk_site *source; /* n_sources */
    size_t n_lines;
    int32_t *line;        /* n_lines half-edges, all of whose points are source number n_sources */
    double *distance;     /* n_vertices; infinite where no source reaches */
    dmk_arrival *arrival; /* n_vertices */
    dmk_tie *tie;         /* n_ties, by vertex; exact windows know them */
    size_t n_ties;
    double *error;    /* n_vertices: estimate of the error; NULL if all are exact */
    double asked;     /* tolerance; 0: exact distances were */
    double tolerance; /* of merged windows; 0: exact */
    dmk_star star;
    int64_t n_windows; /* made */
    int64_t n_shared;  /* of exact ones, that the first thread has left for all */
};

/* source.c: the lines in their order, once each; whether half-edge h is one of them. */
void dmk_lines_sort(dmk_geodesics *g);
bool dmk_lines_have(const dmk_geodesics *g, int32_t h);

/* Whether vertex v is a source, or on a curve that is one: no direction leads to it. */
bool dmk_is_source(const dmk_geodesics *g, int32_t v);
/* Angle around a source, for directions modulo it; HUGE_VAL where they do not close up. */
double dmk_turn_around(const dmk_geodesics *g, int32_t source);
/* Directions at a source times this close up at 2 pi; 1 where they do not. */
double dmk_scale_around(const dmk_geodesics *g, int32_t source);
/* The same of the only source; 1 if there are several. */
double dmk_turn_scale(const dmk_geodesics *g);
/* From direction a to b, the short way around. */
double dmk_turn_between(double full, double a, double b);

/* Up to so many triangles distances are exact unless asked otherwise: there exact windows take less time than merged
 * ones, on smooth meshes too (README.md); beyond, their number per edge still grows. */
enum { DMK_EXACT_TRIANGLES = 450000 };

/* dmk_geodesics_create without a stage of its own and without the argument checks; old: of dmk_star_create. */
int dmk_geodesics_compute(dmk_context *context, const dmk_mesh *mesh, const int32_t *old,
                          size_t n_sources, const dmk_point *source,
                          const dmk_geodesics_options *options, dmk_geodesics **geodesics);
/* All of the object but what is found: distance and arrival are 0, error and tolerance not set. */
int dmk_geodesics_prepare(dmk_context *context, const dmk_mesh *mesh, const int32_t *old,
                          size_t n_sources, const dmk_point *source,
                          const dmk_geodesics_options *options, dmk_geodesics **geodesics);

/* The second path to v, NULL if there is none; logarithmic in their number. */
const dmk_arrival *dmk_geodesics_tie(const dmk_geodesics *geodesics, int32_t v);

/* check.c: DMK_E_MESH, naming the first vertex, if the distances cannot be right. */
int dmk_geodesics_check(dmk_context *context, const dmk_geodesics *geodesics);
/* check.c: DMK_E_ARG for sources whose offsets are too large beside the mesh. */
int dmk_geodesics_check_offsets(dmk_context *context, const dmk_geodesics *geodesics);

/* Distance at the edges' midpoints as the shortest path to the nearer end goes on there: mid,
 * n_edges. Too short by as much as the ways of neighbours differ, some h^3. */
void dmk_geodesics_midpoints(dmk_context *context, const dmk_geodesics *geodesics, double *mid);
/* dmk_geodesics_integrate where these distances are there already. */
int dmk_geodesics_integrate_from(dmk_context *context, const dmk_geodesics *geodesics,
                                 const double *mid, double *integral, double *error);
/* The terms of that, of triangles begin .. end - 1: theirs of sum and error, to be added in this order. */
void dmk_geodesics_integrate_parts(dmk_context *context, const dmk_geodesics *geodesics,
                                   const double *mid, int32_t begin, int32_t end, double *sum,
                                   double *error);
/* To be called behind either: where the estimate says that triangles are too coarse, the integral is that on finer
 * ones. */
int dmk_geodesics_integrate_finer(dmk_context *context, const dmk_geodesics *geodesics,
                                  double *integral, double *error);

/* wave.c: distance and arrival of an object whose star and sources are set, with merged windows. With a
 * tolerance, or where a distance may be off by more than `exact` of the largest, the estimates of the errors are set.
 * *finished: false if there are more than `looks` looks at windows over half-edges, or vertices
 * with estimates over the tolerance than `over`. */
int dmk_waves_run(dmk_context *context, dmk_geodesics *geodesics, double tolerance, double exact,
                  int looks, int over, bool *finished);

/* Whether the estimate of an error is to be made less: it exceeds twice the tolerance; and the most vertices with such
 * ones that are looked at again: on meshes of needles estimates are large everywhere, and then stay. */
static inline bool dmk_is_over(double tolerance, double error, double distance)
{
    return error > 2 * tolerance * distance;
}
enum { DMK_MOST_REPAIRS = 200 };

/* window.c: the same with exact windows. Not *finished, and nothing is set: one thread makes more than
 * `most` windows. The usual ones: twice as many as ordinary meshes need. */
int64_t dmk_windows_usual(const dmk_mesh *mesh);
int dmk_windows_run(dmk_context *context, dmk_geodesics *geodesics, int64_t most, bool *finished);

/* ways.c: from the centroid of h's triangle over the middle of h to that of the next one. */
double dmk_way_across(const dmk_geodesics *geodesics, int32_t h);
/* Parts are sets of nodes, of which `parent` (base/sets.h) is that of n_triangles and the border loops behind
 * them; in_part: n_triangles, those that belong to one; each border loop is one, or of one; loop: n_vertices; n_parts
 * of them. step: n_edges, the length of a way across an edge. Sets kept[edge] where the least ways cross that join all
 * parts, and unites the sets. */
int dmk_join_parts(dmk_context *context, const dmk_geodesics *geodesics, const int32_t *loop,
                   const double *step, const bool *in_part, int32_t n_parts, int32_t *parent,
                   bool *kept);

#endif
