# The library's and the tool's own threads under ThreadSanitizer; OpenCL's libraries are not looked at.
. tests/checks/lib.sh

tests='api coarsen long parallel solver start'
[ "$short" ] && export DMKCL_LONG=16 || tests="$tests locus same"
tool=build/thread/dmkcl
make -s CONFIG=thread "$tool" $(printf 'build/thread/tests/test_%s ' $tests) || exit 1
export TSAN_OPTIONS='ignore_noninstrumented_modules=1 halt_on_error=1 exitcode=66'
# Seconds: test_locus takes 412 of processor time, and 1,140 in all beside other work.
for test in $tests; do
    try "test_$test" timeout 3600 "build/thread/tests/test_$test"
done
"$tool" mesh torus --triangles 20000 --source 3,0,0 --out "$work/torus.off" --quiet || exit 1
printf '3,0,0\n1,1,1\nvertex 7\nvertex 12345678\n' > "$work/sources"
try 'solve' "$tool" solve "$work/torus.off" --source 1,1,1 --out "$work/x.vtp" \
    --locus "$work/x.obj" --tangent "$work/x.csv"
try 'solve, uniform start' "$tool" solve "$work/torus.off" --source 1,1,1 --start uniform
try 'distance, merged' "$tool" distance "$work/torus.off" --vertex 0 --tolerance 1e-6 --threads 3
try 'path' "$tool" path "$work/torus.off" --vertex 0 --to-vertex 999
try 'cut' "$tool" cut "$work/torus.off" --vertex 0 --out "$work/cut.obj"
# The last source is none, which the exit code says; ThreadSanitizer's own is 66.
try 'many sources' sh -c "'$tool' solve '$work/torus.off' --sources '$work/sources' \
    --out '$work/m.vtp'; [ \$? -eq 1 ]"
mkdir "$work/many"
for k in 1 2 3 4 5 6; do "$tool" mesh sphere --triangles 400 --out "$work/many/$k.off" --quiet || exit 1; done
for k in 2 4; do echo none > "$work/many/$k.off"; done
try 'many meshes' sh -c "'$tool' batch '$work/many' --threads 3 --json; [ \$? -eq 3 ]"
finish
