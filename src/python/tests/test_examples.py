"""Each example runs as it stands and writes what it says."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = sorted((Path(__file__).parents[1] / "examples").glob("*.py"))


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_example(example, tmp_path):
    done = subprocess.run(
        [sys.executable, "-W", "error::DeprecationWarning:__main__", example],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() and "nan" not in done.stdout
    promised = re.findall(r'"([\w-]+\.(?:png|html|obj|vtp|vtu|ply))"', example.read_text())
    for name in promised:
        assert (tmp_path / name).stat().st_size > 0, name


def test_the_readme_runs(tmp_path):
    root = Path(__file__).parents[3]
    blocks = re.findall(r"^```python\n(.*?)^```", (root / "README.md").read_text(), re.M | re.S)
    assert blocks
    (tmp_path / "meshes").symlink_to(root / "meshes")
    for block in blocks:
        done = subprocess.run(
            [sys.executable, "-c", block], cwd=tmp_path, capture_output=True, text=True
        )
        assert done.returncode == 0, done.stderr
    assert (tmp_path / "torus.html").stat().st_size > 0


def test_the_readme_is_short_and_its_files_exist():
    root = Path(__file__).parents[3]
    text = (root / "README.md").read_text()
    assert len(text.splitlines()) <= 150
    names = re.findall(r"`([\w./-]+(?:/|\.(?:md|cff|h|py)))`", text) + re.findall(r"\]\(([^)]+)\)", text)
    assert len(names) > 8
    for name in names:
        if not name.startswith("build/"):
            places = (root / name, root / "include" / name)
            assert any(place.exists() for place in places), name


def test_there_are_examples():
    assert len(EXAMPLES) >= 6
