# A sample of wrong changes of the sources, each of which a test has to notice: see tests/mutate/mutate.py.
# MUTANTS=N of the rooms whose tests are quick; all rooms: `make mutate`.
. tests/checks/lib.sh
exec python3 tests/mutate/mutate.py --count "${MUTANTS:-8}" --rooms base,mesh,io,levels --floor 0.7
