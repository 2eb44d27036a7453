# A long time of use by many short runs, SOAK_SECONDS (60; a day is 86400): surfaces, sizes, sources,
# options and formats by chance, some runs interrupted. Each run must end as it should, leave only
# whole files, and give the same bits when it is repeated. SOAK_SEED repeats a sequence.
. tests/checks/lib.sh

seconds=${SOAK_SECONDS:-60}
seed=${SOAK_SEED:-$(($(date +%s) % 32768))}
RANDOM=$seed
tool=$build/dmkcl
place=$work/place
export TMPDIR=$work XDG_CACHE_HOME=$work/cache
mkdir -p "$place" "$XDG_CACHE_HOME"
# Chance goes into `it`, as a subshell would have a sequence of its own.
one_of() { shift $((RANDOM % $#)); it=$1; }
between() { it=$(($1 + RANDOM % ($2 - $1 + 1))); } # LOW HIGH
add() { arguments="$arguments $*"; }

make_order() { # sets mesh, arguments, files
    local surface triangles x y z
    between 0 5; mesh=$work/mesh$it.off
    one_of sphere torus ellipsoid quartic; surface=$it
    between 200 6000; triangles=$it
    # An old mesh twice out of three times.
    between 0 2
    if [ ! -e "$mesh" ] || [ $it -eq 0 ]; then
        "$tool" mesh $surface --triangles $triangles --out "$mesh" --quiet || return
    fi
    between -2999 2999; x=$it
    between -2999 2999; y=$it
    between -2999 2999; z=$it
    arguments=--source=${x}e-3,${y}e-3,${z}e-3
    one_of '' '' --single; add $it
    one_of '' '' '--method inertial'; add $it
    between 1 2; add --threads $it
    one_of vtp vtu ply; files=result.$it
    one_of obj vtp csv; files="$files locus.$it tangent.csv report.json"
}
run() { # FOLDER: a whole run
    set -- "$1" $files
    "$tool" solve "$mesh" $arguments --out "$1/$2" --locus "$1/$3" --tangent "$1/$4" \
        --report "$1/$5" --quiet
}
holds() { [ "$(ls -A "$1" | sort | tr '\n' ' ')" = "$(printf '%s\n' $2 | sort | tr '\n' ' ')" ]; }
sound() { # FOLDER: what the report says of itself
    perl -0777 -ne '
        my ($gap) = /"gap":\s*([0-9.eE+-]+)/ or exit 1;
        my ($lower, $upper) = /"cost_lower":\s*([0-9.eE+-]+).*"cost_upper":\s*([0-9.eE+-]+)/s;
        ($lower, $upper) = /"lower":\s*([0-9.eE+-]+).*"upper":\s*([0-9.eE+-]+)/s unless defined $lower;
        my ($memory) = /"(?:peak_)?memory[a-z_]*":\s*([0-9]+)/;
        exit !($gap >= 0 && $gap < 0.2 && (!defined $lower || $lower <= $upper) &&
            (!defined $memory || $memory < 1e9))' "$1/report.json" || { cat "$1/report.json"; return 1; }
}
whole_run() {
    rm -rf "$place" && mkdir "$place" && run "$place" && holds "$place" "$files" && sound "$place"
}
repeated_run() {
    whole_run && rm -rf "$work/before" && mv "$place" "$work/before" && whole_run || return
    for file in $files; do
        [ $file = report.json ] || cmp "$work/before/$file" "$place/$file" || return
    done
}
interrupted_run() {
    rm -rf "$place" && mkdir "$place" || return
    local signal
    one_of INT TERM; signal=$it
    between 100 300
    timeout --foreground -s $signal 0.$it "$tool" solve "$mesh" $arguments \
        --out "$place/result.vtp" --locus "$place/locus.obj" --quiet
    local status=$?
    # 124: timeout has sent the signal, once: a second one ends the tool where it is. What is there is
    # whole: nothing, or one file, or both.
    [ $status -eq 124 ] || [ $status -eq 0 ] || [ $status -eq 130 ] || return
    for file in $(ls -A "$place"); do
        case $file in
        result.vtp) tail -c 100 "$place/$file" | grep -q '</VTKFile>' || return ;;
        locus.obj) ;;
        *) echo "left behind: $file"; return 1 ;;
        esac
    done
}
refused_run() {
    rm -rf "$place" && mkdir "$place" || return
    between 1 2000
    head -c $it "$mesh" > "$work/cut.off"
    "$tool" solve "$work/cut.off" --vertex 0 --out "$place/x.vtp" --quiet
    local status=$?
    [ $status -ge 1 ] && [ $status -le 4 ] && [ -z "$(ls -A "$place")" ]
}

end=$(($(date +%s) + seconds)) early=0
while [ "$(date +%s)" -lt $end ] && [ $failed -lt 20 ]; do
    one_of whole whole repeated interrupted refused
    kind=$it
    make_order || { echo 'a mesh is not made'; failed=$((failed + 1)); tried=$((tried + 1)); continue; }
    try "run $tried (seed $seed): $kind: ${mesh##*/} $arguments $files" ${kind}_run
    # The kernel cache is full after the first runs.
    [ $tried -eq 40 ] && early=$(du -sk "$XDG_CACHE_HOME" | cut -f1)
done
[ $early -eq 0 ] || try 'the kernel cache stays as it is' \
    [ "$(du -sk "$XDG_CACHE_HOME" | cut -f1)" -le $((early + early / 4 + 4096)) ]
finish
