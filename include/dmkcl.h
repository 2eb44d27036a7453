/* dmkcl: the cut locus of a point on a triangulated surface, by optimal transport, on OpenCL.
 *
 * Public interface of libdmkcl (C11, callable from C99 and C++).
 *
 * Conventions
 *   - Every call that can fail returns a dmk_status: DMK_OK (0) or a negative code; the reason, in
 *     words, is then dmk_context_message(context). Outputs are set only on success.
 *   - Arguments are checked: NULL where a pointer must be, numbers out of range, points that are none of
 *     the mesh give DMK_E_ARG, and accessors give NULL or zeros for NULL. What may be NULL says so:
 *     options of a call (its defaults then), the `n` of accessors. Strings end with 0, arrays have the
 *     stated length: that nobody can check.
 *   - Threads: a context, a device and the solvers on it are used by one thread at a time; different ones
 *     may work at the same time. Meshes, results and loci do not change: any number of threads reads
 *     them, each with a context of its own.
 *   - Forks: what does not compute on a device goes on in a forked child. A child of a process that has
 *     used OpenCL gets DMK_E_DEVICE from calls that need a device, for drivers' threads stay behind; what
 *     it destroys is freed. Fork first, then open devices.
 *   - No globals (but for the process that uses OpenCL and how many of its calls open devices), no signal
 *     handlers, no printing.
 *   - *_create/_read/_open give an object to the caller, who hands it back to *_destroy(&object);
 *     destroying NULL is fine and the pointer is set to NULL. `const` pointers returned by accessors
 *     are borrowed and live as long as the object they come from.
 *   - Option structs are filled first by their _init function, with sizeof of the struct, then changed at will:
 *         dmk_solve_options options;  dmk_solve_options_init(&options, sizeof options);
 *     So they can grow: a library that knows more members takes the defaults for those that a program compiled
 *     against an older header does not have, and one that knows fewer refuses what it would have to overlook. Other
 *     structs stay as they are as long as the soname does (until 1.0: major and minor version).
 *   - Indices count from 0; lengths are in the unit of the mesh's coordinates.
 *
 * The problem, by Facca, Berti, Fasso, Putti, "Computing the cut locus of a Riemannian manifold via optimal transport":
 *     f+ = |M| delta_p,   f- = area measure of the surface M,
 *     -div(mu grad u) = f+ - f-,   |grad u| <= 1,   |grad u| = 1 where mu > 0.
 * Then u = -dist(., p) + const, and the zero set of the density mu is the cut locus of p.
 */
#ifndef DMKCL_H
#define DMKCL_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define DMK_VERSION_MAJOR 0
#define DMK_VERSION_MINOR 2
#define DMK_VERSION_PATCH 0

typedef enum dmk_status {
    DMK_OK = 0,
    DMK_E_ARG = -1,       /* an argument is out of its range */
    DMK_E_NOMEM = -2,     /* out of memory on the host or the device */
    DMK_E_IO = -3,        /* a file cannot be opened, read or written */
    DMK_E_FORMAT = -4,    /* malformed or unrecognised file */
    DMK_E_MESH = -5,      /* the mesh is not a surface this method can treat */
    DMK_E_DEVICE = -6,    /* no OpenCL device, or it failed */
    DMK_E_BUILD = -7,     /* a kernel did not compile */
    DMK_E_DIVERGED = -8,  /* the iteration diverged; there is no result */
    DMK_E_LIMIT = -9,     /* a step or iteration limit was reached before the tolerance */
    DMK_E_CANCELLED = -10 /* the progress callback asked to stop */
} dmk_status;

/* "x.y.z" of the library that is linked. */
const char *dmk_version(void);

/* A few words on a status code, for instance "out of memory". Never NULL. */
const char *dmk_status_text(int status);

/* ---- context: message and progress --------------------------------------------------------- */

typedef struct dmk_context dmk_context;

/* One report of progress. `stage` is a static string ("read", "repair", "levels", "solve", "distance", "locus", "cut",
 * "path", "write", ...). All but "solve" report when they start, and again each 50 ms, with step 0; within "solve",
 * `step` counts nonlinear iterations from 1, `change` is the relative change of mu per unit time and `gap` the
 * relative gap of the certificate after the step before, or NaN when that was not computed. */
typedef struct dmk_progress {
    const char *stage;
    int step;
    int max_steps;
    int cg_iterations; /* of this step */
    double change;
    double tolerance; /* the change at which the iteration ends */
    double gap;
    double seconds; /* since the stage began, of a step since the call did */
} dmk_progress;

/* Return 0 to go on; anything else ends the running call with DMK_E_CANCELLED. */
typedef int (*dmk_progress_fn)(const dmk_progress *progress, void *user);

int dmk_context_create(dmk_context **context);
void dmk_context_destroy(dmk_context **context);
/* Why the last failing call on this context failed; "" if none did. Valid until the next call. */
const char *dmk_context_message(const dmk_context *context);
/* fn may be NULL: no reports; user is handed to it. */
void dmk_context_set_progress(dmk_context *context, dmk_progress_fn fn, void *user);
/* Threads of the host's stages (reading, topology, ordering, coarsening, packing, geodesics, writing) in
 * the calls on this context, the caller's thread among them; 0, as at first: one for each processor the
 * process may use. They are started here, or by the first call that needs them. Results are the same bits
 * for any number. DMK_E_ARG if negative. How many the device uses is dmk_device_options.threads. */
int dmk_context_set_threads(dmk_context *context, int threads);
/* The format of files whose name has no suffix of one that can hold them: a name of dmk_format_get, in whatever case;
 * NULL, as at first: such names are refused, but for streams, which get VTP; with a name streams that it cannot hold
 * are refused. Streams are pipes, character devices as /dev/null, and open descriptors as /dev/stdout: they are
 * written as it comes, other files whole or not at all.
 * DMK_E_ARG for a name that is no format's, and for PVTP, which is several files. */
int dmk_context_set_format(dmk_context *context, const char *format);

/* ---- mesh ------------------------------------------------------------------------------------ */

typedef struct dmk_mesh dmk_mesh;

/* A point on a surface: barycentric weights (sum 1, >= 0) on the corners of a triangle. */
typedef struct dmk_point {
    int64_t triangle;
    double weight[3];
} dmk_point;

/* Copy xyz (3 per vertex) and triangles (3 vertex indices each) and check the topology.
 * Accepted: borders, unused vertices, several components. Refused with DMK_E_MESH, naming the first
 * offender: non-manifold edges or vertices, inconsistent orientation, degenerate triangles, NaN. */
