#!/bin/bash
# Files written by other programs (meshio, trimesh, Gmsh, VTK, PyVista) are read bit for bit, and ours by
# them: see tests/formats.py.
if ! sh tests/pyenv.sh; then
    echo 'not ok 1 - the packages of tests/requirements.txt are there'
    echo '1..1'
    exit 1
fi
exec build/pyenv/bin/python tests/formats.py "$DMKCL_BUILD/dmkcl"
