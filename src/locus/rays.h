/* Straight rays from the source and what they tell the vertices. Internal to src/locus. */
#ifndef DMK_LOCUS_RAYS_H
#define DMK_LOCUS_RAYS_H

#include "locus/locus.h"

/* One edge that rays from the source cross first, as seen from the source: its ends at distance
 * radius, direction angle (radians, counterclockwise, angle[0] < angle[1]). */
typedef struct dmk_chart_sector {
    double angle[2], radius[2];
    int32_t vertex[2];
    int32_t triangle; /* of the source, on this side of the edge */
    int32_t beyond;   /* half-edge 3*t+k entered, or -1 on a border */
} dmk_chart_sector;

/* The directions at the source: 3 sectors for a source inside a triangle, 2 for each triangle at an
 * edge, 1 for each triangle at a vertex. */
typedef struct dmk_chart {
    int32_t n_sectors;
    dmk_chart_sector *sector; /* in increasing angle, contiguous */
    double total;             /* sum of the angles at the source */
    bool closed;              /* the sectors go all around: angles count modulo total */
    int32_t vertex;           /* the source's vertex, or -1 */
} dmk_chart;

/* A geodesic that reaches a vertex. */
typedef struct dmk_sheet {
    double angle;    /* direction at the source */
    double distance; /* its length */
    double spread;   /* d(position)/d(angle) across it: the Jacobi field, a length */
} dmk_sheet;

/* A cusp of the rays: in its direction neighbouring ones meet nearer to the source than beside it.
 * If no shorter geodesic leads there, a branch of the locus ends there. */
typedef struct dmk_cusp {
    double angle, distance;
    double widest; /* largest spread of the rays on the way */
    double doubt;  /* how far `distance` may be off */
} dmk_cusp;

/* Where neighbours of a ray first meet. */
typedef struct dmk_profile_ray {
    double angle;
    double until;  /* length to the conjugate point; HUGE_VAL: none before the end of the ray */
    double end;    /* length of the ray */
    double widest; /* largest spread before the nearer of both */
} dmk_profile_ray;

typedef struct dmk_profile {
    int32_t n, n_cusps;
    dmk_profile_ray *ray; /* n: the fan, by angle */
    dmk_cusp *cusp;       /* n_cusps: by angle */
    double doubt;         /* of most of them */
} dmk_profile;

typedef struct dmk_rays {
    const dmk_mesh *mesh; /* that of the input, or `smooth` */
    dmk_mesh *smooth; /* the same mesh with its vertices' noise taken away; NULL if there is none */
    const double *distance; /* n_vertices: the guide */
    double mean;            /* mean edge length */
    dmk_chart chart;
    int32_t *across;  /* 3*n_triangles: the half-edge on the other side of half-edge 3t+k,
                         which lies opposite corner k; -1 on a border */
    float *size;      /* n_vertices: mean length of the edges there */
    float *curvature; /* n_triangles: Gaussian */
    float *bend;      /* n_vertices: 2 pi less the angles there; 0 on a border */
    dmk_profile profile;
    double noise;       /* mean difference of `bend` between neighbours, corners left out */
    int32_t *row;       /* n_vertices + 1: room of each vertex in `sheet` */
    uint8_t *n_sheets;  /* n_vertices: sheets there, at least one */
    dmk_sheet *sheet;   /* the sheets at each vertex, the shortest first */
    size_t n_unreached; /* vertices in the shadow of a border or a saddle vertex, which
                           borrow a neighbour's angle */
} dmk_rays;

/* A vertex that a ray passes: it comes into the row of triangles that the ray crosses. x, y: its
 * place in the plane into which the row is unfolded, source at the origin, ray along +x. */
typedef struct dmk_pass {
    double x, y;
    int32_t vertex;
    float spread; /* of the rays there; 0 behind a conjugate point */
    int32_t half; /* half-edge through which its triangle was entered; -1 for the source's own */
} dmk_pass;

typedef struct dmk_ray {
    double angle;
    double widest; /* largest spread */
    double until;  /* length up to its first conjugate point; HUGE_VAL: none */
    int32_t n, capacity;
    dmk_pass *pass;
} dmk_ray;

