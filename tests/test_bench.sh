# The programs of bench/ in their smallest runs: what they read is still what the tool writes.
. tests/tap.sh
need_packages 'the programs of bench/'
python=build/pyenv/bin/python

# Rows of all methods, those of Anderson acceleration from a program that calls the library's inner parts.
methods() {
    "$python" bench/methods.py --program "$tool" --anderson "$DMKCL_BUILD/bench-anderson" --work "$work" \
        --results "$work" meshes/torus.off || return
    ! grep -E 'exit|not there|nan' "$work/methods.md" || return
    # Its steps lead to the same density, and their bounds to the same cost.
    grep -qE '^\| anderson, m 5 \| L1 0.005 \|.*\| 0\.00[0-4][0-9] \| [0-9.]*e-0[67] \| [0-9.]*e-04 \|$' "$work/methods.md"
}
check 'methods' methods

accuracy() {
    "$python" bench/accuracy.py --program "$tool" --sizes 5 --surfaces torus --meshes aligned --out "$work/a.csv" &&
        grep -q '^| torus | aligned | 5184 | 0.00 | 0.00 |' "$work/a.md"
}
check 'accuracy' accuracy

scan() {
    "$python" bench/scan.py --program "$tool" --meshes tests/data --names rough --out "$work/s.csv" &&
        grep -q '^| rough | 1708 | 5120 | 0.00 | 0.00 | 0 |' "$work/s.md"
}
check 'scan' scan

parts() { # a tetrahedron, in VRML
    mkdir "$work/parts" &&
        echo 'coordIndex [0,1,2,-1, 0,2,3,-1, 0,3,1,-1, 1,3,2,-1] point [0 0 0, 0 1 0, 1 0 0, 0 0 1]' > "$work/parts/a.wrl" &&
        "$python" bench/cad.py --program "$tool" --models "$work/parts" --out "$work/parts.md" &&
        grep -q '^| meshes, solved | 1, 1 |' "$work/parts.md" && grep -q 'one border | 1 of 1 |' "$work/parts.md" &&
        grep -qE '\| (-?0.0e\+00|[0-9.]*e-1[4-7]), (-?0.0e\+00|[0-9.]*e-1[4-7]), 1 \|$' "$work/parts.md"
}
check 'machine parts' parts

kernels() {
    "$DMKCL_BUILD/bench-kernels" meshes/quartic.off > "$work/kernels" && [ "$(grep -cE '\| (ok|missed) \|$' "$work/kernels")" -eq 7 ]
}
check 'kernels' kernels
tap_end
