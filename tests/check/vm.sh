# SPDX-License-Identifier: MIT
# palp-sim and palpd as two processes over real SocketCAN, in PREEMPT_RT kernels on emulated x86-64 and AArch64.
#   lock step  every protocol over vcan, classic and FD; over two kvaser controllers on one bus; over a serial-line
#              adapter: TICKS each, with the very same result as the bus in memory on this host
#              (TICKS=1500 of them here; make soak takes 10,000)
#   paced      in virtual time by instruction count: real clock, logs that replay on this host, the device gone,
#              error-passive, bus-off and restart. It shows function and frame handling, not latency.
. "$(dirname "$0")/../cli/lib.sh"
. "$here/tests/vm/lib.sh"
TICKS=${TICKS:-1500}
skip() { echo "ok 1 - palpd and palp-sim over SocketCAN in virtual machines # SKIP $1"; echo 1..1; exit 0; }
[ "$(uname -m)" = x86_64 ] || skip "needs an x86-64 host"
for tool in qemu-system-x86_64 qemu-system-aarch64 aarch64-linux-gnu-gcc cpio apt-get dpkg; do
    command -v $tool >/dev/null || skip "$tool is not installed (make deps)"
done
for arch in amd64 arm64; do vm_fetch $arch || skip "Debian's kernel for $arch cannot be downloaded: $(tail -1 "$vm/$arch/log")"; done
(cd "$here" && make static BUILD="$BUILD" >/dev/null && make CROSS=aarch64-linux-gnu- BUILD=build/aarch64-linux-gnu static >/dev/null) ||
    { ok 1 "static programs for x86-64 and AArch64"; done_testing; }

mkdir files
small_body files/body.palp
all="arm3 arm3-cia402 arm3-moteus arm3-mit arm3-mit-fd arm3-palp arm3-palp-fd"
classic="arm3 arm3-cia402 arm3-mit arm3-palp"
seconds=$(awk "BEGIN{print $TICKS/1000}")

lockstep() { # lockstep LABEL CONTROLLER-IF DEVICE-IF DEVICES: lines for a guest's script
    cat <<EOF
for d in $4; do
palp-sim --bus $3 --device \$d --lockstep --seconds $seconds >/tmp/sim & W=\$!
palpd /body.palp --bus $2 --device \$d --lockstep --seconds $seconds >/tmp/out 2>/tmp/err || cat /tmp/err
wait \$W; echo "$1 \$d: \$(grep '^lock step' /tmp/out); \$(cat /tmp/sim)"
done
EOF
}
# two users, each with a device on a bus of its own, on one body in one process
printf '0 0 0 0.02\n0.3 0 0 -0.004\n3 0.004 0 -0.006\n' > files/press.hand
printf 'rate 1000\nseconds %s\nbody body.palp\ndevice arm3\nbus vcan0\nhand press.hand\nplace 0 0 0.09\ntool ball 0.008\ndevice arm3\nbus vcan1\nhand press.hand\nplace 0.012 0 0.09\ntool ball 0.008\n' "$seconds" > files/two.scene
users='palp-sim /two.scene --lockstep >/tmp/sim & W=$!
palpd /two.scene --lockstep >/tmp/out 2>/tmp/err || cat /tmp/err
wait $W; echo "users: $(grep "^lock step" /tmp/out); $(cat /tmp/sim); $(grep "^largest" /tmp/out | tr -s " " | tr "\n" ";")"'
{
    lockstep vcan vcan0 vcan0 "$all"
    echo "$users"
    cat <<'EOF'
for i in 0 1; do canlink can$i config 1000000 100; ip link set can$i up; done
EOF
    lockstep kvaser can0 can1 "$classic"
    cat <<'EOF'
slcan vcan0 >/tmp/name & sleep 0.5; S=$(cat /tmp/name); ip link set $S up
EOF
    lockstep slcan '$S' vcan0 "arm3"
} >script-amd64
{ lockstep vcan vcan0 vcan0 "$all"; echo "$users"; } >script-arm64
paced='
A="--bus vcan0 --device arm3 --rate 250"
palp-sim $A --seconds 13 >/tmp/sim & palpd /body.palp $A --priority 80 --seconds 12 --log /tmp/log; echo "EXIT-A $?"; wait; cat /tmp/sim
echo LOG-BEGIN; head -n 12000 /tmp/log; echo LOG-END
'
cat >script-paced-amd64 <<EOF
$paced
if [ -x /bin/candump ]; then
    candump -L -n 3000 vcan0 >/tmp/dump & sleep 0.3; head -n 12000 /tmp/log >/tmp/part; canplayer -t -g 1 -I /tmp/part vcan0=vcan0; sleep 1
    grep ' vcan0 ' /tmp/part | head -n 3000 | cut -d' ' -f3 >/tmp/sent; cut -d' ' -f3 /tmp/dump >/tmp/heard; wc -l </tmp/heard
    cmp /tmp/sent /tmp/heard && echo "CANPLAYER \$(wc -l </tmp/heard) frames"
