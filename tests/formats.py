"""Files of other programs, read by the tool, and the tool's files, read by other programs.

Each surface is written by another program, turned into OFF by `dmkcl mesh`, and compared bit for
bit with what was written; where a writer rounds, with what the file says. Prints TAP.
usage: formats.py TOOL
"""

import base64
import gzip
import itertools
import os
import shutil
import struct
import subprocess
import sys
import tempfile
import types

import gmsh
import meshio
import numpy as np
import pyvista
import trimesh
import vtk
from meshio.vtu import _vtu
from vtk.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray, vtk_to_numpy

tool = sys.argv[1]
folder = tempfile.mkdtemp()
count = 0


def until_padding(text):
    """What meshio takes base64.b64decode for; newer Pythons read on after the padding, into the next array."""
    text = text.decode() if isinstance(text, bytes) else text
    end = text.find("=") % (len(text) + 1)
    return base64.b64decode(text[:end] + "=" * (-end % 4))


_vtu.base64 = types.SimpleNamespace(b64encode=base64.b64encode, b64decode=until_padding)


def report(name, problem):
    global count
    count += 1
    print(f"{'not ok' if problem else 'ok'} {count} - {name}")
    if problem:
        print("#", str(problem).replace("\n", "\n# "))


def reported(compare):
    """Of a function that gives a problem or None: a test with a title. An exception is a problem."""
    def test(title, *arguments, **named):
        try:
            problem = compare(*arguments, **named)
        except Exception as error:
            problem = error
        report(title, problem)
    test.__doc__ = compare.__doc__
    return test


def path(name):
    return os.path.join(folder, name)


# ---- the surface ---------------------------------------------------------------------------------


def torus(n=24, m=12):
    """A torus whose coordinates use all bits of a double."""
    i, j = np.meshgrid(np.arange(n), np.arange(m), indexing="ij")
    a, b = 2 * np.pi * i / n, 2 * np.pi * j / m
    r = 2 + np.cos(b)
    points = np.stack([r * np.cos(a), r * np.sin(a), np.sin(b)], axis=-1).reshape(-1, 3)
    points += 0.01 * np.sin(np.arange(points.size)).reshape(points.shape)
    p = i * m + j
    q, s, t = (i + 1) % n * m + j, (i + 1) % n * m + (j + 1) % m, i * m + (j + 1) % m
    quads = np.stack([p, q, s, t], axis=-1).reshape(-1, 4)
    return points, quads, fans(quads)


def fans(polygons):
    """The triangles that polygons become."""
    return np.array([[f[0], f[k], f[k + 1]] for f in polygons for k in range(1, len(f) - 1)])


V, Q, F = torus()
V32 = V.astype(np.float32).astype(float)


# ---- reading by the tool -------------------------------------------------------------------------


def run(*arguments):
    return subprocess.run([tool, *arguments], capture_output=True, text=True)


def read(name):
    """Vertices and triangles of a mesh file as the tool reads it."""
    out = path("out.off")
    done = run("mesh", path(name), "--out", out, "--quiet")
    if done.returncode != 0:
        raise RuntimeError(f"exit code {done.returncode}: {done.stderr}")
    with open(out) as file:
        words = file.read().split()
    os.remove(out)
    n, m = int(words[1]), int(words[2])
    points = np.array(words[4 : 4 + 3 * n], dtype=float).reshape(n, 3)
    faces = np.array(words[4 + 3 * n :], dtype=int).reshape(m, 4)
    return points, faces[:, 1:]


def difference(points, faces, wanted_points, wanted_faces):
    if points.shape != wanted_points.shape:
        return f"{len(points)} vertices instead of {len(wanted_points)}"
    if faces.shape != wanted_faces.shape:
        return f"{len(faces)} triangles instead of {len(wanted_faces)}"
    wanted_bits = np.ascontiguousarray(wanted_points).view(np.int64)
    if not np.array_equal(points.view(np.int64), wanted_bits):
        return f"vertices differ by {abs(points - wanted_points).max()}"
    if not np.array_equal(faces, wanted_faces):
        return "triangles differ"
    return None


@reported
def check(name, points=V, faces=F):
    """Read as it is, by content alone, and packed."""
    shutil.copy(path(name), path("nameless"))
    with open(path(name), "rb") as file, gzip.open(path(name + ".gz"), "wb") as packed:
        packed.write(file.read())
    for file in (name, "nameless", name + ".gz"):
        problem = difference(*read(file), points, faces)
        if problem:
            return problem
    return None


