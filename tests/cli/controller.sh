# SPDX-License-Identifier: MIT
# The controller's side of the command line: devices, faults, bus load, logs and replay, each also with wrong input.
. "$(dirname "$0")/lib.sh"
small_body body.palp
small_body other.palp 4e4
loop() { $palpd body.palp --bus loop --no-wait --seconds 3 "$@"; }

for device in arm3 desk3 arm3-cia402 arm3-moteus arm3-mit arm3-mit-fd arm3-palp arm3-palp-fd pantograph delta3; do
    loop --device $device --log $device.log >out.txt 2>/dev/null
    status=$?
    said=$($palp replay $device.log body.palp 2>&1) || status=1
    grep -q '^largest force *0.000' out.txt && status=1
    ok $status "$device: feels, and its log repeats: $said"
done

# ---- what a drive does not take ----
trouble() { # trouble FAULT TEXT: palpd ends with 1 and says it
    loop --device arm3-cia402 --lockstep --fault "$1" > /dev/null 2> err.txt; [ $? -eq 1 ] && grep -qF -- "$2" err.txt
    ok $? "CiA 402, $1: $(grep node err.txt)"
}
trouble refuse=0x6502 "node 1 does not let 0x6502:00 (modes that it has) be read: abort code 0x06020000, no such object"
trouble refuse=0x6060 "node 1 refuses 10 (0xa) in 0x6060:00 (mode): abort code 0x06020000"
trouble ignore=0x6060 "node 1: 0x6061:00 (mode that it is in) reads 0 (0x0), 10 is needed"
trouble mute=0x6060 "node 1 does not answer for 0x6060:00 (mode)"
trouble mute=0x6076 "node 1 does not answer for 0x6076:00 (rated torque, mNm)"
trouble loss "node 1 says nothing: is it powered"
trouble drive "node 1 reports error 0x40"
loop --device arm3-cia402 --lockstep --fault refuse=0x60c2 > /dev/null 2> err.txt && ! grep -q node err.txt; ok $? "a drive without an optional object works"

# ---- replay ----
loop --device arm3 --lockstep --log step.log >/dev/null 2>&1; $palp replay step.log body.palp >/dev/null 2>&1; ok $? "a log in lockstep repeats as well"
loop --device arm3 --lockstep --friction 0.5,0.3 --log rub.log >out.txt 2>&1; grep -q '^energy *given to the hand: 0 J' out.txt; ok $? "the summary says in words what the hand was given"
$palp replay rub.log body.palp >/dev/null; ok $? "a log with two coefficients of friction repeats"
refuses 2 "at most the static" "friction that grows when it slides" loop --device arm3 --friction 0.3,0.4
refuses 2 "comma between" "friction that is no number" loop --device arm3 --friction 0.3,
$palp calibrate -o board.cost >/dev/null 2>&1
for i in 1 2 3; do loop --device arm3 --target board.cost --seconds 0.1 2>/dev/null | sed -n 's/.*, \(.* per instruction\)/\1/p'; done | uniq >speeds.txt
[ "$(wc -l <speeds.txt)" -eq 1 ]; ok $? "--target: the same speed each time, $(cat speeds.txt)"
refuses 2 "neither a file nor a target" "--target: no such" loop --device arm3 --target nobody
$palp replay arm3.log body.palp -o replay.csv >/dev/null && [ "$(wc -l <replay.csv)" -eq 3001 ]; ok $? "replay writes a line per tick"
$palp report arm3.log -o page.html && grep -q '"series": \[' page.html; ok $? "report draws a log"
loop --device arm3 --no-wait --fault overrun@1.5=3 --log over.log >live.txt 2>/dev/null; $palp report over.log -o over.html
for line in overruns frames guards loop; do
    live=$(sed -n "s/^$line  *//p" live.txt) page=$(sed 's/<[^>]*>/ /g' over.html | sed -n "s/^ *$line  *//p" | sed 's/ *$//')
    [ -n "$live" ] && [ "$live" = "$page" ]; ok $? "the report of a log says of $line what the run said: $page"
