"""Meshes of trimesh and meshio go in as they are; results go back to trimesh and PyVista."""

import meshio
import trimesh

import dmkcl

# From trimesh: any of its meshes.
ring = trimesh.creation.torus(2, 1, major_sections=96, minor_sections=48)
result = dmkcl.CutLocus(ring).solve(vertex=0)
print("torus of trimesh:", result.locus)

# And back: densities are attributes of the faces, distances of the vertices.
coloured = result.to_trimesh()
print("farthest vertex:", coloured.vertex_attributes["distance"].max())

# From meshio: plane cells of all kinds; quads are split.
ring.export("ring.ply")
result = dmkcl.CutLocus(meshio.read("ring.ply")).solve(vertex=0)
print("the same of meshio, in the single precision of trimesh's PLY:", result.locus)

# A file name does as well, of whatever the library, meshio or trimesh reads.
result = dmkcl.CutLocus("ring.ply").solve(vertex=0)

# To PyVista, with named arrays; the locus as lines.
data, lines = result.to_pyvista(), result.locus.to_pyvista()
data.save("ring.vtp")
print("arrays for PyVista:", data.array_names, "and", lines.array_names)
