"""The package's types, and what they find in a user's program: mypy, where it is installed."""

import subprocess
import sys

import pytest

pytest.importorskip("mypy")
RIGHT = """
import numpy as np

import dmkcl

solver = dmkcl.CutLocus(dmkcl.surfaces.torus())
result = solver.solve(vertex=0, method="euler", tolerance=1e-3, progress=True)
length: float = result.path(vertex=5).length
result.plot(contours=3)
dmkcl.solve_meshes(["a.off"], gap=0.1)
v, several = np.int64(3), np.arange(3)
solver.solve(vertex=v, max_steps=np.int32(9)).path(face=v)
solver.solve_many(vertices=several)
dmkcl.CutLocus("a.off", device=v, threads=v)
dmkcl.Geodesics(solver.mesh, v, sources=several, vertices=[v, 4], curve=several)
dmkcl.shortest_path("a.off", v, 99)
dmkcl.shortest_path("a.off", start=v, end=99)
dmkcl.shortest_path(solver.mesh.vertices, solver.mesh.faces, v, 99)
dmkcl.surfaces.torus(n_triangles=v, refine=np.uint8(1))
dmkcl.cut_open("a.off", strength=0.1)
place = solver.mesh.at_face(3)
dmkcl.shortest_path("a.off", None, place, 99)
solver.solve(point=place).path(point=place)
solver.solve_many(points=[(3, 0, 0), place])
dmkcl.Geodesics(solver.mesh, points=[place, [1, 0, 0], np.zeros(3)]).at(((1, 0, 0), (0, 1.5, 0)))
dmkcl.Measure(points=np.zeros((2, 3))) == dmkcl.Measure(points=[place])
"""


# What results are handed to or drawn with is not read: ten times as many lines as all the rest.
OPTIONS = """
[mypy]
strict = True
ignore_missing_imports = True
[mypy-IPython.*,PIL.*,meshio.*,pyvista.*,trimesh.*]
follow_imports = skip
"""


@pytest.fixture(scope="module")
def mypy(tmp_path_factory):
    cache = tmp_path_factory.mktemp("mypy")
    (cache / "mypy.ini").write_text(OPTIONS)
    command = [sys.executable, "-m", "mypy", "--config-file", cache / "mypy.ini", "--cache-dir", cache]

    def run(*arguments):
        return subprocess.run([*command, *map(str, arguments)], capture_output=True, text=True)

    return run


def test_the_package_is_strictly_typed(mypy):
    done = mypy("-p", "dmkcl")
    assert done.returncode == 0, done.stdout


def test_right_programs_pass_and_typos_do_not(mypy, tmp_path):
    path = tmp_path / "program.py"
    path.write_text(RIGHT)
    done = mypy(path)
    assert done.returncode == 0, done.stdout
    for right, wrong in (
        ("tolerance", "tolerence"), ('"euler"', '"oiler"'), ("float", "str"), ("contours", "contour"), ("gap", "gab"),
        ("strength", "strenght"), ("points=[place]", "points=3"),
    ):  # fmt: skip
        path = tmp_path / f"{wrong.strip(chr(34))}.py"  # mypy knows a file by its size and second
        path.write_text(RIGHT.replace(right, wrong))
        assert mypy(path).returncode == 1, wrong
