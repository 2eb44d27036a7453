"""Meshes: arrays in and out, points, errors, mesh objects of other packages."""

import gc
import types

import numpy as np
import pytest

import dmkcl


def test_arrays_come_back(small):
    V, F = small
    mesh = dmkcl.Mesh(V, F)
    assert np.array_equal(mesh.vertices, V) and np.array_equal(mesh.faces, F)
    assert mesh.vertices.dtype == np.float64 and mesh.faces.dtype == np.int32
    assert mesh.info["euler"] == 2 and mesh.info["n_border_edges"] == 0


@pytest.mark.parametrize("dtype", [np.int16, np.int64, np.uint32])
def test_faces_of_any_integers(small, dtype):
    assert np.array_equal(dmkcl.Mesh(small.vertices, small.faces.astype(dtype)).faces, small.faces)


def test_lists_and_single_precision_and_order(small):
    V = np.asfortranarray(small.vertices.astype(np.float32))
    mesh = dmkcl.Mesh(V, small.faces.tolist())
    assert np.array_equal(mesh.vertices, V.astype(float))


def test_plane_coordinates():
    mesh = dmkcl.Mesh([[0, 0], [1, 0], [0, 1]], [[0, 1, 2]])
    assert np.array_equal(mesh.vertices[:, 2], [0, 0, 0])
    assert repr(mesh) == "<dmkcl.Mesh: 3 vertices, 1 triangle, 1 component, genus 0, 1 border>"


def test_arrays_are_read_only_and_outlive_the_mesh(small):
    mesh = dmkcl.Mesh(*small)
    vertices = mesh.vertices
    with pytest.raises(ValueError):
        vertices[0] = 1
    del mesh
    gc.collect()
    assert np.array_equal(vertices, small.vertices)


def test_masked_numbers_are_refused(small):
    V, F = small
    with pytest.raises(dmkcl.ArgumentError, match="vertices are masked"):
        dmkcl.Mesh(np.ma.masked_greater(V, 0.9), F)
    with pytest.raises(dmkcl.ArgumentError, match="faces are masked"):
        dmkcl.Mesh(V, np.ma.masked_equal(F, 7))
    assert dmkcl.Mesh(np.ma.masked_invalid(V), np.ma.masked_less(F, 0)).info["n_triangles"] == len(F)


def test_edges_and_face_edges(small):
    assert not small.face_edges.flags.writeable  # gradients are made with them
    assert (small.edges[:, 0] < small.edges[:, 1]).all()
    for k in range(3):
        ends = np.sort(small.faces[:, [(k + 1) % 3, (k + 2) % 3]], axis=1)
        assert np.array_equal(small.edges[small.face_edges[:, k]], ends)


@pytest.mark.parametrize(
    "V, F, words",
    [
        (np.zeros((4, 2, 3)), [[0, 1, 2]], "shape"),
        (np.eye(3), [[0, 1, 2, 0]], "triangles only"),
        (np.eye(3), [[0.0, 1.0, 2.0]], "integers"),
        (np.eye(3), [[0, 1, 2], [0, 1]], "faces have rows of different lengths"),
        (np.eye(3) + 0j, [[0, 1, 2]], "vertices are of type complex128"),
        (np.eye(3).astype(str), [[0, 1, 2]], "vertices are of type <U32"),
        ([[0, 0, 0], [1, 0]], [[0, 1, 2]], "vertices have rows of different lengths"),
        (np.eye(3), [[0, 1, 3]], "triangle 0 names the vertices .*numbered from 0, and there are 3"),
        (np.eye(3), [[0, 1, -1]], "triangle 0 names the vertices"),
        (np.eye(3) * np.nan, [[0, 1, 2]], "finite|NaN|nan"),
        (np.eye(3), [[0, 1, 1]], "triangle 0"),
    ],
)
def test_bad_arrays_are_named(V, F, words):
    with pytest.raises((dmkcl.ArgumentError, dmkcl.MeshError), match=words) as raised:
        dmkcl.Mesh(V, F)
    assert isinstance(raised.value, ValueError)


def test_library_words_and_code():
    V = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]]
    with pytest.raises(dmkcl.MeshError, match="edge") as raised:
        dmkcl.Mesh(V, [[0, 1, 2], [1, 0, 3], [0, 1, 4]])
    assert raised.value.code == -5