int dmk_mesh_create(dmk_context *context, size_t n_vertices, const double *xyz, size_t n_triangles,
                    const int32_t *triangles, dmk_mesh **mesh);
/* The n_corners - 2 triangles of each of n_polygons polygons, which have n_corners corners each, as reading a file
 * splits them: around the first corner where those triangles lie side by side, as of convex ones, else so that
 * the thinnest is as thick as can be. DMK_E_ARG for less than 3 corners, DMK_E_MESH for vertices that do not exist and
 * for more than 1,000 corners of one that is not convex. */
int dmk_polygons_split(dmk_context *context, size_t n_vertices, const double *xyz,
                       size_t n_polygons, size_t n_corners, const int32_t *corners,
                       int32_t *triangles);
/* Read a mesh file; the format is recognised by its content, then its suffix. */
int dmk_mesh_read(dmk_context *context, const char *path, dmk_mesh **mesh);
/* Read the array `name`, one number for each, of the points of a VTP or VTU file, or where these have none of that
 * name of its faces, into the first *n of values; *of_points: which. DMK_E_FORMAT if there is none, or more than `room`
 * numbers. */
int dmk_array_read(dmk_context *context, const char *path, const char *name, size_t room,
                   double *values, size_t *n, int *of_points);
/* Write the bare mesh; the suffix chooses the format (see dmk_format_get, dmk_context_set_format). */
int dmk_mesh_write(dmk_context *context, const dmk_mesh *mesh, const char *path);
void dmk_mesh_destroy(dmk_mesh **mesh);

/* What a repair did, in numbers and as maps; handed back to dmk_repairs_free. */
typedef struct dmk_repairs {
    size_t merged_vertices;      /* that lay where another one does */
    size_t flipped_triangles;    /* without area, mended by a flip of the longest edge */
    size_t degenerate_triangles; /* dropped: a corner twice, or no area */
    size_t duplicate_triangles;  /* dropped: the same three corners as another one */
    size_t split_edges;          /* of more than two triangles */
    size_t turned_triangles;     /* to agree with their neighbours */
    size_t split_vertices;       /* vertices added, as triangles met in a vertex only */
    size_t n_old_vertices, n_vertices, n_triangles; /* lengths of the maps */
    int32_t *vertex_new; /* n_old_vertices: its new number; -1: it has gone */
    int32_t *vertex_old; /* n_vertices of the repaired mesh: the old number, the first of several */
    int32_t *triangle_old; /* n_triangles of it */
    size_t seam_edges;     /* of two triangles, cut open where the surface has one side only */
} dmk_repairs;

/* A mesh of triangles that dmk_mesh_create may refuse, repaired: coincident vertices, and the ends of
 * edges no longer than the rounding of their coordinates, become one; zero-area
 * triangles are flipped or dropped, duplicates dropped; at an edge of more than two triangles the pairs
 * that fit stay joined; triangles are oriented consistently; a surface with one side only is cut open along a
 * seam, and distances across that are not its own; vertices whose triangles share no edge are split. Other edges
 * of two triangles stay joined. repair: what was done, or NULL. DMK_E_MESH if a triangle names a vertex that does
 * not exist or is not finite, has a side too long or too short to compute with, or nothing is left. */
int dmk_mesh_repair(dmk_context *context, size_t n_vertices, const double *xyz, size_t n_triangles,
                    const int32_t *triangles, dmk_repairs *repair, dmk_mesh **mesh);
/* The same of a file. */
int dmk_mesh_read_repaired(dmk_context *context, const char *path, dmk_repairs *repair,
                           dmk_mesh **mesh);
void dmk_repairs_free(dmk_repairs *repair);

typedef struct dmk_mesh_info {
    size_t n_vertices, n_triangles, n_edges;
    size_t n_unused_vertices; /* in no triangle */
    size_t n_border_edges;    /* in one triangle only */
    size_t n_border_loops;    /* closed border curves */
    size_t n_components;      /* connected through edges */
    int64_t euler;            /* V - E + F over used vertices */
    double area;              /* sum of the triangles' areas */
    double mean_edge, min_edge, max_edge;
    double min_angle, max_angle; /* degrees, over all triangle corners */
    double box_min[3], box_max[3];
} dmk_mesh_info;

void dmk_mesh_get_info(const dmk_mesh *mesh, dmk_mesh_info *info);
/* Borrowed: 3*n_vertices coordinates, 3*n_triangles indices, in the input's order. */
const double *dmk_mesh_vertices(const dmk_mesh *mesh);
const int32_t *dmk_mesh_triangles(const dmk_mesh *mesh);
/* Borrowed: 2*n_edges vertex indices, the smaller first; the edges' order is that of the results'
 * midpoint arrays. */
const int32_t *dmk_mesh_edges(const dmk_mesh *mesh);
/* Give back what is not needed to write results: edges, their lengths and the triangles' areas, 56 bytes per triangle.
 * A solver that has put the mesh in order (dmk_solver_create without a device, of one component) solves on; results
 * are written, and cut loci and paths made of them. Solvers, geodesics and samples from then on are DMK_E_ARG, and
 * dmk_mesh_edges is NULL. */
void dmk_mesh_forget_edges(dmk_mesh *mesh);

/* The point of the surface nearest to xyz (in space). DMK_E_ARG for NaN or infinite xyz. */
int dmk_mesh_project(dmk_context *context, const dmk_mesh *mesh, const double xyz[3],
                     dmk_point *point);
/* The same for n_points at once, xyz[3 i ..] and points[i], in far less time for many: the message of a failure begins
 * with the number of the first point that failed. */
int dmk_mesh_project_all(dmk_context *context, const dmk_mesh *mesh, size_t n_points,
                         const double *xyz, dmk_point *points);
/* The place of vertex i as a point. DMK_E_ARG if i is out of range or in no triangle. */
int dmk_mesh_vertex_point(dmk_context *context, const dmk_mesh *mesh, int64_t vertex,
                          dmk_point *point);
/* The same by the number that the vertex had before a repair, which the message of a failure has, too. */
int dmk_repairs_vertex_point(dmk_context *context, const dmk_mesh *mesh, const dmk_repairs *repair,
                             int64_t vertex, dmk_point *point);
/* n vertices far from each other: `first`, then each time the vertex farthest from those before it (the
 * first of several), so that fewer samples are the beginning of more. Distances are along edges and across
 * pairs of triangles. Other components count as farthest of all; unused vertices are never taken. vertex:
 * room for n. DMK_E_ARG if n is above the number of vertices in triangles, or `first` is none of them. */
