# Kernels and library compiled for the processor by clang under ASan and UBSan, on an OpenCL of our
# own (native/): every kernel in both shapes and both precisions. Buffers end where they end, so one
# number read or written beyond is found.
. tests/checks/lib.sh

export NATIVE_BUILD=$PWD/tests/checks/native/build.sh
export UBSAN_OPTIONS=print_stacktrace=1 ASAN_OPTIONS=detect_stack_use_after_return=0
runs='cpu:double cpu:single gpu:double gpu:single'
[ -z "$short" ] || runs='cpu:double gpu:single' # the others: oclgrind.sh
# All but the benchmark's copy.
kernels=$(grep -hoE '^KERNEL(_ALONE)? [a-z_]+' kernels/*.cl | cut -d' ' -f2 | sort -u | grep -vx narrow_copy)
sources=$(find src -name '*.c' ! -path 'src/cli/*' ! -path 'src/python/*' | sort)
sanitize='-g -O1 -fsanitize=address,undefined -fno-sanitize-recover=all -fno-omit-frame-pointer
    -shared-libsan'
"$build/dmkcl" mesh sphere --triangles 320 --source 0,0,1 --out "$work/gpu.off" --quiet || exit 1
# Large enough for the CPU shape to share the work among threads, and for two ranks: each has a chunk of vertices
# at least, and a chunk is up to 256 blocks of 8, by the size of the processor's first cache.
"$build/dmkcl" mesh sphere --triangles 9000 --source 0,0,1 --out "$work/cpu.off" --quiet || exit 1
clang $flags -Itests $sanitize -w -rdynamic tests/checks/solve.c tests/checks/native/opencl.c $sources \
    "$build/kernels.c" -o "$work/solve" -ldl ${libs/-lOpenCL/} \
    -Wl,-rpath,"$(dirname "$(clang -print-file-name=libclang_rt.asan-x86_64.so)")" || exit 1

place=$work
solves() { # SHAPE:PRECISION
    export NATIVE_FOLDER=$work
    timeout 600 "$place/solve" "$place/${1%:*}.off" ${1%:*} ${1#*:} "$place/cpu.off" > "$work/said" 2>&1
    local status=$?
    cat "$work/said"
    sed -n 's/^kernel //p' "$work/said" | sort -u > "$place/seen:$1"
    return $status
}
each solves $runs
for run in $runs; do
    for kernel in $kernels; do
        # In single precision nothing is rounded on the way.
        [ $kernel$run != newton_rows${run%:*}:single ] || continue
        try "$run: $kernel ran" grep -qx $kernel "$work/seen:$run"
    done
done
finish
