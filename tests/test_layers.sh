# What the sources promise: a room knows only the rooms before it, by its includes and by the names in
# its objects, its files call each other in no circle; the library neither prints nor exits; kernels are
# OpenCL C 1.2 in every shape.
. tests/tap.sh

rooms=$(sed -n 's/^ROOMS := //p' Makefile)
rooms=$(for room in $rooms; do [ -d src/$room ] && echo "$room"; done)
# The rooms that the names of a room's functions and headers may come from.
knows() {
    case $1 in
    base) ;;
    mesh) echo base ;;
    surfaces | levels | io | geodesic) echo base mesh ;;
    device) echo base ;;
    ranks) echo base mesh levels device ;;
    solver) echo base mesh levels geodesic device ranks ;;
    locus) echo base mesh geodesic ;;
    cut) echo base mesh geodesic locus ;;
    api) echo "$rooms" ;;
    esac
}

# includes ROOM ALLOWED...: no file of the room includes from another room than these.
includes() {
    local room=$1 seen allowed
    shift
    allowed=" $room $* "
    for seen in $(grep -h '^#include "[a-z_]*/' src/"$room"/*.[ch] | sed 's/.*"\(.*\)\/.*/\1/' | sort -u); do
        case $allowed in *" $seen "*) ;; *) echo "src/$room includes $seen/"; return 1 ;; esac
    done
}

# "FILE FILE NAME": the first calls NAME, which the second defines; read from the objects of the build.
for source in $(find src -name '*.c' ! -path 'src/python/*') kernels.c; do
    object=$DMKCL_BUILD/${source%.c}.o
    [ -e "$object" ] || { echo "Bail out! no $object"; exit 1; }
    nm "$object" | awk -v file="${source%.c}" '
        NF == 2 && $1 == "U" { print "uses", $2, file } NF == 3 && $2 ~ /[A-Z]/ { print "has", $3, file }'
done | sort | awk '$1 == "has" { home[$2] = $3 }
    $1 == "uses" && $2 in home && home[$2] != $3 { print $3, home[$2], $2 }' > "$work/calls"
# calls ROOM ALLOWED...: no file of the room calls what another room than these defines.
calls() {
    local room=$1
    shift
    awk -v room="$room" -v allowed=" $room kernels $* " '
        { split($1, from, "/"); n = split($2, to, "/"); there = n > 1 ? to[2] : $2 }
        from[2] == room && !index(allowed, " " there " ") { print $1 " calls " $3 " of " $2; bad = 1 }
        END { exit bad }' "$work/calls"
}
no_circle() { # among the files of a room
    awk -v room="$1" '$1 ~ "^src/" room "/" && $2 ~ "^src/" room "/" { print $1, $2 }' "$work/calls" |
        sort -u | tsort > /dev/null
}
nothing() { # FILES... without a match of PATTERN
    local pattern=$1
    shift
    ! grep -nE -e "$pattern" "$@"
}
library() { find src -name '*.[ch]' ! -path 'src/cli/*' ! -path 'src/python/*'; }

for room in $rooms; do
    allowed=$(echo $(knows $room))
    check "$room includes from ${allowed:-no other room}" includes $room $allowed
    check "$room calls ${allowed:-no other room}" calls $room $allowed
    check "no circle among the files of $room" no_circle $room
done
# Files come into being in one way, whoever writes them.
check 'the tool knows the public header, and of the library how files are written' \
    sh -c "! grep -n '#include \"[a-z_]*/' src/cli/*.[ch] | grep -v '\"base/outfile.h\"'"
