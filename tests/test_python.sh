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

need_packages 'the Python package'
check 'pip install ./src/python' install_package
check 'building writes nothing into the source tree' is_clean
"$python" -m pytest --tap -p no:terminal -p no:cacheprovider $source/tests > "$work/pytest"
status=$?
cat "$work/pytest"
check 'pytest ends well' test "$status" -eq 0
tap_end
