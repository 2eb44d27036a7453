"""Solving: the arrays, against known surfaces and against themselves."""

import copy
import gc
import inspect
import pickle
import re
import sys

import numpy as np
import pytest

import dmkcl
from dmkcl import _result


def test_certificate_holds_the_torus_cost(result):
    c = result.certificate
    assert c.lower <= c.upper and c.gap == pytest.approx((c.upper - c.lower) / c.upper)
    assert c.gap < 5e-3
    assert c.upper == pytest.approx(321.4165, rel=5e-3)  # of the smooth torus


def test_shapes_types_and_signs(torus, result):
    n, m, e = (torus.info[k] for k in ("n_vertices", "n_triangles", "n_edges"))
    shapes = dict(
        density=(m,),
        acl=(m,),
        potential=(n,),
        distance=(n,),
        potential_mid=(e,),
        gradient=(m, 3),
    )
    for name, shape in shapes.items():
        array = getattr(result, name)
        assert array.shape == shape and not array.flags.writeable, name
        assert array.dtype == (bool if name == "acl" else np.float64), name
    assert (result.density >= 0).all() and 0 < result.acl.sum() < m / 5
    assert result.distance[0] == 0 == result.potential[0]
    # The distance is that of the polyhedron, the potential the transport's: apart by a part of an edge.
    assert np.abs(result.potential + result.distance).max() < torus.info["mean_edge"]


def test_distance_on_a_sphere():
    sphere = dmkcl.surfaces.sphere(n_triangles=5000, source=(0, 0, 1))
    result = dmkcl.CutLocus(sphere).solve(vertex=0)
    exact = np.arccos(np.clip(sphere.vertices[:, 2], -1, 1))
    assert np.abs(result.distance - exact).max() < sphere.info["mean_edge"]
    assert (result.locus.kind == 3).all() and result.locus.vertices[0, 2] < -0.99


def test_gradient_is_the_mean_of_the_four_triangles(torus, result):
    """On each quarter of a triangle the distance is linear: solve for its slope there."""
    rng = np.random.default_rng(1)
    for t in rng.integers(len(torus.faces), size=20):
        x = torus.vertices[torus.faces[t]]
        middle = np.array([(x[1] + x[2]) / 2, (x[2] + x[0]) / 2, (x[0] + x[1]) / 2])
        d = -result.potential[torus.faces[t]]
        d_mid = -result.potential_mid[torus.face_edges[t]]
        quarters = [
            ([x[0], middle[2], middle[1]], [d[0], d_mid[2], d_mid[1]]),
            ([x[1], middle[0], middle[2]], [d[1], d_mid[0], d_mid[2]]),
            ([x[2], middle[1], middle[0]], [d[2], d_mid[1], d_mid[0]]),
            (middle, d_mid),
        ]
        slopes = []
        for corners, values in quarters:
            side = np.array([corners[1] - corners[0], corners[2] - corners[0]])
            rise = np.array([values[1] - values[0], values[2] - values[0]])
            slopes.append(np.linalg.pinv(side) @ rise)
        assert np.allclose(result.gradient[t], np.mean(slopes, axis=0), atol=1e-9)


def test_gradient_has_length_one_away_from_the_locus(result):
    length = np.linalg.norm(result.gradient, axis=1)
    assert length.max() < 1.01 and abs(np.median(length) - 1) < 1e-2


def test_gradient_of_caps_is_bounded():
    """A cap of 1e-5 of its longest side is solved as a thicker one: by its own height u is 50 times too steep."""
    n = 8
    x = [[i, j, 0] for j in range(n + 1) for i in range(n + 1)]
    faces = [[a, a + 1, a + n + 2] for j in range(n) for a in range(j * (n + 1), j * (n + 1) + n)]
    faces += [[a, c, c - 1] for a, _, c in faces]
    a, b, c = faces[36]
    x.append([x[a][0] + 0.5, x[a][1] + 1e-5, 0])
    faces[36] = [a, b, len(x) - 1]
    faces += [[b, c, len(x) - 1], [c, a, len(x) - 1]]
    mesh = dmkcl.Mesh(np.array(x, float), np.array(faces, np.int32))
    length = np.linalg.norm(dmkcl.CutLocus(mesh).solve(vertex=0).gradient, axis=1)
    assert length.max() < 1.01 and length.min() > 0.5
    # The cap that is as flat as the solver leaves it: half and twice of what its sides are longer by.
    for longer, slope in ((0.7e-6, 1), (1.4e-6, 5)):
        height = np.sqrt((1 + longer) ** 2 - 1) / 2
        steep = np.array([[0.0, 5, 0]])
        _result._limit_caps(np.array([[[0, 0, 0], [1, 0, 0], [0.5, height, 0]]]), steep)
        assert np.allclose(steep, [[0, slope, 0]])