int dmk_chart_create(dmk_context *ctx, const dmk_mesh *mesh, const int32_t *across,
                     const dmk_point *source, dmk_chart *chart);
void dmk_chart_free(dmk_chart *chart);
/* The angle from a to b around the source, in [-total/2, total/2] if the chart is closed. */
double dmk_chart_turn(const dmk_chart *chart, double a, double b);

/* ray.c: follow one ray until it is `slack` mean edges plus 2 % longer than the guide. */
int dmk_ray_shoot(const dmk_rays *rays, double angle, double slack, dmk_ray *ray);

/* Radians: corners bent by more are none of the curved surface that the mesh stands for. */
static const double dmk_sharp = 0.5;

/* Whether a ray of length x at v is longer than the guide by more than `slack` mean edges plus 2 %.
 */
bool dmk_ray_ended(const dmk_rays *rays, double slack, double x, int32_t v);

/* The points at n increasing distances on a ray. False if the ray meets a border before. */
bool dmk_ray_points(const dmk_rays *rays, double angle, int n, const double *distance,
                    dmk_point *place);

/* Move `place` over the mesh to the point nearest to xyz, which is near already. */
void dmk_rays_go_to(const dmk_rays *rays, const double xyz[3], dmk_point *place);

/* fan.c: every geodesic found to every vertex; *hit is the caller's to free. */
typedef struct dmk_hit {
    dmk_sheet sheet;
    int32_t vertex;
} dmk_hit;
int dmk_fan_shoot(dmk_context *ctx, const dmk_rays *rays, dmk_profile *profile, dmk_hit **hit,
                  size_t *n_hits);

/* conjugate.c */
int dmk_rays_find_curvature(dmk_context *ctx, dmk_rays *rays);
int dmk_profile_find_cusps(dmk_context *ctx, double mean, dmk_profile *profile);
void dmk_profile_free(dmk_profile *profile);
/* The nearest cusp between two directions, the short way around, at a distance between `least` and
 * `most`. NULL if there is none. */
const dmk_cusp *dmk_rays_cusp(const dmk_rays *rays, double a, double b, double least, double most);

/* sheets.c */
/* 3*n_triangles: the half-edge on the other side of each, -1 on a border; freed with free(). */
int dmk_find_across(dmk_context *ctx, const dmk_mesh *mesh, int32_t **across);
int dmk_rays_create(dmk_context *ctx, const dmk_locus_input *in, dmk_rays *rays);
void dmk_rays_free(dmk_rays *rays);
/* The shortest geodesic to v. */
static inline const dmk_sheet *dmk_rays_first(const dmk_rays *rays, int32_t v)
{
    return rays->sheet + rays->row[v];
}
/* smooth.c: *smooth = NULL for a mesh without noise. */
int dmk_rays_smooth(dmk_context *ctx, const dmk_rays *rays, dmk_mesh **smooth);
/* repair.c: give the vertices that lie between no two rays the geodesic their neighbours suggest.
 */
int dmk_rays_repair(dmk_context *ctx, dmk_rays *rays);
/* complete.c: where neighbours have different geodesics, let each be known at the other's vertex.
 */
int dmk_rays_complete(dmk_context *ctx, dmk_rays *rays);
/* The geodesic to corner k of t in the beam through the geodesics a and b of corners k+1 and k+2.
 * False if it would pass the edge between them by more than `beyond` times its length. */
bool dmk_rays_unfold(const dmk_rays *rays, int32_t t, int k, const dmk_sheet *a, const dmk_sheet *b,
                     double beyond, dmk_sheet *c);
/* Width of the beam between two geodesics, in a narrow beam the distance of their ends. */
static inline double dmk_rays_width(const dmk_rays *rays, const dmk_sheet *a, const dmk_sheet *b)
{
    double turn = dmk_chart_turn(&rays->chart, a->angle, b->angle);
    return (turn < 0 ? -turn : turn) * (a->spread < b->spread ? a->spread : b->spread);
}
/* The sheet of vertex v that continues `from`, a sheet of a vertex at distance `length`; -1 if no
 * such geodesic reaches v. */
int32_t dmk_rays_continue(const dmk_rays *rays, const dmk_sheet *from, double length, int32_t v);

#endif
