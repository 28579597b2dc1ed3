# SPDX-License-Identifier: MIT
# What the library takes: code, data and the deepest stack of every target that can be built here, and memory that the
# memsize functions ask for. size.sh [BLOB ...]; exit 1 if there is mutable data, or more stack than PALP_SERVO_STACK.
BUILD=${BUILD:-build}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
failed=0
flags="-std=c11 -O3 -ffp-contract=off -fno-math-errno -fno-trapping-math -ffreestanding -fno-jump-tables -I. -fcallgraph-info=su"
target() { # target NAME COMPILER FLAGS...
    name=$1 compiler=$2
    shift 2
    if ! command -v "$compiler" >/dev/null; then echo "$name: $compiler is not installed (make deps)"; return; fi
    rm -rf "$work/o" && mkdir "$work/o"
    for c in core/*/*.c; do echo "$c $work/o/$(echo "$c" | tr / _).o"; done |
        xargs -P 4 -n 2 sh -c "$compiler $flags $* -c \$0 -o \$1 || exit 255" || { echo "$name: does not build"; failed=1; return; }
    tool=${compiler%gcc}
    "${tool}size" -A "$work"/o/*.o | awk -v n="$name" '
        $1 ~ /^\.text/ {t += $2} $1 ~ /^\.rodata/ {r += $2} $1 ~ /^\.data($|\.[^r])/ {d += $2} $1 ~ /^\.bss/ {b += $2}
        END {printf "%s: code %d, constants %d, mutable data %d, zeroed data %d bytes\n", n, t, r, d, b; exit d + b > 0}' ||
        failed=1
    python3 tests/callgraph.py "$work"/o/*.ci > "$work/stack" || failed=1
    sed 's/^/    /' "$work/stack"
    deepest=$(awk 'NR == 2 {print $1}' "$work/stack")
    [ "$deepest" -le "$most" ] || { echo "    more than $most bytes of stack"; failed=1; }
}
most=$(sed -n "s/^#define PALP_SERVO_STACK \([0-9]*\)u/\1/p" core/servo/servo.h)
of() { sed -n "s/^$1_$2 := *//p" core/targets.mk; } # of PREFIX|FLAGS TARGET
for t in $(sed -n 's/^TARGETS := //p' core/targets.mk); do target "$t" "$(of PREFIX "$t")gcc" $(of FLAGS "$t"); done
for blob in "$@"; do
    echo "memory for $blob (palp wcet):"
    "$BUILD/palp" wcet "$blob" | sed -n "s/^memory/    servo:/p"
done
exit $failed