int dmk_mesh_sample(dmk_context *context, const dmk_mesh *mesh, size_t n, int64_t first,
                    int64_t *vertex);
/* xyz of a point. */
int dmk_mesh_point_xyz(dmk_context *context, const dmk_mesh *mesh, const dmk_point *point,
                       double xyz[3]);

/* ---- the built-in surfaces -------------------------------------------------------------------- */

/* Parameters of a built-in surface. `name` is one of dmk_surface_name(0..): "torus" (a: distance of
 * the tube's centre from the axis, b: tube radius), "ellipsoid" (semi-axes a, b, c), "quartic"
 * ((x/a)^4+(y/b)^4+(z/c)^4=1), "sphere" (radius a). A size left 0 takes the surface's default. */
typedef struct dmk_surface_options {
    size_t struct_size; /* by dmk_surface_options_init, as in all option structs */
    const char *name;
    double size[3];     /* a, b, c */
    size_t n_triangles; /* of the coarse mesh, roughly; 0 = the surface's default */
    int refine;         /* midpoint subdivisions, each new point lifted to the surface */
    int has_source; /* 1: `source` is lifted to the surface and made an exact vertex, number 0 */
    double source[3];
} dmk_surface_options;

/* Defaults; size: sizeof *options. */
void dmk_surface_options_init(dmk_surface_options *options, size_t size);
/* Name of a surface; NULL past the last one. */
const char *dmk_surface_name(size_t index);
/* What the sizes a, b, c mean, in a few words with the defaults. NULL past the last one. */
const char *dmk_surface_text(size_t index);
/* The mesh of a built-in surface: about options->n_triangles even triangles, then refined; where
 * a rim is so sharp that lifted points would fold the surface, as many even triangles made at once. */
int dmk_mesh_surface(dmk_context *context, const dmk_surface_options *options, dmk_mesh **mesh);

/* ---- devices ---------------------------------------------------------------------------------- */

typedef struct dmk_device_info {
    char name[128];
    char platform[128];
    char driver[64];
    char type[16]; /* "CPU", "GPU", "accelerator" */
    int compute_units;
    int fp64;        /* 1 if double precision is there */
    uint64_t memory; /* bytes */
} dmk_device_info;

/* What hwloc knows of the machine; zero where unknown. */
typedef struct dmk_machine_info {
    int packages, numa_nodes, cores, threads;
    uint64_t l1, l2, l3; /* bytes, of one cache each */
    uint64_t memory;     /* bytes */
} dmk_machine_info;

/* Fill up to `capacity` entries (NULL if that is 0); *count is the number there are. */
int dmk_device_list(dmk_context *context, dmk_device_info *infos, size_t capacity, size_t *count);
/* The machine's processors and memory. */
int dmk_machine_get_info(dmk_context *context, dmk_machine_info *info);

typedef struct dmk_device dmk_device;

/* How kernels split their work: long chunks per work-item, or one element per work-item. */
typedef enum dmk_shape { DMK_SHAPE_AUTO = 0, DMK_SHAPE_CPU = 1, DMK_SHAPE_GPU = 2 } dmk_shape;

typedef struct dmk_device_options {
    size_t struct_size;
    const char
        *select; /* NULL: the best, a GPU before a CPU, but with double precision before without;
                             "gpu", "cpu": the best of these; "N": number N of the list; else part of a
                             name; "" is an error */
    int single_precision; /* 1: use no double precision on the device even where it is there */
    int threads;          /* compute units to use on a CPU device; 0 = one per core */
    const char *
        cache; /* folder for kernel binaries, made if it is not there; NULL = the user's cache folder, "" = none */
    dmk_shape shape; /* DMK_SHAPE_AUTO: by the device's type */
    int in_background; /* 1: a thread of the device's own builds the kernels while the caller goes on; what is
                          wrong with them is reported by the first call that needs them. Needs
                          dmk_device_destroy before the process ends. */
} dmk_device_options;

void dmk_device_options_init(dmk_device_options *options, size_t size);
int dmk_device_open(dmk_context *context, const dmk_device_options *options, dmk_device **device);
/* How many devices are being looked for, opened, or have their kernels built in the background, in this process. For
 * handlers of signals: drivers that crash, or end the program, mostly do it then. */
int dmk_devices_opening(void);
/* What the list says of it. */
void dmk_device_get_info(const dmk_device *device, dmk_device_info *info);
void dmk_device_destroy(dmk_device **device);

/* ---- geodesic distance -------------------------------------------------------------------------- */

/* Exact geodesic distances on the polyhedron from any number of sources, by windows (Mitchell, Mount, Papadimitriou
 * 1987): for every vertex the length of the shortest path over the triangles, the nearest source, and how the path
 * leaves and arrives. Distance and direction together are the logarithmic map of a source. Needs no device. Around
 * spikes of 1 : 10,000 and more there may be too many paths: distances have estimates of their errors there; with
 * `exact` they are found up to 1 : 1e6 or so, in a time that grows with this, and beyond that is DMK_E_MESH. */
typedef struct dmk_geodesics dmk_geodesics;

typedef struct dmk_geodesics_options {
    size_t struct_size;
    const double *offset; /* n_sources: distance at each source, 0 or more; NULL = 0 */
    size_t n_lines; /* edges of the mesh that are sources as a whole, with every point of them */
    const int32_t *
        line; /* 2*n_lines: the vertices that each joins; all together are source number n_sources */
    int border;       /* 1: all border edges are lines, too */
    int exact;        /* 1: no error whatever the size; time then grows as n^1.5 on smooth meshes */
    double tolerance; /* relative error, <= 0.01; 0 = none up to 450,000 triangles, 1e-6 beyond */
} dmk_geodesics_options;

/* How the shortest path arrives at a vertex. Directions at a vertex count counterclockwise from the edge to the next
 * corner of the first triangle that has it, up to the total angle there: at a border from the clockwise-most edge. At a
 * source inside a triangle they count from the
 * direction to the triangle's first corner; on an edge, the one opposite corner k of the point's triangle, from
 * that to corner k+2.
 * With a tolerance directions have errors, too: at 1e-6 up to 2e-3 radians at the source and 6e-4 at the vertex at 99 %
 * of the vertices; they are not repaired. */
typedef struct dmk_arrival {
    double direction; /* at the source, radians; 0 at lines */
    double back;      /* at the vertex: direction back along the path, radians */
    int32_t
        pseudo_source; /* last vertex that the path bends at, or begins at on a line; -1: none, or merged ones */
    int32_t source; /* number of the nearest source; -1: no source reaches the vertex */
} dmk_arrival;

