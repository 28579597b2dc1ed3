# SPDX-License-Identifier: MIT
# The shipped cost tables from counted cases: tables.sh CASES_X86_64 CASES_AVX2 CASES_A53 CASES_M7 > core/budget/targets.c
set -e
cat <<'C'
/* SPDX-License-Identifier: MIT */
/* Made by tests/wcet/tables.sh from exact instruction counts; what was raised since: tests/wcet/README.md. */
#include "target.h"

C
i=0
for t in "x86-64 x86_64" "x86-64-avx2 x86_64_avx2" "cortex-a53 cortex_a53" "cortex-m7 cortex_m7"; do
    i=$((i + 1))
    eval "cases=\$$i"
    python3 tests/wcet/fit.py --head-room 1.05 --levels --table $t -- $cases
done
