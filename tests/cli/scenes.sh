# SPDX-License-Identifier: MIT
# Scene files: bodies of every kind, several devices and tools in one palpd, their logs, replay, report, bounds; what is
# wrong in them.
. "$(dirname "$0")/lib.sh"
small_body body.palp
bar 2 bar2.obj
printf 'young 1e5\npoisson 0.3\nepsilon 0\nmesh bar2.obj\nas-is\nzone a\nfix-below x 1e-6\nzone b\nfix-above x 0.0599\ncut a b 0.04 0 0 1 0 0\njoint ab revolute a b\norigin 0.04 0.01 0.01\naxis 0 1 0\nlimits -1 1\n' > chain.model
$palp bake chain.model -o chain.palp > /dev/null 2>&1
bar 4 bar.obj
printf 'mesh bar.obj\nyoung 1e4\npoisson 0.4\nfix-below x 1e-6\ndamping 2e-4\ndrag 4\ntets 120 400\n' > jelly.model
$palp bake jelly.model -o jelly.palp > /dev/null 2>&1
ok $? "bodies of three kinds"
bar 1 box.obj
$palp tool box.obj -o box.tool > /dev/null 2>&1

# scene NAME LINE|LINE|...
scene() { echo "$2" | tr '|' '\n' > "$1.scene"; }
hand() { printf "$2" > "$1.hand"; }
fast="--target fast.txt" # an assumed machine, so that bounds do not depend on this one
$palp calibrate -o fast.txt > /dev/null 2>&1
sed -i 's/^ns-per-instruction .*/ns-per-instruction 0.05/;s/^ns-per-byte .*/ns-per-byte 0.02/' fast.txt
run() { # run NAME WHAT OPTIONS...: runs, repeats from the log, draws; forces of each device in $name.csv
    name=$1 what=$2
    shift 2
    $palpd $name.scene --no-wait $fast --log $name.log --report $name.html "$@" > $name.txt 2> $name.err
    ok $? "$what: $(grep -c '^state *RUN' $name.txt) of $(grep -c '^state' $name.txt) devices in RUN $(head -1 $name.err)"
    $palp replay $name.log $name.scene -o $name.csv > $name.said 2>&1
    ok $? "$what: $(head -1 $name.said)"
    $palp report $name.log -o $name-log.html && grep -q '"series": \[' $name-log.html && grep -q '"series": \[' $name.html
    ok $? "$what: reports"
}
# most NAME DEVICE: its largest force, N
most() { awk -F, -v d="$2" 'NR > 1 && (NF < 14 || $14 == d) {f = sqrt($9^2 + $10^2 + $11^2); if (f > m) m = f} END {print m + 0}' "$1.csv"; }
above() { awk -v a="$1" -v b="$2" 'BEGIN {exit !(a > b)}'; }

# ---- the same as from the command line ----
scene one 'rate 1000|seconds 2|body body.palp|device arm3|tool ball'
$palpd body.palp --bus loop --device arm3 --lockstep --seconds 2 > plain.txt 2>/dev/null
$palpd one.scene --lockstep > scene.txt 2>/dev/null
[ "$(sed -n 's/.*digest //p' plain.txt)" = "$(sed -n 's/.*digest //p' scene.txt)" ] && [ -n "$(sed -n 's/.*digest //p' plain.txt)" ]
ok $? "a scene of one body, one device, one ball: the same bits as from the command line"

# ---- two hands feel each other ----
hand press '0 0 0 0.02\n0.5 0 0 0.02\n1 0 0 -0.006\n3 0 0 -0.006\n'
hand late '0 0 0 0.02\n1.6 0 0 0.02\n2.2 0 0 -0.006\n3 0 0 -0.006\n'
scene two 'rate 1000|seconds 3|body body.palp|device arm3|hand press.hand|place 0 0 0.09|tool ball 0.008|device arm3|hand late.hand|place 0.012 0 0.09|tool ball 0.008'
run two "two hands on one body"
awk -F, 'NR > 1 && $14 == 0 {f = sqrt($9^2 + $10^2 + $11^2); if ($1 > 1.4 && $1 < 1.6) {a += f; n++} if ($1 > 2.7) {b += f; m++}} END {a /= n; b /= m; d = b - a; if (d < 0) d = -d; printf "%.3g N alone, %.3g N with the other", a, b; exit !(d > 0.02 * a)}' two.csv > felt.txt
ok $? "one feels the other through the body: $(cat felt.txt)"
awk -F, 'NR > 1 && $14 == 1 && $1 > 1 && $1 < 1.55 && ($9 != 0 || $10 != 0 || $11 != 0) {bad = 1} END {exit bad}' two.csv
ok $? "a hand that touches nothing feels nothing"
grep -q 'loop1' two.log && [ "$(grep -c 1FFF0006 two.log)" -eq 3000 ]
ok $? "both buses are in the log"

