# A sample of wrong changes of the sources, each of which a test has to notice: see tests/mutate/mutate.py.
# MUTANTS=N of the rooms whose tests are quick; all rooms: `make mutate`. Of 52 changes in all rooms 58 % were
# noticed; a sample of 8 is far below that only where tests do not run at all.
. tests/checks/lib.sh
exec python3 tests/mutate/mutate.py --count "${MUTANTS:-8}" --rooms base,mesh,io,levels --floor 0.25