fi
if [ -x /bin/strace ]; then
    palp-sim \$A --seconds 4 >/tmp/sim & strace -f -o /tmp/trace palpd /body.palp \$A --priority 45 --seconds 3 >/dev/null 2>&1; wait
    T=\$(grep -m1 'clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME' /tmp/trace | cut -d' ' -f1)
    echo "CALLS \$(grep "^\$T " /tmp/trace | grep -v resumed | awk '/clock_nanosleep/{n++} n>20{sub(/\\(.*/,"",\$2); c[\$2]++} END{for(k in c) printf "%s %d; ", k, c[k]}')"
fi
palp-sim \$A --seconds 4 >/tmp/sim & palpd /body.palp \$A --priority 80 --seconds 6; echo "EXIT-B \$?"; wait
palpd /body.palp \$A --seconds 1; echo "EXIT-C \$?"
palp-sim \$A --seconds 6 --fault busoff@2+0.1 >/tmp/sim & palpd /body.palp \$A --priority 45 --seconds 5; echo "EXIT-D \$?"; wait
palp-sim \$A --seconds 6 --fault down@2+0.3 >/tmp/sim & palpd /body.palp \$A --priority 45 --seconds 5; echo "EXIT-E \$?"; wait
slcan vcan0 >/tmp/name & sleep 0.2; P=\$!; S=\$(cat /tmp/name); ip link set \$S up
palp-sim --bus vcan0 --device arm3 --rate 250 --seconds 10 >/tmp/sim & palpd /body.palp --bus \$S --device arm3 --rate 250 --seconds 8 --priority 45 & D=\$!
sleep 2; kill -USR1 \$P; sleep 1; kill -USR2 \$P; sleep 1; kill -HUP \$P; sleep 0.3; kill -USR1 \$D; wait \$D; echo "EXIT-F \$?"
EOF
printf '%s\n' "$paced" >script-paced-arm64
for arch in amd64 arm64; do
    vm_initrd $arch script-$arch initrd-$arch && vm_initrd $arch script-paced-$arch initrd-paced-$arch || ok 1 "ramdisk for $arch"
done
(vm_boot arm64 initrd-arm64 900 >vm-arm64.txt 2>&1; vm_boot arm64 initrd-paced-arm64 600 -icount shift=0,sleep=off >vm-paced-arm64.txt 2>&1) &
vm_boot amd64 initrd-amd64 1200 -object can-bus,id=b0 -device kvaser_pci,canbus=b0 -device kvaser_pci,canbus=b0 >vm-amd64.txt 2>&1
vm_boot amd64 initrd-paced-amd64 600 -icount shift=0,sleep=off >vm-paced-amd64.txt 2>&1
wait
for f in vm-*.txt; do [ -n "$VERBOSE" ] && grep -v '^(' "$f" | sed "s/^/# $f: /"; done

# ---- lock step ----
for arch in amd64 arm64; do grep -q 'KERNEL.*PREEMPT_RT' vm-$arch.txt; ok $? "$(grep KERNEL vm-$arch.txt | cut -c1-60)"; done
for device in $all; do
    here_digest=$($palpd files/body.palp --bus loop --device $device --lockstep --seconds "$seconds" 2>/dev/null | sed -n 's/.*digest //p')
    for arch in amd64 arm64; do
        for label in vcan kvaser slcan; do
            line=$(grep "^$label $device:" vm-$arch.txt) || { # what this machine should have run
                case "$arch $label $device" in *"vcan "* | "amd64 slcan arm3" ) ok 1 "$arch $label $device did not run" ;;
                    "amd64 kvaser "*) case " $classic " in *" $device "*) ok 1 "$arch $label $device did not run" ;; esac ;; esac
                continue
            }
            echo "$line" | grep -q "$TICKS ticks, 0 frames lost or out of turn, digest $here_digest; palp-sim: [0-9]* frames sent, 0 lost"
            ok $? "$arch $line"
        done
    done