def test_points(small):
    at = small.nearest((2, 0, 0))
    assert np.allclose(np.array(at.bary) @ small.vertices[small.faces[at.face]], at.xyz)
    assert np.linalg.norm(at.xyz) <= 1 + 1e-12 and at.xyz[0] > 0.97
    assert np.array_equal(small.at_vertex(7).xyz, small.vertices[7])
    middle = small.at_face(5)
    assert np.allclose(middle.xyz, small.vertices[small.faces[5]].mean(axis=0))
    assert small.at_face(5, (2, 0, 2)).bary == (0.5, 0, 0.5)


def test_many_points_are_those_of_one_at_a_time(small):
    rng = np.random.default_rng(1)
    middles = small.vertices[small.edges[:200]].mean(axis=1)
    points = np.vstack([2 * rng.normal(size=(200, 3)), small.vertices[:200], middles])
    assert small.nearest_all(points) == [small.nearest(point) for point in points]
    assert small.nearest_all(points[:1]) == [small.nearest(points[0])]
    for wrong in (points[0], points[:, :2], [(0, 0, np.nan)]):
        with pytest.raises(dmkcl.ArgumentError, match="point"):
            small.nearest_all(wrong)


@pytest.mark.parametrize(
    "where",
    [
        {},
        {"vertex": 0, "point": (1, 0, 0)},
        {"vertex": -1},
        {"vertex": 10**6},
        {"vertex": 2**31},
        {"face": 2**32},
        {"face": -1},
        {"face": 10**6},
        {"face": 0, "bary": (1, -1, 1)},
        {"face": 0, "bary": (0, 0, 0)},
        {"face": 0, "bary": (1, 1)},
        {"vertex": 0, "bary": (1, 0, 0)},
        {"point": (np.nan, 0, 0)},
        {"point": (1, 0)},
    ],
)
def test_bad_points(small, where):
    with pytest.raises(dmkcl.ArgumentError):
        small.place(**where)


@pytest.mark.parametrize("n", [2**31, -(2**31) - 1, 2**70])
def test_whole_numbers_have_32_bits(small, n):
    for use in (
        lambda: dmkcl.surfaces.torus(refine=n),
        lambda: dmkcl.surfaces.torus(n_triangles=n),
        lambda: dmkcl.CutLocus(small, threads=n),
        lambda: dmkcl.Geodesics(small, curve=[0, n]),
    ):
        with pytest.raises(dmkcl.ArgumentError, match=f"= {n}: expected a number of 32 bits"):
            use()


def test_a_source_that_is_lifted_from_afar_is_warned_of(recwarn):
    assert dmkcl.surfaces.torus(source=(3.01, 0, 0)).vertices[0] == pytest.approx((3, 0, 0))
    assert not recwarn
    words = r"^\(100, 0, 0\) is away from the surface; the source, \(3, 0, 0\), is 97 from it$"
    with pytest.warns(UserWarning, match=words) as warned:
        dmkcl.surfaces.torus(source=(100, 0, 0))
    assert warned[0].filename == __file__


def test_surfaces():
    for name in dmkcl.surfaces.__all__:
        assert getattr(dmkcl.surfaces, name)(n_triangles=800).info["n_border_edges"] == 0
    R = 3
    V, _ = dmkcl.surfaces.torus(R, 0.5, n_triangles=2000, source=(0, 3.5, 0))
    assert np.allclose(np.hypot(np.hypot(V[:, 0], V[:, 1]) - R, V[:, 2]), 0.5)
    assert np.allclose(V[0], (0, 3.5, 0))
    with pytest.raises(dmkcl.ArgumentError, match="tube"):
        dmkcl.surfaces.torus(1, 2)


def test_trimesh_and_back(small):
    trimesh = pytest.importorskip("trimesh")
    mesh = small.to_trimesh()
    assert isinstance(mesh, trimesh.Trimesh) and mesh.is_watertight
    back = dmkcl.CutLocus(mesh).mesh
    assert np.array_equal(back.vertices, small.vertices) and np.array_equal(back.faces, small.faces)


