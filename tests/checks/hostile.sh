# Bad meshes, each with what is to come of it.
. tests/checks/lib.sh
tested 'bad meshes' sh tests/run.sh "$build" "$build"/tests/test_hostile $(ls tests/test_hostile*.sh 2> /dev/null)
finish
