"""The pages of `make docs`: complete, and the tutorial runs."""

import inspect
import re
import subprocess
from pathlib import Path

import nbclient
import nbformat
import pytest

import dmkcl
import dmkcl.plotting

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
    assert page.count(":members:\n:undoc-members:\n") == len(groups)  # of structs all members, those without a word too

    def functions(text):
        return re.findall(r"(dmk_\w+)\(", re.sub(r"/\*.*?\*/", "", text, flags=re.S))

    assert functions(shown) == functions(header)


def documented():
    """Every public class and function, methods and properties too, that has a docstring: its name, it, the docstring."""
    named = {**vars(dmkcl.plotting), **vars(dmkcl.surfaces), **vars(dmkcl)}
    own = {name: value for name, value in named.items() if getattr(value, "__module__", "").startswith("dmkcl")}
    for name, value in own.items():
        if name.startswith("_"):
            continue
        yield name, value, inspect.getdoc(value) or ""
        for member, inside in vars(value).items() if isinstance(value, type) else ():
            if not member.startswith("_"):
                yield f"{name}.{member}", inside, inspect.getdoc(inside) or ""


def sections(docstring):
    """By title the lines that begin an entry: a section goes up to the next title."""
    parts = re.split(r"^(\w+)\n-+\n", docstring, flags=re.M)
    return {title: re.findall(r"^\S.*", text, re.M) for title, text in zip(parts[1::2], parts[2::2])}


def test_what_parameters_are_said_to_be_is_a_parameter():
    seen = set()
    for name, value, docstring in documented():
        names = [word for line in sections(docstring).get("Parameters", []) for word in line.split(" : ")[0].split(", ")]
        if names:
            assert set(names) <= set(inspect.signature(value).parameters), name
            seen.add(name)
    assert seen >= {"Mesh", "CutLocus", "CutLocus.solve", "solve_meshes", "Geodesics", "plot"}


def test_no_attribute_is_described_twice():
    for name, value, docstring in documented():
        lines = sections(docstring).get("Attributes", [])
        twice = [word for line in lines for word in line.split(" : ")[0].split(", ") if word in vars(value)]
        assert not twice, f"{name}: {twice}"