def test_the_same_source_three_ways(torus, solver, result):
    face = int(np.flatnonzero((torus.faces == 0).any(axis=1))[0])
    bary = (torus.faces[face] == 0).astype(float)
    for where in ({"face": face, "bary": bary}, {"point": (3, 0, 0)}):
        other = solver.solve(**where)
        assert np.allclose(other.distance, result.distance, atol=1e-9)
        assert np.allclose(other.source.xyz, (3, 0, 0))


def test_directions_at_a_corner():
    """Around the corner of a cube 3 pi / 2: to that go the directions of paths and distances; those of the cut locus,
    of the tangent cut locus and of the plane go to 2 pi."""
    corner = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)], float)
    sides = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    V, F, n = [], [], 16
    for side in sides:
        a, b, c, d = corner[list(side)]
        u, v = (w.ravel()[:, None] / n for w in np.meshgrid(range(n + 1), range(n + 1)))
        at = sum(map(len, V))
        V.append((1 - v) * ((1 - u) * a + u * b) + v * ((1 - u) * d + u * c))
        i = at + (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
        F.append(np.vstack([np.array([i, i + 1, i + n + 2]).T, np.array([i, i + n + 2, i + n + 1]).T]))
    cube = dmkcl.repair(np.vstack(V), np.vstack(F)).mesh
    assert cube.info["euler"] == 2 and cube.info["area"] == pytest.approx(6)
    source = int(np.flatnonzero((cube.vertices == 0).all(axis=1))[0])
    result, at = dmkcl.CutLocus(cube).solve(vertex=source), dmkcl.Geodesics(cube, source)
    around = 3 * np.pi / 2
    assert 0.95 * around < at.direction.max() < around
    near = np.flatnonzero((0 < at.distance) & (at.distance < 0.7))  # one path, the same for both
    angles = [result.path(vertex=int(v)).angle for v in near]
    assert np.allclose(angles, at.direction[near], atol=1e-9)
    for scaled in result.locus.angle, result.tangent.angle:
        assert around < scaled.max() < 2 * np.pi
    cut = result.cut_open()
    where = np.searchsorted(cut.origin[cut.origin >= 0], near)
    plane = at.distance[near, None] * np.column_stack(
        [np.cos(at.direction[near] * 4 / 3), np.sin(at.direction[near] * 4 / 3)]
    )
    assert np.allclose(cut.plane[where], plane, atol=1e-6)


def test_arrays_outlive_everything():
    solver = dmkcl.CutLocus(dmkcl.surfaces.sphere(n_triangles=1300))
    result = solver.solve(vertex=3)
    density, copy = result.density, result.density.copy()
    locus = result.locus
    del solver, result
    gc.collect()
    dmkcl.CutLocus(dmkcl.surfaces.sphere(n_triangles=1300)).solve(vertex=4)
    assert np.array_equal(density, copy)
    steps = np.diff(locus.vertices[locus.edges], axis=1)
    assert np.linalg.norm(steps, axis=2).sum() == pytest.approx(locus.length)


@pytest.mark.filterwarnings("ignore:the mesh is in 2 pieces")
def test_other_components_are_told_apart(small):
    V, F = small
    two = dmkcl.CutLocus(np.vstack([V, V + [5, 0, 0]]), np.vstack([F, F + len(V)]))
    first, second = two.solve(vertex=0), two.solve(vertex=len(V))
    assert np.isfinite(first.distance[: len(V)]).all() and np.isinf(first.distance[len(V) :]).all()
    assert (first.density[len(F) :] == 0).all() and np.isnan(first.gradient[len(F) :]).all()
    assert np.isfinite(first.gradient[: len(F)]).all()
    assert np.allclose(first.distance[: len(V)], second.distance[len(V) :], atol=1e-9)


def test_points_far_off_the_surface_are_warned_of(solver, recwarn):
    mesh, far, near = solver.mesh, (30, 0, 0), (3.01, 0, 0)
    words = r"^\(30, 0, 0\) is 27 away from the surface; its nearest point \(3, .*\) is taken"
    unit = dmkcl.Measure(uniform=1)

    def ask(p):
        yield lambda: solver.solve(point=p)
        yield lambda: list(solver.solve_many(points=[p]))
        yield lambda: list(dmkcl.solve_meshes([mesh], source=p))
        yield lambda: dmkcl.Geodesics(mesh, point=p)
        yield lambda: dmkcl.Geodesics(mesh, vertex=0).at([p])
        yield lambda: dmkcl.distance(mesh, points=[p])
        yield lambda: dmkcl.Geodesics(mesh, 0).path(point=p)
        yield lambda: solver.shortest_path(5, p)
        yield lambda: solver.transport(dmkcl.Measure(points=[p]), unit)

    edge = mesh.info["mean_edge"]
    for away, warned in ((0.9, 0), (1.1, 1)):
        recwarn.clear()
        solver.solve(point=(3 + away * edge, 0, 0))
        assert len(recwarn) == warned, away
    recwarn.clear()
    for call in ask(near):
        call()
    assert not recwarn
    for call in ask(far):
        with pytest.warns(UserWarning, match=words) as warned:
            call()
        assert len(warned) == 1 and warned[0].filename == __file__
    with pytest.warns(UserWarning, match=words + ", and so are those of 2 more such points"):
        dmkcl.Geodesics(mesh, points=[near, far, (0, 0, 9), (0, 0, -9)])


def test_solve_many(solver, result):
    found = list(solver.solve_many(vertices=[0, 5, 9]))
    assert np.array_equal(found[0].density, result.density)
    assert np.array_equal(found[2].distance, solver.solve(vertex=9).distance)
    at = next(solver.solve_many(points=[(3, 0, 0), (0, 3, 0)]))
    assert np.allclose(at.distance, result.distance, atol=1e-9)
    assert len(list(solver.solve_many(faces=[3, 4], bary=np.full((2, 3), 1 / 3)))) == 2


@pytest.mark.parametrize(
    "sources",
    [
        {},
        {"vertices": [0], "points": [(1, 0, 0)]},
        {"vertices": [-1]},
        {"points": (1, 0, 0)},
        {"faces": [0, 1], "bary": [(1, 0, 0)]},
        {"faces": [0], "bary": 3},
        {"faces": [0], "bary": [(1, 0)]},
        {"points": [(1, 0, 0), (1, 0)]},
    ],
)
def test_solve_many_checks_at_once(solver, sources):
    with pytest.raises(dmkcl.ArgumentError):
        solver.solve_many(**sources)


@pytest.mark.parametrize("method", ["newton", "inertial", "euler"])
def test_methods_agree(small, method):
    solver = dmkcl.CutLocus(small)
    c = solver.solve(vertex=0, method=method, tolerance=1e-3, max_steps=5000).certificate
    assert c.upper == pytest.approx(solver.solve(vertex=0).certificate.upper, rel=1e-2)


def test_single_precision(small, result):
    stats = dmkcl.CutLocus(small, single=True).solve(vertex=0).stats
    assert stats["double_precision"] == 0 and result.stats["double_precision"] == 1


def test_history(solver):
    with pytest.warns(UserWarning, match="the gap is .* above the 1e-12 that was asked for") as warned:
        found = solver.solve(vertex=0, gap=1e-12, tolerance=1e-3)
    assert warned[0].filename == __file__
    history = found.history
    assert np.array_equal(history["step"], np.arange(1, found.stats["steps"] + 1))
    assert history["cg_iterations"].sum() <= found.stats["cg_iterations"]
    assert history["change"][-1] == found.stats["change"] <= history["tolerance"][-1] * 1.0000001
    assert history["gap"][-1] == found.certificate.gap and np.isfinite(history["gap"]).all()
    assert (np.diff(history["seconds"]) > 0).all()
    assert len(solver.solve(vertex=0).history) > 0


def test_errors_have_their_classes(small):
    solver = dmkcl.CutLocus(small)
    with pytest.raises(dmkcl.StepLimitError, match="raise max_steps or tolerance"):
        solver.solve(vertex=0, max_steps=1)
    with pytest.raises(dmkcl.ArgumentError, match="dt"):
        solver.solve(vertex=0, dt=7)
    for method in ("magic", ["newton"]):
        with pytest.raises(dmkcl.ArgumentError, match="one of newton"):
            solver.solve(vertex=0, method=method)
    with pytest.raises(TypeError):
        solver.solve(vertex=0, no_such_option=1)
    with pytest.raises(dmkcl.DeviceError):
        dmkcl.CutLocus(small, device="no such device")
    assert solver.solve(vertex=0).certificate.gap < 0.1


@pytest.mark.parametrize("device", [[0], True, 0.0, "cpu\0gpu", "\udcff", {"name": "cpu"}])
def test_devices_of_a_wrong_kind(small, device):
    with pytest.raises(dmkcl.ArgumentError, match="expected a number of devices.. or part of a name"):
        dmkcl.CutLocus(small, device=device)


def test_devices():
    found = dmkcl.devices()
    assert found and found[0]["compute_units"] > 0
    solver = dmkcl.CutLocus(dmkcl.surfaces.sphere(n_triangles=800), device=0)
    assert solver.device["name"] == found[0]["name"]


# ---- locus, tangent, paths, cuts ------------------------------------------------------------


def test_locus(torus, result):
    locus = result.locus
    assert (locus.loops, locus.components, locus.endpoints) == (2, 1, 2)
    assert 2 <= locus.branch_points <= 4
    assert locus.length == pytest.approx(4 * np.pi + 2 * np.pi * (3 - 3**0.5), rel=5e-3)
    k = len(locus.vertices)
    for name in ("faces", "distance", "mu", "strength", "meeting_angle", "source_angle", "kind", "degree"):
        assert getattr(locus, name).shape == (k,), name
    assert locus.bary.shape == (k, 3) and locus.angle.shape == (k, 2)
    on_mesh = np.einsum("ij,ijk->ik", locus.bary, torus.vertices[torus.faces[locus.faces]])
    assert np.allclose(on_mesh, locus.vertices)
    ends = locus.vertices[locus.edges]
    assert np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).sum() == pytest.approx(locus.length)
    assert np.array_equal(np.bincount(locus.edges.ravel(), minlength=k), locus.degree)
    assert (locus.strength[locus.kind != 1] > 0).all() and len(locus.edge_strength) == len(
        locus.edges
    )


