import copy
import pickle

import dmkcl
import numpy as np
import pytest


@pytest.fixture(scope="module")
def sphere():
    return dmkcl.CutLocus(dmkcl.surfaces.sphere(n_triangles=3000))


def test_two_points(sphere):
    pole, equator = (0, 0, 1), (1, 0, 0)
    a, b = dmkcl.Measure(points=[pole]), dmkcl.Measure(points=[equator])
    found = sphere.transport(a, b)
    assert found.lower <= found.upper and abs(found.w1 - np.pi / 2) < 0.05
    assert found.mass == pytest.approx(1) and found.balance < 1e-8
    assert found.flux.shape == (len(sphere.mesh.faces), 3) and not found.flux.flags.writeable
    assert (found.density >= 0).all() and found.potential.max() == 0
    assert "discrete W1 from" in repr(found)


def test_masses_at_vertices_signed_and_written(sphere, tmp_path):
    z = sphere.mesh.vertices[:, 2]
    a, b = (z > 0.8).astype(float), (z < -0.8).astype(float)
    found = sphere.transport(a / a.sum(), 3 * b, normalise=True)
    assert np.pi - 1 < found.w1 < np.pi
    signed = sphere.transport(a / a.sum() - b / b.sum())
    assert signed.w1 == pytest.approx(found.w1, rel=1e-3)
    found.write(tmp_path / "t.vtp")
    assert (tmp_path / "t.vtp").stat().st_size > 1000
    with pytest.raises(dmkcl.ArgumentError):
        sphere.transport(a, 2 * a)
    with pytest.raises(dmkcl.ArgumentError, match="vertex_mass"):
        sphere.transport(a[:-1], b)


def test_it_pickles_and_copies(sphere):
    free = dmkcl.Measure(points=[(1, 0, 0), (0, 0, 1)], masses="free")
    found = sphere.transport(dmkcl.Measure(uniform=1), free)
    again = pickle.loads(pickle.dumps(found))
    for name in ("density", "flux", "potential", "atom_mass", "acl"):
        assert np.array_equal(getattr(again, name), getattr(found, name)), name
        assert not getattr(again, name).flags.writeable
    assert repr(again) == repr(found) and again.balance == found.balance
    assert again.stats["steps"] == found.stats["steps"] and again.lower == found.lower
    assert len(again.atom_mass) == 2 and copy.copy(found) is copy.deepcopy(found) is found
    with pytest.raises(dmkcl.ArgumentError, match="pickled"):
        again.write("nowhere.vtp")
    assert repr(free) == "<dmkcl.Measure: points of 2, masses free>"


def test_measures_print_and_compare(sphere):
    at = sphere.mesh.at_vertex(0)
    free = dmkcl.Measure(points=[(1, 0, 0), at], masses="free")
    assert repr(free) == "<dmkcl.Measure: points of 2, masses free>"
    assert repr(dmkcl.Measure(vertex_mass=np.ones(3))) == "<dmkcl.Measure: vertex_mass of 3>"
    assert repr(dmkcl.Measure(vertex_mass=3)) == "<dmkcl.Measure: vertex_mass 3>"
    with pytest.raises(dmkcl.ArgumentError, match="vertex_mass has the shape"):
        sphere.transport(dmkcl.Measure(vertex_mass=3), free)
    kinds = [
        lambda: dmkcl.Measure(),
        lambda: dmkcl.Measure(uniform=1),
        lambda: dmkcl.Measure(vertex_mass=np.ones(3)),
        lambda: dmkcl.Measure(vertex_mass=np.ones(4)),
        lambda: dmkcl.Measure(face_density=np.ones(3)),
        lambda: dmkcl.Measure(points=np.eye(3), masses=np.arange(3)),
        lambda: dmkcl.Measure(points=np.eye(3), masses="free"),
        lambda: dmkcl.Measure(points=[np.array((1, 0, 0)), at], masses="free"),
    ]
    for i, one in enumerate(kinds):
        for j, other in enumerate(kinds):
            assert (one() == other()) == (i == j) != (one() != other()), (i, j)
        assert hash(one()) == hash(one())
    assert dmkcl.Measure(vertex_mass=[1, 1, 1]) == kinds[2]() != np.ones(3).tolist()
    assert free == kinds[7]()


