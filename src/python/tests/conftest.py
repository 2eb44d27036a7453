"""What the tests share: a solved torus, and TAP for the repository's test runner."""

import os
from pathlib import Path

import pytest

os.environ.setdefault("MPLBACKEND", "Agg")
os.environ.setdefault("PYVISTA_OFF_SCREEN", "true")

import dmkcl  # noqa: E402


@pytest.fixture(scope="session")
def torus():
    """Radii 2 and 1, some 22,000 triangles, vertex 0 at (3, 0, 0)."""
    return dmkcl.surfaces.torus(refine=1, source=(3, 0, 0))


@pytest.fixture(scope="session")
def solver(torus):
    return dmkcl.CutLocus(torus)


@pytest.fixture(scope="session")
def result(solver):
    return solver.solve(vertex=0)


@pytest.fixture(scope="session")
def small():
    """A sphere of some 1,300 triangles."""
    return dmkcl.surfaces.sphere(n_triangles=1300)


@pytest.fixture(scope="session")
def examples():
    return Path(__file__).parents[1] / "examples"


class Tap:
    """A line for each test: "ok K - name", "not ok K - name" and why, or "ok K # SKIP name"."""

    def __init__(self):
        self.count = 0

    def line(self, result, name, text=""):
        self.count += 1
        shown = "".join(f"# {line}\n" for line in text.splitlines())
        print(f"{result} {self.count} {name}\n{shown}", end="", flush=True)

    def pytest_runtest_logreport(self, report):
        name = report.nodeid.split("tests/")[-1]
        if report.skipped:
            print(report.longrepr[2])
            self.line("ok", f"# SKIP {name}")
        elif report.failed:
            self.line("not ok", f"- {name} ({report.when})", report.longreprtext)
        elif report.when == "call":
            self.line("ok", f"- {name}")

    def pytest_collectreport(self, report):
        if report.failed:
            self.line("not ok", f"- collecting {report.nodeid}", report.longreprtext)

    def pytest_sessionfinish(self):
        print(f"1..{self.count}", flush=True)


def pytest_addoption(parser):
    parser.addoption("--tap", action="store_true", help="print TAP; give -p no:terminal too")


def pytest_configure(config):
    if config.getoption("tap"):
        config.pluginmanager.register(Tap())
