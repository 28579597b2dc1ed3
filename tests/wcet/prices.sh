# SPDX-License-Identifier: MIT
# The shipped unit costs, from the machine code: prices.sh "ZONES.." BLOB... > core/budget/targets.c, with multizone models, whose own
# operations are counted and not derived, and bodies of the other kinds. Some minutes.
set -e
zones=$1
shift
out=${BUILD:-build}/wcet/proof
mkdir -p "$out"
gcc -std=gnu11 -O1 -I. tests/wcet/ipet/formulas.c "${BUILD:-build}/libpalp.a" -lm -o "$out/formulas"
"$out/formulas" 1 "${DRAWS:-30}" "$@" > "$out/lines"
table() { # table TARGET
    on=${1%-cycles}
    [ "$on" != "$1" ] || for z in $zones; do sh tests/wcet/cases.sh "$1" "$z" 11 20; done > "$out/$1.cases"
    python3 tests/wcet/ipet/ipet.py prices "$1" "$(sh tests/wcet/proof.sh "$on")" "$out/lines" "$out/$on.cases" > "$out/$1.table"
}
table x86-64 && table x86-64-avx2 & # two at a time
table cortex-m7 && table cortex-m7-cycles && table cortex-a53
wait
{
    echo '/* SPDX-License-Identifier: MIT */'
    echo '/* Made by tests/wcet/prices.sh from the machine code (tests/wcet/README.md). */'
    echo '#include "target.h"'
    for t in x86-64 x86-64-avx2 cortex-a53 cortex-m7 cortex-m7-cycles; do
        echo
        cat "$out/$t.table"
    done
} | clang-format --assume-filename=targets.c
