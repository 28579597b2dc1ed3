# SPDX-License-Identifier: MIT
# The same blob and the same frames give the same bits from every compiler, level and target that is here.
. "$(dirname "$0")/../cli/lib.sh"
cd "$here" || exit 1
small_body "$work/r.palp"
small_chain "$work/z.palp"
printf 'mesh bar.obj\nyoung 1e4\npoisson 0.4\nfix-below x 1e-6\ntets 120 400 1500\n' > "$work/d.model"
"$palp" bake "$work/d.model" -o "$work/d.palp" > /dev/null 2>&1
"$palpd" "$work/r.palp" --bus loop --device arm3 --seconds 6 --no-wait --log "$work/r.log" >/dev/null
grep -qE ' loop 0(29|49|69)#' "$work/r.log"
ok $? "a log of $(grep -c . "$work/r.log") frames"
reference=""
run() { # run NAME RUNNER COMPILER FLAGS...
    name=$1 runner=$2 compiler=$3
    shift 3
    if ! command -v "$compiler" >/dev/null || { [ -n "$runner" ] && ! command -v "$runner" >/dev/null; }; then
        count=$((count + 1)); echo "ok $count - $name # SKIP $compiler or $runner is not installed (make deps)"
        return
    fi
    "$compiler" -std=c11 -ffp-contract=off -fno-math-errno -static "$@" -I. tests/check/hash-ticks.c core/*/*.c -o "$work/hash" 2>"$work/errors" ||
        { ok 1 "$name does not build: $(head -1 "$work/errors")"; return; }
    hash=$($runner "$work/hash" "$work/r.palp" "$work/r.log" "$work/z.palp" "$work/d.palp")
    [ -z "$reference" ] && reference=$hash
    [ -n "$hash" ] && [ "$hash" = "$reference" ]
    ok $? "$name: $hash"
}
run "gcc -O0" "" gcc -O0
run "gcc -O2" "" gcc -O2
run "gcc -O3" "" gcc -O3 -fno-trapping-math
if grep -q avx2 /proc/cpuinfo; then run "gcc -O3 AVX2 with FMA at hand" "" gcc -O3 -mavx2 -mfma; fi
run "clang -O0" "" clang -O0
run "clang -O3" "" clang -O3
run "AArch64 gcc -O2" qemu-aarch64-static aarch64-linux-gnu-gcc -O2
done_testing
