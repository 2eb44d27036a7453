# Print the manual page dmkcl(3) from the public header: what its comments and declarations say, in
# the header's order. A piece is a comment and the declarations below it, up to an empty line or the next
# comment at the start of a line.
# usage: awk -v version=X.Y.Z -f reference.awk include/dmkcl.h > dmkcl.3

function escaped(text)
{
    gsub(/\\/, "\\e", text)
    gsub(/-/, "\\-", text)
    if (text ~ /^[.']/) text = "\\&" text
    return text
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
/^#/ && !/^#define DMK_/ { next }
/^extern "C"|^}$/ { next }
/^$/ { end_piece(); next }
{
    code = code $0 "\n"
    n_code++
}
END {
    end_piece()
    put_man()
}

# ---- writing ----

# Lines that are indented stand as they are; others flow.
function put_text(text,    n, i, line, kept)
{
    n = split(text, lines, "\n")
    kept = 0
    print ".PP"
    for (i = 1; i <= n; i++) {
        line = lines[i]
        if ((line ~ /^  /) != kept) {
            kept = !kept
            print kept ? ".nf" : ".fi"
        }
        if (line == "" && i < n) print ".PP"
        else if (line != "") print escaped(line)
    }
    if (kept) print ".fi"
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

BEGIN { section = "conventions" }
