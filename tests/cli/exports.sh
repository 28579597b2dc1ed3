# SPDX-License-Identifier: MIT
# One surface as programs export it, with every quirk (exports.py): the same vertices, triangles and volume, and what was mended
# is said; what cannot be read is refused with its cause.
. "$(dirname "$0")/lib.sh"
if ! command -v python3 > /dev/null; then echo "ok 1 - exported meshes # SKIP python3 is not installed (make deps)"; echo 1..1; exit 0; fi
$palp subdivide "$here/blobs/ball.obj" -o ball.obj --levels 1 > /dev/null
mkdir files && python3 "$here/tests/cli/exports.py" ball.obj files > list.txt; ok $? "$(wc -l < list.txt) files are written"
volume() { awk '/^v / {n++; x[n] = $2; y[n] = $3; z[n] = $4} /^f / {a = $2; b = $3; c = $4; s += x[a] * (y[b] * z[c] - z[b] * y[c]) + y[a] * (z[b] * x[c] - x[b] * z[c]) + z[a] * (x[b] * y[c] - y[b] * x[c])} END {printf "%.9g", s / 6}' "$1"; }
ball=$(volume ball.obj)
while read -r name vertices triangles right says; do
    $palp subdivide "files/$name" -o read.obj --levels 0 > said.txt 2> err.txt; status=$?
    v=$(grep -c '^v ' read.obj 2>/dev/null) t=$(grep -c '^f ' read.obj 2>/dev/null)
    [ "$right" = 0 ] && right=$ball
    [ "$status" -eq 0 ] && [ "$v" = "$vertices" ] && [ "$t" = "$triangles" ] &&
        awk -v a="$(volume read.obj)" -v b="$right" 'BEGIN {d = a / b - 1; exit !(d < 1e-5 && d > -1e-5)}' &&
        if [ "$says" = - ]; then [ ! -s err.txt ]; else [ "$(grep -c . err.txt)" -eq 1 ] && grep -q "$says" err.txt; fi
    ok $? "$name: $v vertices, $t triangles $(cut -c1-120 err.txt)"
    rm -f read.obj
done < list.txt
head -c 300 files/binary.stl > short.stl
refuses 1 "needs" "a binary STL that is cut off" $palp remesh short.stl -o out.obj
sed 's/vertex \([-0-9]*\)\./vertex \1,/' files/text.stl > comma.stl
refuses 1 "comma.stl:4: a vertex needs three numbers" "decimal commas" $palp remesh comma.stl -o out.obj
printf 'v 0 0 0\nv 1 0 0\nv nan 1 0\nf 1 2 3\n' > nan.obj
refuses 1 "nan.obj:3: coordinate 1" "a corner that is no number" $palp remesh nan.obj -o out.obj
printf 'v 0 0 0\nf 1 2 3\n' > range.obj
refuses 1 "range.obj:2: vertex 2 is out of range" "a vertex that is not there" $palp remesh range.obj -o out.obj
refuses 2 "name it .obj" "an output of another format" $palp remesh files/plain.obj -o out.stl
done_testing
