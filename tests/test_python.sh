# The Python package, built and installed into the virtual environment of the tests as a user does,
# then pytest. What is up to date stays.
. tests/tap.sh

case $DMKCL_BUILD in
*/release) ;;
*)
    skip 'the Python package' 'The package is tested as it is released, without sanitizers and counters.'
    tap_end
    exit
    ;;
esac

base=$PWD/build/python
source=src/python
python=$PWD/build/pyenv/bin/python
mkdir -p "$base"
# Nothing goes into the source tree, the user's folders or pip's cache.
export PYTHONDONTWRITEBYTECODE=1 PIP_NO_CACHE_DIR=1 PIP_DISABLE_PIP_VERSION_CHECK=1
export PIP_ROOT_USER_ACTION=ignore MPLCONFIGDIR=$work/matplotlib

install_package() {
    local changed
    changed=$(find Makefile README.md LICENSE include kernels src -newer "$base/package.ok" -type f \
        ! -path "$source/tests/*" ! -path "$source/examples/*" 2>&1)
    [ -n "$changed" ] || ! "$python" -c 'import dmkcl' || return 0
    touch "$base/begun" &&
        DMKCL_BUILD=$base/build "$python" -m pip install -q --no-build-isolation --no-deps \
            --force-reinstall ./$source && mv "$base/begun" "$base/package.ok"
}
# Building leaves no trace beside the sources.
is_clean() {
    ! find $source -name '*.egg-info' -o -name build -o -name '*.so' -o -name '*.c' | grep .
}

# From a copy of the sources, for it leaves the extension and the tool there; the parts it needs to build are the tests'
# own, and the C library is the one that was just compiled.
install_editable() {
    local env=$work/editable
    mkdir -p "$base/editable" "$work/clone" && cp -pr "$base/build/lib" "$base/editable" && cp -pr Makefile README.md LICENSE CITATION.cff include kernels src .ci "$work/clone" &&
        "$python" -m venv --without-pip "$env" &&
        find "$(dirname "$python")"/../lib/python3.*/site-packages -maxdepth 1 -mindepth 1 ! -name '*dmkcl*' \
            -exec ln -sf -t "$(echo "$env"/lib/python3.*/site-packages)" {} + &&
        DMKCL_BUILD=$base/editable "$python" -m pip --python "$env/bin/python" install -q --no-build-isolation --no-deps \
            -e "$work/clone/$source" &&
        "$env/bin/python" -c "import dmkcl; assert dmkcl.__file__.startswith('$work/clone'); dmkcl.surfaces.sphere()" &&
        test "$("$env/bin/dmkcl" --version)" = "$("$DMKCL_BUILD/dmkcl" --version)"
}

need_packages 'the Python package'
check 'pip install ./src/python' install_package
check 'building writes nothing into the source tree' is_clean
check 'an editable install, with its dmkcl command' install_editable
"$python" -m pytest --tap -p no:terminal -p no:cacheprovider $source/tests > "$work/pytest"
status=$?
cat "$work/pytest"
check 'pytest ends well' test "$status" -eq 0
tap_end
