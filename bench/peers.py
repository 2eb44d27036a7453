"""One run of a peer: read the OFF file, set up, one solve. usage: peers.py PEER MESH.off VERTEX

peers.py compare MESH.off VERTEX FILE.ply prints the largest difference of `dmkcl distance`'s file from pygeodesic, over the
largest distance.
"""
import sys

peer, path, vertex = sys.argv[1], sys.argv[2], int(sys.argv[3])
import potpourri3d as pp3d

V, F = pp3d.read_mesh(path)
if peer == "heat_robust":
    d = pp3d.MeshHeatMethodDistanceSolver(V, F).compute_distance(vertex)
elif peer == "heat_plain":
    d = pp3d.MeshHeatMethodDistanceSolver(V, F, use_robust=False).compute_distance(vertex)
elif peer == "fast_marching":
    d = pp3d.MeshFastMarchingDistanceSolver(V, F).compute_distance([[(vertex, [])]])
elif peer in ("exact", "compare"):
    import numpy as np
    from pygeodesic import geodesic

    d, _ = geodesic.PyGeodesicAlgorithmExact(V, F).geodesicDistances(np.array([vertex]), None)
else:
    sys.exit(f"no peer {peer}")
assert len(d) == len(V)
if peer == "compare":
    with open(sys.argv[4]) as f:
        while f.readline().strip() != "end_header":
            pass
        own = np.loadtxt(f, usecols=3, max_rows=len(V))
    ok = np.isfinite(own)
    print(np.abs(own - d)[ok].max() / own[ok].max())
