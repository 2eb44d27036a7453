"""Transport between measures on a surface: W1 with its bounds, the flux, distances of many measures."""

import numpy as np

import dmkcl

mesh = dmkcl.surfaces.torus(2, 1)
solver = dmkcl.CutLocus(mesh)


def blob(x, y, z):
    """A bump of mass 1 around a point."""
    square = ((mesh.vertices - [x, y, z]) ** 2).sum(axis=1)
    mass = np.exp(-square / 0.3)
    return mass / mass.sum()


# From one side of the torus to the other: half of it goes each way around.
moved = solver.transport(blob(3, 0, 0), blob(-3, 0, 0), normalise=True)
print(f"W1 between {moved.lower:.5f} and {moved.upper:.5f}, mass balance {moved.balance:.0e}")
print(f"largest density {moved.density.max():.3f} of mass 1 per length")
moved.write("transport.vtp")  # mu, flux (arrows, stream lines) and u for ParaView

# Three points of equal mass share the surface evenly.
points = [[3, 0, 0], [-2, 0, 1], [0, -3, 0]]
whole = dmkcl.Measure(uniform=1.0)
shares = solver.transport(dmkcl.Measure(points=points), whole, normalise=True)
print(f"to three points of equal mass: {shares.w1:.4f}")

# Each point of the surface goes to the nearest of the three: u is minus the distance to the set.
nearest = solver.transport(dmkcl.Measure(points=points, masses="free"), whole, normalise=True)
print(f"to the nearest of three points: {nearest.w1:.4f}, shares {nearest.atom_mass.round(3)}")

# Distances of measures, pair by pair, with one hierarchy.
angles = np.linspace(0, np.pi, 4)
bumps = [blob(3 * np.cos(a), 3 * np.sin(a), 0) for a in angles]
print(np.array2string(solver.w1_matrix(bumps, normalise=True), precision=3))
