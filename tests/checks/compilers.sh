# Every C file under gcc and clang, each with its own set of warnings as errors.
. tests/checks/lib.sh

for file in $(find src tests bench -name '*.c'); do
    try "$file: clang" clang $flags $warnings -Wcast-qual -Wconditional-uninitialized \
        -Wimplicit-fallthrough -Wextra-semi -Wnewline-eof -Wunreachable-code -Wloop-analysis \
        -Wno-cast-qual -Itests -fsyntax-only "$file"
done
# Warnings that only come with the optimiser's knowledge need the code made.
for file in $(find src tests bench -name '*.c'); do
    try "$file: gcc" gcc $flags $warnings -O2 \
        -D_FORTIFY_SOURCE=2 -Itests -c "$file" -o "$work/x.o"
done
finish