typedef struct dmk_geodesics_info {
    size_t n_reached; /* vertices */
    double farthest;  /* largest distance */
    double
        error; /* largest estimate of an error over its distance, no bound; 0: exact but for rounding */
    double tolerance; /* that was asked for, or the usual one beyond 450,000 triangles; 0: none */
    size_t n_beyond;  /* vertices whose estimate over their distance is above the tolerance */
    size_t n_windows; /* that were made */
} dmk_geodesics_info;

void dmk_geodesics_options_init(dmk_geodesics_options *options, size_t size);
/* From n_sources points (and the options' lines: one source at least). The mesh must outlive the object. Checked: every
 * vertex of a component with a source is reached, no edge is shorter than its ends' distances differ, and nothing is
 * negative; DMK_E_MESH, naming the first vertex, if rounding breaks that. DMK_E_ARG for points off the mesh, offsets
 * that are negative or not finite, or that leave a component without one below 1e9 times the mesh's extent, lines that
 * are no edge. */
int dmk_geodesics_create(dmk_context *context, const dmk_mesh *mesh, size_t n_sources,
                         const dmk_point *sources, const dmk_geodesics_options *options,
                         dmk_geodesics **geodesics);
void dmk_geodesics_destroy(dmk_geodesics **geodesics);

void dmk_geodesics_get_info(const dmk_geodesics *geodesics, dmk_geodesics_info *info);
/* Borrowed, one for each vertex of the mesh. */
const double *dmk_geodesics_distance(const dmk_geodesics *geodesics,
                                     size_t *n); /* infinite: not reached */
const dmk_arrival *dmk_geodesics_arrivals(const dmk_geodesics *geodesics, size_t *n);
/* Estimate of the error of each distance; NULL, n = 0, if all are exact. No bound: on smooth meshes hardly a vertex is
 * above it, on terrain of random heights 0.1 %, a few of these where it is near 0. With a tolerance they are
 * up to twice that, over the distance, and more only on needles and tubes, where too many ways are as short. */
const double *dmk_geodesics_error(const dmk_geodesics *geodesics, size_t *n);
/* The integral of the distance over the triangles that a source reaches, and an estimate of its quadrature's error. */
int dmk_geodesics_integrate(dmk_context *context, const dmk_geodesics *geodesics, double *integral,
                            double *error);
/* Write mesh and point data distance, direction (radians), nearest (number of the source): PLY, VTP, PVTP or VTU. */
int dmk_geodesics_write(dmk_context *context, const dmk_geodesics *geodesics, const char *path);

/* Distance, direction at the source and its number, of any point. */
typedef struct dmk_value {
    double distance; /* infinite, and source -1: no source is joined to it */
    double direction;
    int32_t source;
} dmk_value;

/* The same inside triangles: exact at any point, too (with merged windows: within their error), by a search back along
 * the path, a millisecond for each point on 50,000 triangles. */
int dmk_geodesics_at(dmk_context *context, const dmk_geodesics *geodesics, size_t n_points,
                     const dmk_point *points, dmk_value *values);

/* A minimal geodesic of the polyhedron, straight in every triangle. It may bend at vertices with
 * more than 2 pi around them, and at those of a border. */
typedef struct dmk_path {
    size_t n;
    dmk_point *point; /* n: the source, a point on each edge crossed and at each bend, the end */
    double length;    /* of the line through these points */
    double angle;     /* direction at the source, radians: as dmk_arrival.direction */
} dmk_path;

/* The minimal geodesics from the nearest source to n_points points, into paths[0..n_points), each handed back to
 * dmk_path_free. Where several are minimal, one of them. DMK_E_ARG if no source is joined to one. On failure nothing is
 * left in paths. */
int dmk_geodesics_paths(dmk_context *context, const dmk_geodesics *geodesics, size_t n_points,
                        const dmk_point *to, dmk_path *paths);
/* Frees its points and clears it; a cleared path is fine. */
void dmk_path_free(dmk_path *path);
/* One line, by the suffix: OBJ, VTP with the distance to the source, or CSV. */
int dmk_path_write(dmk_context *context, const dmk_mesh *mesh, const dmk_path *path,
                   const char *file);

/* ---- solver ----------------------------------------------------------------------------------- */

typedef enum dmk_method {
    DMK_NEWTON = 0,   /* inexact Newton in (u, log mu): the default */
    DMK_INERTIAL = 1, /* explicit steps in log mu with inertia */
    DMK_EULER = 2     /* explicit Euler with step dt: the paper's method */
} dmk_method;

typedef enum dmk_start {
    /* mu and u from the exact distance; on meshes of needles Newton's method starts from mu = 1 all the same */
    DMK_START_DISTANCE = 0,
    DMK_START_UNIFORM = 1 /* mu = 1 */
} dmk_start;

/* The tolerances are relative, and at most 1. */
typedef struct dmk_solve_options {
    size_t struct_size;
    dmk_method method;
    dmk_start start;
    double dt;            /* time step of DMK_EULER, in (0, 1]; 0 = 0.5 */
    double inertia;       /* beta of DMK_INERTIAL, in [0, 1); negative = 0.8, reached gradually */
    double tolerance;     /* on the relative change of mu per unit time; 0 = the method's default */
    double gap_tolerance; /* also stop when the certificate's relative gap is below; 0 = not used */
    double
        cg_tolerance; /* relative energy residual of the inner solves; 0 = the method's default */
    int max_steps;    /* of all attempts of Newton's method; 0 = the method's default */
    int normalise;    /* dmk_solve_measures: 1 scales the second measure to the mass of the first */
    double threshold; /* absolute bound of the approximate cut locus {mu <= eps}; 0 = a rule without
                             a tolerance to choose, see dmk_result_acl */
    int density_only; /* 1: dmk_solve gives density, potential and bounds of the cost, from mu = 1: no
                         distance (so no cut locus and no paths) and no approximate cut locus */
} dmk_solve_options;

void dmk_solve_options_init(dmk_solve_options *options, size_t size);

typedef struct dmk_solver dmk_solver;

/* Bytes, about, that a solve takes at most on a mesh of so many triangles; on a CPU device both come from
 * the host's memory. Meshes of needles take more: ask dmk_mesh_memory. A solve that cannot fit fails with
 * DMK_E_NOMEM before it starts. */
typedef struct dmk_memory {
    uint64_t host, device;
} dmk_memory;