done

users_digest=$($palpd files/two.scene --bus loop --lockstep 2>/dev/null | sed -n 's/.*digest //p')
for arch in amd64 arm64; do
    line=$(grep '^users:' vm-$arch.txt)
    echo "$line" | grep -q "$TICKS ticks, 0 frames lost or out of turn, digest $users_digest; palp-sim: [0-9]* frames sent, 0 lost.*largest force [0-9.]*[1-9].*largest force [0-9.]*[1-9]"
    ok $? "$arch: two users over two buses: $line"
done

# ---- paced ----
for arch in amd64 arm64; do
    out=vm-paced-$arch.txt
    first=$(sed '/EXIT-A/q' $out | grep -v '^(')
    grep -q 'EXIT-A 0' $out; ok $? "$arch: 12 s over vcan, by the clock, end in RUN without fault"
    # two clocks run free: where their ticks coincide, one brings no frame of an axis and the next two
    echo "$first" | grep -qE ' 0 rejected, ([0-9]{1,2}) repeated, \1 late, 0 implausible; [0-9]+ sent, 0 lost; 0 dropped'
    ok $? "$arch: $(echo "$first" | grep '^frames' | tr -s ' ')"
    echo "$first" | grep -qE 'largest force +[0-9.]*[1-9]'; ok $? "$arch: the body is felt: $(echo "$first" | grep '^largest' | tr -s ' ')"
    echo "$first" | grep -q '^loop  *0 minor page faults after the start, 0 ticks not on record'; ok $? "$arch: $(echo "$first" | grep '^loop' | tr -s ' ')"
    sed -n '/LOG-BEGIN/,/LOG-END/p' $out | grep '^(' >$arch.log
    said=$($palp replay $arch.log files/body.palp 2>&1)
    ok $? "$arch: $said"
done
out=vm-paced-amd64.txt
sed '/EXIT-A/q' $out | grep -q 'not real-time: the loop may be moved from one processor to another: --cpu N'
ok $? "what real time lacks is said at the start: $(sed '/EXIT-A/q' $out | grep -c 'not real-time') sentences"
sed -n '/EXIT-B/,/EXIT-C/p' $out | grep -q 'without --priority N .* nothing about its timing is guaranteed'
ok $? "and without --priority, that nothing is guaranteed"
if command -v candump >/dev/null; then
    grep -q 'CANPLAYER 3000 frames' $out; ok $? "canplayer sends our log again and candump writes the same frames in the same order"
else
    count=$((count + 1)); echo "ok $count - candump and canplayer # SKIP can-utils is not installed (make deps)"
fi
if command -v strace >/dev/null; then
    calls=$(sed -n 's/^CALLS //p' $out)
    echo "$calls" | grep -q 'recvmmsg [1-9]' && [ -z "$(echo "$calls" | tr ';' '\n' | awk 'NF{print $1}' | grep -vE '^(clock_nanosleep|recvmmsg|write|exit|madvise|munmap|rt_sigprocmask|getrusage|\+\+\+)$')" ]
    ok $? "over SocketCAN the loop only sleeps, receives and sends (its end included): $calls"
fi
grep -q 'EXIT-B 1' $out && sed -n '/EXIT-A/,/EXIT-B/p' $out | grep -q 'FAULT: lost-encoder'; ok $? "a device that falls silent latches a fault, exit 1"
grep -q 'EXIT-C 1' $out && grep -q 'waiting for heartbeats' $out; ok $? "without a device palpd says what it waits for, exit 1"
grep -q 'EXIT-D 1' $out && sed -n '/EXIT-C/,/EXIT-D/p' $out | grep -q 'FAULT: bus'; ok $? "an error frame of bus-off latches a fault"
grep -q 'EXIT-E 1' $out && sed -n '/EXIT-D/,/EXIT-E/p' $out | grep -q 'FAULT: bus'; ok $? "an interface that goes down latches a fault"
last=$(sed -n '/EXIT-E/,/EXIT-F/p' $out)
echo "$last" | grep -q 'EXIT-F 0' && echo "$last" | grep -q 'FAULT: bus' && echo "$last" | grep -q '^guards.*bus: 1 faults, 1 warnings.* 1 resets'
ok $? "slcan: error-passive is counted, bus-off latches, after restart and reset it feels again: $(echo "$last" | grep '^guards' | tr -s ' ' | sed 's/.*bus:/bus:/')"
done_testing