done
grep -v ' palp 1FFF0005' over.log >killed.log; $palp report killed.log -o killed.html
[ "$(sed 's/<[^>]*>/ /g' killed.html | grep -cE '^ *(overruns|frames|guards|loop) .*not in the log')" -eq 4 ]
ok $? "and of one whose run did not end, that it is not in the log"
# the session's description, changed: 64 bytes to a frame
describe() { python3 - "$1" "$2" "$3" <<'EOF'
import re, sys
log, old, new = sys.argv[1:]
lines = open(log).read().splitlines()
text = [l for l in lines if ' palp 1FFF0000##1' in l]
rest = [l for l in lines if l not in set(text)]
whole = b''.join(bytes.fromhex(l.split('##1')[1]) for l in text).rstrip(b'\0').decode()
assert old in whole
whole = whole.replace(old, new, 1).encode()
print('\n'.join('(0000000000.000000) palp 1FFF0000##1' + whole[i:i + 64].ljust(64, b'\0').hex().upper() for i in range(0, len(whole), 64)))
print('\n'.join(rest))
EOF
}
if command -v python3 >/dev/null; then
    for like in ' like' '	like' 'like	'; do
        describe arm3.log 'kinematics ' "$like /etc/hostname
kinematics " >like.log
        refuses 1 "without 'like'" "a log never opens other files ('$like')" $palp report like.log -o out.html
    done
    describe arm3.log 'bus loop' 'bus <b>&"loop' | sed 's/ loop / <b>\&"loop /' >markup.log
    $palp report markup.log -o markup.html && ! grep -q '<b>' markup.html && grep -q '&#60;b&#62;' markup.html
    ok $? "a name with markup in a log is text in the page"
else
    count=$((count + 1)); echo "ok $count - changed descriptions # SKIP python3 is not installed (make deps)"
fi
refuses 1 "not the blob" "replay: another blob" $palp replay arm3.log other.palp
refuses 2 "No such file" "replay: no such log" $palp replay none.log body.palp
echo hello >bad.log
refuses 1 "bad.log:1" "replay: not a log" $palp replay bad.log body.palp
printf '(0000000000.000000) can0 123#00\n' >foreign.log
refuses 1 "not a log that palpd" "replay: a candump log of somebody else" $palp replay foreign.log body.palp -o out.csv
line=$(grep -n ' loop 029#' arm3.log | sed -n 900p | cut -d: -f1)
sed "${line}s/#..../#3f2e/" arm3.log >bent.log
refuses 1 "tick [0-9]* at" "replay: one encoder value changed" $palp replay bent.log body.palp -o out.csv
line=$(grep -n ' palp 1FFF0003' arm3.log | sed -n 1500p | cut -d: -f1)
sed "${line}s/##1../##1FE/" arm3.log >bent.log
refuses 1 "tick 1499 at 1.499" "replay: one result changed" $palp replay bent.log body.palp -o out.csv
sed -E "${line}s/##1(.{16})04/##1\\106/" arm3.log >bent.log
refuses 1 "tick 1499 at 1.499" "replay: one recorded state changed" $palp replay bent.log body.palp -o out.csv
sed -E "${line}s/##1(.{16})04/##1\\1FA/" arm3.log >bent.log
refuses 1 "state or level out of range" "report: a state that is none" $palp report bent.log -o out.html
sed "${line}d" arm3.log >bent.log
refuses 1 "damaged" "replay: a line gone" $palp replay bent.log body.palp -o out.csv
head -c 900000 arm3.log >short.log
$palp replay short.log body.palp | grep -q 'bit for bit'; ok $? "a log that was cut off repeats as far as it goes"

# ---- faults, states ----
loop --device arm3 --fault loss@1.5+0.1 >out.txt 2>err.txt
[ $? -eq 1 ] && grep -q 'FAULT: lost-encoder' err.txt; ok $? "a fault latches and is the exit code: $(grep 'run ended' err.txt)"
loop --device arm3 --fault overrun@1.5=8 >out.txt 2>err.txt
[ $? -eq 1 ] && grep -q 'DAMPING' err.txt; ok $? "an overrun of 8 ms ends in DAMPING"
loop --device arm3 --fault overrun@1.5=8 --resume >out.txt 2>err.txt; ok $? "and with --resume in RUN again"
loop --device arm3 --fault loss=0.01,duplicate=0.01 --seed 3 >a.txt 2>&1; loop --device arm3 --fault loss=0.01,duplicate=0.01 --seed 3 >b.txt 2>&1
grep '^frames' a.txt | cut -d';' -f1 >a; grep '^frames' b.txt | cut -d';' -f1 >b; cmp -s a b; ok $? "a seed repeats its faults: $(tr -s ' ' <a)"
refuses 2 "'melt' in" "unknown fault" loop --device arm3 --fault melt@1
refuses 2 "not KIND" "fault without a time" loop --device arm3 --fault loss@now
refuses 2 "give it to palp-sim" "fault on another bus" $palpd body.palp --bus vcan9 --device arm3 --fault loss
refuses 2 "happen in the controller" "overrun of a device" $palp_sim --bus vcan9 --device arm3 --fault overrun@1
refuses 2 "needs an end" "lock step without end" $palpd body.palp --bus loop --device arm3 --lockstep --seconds 0

