"""`dmkcl.read`: the library's formats, and files written by meshio and trimesh."""

import errno
import gzip
import pickle
import shutil
import sys
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import dmkcl

meshio = pytest.importorskip("meshio")
trimesh = pytest.importorskip("trimesh")


def same_surface(mesh, small, tolerance=1e-12):
    assert mesh.info["n_triangles"] == small.info["n_triangles"]
    assert mesh.info["n_border_edges"] == 0 and mesh.info["euler"] == 2
    assert mesh.info["area"] == pytest.approx(small.info["area"], rel=max(tolerance, 1e-12))


MESHIO = {
    "stl": 1e-6,
    "ply": 1e-12,
    "obj": 1e-12,
    "off": 1e-12,
    "vtk": 1e-12,
    "vtu": 1e-12,
    "msh": 1e-12,
    "mesh": 1e-12,
    "inp": 1e-12,
}


@pytest.mark.parametrize("suffix", MESHIO)
def test_written_by_meshio(tmp_path, small, suffix):
    path = tmp_path / f"sphere.{suffix}"
    meshio.write(path, meshio.Mesh(small.vertices, [("triangle", small.faces)]))
    same_surface(dmkcl.read(path), small, MESHIO[suffix])


@pytest.mark.parametrize("suffix", ["stl", "ply", "obj", "off", "glb"])
def test_written_by_trimesh(tmp_path, small, suffix):
    path = tmp_path / f"sphere.{suffix}"
    small.to_trimesh().export(path)
    same_surface(dmkcl.read(path), small, 1e-6)


def test_seams_of_pictures_are_closed(tmp_path):
    """A box with a texture has its corners once for each side; the surface has them once."""
    box = trimesh.creation.box()
    box.unmerge_vertices()
    box.visual = trimesh.visual.TextureVisuals(uv=np.random.default_rng(0).random((36, 2)))
    box.export(tmp_path / "box.glb")
    mesh = dmkcl.read(str(tmp_path / "box.glb"))
    assert len(mesh.vertices) == 8 and mesh.info["n_border_edges"] == 0


def test_packed_by_gzip(tmp_path, small):
    small.write(tmp_path / "a.off")
    with open(tmp_path / "a.off", "rb") as plain, gzip.open(tmp_path / "a.off.gz", "wb") as packed:
        shutil.copyfileobj(plain, packed)
    assert np.array_equal(dmkcl.read(tmp_path / "a.off.gz").vertices, small.vertices)


def test_names_of_any_letters(tmp_path, small):
    path = tmp_path / "Fläche 1.off"
    small.write(path)
    assert dmkcl.CutLocus(path).mesh.info["n_triangles"] == small.info["n_triangles"]


def test_a_missing_file_is_what_python_has_for_it(tmp_path, small):
    for missing in (lambda: dmkcl.read(tmp_path / "nothing.off"), lambda: small.write(tmp_path / "no/where.off")):
        with pytest.raises(FileNotFoundError, match="nothing.off|where.off") as caught:
            missing()
        again = pickle.loads(pickle.dumps(caught.value))
        for error in (caught.value, again):
            assert isinstance(error, dmkcl.FileError) and isinstance(error, FileNotFoundError)
            assert (error.errno, error.code, str(error)) == (errno.ENOENT, -3, str(caught.value))
    (tmp_path / "file").touch()
    with pytest.raises(NotADirectoryError):
        dmkcl.read(tmp_path / "file" / "No such file or directory.off")
    with pytest.raises(IsADirectoryError, match="name a mesh file in it") as folder:
        dmkcl.read(tmp_path)
    assert isinstance(folder.value, dmkcl.FileError) and folder.value.errno == errno.EISDIR
    with pytest.raises(dmkcl.FileError, match="is a device") as device:
        dmkcl.read("/dev/zero")
    assert device.value.errno is None


