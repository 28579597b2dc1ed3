# SPDX-License-Identifier: MIT
# Counted cases on a target: cases.sh TARGET BLOB SEED EPISODES [hold], to standard output; with hold, held
# against the target's table; with CASES=surface in the environment those of contact on the surface and whole ticks
# alone. Builds what it needs below build/wcet. TARGET: x86-64, x86-64-avx2, cortex-a53 or cortex-m7, as in budget/target.h.
# With TARGET alone it only builds.
set -e
target=$1
out=${BUILD:-build}/wcet/$target
arch="" program="tests/wcet/main.c" host="-D_GNU_SOURCE -static" root=$(pwd)
case $target in
x86-64) cc=gcc run="qemu-x86_64 -plugin" ;;
x86-64-avx2) cc=gcc arch="-mavx2" run="qemu-x86_64 -cpu max -plugin" ;;
cortex-a53) cc=aarch64-linux-gnu-gcc run="qemu-aarch64 -plugin" ;;
cortex-m7) cc=arm-none-eabi-gcc arch="-mthumb -mcpu=cortex-m7 -mfpu=fpv5-sp-d16 -mfloat-abi=hard" host="-DQEMU_TICK_PS=40000u" ;;
*) echo "cases.sh: unknown target '$target'" >&2; exit 2 ;;
esac
mkdir -p "$out"
newer=$(find core tests/wcet port/cortexm/test_trajectory.c tools/wcet/tool_path.c port/cortexm -newer "$out/cases" -name '*.[ch]' 2>/dev/null | head -1)
if [ ! -e "$out/cases" ] || [ -n "$newer" ]; then
    core="-std=c11 -O3 -ffp-contract=off -fno-math-errno -fno-trapping-math -ffreestanding -fno-jump-tables -I. $arch"
    rm -f "$out"/*.o
    for c in core/*/*.c; do echo "$c $out/$(echo "$c" | tr / _).o"; done |
        xargs -P 4 -n 2 sh -c "$cc $core -c \$0 -o \$1"
    rest="tests/wcet/*_cases.c tests/wcet/instructions.c port/cortexm/test_trajectory.c tools/wcet/tool_path.c"
    flags="-std=gnu11 -O2 -fno-math-errno -I. $arch $host"
    if [ "$target" = cortex-m7 ]; then # memory: the board's PSRAM
        $cc $flags -Dmain=hosted_main -DCASES_AT=0x60000000 -c $program -o "$out/main.o"
        $cc $flags -nostartfiles --specs=rdimon.specs -T port/cortexm/an500.ld $rest tests/wcet/bare.c \
            port/cortexm/start.c port/cortexm/systick.c "$out"/*.o -lm -o "$out/cases"
    else
        $cc $flags $program $rest "$out"/*.o -o "$out/cases"
        gcc -O2 -shared -fPIC tests/wcet/counter.c -o "$out/counter.so"
    fi
fi
[ $# -lt 4 ] && exit 0
held=${5:+$target}
[ -n "$CASES" ] && held="${held:--} $CASES"
if [ "$target" = cortex-m7 ]; then
    exec qemu-system-arm -M mps2-an500 -nographic -monitor none -serial none \
        -semihosting-config enable=on,target=native,arg=cases,arg="$2",arg="$3",arg="$4"$(printf ',arg=%s' $held | sed 's/^,arg=$//') \
        -icount shift=6 -kernel "$out/cases" </dev/null
fi
case $out in /*) ;; *) out=$root/$out ;; esac
count=$(mktemp)
trap 'rm -f "$count"' EXIT
PALP_COUNT=$count $run "$out/counter.so,count=$count" "$out/cases" "$2" "$3" "$4" $held
