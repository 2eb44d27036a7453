"""The pages of `make docs`: complete, and the tutorial runs."""

import re
import subprocess
from pathlib import Path

import nbclient
import nbformat
import pytest

import dmkcl

ROOT = Path(__file__).parents[3]
DOCS = ROOT / "src/docs"


def test_the_tutorial_runs(tmp_path, monkeypatch):
    monkeypatch.delenv("MPLBACKEND")  # the notebook's own: pictures are outputs
    notebook = nbformat.read(DOCS / "tutorial.ipynb", as_version=4)
    assert not any(cell.get("outputs") for cell in notebook.cells), "stored without outputs"
    nbclient.NotebookClient(
        notebook, timeout=120, kernel_name="python3", resources={"metadata": {"path": tmp_path}}
    ).execute()
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    assert sum("image/png" in output.get("data", {}) for output in outputs) >= 3
    assert any("<iframe" in output.get("data", {}).get("text/html", "") for output in outputs)


def test_every_page_is_in_the_contents():
    index = (DOCS / "index.md").read_text()
    listed = set(re.findall(r"^([\w/]+)$", index, re.M))
    pages = {str(p.relative_to(DOCS).with_suffix("")) for p in DOCS.rglob("*.md")}
    pages |= {str(p.relative_to(DOCS).with_suffix("")) for p in DOCS.rglob("*.ipynb")}
    assert listed == pages - {"index", "README"}


@pytest.mark.parametrize("page", sorted((DOCS / "methods").glob("*.md")), ids=lambda p: p.stem)
def test_each_algorithm_has_formula_picture_and_sources(page):
    text = page.read_text()
    for name in re.findall(r"{include} (\S+)", text):
        text += (page.parent / name).read_text()
    assert "$$" in text or "W1 = min" in text
    assert re.search(r"!\[[^]]+\]\([^)]+\.png\)", text)
    assert len(re.findall(r"^- [A-Z]\. ", text, re.M)) >= 1 or page.stem == "certificate"
    drawn = (DOCS / "pictures.py").read_text()
    for name in re.findall(r"\.\./pictures/(\w+)\.png", text):
        assert f'"{name}")' in drawn


def test_the_python_page_names_everything():
    text = (DOCS / "python.md").read_text()
    named = set(re.findall(r"dmkcl\.(\w+)", text))
    assert set(dmkcl.__all__) <= named


def test_the_tool_page_has_every_command():
    text = (DOCS / "tool.md").read_text()
    table = (ROOT / "src/cli/main.c").read_text()
    commands = set(re.findall(r'^    \{"(\w+)", ', table, re.M))
    assert len(commands) >= 9
    assert commands == set(re.findall(r"\{program-output\} dmkcl help (\w+)", text))


def test_the_c_page_shows_every_section_of_the_header():
    header = (ROOT / "include/dmkcl.h").read_text()
    shown = subprocess.run(
        ["awk", "-f", DOCS / "header.awk", ROOT / "include/dmkcl.h"],
        capture_output=True, text=True, check=True,
    ).stdout
    groups = re.findall(r"@defgroup (section-\d+) (.*)", shown)
    page = (DOCS / "c.md").read_text()
    assert [f"{title}: {group}" for group, title in groups] == [
        f"{title}: {group}"
        for title, group in re.findall(r"## (.*)\n\n```\{doxygengroup\} (section-\d+)", page)
    ]
    assert shown.count("@{") == shown.count("@}")

    def functions(text):
        return re.findall(r"(dmk_\w+)\(", re.sub(r"/\*.*?\*/", "", text, flags=re.S))

    assert functions(shown) == functions(header)
