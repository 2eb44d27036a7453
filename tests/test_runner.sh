# The judge of test outputs: what must count as a failure does.
. tests/tap.sh

not() { ! "$@"; }
judge() { # STATUS TEXT: the three counts
    printf "$2" | awk -v name=x -v status="$1" -f tests/tap.awk | tail -n 1
}
counts() { # NAME STATUS TEXT COUNTS
    check "$1" test "$(judge "$2" "$3")" = "$4"
}

counts 'passes are counted' 0 '1..2\nok 1 - a\nok 2 - b\n' '2 0 0'
counts 'several groups are added up' 0 '1..1\nok 1 - a\n1..1\nok 1 - b\n' '2 0 0'
counts 'a failure is counted' 1 '1..2\nok 1 - a\nnot ok 2 - b\n# why\n' '1 1 0'
counts 'a failure behind other text is seen' 1 '1..1\ntextnot ok 1 - b\n' '0 1 0'
counts 'a skip is no pass and no failure' 0 '1..2\nok 1 - a\nwhy\nnot ok 2 # SKIP b\n' '1 0 1'
counts 'no plan is a failure' 0 '' '0 1 0'
counts 'an empty plan is a failure' 0 '1..0\n' '0 1 0'
counts 'an end before the last test is a failure' 0 '1..3\nok 1 - a\nok 2 - b\n' '2 1 0'
counts 'a crash after the last test is a failure' 139 '1..1\nok 1 - a\n' '1 1 0'
counts 'a bad status alone is a failure' 3 '1..1\nok 1 - a\n' '1 1 0'

# A test that fails the first time, with the words of its argument.
cat > "$work/once.sh" << 'EOF'
[ -e "$0.again" ] && { printf '1..1\nok 1 - a\n'; exit 0; }
touch "$0.again"
printf '1..1\nok 1 - a\n%s\n' "$WORDS"
exit 23
EOF
once() { # WORDS RESULT
    rm -f "$work/once.sh.again"
    test "$(WORDS=$1 sh tests/run.sh "$DMKCL_BUILD/runner" "$work/once.sh" | tail -n 1)" = "$2"
}
check 'a crash of the leak checker is no failure' \
    once '==1==LeakSanitizer has encountered a fatal error.' '1 passed, 0 failed'
check 'a leak is a failure' once '==1==ERROR: LeakSanitizer: detected memory leaks' '1 passed, 1 failed'

# Tests side by side: what they have printed and their counts, one that is not there too.
printf 'printf "1..1\\nok 1 - a\\n"' > "$work/good.sh"
side_by_side() {
    test "$(TEST_JOBS=3 sh tests/run.sh "$DMKCL_BUILD/runner" "$work/good.sh" "$work/missing.sh" "$work/once.sh" | tail -n 1)" = \
        '2 passed, 1 failed'
}
check 'tests that run side by side are added up' side_by_side

no_blanks() {
    mkdir "$work/a b" && ln -s "$PWD/tests" "$work/a b/tests" || return
    echo 'echo 1..1; case $TMPDIR in *" "*) echo not ok 1 - a ;; *) echo ok 1 - a ;; esac' > "$work/a b/x.sh"
    test "$(cd "$work/a b" && sh tests/run.sh build x.sh | tail -n 1)" = '1 passed, 0 failed'
}
check 'files of tests are where there are no blanks' no_blanks

german() {
    localedef -i de_DE -f UTF-8 "$work/de_DE.UTF-8" && test 5.5 = "$(LOCPATH=$work LC_ALL=de_DE.UTF-8 \
        bash -c '. tests/tap.sh; echo 2.75 | awk "{ print 2 * \$1 }"')"
}
check 'numbers have points in any locale' german

# What must be no JSON.
check 'JSON is JSON' is_json <(echo '{"a": [1, -2.5e-3, "x\\n", null]}')
for text in '' '{"a": 1' '{"a": 1} {}' '[1]' '{"a": nan}'; do
    check "no JSON: '$text'" not is_json <(printf '%s' "$text")
done
check 'nor is a file that is missing' not is_json "$work/missing.json"
tap_end
