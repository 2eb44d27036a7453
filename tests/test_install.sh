# What `make install` puts in place is enough to build and run a program.
. tests/tap.sh

stage=$work/stage
config=${DMKCL_BUILD##*/}
pc() { PKG_CONFIG_PATH="$stage/usr/lib/pkgconfig" PKG_CONFIG_SYSROOT_DIR="$stage" pkg-config "$@"; }
cat > "$work/client.c" << 'EOF'
#include <dmkcl.h>
#include <stdio.h>
#include <string.h>
int main(void)
{
    char expected[32];
    snprintf(expected, sizeof expected, "%d.%d.%d", DMK_VERSION_MAJOR, DMK_VERSION_MINOR,
             DMK_VERSION_PATCH);
    return strcmp(dmk_version(), expected) != 0;
}
EOF

check 'make install with DESTDIR and PREFIX' \
    make -s CONFIG="$config" install PREFIX=/usr DESTDIR="$stage"
for file in bin/dmkcl include/dmkcl.h lib/libdmkcl.a lib/libdmkcl.so lib/pkgconfig/dmkcl.pc \
    share/man/man1/dmkcl.1 share/bash-completion/completions/dmkcl; do
    check "installed: $file" test -s "$stage/usr/$file"
done
check 'the version of dmkcl.pc is the tool'"'"'s' \
    test "dmkcl $(pc --modversion dmkcl)" = "$("$stage/usr/bin/dmkcl" --version)"

if [ "$config" = release ] || [ "$config" = debug ]; then
    check 'a client of the shared library builds' \
        gcc "$work/client.c" -o "$work/shared" $(pc --cflags --libs dmkcl)
    check 'and runs' env LD_LIBRARY_PATH="$stage/usr/lib" "$work/shared"
    check 'and asks for the library by its soname' \
        sh -c "objdump -p '$work/shared' | grep -q 'NEEDED *libdmkcl.so.[0-9]*\$'"
    check 'a client of the static library builds' \
        gcc "$work/client.c" -o "$work/static" $(pc --cflags dmkcl) "$stage/usr/lib/libdmkcl.a" \
        $(pc --libs --static dmkcl | sed 's/-ldmkcl//')
    check 'and runs without the shared one' "$work/static"
fi

nm -D --defined-only "$stage/usr/lib/libdmkcl.so" | awk '$2 == "T" { print $3 }' | sort > "$work/exported"
gcc -E -P include/dmkcl.h | grep -o 'dmk_[a-z0-9_]*(' | tr -d '(' | sort -u > "$work/declared"
check 'the shared library exports what the header declares, and only that' \
    diff "$work/declared" "$work/exported"
echo '#include "dmkcl.h"' > "$work/alone.c"
check 'the header stands alone in C99' \
    gcc -std=c99 -pedantic -Wall -Wextra -Werror -Iinclude -fsyntax-only "$work/alone.c"
check 'the manual names every command' \
    sh -c "for c in SOLVE MESH INFO DEVICES; do grep -q \"^.SH DMKCL \$c\" $stage/usr/share/man/man1/dmkcl.1 || exit 1; done"

complete_words() { # WORD...: what the completion offers for the last word
    PATH=$stage/usr/bin:$PATH bash -c '. "$0"; COMP_WORDS=(dmkcl "$@"); COMP_CWORD=$#; _dmkcl
        echo "${COMPREPLY[@]}"' "$stage/usr/share/bash-completion/completions/dmkcl" "$@"
}
check 'completion of a command' test "$(complete_words so)" = solve
check 'completion of an option' test "$(complete_words solve --ver)" = '--vertex --verbose'
check 'completion of a surface' test "$(complete_words mesh tor)" = torus
check 'completion of a method' test "$(complete_words solve --method ne)" = newton

check 'make uninstall' make -s uninstall PREFIX=/usr DESTDIR="$stage"
check 'leaves no file' test -z "$(find "$stage" -type f -o -type l)"
tap_end
