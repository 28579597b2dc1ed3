# SPDX-License-Identifier: MIT
# palp wcet and calibrate: tables, verdicts, searched paths, and what they refuse.
. "$(dirname "$0")/lib.sh"
small_body r.palp
small_chain z.palp
printf 'mesh bar.obj\nyoung 1e4\npoisson 0.4\nfix-below x 1e-6\ntets 120 400\n' > d.model
$palp bake d.model -o d.palp > /dev/null 2>&1
has() { # has NAME FILE PATTERN...
    name=$1 file=$2 missing=""
    shift 2
    for p in "$@"; do grep -q -- "$p" "$file" || missing="$missing $p"; done
    [ -z "$missing" ]; ok $? "$name $missing"
}
for b in r z d; do
    $palp wcet $b.palp --rate 500 --target cortex-m7 --limits 16 8 2 6 --json > $b.json
    has "JSON of $b" $b.json '"rate_hz":500' '"period_us":2000' '"target":"cortex-m7"' '"steps":\[{"step"' '"level":' '"instructions_max":' \
        '"time_us_max":' '"bytes_max":' '"ram_bytes":' '"stack_bytes":' '"finest_level_in_time":' '"verdict":"'
    if command -v python3 > /dev/null; then python3 -c 'import json, sys; d = json.load(open(sys.argv[1])); assert all(s["instructions_max"] > 0 for s in d["steps"])' $b.json; ok $? "it parses"; fi
done
$palp wcet r.palp --rate 1 --json > slow.json
$palp wcet r.palp --rate 1000000 --json > fast.json; ok $? "a refusal is an answer, exit 0"
has "one tick a second fits, on the finest level" slow.json '"verdict":"fits"' '"finest_level_in_time":3'
has "a million do not" fast.json '"verdict":"refused"' '"finest_level_in_time":-1'
$palp wcet r.palp --rate 1000000 > refused.txt
has "and the text says by how much" refused.txt 'refused: the least answer needs'
$palp wcet r.palp --hunt 1 --keep path > /dev/null 2> hunt.txt
has "the search says how near it came" hunt.txt 'of at most' 'longest tick'
$palp wcet r.palp --replay path > one.csv && $palp wcet r.palp --replay path > two.csv && cmp -s one.csv two.csv
ok $? "a kept path repeats: $(wc -l < one.csv) lines"
$palp calibrate -o board.cost > /dev/null 2>&1 && $palp wcet r.palp --target board.cost > own.txt
ok $? "calibrated: $(grep -E '^ns-per' board.cost | tr '\n' ' ')"
refuses 2 "neither a file nor a target" "unknown target" $palp wcet r.palp --target pdp-11
refuses 2 "which blob" "no blob" $palp wcet
refuses 2 "goes with --hunt" "--keep alone" $palp wcet r.palp --keep out.path
refuses 2 "goes with a ball" "searching with a pad" $palp wcet r.palp --hunt 1 --tool pad
refuses 2 "" "limits that cannot be" $palp wcet r.palp --limits 8 16 2 6
refuses 2 "" "no rate" $palp wcet r.palp --rate 0
grep -v '^ball ' board.cost > short.cost
refuses 1 "no line 'ball'" "an incomplete table" $palp wcet r.palp --target short.cost
grep -v '^ns-per-byte' board.cost > nobyte.cost
refuses 1 "ns-per-byte" "a table without the memory's speed" $palp wcet r.palp --target nobyte.cost
sed 's/^name .*/name a"b/' board.cost > quote.cost
refuses 1 "quotes" "a name that JSON cannot hold" $palp wcet r.palp --target quote.cost
sed 's/^seed .*/seed abc/' path > bad.path
refuses 1 "whole number" "a path with a bad seed" $palp wcet r.palp --replay bad.path
refuses 1 "bake it again" "a damaged blob" sh -c "head -c 5000 r.palp > cut.palp; $palp wcet cut.palp"
refuses 2 "single bodies" "searching on zones" $palp wcet z.palp --hunt 1
# One table of prices, one verdict: palp play refuses what palp wcet refuses, at the same figure.
printf 'seconds 0.1\nrate 1000\nprobe 0.006\ntouch 0 0.05 0.01 0.04\n' > probe.scene
verdict() { # verdict NAME BLOB FINEST MACHINE...: the least answer by both, in whole us; fits only if both say so
    name=$1 blob=$2 finest=$3
    shift 3
    $palp wcet "$blob" --tool-radius 0.006 "$@" > w.txt
    $palp play "$blob" --scene probe.scene --finest "$finest" "$@" > p.txt 2> perr.txt
    said=$?
    asked=$(sed -n 's/^refused: the least answer needs \([0-9.e+]*\) us.*/\1/p' w.txt | awk '{printf "%.0f", $1}')
    told=$(sed -n 's/.*\(may take\|mesh needs\) \([0-9]*\) us on.*/\2/p' perr.txt)
    if grep -q '^fits' w.txt; then [ $said -eq 0 ]; else [ $said -eq 1 ] && awk -v a="$asked" -v b="$told" 'BEGIN {exit !(a > 0 && (a - b)^2 <= 1)}'; fi
    ok $? "$name, $*: wcet $(grep -oE '^(fits|refused)' w.txt) ${asked:-} us, play exit $said ${told:-} us"
}
for machine in "--target cortex-m7" "--target x86-64" "--ns-per-operation 5" "--ns-per-operation 0.01"; do
    verdict "a dynamic body" d.palp 7 $machine
    verdict "a multizone model" z.palp 5 $machine
done
refuses 2 "one machine" "two machines" $palp play d.palp --scene probe.scene --target x86-64 --ns-per-operation 1
done_testing
