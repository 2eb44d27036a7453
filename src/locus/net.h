/* The cut locus while it is being built: a graph whose vertices have three neighbours at most, or a
 * few more where branch points were merged. Internal to src/locus. */
#ifndef DMK_LOCUS_NET_H
#define DMK_LOCUS_NET_H

#include "locus/rays.h"

/* What is left of the dual graph after pruning. */
typedef struct dmk_dual {
    float *strength; /* n_edges: width of the beam between the geodesics to the two ends of the
                        edge, in lengths of the edge: about 1 or less where they are one family */
    bool *kept;      /* n_edges: the edge is crossed by the graph */
    bool *held;      /* n_edges: never stripped: the cusp from which the branch comes is known */
    uint8_t *degree; /* n_triangles: kept edges of the triangle */
    int32_t n_kept;  /* edges */
    int32_t n_loops; /* border loops of the mesh, each a node of the dual graph */
    int64_t betti;   /* first Betti number of the graph kept */
} dmk_dual;

/* graph.c. What the roughness of the mesh may add to the angle at the source between two rays of
 * one family that meet at a place with edges of length `size`. */
double dmk_rays_walk(const dmk_rays *rays, double distance, double size);
/* DMK_E_MESH if the first Betti number is not 2g or the graph not connected. */
int dmk_dual_create(dmk_context *ctx, const dmk_rays *rays, double threshold, dmk_dual *dual);
void dmk_dual_free(dmk_dual *dual);

enum { max_branches = 8 };

typedef struct dmk_node {
    dmk_locus_vertex at;        /* angles as in the chart, strength not yet scaled to 2 pi */
    double size;                /* length of a mesh edge there */
    int32_t next[max_branches]; /* neighbours, at.degree of them */
    double width;               /* of the beam between the two geodesics, in mesh edges */
    int32_t edge;               /* mesh edge it lies on by construction, or -1 */
    bool border;                /* an end that lies on the mesh's border */
    bool guess; /* a family was not known at both ends of the edge: placed in the middle */
    bool blunt; /* an end where no cusp of the rays was found */
    bool weak;  /* on an edge too weak to be an end */
    bool held;  /* on an edge held by the dual graph */
} dmk_node;

typedef struct dmk_net {
    int32_t n, capacity;
    dmk_node *node; /* removed ones have degree 0, unless the net is one point */
} dmk_net;

/* place.c: kept edges and triangles to points on the surface. */
int dmk_net_create(dmk_context *ctx, const dmk_rays *rays, const dmk_dual *dual, double threshold,
                   dmk_net *net);
void dmk_net_free(dmk_net *net);
void dmk_net_set_place(const dmk_mesh *mesh, dmk_point place, dmk_locus_vertex *at);

/* net.c */
int dmk_net_add(dmk_context *ctx, dmk_net *net, int32_t *node);
void dmk_net_link(dmk_net *net, int32_t a, int32_t b);
void dmk_net_unlink(dmk_net *net, int32_t a, int32_t b);
/* The neighbour of b that is not a, for b of degree 2. */
int32_t dmk_net_onward(const dmk_net *net, int32_t a, int32_t b);
double dmk_net_distance(const dmk_net *net, int32_t a, int32_t b);
/* Length of the branch from the end a to its junction in mesh edges, or HUGE_VAL if it ends in
 * another end; counted up to `limit`. */
double dmk_net_branch_length(const dmk_net *net, int32_t a, double limit);
/* The branch from the end a up to its junction. */
void dmk_net_remove_branch(dmk_net *net, int32_t a);
/* Branch points nearer to each other than half an edge become one: on a mesh four branches that
 * meet in a point are two pairs of three. */
void dmk_net_merge_branches(const dmk_rays *rays, dmk_net *net);
/* Strip weak ends once more, looking some points ahead. Remove ends nearer than `twig` edges to
 * their junction, and points nearer than `short` edges to their neighbours on a branch. */
void dmk_net_tidy(dmk_net *net);
/* The first part of it: only whole ends are removed, so that each link stays in one triangle. */
void dmk_net_strip(dmk_net *net);

/* Remove short branches that end bluntly: the mesh's view of several families that meet nearly at
 * one point. */
void dmk_net_remove_blunt(dmk_net *net);

/* cusp.c. Move a cusp, known to within some edges, to where a bundle of rays shows it, at most
 * `width` (radians) to both sides; size: of the mesh edges there. False if they show none. */
bool dmk_cusp_fit(const dmk_rays *rays, double width, double size, dmk_cusp *cusp);

/* tip.c: move the ends to where the two geodesics become one. */
int dmk_net_fit_tips(dmk_context *ctx, const dmk_rays *rays, dmk_net *net);

/* point.c: if the rays of all directions meet, make the net one point. */
int dmk_net_shrink(dmk_context *ctx, const dmk_rays *rays, const dmk_dual *dual, dmk_net *net);

/* A sheet at the fraction s between its values at two vertices. */
dmk_sheet dmk_sheet_between(const dmk_chart *chart, const dmk_sheet *a, const dmk_sheet *b,
                            double s);

#endif
