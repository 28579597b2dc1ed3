# SPDX-License-Identifier: MIT
# No operation and no tick takes more instructions than its bound, counted exactly, on every target with a table; ticks in
# virtual time are never late; what numbers an input holds does not change what it costs; the bare image runs.
. "$(dirname "$0")/../cli/lib.sh"
cd "$here" || exit 1
scale=${PALP_SCALE:-1} # episodes of every kind of case, times ten
skip() { # skip NAME COMMAND
    count=$((count + 1))
    echo "ok $count - $1 # SKIP $2 is not installed (make deps)"
}
bake() { "$palp" bake "$work/$1.model" -o "$work/$1.palp" > /dev/null 2>&1; }
body() { printf 'mesh %s/blobs/%s.obj\nloop %s\nyoung 3e4\npoisson 0.45\nfix-below z %s\n%s\nstorage %s\n' "$here" "$2" "$3" "$4" "${5:+table-mb $5}" "${6:-f32}" > "$work/$1.model" && bake "$1"; }
body small bean 2 0.0339 ""      # 162 nodes, split form
body middle rabbit 2 0.004 1     # 642, the finest level compressed
body tables rabbit 2 0.004 16    # 642, tables on every level
body flash rabbit 2 0.004 0.5 f16
cp "$work/flash.model" "$work/half.model" && printf 'wavelet butterfly\nepsilon 0.01\n' >> "$work/half.model" && bake half # long columns in halves
small_chain "$work/chain.palp"
printf 'mesh bar.obj\nyoung 1e4\npoisson 0.4\nfix-below x 1e-6\ntets 120 400 1500\n' > "$work/dynamic.model" && bake dynamic
[ -s "$work/flash.palp" ] && [ -s "$work/dynamic.palp" ]; ok $? "bodies of 162 and 642 nodes, a chain and a dynamic body"

hold() { # hold TARGET: every case of every body within its bound
    target=$1
    echo "# $target, seed 4711: body, operation, level, cases, most counted, largest bound, share of its bound, beyond"
    for b in small half; do sh tests/wcet/cases.sh "$target" "$work/$b.palp" 4711 $((scale * 5)) hold | sed "s/^/$b /"; done > "$work/$target.held"
    sh tests/wcet/cases.sh "$target" "$work/tables.palp" 4711 $((scale * 18)) hold | sed "s/^/tables /" >> "$work/$target.held" # hunted most
    sh tests/wcet/cases.sh "$target" "$work/chain.palp" 4711 $((scale * 6)) hold | sed "s/^/chain /" >> "$work/$target.held"
    sh tests/wcet/cases.sh "$target" "$work/dynamic.palp" 4711 "$scale" hold | sed "s/^/dynamic /" >> "$work/$target.held"
    sed 's/^/#   /' "$work/$target.held"
    cases=$(awk '{n += $4} END {print n + 0}' "$work/$target.held")
    beyond=$(awk '{n += $8} END {print n + 0}' "$work/$target.held")
    [ "$cases" -gt $((scale * 6000)) ] && [ "$beyond" -eq 0 ]
    ok $? "$target: $cases counted cases, $beyond beyond their bound"
    # of the 642 nodes with tables: a derivation assumes the longest way everywhere at once; of a whole tick a short hunt finds the most
    tight() { awk -v o="$1" -v l="$2" '$1 == "tables" && $2 == o && $3 == l {printf "%.2f", $6 / $5}' "$work/$target.held"; }
    points=$(tight points 3) whole=$(tight whole 3)
    awk -v q="$points" -v w="$whole" 'BEGIN {exit !(q >= 1 && q <= 2 && w >= 1 && w <= 6)}'
    ok $? "$target: largest bound over most counted: contact points $points, a whole tick $whole"
}
for t in x86-64 x86-64-avx2 cortex-a53 cortex-m7; do
    case $t in
    x86*) needs="qemu-x86_64" ;;
    cortex-a53) needs="qemu-aarch64 aarch64-linux-gnu-gcc" ;;
    cortex-m7) needs="qemu-system-arm arm-none-eabi-gcc" ;;
    esac
    missing=""
    for n in $needs; do command -v "$n" > /dev/null || missing=$n; done
    if [ -n "$missing" ]; then skip "$t" "$missing"; else hold "$t"; fi
done

