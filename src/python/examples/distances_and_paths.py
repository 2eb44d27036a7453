"""Distances and shortest paths, with the calls that potpourri3d has."""

import numpy as np

import dmkcl

V, F = dmkcl.surfaces.quartic(n_triangles=20000)

# As potpourri3d.MeshHeatMethodDistanceSolver: made once, asked often.
solver = dmkcl.CutLocus(V, F)
print("farthest from vertex 0:", solver.distance(0).max())
print("farthest from three vertices:", solver.distance(sources=[0, 500, 900]).max())
print("from a point inside a triangle:", solver.distance(point=(0.3, 0.2, 1)).max())

# As potpourri3d.EdgeFlipGeodesicSolver.find_geodesic_path.
line = solver.shortest_path(0, 900)
steps = np.linalg.norm(np.diff(line, axis=0), axis=1)
print(f"shortest path: {len(line)} points, length {steps.sum():.6g}")

# Many paths from one source: solve once.
result = solver.solve(vertex=0)
for vertex in (100, 500, 900):
    path = result.path(vertex=vertex)
    leaves = np.degrees(path.angle)
    print(f"to vertex {vertex}: length {path.length:.6g}, it leaves at {leaves:.1f} degrees")

# One call, where nothing is to be kept.
assert np.allclose(dmkcl.distance(V, F, 0), result.distance)
