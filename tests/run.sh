#!/bin/sh
# SPDX-License-Identifier: MIT
# Runs TAP tests side by side, JOBS at a time (as many as there are processors), and adds them up: sh tests/run.sh TEST...
# Ends with "N passed, N failed, N skipped". The numbers also go to the file $COUNTS; those of the file $BEFORE are counted
# in. VERBOSE=1 prints everything. Long tests had better stand first, so that none is left to run alone at the end.
if [ "$1" = --one ]; then # one test: its numbers go to $SUMS, what it says is printed in one piece
    test=$2
    log=$(mktemp)
    trap 'rm -f "$log"' EXIT
    case $test in *.sh) runner=sh ;; *) runner= ;; esac
    begun=$(date +%s)
    $runner "$test" >"$log" 2>&1
    status=$?
    p=$(grep -cE '^ok ' "$log") f=$(grep -cE '^not ok ' "$log") s=$(grep -cE '^ok .*# SKIP' "$log")
    plan=$(grep -cE '^1\.\.[0-9]+' "$log") early=
    if [ "$plan" -ne 1 ] || { [ $status -ne 0 ] && [ "$f" -eq 0 ]; }; then
        early="not ok - $test ended early (exit $status):
$(tail -5 "$log")
"
        f=$((f + 1))
    fi
    [ -n "$VERBOSE" ] && shown=$(cat "$log") || shown=$(grep -E '^not ok |# SKIP' "$log")
    echo "$((p - s)) $f $s" >> "$SUMS"
    printf '%s# %s: %d passed, %d failed, %d skipped, %d s\n%s' "$early" "$test" $((p - s)) $f $s $(($(date +%s) - begun)) "${shown:+$shown
}"
    exit 0
fi
SUMS=$(mktemp)
export SUMS
trap 'rm -f "$SUMS"' EXIT
before=0
[ -n "$BEFORE" ] && before=1 && cat "$BEFORE" > "$SUMS"
printf '%s\0' "$@" | xargs -0 -P "${JOBS:-$(nproc)}" -I TEST sh "$0" --one TEST
[ "$(wc -l < "$SUMS")" -eq $(($# + before)) ] || { echo "not ok - some tests left no result"; echo "0 1 0" >> "$SUMS"; }
sums=$(awk '{p += $1; f += $2; s += $3} END {print p + 0, f + 0, s + 0}' "$SUMS")
[ -n "$COUNTS" ] && echo "$sums" > "$COUNTS"
echo "$sums" | awk '{print $1 " passed, " $2 " failed, " $3 " skipped"; exit $2 > 0}'
