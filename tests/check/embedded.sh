# SPDX-License-Identifier: MIT
# Scenes in flash: every kind of body, several devices and tools, as images for a Cortex-M7 that palp embed's source makes.
# Each is in time, feels its bodies, and gives the bits that the same source gives on this machine.
. "$(dirname "$0")/../cli/lib.sh"
cd "$here" || exit 1
flags="-std=c11 -O2 -ffp-contract=off -fno-math-errno -fno-trapping-math -I. -DTICKS=400u"
bake() { "$palp" bake "$work/$1.model" -o "$work/$1.palp" > /dev/null 2>&1; }
printf 'mesh %s/blobs/bean.obj\nloop 2\nyoung 3e4\npoisson 0.45\nfix-below z 0.0339\n' "$here" > "$work/bean.model" && bake bean
small_chain "$work/chain.palp"
printf 'mesh bar.obj\nyoung 1e4\npoisson 0.4\nfix-below x 1e-6\ntets 120 400\n' > "$work/bar.model" && bake bar
sed 's/ 400//' "$work/bar.model" > "$work/coarse.model" && bake coarse
"$palp" tool "$here/blobs/ball.obj" -o "$work/ball.tool" --units mm --cells 12 > /dev/null 2>&1
[ -s "$work/bean.palp" ] && [ -s "$work/chain.palp" ] && [ -s "$work/bar.palp" ] && [ -s "$work/coarse.palp" ] && [ -s "$work/ball.tool" ]
ok $? "bodies of every kind, and a tool"

scene() { # scene NAME RATE LINES: its text, with paths from the work folder
    printf 'seconds 5\nrate %s\n' "$2" > "$work/$1.scene"
    cat >> "$work/$1.scene"
}
image() { # image MHZ NAME TEXT
    mhz=$1 name=$2
    "$palp" embed "$work/$name.scene" -o "$work/$name.c" > "$work/$name.out" 2>&1
    ok $? "$3: $(sed 's|.*/||' "$work/$name.out")"
    gcc $flags -DQEMU_TICK_PS=40000u -DCLOCK_STANDS -DCORE_MHZ="${mhz}u" -include tests/check/host_semihost.h "$work/$name.c" port/embedded/*.c \
        tests/check/host_board.c "$BUILD/libpalp.a" -o "$work/$name.host" && "$work/$name.host" > "$work/$name.here"
    ok $? "builds and runs on this machine"
    grep -q 'ticks in RUN 39[0-9]' "$work/$name.here" && ! grep -q 'largest force [0-9] mN' "$work/$name.here"
    ok $? "feels its bodies: $(grep -o 'body .*' "$work/$name.here" | tr '\n' ' ')"
    run "$name" -DCLOCK_STANDS && [ "$(grep '^hash' "$work/$name.m7")" = "$(grep '^hash' "$work/$name.here")" ]
    ok $? "the same bits on a Cortex-M7: $(grep '^hash' "$work/$name.here")"
    run "$name" && grep -q '^late 0$' "$work/$name.m7" && grep -q 'ticks in RUN 39[0-9]' "$work/$name.m7"
    ok $? "in time at $mhz MHz: $(grep 'instructions a tick' "$work/$name.m7"), $(grep 'flash:' "$work/$name.m7")"
}
run() { # run NAME FLAGS...
    name=$1
    shift
    sh port/cortexm/build.sh "$work/$name.c" "$work/$name.elf" m7 -DTICKS=400u -DCORE_MHZ="${mhz}u" "$@" > "$work/$name.m7" 2>&1 &&
        timeout 300 qemu-system-arm -M mps2-an500 -nographic -monitor none -serial none -semihosting-config enable=on,target=native \
            -icount shift=6 -kernel "$work/$name.elf" < /dev/null >> "$work/$name.m7" 2>&1
}
if ! command -v arm-none-eabi-gcc > /dev/null || ! command -v qemu-system-arm > /dev/null; then
    count=$((count + 1))
    echo "ok $count - images # SKIP arm-none-eabi-gcc or qemu-system-arm is not installed (make deps)"
    done_testing
fi
scene elastic 80 << END
body bean.palp
finest 2
device arm3-palp-fd
tool capsule 0.003 0.006
friction 0.5
device arm3-palp
place 0.03 0 0.05
tool ball 0.004
END
image 750 elastic "two devices, a capsule with friction and a ball on an elastic body"
scene zones 49.5 << END
body chain.palp
finest 2
no-pairs
pose 0 ab 0
pose 4 ab 0.2
pose 10 ab -0.2
follow bc 0 4 0.5
device arm6-palp-fd
place 0.05 0.01 0.02
tool ball.tool
END
image 1000 zones "a mesh on a wrist with motors, on zones whose joints follow a track and an axis"
scene dynamic 50 << END
body bar.palp
device arm7-palp-fd
place 0.06 0.01 0.01
tool ball 0.008
jaw -0.3
tool ball 0.008
jaw 0.3
END
image 900 dynamic "two jaws on a dynamic body"
scene both 50 << END
body bean.palp
finest 1
body coarse.palp
at 0.3 0 0
device arm3-palp-fd
tool pad 0.004 0.004 0.001
device arm3-palp-fd
place 0.06 0.01 0.01 coarse
tool capsule 0.006 0.006
END
image 1000 both "an elastic and a dynamic body, a pad and a capsule on two devices"
done_testing
