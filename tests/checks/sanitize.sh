# All tests under ASan and UBSan.
. tests/checks/lib.sh

tested 'make CONFIG=sanitize test' make -s CONFIG=sanitize test
finish
