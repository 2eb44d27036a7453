#!/bin/sh
# Print the manual page dmkcl(1), made from the tool's own help; with --html as a page for browsers.
# usage: man.sh [--html] TOOL > dmkcl.1
html=
if [ "$1" = --html ]; then
    html=1
    shift
fi
tool=$1
commands=$("$tool" --help | sed -n '/^commands:/,/^$/s/^  \([a-z]*\) .*/\1/p')

verbatim() { # the help as it is: dots and backslashes at the start of lines mean something to roff
    if [ "$html" ]; then
        echo '<pre>'
        "$@" | sed -e 's/&/\&amp;/g' -e 's/</\&lt;/g' -e 's/>/\&gt;/g'
        echo '</pre>'
    else
        echo '.nf'
        "$@" | sed -e 's/\\/\\e/g' -e 's/-/\\-/g' -e "s/^[.']/\\\\\&&/"
        echo '.fi'
    fi
}

if [ "$html" ]; then
    echo "<!doctype html><html lang=\"en\"><head><meta charset=\"utf-8\"><title>$("$tool" --version)</title>"
    echo '<style>:root { color-scheme: light dark } body { max-width: 56em; margin: 2em auto;'
    echo 'padding: 0 1em; font-family: sans-serif } pre { overflow: auto; font-size: 14px }</style></head>'
    echo "<body><h1>dmkcl: the tool</h1>"
    verbatim "$tool" --help
    for command in $commands; do
        echo "<h2 id=\"$command\">dmkcl $command</h2>"
        verbatim "$tool" "$command" --help
    done
    echo '</body></html>'
    exit
fi

echo ".TH DMKCL 1 \"\" \"$("$tool" --version)\" \"User Commands\""
echo '.SH NAME'
echo 'dmkcl \- cut locus of a point on a triangulated surface, by optimal transport'
echo '.SH SYNOPSIS'
for command in $commands; do
    usage=$("$tool" "$command" --help | sed -n -e 's/^usage: dmkcl [a-z]* *//p' | sed -e 's/\\/\\e/g' -e 's/-/\\-/g')
    printf '.B dmkcl %s\n%s\n.br\n' "$command" "${usage:-}"
done
echo '.SH DESCRIPTION'
verbatim "$tool" --help
for command in $commands; do
    echo ".SH DMKCL $(echo "$command" | tr a-z A-Z)"
    verbatim "$tool" "$command" --help
done
echo '.SH SEE ALSO'
echo '.BR dmkcl (3)'