def test_polylines_are_the_edges(result):
    locus = result.locus
    pairs = [tuple(sorted(pair)) for line in locus.polylines for pair in zip(line[:-1], line[1:])]
    assert sorted(pairs) == sorted(tuple(sorted(edge)) for edge in locus.edges.tolist())


def test_strength(solver):
    full = solver.solve(vertex=0).locus
    least = 2 * np.sort(full.edge_strength)[len(full.edges) // 4]
    kept = full.edge_strength >= least
    locus = solver.solve(vertex=0, strength=least).locus
    assert len(locus.edges) == kept.sum() and locus.least_strength == least
    lengths = np.linalg.norm(np.diff(full.vertices[full.edges], axis=1)[:, 0], axis=1)
    assert locus.length == pytest.approx(lengths[kept].sum())


def test_tangent(result):
    angle, time, vertex = result.tangent
    assert len(angle) == 2 * len(result.locus.vertices)
    assert (np.diff(angle) >= 0).all() and angle[0] >= 0 and angle[-1] < 2 * np.pi
    assert np.array_equal(time, result.locus.distance[vertex])
    # The nearest point of the cut locus is half around the tube.
    assert time.min() == pytest.approx(np.pi, abs=2e-2)
    assert time.max() == pytest.approx(result.locus.distance.max())


def test_path(torus, result):
    path = result.path(vertex=100)
    assert np.allclose(path.points[0], (3, 0, 0)) and np.allclose(
        path.points[-1], torus.vertices[100]
    )
    steps = np.linalg.norm(np.diff(path.points, axis=0), axis=1)
    assert steps.sum() == pytest.approx(path.length)
    assert path.length == pytest.approx(result.distance[100], abs=torus.info["mean_edge"])
    assert len(path.faces) == len(path.bary) == len(path.points)
    assert 0 <= path.angle < 2 * np.pi + 1e-9


def test_cut_open(torus, result):
    vertices, faces, origin = result.cut_open()
    info = dmkcl.Mesh(vertices, faces).info
    assert (info["euler"], info["n_border_loops"], info["n_components"]) == (1, 1, 1)
    assert info["area"] == pytest.approx(torus.info["area"])
    old = origin >= 0
    assert np.array_equal(vertices[old], torus.vertices[origin[old]]) and (~old).any()
    radius = np.linalg.norm(result.cut_open().plane, axis=1)
    assert np.allclose(radius[old], result.distance[origin[old]])


def test_functions_like_those_of_potpourri3d(torus, result):
    V, F = torus
    assert np.array_equal(dmkcl.distance(V, F, 0), result.distance)
    at = dmkcl.CutLocus(V, F)
    both = at.distance(sources=[0, 7])
    assert np.allclose(both, np.minimum(result.distance, at.distance(7)))
    assert np.allclose(at.distance(point=(3, 0, 0)), result.distance, atol=1e-9)
    edge = torus.edges[5]
    for given in (dict(vertex=7), dict(vertices=[0, 7]), dict(curve=edge), dict(curve=edge, vertex=7)):
        assert np.array_equal(at.distance(**given), dmkcl.distance(V, F, **given)), given
    path = dmkcl.shortest_path(V, F, 0, 100)
    assert np.allclose(path, result.path(vertex=100).points)
    assert np.allclose(dmkcl.shortest_path(V, F, V[0], V[100])[-1], V[100])
    cut, same = dmkcl.cut_open(V, F, 0), result.cut_open()
    n = len(V)
    assert np.array_equal(cut.origin[:n], same.origin[:n])
    assert np.allclose(np.linalg.norm(cut.plane[:n], axis=1), result.distance)
    assert (len(cut.vertices), len(cut.faces)) == (len(same.vertices), len(same.faces))
    assert np.array_equal(dmkcl.Geodesics(torus, 0).cut_open().faces, cut.faces)
    with pytest.raises(dmkcl.ArgumentError, match="of 2 sources parts the surface"):
        dmkcl.Geodesics(torus, sources=[0, 7]).cut_open()
    with pytest.raises(dmkcl.ArgumentError):
        at.shortest_path([1, 2], 3)
    with pytest.raises(dmkcl.ArgumentError):
        at.distance(1.5)


# ---- out --------------------------------------------------------------------------------------


def test_write(tmp_path, torus, result):
    pyvista = pytest.importorskip("pyvista")
    result.write(tmp_path / "torus.vtu")
    back = pyvista.read(tmp_path / "torus.vtu")
    assert np.array_equal(back.points, torus.vertices)
    assert np.array_equal(back.cell_data["mu"], result.density)
    assert np.array_equal(back.point_data["distance"], result.distance)
    result.locus.write(tmp_path / "locus.obj")
    torus.write(tmp_path / "mesh.ply")
    assert (tmp_path / "locus.obj").stat().st_size > 0
    again = dmkcl.read(tmp_path / "mesh.ply")
    assert np.array_equal(again.vertices, torus.vertices) and np.array_equal(
        again.faces, torus.faces
    )
    with pytest.raises(dmkcl.FileError, match="no-such-folder") as raised:
        result.write(tmp_path / "no-such-folder" / "x.vtp")
    assert isinstance(raised.value, OSError)


def test_to_pyvista(result):
    pytest.importorskip("pyvista")
    data = result.to_pyvista()
    assert np.array_equal(data.cell_data["mu"], result.density)
    assert np.array_equal(data.point_data["distance"], result.distance)
    lines = result.locus.to_pyvista()
    assert lines.n_points == len(result.locus.vertices) and lines.n_lines == len(
        result.locus.polylines
    )
    assert lines.length > 0 and "strength" in lines.point_data


def test_to_trimesh(result, tmp_path):
    pytest.importorskip("trimesh")
    mesh = result.to_trimesh()
    mesh.export(tmp_path / "mesh.ply")
    assert np.array_equal(mesh.face_attributes["mu"], result.density)
    assert np.array_equal(mesh.vertex_attributes["distance"], result.distance)


def test_printed_forms(solver, result):
    assert "source (3, 0, 0), cost 3" in repr(result) and len(repr(result)) < 90
    assert "1 component, 2 loops, 2 ends, " in repr(result.locus) and "CutLocus" in repr(solver)
    assert repr(result.path(vertex=9)).startswith("<dmkcl.Path: ") and len(repr(result.path(vertex=9))) < 60
    assert re.fullmatch(r"<dmkcl.Cut: \d+ vertices, \d+ triangles>", repr(result.cut_open()))
    assert re.fullmatch(r"<dmkcl.Tangent: \d+ directions>", repr(result.tangent))
    kept = pickle.loads(pickle.dumps((result.cut_open(), result.tangent, result.certificate)))
    assert np.array_equal(kept[0].plane, result.cut_open().plane) and kept[2] == result.certificate


def test_results_pickle_and_copy(result, tmp_path):
    again = pickle.loads(pickle.dumps(result))
    for name in ("density", "acl", "potential", "distance", "gradient"):
        assert np.array_equal(getattr(again, name), getattr(result, name)), name
        assert not getattr(again, name).flags.writeable
    assert again.stats == result.stats and again.source == result.source
    assert again.history.tobytes() == result.history.tobytes()
    assert again.path(vertex=900).length == result.path(vertex=900).length
    assert again.locus.length == result.locus.length
    result.write(tmp_path / "a.vtp")
    again.write(tmp_path / "b.vtp")
    assert (tmp_path / "a.vtp").read_bytes() == (tmp_path / "b.vtp").read_bytes()
    assert copy.deepcopy(result).density is result.density
    # What was pickled holds no more than its arrays.
    assert len(pickle.dumps(result)) < 1.3 * (
        sum(getattr(result, n).nbytes for n in ("density", "potential", "potential_mid"))
        + result.distance.nbytes + result.acl.nbytes
        + result.mesh.vertices.nbytes + result.mesh.faces.nbytes
    )
    pickle.loads(pickle.dumps(result.path(vertex=5)))


def test_locus_pickles(result, tmp_path):
    locus = pickle.loads(pickle.dumps(result.locus))
    assert np.array_equal(locus.vertices, result.locus.vertices)
    assert len(locus.polylines) == len(result.locus.polylines)


def test_copies_of_a_locus_are_written_as_it_is(result, tmp_path):
    locus = result.locus
    locus.write(tmp_path / "a.csv")
    for other, shared in (copy.copy(locus), True), (copy.deepcopy(locus), False):
        other.write(tmp_path / "b.csv")
        assert (tmp_path / "a.csv").read_bytes() == (tmp_path / "b.csv").read_bytes()
        assert other.loops == locus.loops and np.array_equal(other.vertices, locus.vertices)
        assert np.shares_memory(other.vertices, locus.vertices) == shared


def test_density_only(solver, result, tmp_path):
    lean = solver.solve(vertex=0, density_only=True)
    assert lean.certificate.lower < result.certificate.upper * 1.001
    assert result.certificate.lower < lean.certificate.upper * 1.001
    assert np.abs(lean.potential - result.potential).max() < 0.01 * -result.potential.min()
    for again in (lean, pickle.loads(pickle.dumps(lean))):
        assert np.array_equal(again.density, lean.density)
        for name in ("distance", "acl"):
            with pytest.raises(dmkcl.ArgumentError, match=f"density_only has no {name}"):
                getattr(again, name)
        for ask in (lambda r: r.locus, lambda r: r.path(vertex=5), lambda r: r.cut_open()):
            with pytest.raises(dmkcl.ArgumentError, match="density_only"):
                ask(again)
    for suffix in (".vtp", ".vtu", ".ply", ".pvtp"):
        lean.write(tmp_path / f"lean{suffix}")
        pickle.loads(pickle.dumps(lean)).write(tmp_path / f"again{suffix}")
        names = ("lean_0000.vtp", "again_0000.vtp") if suffix == ".pvtp" else (f"lean{suffix}", f"again{suffix}")
        assert (tmp_path / names[0]).read_bytes() == (tmp_path / names[1]).read_bytes()
    assert "mu" in lean.to_pyvista().cell_data and "distance" not in lean.to_pyvista().point_data
    assert set(lean.to_trimesh().vertex_attributes) == {"u"}
    assert [r.density.size for r in solver.solve_many(vertices=[0, 3], density_only=True)] == [lean.density.size] * 2


def test_unknown_options_are_errors(solver):
    with pytest.raises(TypeError, match="tolerence"):
        solver.solve(vertex=0, tolerence=1e-3)
    with pytest.raises(TypeError, match="max_step"):
        solver.solve_many(vertices=[0], max_step=3)
    with pytest.raises(TypeError, match="tolerence"):
        dmkcl.solve_meshes([], tolerence=1e-3)
    with pytest.raises(dmkcl.ArgumentError, match="'oiler'"):
        dmkcl.solve_meshes([], method="oiler")


def test_all_options_have_names():
    """No function takes arguments that its signature does not name: typos are errors, editors list what there is."""
    public = [getattr(dmkcl, name) for name in dmkcl.__all__]
    methods = [f for c in public if inspect.isclass(c) for f in vars(c).values() if inspect.isfunction(f)]
    functions = [f for f in public if inspect.isfunction(f)] + list(vars(dmkcl.surfaces).values())
    asked = {f for f in [*methods, *functions] if inspect.isfunction(f) and f.__module__.startswith("dmkcl")}
    asked = {f for f in asked if not f.__name__.startswith("__") or f.__name__ == "__init__"}
    assert {dmkcl.solve_meshes, dmkcl.CutLocus.solve, dmkcl.Result.plot, dmkcl.surfaces.torus} < asked
    for f in asked:
        kinds = {p.kind for p in inspect.signature(f).parameters.values()}
        assert not kinds & {inspect.Parameter.VAR_KEYWORD, inspect.Parameter.VAR_POSITIONAL}, f


@pytest.mark.parametrize(
    "call, words",
    [
        (lambda s: s.solve(vertex=1.7), "vertex = 1.7: expected a whole number"),
        (lambda s: s.solve(vertex=True), "vertex = True: expected a whole number"),
        (lambda s: s.solve(vertex="1"), "vertex = '1': expected a whole number"),
        (lambda s: s.solve(vertex=[1, 2]), "expected a whole number"),
        (lambda s: s.solve(face=0.5), "face = 0.5: expected a whole number"),
        (lambda s: s.solve(vertex=0, progress="no"), "progress = 'no'"),
        (lambda s: s.solve_many(vertices=[0], progress="no"), "progress = 'no'"),
        (lambda s: s.solve(vertex=0, density_only="no"), "density_only = 'no'"),
        (lambda s: s.solve(vertex=0, dt=0.3), 'dt = 0.3: only method="euler"'),
        (lambda s: s.solve(vertex=0, inertia=0.0), 'inertia = 0.0: only method="inertial"'),
        (lambda s: s.solve(vertex=0, density_only=True, threshold=1), "leave out threshold and strength"),
        (lambda s: s.solve_many(vertices=[0], density_only=True, strength=1), "leave out threshold and strength"),
        (lambda s: dmkcl.solve_meshes([s.mesh], density_only=True, strength=1), "leave out threshold and strength"),
        (lambda s: s.solve(vertex=0).view(height=0), "height = 0: expected a number above 0"),
        (lambda s: s.solve(face=0, bary=(0, 0, 0)), "bary = (0, 0, 0): expected three finite weights, none negative, not all 0"),
        (lambda s: s.solve_many(points=s.mesh.at_vertex(3)), "one point; expected several, as in a list: [point]"),
        (lambda s: s.transport(np.zeros(len(s.mesh.vertices)), normalise=True), "normalise scales b, which is not given"),
        (lambda s: s.solve_many(vertices=3), "vertices = 3: expected several"),
        (lambda s: s.solve_many(vertices=[1.5]), "expected a whole number"),
        (lambda s: dmkcl.distance(s.mesh, 17), "source=17, not 17"),
        (lambda s: dmkcl.distance("mesh.off", 17), "source=17, not 17"),
        (lambda s: dmkcl.cut_open(s.mesh.to_trimesh(), 17), "source=17, not 17"),
        (lambda s: dmkcl.distance(s.mesh, sources=3), "given as source=3"),
        (lambda s: dmkcl.distance(s.mesh, vertices=3), "given as vertex=3"),
        (lambda s: dmkcl.Geodesics(s.mesh, curve=[0, 1.5]), "curve = 1.5"),
        (lambda s: dmkcl.CutLocus(s.mesh, threads=1.5), "threads = 1.5"),
        (lambda s: dmkcl.CutLocus(s.mesh, single="no"), "single = 'no'"),
        (lambda s: s.solve(vertex=10**20), "expected a number of 32 bits"),
        (lambda s: s.solve(vertex=0, gap=-1), "gap = -1: expected a number from 0 to 1"),
        (lambda s: s.solve(vertex=0, gap=1.1), "gap = 1.1: expected a number from 0 to 1"),
        (lambda s: s.solve(vertex=0, tolerance="1"), "tolerance = '1': expected a number from 0 to 1"),
        (lambda s: s.solve(vertex=0, tolerance=2), "tolerance = 2: expected a number from 0 to 1"),
        (lambda s: s.solve(vertex=0, cg_tolerance=2), "cg_tolerance = 2: expected a number from 0 to 1"),
        (lambda s: s.transport(np.ones(3), tolerance=2), "tolerance = 2: expected a number from 0 to 1"),
        (lambda s: s.solve(vertex=0, max_steps=2.5), "max_steps = 2.5: expected a whole number"),
        (lambda s: s.solve(vertex=0, strength=-1), "strength = -1: expected a finite number from 0"),
        (lambda s: s.solve_many(vertices=[0], strength=np.inf), "strength = inf"),
        (lambda s: dmkcl.solve_meshes([s.mesh], strength=1j), "strength = 1j"),
        (lambda s: s.solve(vertex=0, method="inertial", inertia=-0.5), "inertia = -0.5"),
        (lambda s: dmkcl.Geodesics(s.mesh, 0).locus(strength="x"), "strength = 'x'"),
        (lambda s: dmkcl.Geodesics(s.mesh, 0, offsets=["x"]), "offsets are of type <U1"),
        (lambda s: s.solve(point=(1, 2j, 0)), "coordinates of a point are of type complex128"),
        (lambda s: dmkcl.surfaces.torus(n_triangles=1.5e4), "n_triangles = 15000.0: expected a whole number"),
        (lambda s: dmkcl.surfaces.torus(n_triangles=-4), "n_triangles = -4"),
        (lambda s: dmkcl.surfaces.torus(0), "R = 0: expected a finite number above 0"),
        (lambda s: dmkcl.surfaces.torus(-1), "R = -1: expected a finite number above 0"),
        (lambda s: dmkcl.read(""), "'': expected the name of a file"),
        (lambda s: dmkcl.repair(""), "'': expected the name of a file"),
        (lambda s: dmkcl.repair(s.mesh, s.mesh.faces), "a mesh has its faces"),
        (lambda s: dmkcl.repair("a.off", s.mesh.faces), "a mesh has its faces"),
        (lambda s: dmkcl.surfaces.torus(1, 2), "the tube radius r must be smaller than R,"),
        (lambda s: dmkcl.surfaces.torus(1, 1e-7), "size r of the torus is 1e-07"),
        (lambda s: dmkcl.surfaces.torus(n_triangles=0), "n_triangles = 0: expected a number above 0"),
        (lambda s: dmkcl.CutLocus(s.mesh, device=""), "device = '': expected a number of devices()"),
        (lambda s: s.transport(np.ones(len(s.mesh.vertices)), dmkcl.Measure(uniform=1)), "normalise=True"),
        (lambda s: dmkcl.surfaces.torus(refine="1"), "refine = '1'"),
        (lambda s: dmkcl.surfaces.torus(source=(3, 0)), "source has the shape (2,)"),
    ],
)
def test_arguments_mean_one_thing(solver, call, words):
    with pytest.raises(dmkcl.ArgumentError, match=re.escape(words)):
        call(solver)


def test_many_meshes(small, tmp_path):
    small.write(tmp_path / "a.off")
    bad = tmp_path / "bad.off"
    bad.write_text("no mesh")
    asked = []

    def meshes():
        for mesh in (tmp_path / "a.off", bad, small):
            asked.append(mesh)
            yield mesh

    found = dmkcl.solve_meshes(meshes(), source=5, on_error="yield")
    assert asked == []
    first = next(found)
    assert len(asked) == 1
    wanted = dmkcl.CutLocus(small).solve(vertex=5)
    assert np.array_equal(first.distance, wanted.distance)
    error, last = found
    assert isinstance(error, dmkcl.FormatError) and "bad.off" in str(error)
    assert np.array_equal(last.density, wanted.density)


def test_many_meshes_with_errors(small, tmp_path):
    missing, failed = tmp_path / "missing.off", []
    small.write(tmp_path / "small.off")
    with pytest.raises(dmkcl.ArgumentError, match="small.off: vertex 1000000"):
        next(dmkcl.solve_meshes([tmp_path / "small.off"], source=10**6))
    found = dmkcl.solve_meshes([small, missing, small])
    next(found)
    with pytest.raises(dmkcl.FileError, match="missing.off"):
        next(found)
    kept = dmkcl.solve_meshes([missing, small], on_error=lambda mesh, e: failed.append((mesh, e)))
    assert len(list(kept)) == 1
    assert failed[0][0] == missing and isinstance(failed[0][1], dmkcl.FileError)
    wrong = (dict(on_error="skip"), dict(on_error=np.zeros(2)), dict(source="x"))
    for bad in (*wrong, dict(meshes=str(missing)), dict(meshes=None), dict(meshes=5)):
        with pytest.raises(dmkcl.ArgumentError):
            dmkcl.solve_meshes(**{"meshes": [small], **bad})


@pytest.mark.parametrize(
    "package, call",
    [
        ("pyvista", lambda result: result.plot(show=False)),
        ("pyvista", lambda result: result.mesh.to_pyvista()),
        ("pyvista", lambda result: result.locus.to_pyvista()),
        ("matplotlib", lambda result: result.plot_tangent()),
        ("matplotlib", lambda result: result.plot_history()),
        ("matplotlib", lambda result: result.plot(show=False)),
        ("trimesh", lambda result: result.mesh.to_trimesh()),
        ("tqdm", lambda result: dmkcl.CutLocus(result.mesh).solve(vertex=0, progress=True)),
        ("tqdm", lambda result: list(dmkcl.CutLocus(result.mesh).solve_many(vertices=[0], progress=True))),
        ("tqdm", lambda result: dmkcl.CutLocus(result.mesh).w1_matrix([], progress=True)),
    ],
)
def test_a_missing_package_is_named(monkeypatch, result, package, call):
    for name in [m for m in sys.modules if m.partition(".")[0] == package]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(ImportError, match=rf"needs {package}, .* pip install {package}$"):
        call(result)