pages() { # each folder's own page: there, and short
    local folder
    for folder in src/*/ kernels/ tests/ bench/ meshes/; do
        [ -s "$folder/README.md" ] && [ "$(wc -l < "$folder/README.md")" -le 30 ] || { echo "$folder"; return 1; }
    done
}
check 'each folder has a page of at most 30 lines' pages
check 'only src/device sees OpenCL' \
    nothing '#include <CL/' $(library | grep -v '^src/device/') src/cli/*.[ch]
check 'only solver/kernels.c and ranks/halo.c launch kernels' nothing 'DMK_LAUNCH|dmk_launch\(' \
    $(library | grep -v -e '^src/device/' -e '^src/solver/kernels.c' -e '^src/ranks/halo.c')
check 'the library does not print' nothing '[^n]printf\(|\bputs\(|\bputchar\(|\bperror\(' $(library)
check 'the library does not end the program' nothing '\b(exit|abort)\(' $(library)
check 'the library does not touch the locale' nothing '\bsetlocale\(' $(library)

# Above each kernel: what it reads and writes, the bytes and flops, and how the work is handed out.
untold() {
    awk '/^\/\*/ { said = "" } { said = said $0 " " }
        /^KERNEL/ && said !~ /\/\*.* reads .* writes .* moves .* flops.* shape .*\*\/ KERNEL/ { print FILENAME ": " $0 }' \
        kernels/*.cl
}
check 'every kernel has its header' sh -c 'test -z "$1" || { echo "$1"; false; }' - "$(untold)"
hidden() { # macros that use a name which is neither theirs, nor an argument, nor of the language
    grep -nE '^#define [A-Z_0-9]+(\([^)]*\))? .*\b(shares_|launch_|scratch|partial|scalars|slice|table|arena)\b' kernels/*.cl
}
check 'no kernel macro with hidden names' sh -c 'test -z "$1" || { echo "$1"; false; }' - "$(hidden)"
shared() { # arrays of kernels that are not restrict: only r and its narrow copy may be one (base.cl)
    cat kernels/*.cl | tr '\n' ' ' |
        grep -oE 'KERNEL(_ALONE)? [a-z_]+\([^)]*\)' | tr ',)' '\n\n' | grep '\*' | grep -vE 'volatile global|\*restrict ' |
        sed 's/.*\*//' | sort | uniq -c | xargs
}
check 'the kernels have restrict arrays' test "$(shared)" = '2 narrow 2 r'

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
    # The options that src/device/program.c gives: CPU shape, chunk, double precision, fp64, gathers, PoCL.
    for shape in '1 4 1 1 0 1' '1 4 1 1 1 1' '1 4 0 1 0 1' '1 4 0 0 0 0' '0 1 1 1 0 1' '0 1 0 1 0 0' '0 1 0 0 0 0'; do
        set -- $shape
        check "kernels are OpenCL C 1.2: DMK_CPU $1, _CHUNK $2, _DOUBLE $3, _FP64 $4, _GATHERS $5, _POCL $6" \
            "$clang" -x cl -cl-std=CL1.2 -Xclang -finclude-default-header -fsyntax-only -Wall \
            -Werror -Wno-unused-function -DDMK_CPU=$1 -DDMK_CHUNK=$2 -DDMK_DOUBLE=$3 -DDMK_FP64=$4 \
            -DDMK_GATHERS=$5 -DDMK_POCL=$6 -DDMK_LONE_GROUP=1024 "$work/all.cl"
    done
else
    skip 'kernels are OpenCL C 1.2' 'there is no clang here'
fi

# An entry of a line that is gone excuses nothing. Comments count no more than they do in mutate.py.
bare_lines() { sed -E 's:/\*([^*]|\*[^/])*\*/::g; s:/\*.*::; s/[[:space:]]//g'; }
known_mutants() {
    sed '/^#/d; /^$/d' tests/mutate/known.txt > "$work/known"
    while IFS= read -r entry; do
        line=${entry#* | * | }
        file=${entry%% | *}
        bare_lines < "$file" | grep -qxF -e "$(printf '%s\n' "${line% | *}" | bare_lines)" ||
            echo "no such line: $entry"
    done < "$work/known" > "$work/gone"
    cat "$work/gone"
    ! grep -q . "$work/gone"
}
check 'lines of tests/mutate/known.txt are in the sources' known_mutants
tap_end
