"""Many sources on one surface: mesh, device and hierarchy are made ready once."""

import numpy as np

import dmkcl

solver = dmkcl.CutLocus(dmkcl.surfaces.torus(2, 1))
angles = np.linspace(0, np.pi, 7)
points = np.column_stack([2 + np.cos(angles), 0 * angles, np.sin(angles)])

print("on the tube at   cost       length    branch points")
for angle, result in zip(angles, solver.solve_many(points=points)):
    print(
        f"{np.degrees(angle):8.0f} degrees  {result.certificate.upper:8.3f}  "
        f"{result.locus.length:8.4f}  {result.locus.branch_points:6d}"
    )
