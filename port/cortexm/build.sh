# SPDX-License-Identifier: MIT
# An image: build.sh BLOB|SCENE.c OUT.elf [m7|m55] [FLAGS...], SCENE.c of palp embed. For QEMU's boards; say -DCORE_MHZ and the like.
set -e
input=$1 out=$2 core=${3:-m7}
shift 3 2>/dev/null || shift $#
case $core in
m7) arch="-mcpu=cortex-m7 -mfpu=fpv5-sp-d16 -DQEMU_TICK_PS=40000u" script=port/cortexm/an500 external=port/cortexm/an500_external.ld ;;
m55) arch="-mcpu=cortex-m55 -DQEMU_TICK_PS=31250u" script=port/cortexm/an547 external=port/cortexm/an547.ld ;;
*) echo "build.sh: '$core' is neither m7 nor m55" >&2; exit 2 ;;
esac
board="port/cortexm/memory.c port/cortexm/start.c port/cortexm/systick.c"
case $input in
*.c) what="$board port/embedded/image.c port/embedded/embedded_scene.c $input" script=$external ;;
*) what="$board port/cortexm/image.c port/cortexm/test_trajectory.c port/cortexm/blob.S" script=$script.ld ;;
esac
arm-none-eabi-gcc -mthumb -mfloat-abi=hard $arch -std=c11 -O3 -ffp-contract=off -fno-math-errno \
    -fno-trapping-math -ffreestanding -fno-tree-loop-distribute-patterns -ffunction-sections \
    -fdata-sections -Wl,--gc-sections -nostdlib -nostartfiles -I. "$@" -DBLOB="\"$input\"" -T "$script" \
    $what core/*/*.c -lgcc -o "$out"
arm-none-eabi-size -A "$out" | awk '
    $1 == ".text" {text = $2} $1 == ".blob" {blob = $2} $1 == ".data" {data = $2} $1 == ".bss" {bss = $2}
    END {printf "flash: code and constants %d, blob %d; RAM: data %d, zeroed %d bytes\n", text + data, blob, data, bss}'