# ---- every engine, every tool ----
for engine in body chain jelly; do
    case $engine in body) place='0 0 0.09' ;; *) place='0.05 0.01 0.02' ;; esac
    case $engine in chain) rate=500 ;; *) rate=1000 ;; esac # a busy machine is half as fast
    i=0
    for tool in 'ball 0.006' 'capsule 0.006 0.004' 'cylinder 0.006 0.004' 'pad 0.004 0.004 0.002' 'box.tool'; do
        i=$((i + 1))
        [ "$engine $i" = "jelly 3" ] && lie="|mount 0 0 0 90 0 0" || lie= # the flat end of a cylinder moves no nodes
        scene e$i "rate $rate|seconds 1.5|body $engine.palp|device arm3|hand press.hand|place $place|tool $tool$lie|friction 0.3"
        run e$i "$engine, $tool" > lines.txt
        f=$(most e$i 0)
        ! grep -q '^not ok' lines.txt && above "$f" 0.02
        ok $? "$engine felt with $tool, log repeated, reported: at most $f N $(grep '^not ok' lines.txt | head -1)"
    done
done

# ---- all engines at once, two devices, three tools ----
scene all 'rate 500|seconds 2|body body.palp|body chain.palp|at 0.2 0 0 0 0 30|pose 0.5 ab 0|pose 1.5 ab 0.3|body jelly.palp|at 0.4 0 0|gravity 0 0 -0.1|device arm3|hand press.hand|place 0 0 0.09|tool ball 0.006|tool ball 0.004|mount 0.015 0 0.01|device desk3|hand press.hand|place 0.05 0.01 0.02 jelly|tool ball 0.006'
run all "an elastic body, zones and a dynamic body, two devices, three tools"
above "$(most all 0)" 0.02 && above "$(most all 1)" 0.02
ok $? "both devices feel: $(most all 0) and $(most all 1) N"
[ "$(grep -c '^body ' all.txt)" -eq 3 ] && grep -q 'chain (zones)' all.txt && grep -q 'jelly (dynamic)' all.txt
ok $? "each body has a line of its own"

# ---- joints ----
hand still '0 0 0 0.0005\n2 0 0 0.0005\n'
scene lift 'rate 500|seconds 2|body chain.palp|pose 0.5 ab 0|pose 1.5 ab -0.2|device arm3|hand still.hand|place 0.053 0.01 0.02|tool ball 0.005'
run lift "a joint on a track"
above "$(most lift 0)" 0.02
ok $? "a hand that keeps still feels the body come: $(most lift 0) N"
hand opening '0 0 0 0.02 0 0 0 0\n0.5 0 0 0.02 0 0 0 0\n1 0 0 0.02 0 0 0 30\n2 0 0 0.02 0 0 0 30\n'
scene follow 'rate 500|seconds 2|body chain.palp|follow ab 0 6 1|device arm7-palp-fd|hand opening.hand|place 0.05 0.01 0.02|tool ball 0.005'
run follow "a joint that follows an axis"
hand dwell '0 0 0 0.02\n0.5 0 0 0.02\n1 0 0 -0.004\n60 0 0 -0.004\n'
scene listen 'rate 500|seconds 3|body chain.palp|pose 1 ab 0|pose 2 ab 0.2|pose 2.5 ab 0.2|listen ab 0 0x3a0|device arm3|hand dwell.hand|place 0.05 0.01 0.02|tool ball 0.005'
run listen "a joint that follows frames of another controller"
grep -q '^joint  *ab: 300 set-points in frames 0x3a0 on loop, .* stands at 0.2$' listen.txt
ok $? "$(grep '^joint  *ab' listen.txt)"
sed '/^pose/d;s/0x3a0/0x12345 4 1/' listen.scene > silent.scene
$palpd silent.scene --no-wait $fast > silent.txt 2> silent.err && grep -q 'palpd: joint ab: no set-point came in frames 0x12345' silent.err
ok $? "$(cat silent.err)"
[ "$(grep -c ' loop 3A0#' listen.log)" -eq 300 ] && awk -F, 'NR > 1 {f = sqrt($9^2 + $10^2 + $11^2); if ($1 > 0.9 && $1 < 1) a = f; if ($1 > 2.4 && $1 < 2.5) b = f} END {printf "%.3g N before, %.3g N after it has moved\n", a, b; d = b - a; if (d < 0) d = -d; exit !(d > 0.02)}' listen.csv > felt.txt
ok $? "frames are in the log, and felt: $(cat felt.txt)"