@pytest.mark.parametrize("masses", [[1.0], "free"])
def test_masses_without_points_are_refused(sphere, masses):
    lost = dmkcl.Measure(uniform=1, masses=masses)
    with pytest.raises(dmkcl.ArgumentError, match="masses are given, but no points"):
        sphere.transport(lost, dmkcl.Measure(uniform=1))


def test_matrix(sphere):
    points = [dmkcl.Measure(points=[x]) for x in np.eye(3)]
    matrix = sphere.w1_matrix(points)
    assert np.array_equal(matrix, matrix.T) and np.all(np.diag(matrix) == 0)
    assert np.allclose(matrix[np.triu_indices(3, 1)], np.pi / 2, atol=0.05)


def test_a_normalised_matrix_has_one_mass(sphere):
    """That of the first measure, whatever the others have."""
    points = [dmkcl.Measure(points=[x], masses=[m]) for x, m in zip(np.eye(3), (2.0, 1000.0, 5.0))]
    matrix = sphere.w1_matrix(points, normalise=True)
    assert np.array_equal(matrix, matrix.T)
    assert np.allclose(matrix[np.triu_indices(3, 1)], np.pi, atol=0.1)


class Frame:
    """As a data frame: an array of its rows, but an iterator over its columns."""

    def __init__(self, rows):
        self.rows = np.asarray(rows)

    def __array__(self, dtype=None, copy=None):
        return self.rows

    def __iter__(self):
        return iter(self.rows.T)

    def __len__(self):
        return len(self.rows)


def test_points_of_a_data_frame_are_its_rows(sphere):
    rows = np.array([[0, 0, 1], [0.6, 0, 0.8], [0, 0.6, 0.8]])
    even = dmkcl.Measure(uniform=3)
    found = [sphere.transport(dmkcl.Measure(points=points), even).w1 for points in (rows, Frame(rows))]
    assert found[0] == found[1]


def test_free_masses_are_those_of_the_nearest_points(sphere):
    points = np.vstack([np.eye(3), -np.eye(3)])
    found = sphere.transport(dmkcl.Measure(points=points, masses="free"), dmkcl.Measure(uniform=3), normalise=True)
    assert found.atom_mass.shape == (6,) and found.atom_mass.sum() == pytest.approx(3)
    assert np.allclose(found.atom_mass, 0.5, atol=0.02)  # six equal cells
    distance = np.arccos(np.clip((sphere.mesh.vertices @ points.T).max(axis=1), -1, 1))
    assert np.abs(found.potential - found.potential.max() + distance).mean() < 0.02
    fixed = sphere.transport(dmkcl.Measure(points=points[:1]), dmkcl.Measure(uniform=1), normalise=True)
    assert fixed.atom_mass.shape == (0,) and fixed.acl.shape == (0,)
    x = np.sort(np.abs(sphere.mesh.vertices[sphere.mesh.faces].mean(axis=1)), axis=1)
    even = x[:, 2] - x[:, 1]  # 0 where two of the points are equally near
    assert found.acl.dtype == bool and found.acl[even < 0.1].all() and even[found.acl].max() < 0.25
    assert found.stats["seconds"].keys() == dmkcl.CutLocus(sphere.mesh).solve(vertex=0).stats["seconds"].keys()
    with pytest.raises(dmkcl.ArgumentError, match="free"):
        sphere.transport(dmkcl.Measure(points=points, masses="fre"), dmkcl.Measure(uniform=1))


