# What the libraries show and hold: names begin with dmk_, no data that can be written (no globals),
# nothing that prints or ends the program; what the public header declares is exported, and only that.
. tests/checks/lib.sh

static=$build/libdmkcl.a
shared=$(readlink -e "$build/libdmkcl.so") || exit 1
nm -A --defined-only "$static" > "$work/static" || exit 1
nm -u "$static" | awk '{ print $2 }' | sort -u > "$work/used"
try 'names begin with dmk_' \
    says_nothing awk '$(NF - 1) ~ /^[A-Z]$/ && $NF !~ /^dmk_/' "$work/static"
# Constant tables of pointers lie in .data.rel.ro, which the loader closes. opencl_process, of open.c, is what it takes
# to refuse OpenCL in a forked child; n_opening, of program.c, what a handler of signals can ask for.
try 'no data that can be written' says_nothing sh -c "objdump -t '$static' | grep -E ' O (\\.data|\\.bss|\\.tdata|\\.tbss|\\*COM\\*)[[:space:]]' | grep -vwE 'opencl_process|n_opening'"
for name in printf puts putchar perror exit abort system popen execve setlocale signal sigaction \
    rand srand strtok gets sprintf strcpy strcat mktemp tmpnam; do
    try "$name is not called" says_nothing grep -xE "(__)?$name(_chk)?(@.*)?" "$work/used"
done
nm -D --defined-only "$shared" | awk '{ print $NF }' | sort > "$work/exported"
gcc -E -P include/dmkcl.h | grep -o 'dmk_[a-z0-9_]*(' | tr -d '(' | sort -u > "$work/declared"
try 'exported is what is declared' diff "$work/declared" "$work/exported"
try 'the stack is not executable' \
    sh -c "readelf -lW '$shared' | grep GNU_STACK | grep -q 'RW '"
try 'no text relocations' sh -c "! readelf -dW '$shared' | grep TEXTREL"
try 'every header function is used by a test or the tool' says_nothing \
    sh -c "while read -r f; do grep -rqw \"\$f\" tests src/cli || echo \"\$f\"; done < '$work/declared'"
finish
