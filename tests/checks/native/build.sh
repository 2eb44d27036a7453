# Make a shared object of an OpenCL C source, its kernels compiled for this processor under
# sanitizers, or with the flags in NATIVE_FLAGS. usage: build.sh SOURCE OBJECT OPTION...
set -eu
here=$(dirname "$0")
source=$1 object=$2
shift 2
flags="-g -O1 -fPIC ${NATIVE_FLAGS:--fsanitize=address,undefined,float-cast-overflow,float-divide-by-zero
    -fno-sanitize-recover=all -fno-omit-frame-pointer -shared-libsan}"
cl="clang -x cl -target x86_64-linux-gnu -Xclang -finclude-default-header -Wno-psabi -Wno-unused
    -mavx $flags"
# DMK_FAR: rows of the smallest mesh, too, ask ahead for what they gather.
$cl "$@" -DDMK_FAR=0 -c "$source" -o "$object.kernels.o"
$cl -cl-std=CL1.2 -c "$here/builtins.cl" -o "$object.builtins.o"
# One C function for each kernel that takes its arguments from an array of places.
perl -0777 -ne '
    print "typedef void *pointer;\ntypedef int int4 __attribute__((vector_size(16), aligned(1)));\n",
        "typedef float float8 __attribute__((vector_size(32), aligned(1)));\n";
    while (/^KERNEL(?:_ALONE)? (\w+)\(([^)]*)\)\s*\{(.*?)^\}/gms) {
        my ($name, $body, @type, @value) = ($1, $3);
        for my $p (split /,/, $2) {
            my $t = $p =~ /\*|GATHERED/ ? "pointer" : $p =~ /\b(float8|float|int4)\b/ ? $1 : "int";
            push @value, "*($t *)a[" . @type . "]";
            push @type, $t;
        }
        my $arguments = @type;
        print "void $name(", join(", ", @type), ");\n",
            "const int arguments_$name = $arguments, waits_$name = ", $body =~ /\blocal |TOGETHER|tail_/ ? 1 : 0, ";\n",
            "void call_$name(void **a) { $name(", join(", ", @value), "); }\n";
    }' "$source" > "$object.c"
clang -mavx $flags -w -c "$object.c" -o "$object.calls.o"
clang $flags -shared "$object".*.o -o "$object"