# ---- a gripper holds a body ----
hand close '0 0 0 0 0 0 0 70\n0.4 0 0 0 0 0 0 70\n1 0 0 0 0 0 0 5\n2.5 0 0 0 0 0 0 5\n'
scene jaws 'rate 500|seconds 2.5|body body.palp|device arm7-palp-fd|hand close.hand|place 0 0 0.09|tool ball 0.006|mount 0 0 -0.004|jaw -0.5|friction 0.5|tool ball 0.006|mount 0 0 -0.004|jaw 0.5|friction 0.5'
run jaws "two jaws"

# ---- the operator: another body while it is touched, hold, record ----
cat > ask.py <<'PYTHON'
import socket, sys, time
def line(what):
    f.write(what + "\n"); f.flush(); return f.readline().strip()
for _ in range(200):
    try:
        s = socket.socket(socket.AF_UNIX); s.connect("socket"); break
    except OSError: time.sleep(0.05)
f = s.makefile("rw")
def until(*words): # state, until it has one of the words
    for _ in range(400):
        said = line("state")
        if any(w in said for w in words): return said
        time.sleep(0.02)
    return said
def check(good, what): print(("good " if good else "bad ") + what)
check("load none" in until("device 0 RUN"), "state")
check(line("load none.palp").startswith("error cannot read none.palp"), "no such file")
check(line("dance").startswith("error 'dance': there are state"), "an unknown command")
check(line("load broken.palp") == "ok" and "broken.palp" in until("refused"), "a damaged body is refused with its reason")
check(line("load two.scene") == "ok" and "other devices" in until("other devices"), "a scene with other devices is refused")
time.sleep(1.2)
check("force 0 N" not in line("state"), "it is touched")
for name in ("hard.palp", "body.palp", "hard.palp", "chain.palp", "one.scene", "box.tool"):
    check(line("load " + name) == "ok" and "scene " + name + " load none" in until("scene " + name + " ", "refused"), "another " + name)
check(line("record part.log") == "ok" and "record on" in line("state"), "a record is begun")
time.sleep(0.3)
check(line("record off") == "ok" and "record off" in line("state"), "and ended")
check(line("hold") == "ok" and "DAMPING" in until("DAMPING"), "hold takes the force away")
check(line("reset") == "ok" and "RUN" in until("device 0 RUN"), "a reset gives it back")
check(line("end") == "ok", "end")
PYTHON
small_body hard.palp 6e4
head -c 3000 body.palp > broken.palp
$palpd body.palp --bus loop --device arm3 --seconds 60 --hand dwell.hand --control socket $fast > live.txt 2> live.err &
daemon=$!
python3 ask.py > asked.txt 2>&1
wait $daemon
status=$?
[ $status -eq 0 ] && [ "$(grep -c '^good' asked.txt)" -eq 17 ] && ! grep -q '^bad' asked.txt && [ ! -e socket ]
ok $? "the control socket: $(grep -c '^good' asked.txt) answers as they should be, exit $status $(grep -v "^good" asked.txt | head -1)"
given=$(sed -n 's/^energy *given to the hand: \([0-9.e+-]*\) J.*/\1/p' live.txt)
above 1e-5 "${given:-1}" # of about 1 mJ stored
ok $? "six exchanges while it is touched give the hand $given J"
$palp report part.log -o part.html && grep -q '"series": \[' part.html
ok $? "a record begun in a run can be drawn"
refuses 2 "cannot listen" "a socket that cannot be" $palpd body.palp --bus loop --device arm3 --control none/socket --seconds 1
$palpd --check all.scene > check.txt && grep -q 'dynamic' check.txt
ok $? "palpd --check says what would be felt"

# ---- in virtual time ----
$palp play all.scene --ns-per-operation 0.1 -o one.out --report play.html > play.txt && $palp play all.scene --ns-per-operation 0.1 -o two.out > /dev/null && cmp -s one.out two.out && grep -q '"series": \[' play.html
ok $? "palp play repeats a scene to the last digit: $(grep '^tick latency' play.txt)"
[ "$(wc -l < one.out)" -eq 2001 ] && awk -F, 'NR > 1 && $2 == 1 && $9 > 0.01 {felt = 1} END {exit !felt}' one.out
ok $? "a line for each tick and device"
rm -f one.out two.out
refuses 2 'a scene says these itself' "options of a blob" $palp play all.scene --scene two.scene

