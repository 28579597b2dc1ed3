# SPDX-License-Identifier: MIT
# The blocks of tools/TUTORIAL.md as they stand there, on an STL, and the lines of palpd's summary in tools/GLOSSARY.md.
. "$(dirname "$0")/lib.sh"
for d in core tools blobs sim; do ln -s "$here/$d" $d; done
ln -s "$here/$BUILD" build
$palp subdivide blobs/bean.obj -o bean.obj --levels 2 >/dev/null
awk 'BEGIN {print "solid bean"} /^v / {x[++n] = $2 " " $3 " " $4} /^f / {
    print "facet normal 0 0 0\nouter loop"; for (k = 2; k <= 4; k++) print "vertex " x[$k]; print "endloop\nendfacet"}
    END {print "endsolid bean"}' bean.obj > body.stl
awk '/^```sh/ {on = 1; next} /^```/ {on = 0} on && !/^make$/' tools/TUTORIAL.md > steps.sh
awk '/^```c/ {on = 1; next} /^```/ {on = 0} on' tools/TUTORIAL.md > press.c
[ "$(grep -c . steps.sh)" -ge 9 ]; ok $? "the tutorial has its blocks: $(grep -c . steps.sh) lines"
sh -e steps.sh > out.log 2>&1; ok $? "every block of the tutorial runs $(tail -1 out.log)"
grep -q 'bit for bit' out.log; ok $? "replay repeats its run: $(grep 'bit for bit' out.log)"
[ -s body.html ] && [ -s body.svg ] && grep -q '^energy *given to the hand: 0 J' out.log; ok $? "a page, a picture, and no energy given"
./press body.palp > press.txt; awk -F'[: ]+' 'NR > 1 && $3 <= last {bad = 1} {last = $3} END {exit bad || NR != 11}' press.txt
ok $? "the program of the tutorial: force grows with depth, $(tail -1 press.txt)"
missing=
build/palpd body.palp --bus loop --device arm3 --seconds 1 2>/dev/null | grep -oE '^[a-z][a-z -]*[a-z]  +' | sed 's/ *$//' | sort -u > labels.txt
[ "$(wc -l < labels.txt)" -ge 12 ]; ok $? "the summary has its lines: $(wc -l < labels.txt)"
while read -r label; do grep -qi "^| \*\*$label\*\*" tools/GLOSSARY.md || missing="$missing '$label'"; done < labels.txt
[ -z "$missing" ]; ok $? "the glossary explains each of them $missing"
sed -n '/^## Words/,$p' tools/GLOSSARY.md | grep -v '^| word' > words.txt
[ "$(grep -c '^| [A-Za-z]' words.txt)" -le 30 ]; ok $? "and has 30 words at most: $(grep -c '^| [A-Za-z]' words.txt)"
done_testing