# ---- devices ----
refuses 1 "111 % of the bus" "a rate that the bus cannot carry" loop --device arm3 --rate 1600
$palp info --device arm3-cia402 2>err.txt | grep -q '79 % of the bus' && grep -q 'more than 70' err.txt; ok $? "info --device: $(grep -o 'needs.*' err.txt)"
$palp info --device delta3 --json 2>/dev/null | python3 -c 'import json,sys; d=json.load(sys.stdin); assert 0.7<d["bus_load"]<0.8' 2>/dev/null; ok $? "as JSON"
refuses 2 "no device" "info: unknown device" $palp info --device nobody
dev() { printf 'like arm3\n%s\n' "$1" >out.dev; }
try() { dev "$2"; cp out.dev bad.dev; refuses 2 "$1" "device: $3" loop --device bad.dev; }
try "is not one of: odrive, cia402" "protocol canbus" "unknown protocol"
try "moteus speaks CAN FD" "protocol moteus" "moteus without FD"
try "speak classic CAN" "fd 1
data-bitrate 5000000" "ODrive over FD"
try "rated-torque' is missing" "protocol cia402" "CiA 402 without rated torque"
try "mit-range' is missing" "protocol mit" "MIT without ranges"
try "node ids must differ" "node 1 1 2" "two drives with one id"
try "needs 3 values" "gear 10 10" "a gear ratio missing"
try "do not meet" "kinematics delta
base 0.1" "links that do not meet"
try "joint-zero of axis 2 is 400" "joint-zero 0 400 0" "a zero beyond a turn"
dev "joint-zero -70 40 15"; cp out.dev turned.dev
loop --device arm3 --lockstep --log plain.log >/dev/null 2>&1; loop --device turned.dev --lockstep --log turned.log >out.txt 2>&1
$palp replay plain.log body.palp -o plain.csv >/dev/null; $palp replay turned.log body.palp -o turned.csv >/dev/null
paste -d, plain.csv turned.csv | awk -F, 'NR>1 {d=$11-$24; d=d<0?-d:d; if (d>m) m=d; if ($11>f) f=$11} END {exit !(f>0.1 && m<0.02*f)}'
ok $? "drives that read 0 elsewhere (joint-zero): the same force"
try "name one of them" "homing pose
joint-zero 1 2 3" "a zero beside homing"
try "outside joint-min" "homing pose
joint-home 0 0 400" "a home pose out of the joints' limits"
dev "homing pose"; cp out.dev homes.dev
printf '0 0 0 0\n1 0 0 0\n2 0 0 0.01\n3 0 0 -0.006\n5 0 0 -0.006\n' >from-home
loop --device homes.dev --hand from-home --lockstep --seconds 4 --home >out.txt 2>&1; ok $? "drives without a zero, homed at the start: $(grep -m1 '^state' out.txt | tr -s ' ')"
grep '^largest force' out.txt | awk '{exit !($3 > 0.1)}'; ok $? "and felt: $(grep '^largest force' out.txt | tr -s ' ')"
loop --device homes.dev --hand from-home --lockstep --seconds 1 >out.txt 2>err.txt; code=$?
[ $code -eq 1 ] && grep -q 'HOMING: hold the mechanism at its home pose' err.txt; ok $? "without --home it waits, and says for what: exit $code, $(head -1 err.txt)"
try "joint-min of axis 1" "joint-min -80 120 -60" "crossed limits"
printf 'force-max 3\nlike arm3\n' >bad.dev
refuses 2 "must be the first key" "device: like after another key" loop --device bad.dev
printf 'like arm3-mit\nmaster-id 2\n' >bad.dev
refuses 2 "from master-id" "device: answers under a motor's own id" loop --device bad.dev
printf 'like bad.dev\n' >bad.dev
refuses 2 "in a circle" "device: like itself" loop --device bad.dev
if ! pkg-config --exists CycloneDDS 2>/dev/null; then refuses 2 "built without DDS" "--dds without DDS" loop --device arm3 --dds; fi
done_testing