def test_pyvista_and_back(small):
    pyvista = pytest.importorskip("pyvista")
    data = small.to_pyvista()
    assert isinstance(data, pyvista.PolyData) and data.n_cells == len(small.faces)
    for other in (data, data.cast_to_unstructured_grid()):
        back = dmkcl.CutLocus(other).mesh
        assert len(back.faces) == len(small.faces) and back.info["euler"] == 2


def test_meshio_cells(small):
    meshio = pytest.importorskip("meshio")
    V, F = small
    back = dmkcl.CutLocus(meshio.Mesh(V, [("triangle", F)])).mesh
    assert np.array_equal(back.vertices, V) and np.array_equal(back.faces, F)
    square = meshio.Mesh(
        [[0, 0], [1, 0], [2, 0], [0, 1], [1, 1], [2, 1]],
        [("vertex", [[0]]), ("quad", [[0, 1, 4, 3]]), ("triangle", [[1, 2, 5], [1, 5, 4]])],
    )
    assert dmkcl.CutLocus(square).mesh.info["area"] == 2
    dart = [[0, 0], [2, 1], [0, 0.5], [-2, 1]]
    for cells in (("quad", [[1, 2, 3, 0]]), ("polygon", [[1, 2, 3, 0]])):
        assert dmkcl.CutLocus(meshio.Mesh(dart, [cells])).mesh.info["area"] == pytest.approx(1)
    sizes = np.empty(2, object)
    sizes[:] = [[0, 1, 4, 3], [1, 2, 4]]
    assert len(dmkcl.CutLocus(meshio.Mesh(square.points, [("polygon", sizes)])).mesh.faces) == 3
    for last in (4, -1, 2**32):
        with pytest.raises(dmkcl.MeshError, match=rf"polygon 0 .*, {last}\]; .* from 0, and there are 4"):
            dmkcl.CutLocus(meshio.Mesh(dart, [("quad", np.array([[1, 2, 3, last]]))]))
    with pytest.raises(dmkcl.ArgumentError, match="float64; expected integers"):
        dmkcl.CutLocus(meshio.Mesh(dart, [("quad", [[1.9, 2, 3, 0]])]))
    with pytest.raises(dmkcl.MeshError, match="tetra"):
        dmkcl.CutLocus(meshio.Mesh(np.zeros((4, 3)), [("tetra", [[0, 1, 2, 3]])]))


def test_no_mesh_at_all():
    with pytest.raises(dmkcl.ArgumentError, match="expected a mesh"):
        dmkcl.CutLocus(17)


def test_printed_form(small):
    assert "closed" in repr(small)
    assert repr(small).endswith("1 component, genus 0, closed>")
    two = dmkcl.Mesh([*np.eye(3), *(np.eye(3) + 5)], [[0, 1, 2], [3, 4, 5]])
    assert repr(two) == "<dmkcl.Mesh: 6 vertices, 2 triangles, 2 components, 2 borders>"


@pytest.mark.filterwarnings("ignore:the mesh is in 2 pieces")
def test_scenes_blocks_and_open3d(small):
    trimesh, pyvista = pytest.importorskip("trimesh"), pytest.importorskip("pyvista")
    scene = trimesh.Scene([small.to_trimesh()])
    scene.add_geometry(small.to_trimesh(), transform=trimesh.transformations.translation_matrix((3, 0, 0)))
    both = dmkcl.CutLocus(scene).mesh
    assert both.info["n_components"] == 2 and both.info["box_max"][0] > 3.9
    blocks = pyvista.MultiBlock([small.to_pyvista(), small.to_pyvista().translate((3, 0, 0))])
    assert dmkcl.CutLocus(blocks).mesh.info["n_components"] == 2
    open3d = types.SimpleNamespace(vertices=small.vertices.tolist(), triangles=small.faces.tolist())
    assert np.array_equal(dmkcl.CutLocus(open3d).mesh.faces, small.faces)


def test_errors_name_the_file(tmp_path):
    meshio = pytest.importorskip("meshio")
    path = tmp_path / "solid.inp"
    meshio.Mesh(np.eye(4)[:, :3], [("tetra", [[0, 1, 2, 3]])]).write(path)
    with pytest.raises(dmkcl.MeshError, match="solid.inp.*tetra"):
        dmkcl.read(path)
