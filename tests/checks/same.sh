# The same answer: threads, devices, shapes, precisions, numberings, turns, scales; the long form.
. tests/checks/lib.sh
export DMKCL_SAME=long
tested 'the same answer' sh tests/run.sh "$build" "$build/tests/test_same" tests/test_same.sh
finish
