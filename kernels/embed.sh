#!/bin/sh
# Print a C file with the text of the given kernel files as one string per line.
# usage: embed.sh FILE... > kernels.c
printf '#include <stddef.h>\nextern const char *const dmk_kernel_lines[];\nextern const size_t dmk_kernel_n_lines;\nconst char *const dmk_kernel_lines[] = {\n'
for f in "$@"; do
    printf '"#line 1 \\"%s\\"\\n",\n' "$f"
    sed -e 's/\\/\\\\/g' -e 's/"/\\"/g' -e 's/^/"/' -e 's/$/\\n",/' "$f"
done
printf '};\nconst size_t dmk_kernel_n_lines = sizeof dmk_kernel_lines / sizeof *dmk_kernel_lines;\n'
