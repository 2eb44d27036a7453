# Memory over DMKCL_LONG solves in one process, in three ways; then eight threads at once.
. tests/checks/lib.sh
export DMKCL_LONG=${DMKCL_LONG:-1000}
try 'test_long' "$build/tests/test_long"
grep '^# ' "$work/said"
tried=$(awk '/^# [0-9]+ / { n += $2 } END { print n + 0 }' "$work/said")
finish