def test_what_is_wrong_with_a_measure_has_the_names_of_its_parts(sphere):
    density = np.where(np.arange(len(sphere.mesh.faces)) == 7, -1.0, 1.0)
    with pytest.raises(dmkcl.ArgumentError, match="the first measure: face 7 has the value -1"):
        sphere.transport(dmkcl.Measure(face_density=density), dmkcl.Measure(uniform=1))
    lost = dmkcl.Measure(points=np.eye(3), masses=[1, 1, np.nan])
    with pytest.raises(dmkcl.ArgumentError, match="the second measure: point 2 has the value nan"):
        sphere.transport(dmkcl.Measure(uniform=1), lost)


def folded(n_triangles):
    """A closed surface with folds like a brain's."""
    ball = dmkcl.surfaces.sphere(n_triangles=n_triangles)
    x, y, z = ball.vertices.T
    depth = np.sin(9 * x + 2 * z) * np.cos(8 * y) + np.sin(7 * z - 3 * y)
    return dmkcl.Mesh(ball.vertices * (1 + 0.08 * depth)[:, None] * [0.7, 1, 0.8], ball.faces), depth


def test_histograms_on_a_folded_surface():
    mesh, depth = folded(8000)
    found = dmkcl.transport(mesh, np.clip(depth, 0, None), np.clip(-depth, 0, None), normalise=True)
    way = found.w1 / found.mass
    assert 0.2 < way < 0.5  # from crown to groove, not across the surface
    assert found.upper - found.lower < 3e-3 * found.upper and found.balance < 1e-8
    assert found.stats["steps"] <= 20


def test_from_region_to_region_of_a_scan():
    """Noise moves the vertices; what leaves one end and comes to the other passes between them."""
    plain = dmkcl.surfaces.ellipsoid(0.5, 0.6, 2, n_triangles=8000)
    noise = np.random.default_rng(3).normal(size=plain.vertices.shape)
    mesh = dmkcl.Mesh(plain.vertices + 0.004 * noise, plain.faces)
    z = mesh.vertices[:, 2]
    found = dmkcl.transport(mesh, (z > 1.7).astype(float), (z < -1.7).astype(float), normalise=True)
    assert 3.4 < found.w1 / found.mass < 4.4
    middle = mesh.vertices[mesh.faces].mean(axis=1)[:, 2]
    down = -found.flux[np.abs(middle) < 0.2, 2]
    assert (down > 0).mean() > 0.95
    assert found.upper - found.lower < 3e-3 * found.upper


def test_matrix_of_twenty_with_progress(sphere, capsys):
    """Distances of measures are a metric, and those of points the distances of the points."""
    points = np.random.default_rng(5).normal(size=(20, 3))
    points /= np.linalg.norm(points, axis=1)[:, None]
    matrix = sphere.w1_matrix([dmkcl.Measure(points=[p]) for p in points], progress=True)
    exact = np.arccos(np.clip(points @ points.T, -1, 1))
    assert np.array_equal(matrix, matrix.T)
    assert np.abs(matrix - exact)[~np.eye(20, dtype=bool)].max() < 0.08
    assert (matrix[:, :, None] <= matrix[:, None, :] + matrix[None] + 0.05).all()
    assert "190" in capsys.readouterr().err


def test_a_gap_that_is_not_reached_warns(sphere, recwarn):
    a, b = dmkcl.Measure(points=[(0, 0, 1)]), dmkcl.Measure(points=[(1, 0, 0)])
    sphere.transport(a, b)
    sphere.transport(a, b, gap=0.5)
    assert not recwarn
    with pytest.warns(UserWarning, match="the gap is .* above the 1e-09 that was asked for") as warned:
        sphere.transport(a, b, gap=1e-9)
    assert warned[0].filename == __file__


def test_matrix_names_the_pair(sphere):
    even = np.ones(len(sphere.mesh.vertices))
    with pytest.raises(dmkcl.ArgumentError, match="^measures 2 and 0: the masses differ"):
        sphere.w1_matrix([even, even, 2 * even])


