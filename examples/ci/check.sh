#!/bin/sh
# Runs a suite, compares it with a baseline, and writes the board and the comparison to comment.md.
#
#   check.sh SUITE ESTIMATOR BASELINE.zip [OPTIONS of vobench run]
#
# Exit code 0: nothing got worse. 3: something got worse or fails now. Any other: vobench could not run or compare.
set -u
suite=$1
estimator=$2
baseline=$3
shift 3

vobench run "$suite" --estimator "$estimator" --quiet --out runs "$@" > run.txt || exit
vobench compare "$baseline" "runs/$suite" > compare.txt
verdict=$?

{
    case $verdict in
        0) echo "### $suite: nothing got worse" ;;
        3) echo "### $suite: something got worse" ;;
        *) echo "### $suite: could not be compared with the baseline" ;;
    esac
    echo
    vobench report "runs/$suite" --format md
    echo
    echo "Compared with the baseline:"
    echo
    echo '```'
    cat compare.txt
    echo '```'
} > comment.md
exit $verdict
