# SPDX-License-Identifier: MIT
# The liver, the paper's cube, the gain of adaptivity, the cost of a tick, a million steps of violence.
. "$(dirname "$0")/../cli/lib.sh"
"$palp" bake "$here/blobs/liver.model" -o liver.palp > bake.txt 2>/dev/null
"$palp" play liver.palp --scene "$here/sim/liver.scene" --ns-per-operation 0.15 --report liver.html -o liver.csv > play.txt
ok $? "the liver is poked, released, and on time: $(sed -n '3p' play.txt | tr -s ' ')"
sed 's/^/# /' play.txt
awk -F, 'NR == 1 {for (i = 1; i <= NF; i++) c[$i] = i} NR > 1 {t = $c["t_s"]; f = $c["probe_fx"]^2 + $c["probe_fy"]^2 + $c["probe_fz"]^2; if (f > m) m = f
    if (t > 2.5 && t < 3.5 && $c["displaced_m"] > d) d = $c["displaced_m"]} END {printf "%.2g N, then swings by up to %.2g m", sqrt(m), d; exit !(m > 0.01 && d > 1e-4)}' liver.csv > felt.txt
ok $? "it pushes back with $(cat felt.txt)"
"$palp" reproduce --dynamic "$here/blobs/liver.model" -o rep > rep.txt 2>/dev/null
ok $? "palp reproduce --dynamic"
sed 's/^/# /' rep.txt
awk -F, '($1 == "Green" || $1 == "engine") && $6 < 0.1 {good++} END {exit good != 2}' rep/oscillations.csv
ok $? "Green's strain: frequencies at 27, 59 and 145 nodes agree within 10 %"
[ "$(ls rep/*.csv | wc -l)" -ge 6 ] && [ "$(grep -c '<svg' rep/index.html)" -ge 5 ]
ok $? "figures 4 to 6 and the speed-up table are written"
"$here/$BUILD/elements" > elements.txt
ok $? "5,000 active tetrahedra at 1 kHz on one core: $(sed -n 3p elements.txt)"
sed 's/^/# /' elements.txt
"$here/$BUILD/tests/poke" ${PALP_POKES:-8000} > long.txt
ok $? "violence, $(sed -n 's/.*(\([0-9.e+]*\) steps).*/\1/p' long.txt | awk '{s += $1} END {printf "%.2g", s}') steps in all"
sed 's/^/# /' long.txt
if command -v valgrind >/dev/null; then
    # a ball of a twentieth of the size against the far side, as deep, and away
    printf 'seconds 1.5\nrate 1000\nprobe 0.0105\ntouch 0 -0.01459 -0.09886 -0.01026\ntouch 0.1 -0.01784 -0.05736 -0.00462\ntouch 0.25 -0.01865 -0.04699 -0.00322\ntouch 0.3 -0.01865 -0.04699 -0.00322\ntouch 0.32 -0.01377 -0.10923 -0.01167\n' > short.scene
    count() { # count NAME OPTIONS...: instructions of all ticks
        name=$1
        shift
        valgrind --tool=callgrind --callgrind-out-file=cg.out --toggle-collect=palp_dynamic_tick "$palp" play liver.palp --scene "$@" > "$name.txt" 2> "$name.err"
        grep -a 'Collected' "$name.err" | tr -dc '0-9 ' | awk '{print $NF}'
    }
    few=$(count adaptive short.scene --ns-per-operation 0.15 -o adaptive.csv)
    sed 's/seconds 1.5/seconds 0.3/' short.scene > fine.scene # each of its ticks costs the same
    many=$(($(count uniform fine.scene --uniform --ns-per-operation 0.001) * 5))
    awk -v a="$few" -v b="$many" 'BEGIN {printf "%.3g against %.3g, %.1f times fewer", a, b, b / a; exit !(b > 5 * a)}' > gain.txt
    ok $? "instructions of all ticks, adaptive against uniformly fine: $(cat gain.txt)"
    awk -F, -v a="$few" 'NR == 1 {for (i = 1; i <= NF; i++) c[$i] = i} NR > 1 {s += $c["tick_us"] / 1.5e-4} END {r = a / s; printf "%.2f", r; exit !(r > 0.5 && r < 2.6)}' adaptive.csv > ratio.txt
    ok $? "instructions per operation that the bounds count: $(cat ratio.txt)"
else
    ok 0 "instruction counts # SKIP no valgrind"
fi
done_testing
