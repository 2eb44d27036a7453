"""Cut a surface open along a cut locus: the seam is as far from the chosen point as can be."""

import numpy as np

import dmkcl

torus = dmkcl.surfaces.torus(refine=1)
geodesics = dmkcl.Geodesics(torus, point=(3, 0, 0))
vertices, faces, origin = geodesics.cut_open()

disk = dmkcl.Mesh(vertices, faces)
print("before:", torus)
print("after: ", disk)
disk.write("disk.obj")

# Values at the vertices go along; those on the seam are new.
distance = np.where(origin >= 0, geodesics.distance[origin], np.nan)
print(f"{np.isnan(distance).sum()} vertices on the two sides of the seam")
