# Calls of each public function with each of its arguments wrong in turn, as C for test_arguments.c.
# usage: { cat test_arguments.c; echo ';%'; cc -E -P dmkcl.h; } | awk -f arguments.awk
# The test names the right values as good_TYPE or good_NAME, places to be filled as fresh_TYPE and lists of
# wrong values as wrong_TYPE; a pointer of any type is wrong as NULL. TYPE is the C type without const, _p
# for its first star and p for each further one.
BEGIN { RS = ";" }
!in_header {
    n = split($0, line, "\n")
    for (i = 1; i <= n; i++) {
        if (match(line[i], /(#define |^static.*[^a-z])(good|fresh|wrong)_[a-z0-9_]+/) && match(line[i], /(good|fresh|wrong)_[a-z0-9_]+/)) {
            known[substr(line[i], RSTART, RLENGTH)] = 1
        }
    }
    if (/^%/) { in_header = 1 } else next
}
$0 !~ /[{}]/ && match($0, /dmk_[a-z0-9_]+\(/) {
    gsub(/[ \n\t]+/, " ")
    match($0, /dmk_[a-z0-9_]+\(/)
    name = substr($0, RSTART, RLENGTH - 1)
    returns = substr($0, 1, RSTART - 1)
    returns = returns ~ /\*/ ? "POINTER" : returns ~ /int/ ? "STATUS" : "NOTHING"
    list = substr($0, RSTART + RLENGTH)
    sub(/\) *$/, "", list)
    n = list ~ /^ *(void)?$/ ? 0 : split(list, argument, ",")
    for (i = 1; i <= n; i++) take(i)
    for (i = 1; i <= n; i++) {
        list = "wrong_" type[i]
        if (pointer[i]) emit(i, "1, true", "NULL")
        if (!(list in known) || (pointer[i] && !constant[i])) continue
        emit(i, "sizeof " list " / sizeof *" list ", false", (pointer[i] && type[i] != "double_p" ? "&" : "") list "[index]")
    }
}
# Sets of argument i: its name, type, whether it is a pointer, whether what it points to is const.
function take(i,   a) {
    a = argument[i]
    constant[i] = sub(/const /, "", a)
    sub(/const /, "", a)
    pointer[i] = a ~ /\*|\[|_fn /
    if (sub(/ ?\[[0-9]*\]/, "", a)) sub(/[a-z0-9_]+ *$/, "*&", a)
    match(a, /[a-z0-9_]+ *$/)
    label[i] = substr(a, RSTART)
    sub(/ *$/, "", label[i])
    a = substr(a, 1, RSTART - 1)
    type[i] = ""
    while (sub(/ *\* */, "", a)) type[i] = type[i] (type[i] == "" ? "_p" : "p")
    gsub(/ /, "", a)
    type[i] = a type[i]
}
# By name, as a place to be filled, or by type.
function right_value(i) {
    if (("good_" label[i]) in known) return "good_" label[i]
    if (pointer[i] && !constant[i] && ("fresh_" type[i]) in known) return "fresh_" type[i]
    return ("good_" type[i]) in known ? "good_" type[i] : ""
}
# One call, argument `wrong` being `value`; times: how many there are, whether they are NULL.
function emit(wrong, times, value,   i, list, right) {
    for (i = 1; i <= n; i++) {
        right = right_value(i)
        if (i != wrong && right == "") {
            printf "UNKNOWN(%s, %s)\n", name, type[i]
            return
        }
        list = list (i > 1 ? ", " : "") (i == wrong ? value : right)
    }
    printf "%s(%s, %s, %s, (%s))\n", returns, name, label[wrong], times, list
}
