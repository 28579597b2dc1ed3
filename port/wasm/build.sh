#!/bin/sh
# SPDX-License-Identifier: MIT
# The engine of the web page: sh port/wasm/build.sh OUT.wasm DEVICES.c, with clang, lld and wasi-libc (make deps).
set -e
out=$1
devices=$2
objects=$(dirname "$out")/wasm
mkdir -p "$objects"
export flags="--target=wasm32-wasi -O2 -msimd128 -std=c11 -ffp-contract=off -fno-math-errno -I. -D_GNU_SOURCE -Werror=implicit-function-declaration \
    -D_WASI_EMULATED_SIGNAL -D_WASI_EMULATED_GETPID -D_WASI_EMULATED_PROCESS_CLOCKS -ffunction-sections -fdata-sections"
export objects
sources=$(ls core/*/*.c port/host/*.c port/wasm/*.c sim/*.c sim/web/*.c tools/bake/*.c tools/mesh/*.c tools/press/*.c tools/solver/*.c \
    tools/tool/*.c tools/zone/*.c tools/tet/*.c tools/cli/tool.c tools/cli/bake.c | grep -vE 'parallel.c|palp_sim.c|spectrum.c')
# everything is compiled anew where any header has changed: half a minute
newest=$(ls -t port/wasm/* core/*/*.h core/*.h port/host/*.h sim/*.h sim/web/*.h tools/*/*.h | head -n 1)
all=""
for f in $sources "$devices"; do all="$all $objects/$(echo "$f" | tr / _).o"; done
for f in $sources "$devices"; do
    o=$objects/$(echo "$f" | tr / _).o
    if [ "$o" -nt "$f" ] && [ "$o" -nt "$newest" ]; then continue; fi
    extra=-includeport/wasm/wasi.h
    case $f in core/*) extra=-ffreestanding ;; esac
    echo "$f $o $extra"
done | xargs -r -P 2 -n 3 sh -c 'clang $flags $2 $(case $0 in core/* | tools/solver/*) echo -O3 ;; esac) -c "$0" -o "$1"'
clang --target=wasm32-wasi -mexec-model=reactor -O3 $all -lwasi-emulated-signal -lwasi-emulated-getpid \
    -lwasi-emulated-process-clocks -lm -Wl,--gc-sections,--strip-all,-z,stack-size=1048576 -Wl,--export=malloc -o "$out.part"
mv "$out.part" "$out"
