# SPDX-License-Identifier: MIT
# The unit tests of everything that meets untrusted bytes, under address and undefined behaviour sanitizers.
. "$(dirname "$0")/../cli/lib.sh"
cd "$here" || exit 1
for test in base blob wavelet contact surface zones grasp tets device servo faults; do
    cc=gcc
    $cc -std=c11 -D_GNU_SOURCE -O1 -g -ffp-contract=off -fsanitize=address,undefined -fno-sanitize-recover=undefined \
        -Wno-psabi -DTRIALS=1 -I. -pthread tests/unit/$test.c tests/models.c core/*/*.c \
        $(ls tools/*.c | grep -v tools/main) $(ls sim/*.c | grep -v palp_sim) $(ls port/linux/*.c | grep -vE "palpd|telemetry_dds") \
        "$BUILD/devices.c" -lm -o "$work/$test" 2>"$work/errors" || cat "$work/errors"
    ASAN_OPTIONS=detect_leaks=0 "$work/$test" >"$work/log" 2>&1
    status=$?
    [ $status -eq 0 ] || { grep -E '^not ok|ERROR|runtime error' "$work/log" | head -5; }
    ok $status "tests/unit/$test.c under sanitizers"
done
done_testing
