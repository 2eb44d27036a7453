# The tool under valgrind's memcheck, kernels included, on an OpenCL of our own (native/): no access
# outside of memory, no value used before it is set, no memory lost.
. tests/checks/lib.sh

export NATIVE_BUILD=$PWD/tests/checks/native/build.sh NATIVE_FOLDER=$work NATIVE_FLAGS=-gdwarf-4
tool=$work/dmkcl
gcc $flags -g -O1 -w -rdynamic tests/checks/native/opencl.c $(find src -name '*.c' ! -path 'src/python/*') \
    "$build/kernels.c" -o "$tool" -ldl ${libs/-lOpenCL/} || exit 1
memcheck() { # STATUS ARGUMENT...: the tool ends with STATUS
    local status=$1 got
    shift
    timeout 600 valgrind --quiet --error-exitcode=99 --leak-check=full --track-origins=no \
        --show-leak-kinds=definite --errors-for-leak-kinds=definite \
        "$tool" "$@"
    got=$?
    [ $got -eq "$status" ] || { echo "status $got instead of $status"; return 1; }
}
sphere=$work/sphere.off torus=$work/torus.off
try 'mesh sphere' memcheck 0 mesh sphere --triangles 320 --source 0,0,1 --out "$sphere"
try 'mesh torus' memcheck 0 mesh torus --triangles 400 --source 3,0,0 --out "$torus"
try 'info' memcheck 0 info "$torus"
for suffix in ply vtp vtu; do
    try "solve to .$suffix" memcheck 0 solve "$torus" --vertex 0 --out "$work/x.$suffix"
    try "info of .$suffix" memcheck 0 info "$work/x.$suffix"
done
try 'solve with locus, tangent, report' memcheck 0 solve "$torus" --source 1,1,1 \
    --locus "$work/l.obj" --locus "$work/l.vtp" --locus "$work/l.csv" --tangent "$work/t.csv" \
    --report "$work/r.json"
try 'solve, single precision, inertial' memcheck 0 solve "$sphere" --vertex 3 --single \
    --method inertial --quiet
printf '0,0,1\nvertex 7\n' > "$work/sources"
try 'many sources' memcheck 0 solve "$sphere" --sources "$work/sources" --out "$work/m.vtp"
try 'path' memcheck 0 path "$torus" --vertex 0 --to-vertex 99 --out "$work/p.vtp"
try 'cut' memcheck 0 cut "$torus" --vertex 0 --out "$work/c.obj"
try 'a step limit' memcheck 7 solve "$torus" --vertex 0 --start uniform --max-steps 1
try 'a vertex that is not there' memcheck 1 solve "$torus" --vertex 999999
try 'no file' memcheck 2 info "$work/nothing.off"
printf 'OFF\n3 1 0\n0 0 0\n1 0 0\n' > "$work/short.off"
try 'half a file' memcheck 3 info "$work/short.off"
printf 'OFF\n4 3 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 1 2\n3 0 1 3\n3 1 0 2\n' > "$work/bad.off"
try 'a mesh that is none' memcheck 4 info "$work/bad.off"
finish
