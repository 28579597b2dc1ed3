# SPDX-License-Identifier: MIT
# An image: build.sh BLOB OUT.elf [m7|m55] [FLAGS...]. For QEMU's boards; say -DCORE_MHZ and the like.
set -e
blob=$1 out=$2 core=${3:-m7}
shift 3 2>/dev/null || shift $#
case $core in
m7) arch="-mcpu=cortex-m7 -mfpu=fpv5-sp-d16 -DQEMU_TICK_PS=40000u" script=port/cortexm/an500.ld ;;
m55) arch="-mcpu=cortex-m55 -DQEMU_TICK_PS=31250u" script=port/cortexm/an547.ld ;;
*) echo "build.sh: '$core' is neither m7 nor m55" >&2; exit 2 ;;
esac
arm-none-eabi-gcc -mthumb -mfloat-abi=hard $arch -std=c11 -O3 -ffp-contract=off -fno-math-errno \
    -fno-trapping-math -ffreestanding -fno-tree-loop-distribute-patterns -ffunction-sections \
    -fdata-sections -Wl,--gc-sections -nostdlib -nostartfiles -I. "$@" -DBLOB="\"$blob\"" -T "$script" \
    port/cortexm/*.c port/cortexm/blob.S core/*/*.c -lgcc -o "$out"
arm-none-eabi-size -A "$out" | awk '
    $1 == ".text" {text = $2} $1 == ".blob" {blob = $2} $1 == ".data" {data = $2} $1 == ".bss" {bss = $2}
    END {printf "flash: code and constants %d, blob %d; RAM: data %d, zeroed %d bytes\n", text + data, blob, data, bss}'