void dmk_solve_memory(size_t n_triangles, int single_precision, dmk_memory *memory);
/* The same of this mesh. Where more than 2 % of the triangles are needles a solve in double precision takes up to 1,500
 * bytes a triangle more; after dmk_mesh_forget_edges that is not known, and not counted. */
void dmk_mesh_memory(const dmk_mesh *mesh, int single_precision, dmk_memory *memory);

/* A triangle with sides a >= b >= c is solved as if b + c - a were this part of a at least, unless that would be felt
 * in the area of the whole. Then single precision, in which the preconditioner works, can tell it from a degenerate
 * one, and a distance changes by a millionth of the sides it runs along at most. */
#define DMK_MOLLIFICATION 1e-6

/* A solver for many sources on one mesh: the first solve packs the mesh (the source's connected
 * component) for `device` and sets up its multigrid hierarchy, which the next ones find ready. Both
 * must outlive the solver. Without a device (NULL) it does now what needs none on a mesh of one component, so that
 * another thread can open the device meanwhile, and solves when it has one. */
int dmk_solver_create(dmk_context *context, dmk_device *device, const dmk_mesh *mesh,
                      dmk_solver **solver);
/* The device of a solver that has none yet. DMK_E_ARG if it has. */
int dmk_solver_set_device(dmk_context *context, dmk_solver *solver, dmk_device *device);
void dmk_solver_destroy(dmk_solver **solver);

typedef struct dmk_result dmk_result;

/* Solve for one source. Only the component that holds the source takes part; elsewhere mu is 0, the
 * distance infinite and u minus infinity. DMK_E_DIVERGED, DMK_E_LIMIT and DMK_E_CANCELLED give no result. */
int dmk_solve(dmk_context *context, dmk_solver *solver, const dmk_point *source,
              const dmk_solve_options *options, dmk_result **result);
void dmk_result_destroy(dmk_result **result);

/* Stages of dmk_stats.seconds. */
typedef enum dmk_stage {
    DMK_STAGE_READ = 0, /* file to mesh with topology */
    DMK_STAGE_DEVICE,   /* context, kernels */
    DMK_STAGE_SETUP,    /* first solve: ordering, hierarchy, packing */
    DMK_STAGE_DISTANCE, /* exact; with set-up under way each counts its part of the time */
    DMK_STAGE_START,    /* u and mu to start from */
    DMK_STAGE_SOLVE,    /* nonlinear iteration */
    DMK_STAGE_CERTIFY,  /* bounds of the cost */
    DMK_STAGE_LOCUS,
    DMK_N_STAGES
} dmk_stage;

enum { DMK_N_STEEP = 3 };

typedef struct dmk_stats {
    int steps;         /* nonlinear iterations */
    int cg_iterations; /* summed over all inner solves */
    int v_cycles;
    double change;     /* last relative change of mu per unit time */
    double cost_upper; /* upper bound of the optimal cost of the discrete problem */
    double cost_lower; /* lower bound: f.u of a feasible potential */
    double
        cost_exact; /* the optimal cost of the polyhedron itself, the integral of the exact distance: outside
                       the bounds by the discretisation; NaN after density_only and for measures */
    double cost_exact_error; /* of the quadrature of cost_exact, an estimate */
    double gap;              /* (upper - lower) / upper */
    int sweeps;              /* of the repair of u for the lower bound; 0 where none was needed */
    int64_t
        n_steep; /* triangles in which |grad u| <= 1 is still broken after it; 0: none, or no need */
    int64_t
        steep[DMK_N_STEEP]; /* the steepest of them, which hold the lower bound back; -1: no more */
    double area;            /* of the source's component */
    int levels;             /* of the multigrid hierarchy */
    int double_precision;   /* 1 if the nonlinear iteration ran in double precision */
    double seconds[DMK_N_STAGES];
} dmk_stats;

void dmk_result_get_stats(const dmk_result *result, dmk_stats *stats);
/* Borrowed arrays; each also gives its length through n when n is not NULL: 0 of an array that is NULL. */
const double *dmk_result_density(const dmk_result *result, size_t *n); /* mu per triangle */
/* Per triangle, 1 in the approximate cut locus: mu <= threshold, or, where that is 0, by u and mu in pure
 * numbers, an answer to the paper's question how to choose eps: the mean of grad u in the triangle is shorter
 * than 1, as where two families of rays meet (cos(alpha/2)), and the rays around converge, the more so the
 * larger the triangle is. Only triangles of the source's component. */
const uint8_t *dmk_result_acl(const dmk_result *result, size_t *n);
/* u per vertex, 0 at the source. */
const double *dmk_result_potential(const dmk_result *result, size_t *n);
/* u per edge midpoint. */
const double *dmk_result_potential_mid(const dmk_result *result, size_t *n);
/* The exact distance from the source (see dmk_geodesics), per vertex; -u differs from it by the discretisation.
 * NULL after density_only, and so is dmk_result_acl. */
const double *dmk_result_distance(const dmk_result *result, size_t *n);
/* As it was given; of NULL one in triangle -1. */
void dmk_result_source(const dmk_result *result, dmk_point *source);

/* What a result consists of, for storing it or sending it to another process: the arrays that the
 * accessors give, each for the whole mesh, the source and the stats. */
typedef struct dmk_result_data {
    const double *density, *potential, *potential_mid, *distance;
    const uint8_t *acl;
    dmk_point source;
    dmk_stats stats;
} dmk_result_data;

/* The result again, from copies of these arrays and the same mesh: for dmk_locus_compute,
 * dmk_path_compute, dmk_cut and dmk_result_write. Runs the geodesics anew, and needs no device. With distance and acl
 * NULL it is a result of density_only again. DMK_E_ARG if the source is no point of the mesh, or one of distance and
 * acl is NULL. */
int dmk_result_restore(dmk_context *context, const dmk_mesh *mesh, const dmk_result_data *data,
                       dmk_result **result);

/* ---- transport between measures ---------------------------------------------------------------- */

/* A measure on the surface: the sum of those parts that are given (all are 0 or NULL after = {0}). Masses are
 * of any unit. Borrowed for the call. */
