# A short run of the fuzzing drivers, under sanitizers; `make fuzz` is the long one.
. tests/tap.sh

if make --no-print-directory CONFIG=sanitize replayers > "$work/made" 2>&1; then
    tried() { # DRIVER EXECUTIONS
        (cd "$work" && ASAN_OPTIONS=$ASAN_OPTIONS:abort_on_error=1 "$OLDPWD/build/sanitize/replay/$1" "$2" "$OLDPWD/tests/fuzz/corpus/$1" 2> err |
            grep -x "# tried $2: failed 0") || { cat "$work/err"; od -c "$work/fuzz-failure"; return 1; }
    }
    check 'all readers of meshes' tried mesh 100000
    check 'numbers' tried number 200000
    check 'files of sources' tried sources 100000
    check 'the work on whatever surface' tried surface 500
else
    check 'the drivers are built' sh -c "cat '$work/made'; false"
fi
tap_end
