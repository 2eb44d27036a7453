"""The package's types, and what they find in a user's program: mypy, where it is installed."""

import subprocess
import sys
from pathlib import Path

import dmkcl
import pytest

pytest.importorskip("mypy")
PACKAGE = Path(dmkcl.__file__).parent
RIGHT = """
import dmkcl

solver = dmkcl.CutLocus(dmkcl.surfaces.torus())
result = solver.solve(vertex=0, method="euler", tolerance=1e-3, progress=True)
length: float = result.path(vertex=5).length
"""


def mypy(*arguments):
    command = [sys.executable, "-m", "mypy", "--strict", "--ignore-missing-imports"]
    return subprocess.run(
        [*command, "--cache-dir=/dev/null", *map(str, arguments)], capture_output=True, text=True
    )


def test_the_package_is_strictly_typed():
    done = mypy(PACKAGE)
    assert done.returncode == 0, done.stdout


def test_right_programs_pass_and_typos_do_not(tmp_path):
    path = tmp_path / "program.py"
    path.write_text(RIGHT)
    done = mypy(path)
    assert done.returncode == 0, done.stdout
    for right, wrong in (("tolerance", "tolerence"), ('"euler"', '"oiler"'), ("float", "str")):
        path.write_text(RIGHT.replace(right, wrong))
        assert mypy(path).returncode == 1, wrong