typedef struct dmk_measure {
    const double
        *vertex_mass; /* n_vertices: a mass at each vertex, spread over the triangles around it
                                       as a piecewise linear density */
    const double *triangle_density; /* n_triangles: mass per area */
    size_t n_atoms;                 /* masses that sit in points */
    const dmk_point *atoms;
    const double
        *atom_mass; /* NULL: free, each takes what the other measure has nearest to it; then u is
                                       minus the distance to the nearest (plus, of the second measure), up to a
                                       constant, and mu vanishes on their cut locus; the measure has no other
                                       part then */
    size_t n_lines; /* polylines with mass along them: line k goes straight from point to point */
    const int32_t
        *line_first; /* of line_points[line_first[k] .. line_first[k + 1]), two or more; any two */
    const dmk_point *line_points; /* neighbours lie in one triangle, as those of dmk_path do */
    const double *line_density;   /* n_lines: mass per length; NULL: 1 */
    double uniform; /* a mass that is spread evenly over the component of the others */
} dmk_measure;

typedef struct dmk_transport dmk_transport;

typedef struct dmk_transport_info {
    double mass; /* that is moved */
    double
        balance; /* largest difference between what the flux delivers to a node of the mesh refined once and
                       what it should, over the largest such load: rounding, in double precision 1e-10 or less,
                       among needles more */
} dmk_transport_info;

/* Optimal transport from one measure to another at the cost of the distance: the earth mover's distance
 *     W1 = min of integral of |flux|,  div flux = from - to,
 * with its potential (|grad u| <= 1, falling along the way), density mu = |flux| and flux -mu grad u. `to` may
 * be NULL: then `from` is signed, its positive part moved to its negative part. Both must have the same mass, up
 * to 1e-12 of their sum, unless options->normalise; all of it on one component of the mesh. Refused with
 * DMK_E_ARG, naming the first: NaN, negative masses, mass at unused vertices or on another component, masses
 * that differ, or whose cost is beyond numbers. The bounds in dmk_stats are those of the discrete problem; they
 * enclose W1 on the surface up to the discretisation, of which atoms show most, being blunt by a part of an edge.
 * The solver keeps its hierarchy for the next pair. options: start and threshold are not used. Method: Facca,
 * Cardin, Putti, "Towards a stationary Monge-Kantorovich dynamics"; here by Newton steps from mu = const. */
int dmk_solve_measures(dmk_context *context, dmk_solver *solver, const dmk_measure *from,
                       const dmk_measure *to, const dmk_solve_options *options,
                       dmk_transport **transport);
/* What that refuses but masses that differ or are 0 in all, found at once and without a device. */
int dmk_measures_check(dmk_context *context, const dmk_mesh *mesh, const dmk_measure *from,
                       const dmk_measure *to);
void dmk_transport_destroy(dmk_transport **transport);
/* cost_upper and cost_lower are the bounds of W1, in mass times length. */
void dmk_transport_get_stats(const dmk_transport *transport, dmk_stats *stats);

void dmk_transport_get_info(const dmk_transport *transport, dmk_transport_info *info);
/* Borrowed, for the whole mesh, 0 off the component. Where nothing moves mu is not 0 but its floor, a fifth of the
 * square root of the triangle's part of the area times the mean of mu. */
const double *dmk_transport_density(const dmk_transport *transport,
                                    size_t *n); /* mu: mass per length, per triangle */
const double *dmk_transport_flux(const dmk_transport *transport,
                                 size_t *n); /* x, y, z: its mean in each triangle */
const double *dmk_transport_potential(const dmk_transport *transport,
                                      size_t *n); /* u per vertex, 0 at its largest */
const double *dmk_transport_potential_mid(const dmk_transport *transport,
                                          size_t *n); /* u per edge midpoint */
/* Of the measure whose atoms came without masses, those that they took; n = 0 where all had theirs. */
const double *dmk_transport_atom_mass(const dmk_transport *transport, size_t *n);
/* Where atoms came without masses: 1 in the approximate cut locus of their set, the borders of its Voronoi cells and
 * what the cells have inside, by dmk_result_acl's rule from u (all 0 where nothing moves); NULL, n = 0 where all
 * had theirs. */
const uint8_t *dmk_transport_acl(const dmk_transport *transport, size_t *n);
/* Write mesh, mu, flux, u and, if it is there, acl: PLY, VTP, PVTP or VTU. */
int dmk_transport_write(dmk_context *context, const dmk_mesh *mesh, const dmk_transport *transport,
                        const char *path);

/* ---- ranks: one mesh on many machines ---------------------------------------------------------- */

/* How a rank reaches the others, by MPI or anything else: collective calls (`exchange`, `gather`, `largest`, and, if
 * they are there, `begin` and `finish`), which give 0, DMK_E_CANCELLED to end the solve as if its progress callback
 * had asked for it, or another number on failure. All ranks make the same calls on the same mesh with the same
 * options; each has a device of its own, all of one kind. */
typedef struct dmk_ranks {
    int rank, size;       /* this one, and how many there are */
    int32_t gather_below; /* levels with fewer vertices are on every rank; 0 = 10,000 */
    void *user;
    /* For each rank k: send_bytes[k] bytes at send[k] go to it, receive_bytes[k] at receive[k] come
     * from it; nothing where they are 0, and never to itself. */
    int (*exchange)(void *user, const void *const *send, const size_t *send_bytes,
                    void *const *receive, const size_t *receive_bytes);
    /* all = what every rank has at `mine`, bytes[k] of rank k, in the order of the ranks. */
    int (*gather)(void *user, const void *mine, void *all, const size_t *bytes);
    /* Each of the n values becomes the largest of all ranks. */
    int (*largest)(void *user, int32_t *value, size_t n);
    /* exchange in two halves, or both NULL: what is sent and where it arrives stays as it is from `begin` to
     * `finish`, and nothing else is called in between; the device works on what no other rank reaches. */
    int (*begin)(void *user, const void *const *send, const size_t *send_bytes,
                 void *const *receive, const size_t *receive_bytes);
    int (*finish)(void *user);
} dmk_ranks;

/* What a rank has sent so far, and how its share of the mesh is cut. All 0 without ranks, and where the
 * mesh is too small to be dealt out (fewer than a launch's part of vertices for each rank). */
typedef struct dmk_traffic {
    int64_t own_rows, ghost_rows; /* unknowns that it owns, and those of others that it reads */
    int64_t exchanges;            /* of vectors over rows, vertices or links */
    int64_t overlapped;           /* those with work of the device meanwhile */
    int64_t messages, bytes;      /* sent in them */
    int64_t sums, sum_bytes;      /* sums over all ranks, and what this rank gave to them */
} dmk_traffic;

/* Before the first solve: deal the mesh out to ranks. dmk_solve is then collective, and every rank gets all of the
 * result, with the bits that one rank would compute, but for dmk_result_acl, which the first one has alone. The
 * distance is the first one's work, too, which the others get from it. NULL: this process has all of it. */
