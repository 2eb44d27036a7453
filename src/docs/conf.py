"""The HTML pages, by Sphinx: MyST for the text, Breathe over Doxygen's XML for the C interface, autodoc for Python, the
tool's own help for the tool. `make docs` calls it."""

import os
import sys
from pathlib import Path

import latex2mathml.converter

import dmkcl

HERE = Path(__file__).parent
os.environ["PATH"] = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"

project = "dmkcl"
version = release = dmkcl.__version__
copyright = "the dmkcl developers"
language = "en"
suppress_warnings = ["duplicate_declaration.c", "ref.python"]  # typedef struct x {...} x; attributes of two classes
extensions = [
    "breathe",
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinxcontrib.programoutput",
]
exclude_patterns = ["README.md", "requirements.txt"]
templates_path = []

html_theme = "furo"
html_title = f"dmkcl {version}"
html_show_sphinx = html_show_copyright = False
html_copy_source = False
html_math_renderer = "mathml"

myst_enable_extensions = ["dollarmath", "colon_fence"]
myst_heading_anchors = 3
nb_execution_mode = "force"
nb_execution_raise_on_error = True
nb_execution_timeout = 300

breathe_projects = {"dmkcl": os.environ["DMKCL_DOXYGEN"]}
breathe_default_project = "dmkcl"
breathe_domain_by_extension = {"h": "c"}

autodoc_default_options = {"members": True, "member-order": "bysource"}
autodoc_typehints = "description"
autodoc_typehints_description_target = "documented"
napoleon_use_rtype = False


def formula(display):
    """Formulas as MathML, which browsers show by themselves: the pages need no network."""

    def visit(self, node):
        from docutils.nodes import SkipNode

        text = latex2mathml.converter.convert(node.astext(), display=display)
        self.body.append(f"<p>{text}</p>" if display == "block" else text)
        raise SkipNode

    return visit


def whole_sentences(app, what, name, obj, options, lines):
    """What napoleon takes for the type of a property or attribute is the beginning of its sentence: back to its place."""
    begin, colon = 0, ": "
    for i, line in enumerate(lines):
        if line.startswith(".. attribute::"):
            begin, colon = i + 1, " "
        if not line.lstrip().startswith(":type: "):
            continue
        indent, text = line[: -len(line.lstrip())], line.split(":type: ", 1)[1]
        rest = [k for k in range(begin, i) if lines[k].strip()]
        if rest:
            text += colon + lines[rest[0]].lstrip()
        lines[i] = ""
        lines[rest[0] if rest else i] = indent + text


def no_field_numbers(app, what, name, obj, skip, options):
    """Of a named tuple's fields Python only says their numbers; the words on them stand with the class."""
    return True if str(getattr(obj, "__doc__", "")).startswith("Alias for field number") else None


def setup(app):
    app.connect("autodoc-skip-member", no_field_numbers)
    app.connect("autodoc-process-docstring", whole_sentences, priority=600)
    app.add_html_math_renderer("mathml", (formula("inline"), None), (formula("block"), None))
