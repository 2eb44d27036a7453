# Print the reference of the library from the public header: what its comments and declarations say, in
# the header's order. A piece is a comment and the declarations below it, up to an empty line or the next
# comment at the start of a line.
# usage: awk -v form=html|man -f reference.awk include/dmkcl.h

function escaped(text)
{
    if (form == "man") {
        gsub(/\\/, "\\e", text)
        gsub(/-/, "\\-", text)
        if (text ~ /^[.']/) text = "\\&" text
        return text
    }
    gsub(/&/, "\\&amp;", text)
    gsub(/</, "\\&lt;", text)
    gsub(/>/, "\\&gt;", text)
    return text
}

# Names that the header declares become links to their places.
function linked(text,    out, name)
{
    out = ""
    while (match(text, /dmk_[a-z0-9_]+|DMK_[A-Z0-9_]+/)) {
        name = substr(text, RSTART, RLENGTH)
        out = out substr(text, 1, RSTART - 1)
        out = out (name in place ? "<a href=\"#" place[name] "\">" name "</a>" : name)
        text = substr(text, RSTART + RLENGTH)
    }
    return out text
}

# The names that a line of code declares: functions, types, members of enumerations.
function declared(line,    name)
{
    sub(/\/\*.*/, "", line)
    if (match(line, /dmk_[a-z0-9_]+\(/) && line !~ /^ /) return substr(line, RSTART, RLENGTH - 1)
    if (line ~ /^typedef (struct|enum) dmk_[a-z_]+/ || line ~ /^}/ || line ~ /\(\*dmk_[a-z_]+\)/) {
        if (match(line, /dmk_[a-z0-9_]+/)) return substr(line, RSTART, RLENGTH)
    }
    if (match(line, /DMK_[A-Z0-9_]+/) && line ~ /^ |^typedef enum|^#define/) {
        name = substr(line, RSTART, RLENGTH)
        return name == "DMK_N" ? "" : name
    }
    return ""
}

function end_piece()
{
    if (n_text || n_code) {
        n_pieces++
        pieces_text[n_pieces] = text
        pieces_code[n_pieces] = code
        pieces_section[n_pieces] = section
    }
    text = code = ""
    n_text = n_code = 0
}

function add_text(line)
{
    sub(/ *\*\/ *$/, "", line)
    sub(/^ ?\/?\*+ ?/, "", line)
    text = text line "\n"
    n_text++
}

# ---- reading ----

/^\/\* ---- .* -+ \*\/$/ {
    end_piece()
    section = $0
    gsub(/^\/\* -+ | -+ \*\/$/, "", section)
    next
}
in_comment {
    add_text($0)
    in_comment = $0 !~ /\*\//
    next
}
/^\/\*/ {
    if (n_code) end_piece()
    add_text($0)
    in_comment = $0 !~ /\*\//
    next
}
/^#/ && !/^#define DMK_VERSION/ { next }
/^extern "C"|^}$/ { next }
/^$/ { end_piece(); next }
{
    code = code $0 "\n"
    n_code++
    name = declared($0)
    if (name != "" && !(name in place)) {
        place[name] = name
        at[n_pieces + 1] = at[n_pieces + 1] " " name
    }
}
END {
    end_piece()
    if (form == "man") put_man()
    else put_html()
}

# ---- writing ----

# Lines that are indented stand as they are; others flow.
function put_text(text,    n, i, line, kept)
{
    n = split(text, lines, "\n")
    kept = 0
    print form == "man" ? ".PP" : "<p>"
    for (i = 1; i <= n; i++) {
        line = lines[i]
        if ((line ~ /^  /) != kept) {
            kept = !kept
            if (form == "man") print kept ? ".nf" : ".fi"
            else print kept ? "</p><pre class=\"text\">" : "</pre><p>"
        }
        if (line == "" && i < n) print form == "man" ? ".PP" : "</p><p>"
        else if (line != "") print form == "man" ? escaped(line) : linked(escaped(line))
    }
    if (form == "man") {
        if (kept) print ".fi"
    } else print kept ? "</pre>" : "</p>"
}

function put_man(    i, n, j)
{
    print ".TH DMKCL 3 \"\" \"dmkcl " version "\" \"Library Functions\""
    print ".SH NAME\nlibdmkcl \\- cut locus of a point on a triangulated surface, by optimal transport"
    print ".SH SYNOPSIS\n.nf\n#include <dmkcl.h>\n\ncc program.c $(pkg\\-config \\-\\-cflags \\-\\-libs dmkcl)\n.fi"
    print ".SH DESCRIPTION"
    for (i = 1; i <= n_pieces; i++) {
        if (i > 1 && pieces_section[i] != pieces_section[i - 1]) print ".SH " toupper(pieces_section[i])
        if (pieces_text[i] != "") put_text(pieces_text[i])
        if (pieces_code[i] == "") continue
        print ".PP\n.RS 4\n.nf"
        n = split(pieces_code[i], code_lines, "\n")
        for (j = 1; j < n; j++) print escaped(code_lines[j])
        print ".fi\n.RE"
    }
    print ".SH SEE ALSO\n.BR dmkcl (1)"
}

function put_contents(    i, j, n, last)
{
    print "<nav><h2>dmkcl " version "</h2>"
    for (i = 1; i <= n_pieces; i++) {
        if (pieces_section[i] != last) {
            last = pieces_section[i]
            print "<h3><a href=\"#" anchor(last) "\">" escaped(last) "</a></h3>"
        }
        n = split(at[i], names, " ")
        for (j = 1; j <= n; j++) {
            if (names[j] ~ /^dmk_/) print "<a href=\"#" names[j] "\">" names[j] "</a>"
        }
    }
    print "</nav>"
}

function anchor(section)
{
    gsub(/[^a-z0-9]+/, "-", section)
    return "section-" section
}

function put_html(    i, j, n)
{
    print "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">"
    print "<meta name=\"viewport\" content=\"width=device-width\"><title>dmkcl " version "</title>"
    print "<style>"
    print ":root { color-scheme: light dark } body { margin: 0; display: flex; font: 15px/1.5 sans-serif }"
    print "nav { width: 17em; flex: none; height: 100vh; overflow: auto; position: sticky; top: 0;"
    print "  padding: 0 1em; box-sizing: border-box; border-right: 1px solid #8885; font-size: 13px }"
    print "nav a { display: block; text-decoration: none } main { max-width: 52em; padding: 1em 2em }"
    print "pre { background: #8881; padding: .6em .8em; overflow: auto; font-size: 13px }"
    print "pre.text { background: none; padding: 0; font-family: inherit } h3 { margin: 1em 0 .2em }"
    print "section { border-top: 1px solid #8883; padding: .4em 0 } :target { outline: 2px solid #d80 }"
    print "@media (max-width: 50em) { nav { display: none } }"
    print "</style></head><body>"
    put_contents()
    print "<main><h1>dmkcl: reference of the library</h1>"
    for (i = 1; i <= n_pieces; i++) {
        if (pieces_section[i] != pieces_section[i - 1]) {
            print "<h2 id=\"" anchor(pieces_section[i]) "\">" escaped(pieces_section[i]) "</h2>"
        }
        print "<section>"
        n = split(at[i], names, " ")
        for (j = 1; j <= n; j++) print "<span id=\"" names[j] "\"></span>"
        if (pieces_text[i] != "") put_text(pieces_text[i])
        if (pieces_code[i] != "") print "<pre>" linked(escaped(pieces_code[i])) "</pre>"
        print "</section>"
    }
    print "</main></body></html>"
}

BEGIN { section = "conventions" }
