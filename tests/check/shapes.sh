# SPDX-License-Identifier: MIT
# Shapes of many kinds (shapes.py), each as some program exports it: remeshed and baked. EVERY=1 takes all of them, with
# LEVELS="1 2 3" on three levels; by default every sixth, on level 1.
. "$(dirname "$0")/../cli/lib.sh"
if ! command -v python3 > /dev/null; then echo "ok 1 - shapes # SKIP python3 is not installed (make deps)"; echo 1..1; exit 0; fi
mkdir files && python3 "$here/tests/check/shapes.py" files > list.txt; ok $? "$(wc -l < list.txt) shapes are written"
[ "$(wc -l < list.txt)" -ge 100 ]; ok $? "at least 100"
number=0 baked=0 tried=0
for level in ${LEVELS:-1}; do
    while read -r name file options low; do
        number=$((number + 1))
        [ $((number % ${EVERY:-6})) -eq 0 ] || continue
        tried=$((tried + 1))
        [ "$options" = - ] && options=
        $palp bake "files/$file" -o body.palp --levels "$level" --young 2e4 --poisson 0.45 --fix-below z "$low" ${options:+--units mm} > said.txt 2> err.txt
        status=$?
        [ $status -eq 0 ] && baked=$((baked + 1))
        echo "# level $level, $name ($file): $(sed -n 's/^nodes  *\([0-9]*\) .*/\1 nodes/p' said.txt) $(grep -v '^[a-z A-Z'"'"']*  *[0-9.]* s$' err.txt | grep '^palp bake' | cut -c 12-170 | head -2 | tr '\n' ' ')"
        # what is closed and does not cross itself bakes, or is told its thin walls
        [ $status -eq 0 ] || grep -qE 'wall|crosses' err.txt || ok 1 "$name at level $level: $(tail -1 err.txt)"
    done < list.txt
done
[ "$baked" -ge $((tried * 9 / 10)) ]; ok $? "$baked of $tried bake"
done_testing
