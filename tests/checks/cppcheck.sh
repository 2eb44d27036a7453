# cppcheck on every C file, its findings being errors.
. tests/checks/lib.sh

clean() {
    cppcheck --std=c11 --enable=warning,performance,portability --error-exitcode=1 --quiet \
        --inline-suppr --suppressions-list=tests/checks/cppcheck.known -Iinclude -Isrc -Ikernels \
        -Itests -I"$build" -D_GNU_SOURCE -DCL_TARGET_OPENCL_VERSION=120 -D__linux__ "$1"
}
each clean $(find src tests bench -name '*.c')
finish