int dmk_solver_set_ranks(dmk_context *context, dmk_solver *solver, const dmk_ranks *ranks);
/* The solver takes its mesh over, *mesh becomes NULL, for one solve, which frees it as soon as it is in order. With
 * density_only on several ranks no rank then keeps more than its share of the mesh and 12 bytes per triangle; while it
 * is set up, some 200. */
int dmk_solver_give_mesh(dmk_context *context, dmk_solver *solver, dmk_mesh **mesh);
/* What this rank has sent so far. */
void dmk_solver_get_traffic(const dmk_solver *solver, dmk_traffic *traffic);
/* dmk_mesh_read by all ranks together, each of which has the mesh then. Of a binary PLY of triangles, and of a VTP of
 * one piece in appended raw data, each reads its range of the bytes; any other file is read by the first one, and
 * sent. The file must be the same everywhere, which is not looked at. DMK_E_DEVICE when a rank is lost. ranks NULL:
 * dmk_mesh_read. */
int dmk_mesh_read_dealt(dmk_context *context, const char *path, const dmk_ranks *ranks,
                        dmk_mesh **mesh);

/* A mesh of which no rank has more than a piece, for a density alone. All calls are collective, and what they give is
 * the same on every rank. */
typedef struct dmk_pieces dmk_pieces;
/* As dmk_mesh_create, of n_vertices and n_triangles in all: `xyz` and `triangles` are this rank's, which come behind
 * those of the ranks before; rank r's of n begin at n * r / size, rounded down. The ranks' calls must
 * last as long as the pieces, and what is made of them. */
int dmk_pieces_create(dmk_context *context, const dmk_ranks *ranks, int64_t n_vertices,
                      const double *xyz, int64_t n_triangles, const int64_t *triangles,
                      dmk_pieces **pieces);
/* As dmk_mesh_read. Each rank reads its range of a file as dmk_mesh_read_dealt does. Of any other file, and with
 * less than two ranks, *pieces becomes NULL, and it is to be read by that. */
int dmk_pieces_read(dmk_context *context, const char *path, const dmk_ranks *ranks,
                    dmk_pieces **pieces);
void dmk_pieces_destroy(dmk_pieces **pieces);
/* What dmk_mesh_get_info gives for the whole, to the bit. Not collective. */
void dmk_pieces_get_info(const dmk_pieces *pieces, dmk_mesh_info *info);
/* The file's vertices and triangles once more, to write the result with: not checked again but for their counts, else
 * DMK_E_FORMAT, with the `info` that the pieces had. It is a mesh as after dmk_mesh_forget_edges, of one component
 * whatever the info says. Not collective. */
int dmk_mesh_read_known(dmk_context *context, const char *path, const dmk_mesh_info *info,
                        dmk_mesh **mesh);
/* As dmk_mesh_vertex_point and dmk_mesh_project. */
int dmk_pieces_vertex_point(dmk_context *context, const dmk_pieces *pieces, int64_t vertex,
                            dmk_point *point);
int dmk_pieces_project(dmk_context *context, const dmk_pieces *pieces, const double xyz[3],
                       dmk_point *point);
/* The solver takes the pieces over, *pieces becomes NULL, for one solve with density_only. Each rank then orders and
 * coarsens its share; the first one alone gets the result's arrays. A component too small to be dealt out is
 * gathered on every rank. */
int dmk_solver_create_of_pieces(dmk_context *context, dmk_device *device, dmk_pieces **pieces,
                                dmk_solver **solver);

/* ---- cut locus -------------------------------------------------------------------------------- */

typedef struct dmk_locus dmk_locus;

typedef struct dmk_locus_options {
    size_t struct_size;
    double
        strength; /* a length: leave out branches of less strength; 0 = the default, 0.2 mean edges,
                        or 2.2 times that of the mesh's own branches where these stand
                        apart from the rest; dmk_locus_info says which */
} dmk_locus_options;

typedef enum dmk_locus_kind {
    DMK_LOCUS_ORDINARY = 0,
    DMK_LOCUS_END = 1,
    DMK_LOCUS_BRANCH = 2,
    DMK_LOCUS_POINT = 3 /* the whole locus is this point */
} dmk_locus_kind;

/* A vertex of the cut locus' graph.
 *
 * The excess of a point of the locus is by how much a path to it must grow to be moved over the locus'
 * end from one of its two shortest paths to the other, the largest d(x) + l(x, c) - d(c) over the points x
 * of the branch behind it: the integral of 1 - cos(alpha / 2) along the branch from its end, alpha being the
 * angle at which the two shortest paths meet, and of 1 + cos(alpha / 2) where d falls on the way, as down a spike
 * or a finger from its tip. That counts on branches of an excess of a mean edge or more, and where others join
 * these, and there from 0.2 mean edges on: on a mesh's own branches d rises and falls by chance.
 * Where alpha is less than 0.126 radians, so that the mesh hardly
 * shows where the line is, a branch loses: its strength is the integral of 1 - cos(alpha / 2) - 0.002, not less
 * than 0 on the way, from its end to where it joins a stronger one. It is infinite on loops and on lines between
 * borders. All points of a branch have its strength: with a larger `strength` asked
 * for whole branches go, and nothing else changes. */
typedef struct dmk_locus_vertex {
    double xyz[3];
    dmk_point place; /* on the input mesh */
    double distance; /* to the source, of the shorter family: tenths of an edge off place's */
    double mu;       /* density of the triangle it lies in */
    double strength; /* a length: that of its strongest edge */
    double angle
        [2]; /* directions at p of the two outermost minimal geodesics, radians; of one source scaled so that
                        a full turn is 2 pi, as dmk_arrival.direction at a vertex is not */
    int32_t kind;         /* dmk_locus_kind */
    int32_t degree;       /* edges: 3 at most but where branches meet at a vertex of the mesh */
    double meeting_angle; /* between the minimal geodesics where they meet here, radians, 0 to pi */
    /* Between them at p, radians, a full turn being 2 pi, at a source on the border up to the angle there; pi between
     * two sources. */
    double source_angle;
    int32_t source[2]; /* numbers of the sources that they come from */
} dmk_locus_vertex;

typedef struct dmk_locus_edge {
    int32_t vertex[2];
    double strength; /* that of its branch, a length */
} dmk_locus_edge;

typedef struct dmk_locus_info {
    double length;
    double strength; /* that was asked for, or the default: a length */
    size_t n_vertices, n_edges, n_polylines;
    int64_t loops; /* first Betti number */
    size_t components;
    size_t endpoints, branch_points;
} dmk_locus_info;

