# A sample of wrong changes of the sources, each of which a test has to notice: see tests/mutate/mutate.py.
# MUTANTS=N of the rooms that quick tests reach, tried by those; all rooms and tests: `make mutate`.
. tests/checks/lib.sh
exec python3 tests/mutate/mutate.py --count "${MUTANTS:-24}" --rooms base,mesh,levels,surfaces \
    --tests 'base,mesh,number,parallel,outfile,coarsen,repair,surface,units,start' --floor 0.8
