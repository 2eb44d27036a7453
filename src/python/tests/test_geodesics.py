import copy
import pickle

import dmkcl
import numpy as np
import pytest


@pytest.fixture(scope="module")
def plane():
    """A square of 20 by 20, on which distances are known."""
    x, y = np.meshgrid(np.arange(21.0), np.arange(21.0))
    V = np.column_stack([x.ravel(), y.ravel()])
    corner = (np.arange(20)[:, None] * 21 + np.arange(20)).ravel()
    F = np.vstack([corner + [[0], [1], [22]] for _ in range(1)]).T.reshape(-1, 3)
    F = np.vstack([F, (corner + np.array([[0], [22], [21]])).T])
    return dmkcl.Mesh(V, F)


def test_one_source(plane):
    at = dmkcl.Geodesics(plane, 0)
    xy = plane.vertices[:, :2]
    assert np.allclose(at.distance, np.hypot(*xy.T))
    assert (at.nearest == 0).all() and at.info["error"] == 0
    turn = np.arctan2(xy[1:, 1], xy[1:, 0])
    assert np.allclose(at.direction[1:], turn, atol=1e-9)
    assert np.allclose(at.log_map[1:], xy[1:], atol=1e-9)
    assert "1 source," in repr(at)
    path = at.path(point=(3.3, 4.4, 0))
    assert np.isclose(path.length, 5.5) and np.allclose(path.points[-1], (3.3, 4.4, 0))
    distance, direction = at.at([(3.3, 4.4, 0), (6, 0, 0)])
    assert np.allclose(distance, [5.5, 6]) and np.allclose(direction, [np.arctan2(4, 3), 0])
    assert not at.distance.flags.writeable


def test_directions_count_from_where_they_are_said_to():
    """The edge to the next corner of the first triangle with the vertex, in triangles of any order and first corner."""
    V, F = dmkcl.surfaces.torus(n_triangles=800)
    chance = np.random.default_rng(4)
    F = np.array([np.roll(face, chance.integers(3)) for face in chance.permutation(F)])
    mesh = dmkcl.Mesh(V, F)
    for vertex in chance.integers(len(V), size=20):
        row = F[np.flatnonzero((F == vertex).any(axis=1))[0]].tolist()
        first, second = (row[(row.index(vertex) + k) % 3] for k in (1, 2))
        at = dmkcl.Geodesics(mesh, int(vertex))
        assert at.direction[first] == 0 < at.direction[second] < np.pi
        assert at.path(vertex=first).angle == 0
    at = dmkcl.Geodesics(mesh, mesh.at_face(7))
    assert at.direction[F[7, 0]] == pytest.approx(0, abs=1e-9)
    for k in range(3):
        at = dmkcl.Geodesics(mesh, mesh.at_face(7, np.roll([0, 0.4, 0.6], k)))
        assert at.direction[F[7, (k + 2) % 3]] == pytest.approx(0, abs=1e-9)


def test_arguments_of_a_wrong_kind(plane):
    point = plane.at_face(3)
    wrong = [
        (dict(curve=5), "curve = 5: expected several"),
        (dict(vertex=7, curve=[5]), r"curve = \[5\]: expected two vertices or more"),
        (dict(curve=[0, 1, 440]), r"^curve\[1:3\]: no edge joins vertices 1 and 440"),
        (dict(curve=[0, 500]), r"^curve\[0:2\]: vertex 500 is out of range"),
        (dict(), "no source: one point, curve or border at least"),
        (dict(vertices=[0, 1], offsets=[[0], [1]]), r"offsets have the shape \(2, 1\)"),
        (dict(source=point._replace(face=1.5)), "expected a triangle's number and three weights"),
        (dict(source=point._replace(face=2**70)), "expected a triangle's number and three weights"),
        (dict(source=point._replace(bary=(0.5, 0.5))), "expected a triangle's number and three weights"),
        (dict(points=point), "one point; expected several"),
        (dict(vertex=0, tolerance=True), "tolerance = True"),
        (dict(vertex=0, tolerance=b"0.1"), "tolerance = b'0.1'"),
        (dict(vertex=0, tolerance=2), "tolerance = 2: expected 0 to 0.01"),
        (dict(vertex=0, tolerance=1e-6, exact=True), "tolerance = 1e-06, but exact=True allows no error"),
    ]
    for given, text in wrong:
        with pytest.raises(dmkcl.ArgumentError, match=text):
            dmkcl.Geodesics(plane, **given)
    with pytest.raises(dmkcl.ArgumentError, match="expected a vertex number or a point x, y, z"):
        dmkcl.shortest_path(plane, None, [1, [2]], 5)
    assert np.array_equal(dmkcl.distance(plane, vertex=3, points=[]), dmkcl.distance(plane, vertex=3))
    by_numpy = point._replace(face=np.int32(3), bary=np.array(point.bary))
    assert np.array_equal(dmkcl.distance(plane, None, by_numpy), dmkcl.distance(plane, None, point))


