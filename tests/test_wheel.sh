# What is published: a source distribution that is complete, and the wheel made from it, repaired for other
# distributions, in a new environment on a machine without a compiler.
. tests/tap.sh

case $DMKCL_BUILD in
*/release) ;;
*)
    skip 'the wheel' 'The package is tested as it is released, without sanitizers and counters.'
    tap_end
    exit
    ;;
esac
need_packages 'the wheel'
python=$PWD/build/pyenv/bin/python
export PYTHONDONTWRITEBYTECODE=1 PIP_NO_CACHE_DIR=1 PIP_DISABLE_PIP_VERSION_CHECK=1 PIP_ROOT_USER_ACTION=ignore
# Whoever has copied the environment has another path in its scripts.
PATH=$(dirname "$python"):$PATH

# From a copy: a source distribution is put together beside the sources, where other tests look.
make_wheel() {
    mkdir "$work/clone" && cp -pr Makefile README.md LICENSE CITATION.cff include kernels src .ci "$work/clone" &&
        DMKCL_BUILD=$work/b1 "$python" -m build --sdist --no-isolation -o "$work/dist" "$work/clone/src/python" && mkdir "$work/source" &&
        tar -xzf "$work"/dist/dmkcl-*.tar.gz -C "$work/source" --strip-components 1 &&
        DMKCL_BUILD=$work/b2 "$python" -m build --wheel --no-isolation -o "$work/dist" "$work/source"
}
repair_wheel() { "$python" -m auditwheel repair -w "$work/wheel" "$work"/dist/dmkcl-*.whl && ls "$work"/wheel/dmkcl-*-cp310-abi3-manylinux_*.whl; }
names() { "$python" -m zipfile -l "$(echo "$work"/wheel/*.whl)" | awk '{ print $1 }'; }
# Python and its scripts, and the linker and the shell, which PoCL calls: no compiler.
alone() {
    mkdir -p "$work/tools" "$work/home" && for tool_name in ld sh; do ln -sf "$(command -v $tool_name)" "$work/tools/"; done
    env -i HOME="$work/home" PATH="$work/env/bin:$work/tools" LANG=C.UTF-8 "$@"
}
install_wheel() {
    "$python" -m venv --without-pip "$work/env" &&
        for part in numpy cffi pycparser _cffi_backend; do
            find "$(dirname "$python")"/../lib/python3.*/site-packages -maxdepth 1 -name "$part*" ! -name '*dmkcl*' \
                -exec ln -sf -t "$(echo "$work/env"/lib/python3.*/site-packages)" {} +
        done &&
        "$python" -m pip --python "$work/env/bin/python" install -q --no-index --no-deps "$work"/wheel/*.whl
}

check 'a source distribution, and a wheel from it' make_wheel
check 'the source has its licence' test -s "$work/source/LICENSE" -a -s "$work/source/native/LICENSE"
check 'auditwheel repairs it for any Python from 3.10' repair_wheel
check 'it has its licence, types and viewer' sh -c \
    'test "$(grep -cE "^dmkcl/(LICENSE|py.typed|viewer.js)$|dist-info/licenses/LICENSE$")" -eq 4' < <(names)
check 'and the libraries that it needs' sh -c 'grep -q "^dmkcl.libs/libOpenCL"' < <(names)
check 'it installs in a new environment' install_wheel
no_compiler() { ! alone sh -c 'command -v cc || command -v gcc || command -v clang'; }
check 'where there is no compiler' no_compiler
solves() { # kernels are compiled for the first time here
    alone python -c '
import dmkcl
result = dmkcl.CutLocus(dmkcl.surfaces.torus()).solve(point=(3, 0, 0))
assert 20.3 < result.locus.length < 20.7 and result.certificate.gap < 0.01, result' > "$work/words" 2>&1 || {
        cat "$work/words"
        return 1
    }
}
check 'it solves there' solves
check 'and without a word, of compilers, too' diff "$work/words" /dev/null
check 'and has the tool' test "$(alone dmkcl --version)" = "$("$tool" --version)"
tap_end