def test_errors(tmp_path):
    with pytest.raises(dmkcl.FileError, match="nothing.off"):
        dmkcl.read(tmp_path / "nothing.off")
    odd = tmp_path / "odd.xyz123"
    odd.write_text("what is this\n")
    with pytest.raises(dmkcl.FormatError, match="meshio.*trimesh"):
        dmkcl.read(odd)
    tetra = tmp_path / "tetra.inp"
    meshio.write(
        tetra, meshio.Mesh(np.vstack([np.zeros(3), np.eye(3)]), [("tetra", [[0, 1, 2, 3]])])
    )
    with pytest.raises(dmkcl.MeshError, match="tetra"):
        dmkcl.read(tetra)
    bad = tmp_path / "bad.off"
    bad.write_text("OFF\n3 1 0\n0 0 0\n1 0 0\n2 0 0\n3 0 1 2\n")
    with pytest.raises(dmkcl.MeshError, match="triangle 0"):
        dmkcl.read(bad)


def test_every_reader_of_meshio_has_a_public_name(tmp_path, small, monkeypatch):
    kinds = {kind for kinds in meshio.extension_to_filetypes.values() for kind in kinds}
    readers = {kind for kind in kinds if callable(getattr(getattr(meshio, kind.partition("-")[0]), "read", None))}
    assert kinds - readers == {"svg"}  # which is only written
    path = tmp_path / "small.MESH"
    meshio.write(path, meshio.Mesh(small.vertices, [("triangle", small.faces)]), file_format="medit")
    for name in "reader_map", "_filetypes_from_path":
        monkeypatch.delattr(f"meshio._helpers.{name}", raising=False)
    assert np.array_equal(dmkcl.read(path).faces, small.faces)


def test_errors_have_the_name_as_it_is(tmp_path):
    path = tmp_path / "a--repair --b.off"
    with pytest.raises(dmkcl.FileError, match=f"{path}"):
        dmkcl.read(path)


