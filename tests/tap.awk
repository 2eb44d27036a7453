# Judge the output of one test program. Variables: name, status (its exit status), seconds (that it took).
# Prints a line on the program, its failures and skips with what it said about them, and at last the
# three counts: passed failed skipped.
# A result may follow the program's own text on one line; cmocka 1.1.5 calls a skip "not ok K # SKIP".

match($0, /(not )?ok [0-9]+ (-|# SKIP)/) {
    result = substr($0, RSTART)
    if (RSTART > 1) said = said "      " substr($0, 1, RSTART - 1) "\n"
    label = result
    sub(/^(not )?ok [0-9]+ (- )?/, "", label)
    results++
    in_failure = 0
    if (label ~ /^# SKIP/) {
        skipped++
        text = text "    skipped: " substr(label, 8) "\n" said
    } else if (result ~ /^not/) {
        failed++
        text = text "    FAILED: " label "\n" said
        in_failure = 1
    } else {
        passed++
    }
    said = ""
    next
}
/^1\.\.[0-9]+/ { planned += substr($0, 4); next }
in_failure && /^#/ { text = text "      " $0 "\n"; next }
{ said = said "      " $0 "\n" }

END {
    if (results != planned || planned == 0) {
        failed++
        text = text "    FAILED: ran " (results + 0) " of " (planned + 0) " tests\n" said
    } else if (status != 0 && failed == 0) {
        failed++
        text = text "    FAILED: every test passed, but the program's status is " status "\n" said
    }
    if (status > 128) text = text "    ended by signal " (status - 128) "\n"
    if (status == 124) text = text "    took too long\n"
    printf "%-24s %3d passed%s%s%s\n%s", name, passed, seconds == "" ? "" : sprintf(", %d s", seconds), failed ? ", " failed " FAILED" : "",
        skipped ? ", " skipped " skipped" : "", text
    print passed + 0, failed + 0, skipped + 0
}