def test_a_point_of_a_mesh_is_a_place(plane):
    start, end = plane.at_face(3), plane.nearest((7.2, 3.4, 0))
    path = dmkcl.Geodesics(plane, start).path(point=end)
    assert np.allclose(path.points[-1], end.xyz) and plane.place(point=end) == end
    both = dmkcl.Geodesics(plane, points=[end, start, (7.2, 3.4, 0)])
    assert both.sources == [end, start, end]
    assert np.allclose(both.at([start, start.xyz])[0], 0) and both.at(end)[0] == 0
    assert np.array_equal(dmkcl.shortest_path(plane, None, start, end), path.points)


def test_many_sources_curves_and_borders(plane, tmp_path):
    xy = plane.vertices[:, :2]
    at = dmkcl.Geodesics(plane, sources=[0, 440], offsets=[0, 1])
    two = np.column_stack([np.hypot(*xy.T), 1 + np.hypot(*(xy - 20).T)])
    assert np.allclose(at.distance, two.min(axis=1))
    clear = np.abs(two[:, 0] - two[:, 1]) > 1e-9
    assert np.array_equal(at.nearest[clear], two.argmin(axis=1)[clear])
    line = dmkcl.Geodesics(plane, curve=np.arange(21))
    assert np.allclose(line.distance, xy[:, 1])
    border = dmkcl.Geodesics(plane, border=True)
    assert np.allclose(border.distance, np.minimum(xy, 20 - xy).min(axis=1))
    inside = dmkcl.Geodesics(plane, point=(3.3, 4.4, 0))
    assert np.allclose(inside.distance, np.hypot(*(xy - (3.3, 4.4)).T))
    at.write(tmp_path / "at.vtp")
    assert (tmp_path / "at.vtp").stat().st_size > 1000


def test_a_border_that_is_not_there_is_warned_of(plane, small, recwarn):
    dmkcl.distance(plane, vertex=0, border=True)
    assert not recwarn
    with pytest.warns(UserWarning, match="^the mesh is closed, and has no border that border=True could take$"):
        found = dmkcl.distance(small, vertex=0, border=True)
    assert np.array_equal(found, dmkcl.distance(small, vertex=0))


def test_as_functions(plane):
    V, F = plane
    d = dmkcl.distance(V, F, 17)
    assert np.array_equal(d, dmkcl.Geodesics(plane, 17).distance)
    assert np.array_equal(d, dmkcl.distance(plane, vertex=17))
    assert np.allclose(dmkcl.distance(plane, points=[(0, 0, 0), (20, 20, 0)])[[0, 440]], 0)
    assert np.allclose(dmkcl.distance(plane, vertices=[0, 440])[[0, 440]], 0)
    for several in np.array([7, 9]), np.array([7, 9], np.uint8), (7, 9), range(7, 10, 2):
        found = dmkcl.distance(plane, vertex=5, vertices=several)
        assert np.flatnonzero(found == 0).tolist() == [5, 7, 9]
    assert np.allclose(dmkcl.distance(plane, curve=[0, 1, 2])[:3], 0)
    assert np.allclose(dmkcl.distance(plane, border=True)[[0, 440]], 0)
    path = dmkcl.shortest_path(V, F, 0, (3, 4, 0))
    assert np.allclose(np.linalg.norm(np.diff(path, axis=0), axis=1).sum(), 5)


