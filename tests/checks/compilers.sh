# Every C file under gcc and clang, each with its own set of warnings as errors.
. tests/checks/lib.sh

clang_takes() {
    clang $flags $warnings -Wcast-qual -Wconditional-uninitialized -Wimplicit-fallthrough \
        -Wextra-semi -Wnewline-eof -Wunreachable-code -Wloop-analysis -Wno-cast-qual -Itests \
        -I"$build" -fsyntax-only "$1"
}
# Warnings that only come with the optimiser's knowledge need the code made.
gcc_takes() {
    gcc $flags $warnings -O2 -D_FORTIFY_SOURCE=2 -Itests -I"$build" -c "$1" -o "$work/x.o"
}
files=$(find src tests bench -name '*.c')
each clang_takes $files
each gcc_takes $files
finish