def refused(title, name, part, code=3):
    done = run("mesh", path(name), "--out", path("out.off"))
    good = done.returncode == code and part in done.stderr
    report(title, None if good else f"exit code {done.returncode}: {done.stderr}")


# ---- meshio --------------------------------------------------------------------------------------


def meshio_files():
    mesh = meshio.Mesh(V, [("triangle", F)])
    for name, binary in itertools.product(("gmsh22", "gmsh40", "gmsh"), (False, True)):
        # meshio's table of names has no 4.0, its writer has
        version = {"gmsh22": "2.2", "gmsh40": "4.0", "gmsh": "4.1"}[name]
        meshio.gmsh.write(path("m.msh"), mesh, fmt_version=version, binary=binary)
        check(f"MSH {version}, {'binary' if binary else 'text'}, meshio", "m.msh")
    for name, binary in itertools.product(("vtk42", "vtk51"), (False, True)):
        meshio.write(path("m.vtk"), mesh, file_format=name, binary=binary)
        check(f"VTK legacy {name[3:]}, {'binary' if binary else 'text'}, meshio", "m.vtk")
    for options in ({"binary": False}, {"compression": None}, {"compression": "zlib"}):
        meshio.write(path("m.vtu"), mesh, **options)
        check(f"VTU {options}, meshio", "m.vtu", as_meshio_reads("m.vtu")[0])
    meshio.write(path("m.vtu"), mesh, compression="lzma")
    refused("VTU packed by LZMA is refused", "m.vtu", "zlib")
    for binary in (False, True):
        meshio.write(path("m.ply"), mesh, binary=binary)
        check(f"PLY, {'binary' if binary else 'text'}, meshio", "m.ply")
    for name in ("m.obj", "m.off"):
        meshio.write(path(name), mesh)
        check(f"{name[2:].upper()}, meshio", name, *as_meshio_reads(name))
    quads = meshio.Mesh(V, [("line", F[:5, :2]), ("vertex", F[:3, :1]), ("quad", Q)])
    for name in ("m.msh", "m.vtk", "m.vtu"):
        meshio.write(path(name), quads, **({"file_format": "gmsh22"} if name == "m.msh" else {}))
        check(f"quadrilaterals beside lines and points in {name[2:].upper()}, meshio", name)
    single = meshio.Mesh(V.astype(np.float32), [("triangle", F.astype(np.int32))])
    for name in ("m.vtk", "m.vtu", "m.ply"):
        meshio.write(path(name), single)
        check(f"single precision in {name[2:].upper()}, meshio", name, V32)


def as_meshio_reads(name):
    mesh = meshio.read(path(name))
    return mesh.points.astype(float), mesh.cells_dict["triangle"]


# ---- trimesh -------------------------------------------------------------------------------------


def trimesh_files():
    mesh = trimesh.Trimesh(V, F, process=False)
    for name, options in (
        ("m.obj", {"digits": 17}),
        ("m.off", {"digits": 17}),
        ("m.ply", {"encoding": "ascii"}),
        ("m.ply", {"encoding": "binary"}),
    ):
        mesh.export(path(name), **options)
        text = options.get("encoding") == "ascii"  # where it writes eight digits
        points = np.float32([[f"{x:.8f}" for x in v] for v in V32]).astype(float)
        points = points if text else as_meshio_reads(name)[0]
        check(f"{name[2:].upper()} {options}, trimesh", name, points)
    for kind in ("stl", "stl_ascii"):
        mesh.export(path("m.stl"), file_type=kind)
        check_corners(f"{kind.upper()}, trimesh", "m.stl", V32 if kind == "stl" else None)


@reported
def check_corners(name, points, tolerance=1e-7):
    """STL has no vertices: their order is that of their first corners."""
    p, f = read(name)
    order = np.unique(F.ravel(), return_index=True)[1]
    first = F.ravel()[np.sort(order)]
    number = np.empty(len(V), dtype=int)
    number[first] = np.arange(len(V))
    if points is not None:
        problem = difference(p, f, points[first], number[F])
    else:
        close = p.shape == V.shape and np.allclose(p, V[first], atol=tolerance)
        problem = None if close and np.array_equal(f, number[F]) else "another surface"
    return problem


# ---- Gmsh ----------------------------------------------------------------------------------------


