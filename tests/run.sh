#!/bin/sh
# SPDX-License-Identifier: MIT
# Runs TAP tests and adds them up: sh tests/run.sh COMMAND... Ends with "N passed, N failed, N skipped". The numbers
# also go to the file $COUNTS; those of the file $BEFORE are counted in.
passed=0 failed=0 skipped=0
[ -n "$BEFORE" ] && read -r passed failed skipped < "$BEFORE"
log=$(mktemp)
trap 'rm -f "$log"' EXIT
for test in "$@"; do
    case $test in *.sh) runner=sh ;; *) runner= ;; esac
    begun=$(date +%s)
    $runner "$test" >"$log" 2>&1
    status=$?
    p=$(grep -cE '^ok ' "$log") f=$(grep -cE '^not ok ' "$log") s=$(grep -cE '^ok .*# SKIP' "$log")
    plan=$(grep -cE '^1\.\.[0-9]+' "$log")
    if [ "$plan" -ne 1 ] || { [ $status -ne 0 ] && [ "$f" -eq 0 ]; }; then
        echo "not ok - $test ended early (exit $status):"
        tail -5 "$log"
        f=$((f + 1))
    fi
    echo "# $test: $((p - s)) passed, $f failed, $s skipped, $(($(date +%s) - begun)) s"
    grep -E '^not ok |# SKIP' "$log"
    [ -n "$VERBOSE" ] && cat "$log"
    passed=$((passed + p - s)) failed=$((failed + f)) skipped=$((skipped + s))
done
[ -n "$COUNTS" ] && echo "$passed $failed $skipped" > "$COUNTS"
echo "$passed passed, $failed failed, $skipped skipped"
[ "$failed" -eq 0 ]
