# SPDX-License-Identifier: MIT
# palp-sim and palpd as two processes over real SocketCAN: a PREEMPT_RT kernel with vcan, emulated. Virtual time by
# instruction count, so a run repeats exactly; it shows function and frame handling, not latency.
. "$(dirname "$0")/../cli/lib.sh"
skip() { echo "ok 1 - two processes over vcan # SKIP $1"; echo 1..1; exit 0; }
[ "$(uname -m)" = x86_64 ] || skip "needs an x86-64 host"
for tool in qemu-system-x86_64 cpio busybox apt-get dpkg; do command -v $tool >/dev/null || skip "$tool is not installed (make deps)"; done
cache=$here/$BUILD/vm
mkdir -p "$cache"
if [ ! -f "$cache/kernel" ]; then
    package=$(apt-cache depends linux-image-rt-amd64 2>/dev/null | awk '/Depends: linux-image/{print $2}')
    [ -n "$package" ] || skip "no linux-image-rt-amd64 in the package lists (apt-get update)"
    (cd "$cache" && apt-get download "$package" >/dev/null 2>&1 && dpkg -x linux-image-*.deb k && rm -f linux-image-*.deb) ||
        skip "$package cannot be downloaded"
    cp "$cache"/k/boot/vmlinuz-* "$cache/kernel"
fi
modules=$(find "$cache/k" -path '*/kernel' -type d | head -1)
mkdir -p root/bin root/mods root/proc root/sys root/dev root/tmp
cp "$(command -v busybox)" root/bin/busybox
for m in net/can/can.ko net/can/can-raw.ko drivers/net/can/dev/can-dev.ko drivers/net/can/vcan.ko; do cp "$modules/$m" root/mods/; done
objects=$(cd "$here" && for f in tools/*.c sim/*.c port/linux/*.c; do case $f in tools/main.c | sim/palp_sim.c | port/linux/palpd.c) ;; *) echo "$here/$BUILD/${f%.c}.o" ;; esac; done)
gcc -static -pthread "$here/$BUILD/port/linux/palpd.o" $objects "$here/$BUILD/devices.o" "$here/$BUILD/libpalp.a" -lm -o root/bin/palpd 2>/dev/null
gcc -static -pthread "$here/$BUILD/sim/palp_sim.o" $objects "$here/$BUILD/devices.o" "$here/$BUILD/libpalp.a" -lm -o root/bin/palp-sim 2>/dev/null
$palp subdivide "$here/blobs/rabbit.obj" -o r.obj --levels 2 >/dev/null
$palp bake r.obj --as-is -o root/rabbit.palp --young 3e4 --poisson 0.45 --fix-below z 0.004 >/dev/null 2>&1
cat >root/init <<'EOF'
#!/bin/busybox sh
/bin/busybox --install -s /bin
export PATH=/bin
mount -t proc none /proc; mount -t sysfs none /sys; mount -t devtmpfs none /dev
for m in can can-raw can-dev vcan; do insmod /mods/$m.ko; done
ip link add dev vcan0 type vcan; ip link set vcan0 up
echo "KERNEL $(uname -v)"
A="--bus vcan0 --device arm3 --rate 250"
palp-sim $A --seconds 7 >/tmp/sim & palpd /rabbit.palp $A --priority 80 --seconds 6; echo "EXIT-A $?"; wait; cat /tmp/sim
palp-sim $A --seconds 4 >/tmp/sim & palpd /rabbit.palp $A --priority 80 --seconds 6; echo "EXIT-B $?"; wait
palpd /rabbit.palp $A --priority 80 --seconds 1; echo "EXIT-C $?"
poweroff -f
EOF
chmod +x root/init
(cd root && find . | cpio -o -H newc --quiet -R 0:0 | gzip -1) >initrd
timeout 240 qemu-system-x86_64 -accel tcg -icount shift=0,sleep=off -cpu qemu64 -smp 1 -m 512 -M q35,hpet=off -nodefaults \
    -no-user-config -display none -serial stdio -no-reboot -kernel "$cache/kernel" -initrd initrd \
    -append "console=ttyS0 quiet panic=-1 tsc=reliable mitigations=off" </dev/null >vm.txt 2>&1
[ -n "$VERBOSE" ] && sed 's/^/# /' vm.txt
grep -q 'KERNEL.*PREEMPT_RT' vm.txt; ok $? "the kernel is PREEMPT_RT"
grep -q 'EXIT-A 0' vm.txt; ok $? "6 s over vcan end in RUN without fault"
first=$(sed '/EXIT-A/q' vm.txt)
echo "$first" | grep -qE ' 0 rejected.* 0 late, 0 implausible; [0-9]+ sent, 0 lost; 0 dropped'; ok $? "no frame lost, late or rejected: $(echo "$first" | grep '^frames' | tr -s ' ')"
echo "$first" | grep -qE 'largest force +[0-9.]*[1-9]'; ok $? "and the body is felt: $(echo "$first" | grep '^largest' | tr -s ' ')"
grep -qE 'palp-sim: [0-9]+ frames sent, 0 lost' vm.txt; ok $? "$(grep 'palp-sim:' vm.txt | head -1)"
grep -q 'EXIT-B 1' vm.txt && grep -qi 'lost-encoder' vm.txt; ok $? "a device that falls silent latches a fault, exit 1"
grep -q 'EXIT-C 1' vm.txt && grep -q 'waiting for heartbeats' vm.txt; ok $? "without a device palpd says what it waits for, exit 1"
done_testing
