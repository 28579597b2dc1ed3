# SPDX-License-Identifier: MIT
# Many cases of many bodies against their bounds: campaign.sh CASES [TARGET..] goes on, seed by seed, until so many were counted on each
# target, two targets at a time; says at the end, for each target and body, cases, the largest share of a bound, and how many were beyond.
# Exits 1 if any was. Hours: 10,000 cases take some seconds to a minute. `make campaign CASES=..`
cases=$1
shift
[ $# -gt 0 ] || set -- x86-64 cortex-a53 x86-64-avx2 cortex-m7
build=${BUILD:-build}
out=$build/wcet/campaign
mkdir -p "$out"
PALP=$(pwd)/$build/palp BLOBS=$(pwd)/blobs sh tests/wcet/bodies.sh "$out/bodies" > "$out/list" || exit 1
for t in "$@"; do
    sh tests/wcet/cases.sh "$t" || exit 1
    : > "$out/$t"
done
one='t=$0; n=0; seed=1
while [ $n -lt '$cases' ]; do
    while read -r b; do
        [ "$t" = cortex-m7 ] && [ "$(stat -c %s "$b")" -gt 7000000 ] && continue # the board has 16 MB for all
        name=$(basename "$b" .palp)
        case $name in chain) e=4 ;; moving | cube | slab) e=1 ;; *) e=6 ;; esac
        sh tests/wcet/cases.sh "$t" "$b" $seed $e hold > '$out'/$t.one # 1 where a case is beyond
        [ $? -le 1 ] && [ -s '$out'/$t.one ] || { echo "$t: $name, seed $seed: the cases do not run" >&2; exit 255; }
        sed "s/^/$name /" '$out'/$t.one >> '$out'/$t
    done < '$out'/list
    n=$(awk "{n += \$4} END {print n + 0}" '$out'/$t)
    echo "$t: seed $seed, $n cases, $(awk "{n += \$8} END {print n + 0}" '$out'/$t) beyond" >&2
    seed=$((seed + 1))
done'
status=0
printf '%s\n' "$@" | xargs -P 2 -n 1 sh -c "$one" || status=1
for t in "$@"; do
    awk -v t="$t" '{n[$1] += $4; beyond[$1] += $8; all += $4; gone += $8; if ($7 > share[$1]) { share[$1] = $7; op[$1] = $2 " on level " $3 } }
        END { for (b in n) printf "%s %-10s %8d cases, nearest to its bound %.3f (%s), %d beyond\n", t, b, n[b], share[b], op[b], beyond[b] | "sort"
        close("sort"); printf "%s: %d cases, %d beyond\n", t, all, gone; exit gone > 0 }' "$out/$t" || status=1
done
exit $status