# the plugin against callgrind: the same program, counted by both
native="-std=gnu11 -O2 -fno-math-errno -D_GNU_SOURCE -I. -static"
gcc $native tests/wcet/deadline.c tools/wcet/tool_path.c "$BUILD/libpalp.a" -lm -o "$work/deadline" || exit 1
if command -v qemu-x86_64 > /dev/null && command -v valgrind > /dev/null; then
    qemu-x86_64 -plugin "$BUILD/wcet/x86-64/counter.so,count=$work/count" "$work/deadline" "$work/small.palp" 1000 1 > /dev/null
    plugin=$(od -An -tu8 -N8 "$work/count" | tr -d ' ')
    callgrind=$(valgrind --tool=callgrind --callgrind-out-file=/dev/null "$work/deadline" "$work/small.palp" 1000 1 2>&1 | sed -n 's/.*Collected : //p')
    awk -v a="$plugin" -v b="$callgrind" 'BEGIN {exit !(a > 1e6 && a / b < 1.005 && a / b > 0.995)}'
    ok $? "1000 ticks are $plugin instructions by the plugin, $callgrind by callgrind"
else
    skip "plugin against callgrind" "qemu-x86_64 or valgrind"
fi

# a million ticks, by what the code counts itself
ticks=${PALP_TICKS:-1000000}
"$work/deadline" "$work/small.palp" $((ticks / 2)) 1 > "$work/one" & one=$!
"$work/deadline" "$work/tables.palp" $((ticks / 4)) 2 > "$work/two"; two=$?
"$work/deadline" "$work/middle.palp" $((ticks / 4)) 3 > "$work/three"; three=$?
wait $one && [ $two -eq 0 ] && [ $three -eq 0 ]
ok $? "$ticks ticks in virtual time, none late"
sed 's/^/#   /' "$work/one" "$work/two" "$work/three"
[ "$(sed 's/.*at look//' "$work/one" "$work/two" "$work/three" | grep -oE ' [0-9]+:' | sort -un | wc -l)" -ge 3 ]
ok $? "and held after leaps at several of the looks at the clock"
if command -v qemu-x86_64 > /dev/null; then # and by instructions
    sh tests/wcet/cases.sh x86-64
    gcc $native -DINSTRUCTIONS tests/wcet/deadline.c tests/wcet/instructions.c tools/wcet/tool_path.c "$BUILD"/wcet/x86-64/core_*.o -lm -o "$work/exact" || exit 1
    for b in small tables; do
        PALP_COUNT=$work/count qemu-x86_64 -plugin "$BUILD/wcet/x86-64/counter.so,count=$work/count" "$work/exact" "$work/$b.palp" 10000 5 > "$work/exact.out"
        ok $? "clock driven by counted instructions: $(cat "$work/exact.out")"
    done
fi

# numbers in the input
gcc $native -O2 tests/wcet/timing.c "$BUILD/libpalp.a" -lm -o "$work/timing" || exit 1
"$work/timing" "$work/tables.palp" > "$work/timing.out" || "$work/timing" "$work/tables.palp" > "$work/timing.out" # noise, once
ok $? "time of a tick in ns: $(cat "$work/timing.out")"
if command -v qemu-x86_64 > /dev/null; then
    gcc $native -DINSTRUCTIONS tests/wcet/timing.c tests/wcet/instructions.c "$BUILD/libpalp.a" -lm -o "$work/timing" || exit 1
    PALP_COUNT=$work/count qemu-x86_64 -plugin "$BUILD/wcet/x86-64/counter.so,count=$work/count" "$work/timing" "$work/tables.palp" > "$work/timing.out"
    ok $? "most instructions of a tick: $(cat "$work/timing.out")"
fi

# images without an operating system
image() { # image NAME BLOB CORE MACHINE FLAGS...
    name=$1 blob=$2 core=$3 machine=$4
    shift 4
    if ! command -v arm-none-eabi-gcc > /dev/null || ! command -v qemu-system-arm > /dev/null; then
        skip "$name" "arm-none-eabi-gcc or qemu-system-arm"
        return
    fi
    sh port/cortexm/build.sh "$work/$blob.palp" "$work/image.elf" "$core" "$@" > "$work/image.out" &&
        timeout 300 qemu-system-arm -M "$machine" -nographic -monitor none -serial none -semihosting-config enable=on,target=native \
            -icount shift=6 -kernel "$work/image.elf" </dev/null >> "$work/image.out" 2>&1
    grep -q '^late 0$' "$work/image.out" && ! grep -q 'largest force 0 mN' "$work/image.out" && grep -q '^hash' "$work/image.out"
    ok $? "$name"
    sed 's/^/#   /' "$work/image.out"
    grep '^hash' "$work/image.out" >> "$work/hashes.$blob"
}
image "Cortex-M7, 162 nodes, 100 Hz" small m7 mps2-an500 -DRATE_HZ=100.0f
image "Cortex-M7, 642 nodes, 95 Hz" flash m7 mps2-an500 -DRATE_HZ=95.0f
image "Cortex-M55, 162 nodes, 100 Hz" small m55 mps3-an547 -DRATE_HZ=100.0f
sh tests/size.sh "$work/small.palp" "$work/middle.palp" > "$work/size.out"
ok $? "no mutable data, no more stack than PALP_SERVO_STACK in any call on any target"
sed 's/^/#   /' "$work/size.out"
done_testing
