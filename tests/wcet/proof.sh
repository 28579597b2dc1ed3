# SPDX-License-Identifier: MIT
# All of core as `make lib TARGET=..` builds it, with its debug information, linked to one binary: proof.sh TARGET prints its path.
# Calls of memcpy and the like are to stand-ins that ipet.py knows. TARGET: x86-64, x86-64-avx2, cortex-a53 or cortex-m7.
set -e
target=$1
out=${BUILD:-build}/wcet/proof/$target
case $target in
x86-64*) cc=gcc arch="-no-pie" ;;
cortex-a53) cc=aarch64-linux-gnu-gcc arch="-no-pie" ;;
cortex-m7) cc=arm-none-eabi-gcc arch="-mthumb -mcpu=cortex-m7 -mfpu=fpv5-sp-d16 -mfloat-abi=hard" ;;
*) echo "proof.sh: unknown target '$target'" >&2; exit 2 ;;
esac
mkdir -p "$out"
MAKEFLAGS='' make -s -j2 lib TARGET="$target" BUILD="$out" OPTIMISE='-O3 -g' > /dev/null
cat > "$out/copies.c" <<'C'
typedef __SIZE_TYPE__ size;
void *memcpy(void *to, const void *from, size n);
void *memmove(void *to, const void *from, size n);
void *memset(void *to, int value, size n);
int memcmp(const void *a, const void *b, size n);
void *memcpy(void *to, const void *from, size n) { return n > 0u ? to : (void *)from; }
void *memmove(void *to, const void *from, size n) { return n > 1u ? to : (void *)from; }
void *memset(void *to, int value, size n) { return n > (size)value ? to : 0; }
int memcmp(const void *a, const void *b, size n) { return a == b && n > 0u; }
C
$cc $arch -O1 -ffreestanding -c "$out/copies.c" -o "$out/copies.o"
$cc $arch -nostdlib -static -Wl,-e,0 -Wl,--whole-archive "$out/libpalp.a" -Wl,--no-whole-archive "$out/copies.o" -lgcc -o "$out/core.elf"
echo "$out/core.elf"