def test_masses_are_told_as_they_were_given(sphere):
    even = np.ones(len(sphere.mesh.vertices))
    n = len(even)
    with pytest.raises(dmkcl.ArgumentError, match=f"^the masses differ: {n} to be moved, {n}.00000001 at the target"):
        sphere.transport(even, even + 1e-8 / n)
    with pytest.raises(dmkcl.ArgumentError, match=f"^the signed measure has the total mass {n}: expected 0"):
        sphere.transport(even)


def test_a_matrix_of_one_is_checked_too(sphere):
    assert sphere.w1_matrix([np.ones(len(sphere.mesh.vertices))]) == [[0]]
    assert sphere.w1_matrix([]).shape == (0, 0)
    with pytest.raises(dmkcl.ArgumentError, match=r"^one measure; expected several, as in a list: \[measure\]$"):
        sphere.w1_matrix(dmkcl.Measure(uniform=1))
    with pytest.raises(dmkcl.ArgumentError, match="measures = None: expected several, as in a list"):
        sphere.w1_matrix(None)
    with pytest.raises(dmkcl.ArgumentError, match="progress = array"):
        sphere.w1_matrix([], progress=np.zeros(2))
    with pytest.raises(dmkcl.ArgumentError, match="^measure 0: vertex_mass has the shape"):
        sphere.w1_matrix([np.ones(3)])
    with pytest.raises(dmkcl.ArgumentError, match="^measure 0: vertex 7 has the value nan"):
        sphere.w1_matrix([np.where(np.arange(len(sphere.mesh.vertices)) == 7, np.nan, 1)])


@pytest.mark.parametrize("normalise", [False, True])
def test_a_matrix_names_the_measure_whichever_way_it_is_moved(sphere, normalise):
    one, none = np.ones(len(sphere.mesh.vertices)), np.zeros(len(sphere.mesh.vertices))
    with pytest.raises(dmkcl.ArgumentError, match="^measures (0 and 2|2 and 0): measure 2 has no mass$"):
        sphere.w1_matrix([one, one, none], normalise=normalise)
    with pytest.raises(dmkcl.ArgumentError, match="^measures (0 and 1|1 and 0): measure 0 has no mass$"):
        sphere.w1_matrix([none, one, one], normalise=normalise)
    with pytest.raises(dmkcl.ArgumentError, match="^measure 0: the measures have no mass anywhere$"):
        sphere.w1_matrix([none], normalise=normalise)


def test_a_matrix_is_checked_before_anything_is_moved(sphere, monkeypatch):
    n = len(sphere.mesh.vertices)
    even, spoilt = np.ones(n), np.where(np.arange(n) == 7, -1.0, 1.0)

    def unexpected(*arguments):
        raise AssertionError("a transport")

    monkeypatch.setattr(dmkcl.CutLocus, "_transport", unexpected)
    assert sphere.w1_matrix(iter([even])) == [[0]]
    with pytest.raises(dmkcl.ArgumentError, match="^measures 2 and 0: measure 2: vertex 7"):
        sphere.w1_matrix([even, even, spoilt])
    with pytest.raises(dmkcl.ArgumentError, match="^measure 2: vertex_mass has the shape"):
        sphere.w1_matrix([even, even, even[1:]])
    free = dmkcl.Measure(points=np.eye(3), masses="free")
    with pytest.raises(dmkcl.ArgumentError, match="^measures 2 and 1: points without a mass"):
        sphere.w1_matrix([even, free, free])


def test_masked_values_are_no_numbers(sphere):
    mass = np.ma.masked_equal(np.arange(len(sphere.mesh.vertices)) % 5, 3)
    with pytest.raises(dmkcl.ArgumentError, match="vertex_mass are masked"):
        sphere.transport(mass, np.ones(len(mass)), normalise=True)
    whole = np.ma.masked_array(np.ones(len(mass)))
    assert sphere.transport(whole, np.ones(len(mass))).upper == 0
