# All tests under ASan and UBSan; in short those in C, and the tool's on many sources.
. tests/checks/lib.sh

if [ "$short" ]; then
    tested 'C tests' make -s CONFIG=sanitize test TEST_SCRIPTS=tests/test_batch.sh
else
    tested 'make CONFIG=sanitize test' make -s CONFIG=sanitize test
fi
finish
