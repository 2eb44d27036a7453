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
check 'prefix= means PREFIX=' \
    grep -q "$stage/opt/bin" <(make -n CONFIG="$config" install prefix=/opt DESTDIR="$stage")
for file in bin/dmkcl include/dmkcl.h lib/libdmkcl.a lib/libdmkcl.so lib/pkgconfig/dmkcl.pc \
    share/man/man1/dmkcl.1 share/man/man3/dmkcl.3 share/bash-completion/completions/dmkcl; do
    check "installed: $file" test -s "$stage/usr/$file"
done
check 'the version of dmkcl.pc is the tool'"'"'s' \
    test "dmkcl $(pc --modversion dmkcl)" = "$("$stage/usr/bin/dmkcl" --version)"

# One version everywhere.
version=$(pc --modversion dmkcl)
check 'the version is that of CITATION.cff' grep -qx "version: $version" CITATION.cff
check 'and that of the newest changes' sh -c "sed -n 's/^## //p' CHANGELOG.md | head -1 | grep -q '^$version\\b'"
check 'and its first two numbers are those of the soname' \
    sh -c "objdump -p '$stage/usr/lib/libdmkcl.so' | grep -qx ' *SONAME *libdmkcl.so.${version%.*}'"

if [ "$config" = release ] || [ "$config" = debug ]; then
    check 'a client of the shared library builds' \
        gcc "$work/client.c" -o "$work/shared" $(pc --cflags --libs dmkcl)
    check 'and runs' env LD_LIBRARY_PATH="$stage/usr/lib" "$work/shared"
    check 'and asks for the library by its soname' \
        sh -c "objdump -p '$work/shared' | grep -q 'NEEDED *libdmkcl.so.[0-9]*.[0-9]*\$'"
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

for name in $(cat "$work/declared"); do
    grep -q "^.*$(printf '%s' "$name" | sed 's/-/\\-/g')(" "$stage/usr/share/man/man3/dmkcl.3" || echo "$name"
done > "$work/unsaid"
check 'the manual of the library names every function' test ! -s "$work/unsaid"
if command -v groff > /dev/null; then
    check 'the manuals are good roff' \
        test -z "$(cat "$stage"/usr/share/man/man[13]/* | groff -man -Tutf8 -ww 2>&1 > /dev/null)"
else
    skip 'the manuals are good roff' 'There is no groff here.'
fi
complete_words() { # WORD...: what the completion offers for the last word
    PATH=$stage/usr/bin:$PATH bash -c '. "$0"; COMP_WORDS=(dmkcl "$@"); COMP_CWORD=$#; _dmkcl
        echo "${COMPREPLY[@]}"' "$stage/usr/share/bash-completion/completions/dmkcl" "$@"
}
check 'completion of a command' test "$(complete_words so)" = solve
check 'completion of an option' test "$(complete_words solve --ver)" = '--vertex --verbose'
check 'completion of a surface' test "$(complete_words mesh tor)" = torus
check 'completion of a method' test "$(complete_words solve --method ne)" = newton
check 'completion of a device' test "$(complete_words solve --device '' | cut -c1)" = 0
check 'no words after an option that takes a number' test -z "$(complete_words solve --vertex '')"
mkdir "$work/shelf" && touch "$work/shelf/"{m.off,m.msh,M.VTK,m.off.gz,m.txt,r.vtp,l.obj,notes,p.pvtp,s.svg}
complete_files() { # WORD...: the same, in the folder with these files, one line, sorted
    (cd "$work/shelf" && complete_words "$@" | tr ' ' '\n' | sort | xargs)
}
stage=$(cd "$stage" && pwd)
check 'completion of meshes' \
    test "$(complete_files solve '' | tr ' ' '\n' | LC_ALL=C sort | xargs)" = 'M.VTK l.obj m.msh m.off m.off.gz r.vtp'
check 'completion of results' test "$(complete_files solve m.off --out '')" = 'p.pvtp r.vtp'
check 'completion of lists' test "$(complete_files batch m.t)" = m.txt
check 'completion of a suffix' test "$(complete_words batch --out .v)" = '.vtp .vtu'
check 'completion of a folder' test "$(cd "$work" && complete_words batch --out-dir she)" = shelf
check 'no files where an option takes a number' test -z "$(complete_files batch --sources '')"
check 'completion of pictures' test "$(complete_files cut m.off --picture '')" = s.svg
check 'completion of measures' test "$(complete_files transport m.off --from m.t)" = m.txt
check 'and of a word for one' test "$(complete_files transport m.off --to un)" = uniform
check 'completion of a format' test "$(complete_words solve --format v)" = 'vtp vtu'
check 'completion of help' test "$(complete_words help so)" = solve
check 'which is a word itself' test "$(complete_words hel)" = help
check 'completion of loci' test "$(complete_files path m.off --out '')" = 'l.obj r.vtp'
check 'completion of surfaces and files' test "$(complete_files mesh m.o)" = 'm.off m.off.gz'
for command in $("$tool" --help | sed -n '/^commands:/,/^$/s/^  \([a-z]*\) .*/\1/p'); do
    check "completion knows $command" test "$(complete_words "$command")" = "$command"
    check "and all its options" test "$(complete_words "$command" -- | wc -w)" -ge 2
done

# Of what is built in the tree nothing goes into the archive: an editable install leaves a program and a library there.
mkdir "$work/tree" && cp -r Makefile README.md include kernels src tests .ci "$work/tree" &&
    touch "$work/tree/src/python/dmkcl/dmkcl" "$work/tree/src/python/dmkcl/_dmkcl.abi3.so"
check 'make dist' make -s -C "$work/tree" dist
tar -tzf "$work/tree/build/dmkcl-$version.tar.gz" | sed 's,^[^/]*/,,' > "$work/packed"
check 'packs the sources' sh -c "for f in Makefile include/dmkcl.h src/cli/main.c kernels/base.cl tests/run.sh; do
    grep -qx \$f '$work/packed' || exit 1; done"
check 'and nothing built' test -z "$(grep -E '\.so$|^src/python/dmkcl/dmkcl$|^build|\.git/' "$work/packed")"

# A source that goes leaves nothing in the library. The compiler is one that makes empty files.
printf '%s\n' 'while [ $# -gt 0 ]; do [ "$1" != -o ] || : > "$2"; shift; done' > "$work/cc"
build_library() { make -s -C "$work/tree" CONFIG=debug CC="sh $work/cc" build/debug/libdmkcl.a; }
members() { ar t "$work/tree/build/debug/libdmkcl.a" | grep -cx stl.o; }
check 'the static library' build_library
check 'has a member for a source' test "$(members)" = 1
rm "$work/tree/src/io/stl.c"
check 'is made anew without the source' build_library
check 'and has no such member' test "$(members)" = 0

mkdir "$work/blank" && touch "$work/blank/my"
for folder in DESTDIR PREFIX libdir; do
    fails "a blank in $folder is refused" 2 "$folder='.*my stage': expected a folder without blanks" \
        make -s uninstall DESTDIR="$work/blank" "$folder=$work/blank/my stage"
done
fails 'at the end, too' 2 "DESTDIR='.* ': expected a folder without blanks" make -n --no-print-directory install DESTDIR="$work/blank/my "
fails 'half a path is refused' 2 "PREFIX='usr': expected a whole path" \
    make -n --no-print-directory install DESTDIR="$stage" PREFIX=usr
check 'and nothing is deleted' test -e "$work/blank/my"

check 'make uninstall' make -s uninstall PREFIX=/usr DESTDIR="$stage"
check 'leaves no file' test -z "$(find "$stage" -type f -o -type l)"
tap_end