# ---- bounds ----
$palp wcet all.scene --target x86-64 > wcet.txt && grep -q 'the whole scene' wcet.txt && [ "$(grep -c ' always ' wcet.txt)" -eq 3 ]
ok $? "palp wcet of a scene: $(tail -1 wcet.txt)"
sed 's/^ns-per-instruction .*/ns-per-instruction 5/' fast.txt > slow.txt
least=$($palp wcet one.scene --target slow.txt | sed -n 's/^refused: the least answer needs \([0-9.]*\) us.*/\1/p')
$palpd one.scene --target slow.txt --no-wait > /dev/null 2> slow.err
[ -n "$least" ] && grep -q "may take $(printf %.0f "$least") us" slow.err
ok $? "palpd refuses by the same bound: $least us; $(cat slow.err)"

# ---- doubtful scenes ----
doubt() { scene odd "$2"; $palpd --check odd.scene > /dev/null 2> odd.err && grep -q "$1" odd.err; ok $? "$2: $(head -1 odd.err)"; }
doubt 'off the nearest point' 'body body.palp|device arm3|place 20 0 90|tool ball'
doubt 'larger (5 m)' 'body body.palp|device arm3|tool ball 5'
doubt 'at the same place' 'body body.palp|device arm3|tool ball|device arm3|tool ball'

# ---- wrong scenes ----
wrong() { # wrong PATTERN LINES CODE
    scene bad "$2"
    refuses "${3:-2}" "$1" "$2" $palpd bad.scene --lockstep --seconds 1 --log out.log
}
base='body body.palp|device arm3|tool ball'
wrong 'bad.scene:1: .*colour' "colour red|$base"
wrong 'no body' 'device arm3|tool ball'
wrong 'no device' 'body body.palp'
wrong 'holds no tool' 'body body.palp|device arm3'
wrong 'follows the device' 'body body.palp|tool ball'
wrong "no tool 'hammer'" 'body body.palp|device arm3|tool hammer 1'
wrong 'needs a radius and half' 'body body.palp|device arm3|tool capsule 1'
wrong 'must be above 0' 'body body.palp|device arm3|tool ball -0.01'
wrong "no body is called 'cat'" "body body.palp|device arm3|place 0 0 0 cat|tool ball"
wrong "called 'body'" "body body.palp|$base"
wrong 'has no joints' "body body.palp|pose 0 knee 1|device arm3|tool ball"
wrong "no joint named 'knee'" "body chain.palp|pose 0 knee 1|device arm3|tool ball"
wrong 'out of its range' "body chain.palp|pose 0 ab 3|device arm3|tool ball"
wrong 'is on a track' "body chain.palp|pose 0 ab 0|follow ab 0 0 1|device arm3|tool ball"
wrong 'come from node 1' 'body chain.palp|listen ab 0 0x21|device arm3|tool ball'
wrong 'byte 6 needs' 'body chain.palp|listen ab 0 0x3a0 6|device arm3|tool ball'
wrong 'is no id' 'body chain.palp|listen ab 0 0x3fffffff|device arm3|tool ball'
wrong 'already' 'body chain.palp|listen ab 0 0x3a0|follow ab 0 0 1|device arm3|tool ball'
wrong '3 axes' "body chain.palp|follow ab 0 6 1|device arm3|tool ball"
wrong 'has no gripper' "$base|jaw 0.5"
wrong 'was baked into it' "body body.palp|young 1e4|device arm3|tool ball"
wrong 'elastostatic' "body body.palp|gravity 0 0 -9|device arm3|tool ball"
wrong 'cannot read none.palp' 'body none.palp|device arm3|tool ball'
wrong 'said by another key' "body body.palp|device arm3|place 0 0 0|node 3|tool ball"
wrong 'more than 4 tools' "$base|tool ball|tool ball|tool ball|tool ball"
wrong 'all or none' "body body.palp|device arm3|bus loop|tool ball|device arm3|bus vcan0|tool ball"
printf 'body body.palp\ndevice arm3\ntool ball\n' > fine.scene
refuses 2 'a scene says these itself' "a tool besides a scene" $palpd fine.scene --tool box.tool --bus loop
sed 's/body.palp/jelly.palp/' two.scene > other.scene
refuses 1 'is not the blob of this session' "replay with another body" $palp replay two.log other.scene
refuses 1 'is not the scene of this session' "replay with another scene" $palp replay two.log all.scene
refuses 2 'name its scene' "replay of several bodies with a blob" $palp replay all.log body.palp
head -c 200000 two.log > cut.log
$palp replay cut.log two.scene > cut.txt 2>&1 && grep -q 'ends before its run did' cut.txt
ok $? "a log that is cut off is repeated as far as it goes"
refuses 2 'the scene names them' "a bus besides a scene" $palp_sim two.scene --bus vcan0
refuses 2 'has no bus of its own' "a scene without buses" $palp_sim two.scene
echo "1..$count"
exit $failed
