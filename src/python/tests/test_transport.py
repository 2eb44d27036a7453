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
    assert "W1 from" in repr(found)


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


def test_matrix(sphere):
    spots = [dmkcl.Measure(points=[x]) for x in np.eye(3)]
    matrix = sphere.w1_matrix(spots)
    assert np.array_equal(matrix, matrix.T) and np.all(np.diag(matrix) == 0)
    assert np.allclose(matrix[np.triu_indices(3, 1)], np.pi / 2, atol=0.05)