/* The cut locus as a graph on the surface, from a result's geodesics: where shortest paths of the polyhedron
 * from two sides meet. Every edge runs inside one triangle, and has a length. Connected with first Betti number 2g on
 * a closed surface of genus g; with borders, once each border is contracted to a point, where lines end on it: one that
 * passes by a border at a vertex of the mesh is not joined to it there. */
int dmk_locus_compute(dmk_context *context, const dmk_mesh *mesh, const dmk_result *result,
                      const dmk_locus_options *options, dmk_locus **locus);
/* Rank `from`'s cut locus to all ranks, which call this together: *locus is there on that one, and new on the others.
 * DMK_E_DEVICE when a rank is lost; the locus is not to be used then. */
int dmk_locus_spread(dmk_context *context, const dmk_ranks *ranks, int from, dmk_locus **locus);
/* The cut locus of all the geodesics' sources as one set: the points that have several shortest paths to it. Where
 * these lead to two sources, the borders between the cells of points with the same nearest source (Voronoi diagram),
 * with infinite strength; within a cell its source's own, with a strength as for one source. Between any two vertices
 * with another nearest source the locus crosses the edge. With k sources, each nearest to some vertex next to it, its
 * first Betti number is 2g + k - 1. mu is 0. On a mesh of several components that of the one with the sources, as if it
 * were alone. DMK_E_ARG for geodesics from lines or a border, and for sources on two components. */
int dmk_geodesics_locus(dmk_context *context, const dmk_geodesics *geodesics,
                        const dmk_locus_options *options, dmk_locus **locus);

void dmk_locus_options_init(dmk_locus_options *options, size_t size);
void dmk_locus_destroy(dmk_locus **locus);
void dmk_locus_get_info(const dmk_locus *locus, dmk_locus_info *info);
const dmk_locus_vertex *dmk_locus_vertices(const dmk_locus *locus, size_t *n);
const dmk_locus_edge *dmk_locus_edges(const dmk_locus *locus, size_t *n);
/* Polylines between branch and end points: polyline k is vertices index[offset[k]..offset[k+1]). */
const int32_t *dmk_locus_polylines(const dmk_locus *locus, const int32_t **offset, size_t *n);
/* OBJ with l lines (p for a single point), VTP lines with point data, or CSV, by the suffix. */
int dmk_locus_write(dmk_context *context, const dmk_locus *locus, const char *path);

/* ---- minimal geodesics, and the surface cut open ---------------------------------------------- */

/* The minimal geodesics from the result's source to n_points points of its component, into
 * paths[0..n_points), each handed back to dmk_path_free. Where several are minimal, one of them. On
 * failure nothing is left in paths. */
int dmk_path_compute(dmk_context *context, const dmk_mesh *mesh, const dmk_result *result,
                     size_t n_points, const dmk_point *to, dmk_path *paths);

/* The component of the source cut open along its cut locus: a disk, with one border loop and Euler
 * characteristic 1. Triangles that the locus crosses are split, so that it runs along edges; its
 * points are vertices once for each side, and keep 0.15 of an edge from the edge's ends, so that no
 * slivers are created. Edges are bisected before where the locus is traced on finer triangles: on a mesh of fewer than
 * 5,000, which has some 2,000 to 5,000 then, and where a tenth of all length is in edges of more than four mean ones. A
 * locus that crosses fewer than three edges of a sphere becomes a slit of two edges of the mesh itself, at the farthest
 * vertex; a disk without a cut locus stays as it is. The mesh begins with the component's vertices in the
 * input's order. *origin (NULL: not wanted) gives for each vertex of the
 * cut mesh the vertex of the geodesics' mesh at the same place, or -1 for new points; freed with free().
 * *plane (NULL: not wanted): 2 coordinates for each vertex of the cut mesh, the logarithmic map, that is the
 * distance times the direction at the source (a full turn is 2 pi, as in dmk_locus_vertex.angle), on the locus' two
 * sides each its own; freed with free(). Directions are
 * those of the exact paths, but of vertices that the cut leaves on the other side than that which theirs come by, and
 * around triangles that would turn over or be flat in the plane, as behind saddle vertices of the polyhedron: there
 * they are averaged over neighbours, or such that these triangles lie the right way round. Some stay on scans, and
 * around a slit, where few vertices stand around the whole circle and the sides between them dip below the next ring
 * (on a sphere of 1,280 triangles 24). Distances are exact at vertices of that mesh; at new points they are those of
 * the nearest corner's family on that side, some 0.1 mean edges short where a saddle vertex keeps it from the point.
 * *locus (NULL: not wanted): the cut locus itself, as dmk_geodesics_locus has it, which need not be traced twice then.
 * DMK_E_ARG as there, and for geodesics from several sources. Needs no device. */
int dmk_geodesics_cut(dmk_context *context, const dmk_geodesics *geodesics,
                      const dmk_locus_options *options, dmk_mesh **cut, int32_t **origin,
                      double **plane, dmk_locus **locus);
/* The same by a result's geodesics. Where the first cut locus of the result was traced with the same strength it is
 * not traced again. */
int dmk_cut(dmk_context *context, const dmk_mesh *mesh, const dmk_result *result,
            const dmk_locus_options *options, dmk_mesh **cut, int32_t **origin, double **plane);
/* Write a cut mesh with its plane coordinates: OBJ with them as vt, VTP with them as the point array `plane`,
 * by the suffix; other mesh formats leave them out. */
int dmk_cut_write(dmk_context *context, const dmk_mesh *cut, const double *plane, const char *path);
/* How many of the cut mesh's triangles lie the other way round, or are degenerate, in the plane. */
size_t dmk_cut_flipped(const dmk_mesh *cut, const double *plane);

/* ---- files ------------------------------------------------------------------------------------ */

/* Write mesh, mu, acl, u, distance: PLY, VTP, PVTP or VTU by the suffix. Written under a temporary name, then
 * renamed: the file is whole or not there. */
int dmk_result_write(dmk_context *context, const dmk_mesh *mesh, const dmk_result *result,
                     const char *path);

typedef struct dmk_format_info {
    const char *name;     /* "OFF" */
    const char *suffixes; /* ".off" or several, blank-separated */
    int reads_mesh, writes_mesh, writes_result, writes_locus;
} dmk_format_info;

/* 0 and *info for index 0, 1, ...; DMK_E_ARG past the last. */
int dmk_format_get(size_t index, dmk_format_info *info);

#ifdef __cplusplus
}
#endif
#endif
