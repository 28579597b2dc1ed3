# SPDX-License-Identifier: MIT
# The unit tests of everything that meets untrusted bytes, under address and undefined behaviour sanitizers. The solvers that
# bake their bodies go without, since they take most of the time, and each fault meets two protocols of six; with FULL=1 (make
# soak) all do.
. "$(dirname "$0")/../cli/lib.sh"
cd "$here" || exit 1
tests="base contracts mesh blob wavelet surface friction zones grasp tets device passivity servo faults"
make -s -j2 BUILD="$BUILD/sanitized" PLAIN="$([ -n "$FULL" ] || echo tools/solver tools/bake tools/zone)" OPTIMISE=-O2 WARN=-w DDS= \
    INSTRUMENT="-g -fsanitize=address,undefined -fno-sanitize-recover=undefined -DTRIALS=1 $([ -n "$FULL" ] || echo -DEVERY=3)" \
    $(for t in $tests; do echo "$BUILD/sanitized/tests/$t"; done) >"$work/errors" 2>&1 ||
    { tail -5 "$work/errors"; ok 1 "the sanitised build"; done_testing; }
for test in $tests; do
    begun=$(date +%s)
    ASAN_OPTIONS=detect_leaks=0 "$BUILD/sanitized/tests/$test" >"$work/log" 2>&1
    status=$?
    [ $status -eq 0 ] || { grep -E '^not ok|ERROR|runtime error' "$work/log" | head -5; }
    ok $status "tests/unit/$test.c under sanitizers, $(($(date +%s) - begun)) s"
done
done_testing
