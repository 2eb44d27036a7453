# Headers stand alone: the public one in C99, C11, C17 and C++, each of the library's own in C11.
. tests/checks/lib.sh

printf '#include <dmkcl.h>\n#include <dmkcl.h>\nint use(void); int use(void) { return DMK_OK; }\n' \
    > "$work/use.c"
cp "$work/use.c" "$work/use.cc"
strict='-Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wundef -Werror'
for compiler in gcc clang; do
    for standard in c99 c11 c17 gnu11; do
        try "dmkcl.h: $compiler -std=$standard" \
            $compiler -std=$standard $strict -Iinclude -fsyntax-only "$work/use.c"
    done
done
for standard in c++98 c++11 c++14 c++17 c++20; do
    # long long is newer than C++98, and stdint.h needs it there.
    try "dmkcl.h: clang++ -std=$standard" clang++ -std=$standard $strict -Wold-style-cast \
        -Wno-c++11-long-long -Iinclude -fsyntax-only "$work/use.cc"
done
for header in $(find src kernels tests -name '*.h' ! -path 'tests/checks/*'); do
    printf '#include "%s"\n#include "%s"\ntypedef int use;\n' "$PWD/$header" "$PWD/$header" \
        > "$work/one.c"
    for compiler in gcc clang; do
        try "$header: $compiler" $compiler $flags -Itests $warnings -fsyntax-only "$work/one.c"
    done
done
finish
