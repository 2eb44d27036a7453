#!/bin/sh
# Run test programs (cmocka) and test scripts from the repository root, print what failed, count.
# usage: run.sh BUILD_FOLDER TEST...    TEST_JOBS=N: so many side by side, else one more than there are processors
# Every test speaks TAP: a plan "1..N", then "ok K - name" or "not ok K - name" for each. A program
# that ends badly, ends before its plan is fulfilled, or plans nothing counts as one failure more.
set -u
build=$1
shift

# Nothing outside the build folder is touched: kernel caches live here while tests run, and longer with
# KEEP_SCRATCH=1. Where that has a blank, which PREFIX and LD_PRELOAD do not take, it is elsewhere.
scratch=$PWD/$build/scratch
[ "${KEEP_SCRATCH:-}" ] || rm -rf "$scratch"
case $scratch in
*[[:space:]]*)
    scratch=$(mktemp -d /tmp/dmkcl-tests.XXXXXX) || exit 1
    trap 'rm -rf "$scratch"' EXIT
    ;;
esac
mkdir -p "$scratch/tmp" "$scratch/cache/pocl" || exit 1
export TMPDIR="$scratch/tmp" XDG_CACHE_HOME="$scratch/cache" POCL_CACHE_DIR="$scratch/cache/pocl"
export DMKCL_BUILD="$build" CMOCKA_MESSAGE_OUTPUT=TAP
# LLVM inside OpenCL drivers sets an alternate signal stack of its own in threads it makes.
export ASAN_OPTIONS="use_sigaltstack=0"
export LSAN_OPTIONS="suppressions=$PWD/tests/lsan.supp:print_suppressions=0"

# Each test that ends leaves its three counts. One more than there are processors: some use two, others wait.
rm -f "$scratch"/*.counts
printf '%s\0' "$@" | xargs -0 -P "${TEST_JOBS:-$(($(nproc) + 1))}" -I{} sh tests/one.sh "$scratch" {}
for test; do [ -e "$scratch/$(basename "$test").counts" ] || echo "FAILED: $test has no end"; done
awk -v tests=$# '{ passed += $1; failed += $2; skipped += $3 }
    END {
        failed += tests - NR + (passed == 0)
        printf "%d passed, %d failed%s\n", passed, failed, skipped ? sprintf(", %d skipped", skipped) : ""
        exit failed > 0
    }' "$scratch"/*.counts /dev/null
