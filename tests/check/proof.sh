# SPDX-License-Identifier: MIT
# Bounds from the machine code: every loop of core has a bound in named counts on every target with a table, and no formula of
# core is below what they come to at any of the counts it is asked for.
. "$(dirname "$0")/../cli/lib.sh"
cd "$here" || exit 1
body() { printf 'mesh %s/blobs/%s.obj\nloop %s\nyoung 3e4\npoisson 0.45\nfix-below z %s\ntable-mb %s\nstorage %s\n%s\n' "$here" "$2" "$3" "$4" "$5" "$6" "$7" > "$work/$1.model" && "$palp" bake "$work/$1.model" -o "$work/$1.palp" > /dev/null 2>&1; }
body middle rabbit 2 0.004 16 f32
body half rabbit 2 0.004 0.5 f16
printf 'mesh %s/blobs/bean.obj\nas-is\nyoung 3e4\npoisson 0.45\nfix-below z 0.0339\n' "$here" > "$work/one.model" # of one level
"$palp" bake "$work/one.model" -o "$work/one.palp" > /dev/null 2>&1
body many bean 1 0.0339 8 f32 'modes 128'
printf 'mesh %s/blobs/box.obj\nyoung 1e4\npoisson 0.4\nfix-below z 1e-3\ntets 150 600 2500\n' "$here" > "$work/cube.model"
"$palp" bake "$work/cube.model" -o "$work/cube.palp" > /dev/null 2>&1
small_chain "$work/chain.palp" # its mesh: bar.obj
printf 'mesh %s\nyoung 1e4\npoisson 0.4\nfix-below x 1e-6\ntets 120 400 1500\n' "$work/bar.obj" > "$work/dynamic.model"
"$palp" bake "$work/dynamic.model" -o "$work/dynamic.palp" > /dev/null 2>&1
gcc -std=gnu11 -O1 -I. tests/wcet/ipet/formulas.c "$BUILD/libpalp.a" -lm -o "$work/formulas" &&
    "$work/formulas" 2 14 "$work/middle.palp" "$work/half.palp" "$work/one.palp" "$work/many.palp" "$work/dynamic.palp" "$work/cube.palp" > "$work/lines" && [ "$(wc -l < "$work/lines")" -gt 8000 ]
ok $? "formulas asked at $(wc -l < "$work/lines") counts"
# One target: lines of a status and a text, or of a comment.
prove() {
    t=$1
    for n in python3 glpsol llvm-symbolizer $(case $t in cortex-m7) echo arm-none-eabi-gcc ;; cortex-a53) echo aarch64-linux-gnu-gcc ;; esac); do
        command -v "$n" > /dev/null || { echo "skip $t # SKIP $n is not installed (make deps)"; return; }
    done
    elf=$(sh tests/wcet/proof.sh $t)
    python3 tests/wcet/ipet/ipet.py survey $t "$elf" > "$work/$t.survey"
    echo "$? $(tail -1 "$work/$t.survey"), none without a bound"
    for b in half one dynamic; do # what a short hunt counts, to be seen beside the bounds (check/wcet.sh hunts longer)
        sh tests/wcet/cases.sh $t "$work/$b.palp" 7 2 hold
    done > "$work/$t.counted" 2> /dev/null
    python3 tests/wcet/ipet/ipet.py hold $t "$elf" "$work/lines" "$work/$t.counted" > "$work/$t.held"
    echo "$? $(tail -1 "$work/$t.held")"
    sed 's/^/#   /' "$work/$t.held"
    [ $t = cortex-m7 ] || return
    python3 tests/wcet/ipet/ipet.py hold cortex-m7-cycles "$elf" "$work/lines" > "$work/$t.cycles"
    echo "$? in cycles, as they are stated: $(tail -1 "$work/$t.cycles")"
    python3 tests/wcet/ipet/ipet.py facts $t "$elf" "$work/lines" > "$BUILD/wcet/proof/$t.ff" && [ "$(grep -c '^loop 0x.* MAX ' "$BUILD/wcet/proof/$t.ff")" -gt 700 ]
    echo "$? flow facts, $BUILD/wcet/proof/$t.ff: $(tail -1 "$BUILD/wcet/proof/$t.ff" | cut -c4-)"
}
# Two at a time.
(prove cortex-m7 > "$work/cortex-m7.out" 2>&1) &
for t in cortex-a53 x86-64 x86-64-avx2; do prove $t > "$work/$t.out" 2>&1; done
wait
for t in cortex-m7 cortex-a53 x86-64 x86-64-avx2; do
    while IFS= read -r line; do
        case $line in
            '#'*) echo "$line" ;;
            skip*) count=$((count + 1)); echo "ok $count - ${line#skip }" ;;
            [0-9]*) ok "${line%% *}" "${line#* }" ;;
            *) ok 1 "$t: $line" ;;
        esac
    done < "$work/$t.out"
done
done_testing