def gmsh_files():
    gmsh.initialize(interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh_discrete()
    gmsh_made()
    gmsh_volume()
    gmsh.finalize()


def gmsh_write(name, version=4.1, binary=0, **options):
    gmsh.option.setNumber("Mesh.MshFileVersion", version)
    gmsh.option.setNumber("Mesh.Binary", binary)
    for key, value in options.items():
        gmsh.option.setNumber("Mesh." + key, value)
    gmsh.write(path(name))


def rounded(points, digits=16):
    """As Gmsh writes text."""
    return np.array([float(f"{x:.{digits}g}") for x in points.ravel()]).reshape(points.shape)


def gmsh_discrete():
    gmsh.model.add("ours")
    gmsh.model.addDiscreteEntity(2, 1)
    tags = 10 + 3 * np.arange(len(V))[::-1]  # neither dense nor rising
    gmsh.model.mesh.addNodes(2, 1, tags, V.ravel())
    gmsh.model.mesh.addElementsByType(1, 2, [], tags[F].ravel())
    for version, binary in itertools.product((2.2, 4.0, 4.1), (0, 1)):
        if version == 4.0 and binary:
            continue  # Gmsh writes no such file any more; meshio does
        gmsh_write("m.msh", version, binary)
        points = V if binary else rounded(V)
        check_gmsh(f"MSH {version}, {'binary' if binary else 'text'}, tags with gaps, Gmsh", points)
    gmsh_write("m.stl", binary=1)
    check_corners("STL, Gmsh", "m.stl", V32)


@reported
def check_gmsh(points):
    """Gmsh may write nodes in the order of their tags."""
    p, f = read("m.msh")
    flip = np.array_equal(p, points[::-1])
    wanted = len(V) - 1 - F if flip else F
    problem = difference(p, f, points[::-1] if flip else points, wanted)
    return problem


def gmsh_made():
    """A sphere by Gmsh's own mesher: with points and lines, parameters, quadrilaterals, order 2."""
    gmsh.model.add("sphere")
    gmsh.model.occ.addSphere(0, 0, 0, 1)
    gmsh.model.occ.synchronize()
    gmsh.option.setNumber("Mesh.MeshSizeMax", 0.4)
    gmsh.model.mesh.generate(2)
    for version, binary, parameters in itertools.product((2.2, 4.0, 4.1), (0, 1), (0, 1)):
        if version == 4.0 and binary:
            continue
        gmsh_write("m.msh", version, binary, SaveAll=1, SaveParametric=parameters)
        check_areas(f"MSH {version}, binary {binary}, parameters {parameters}: a whole model", 2,
                    [0, 1, 2])
    gmsh_write("m.vtk", binary=0)
    check_areas("VTK legacy, Gmsh", 2, [0, 1, 2], "m.vtk")
    gmsh_write("m.vtk", binary=1)
    check_areas("VTK legacy, binary, Gmsh", 2, [0, 1, 2], "m.vtk")
    gmsh.model.mesh.setOrder(2)
    for version, binary in itertools.product((2.2, 4.1), (0, 1)):
        gmsh_write("m.msh", version, binary)
        check_areas(f"MSH {version}, binary {binary}: second order in four", 9,
                    [0, 3, 5, 3, 1, 4, 5, 4, 2, 3, 4, 5])
    gmsh.model.mesh.setOrder(3)
    gmsh_write("m.msh")
    refused("MSH of third order is refused", "m.msh", "first-order")


@reported
def check_areas(kind, pattern, name="m.msh"):
    """Triangles in Gmsh's order, each at its place. Nodes of lines and points come first."""
    tags, points, _ = gmsh.model.mesh.getNodes()
    place = dict(zip(tags, points.reshape(-1, 3)))
    _, nodes = gmsh.model.mesh.getElementsByType(kind)
    nodes = nodes.reshape(-1, {2: 3, 9: 6}[kind])[:, pattern].reshape(-1, 3)
    wanted = np.array([[place[t] for t in triangle] for triangle in nodes])
    p, f = read(name)
    same = p[f].shape == wanted.shape and np.allclose(p[f], wanted, rtol=1e-14, atol=1e-15)
    problem = None if same else "other triangles"
    if len(p) != len(tags):
        problem = f"{len(p)} vertices instead of {len(tags)}"
    return problem


def gmsh_volume():
    gmsh.model.add("ball")
    gmsh.model.occ.addSphere(0, 0, 0, 1)
    gmsh.model.occ.synchronize()
    gmsh.model.mesh.generate(3)
    gmsh_write("m.msh", SaveAll=1)
    check_areas("MSH with tetrahedra beside its surface", 2, [0, 1, 2])
    gmsh.model.addPhysicalGroup(3, [1])
    gmsh_write("m.msh", SaveAll=0)
    refused("MSH of tetrahedra only is refused", "m.msh", "extract the surface")
    gmsh_write("m.vtk", binary=0)
    refused("VTK of tetrahedra only is refused", "m.vtk", "extract the surface")


# ---- VTK -----------------------------------------------------------------------------------------


def polydata(points=V, polygons=F, single=False):
    data = vtk.vtkPolyData()
    data.SetPoints(vtk_points(points, single))
    data.SetPolys(vtk_cells(polygons))
    values = numpy_to_vtk(np.arange(float(len(points))), deep=True)
    values.SetName("value")
    data.GetPointData().SetScalars(values)
    return data


def vtk_points(points, single):
    p = vtk.vtkPoints()
    p.SetData(numpy_to_vtk(points.astype(np.float32 if single else np.float64), deep=True))
    return p


def vtk_cells(cells):
    a = vtk.vtkCellArray()
    n, k = np.shape(cells)
    offsets = numpy_to_vtkIdTypeArray(np.arange(0, n * k + 1, k, dtype=np.int64), deep=True)
    a.SetData(offsets, numpy_to_vtkIdTypeArray(np.ravel(cells).astype(np.int64), deep=True))
    return a


def grid(points=V, polygons=F, single=False):
    data = vtk.vtkUnstructuredGrid()
    data.SetPoints(vtk_points(points, single))
    kind = {3: vtk.VTK_TRIANGLE, 4: vtk.VTK_QUAD}[np.shape(polygons)[1]]
    data.SetCells(kind, vtk_cells(polygons))
    return data


def vtk_write(writer, data, name):
    writer.SetInputData(data)
    writer.SetFileName(path(name))
    writer.Write()


def as_vtk_reads(reader, name):
    reader.SetFileName(path(name))
    reader.Update()
    return reader.GetOutput()


def xml_writers():
    """Every way that VTK's XML writers have to write an array."""
    for order, header in itertools.product(("little", "big"), (32, 64)):
        for mode, packed in itertools.product(("text", "inline", "raw", "base64"), (False, True)):
            if mode == "text" and (packed or order == "big" or header == 64):
                continue
            yield mode, packed, order, header


def set_up(writer, mode, packed, order, header):
    if mode == "text":
        writer.SetDataModeToAscii()
    elif mode == "inline":
        writer.SetDataModeToBinary()
    else:
        writer.SetDataModeToAppended()
        writer.SetEncodeAppendedData(mode == "base64")
    writer.SetCompressorTypeToZLib() if packed else writer.SetCompressorTypeToNone()
    writer.SetByteOrder(1 if order == "little" else 0)
    writer.SetHeaderType(header)
    writer.SetBlockSize(1024)  # so that there are many blocks


def vtk_xml_files():
    kinds = (("vtp", polydata, vtk.vtkXMLPolyDataWriter, vtk.vtkXMLPolyDataReader),
             ("vtu", grid, vtk.vtkXMLUnstructuredGridWriter, vtk.vtkXMLUnstructuredGridReader))
    for kind, make, new_writer, new_reader in kinds:
        for way in xml_writers():
            for single in (False, True):
                writer = new_writer()
                set_up(writer, *way)
                vtk_write(writer, make(single=single), "m." + kind)
                check(f"{kind.upper()} {way} {'single' if single else 'double'}, VTK", "m." + kind,
                      V32 if single else V)
        vtk_write(new_writer(), make(polygons=Q), "m." + kind)
        check(f"quadrilaterals in {kind.upper()}, VTK", "m." + kind)
        for compressor in ("LZ4", "LZMA"):
            writer = new_writer()
            getattr(writer, f"SetCompressorTypeTo{compressor}")()
            vtk_write(writer, make(), "m." + kind)
            refused(f"{kind.upper()} packed by {compressor} is refused", "m." + kind, "zlib")


def vtk_pieces():
    writer = vtk.vtkXMLPolyDataWriter()
    writer.SetNumberOfPieces(3)
    vtk_write(writer, polydata(), "m.vtp")
    out = as_vtk_reads(vtk.vtkXMLPolyDataReader(), "m.vtp")
    points = vtk_to_numpy(out.GetPoints().GetData())
    faces = vtk_to_numpy(out.GetPolys().GetConnectivityArray()).reshape(-1, 3)
    check("VTP in three pieces", "m.vtp", points, faces)


def vtk_mixed():
    """Lines and points beside the polygons; strips; nothing but lines."""
    data = polydata()
    data.SetLines(vtk_cells(F[:7, :2]))
    data.SetVerts(vtk_cells(F[:7, :1]))
    strips = vtk.vtkStripper()
    strips.SetInputData(polydata())
    strips.Update()
    stripped = strips.GetOutput()
    back = vtk.vtkTriangleFilter()
    back.SetInputData(stripped)
    back.Update()
    faces = vtk_to_numpy(back.GetOutput().GetPolys().GetConnectivityArray()).reshape(-1, 3)
    lines = vtk.vtkPolyData()
    lines.SetPoints(vtk_points(V, False))
    lines.SetLines(vtk_cells(F[:7, :2]))
    legacy = vtk.vtkPolyDataWriter()
    legacy.SetFileTypeToBinary()
    for name, writer in (("m.vtp", vtk.vtkXMLPolyDataWriter()), ("m.vtk", legacy)):
        vtk_write(writer, data, name)
        check(f"lines and points beside triangles in {name[2:].upper()}, VTK", name)
        vtk_write(writer, stripped, name)
        check(f"triangle strips in {name[2:].upper()}, VTK", name, V, faces)
        vtk_write(writer, lines, name)
        refused(f"{name[2:].upper()} of lines only is refused", name, "no face")
    image = vtk.vtkImageData()
    image.SetDimensions(3, 3, 3)
    vtk_write(vtk.vtkXMLImageDataWriter(), image, "m.vti")
    refused("VTK ImageData is refused", "m.vti", "extract the surface")
    vtk_write(vtk.vtkStructuredPointsWriter(), image, "m.vtk")
    refused("VTK structured points are refused", "m.vtk", "extract the surface")


def vtk_legacy_files():
    kinds = (("PolyData", polydata, vtk.vtkPolyDataWriter, vtk.vtkPolyDataReader),
             ("grid", grid, vtk.vtkUnstructuredGridWriter, vtk.vtkUnstructuredGridReader))
    for kind, make, new_writer, new_reader in kinds:
        for version, binary, single in itertools.product((42, 51), (False, True), (False, True)):
            writer = new_writer()
            writer.SetFileVersion(version)
            writer.SetFileType(2 if binary else 1)
            data = make(single=single)
            field = numpy_to_vtk(np.arange(6.0).reshape(2, 3), deep=True)
            field.SetName("field")
            data.GetFieldData().AddArray(field)
            vtk_write(writer, data, "m.vtk")
            out = as_vtk_reads(new_reader(), "m.vtk")
            points = vtk_to_numpy(out.GetPoints().GetData()).astype(float)
            if binary and not np.array_equal(points, V32 if single else V):
                report("VTK reads what it wrote", "it does not")
            text = "binary" if binary else "text"
            check(f"VTK legacy {version} {kind} {text} {'single' if single else 'double'}, VTK",
                  "m.vtk", points)


def vtk_others():
    for binary in (False, True):
        text = "binary" if binary else "text"
        writer = vtk.vtkPLYWriter()
        writer.SetFileType(2 if binary else 1)
        vtk_write(writer, polydata(), "m.ply")
        check(f"PLY {text}, VTK", "m.ply", *as_meshio_reads("m.ply"))
        writer = vtk.vtkSTLWriter()
        writer.SetFileType(2 if binary else 1)
        vtk_write(writer, polydata(), "m.stl")
        check_corners(f"STL {text}, VTK", "m.stl", V32 if binary else None, 1e-5)
    writer = vtk.vtkPLYWriter()
    writer.SetFileTypeToBinary()
    writer.SetDataByteOrderToBigEndian()
    vtk_write(writer, polydata(), "m.ply")
    check("PLY high byte first, VTK", "m.ply", V32)
    vtk_write(vtk.vtkOBJWriter(), polydata(), "m.obj")
    check("OBJ, VTK", "m.obj", *as_meshio_reads("m.obj"))


def pyvista_files():
    faces = np.hstack([np.full((len(F), 1), 3), F]).ravel()
    mesh = pyvista.PolyData(V, faces)
    mesh["value"] = np.arange(len(V))
    for name, binary in itertools.product(("m.vtp", "m.vtk"), (True, False)):
        mesh.save(path(name), binary=binary)
        points = np.asarray(pyvista.read(path(name)).points, dtype=float)
        text = "binary" if binary else "text"
        check(f"{name[2:].upper()} {text}, PyVista", name, points)
    for binary in (True, False):
        mesh.cast_to_unstructured_grid().save(path("m.vtu"), binary=binary)
        check(f"VTU {'binary' if binary else 'text'}, PyVista", "m.vtu")
    mesh.save(path("m.ply"))
    check("PLY, PyVista", "m.ply", *as_meshio_reads("m.ply"))


# ---- damaged files -------------------------------------------------------------------------------


def damaged_files():
    """Cut anywhere, a file is refused in words."""
    mesh = meshio.Mesh(V, [("triangle", F)])
    meshio.write(path("d.msh"), mesh)
    meshio.write(path("d22.msh"), mesh, file_format="gmsh22", binary=False)
    for version, name in ((42, "d42.vtk"), (51, "d51.vtk")):
        writer = vtk.vtkPolyDataWriter()
        writer.SetFileVersion(version)
        writer.SetFileType(2 if version == 42 else 1)
        data = polydata()
        data.GetPointData().Initialize()
        vtk_write(writer, data, name)
    for mode in ("text", "inline", "raw", "base64"):
        for packed in (False, True):
            if mode == "text" and packed:
                continue
            writer = vtk.vtkXMLPolyDataWriter()
            set_up(writer, mode, packed, "little", 64)
            data = polydata()
            data.GetPointData().Initialize()
            vtk_write(writer, data, f"d-{mode}-{packed}.vtp")
    for name in sorted(n for n in os.listdir(folder) if n.startswith("d")):
        with open(path(name), "rb") as file:
            whole = file.read()
        problem = None
        for share in (0.03, 0.2, 0.4, 0.6, 0.7, 0.8, 0.9):
            with open(path("cut"), "wb") as file:
                file.write(whole[: int(share * len(whole))])
            done = run("mesh", path("cut"), "--out", path("out.off"))
            if done.returncode != 3 or "cut" not in done.stderr:
                problem = f"cut at {share}: exit code {done.returncode}: {done.stderr}"
        report(f"{name} cut anywhere is refused", problem)


def lying_files():
    """Counts that the file cannot hold are refused before memory is asked for."""
    texts = {
        "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n99999999999\n1 0 0 0\n": "do not fit",
        "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n1 9 1 9\n2 1 0 9000000000\n1\n":
            "do not fit",
        "# vtk DataFile Version 3.0\nx\nASCII\nDATASET POLYDATA\nPOINTS 4000000000 float\n0 0 0":
            "do not fit",
        "# vtk DataFile Version 3.0\nx\nASCII\nDATASET POLYDATA\nPOINTS 1 float\n0 0 0\n"
        "POLYGONS 1 4000000000\n3 0 0 0": "do not fit",
        '<VTKFile type="PolyData"><PolyData><Piece NumberOfPoints="4000000000" NumberOfPolys="1">'
        '<Points><DataArray type="Float64" NumberOfComponents="3" format="ascii">0 0 0</DataArray>'
        "</Points></Piece></PolyData></VTKFile>": "",
        '<VTKFile type="PolyData"><PolyData><Piece NumberOfPoints="1" NumberOfPolys="900000000000">'
        '<Points><DataArray type="Float64" NumberOfComponents="3" format="ascii">0 0 0</DataArray>'
        '</Points><Polys><DataArray type="Int64" Name="connectivity" format="ascii">0</DataArray>'
        '<DataArray type="Int64" Name="offsets" format="ascii">3</DataArray></Polys></Piece>'
        "</PolyData></VTKFile>": "do not fit",
        '<!DOCTYPE x [<!ENTITY a "1 2 3">]><VTKFile type="PolyData"></VTKFile>': "DOCTYPE",
    }
    for k, (text, part) in enumerate(texts.items()):
        with open(path("lie"), "w") as file:
            file.write(text)
        refused(f"a lie of kind {k} is refused", "lie", part)


# ---- the tool's files ----------------------------------------------------------------------------


def our_meshes():
    mesh = meshio.Mesh(V, [("triangle", F)])
    meshio.gmsh.write(path("o.msh"), mesh, fmt_version="4.1", binary=True)
    for kind in ("off", "obj", "ply", "vtp", "vtu"):
        done = run("mesh", path("o.msh"), "--out", path("o." + kind), "--quiet")
        report(f"{kind.upper()} is written", done.stderr)
    for kind in ("off", "obj", "ply", "vtu"):
        report(f"meshio reads our {kind.upper()}", difference(*as_meshio_reads("o." + kind), V, F))
    for kind in ("off", "obj", "ply"):
        mesh = trimesh.load_mesh(path("o." + kind), process=False)
        problem = difference(np.array(mesh.vertices), np.array(mesh.faces), V, F)
        report(f"trimesh reads our {kind.upper()}", problem)
    for kind in ("vtp", "vtu", "ply", "obj"):
        mesh = pyvista.read(path("o." + kind))
        mesh = mesh if kind != "vtu" else mesh.extract_surface(algorithm=None, pass_pointid=False)
        points, faces = np.asarray(mesh.points, dtype=float), mesh.faces.reshape(-1, 4)[:, 1:]
        if kind in ("ply", "obj"):  # whose readers in VTK keep single precision
            same = np.array_equal(faces, F) and np.allclose(points, V, atol=1e-6)
        else:
            same = np.array_equal(points[faces], V[F])
        problem = None if same else "another surface"
        report(f"VTK reads our {kind.upper()}", problem)
    gmsh.initialize(interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.open(path("o.off"))
    n = len(gmsh.model.mesh.getNodes()[0])
    report("Gmsh reads our OFF", None if n == len(V) else f"{n} nodes")
    gmsh.finalize()


def our_results():
    solve = run("solve", path("o.vtp"), "--source", "3,0,0", "--quiet",
                *sum((["--out", path("r." + k)] for k in ("vtp", "vtu", "ply")), []),
                *sum((["--locus", path("l." + k)] for k in ("vtp", "obj", "csv")), []))
    report("a result is written", solve.stderr if solve.returncode else None)
    if solve.returncode:
        return
    readers = {"vtp": vtk.vtkXMLPolyDataReader(), "vtu": vtk.vtkXMLUnstructuredGridReader()}
    data = {kind: as_vtk_reads(reader, "r." + kind) for kind, reader in readers.items()}
    ply = trimesh.load(path("r.ply"), process=False).metadata["_ply_raw"]
    ply = {n: np.asarray(e["data"][n]).ravel()
           for e in (ply["vertex"], ply["face"]) for n in ("u", "distance", "mu", "acl")
           if n in e["properties"]}
    for kind, result in data.items():
        scalars = result.GetCellData().GetScalars()
        active = scalars.GetName() if scalars else None
        report(f"{kind.upper()}: viewers colour by mu", None if active == "mu" else active)
        problem = [n for n in ("mu", "acl") if not np.array_equal(
            vtk_to_numpy(result.GetCellData().GetArray(n)), ply[n])]
        problem += [n for n in ("u", "distance") if not np.array_equal(
            vtk_to_numpy(result.GetPointData().GetArray(n)), ply[n])]
        report(f"{kind.upper()} and PLY hold the same numbers", problem)
        source = vtk_to_numpy(result.GetFieldData().GetArray("source"))
        report(f"{kind.upper()} holds the source", None if abs(source[0, 0] - 3) < 0.1 else source)
    for kind in ("vtu", "ply"):
        mesh = meshio.read(path("r." + kind))
        same = np.array_equal(np.ravel(mesh.cell_data["mu"][0]), ply["mu"]) and \
            np.array_equal(mesh.point_data["distance"], ply["distance"])
        report(f"meshio reads our result, {kind.upper()}", None if same else "other numbers")
    results_elsewhere(len(ply["u"]), len(ply["mu"]))
    locus = as_vtk_reads(vtk.vtkXMLPolyDataReader(), "l.vtp")
    lengths = pyvista.wrap(locus).compute_cell_sizes()["Length"].sum()
    report("VTK reads our locus", None if 17 < lengths < 24 else f"length {lengths}")
    report("viewers colour the locus by strength",
           None if locus.GetCellData().GetScalars().GetName() == "strength" else "they do not")
    table = np.genfromtxt(path("l.csv"), delimiter=",", names=True)
    points = vtk_to_numpy(locus.GetPoints().GetData())
    same = np.array_equal(np.stack([table[c] for c in "xyz"], axis=1), points)
    report("CSV and VTP hold the same locus", None if same else "other points")
    lines = pyvista.wrap(as_vtk_reads(vtk.vtkOBJReader(), "l.obj"))
    length = lines.compute_cell_sizes()["Length"].sum()
    same = abs(length - lengths) < 1e-4 * lengths  # in single precision
    report("VTK reads our locus in OBJ", None if same else f"length {length}")


def results_elsewhere(n_vertices, n_faces):
    """Each result in PyVista and Gmsh; PLY with values of other commands in meshio."""
    for kind in ("ply", "vtp", "vtu"):
        grid = pyvista.read(path("r." + kind))
        problem = None if (grid.n_points, grid.n_cells) == (n_vertices, n_faces) else grid
        if kind != "ply" and not {"mu", "acl"} <= set(grid.cell_data.keys()):
            problem = grid.array_names
        report(f"PyVista reads our result, {kind.upper()}", problem)
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.open(path("r.ply"))
    found = len(gmsh.model.mesh.getNodes()[0]), sum(map(len, gmsh.model.mesh.getElements(2)[1]))
    report("Gmsh reads our result in PLY", None if found == (n_vertices, n_faces) else found)
    report("with its values as views", None if len(gmsh.view.getTags()) == 4 else gmsh.view.getTags())
    gmsh.finalize()
    run("distance", path("o.vtp"), "--vertex", "0", "--quiet", "--out", path("d.ply"))
    arrays = set(meshio.read(path("d.ply")).point_data)
    report("meshio reads distances in PLY", None if arrays == {"distance", "direction", "nearest"} else arrays)


def our_transport():
    """On a torus: with twice as many triangles as vertices meshio can take one array for another."""
    run("mesh", "torus", "--triangles", "1000", "--quiet", "--out", path("ring.off"))
    for name, vertex in ("a", 0), ("b", 100):
        with open(path(name), "w") as file:
            file.write(f"vertex {vertex} 1\n")
    run("transport", path("ring.off"), "--from", path("a"), "--to", path("b"), "--quiet", "--out", path("t.vtu"))
    try:
        mesh = meshio.read(path("t.vtu"))
        error = None if np.array_equal(mesh.cells_dict["triangle"], read("ring.off")[1]) else "other triangles"
    except (Exception, SystemExit) as failure:
        error = repr(failure)
    report("meshio reads a transport on a torus, VTU", error)


def our_pieces():
    """More triangles than a piece holds: an index and two files, which VTK opens as one mesh."""
    n = 360
    whole = pyvista.Plane(i_resolution=n, j_resolution=n).triangulate()
    whole.points = np.asarray(whole.points, dtype=float)
    whole.save(path("plane.vtp"))
    subprocess.run([tool, "mesh", path("plane.vtp"), "--quiet", "--out", path("plane.pvtp")], check=True)
    reader = vtk.vtkXMLPPolyDataReader()
    reader.SetFileName(path("plane.pvtp"))
    reader.Update()
    ours = pyvista.wrap(reader.GetOutput())
    same = np.array_equal(ours.points[ours.regular_faces], whole.points[whole.regular_faces])
    report("VTK reads our pieces as one", None if same else "other triangles")
    pieces = sorted(name for name in os.listdir(folder) if name.startswith("plane_"))
    report("a mesh of 259,200 triangles has two pieces",
           None if pieces == ["plane_0000.vtp", "plane_0001.vtp"] else pieces)
    wrong = subprocess.run([tool, "mesh", path("plane.vtp"), "--quiet", "--out", path("no/plane.pvtp")],
                           capture_output=True, check=False)
    report("no piece where the index cannot be", None if wrong.returncode != 0 else "it succeeded")
    subprocess.run([tool, "solve", path("sphere.off"), "--vertex", "0", "--quiet", "--out", path("p.vtp"),
                    "--out", path("p.pvtp")], check=True)
    reader = vtk.vtkXMLPPolyDataReader()
    reader.SetFileName(path("p.pvtp"))
    reader.Update()
    ours, one = pyvista.wrap(reader.GetOutput()), pyvista.read(path("p.vtp"))
    same = np.array_equal(ours.cell_data["mu"], one.cell_data["mu"]) and np.array_equal(
        ours.cell_data["acl"], one.cell_data["acl"]) and np.array_equal(
        ours["distance"][ours.regular_faces], one["distance"][one.regular_faces])
    report("pieces hold the result", None if same else "other values")


try:
    subprocess.run([tool, "mesh", "sphere", "--triangles", "1000", "--quiet", "--out", path("sphere.off")], check=True)
    our_pieces()
    meshio_files()
    trimesh_files()
    gmsh_files()
    vtk_xml_files()
    vtk_pieces()
    vtk_mixed()
    vtk_legacy_files()
    vtk_others()
    pyvista_files()
    damaged_files()
    lying_files()
    our_meshes()
    our_results()
    our_transport()
finally:
    shutil.rmtree(folder)
print(f"1..{count}")
