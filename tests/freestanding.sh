# SPDX-License-Identifier: MIT
# core stands alone: what it includes, what it links to, what instructions it holds, where it compiles.
. "$(dirname "$0")/cli/lib.sh"
cd "$here" || exit 1
bad=$(grep -nE '^ *# *include *<' core/*.h core/*/*.[ch] | grep -vE '<(stdint|stddef|stdbool|float|limits)\.h>')
[ -z "$bad" ]; ok $? "only freestanding headers are included $bad"
bad=$(grep -nwE 'double|malloc|calloc|realloc|free|printf|goto' core/*.h core/*/*.[ch] | grep -vE '^[^:]*:[0-9]+: *(\*|/\*)' | grep -v '\*.*\bfree\b')
[ -z "$bad" ]; ok $? "no double, no allocation, no printing $bad"
bad=$(grep -nE '#include "' core/*.h core/*/*.[ch] | grep -vE '"(core/|[a-z0-9_]+\.h)')
[ -z "$bad" ]; ok $? "core includes nothing outside core $bad"
if command -v python3 >/dev/null; then
    floors=$(python3 tests/floors.py tests/floors.txt $(ls core/*.h core/*/*.[ch] port/*/*.[ch] sim/*.[ch] sim/*/*.[ch] tools/*/*.[ch]))
    ok $? "includes run one way: $floors"
    # the table is held to: what stands against it is seen
    mkdir -p "$work/core/base" && echo '#include "core/servo/servo.h"' >"$work/core/base/upward.c"
    (cd "$work" && python3 "$here/tests/floors.py" "$here/tests/floors.txt" core/base/upward.c >/dev/null); [ $? -eq 1 ]
    ok $? "and one that runs upwards is found"
else
    count=$((count + 1)); echo "ok $count - floors # SKIP python3 is not installed (make deps)"
fi
undefined=$(nm -u "$BUILD/libpalp.a" | awk '$1=="U"{print $2}' | sort -u | grep -vE '^(memcpy|memmove|memset|memcmp)$')
defined=$(nm "$BUILD/libpalp.a" | awk '$2 ~ /^[TR]$/{print $3}' | sort -u)
outside=$(echo "$undefined" | while read -r s; do echo "$defined" | grep -qx "$s" || echo "$s"; done)
[ -z "$(echo $outside)" ]; ok $? "the library needs nothing but memcpy, memmove, memset, memcmp $outside"
data=$(nm "$BUILD/libpalp.a" | awk '$2 ~ /^[bBdDcC]$/')
[ -z "$data" ]; ok $? "no mutable static data $data"
if [ "$(uname -m)" = x86_64 ]; then
    doubles=$(objdump -d "$BUILD/libpalp.a" | grep -cE '\b(add|sub|mul|div|sqrt|cvtss2|cvtsi2)sd\b|\b(add|mul|sub|div)pd\b|\bf(ld|st|mul|add)')
    [ "$doubles" -eq 0 ]; ok $? "no double-precision instruction ($doubles)"
fi
for c in core/*/*.c; do
    o=$work/$(echo "$c" | tr / _).o
    gcc -std=c11 -O3 -ffreestanding -fno-math-errno -ffp-contract=off -I. -fstack-usage -fcallgraph-info=su -c "$c" -o "$o" && cat "${o%.o}.su"
done > "$work/stack.txt"
deep=$(awk '$2 > 4096 {print $1, $2}' "$work/stack.txt")
[ -z "$deep" ] && [ -s "$work/stack.txt" ]; ok $? "no call takes more than 4 KiB of stack: $(sort -k2 -n "$work/stack.txt" | tail -1 | awk '{print $1, $2}') $deep"
if command -v python3 >/dev/null; then
    loops=$(python3 tests/loops.py core/*/*.c core/*/*.h)
    ok $? "loops: $loops"
    python3 tests/callgraph.py "$work"/*.ci > "$work/calls"
    ok $? "calls: $(tail -1 "$work/calls")"
else
    count=$((count + 1)); echo "ok $count - loops and calls # SKIP python3 is not installed (make deps)"
fi
flags="-std=c11 -O2 -ffreestanding -fno-math-errno -ffp-contract=off -I. -Wall -Wextra -Werror"
try() { # try NAME COMPILER FLAGS...
    name=$1 compiler=$2
    shift 2
    if ! command -v "$compiler" >/dev/null; then
        count=$((count + 1)); echo "ok $count - $name # SKIP $compiler is not installed (make deps)"
        return
    fi
    errors=""
    for c in core/*/*.c; do "$compiler" $flags "$@" -c "$c" -o "$work/x.o" 2>"$work/errors" || errors="$errors $c: $(head -2 "$work/errors")"; done
    [ -z "$errors" ]; ok $? "$name $errors"
}
try "core compiles for Cortex-M7, single precision" arm-none-eabi-gcc -mthumb -mcpu=cortex-m7 -mfpu=fpv5-sp-d16 -mfloat-abi=hard
if command -v arm-none-eabi-gcc >/dev/null; then
    calls=""
    for c in core/*/*.c; do
        arm-none-eabi-gcc $flags -mthumb -mcpu=cortex-m7 -mfpu=fpv5-sp-d16 -mfloat-abi=hard -c "$c" -o "$work/x.o"
        calls="$calls$(arm-none-eabi-nm -u "$work/x.o" | grep -E '__aeabi_d|sqrt')"
    done
    [ -z "$calls" ]; ok $? "and calls no software double or square root $calls"
fi
try "core compiles for wasm32" clang --target=wasm32 -Wno-unknown-warning-option
try "core compiles for AArch64" aarch64-linux-gnu-gcc
try "core compiles with clang, warnings as errors" clang -Wpedantic -Wconversion -Wshadow -Wdouble-promotion -Wfloat-equal -Wstrict-prototypes -Wmissing-prototypes -Wundef -Wvla
done_testing
