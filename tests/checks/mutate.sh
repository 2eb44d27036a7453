# A sample of wrong changes of the sources, each of which a test has to notice: see tests/mutate/mutate.py.
# MUTANTS=N of the rooms that quick tests reach, tried by those; in short a few of two rooms, without counting lines.
# All rooms and tests: `make mutate`.
. tests/checks/lib.sh
if [ "${CHECK_SHORT:-}" ]; then
    exec python3 tests/mutate/mutate.py --direct --count "${MUTANTS:-8}" --rooms base,mesh --floor 0.8 \
        --tests 'base,mesh,number,parallel,repair,outfile'
fi
exec python3 tests/mutate/mutate.py --count "${MUTANTS:-24}" --rooms base,mesh,levels,surfaces \
    --tests 'base,mesh,number,parallel,outfile,coarsen,repair,surface,units,start' --floor 0.8
