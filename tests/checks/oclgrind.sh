# Every kernel in both shapes and both precisions under Oclgrind: data races, accesses outside of
# buffers, wrong calls of OpenCL. (Its search for uninitialised values does not know LLVM's `freeze`
# and finds them everywhere.)
. tests/checks/lib.sh

"$build/dmkcl" mesh sphere --triangles 320 --source 0,0,1 --out "$work/sphere.off" --quiet || exit 1
gcc $flags -Itests -O1 tests/checks/solve.c "$build/libdmkcl.a" -o "$work/solve" \
    $libs || exit 1
runs='cpu:double cpu:single gpu:double gpu:single'
[ -z "$short" ] || runs='cpu:single gpu:double' # the others: kernels.sh
# All but the benchmark's copy, those of ranks, as Oclgrind does not bear two threads, and those of coarse levels too
# large for the one launch that does the coarsest ones: kernels.sh has these.
others='narrow_copy|halo_.*|cg_alpha|cg_beta|inner_scalars|sum_partials|coarse_solve|coarse_inverse'
others+='|graph_refresh|prolong_rows|prolong_chebyshev|restrict_rows'
kernels=$(grep -hoE '^KERNEL(_ALONE)? [a-z_]+' kernels/*.cl | cut -d' ' -f2 | sort -u | grep -vxE "$others")

# Errors but for two kinds, where it does not matter whether the old value is read or the new one: band_slopes and
# repair_elements look at a maximum or a flag before they raise it by an atomic operation, to spare most of these;
# repair_grow takes rows of no ring into the next one, which is as little of this one as no ring is.
errors() { # LOG
    awk '/^(Read-write|Write-write|Invalid|Uninit|OCLGRIND)|data race|error/ && !/Instructions/ { what = $0
            getline; if ($0 !~ /Kernel: (band_slopes|repair_elements|repair_grow)/ || what !~ /^Read-write data race at global/) {
                print what; print } }' "$1"
}
place=$work
clean() { # SHAPE:PRECISION
    timeout 900 oclgrind --data-races --check-api --max-errors 100000 --inst-counts \
        "$place/solve" "$place/sphere.off" ${1%:*} ${1#*:} > "$work/log" 2>&1 || { tail "$work/log"; return 1; }
    sed -n "s/^Instructions executed for kernel '\(.*\)':/\1/p" "$work/log" | sort -u > "$place/seen:$1"
    says_nothing errors "$work/log"
}
each clean $runs
for run in $runs; do
    for kernel in $kernels; do
        # In single precision nothing is rounded on the way, and needles have no levels of their own.
        case $kernel:$run in newton_rows:*:single | fine_*:*:single | *_wide:*:single | rows_scale:*:single) continue ;; esac
        try "$run: $kernel ran" grep -qx $kernel "$work/seen:$run"
    done
done
finish
