# What the sources promise: a room knows only the rooms before it, the library neither prints nor
# exits, kernels are OpenCL C 1.2 in every shape.
. tests/tap.sh

# includes ROOM ALLOWED...: no file of the room includes from another room than these.
includes() {
    local room=$1 seen allowed
    shift
    allowed=" $room $* "
    for seen in $(grep -h '^#include "[a-z_]*/' src/"$room"/*.[ch] | sed 's/.*"\(.*\)\/.*/\1/' | sort -u); do
        case $allowed in *" $seen "*) ;; *) echo "src/$room includes $seen/"; return 1 ;; esac
    done
}
nothing() { # FILES... without a match of PATTERN
    local pattern=$1
    shift
    ! grep -nE -e "$pattern" "$@"
}
library() { find src -name '*.[ch]' ! -path 'src/cli/*' ! -path 'src/python/*'; }

check 'base knows no other room' includes base
check 'mesh knows base' includes mesh base
check 'io knows base, mesh' includes io base mesh
check 'device knows base' includes device base
check 'solver knows base, mesh, device' includes solver base mesh device
check 'locus knows base, mesh' includes locus base mesh
check 'the tool knows the public header only' includes cli
check 'only src/device sees OpenCL' \
    nothing '#include <CL/' $(library | grep -v '^src/device/') src/cli/*.[ch]
check 'the library does not print' nothing '[^n]printf\(|\bputs\(|\bputchar\(|\bperror\(' $(library)
check 'the library does not end the program' nothing '\b(exit|abort)\(' $(library)
check 'the library does not touch the locale' nothing '\bsetlocale\(' $(library)

clang=$(command -v clang clang-15 clang-14 clang-16 | head -n 1)
if [ -n "$clang" ]; then
    cat > "$work/print.c" << 'EOF'
#include <stddef.h>
#include <stdio.h>
extern const char *const dmk_kernel_lines[];
extern const size_t dmk_kernel_n_lines;
int main(void)
{
    for (size_t i = 0; i < dmk_kernel_n_lines; i++) fputs(dmk_kernel_lines[i], stdout);
    return 0;
}
EOF
    check 'the embedded kernels print' \
        sh -c "gcc '$work/print.c' '$DMKCL_BUILD/kernels.c' -o '$work/print' && '$work/print' > '$work/all.cl'"
    # The options that src/device/program.c gives: CPU shape, chunk, double precision, fp64.
    for shape in '1 4 1 1' '1 4 0 1' '1 4 0 0' '0 1 1 1' '0 1 0 1' '0 1 0 0'; do
        set -- $shape
        check "kernels are OpenCL C 1.2: DMK_CPU $1, _CHUNK $2, _DOUBLE $3, _FP64 $4" \
            "$clang" -x cl -cl-std=CL1.2 -Xclang -finclude-default-header -fsyntax-only -Wall \
            -Werror -Wno-unused-function -DDMK_CPU=$1 -DDMK_CHUNK=$2 -DDMK_DOUBLE=$3 -DDMK_FP64=$4 \
            "$work/all.cl"
    done
else
    skip 'kernels are OpenCL C 1.2' 'there is no clang here'
fi
tap_end
