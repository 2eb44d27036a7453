"""Build the extension and the tool: the Makefile makes the static library, cffi the rest.

Nothing is written into the source tree: all goes to a temporary folder, or to the one that
DMKCL_BUILD names, which then saves what need not be built again. DMKCL_ARCH is the Makefile's ARCH
(gcc's -march); by default the wheel runs on any processor of the kind.
"""

import atexit
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from pathlib import Path

from setuptools import setup
from setuptools.command.build_ext import build_ext
from setuptools.command.build_py import build_py
from setuptools.command.sdist import sdist

HERE = Path(__file__).resolve().parent
# The repository, or the copy of what is needed of it that comes along in a source distribution.
NATIVE = HERE / "native"
ROOT = NATIVE if NATIVE.exists() else HERE.parents[1]
# What the library and the tool are built from.
SOURCES = ("Makefile", "LICENSE", "README.md", "CITATION.cff", ".ci/*packages", ".ci/deps.sh",
           "include/*", "kernels/*", "src/*/*.[ch]", "src/cli/man.sh", "src/docs/reference.awk")
NEEDED = (
    "gcc make libc6-dev libhwloc-dev ocl-icd-opencl-dev opencl-c-headers zlib1g-dev "
    "libexpat1-dev python3-dev"
)


def build_folder():
    named = os.environ.get("DMKCL_BUILD")
    if named:
        return Path(named).resolve()
    made = tempfile.mkdtemp(prefix="dmkcl-build-")
    atexit.register(shutil.rmtree, made, ignore_errors=True)
    return Path(made)


def version():
    header = (ROOT / "include/dmkcl.h").read_text()
    numbers = re.findall(r"#define DMK_VERSION_(?:MAJOR|MINOR|PATCH) (\d+)", header)
    return ".".join(numbers)


if not (ROOT / "include/dmkcl.h").exists():
    sys.exit("The C sources are missing here: install from the repository or a source distribution")
BUILD = build_folder()
OBJECTS = BUILD / "lib"
SETUP = BUILD / "setup"
for folder in (OBJECTS, SETUP):
    folder.mkdir(parents=True, exist_ok=True)
os.environ["DMKCL_ROOT"] = str(ROOT)
os.environ["DMKCL_OBJECTS"] = str(OBJECTS)


def make_library():
    """libdmkcl.a and the tool, by the Makefile, which need not look for the tests' packages."""
    packages = OBJECTS / "packages.ok"
    packages.touch()
    command = [
        "make",
        "-s",
        "-C",
        str(ROOT),
        f"B={OBJECTS}",
        f"PACKAGES={packages}",
        "CONFIG=release",
        "ARCH=" + os.environ.get("DMKCL_ARCH", ""),
        "CFLAGS=-Wno-error",
        f"-j{os.cpu_count() or 1}",
        str(OBJECTS / "libdmkcl.a"),
        str(OBJECTS / "dmkcl"),
    ]
    # A make that called pip has its own flags and variables in the environment.
    clean = {
        k: v for k, v in os.environ.items() if k not in ("MAKEFLAGS", "MFLAGS", "MAKEOVERRIDES")
    }
    try:
        done = subprocess.run(command, env=clean).returncode == 0
    except FileNotFoundError:
        done = False
    if not (done and (Path(sysconfig.get_path("include")) / "Python.h").exists()):
        sys.exit(
            f"The C library did not build, or Python.h is missing. On Debian that needs {NEEDED}"
        )


class BuildExtension(build_ext):
    def run(self):
        make_library()
        super().run()


class SourceDistribution(sdist):
    """Takes along the C sources."""

    def make_release_tree(self, base_dir, files):
        super().make_release_tree(base_dir, files)
        for pattern in SOURCES:
            for path in sorted(ROOT.glob(pattern)):
                to = Path(base_dir) / "native" / path.relative_to(ROOT)
                self.mkpath(str(to.parent))
                self.copy_file(str(path), str(to))
        self.copy_file(str(HERE / "build_ffi.py"), str(Path(base_dir) / "build_ffi.py"))
        self.copy_file(str(ROOT / "LICENSE"), str(Path(base_dir) / "LICENSE"))


class BuildPackage(build_py):
    """Puts the tool and the licence beside the modules; in an editable install, in the sources."""

    def run(self):
        super().run()
        make_library()
        package = (HERE if self.editable_mode else Path(self.build_lib)) / "dmkcl"
        self.mkpath(str(package))
        self.copy_file(str(OBJECTS / "dmkcl"), str(package / "dmkcl"))
        self.copy_file(str(ROOT / "LICENSE"), str(package / "LICENSE"))


setup(
    version=version(),
    long_description=(ROOT / "README.md").read_text(encoding="utf-8"),
    long_description_content_type="text/markdown",
    license="MIT",
    cffi_modules=["build_ffi.py:ffi"],
    cmdclass={"build_ext": BuildExtension, "build_py": BuildPackage, "sdist": SourceDistribution},
    options={
        "build": {"build_base": str(BUILD / "build")},
        "egg_info": {"egg_base": str(SETUP)},
        "bdist_wheel": {"py_limited_api": "cp310"},
    },
)
