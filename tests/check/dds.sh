# SPDX-License-Identifier: MIT
# Telemetry: a plain Cyclone DDS reader gets the ROS 2 messages with the values of the log, at 100 Hz of a 1 kHz loop; stopping,
# starving or killing it changes no bit and no instruction of the tick.
. "$(dirname "$0")/../cli/lib.sh"
skip() { echo "ok 1 - telemetry over DDS # SKIP $1"; echo 1..1; exit 0; }
command -v idlc >/dev/null && pkg-config --exists CycloneDDS || skip "cyclonedds-dev and cyclonedds-tools are not installed (make deps)"
gcc -O1 -w -I"$here/$BUILD/dds" $(pkg-config --cflags CycloneDDS) "$here/tests/dds/subscriber.c" "$here/$BUILD/dds/telemetry_idl.o" \
    $(pkg-config --libs CycloneDDS) -o subscriber
ok $? "a subscriber of its own"
cat >lo.xml <<'EOF'
<CycloneDDS><Domain Id="any"><General><Interfaces><NetworkInterface name="lo" multicast="false"/></Interfaces><AllowMulticast>false</AllowMulticast></General>
<Discovery><ParticipantIndex>auto</ParticipantIndex><Peers><Peer Address="127.0.0.1"/></Peers></Discovery></Domain></CycloneDDS>
EOF
export CYCLONEDDS_URI=file://$work/lo.xml
small_body body.palp

./subscriber 7 >got.csv &
sleep 1
$palpd body.palp --bus loop --device arm3 --seconds 5 --dds --log run.log >run.txt 2>&1
ok $? "5 s at 1 kHz with telemetry: $(grep '^dds' run.txt | tr -s ' ')"
wait
$palp replay run.log body.palp -o run.csv >/dev/null
wrenches=$(grep -c '^wrench,' got.csv) joints=$(grep -c '^joints,' got.csv) poses=$(grep -c '^pose,' got.csv)
[ "$wrenches" -ge 400 ] && [ "$wrenches" -le 505 ] && [ "$joints" -ge 400 ] && [ "$poses" -ge 400 ]
ok $? "100 Hz: $wrenches wrenches, $joints joint states, $poses poses in 5 s"
awk -F, 'NR==FNR{f[$9","$10","$11]=1; p[$6","$7","$8]=1; next} $1=="wrench"{n++; if(!(($4","$5","$6) in f)) bad++; if($6!=0) touch++} $1=="pose"{m++; if(!(($4","$5","$6) in p)) bad++}
    END{print n, m, bad+0, touch; exit !(n>0 && m>0 && bad==0 && touch>50)}' run.csv got.csv >values
ok $? "forces and tips are those of the log, to the digit (wrenches, poses, wrong, touching: $(cat values))"
awk -F, '$1=="joints"{if($4!=3||$5!="joint1"||$9!="joint2"||$13!="joint3"||$3!="palp_device") bad++; if($14*$14>1e-6) moved++; if($16*$16>1e-6) pushed++} END{exit !(bad==0&&moved>50&&pushed>50)}' got.csv
ok $? "joint states have names, angles, velocities and torques of three joints"
awk -F, '$1=="wrench"{if(last&&$2<=last) bad++; last=$2} END{exit bad>0}' got.csv; ok $? "time stamps grow"
grep -q '^fault,RUN' got.csv; ok $? "the state is published reliably: $(grep '^fault' got.csv | cut -d, -f2 | tr '\n' ' ')"

./subscriber 20 >/dev/null & reader=$!
($palpd body.palp --bus loop --device arm3 --seconds 6 --dds --log hard.log >hard.txt 2>&1; echo $? >hard.status) &
sleep 2; kill -STOP $reader; sleep 2; kill -CONT $reader; sleep 0.3; kill -KILL $reader
wait
[ "$(cat hard.status)" -eq 0 ] && grep -q ' 0 ticks not on record' hard.txt; ok $? "a reader that is stopped, starved and killed disturbs neither loop nor log"
said=$($palp replay hard.log body.palp 2>&1); ok $? "same bits: $said"
digest() { $palpd body.palp --bus loop --device arm3 --lockstep --seconds 2 "$@" | sed -n 's/.*digest //p'; }
[ "$(digest)" = "$(digest --dds)" ]; ok $? "the same digest with telemetry and without"
if command -v valgrind >/dev/null; then
    count() { valgrind --tool=callgrind --callgrind-out-file=/dev/null --toggle-collect=palp_servo_tick $palpd body.palp --bus loop --device arm3 \
        --lockstep --seconds 1 "$@" 2>&1 | sed -n 's/.*Collected : //p'; }
    without=$(count)
    ./subscriber 60 >/dev/null & reader=$!
    (sleep 6; kill -STOP $reader; sleep 4; kill -KILL $reader) 2>/dev/null &
    with=$(count --dds)
    [ -n "$without" ] && [ "$without" = "$with" ]; ok $? "the same instructions in 1,000 ticks: $without without, $with with"
    kill -KILL $reader 2>/dev/null; wait
else
    count=$((count + 1)); echo "ok $count - instruction count # SKIP valgrind is not installed (make deps)"
fi
done_testing
