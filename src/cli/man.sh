#!/bin/sh
# Print the manual page dmkcl(1), made from the tool's own help.
# usage: man.sh TOOL > dmkcl.1
tool=$1
commands=$("$tool" --help | sed -n '/^commands:/,/^$/s/^  \([a-z]*\) .*/\1/p')

verbatim() { # the help as it is: dots and backslashes at the start of lines mean something to roff
    echo '.nf'
    "$@" | sed -e 's/\\/\\e/g' -e 's/-/\\-/g' -e "s/^[.']/\\\\\&&/"
    echo '.fi'
}

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