@pytest.mark.parametrize("suffix", ["off", "obj", "ply", "vtu"])
def test_a_broken_file_is_not_read_in_part(tmp_path, small, suffix, capfd):
    """A format that the library knows is its own affair: meshio and trimesh would take the part that is there."""
    path = tmp_path / f"cut.{suffix}"
    small.write(path)
    whole = path.read_bytes()
    path.write_bytes(whole[: 3 * len(whole) // 4].rstrip(b"0123456789 \n") + b" x")
    for load in (dmkcl.read, dmkcl.repair, dmkcl.CutLocus):
        with pytest.raises(dmkcl.FormatError, match="^(?!.*(meshio|trimesh)).*cut"):
            load(path)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("text", ["v 0 0 0\nv 1 0 0\n", "v 0 0 0\nv 1 0 0\nl 1 2\n"])
def test_points_and_lines_are_no_mesh(tmp_path, text):
    path = tmp_path / "lines.obj"
    path.write_text(text)
    with pytest.raises(dmkcl.FormatError, match="lines.obj: contains no faces"):
        dmkcl.read(path)


def test_of_what_nobody_reads_one_message_comes(tmp_path, capfd):
    for name in ("odd.inp", "odd.msh", "odd.glb"):
        path = tmp_path / name
        path.write_text("what is this\n")
        with pytest.raises(dmkcl.Error) as raised:
            dmkcl.read(path)
        assert str(raised.value).startswith(str(path)) and "array" not in str(raised.value)
    assert capfd.readouterr() == ("", "")


def test_threads_keep_the_streams(tmp_path):
    trimesh.creation.box().export(tmp_path / "box.glb")
    streams = sys.stdout, sys.stderr
    with ThreadPoolExecutor(4) as pool:
        list(pool.map(lambda _: dmkcl.read(tmp_path / "box.glb"), range(40)))
    assert (sys.stdout, sys.stderr) == streams


@pytest.mark.parametrize("loaded", ["trimesh", "meshio"])
def test_five_lines(tmp_path, small, loaded):
    small.write(tmp_path / "sphere.ply")
    if loaded == "trimesh":
        mesh = trimesh.load_mesh(tmp_path / "sphere.ply")
    else:
        mesh = meshio.read(tmp_path / "sphere.ply")
    result = dmkcl.CutLocus(mesh).solve(point=(0, 0, 1))
    assert len(result.density) == len(small.faces)
    assert result.locus.vertices[0, 2] < -0.9


def test_no_name_is_cut_at_a_nul(tmp_path, small, monkeypatch):
    monkeypatch.chdir(tmp_path)
    small.write(b"a.off")
    assert len(dmkcl.read(b"a.off").faces) == len(dmkcl.repair(tmp_path / "a.off").mesh.faces) == len(small.faces)
    for use in (small.write, dmkcl.Geodesics(small, 0).write, dmkcl.read, dmkcl.repair, dmkcl.CutLocus):
        with pytest.raises(dmkcl.ArgumentError, match="no NUL"):
            use("a.off\0.vtp")
    with pytest.raises(dmkcl.ArgumentError, match="no NUL"):
        dmkcl.CutLocus(small, cache="a\0b")
    assert [p.name for p in tmp_path.iterdir()] == ["a.off"]


def soup(mesh):
    """Each triangle with vertices of its own."""
    return mesh.vertices[mesh.faces.ravel()], np.arange(3 * len(mesh.faces)).reshape(-1, 3)


def test_repair(tmp_path):
    whole = dmkcl.surfaces.sphere(n_triangles=200)
    V, F = soup(whole)
    F = np.vstack([F, F[:1, ::-1], [[0, 0, 1]]])
    F[5:40:3] = F[5:40:3, ::-1]
    done = dmkcl.repair(V, F)
    assert done.mesh.info["euler"] == 2 and len(done.mesh.faces) == len(whole.faces)
    assert done.merged_vertices == len(V) - len(whole.vertices) and done.turned_triangles == 12
    assert done.duplicate_triangles == 1 and done.degenerate_triangles == 1
    assert np.array_equal(done.mesh.vertices, V[done.vertex_old])
    assert np.array_equal(done.mesh.vertices[done.vertex_new], V)
    assert np.array_equal(np.sort(done.vertex_new[F[done.face_old]]), np.sort(done.mesh.faces))
    assert "12 turned_triangles" in repr(done)
    path = tmp_path / "soup.obj"
    lines = [f"v {x} {y} {z}" for x, y, z in V] + [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in F]
    path.write_text("\n".join(lines))
    assert len(dmkcl.repair(path).mesh.vertices) == len(whole.vertices)
    with pytest.raises(dmkcl.MeshError, match="soup.obj.*dmkcl.repair does"):
        dmkcl.read(path)


def test_a_seam_is_warned_of():
    n = 24
    t, w = np.meshgrid(2 * np.pi * np.arange(n) / n, (-0.3, 0.3), indexing="ij")
    r = 1 + w * np.cos(t / 2)
    V = np.stack([r * np.cos(t), r * np.sin(t), w * np.sin(t / 2)], -1).reshape(-1, 3)
    a = 2 * np.arange(n)
    c, d = np.append(a[1:], 1), np.append(a[1:] + 1, 0)
    F = np.concatenate([np.stack([a, c, a + 1], -1), np.stack([a + 1, c, d], -1)])
    with pytest.warns(UserWarning, match="cut open along 1 edge, for it has one side only"):
        done = dmkcl.repair(V, F)
    assert done.seam_edges == 1 and done.split_edges == 0 and "1 seam_edges" in repr(done)


def test_pieces_are_warned_of():
    whole = dmkcl.surfaces.sphere(n_triangles=200)
    with pytest.warns(UserWarning, match=r"in 20\d pieces.*leaves 1"):
        dmkcl.CutLocus(*soup(whole))
    pyvista = pytest.importorskip("pyvista")
    with pytest.warns(UserWarning, match="in 6 pieces.*leaves 1"):
        dmkcl.CutLocus(pyvista.Cube(clean=False))
    assert dmkcl.repair(pyvista.Cube(clean=False)).mesh.info["euler"] == 2
