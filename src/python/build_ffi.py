"""What cffi needs: the declarations of the real header, and how to link the static library."""

import os
import re
from pathlib import Path

from cffi import FFI

ROOT = Path(os.environ["DMKCL_ROOT"])
BUILD = Path(os.environ["DMKCL_OBJECTS"])


def declarations(text):
    """The header as cffi reads it: no comments, no preprocessor but `#define NAME NUMBER` of whole numbers; others are
    constants."""
    text = re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL)
    text = re.sub(r"#ifdef __cplusplus.*?#endif", "", text, flags=re.DOTALL)
    text = re.sub(r"^#define (\w+) \d\S*[.e]\S+$", r"static const double \1;", text, flags=re.M)
    lines = [
        line
        for line in text.splitlines()
        if not line.startswith("#") or re.fullmatch(r"#define \w+ \d+\s*", line)
    ]
    return "\n".join(lines)


def libraries(makefile):
    """What the Makefile links the library with, without -l."""
    return re.findall(r"-l(\w+)", re.search(r"^LDLIBS := (.*)$", makefile, re.M)[1])


ffi = FFI()
ffi.cdef(declarations((ROOT / "include/dmkcl.h").read_text()))
ffi.cdef("""
    extern "Python" int dmkcl_python_progress(const dmk_progress *progress, void *user);
    void free(void *memory);
""")
ffi.set_source(
    "dmkcl._dmkcl",
    '#include "dmkcl.h"\n#include <stdlib.h>\n',
    include_dirs=[str(ROOT / "include")],
    extra_objects=[str(BUILD / "libdmkcl.a")],
    # In a build folder that is kept, linked again when one of these is newer.
    depends=[str(BUILD / "libdmkcl.a"), str(ROOT / "include/dmkcl.h"), str(ROOT / "Makefile")],
    libraries=libraries((ROOT / "Makefile").read_text()),
    # The library's own symbols stay inside: another libdmkcl in the process does no harm.
    extra_link_args=["-Wl,--exclude-libs,ALL", "-Wl,--as-needed"],
)
