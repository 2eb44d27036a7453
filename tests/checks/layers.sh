# What knows what: see tests/test_layers.sh.
. tests/checks/lib.sh
tested layers sh tests/run.sh "$build" tests/test_layers.sh
finish
