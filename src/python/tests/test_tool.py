"""The package as it is installed: the tool, types, version, the wheel's parts."""

import importlib.metadata
import inspect
import subprocess
import sys
from functools import cached_property
from pathlib import Path

import pytest

import dmkcl


def tool(*words):
    return subprocess.run([sys.executable, "-m", "dmkcl", *words], capture_output=True, text=True)


def test_module_is_the_tool(tmp_path):
    said = tool("--version")
    assert said.returncode == 0 and said.stdout.split() == ["dmkcl", dmkcl.__version__]
    assert tool("mesh", "sphere", "--out", str(tmp_path / "s.off")).returncode == 0
    assert dmkcl.read(tmp_path / "s.off").info["euler"] == 2
    wrong = tool("slove")
    assert wrong.returncode == 1 and "solve" in wrong.stderr


def test_versions_agree():
    assert importlib.metadata.version("dmkcl") == dmkcl.__version__ == dmkcl.version()


def test_everything_public_is_documented():
    for name in dmkcl.__all__:
        thing = getattr(dmkcl, name)
        assert inspect.getdoc(thing), name
        for part, member in vars(thing).items() if inspect.isclass(thing) else ():
            if not part.startswith("_") and (
                inspect.isfunction(member) or isinstance(member, (property, cached_property))
            ):
                assert member.__doc__, f"{name}.{part}"


def test_typed_and_whole():
    folder = Path(dmkcl.__file__).parent
    for part in ("py.typed", "viewer.html", "viewer.js", "dmkcl", "LICENSE"):
        assert (folder / part).exists(), part


def test_only_numpy_is_needed(tmp_path):
    """Pictures and files of others are extras: without them the rest works."""
    code = """
import sys
for name in ("pyvista", "vtk", "matplotlib", "trimesh", "meshio", "tqdm"):
    sys.modules[name] = None
import dmkcl
result = dmkcl.CutLocus(dmkcl.surfaces.sphere(n_triangles=800)).solve(vertex=0)
result.export_html(sys.argv[1])
print(result.locus.length)
"""
    assert subprocess.run([sys.executable, "-c", code, tmp_path / "x.html"]).returncode == 0


@pytest.mark.parametrize("needed", ["libOpenCL", "libhwloc"])
def test_what_stays_shared(needed):
    folder = Path(dmkcl.__file__).parent
    said = subprocess.run(["ldd", next(folder.glob("_dmkcl*.so"))], capture_output=True, text=True)
    assert needed in said.stdout and "libdmkcl" not in said.stdout
