# SPDX-License-Identifier: MIT
# CAN frames, events and missed periods from libFuzzer with address and undefined-behaviour sanitizers: FUZZ_SECONDS (40) of it,
# begun from the corpus that is kept. KEEP=FOLDER adds what is new to a folder.
. "$(dirname "$0")/../cli/lib.sh"
skip() { echo "ok 1 - frame fuzzing # SKIP $1"; echo 1..1; exit 0; }
command -v clang >/dev/null || skip "clang is not installed (make deps)"
cd "$here" || exit 1
sources="tests/fuzz/frames.c $(ls core/*/*.c port/host/*.c sim/*.c | grep -v sim/palp_sim.c)"
clang -std=c11 -O1 -g -D_GNU_SOURCE -fsanitize=fuzzer,address,undefined -fno-sanitize-recover=undefined -ffp-contract=off -I. $sources \
    "$BUILD/devices.c" -pthread -lm -o "$work/fuzz" 2>"$work/errors" || skip "libFuzzer does not link: $(tail -1 "$work/errors")"
mkdir -p "$work/new" && tar -xJf tests/fuzz/corpus.tar.xz -C "$work"
small_body "$work/body.palp"
export PALP_FUZZ_BLOB=$work/body.palp ASAN_OPTIONS=detect_leaks=0 # host programs free nothing at their end
timeout 3000 "$work/fuzz" -max_total_time="${FUZZ_SECONDS:-40}" -max_len=1024 -timeout=30 -print_final_stats=1 -artifact_prefix="$work/" \
    "$work/new" "$work/corpus" >"$work/log" 2>&1
status=$?
runs=$(sed -n 's/stat::number_of_executed_units: *//p' "$work/log" | head -1) covered=$(grep -oE 'cov: [0-9]+' "$work/log" | tail -1)
[ "$status" -eq 0 ]; ok $? "no crash, no report, no force out of limits in ${runs:-0} inputs ($covered), ${FUZZ_SECONDS:-40} s$(grep -m1 -E 'ERROR|runtime error' "$work/log")"
[ "${runs:-0}" -ge 100 ]; ok $? "and they were many enough"
[ -n "$KEEP" ] && "$work/fuzz" -merge=1 "$KEEP" "$work/new" >/dev/null 2>&1
[ "$status" -ne 0 ] && { mkdir -p "$BUILD/fuzz" && cp "$work"/crash-* "$work"/timeout-* "$BUILD/fuzz/" 2>/dev/null; echo "# input kept in $BUILD/fuzz"; }
done_testing