def test_shortest_paths_of_all_that_is_a_mesh(plane):
    V, F = plane
    found = dmkcl.shortest_path(V, F, 17, 99)
    for start, end in (17, 99), (V[17], plane.at_vertex(99)):
        for mesh in plane, (V, F), [V, F]:
            assert np.allclose(dmkcl.shortest_path(mesh, start, end), found)
            assert np.allclose(dmkcl.shortest_path(mesh, start, end=end), found)
            assert np.allclose(dmkcl.shortest_path(mesh, start=start, end=end), found)
            assert np.allclose(dmkcl.shortest_path(mesh, None, start, end), found)
        assert np.allclose(dmkcl.shortest_path(V, F, start=start, end=end), found)
    for given in (plane,), (plane, 17), (V, F), (V, F, 17), (plane, None, 17), (plane, None, None, 17):
        with pytest.raises(dmkcl.ArgumentError, match=r"^a path has two ends: shortest_path\(mesh, 17, 99\), or"):
            dmkcl.shortest_path(*given)
    with pytest.raises(dmkcl.ArgumentError, match="a mesh has its faces"):
        dmkcl.shortest_path(plane, F, 17, 99)
    with pytest.raises(dmkcl.ArgumentError, match="^1.5: expected a vertex number or a point x, y, z"):
        dmkcl.shortest_path(plane, 1.5, 99)
    with pytest.raises(dmkcl.ArgumentError, match="^expected a mesh: vertices and faces, .* not ndarray"):
        dmkcl.shortest_path(V, 17, 99)


@pytest.mark.parametrize("wrong", [1.5, [0, 1], (0.0, 0.0, 0.0), "3"])
def test_what_is_no_vertex_is_refused(plane, wrong):
    with pytest.raises(dmkcl.ArgumentError, match="points in space"):
        dmkcl.distance(plane, None, wrong)


def test_they_pickle_and_copy(plane, tmp_path):
    found = dmkcl.Geodesics(plane, vertices=[3], point=(1, 0, 0), curve=[0, 1], offsets=[0.5, 0])
    again = pickle.loads(pickle.dumps(found))
    for name in ("distance", "nearest", "direction"):
        assert np.array_equal(getattr(again, name), getattr(found, name)), name
        assert not getattr(again, name).flags.writeable
    assert again._made is None and repr(again) == repr(found) and again.info == found.info
    assert again.path(vertex=300).length == found.path(vertex=300).length
    found.write(tmp_path / "a.vtp")
    again.write(tmp_path / "b.vtp")
    assert (tmp_path / "a.vtp").read_bytes() == (tmp_path / "b.vtp").read_bytes()
    assert copy.copy(found) is copy.deepcopy(found) is found


def test_cut_locus_of_a_set(tmp_path):
    """Between two poles of a sphere the equator."""
    ball = dmkcl.surfaces.sphere(n_triangles=5000)
    z = ball.vertices[:, 2]
    at = dmkcl.Geodesics(ball, sources=[int(z.argmax()), int(z.argmin())])
    locus = at.locus()
    assert (locus.loops, locus.components, locus.endpoints) == (1, 1, 0)
    assert abs(locus.vertices[:, 2]).max() < 0.05 and abs(locus.length / (2 * np.pi) - 1) < 0.01
    assert (np.sort(locus.sources) == [0, 1]).all() and np.isinf(locus.edge_strength).all()
    locus.write(tmp_path / "equator.obj")
    assert (tmp_path / "equator.obj").stat().st_size > 1000
    assert copy.deepcopy(at.locus(strength=0.1)).length == locus.length


def test_cut_locus_of_a_border_is_refused(plane):
    with pytest.raises(dmkcl.ArgumentError, match="of curves and borders is not traced"):
        dmkcl.Geodesics(plane, border=True).locus()


def test_no_source_is_refused(plane):
    with pytest.raises(dmkcl.ArgumentError):
        dmkcl.Geodesics(plane)
    with pytest.raises(dmkcl.ArgumentError, match="2 offsets for 1 source$"):
        dmkcl.Geodesics(plane, 0, offsets=[0, 1])
