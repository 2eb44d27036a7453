# The tool in surroundings that are not as they should be: each is named, with the way out; and interruptions at
# any moment.
. tests/tap.sh

mesh=$work/sphere.off
"$tool" mesh sphere --triangles 300 --quiet --out "$mesh"
run() { # VARIABLE=VALUE...
    env "$@" "$tool" solve "$mesh" --vertex 0 --quiet
}
wrong() { # NAME PATTERN VARIABLE=VALUE...: exit code 5
    local name=$1 pattern=$2
    shift 2
    fails "$name" 5 "$pattern" env "$@" "$tool" solve "$mesh" --vertex 0
}

# ---- the driver -------------------------------------------------------------------------------

if "$tool" devices | grep -q 'Portable Computing Language'; then
    : > "$work/file"
    wrong 'a kernel cache that is no folder' "PoCL cannot keep its kernels in $work/file: .*set POCL_CACHE_DIR" \
        POCL_CACHE_DIR="$work/file"
    wrong 'a kernel cache that cannot be made' "kernels in $work/file/x: Not a directory" POCL_CACHE_DIR="$work/file/x"
    wrong 'a home that cannot be written to' 'kernels in /proc/none/.cache/pocl/kcache: ' \
        -u POCL_CACHE_DIR -u XDG_CACHE_HOME HOME=/proc/none
    wrong 'a cache folder of the user that is none' "kernels in $work/file/pocl/kcache: " \
        -u POCL_CACHE_DIR XDG_CACHE_HOME="$work/file"
    wrong 'devices that PoCL does not know' 'no device; try without POCL_DEVICES=none' POCL_DEVICES=none
    # The driver crashes then: sanitizers leave that to the tool.
    wrong 'a machine that hwloc does not find' '; try without .*HWLOC_XMLFILE=/dev/null$' HWLOC_XMLFILE=/dev/null \
        ASAN_OPTIONS="${ASAN_OPTIONS-}:handle_segv=0" TSAN_OPTIONS="${TSAN_OPTIONS-}:handle_segv=0"
    wrong 'fewer threads than one' 'POCL_MAX_PTHREAD_COUNT=-3; set it to a number from 1' POCL_MAX_PTHREAD_COUNT=-3
    wrong 'more threads than there can be' 'POCL_MAX_PTHREAD_COUNT=4097; set it to a number from 1 to 4096' \
        POCL_MAX_PTHREAD_COUNT=4097
    check 'many threads' env POCL_MAX_PTHREAD_COUNT=2100 "$tool" solve "$mesh" --vertex 0
    # Drivers reserve memory, and give up in ways of their own where there is none.
    if [ "${DMKCL_BUILD##*/}" = release ]; then
        bounded() { bash -c 'ulimit -v "$1"; shift; exec "$@"' - "$@"; }
        fails 'no room for the driver' 5 'no OpenCL platform .* or try without .ulimit -v., as drivers' \
            bounded 150000 "$tool" solve "$mesh" --vertex 0
        fails 'little room for the driver' 5 'without .ulimit -v., as drivers reserve up to 1 GB' \
            bounded 300000 "$tool" solve "$mesh" --vertex 0
    else
        skip 'a bound of the memory' 'this build has a runtime that reserves some itself'
    fi
    check 'a home that cannot be written to, and --cache' env -u POCL_CACHE_DIR -u XDG_CACHE_HOME HOME=/proc/none \
        "$tool" solve "$mesh" --vertex 0 --quiet --cache "$work/cache"
    check 'has the kernels of PoCL, too' test -n "$(find "$work/cache/pocl" -name program.bc)"
    check 'but not where they have a folder' env POCL_CACHE_DIR="$work/cache/pocl" \
        "$tool" solve "$mesh" --vertex 0 --quiet --cache "$work/cache2"
    check 'of their own' test ! -e "$work/cache2/pocl"
    fails '--cache of a file' 1 "--cache: '$work/file' is not a folder" \
        "$tool" solve "$mesh" --vertex 0 --cache "$work/file"
    # PoCL's folder is then one that the first user to come keeps for himself.
    no_home=(-u HOME -u XDG_CACHE_HOME -u POCL_CACHE_DIR)
    if [ ! -e /tmp/pocl ] || [ -w /tmp/pocl ]; then
        check 'no home at all' run "${no_home[@]}"
    else
        wrong 'no home at all' 'kernels in /tmp/pocl/kcache: Permission denied; set POCL_CACHE_DIR' "${no_home[@]}"
    fi
    # Both programs are kept, and kernels are compiled for them as they are kept.
    keeps() { # the two files are whole, and the same as before
        "$tool" solve "$mesh" --vertex 0 --quiet --cache "$work/kept" --out "$work/kept.ply" || return 1
        cat "$work"/kept/*.bin > "$work/kept.now"
        [ "$(ls "$work"/kept/*.bin | wc -l)" = 2 ] && cat "$work/kept.ply" >> "$work/kept.now" || return 1
        [ -e "$work/kept.first" ] || cp "$work/kept.now" "$work/kept.first"
        cmp "$work/kept.now" "$work/kept.first"
    }
    programs() { find "${POCL_CACHE_DIR:-$work/kept/pocl}" -name program.bc | wc -l; }
    check 'programs are kept' keeps
    before=$(programs)
    check 'and found, with the same result' keeps
    for file in "$work"/kept/*.bin; do truncate -s 9999 "$file"; done
    check 'damaged ones are made anew' keeps
    rm "$work"/kept/*.bin
    check 'and so are those that have been removed' keeps
    check 'by which no program is built again' test "$(programs)" = "$before"
    "$tool" solve "$mesh" --vertex 0 --quiet --cache '' --out "$work/unkept.ply"
    check 'without a folder the result is the same' cmp "$work/unkept.ply" "$work/kept.ply"
    if unshare -m true 2> /dev/null; then
        mkdir "$work/tiny"
        fails 'no /sys' 5 'PoCL does not start without /sys' \
            unshare -m sh -c 'umount -l /sys; exec "$@"' - "$tool" solve "$mesh" --vertex 0
        fails 'a kernel cache that is full' 5 "kernels in $work/tiny: No space left on device; .* 4 MB" \
            env POCL_CACHE_DIR="$work/tiny" unshare -m sh -c 'mount -t tmpfs -o size=64k none "$POCL_CACHE_DIR"; exec "$@"' - \
            "$tool" solve "$mesh" --vertex 0
        fails 'a kernel cache that is read only' 5 "kernels in $work/tiny: Read-only file system" \
            env POCL_CACHE_DIR="$work/tiny" unshare -m sh -c 'mount -t tmpfs -o ro none "$POCL_CACHE_DIR"; exec "$@"' - \
            "$tool" solve "$mesh" --vertex 0
        wrong 'no home, and a folder of somebody else' 'kernels in /tmp/pocl/kcache: Read-only file system' \
            "${no_home[@]}" unshare -m sh -c 'mount -t tmpfs -o ro none /tmp/pocl; exec "$@"' -
    else
        skip 'no /sys, a full disk' 'nothing can be mounted here'
    fi
    # A driver that crashes all the same: a library in front of it whose calls do so, the one that finds devices and
    # the one that builds kernels beside the rest of the work. Found by its name: LD_PRELOAD takes a blank for an end.
    cat > "$work/crash.c" << 'EOF'
#include <pthread.h>
#include <stdlib.h>
#include <sys/syscall.h>
#include <unistd.h>
static void *give_up(void *unused) { abort(); }
ssize_t write(int fd, const void *from, size_t n) /* slow, so that all threads have given up before the first has spoken */
{
    usleep(20000);
    return syscall(SYS_write, fd, from, n);
}
int CALL(void)
{
    pthread_t thread;
    for (int i = 0; getenv("HOW")[0] == 't' && i < 2; i++) pthread_create(&thread, NULL, give_up, NULL);
    if (getenv("HOW")[0] == 't') pthread_join(thread, NULL);
    if (getenv("HOW")[0] == 'a') abort();
    if (getenv("HOW")[0] == 'e') exit(1);
    return *(volatile int *)8;
}
EOF
    crashing=(LD_LIBRARY_PATH="$work" LD_PRELOAD=crash.so)
    if [ "${DMKCL_BUILD##*/}" = release ] && gcc -shared -fPIC -DCALL=none "$work/crash.c" -o "$work/crash.so"; then
        for call in clGetPlatformIDs clBuildProgram; do
            gcc -shared -fPIC -DCALL=$call "$work/crash.c" -o "$work/crash.so"
            wrong "a driver that crashes in $call" 'driver crashed while the device was opened; try without .*POCL_ODD=1' \
                "${crashing[@]}" HOW=crash POCL_ODD=1
            wrong "a driver that gives up in $call" 'driver gave up while' "${crashing[@]}" HOW=abort
            wrong "a driver whose threads give up in $call" 'driver gave up while' "${crashing[@]}" HOW=threads
            wrong "a driver that ends the program in $call" 'driver ended the program while' \
                "${crashing[@]}" HOW=exit
        done
        gcc -shared -fPIC -DCALL=clGetPlatformIDs "$work/crash.c" -o "$work/crash.so"
        crashes() { # COMMAND ARGUMENTS...
            fails "a driver that crashes under $1" 5 'driver crashed while' env "${crashing[@]}" HOW=crash "$tool" "$@"
        }
        crashes devices
        crashes batch "$mesh" --out-dir "$work/crashed"
        crashes transport "$mesh" --from uniform --to uniform
    else
        skip 'a driver that crashes' 'this build has a runtime that wants to be loaded first'
    fi
else
    skip 'PoCL' 'the devices are of another driver'
fi

check 'caches that the machine has not' \
    test -z "$(HWLOC_SYNTHETIC='pack:1 l1:1 core:1 pu:1' "$tool" devices | grep -E ' L[23]|L1 0')"

# ---- inputs without an end --------------------------------------------------------------------

fails '/dev/zero' 2 '/dev/zero: is a device' "$tool" info /dev/zero
case ${DMKCL_BUILD##*/} in
sanitize | thread) skip 'a pipe without an end' 'this build has a runtime that reserves more than any bound' ;;
*)
    fails 'a pipe without an end' 8 'out of memory: [0-9]+ bytes and no end|out of memory' \
        bash -c 'ulimit -v 2000000; exec "$@" < <(cat /dev/zero)' - "$tool" info /dev/stdin
    ;;
esac

# ---- interruptions ----------------------------------------------------------------------------

python3 tests/interrupts.py "$tool" "${INTERRUPTS:-12}" "${INTERRUPTS_SEED:-17}" > "$work/interrupts"
check 'interrupted runs end at once, with 130, and leave nothing' test $? -eq 0
sed 's/^/# /' "$work/interrupts"
tap_end
