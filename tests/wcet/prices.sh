# SPDX-License-Identifier: MIT
# The shipped unit costs, from the machine code: prices.sh ZONES BLOB... > core/budget/targets.c, with a multizone model, whose own
# operations are counted and not derived, and bodies of the other kinds.
set -e
zones=$1
shift
out=${BUILD:-build}/wcet/proof
mkdir -p "$out"
gcc -std=gnu11 -O1 -I. tests/wcet/ipet/formulas.c "${BUILD:-build}/libpalp.a" -lm -o "$out/formulas"
"$out/formulas" 1 60 "$@" > "$out/lines"
cat <<'C'
/* SPDX-License-Identifier: MIT */
/* Made by tests/wcet/prices.sh from the machine code (tests/wcet/README.md). */
#include "target.h"

C
for t in x86-64 x86-64-avx2 cortex-a53 cortex-m7; do
    sh tests/wcet/cases.sh $t "$zones" 11 20 > "$out/$t.cases"
    python3 tests/wcet/ipet/ipet.py prices $t "$(sh tests/wcet/proof.sh $t)" "$out/lines" "$out/$t.cases"
done | clang-format --assume-filename=targets.c
