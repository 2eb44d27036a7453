# The public header as Doxygen reads it: comments become documentation, sections groups.
# usage: awk -f header.awk include/dmkcl.h

# A declaration below another one, after the same comment, refers to that one.
function refer(line)
{
    if (line !~ /^[a-z]/ || line ~ /^typedef|_(destroy|free)\(/ || !match(line, /dmk_[a-z0-9_]+\(/)) return
    if (above != "") print "/** See " above ". */"
    else above = substr(line, RSTART, RLENGTH) ")"
}
# Formulas, indented in a comment, keep their lines.
function set_apart(is_formula)
{
    if (is_formula && !in_formula) print " * @verbatim"
    if (!is_formula && in_formula) print "@endverbatim"
    in_formula = is_formula
}
function open_group(title)
{
    print "/** @defgroup section-" n_sections++ " " title "\n * @{ */"
}

/^#(if|endif|include|define DMKCL_H)/ || /^extern "C"/ || /^}$/ { next }
/^\/\* ---- .* -+ \*\/$/ {
    gsub(/^\/\* -+ | -+ \*\/$/, "")
    print "/** @} */"
    open_group(toupper(substr($0, 1, 1)) substr($0, 2))
    next
}
/^#define/ && !n_sections { open_group("Version and status") }
/^$/ { above = ""; commented = 0 }
in_comment {
    if (/^ \* +- /) in_list = 1
    if (/^ \*$/) in_list = 0
    set_apart(!in_list && sub(/^ \*     /, ""))
    in_comment = $0 !~ /\*\//
    print
    next
}
/^\/\*/ {
    sub(/^\/\*/, NR == 1 ? "/** @file\n *" : "/**")
    above = ""
    commented = 1
    in_comment = $0 !~ /\*\//
    print
    next
}
{
    if (commented) refer($0)
    if (!sub(/^ +\/\* /, "&\001")) sub(/\/\* /, "/**< ")
    sub(/\/\* \001/, "/** ")
    print
}
END { print "/** @} */" }
