# A few of the random hostile meshes of `make hostile`, whose first ones are of all kinds.
. tests/tap.sh

python3 tests/hostile.py "$tool" "${HOSTILE:-14}" > "$work/hostile"
check 'random meshes through all commands' test $? -eq 0
sed 's/^/# /' "$work/hostile"
tap_end
