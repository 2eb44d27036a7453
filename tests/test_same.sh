# The same bits whatever the number of threads, of the device's and of the host's; the same answers
# from a second OpenCL implementation.
. tests/tap.sh

torus=$work/torus.off
"$tool" mesh torus --triangles 20000 --source 3,0,0 --out "$torus" --quiet || exit 1

# Leaks are looked for by the other tests; it takes seconds at the end of each run.
export ASAN_OPTIONS="${ASAN_OPTIONS-}:detect_leaks=0"

# solved NAME COMMAND...: all that a solve writes, as NAME.*
solved() {
    local to=$work/$1
    shift
    "$@" "$tool" solve "$torus" --source=-0.3,1.1,0.8 --out "$to.vtp" --out "$to.ply" \
        --locus "$to.obj" --locus "$to.csv" --tangent "$to-tangent.csv" --quiet $flags
}
same_bits() { # NAME COMMAND...
    solved again "$@" || return
    local file
    for file in .vtp .ply .obj .csv -tangent.csv; do cmp "$work/first$file" "$work/again$file" || return; done
}

# ---- the number of threads --------------------------------------------------------------------

# So many processors as the program sees them (not OpenCL's libraries): its own threads.
cat > "$work/processors.c" << 'EOC'
#define _GNU_SOURCE
#include <dlfcn.h>
#include <sched.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
static int from_program(void *caller)
{
    Dl_info info;
    return dladdr(caller, &info) && !strstr(info.dli_fname, ".so");
}
static int wanted(void) { return atoi(getenv("PROCESSORS")); }
long sysconf(int name)
{
    long (*real)(int) = (long (*)(int))dlsym(RTLD_NEXT, "sysconf");
    if (name == _SC_NPROCESSORS_ONLN && from_program(__builtin_return_address(0))) return wanted();
    return real(name);
}
int sched_getaffinity(pid_t pid, size_t size, cpu_set_t *set)
{
    int (*real)(pid_t, size_t, cpu_set_t *) =
        (int (*)(pid_t, size_t, cpu_set_t *))dlsym(RTLD_NEXT, "sched_getaffinity");
    if (!from_program(__builtin_return_address(0))) return real(pid, size, set);
    memset(set, 0, size);
    for (int i = 0; i < wanted(); i++) CPU_SET(i, set);
    return 0;
}
EOC
gcc -shared -fPIC -w "$work/processors.c" -o "$work/processors.so" -ldl || exit 1
processors() { # N COMMAND...
    local n=$1
    shift
    env PROCESSORS="$n" LD_PRELOAD="$work/processors.so" \
        ASAN_OPTIONS="$ASAN_OPTIONS:verify_asan_link_order=0" "$@"
}

threads_do_not_matter() { # NAME
    check "$1: a solve" solved first env
    check "$1: again" same_bits env
    check "$1: on one processor" same_bits taskset -c 0
    local n
    for n in 1 2 3; do
        flags="$flags --threads $n"
        check "$1: --threads $n" same_bits env POCL_MAX_PTHREAD_COUNT=4
        flags=${flags% --threads $n}
        check "$1: $n threads in PoCL" same_bits env POCL_MAX_PTHREAD_COUNT=$n
    done
    for n in 1 3 16; do check "$1: $n threads of the host" same_bits processors $n; done
}
flags=
threads_do_not_matter 'double precision'
flags=--single
threads_do_not_matter 'single precision'
flags=

# ---- a second implementation ------------------------------------------------------------------

intel=$PWD/build/pyenv/lib/libintelocl.so
if sh tests/pyenv.sh > "$work/pyenv" 2>&1 && [ -e "$intel" ]; then
    mkdir "$work/alone" "$work/both"
    echo "$intel" | tee "$work/alone/intel.icd" > "$work/both/intel.icd"
    cp /etc/OpenCL/vendors/*.icd "$work/both"
    alone() { env OCL_ICD_VENDORS="$work/alone" "$@"; }
    both() { env OCL_ICD_VENDORS="$work/both" "$@"; }

    check 'the second implementation is there' \
        sh -c "OCL_ICD_VENDORS='$work/alone' '$tool' devices | grep -q 'Intel(R) OpenCL'"
    check 'both are there' sh -c "OCL_ICD_VENDORS='$work/both' '$tool' devices | grep -q '^  1 '"
    check 'both agree' both "$DMKCL_BUILD/tests/test_same"
    for test in operator solver exact; do
        check "test_$test on the second one" alone "$DMKCL_BUILD/tests/test_$test"
    done
    check 'the second one: a solve' solved first alone
    check 'the second one: again, kernels from the cache' same_bits alone
    check 'the second one: on one processor' same_bits alone taskset -c 0
    for n in 1 2; do
        flags="--threads $n"
        check "the second one: --threads $n" same_bits alone
    done
else
    skip 'a second OpenCL implementation' "not to be had from PyPI: $(tail -n 1 "$work/pyenv")"
fi
tap_end
