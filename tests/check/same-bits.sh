# SPDX-License-Identifier: MIT
# The same blob and the same frames give the same bits from every compiler and target that is here, plain and as fast as it can;
# with FULL=1 (make soak) at the level between as well.
. "$(dirname "$0")/../cli/lib.sh"
cd "$here" || exit 1
seconds=${PALP_SECONDS:-2} # ticks at 1 kHz
"$palp" subdivide blobs/rabbit.obj -o "$work/rabbit.obj" --levels 2 > /dev/null
"$palp" bake "$work/rabbit.obj" --as-is -o "$work/r.palp" --young 3e4 --poisson 0.45 --fix-below z 0.004 > /dev/null 2>&1
small_chain "$work/z.palp"
printf 'mesh bar.obj\nyoung 1e4\npoisson 0.4\nfix-below x 1e-6\ntets 120 400 1500\n' > "$work/d.model"
"$palp" bake "$work/d.model" -o "$work/d.palp" > /dev/null 2>&1
printf '0 0 0 0.02\n0.7 0 0 -0.006\n1.2 0.006 0.004 -0.008\n1.6 0 -0.004 0.002\n2.5 0 0 -0.004\n4 0 0 0.02\n' > "$work/hand"
"$palpd" "$work/r.palp" --bus loop --device arm3 --hand "$work/hand" --seconds "$seconds" --lockstep --log "$work/all.log" >/dev/null
grep -E ' loop 0(21|29|41|49|61|69)#' "$work/all.log" > "$work/r.log" # what the drives sent
lines=$(grep -c . "$work/r.log")
[ "$lines" -ge $((3 * ${seconds%.*} * 1000)) ]; ok $? "a log of $lines frames in $seconds s of ticks at 1 kHz"
reference=""
same() { # same NAME HASH
    [ -z "$reference" ] && reference=$2
    [ -n "$2" ] && [ "$2" = "$reference" ]
    ok $? "$1: $2"
}
run() { # run NAME RUNNER COMPILER FLAGS...
    name=$1 runner=$2 compiler=$3
    shift 3
    if ! command -v "$compiler" >/dev/null || { [ -n "$runner" ] && ! command -v "${runner%% *}" >/dev/null; }; then
        count=$((count + 1)); echo "ok $count - $name # SKIP $compiler or ${runner%% *} is not installed (make deps)"
        return
    fi
    "$compiler" -std=c11 -ffp-contract=off -fno-math-errno "$@" -I. tests/check/hash-ticks.c core/*/*.c -o "$work/hash" 2>"$work/errors" ||
        { ok 1 "$name does not build: $(head -1 "$work/errors")"; return; }
    same "$name" "$($runner "$work/hash" "$work/r.palp" "$work/r.log" "$work/z.palp" "$work/d.palp")"
}
bare() { # bare NAME FLAGS...: Cortex-M7 without an operating system, files over semihosting
    name=$1
    shift
    if ! command -v arm-none-eabi-gcc >/dev/null || ! command -v qemu-system-arm >/dev/null; then
        count=$((count + 1)); echo "ok $count - $name # SKIP arm-none-eabi-gcc or qemu-system-arm is not installed (make deps)"
        return
    fi
    arch="-mthumb -mcpu=cortex-m7 -mfpu=fpv5-sp-d16 -mfloat-abi=hard -std=gnu11 -ffp-contract=off -fno-math-errno -I."
    arm-none-eabi-gcc $arch -Dmain=hosted_main -c tests/check/hash-ticks.c -o "$work/hash.o" 2>"$work/errors" &&
        arm-none-eabi-gcc $arch "$@" -ffreestanding -nostartfiles --specs=rdimon.specs -Wl,--wrap=_sbrk -T port/cortexm/an500.ld \
            core/*/*.c tests/wcet/bare.c port/cortexm/start.c "$work/hash.o" -lm -o "$work/hash.elf" 2>>"$work/errors" ||
        { ok 1 "$name does not build: $(head -1 "$work/errors")"; return; }
    same "$name" "$(timeout 1200 qemu-system-arm -M mps2-an500 -nographic -monitor none -serial none -semihosting-config \
        "enable=on,target=native,arg=h,arg=$work/r.palp,arg=$work/r.log,arg=$work/z.palp,arg=$work/d.palp" \
        -kernel "$work/hash.elf" </dev/null)"
}
run "gcc -O0" "" gcc -O0 -static
[ -n "$FULL" ] && run "gcc -O2" "" gcc -O2 -static
run "gcc -O3" "" gcc -O3 -fno-trapping-math -static
run "clang -O0" "" clang -O0 -static
[ -n "$FULL" ] && run "clang -O2" "" clang -O2 -static
run "clang -O3" "" clang -O3 -static
for c in gcc clang; do
    for o in ${FULL:+-O2} -O3; do
        name="$c $o AVX2 with FMA at hand"
        if grep -q avx2 /proc/cpuinfo; then
            run "$name" "" $c $o -mavx2 -mfma -static
        else
            run "$name (QEMU)" "qemu-x86_64 -cpu max" $c $o -mavx2 -mfma -static
        fi
    done
done
[ -n "$FULL" ] && run "AArch64 gcc -O2" qemu-aarch64-static aarch64-linux-gnu-gcc -O2 -static
run "AArch64 gcc -O3" qemu-aarch64-static aarch64-linux-gnu-gcc -O3 -static
run "armhf gcc -O3 with NEON at hand" qemu-arm-static arm-linux-gnueabihf-gcc -O3 -mfpu=neon -static
bare "Cortex-M7 gcc -O3" -O3
[ -n "$FULL" ] && bare "Cortex-M7 gcc -O2" -O2
if [ -d /usr/lib/wasm32-wasi ]; then
    run "wasm32 clang -O3" "node --no-warnings tests/check/wasi.mjs" clang --target=wasm32-wasi -O3 -Wl,-z,stack-size=262144
    run "wasm32 clang -O3 with SIMD" "node --no-warnings tests/check/wasi.mjs" clang --target=wasm32-wasi -O3 -msimd128 -Wl,-z,stack-size=262144
else
    count=$((count + 1)); echo "ok $count - wasm32 # SKIP wasi-libc is not installed (make deps)"
fi
case $reference in *"largest 0."[1-9]*|*"largest 0.0"[1-9]*|*"largest "[1-9]*) ok 0 "there was something to feel" ;; *) ok 1 "there was nothing to feel: $reference" ;; esac
done_testing
