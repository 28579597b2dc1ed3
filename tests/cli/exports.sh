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
awk '{print} /^f/ {print}' ball.obj > twice.obj
refuses 1 "lies there twice" "a surface that is there twice" $palp remesh twice.obj -o out.obj
awk '{print} /^f/ {print "f", $3, $2, $4}' ball.obj > two-sided.obj
refuses 1 "lies there twice" "a surface with two sides" $palp remesh two-sided.obj -o out.obj
printf 'ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n' > no-face.ply
refuses 1 "'element face N' is missing" "a PLY header without faces" $palp remesh no-face.ply -o out.obj
printf 'ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nend_header\n0 0 0\n1 0 0\n0 1' > short.ply
refuses 1 "vertex 3: z should be a number" "a PLY that ends too early" $palp remesh short.ply -o out.obj
printf 'v 0 0 0\nf 1 2 3\n' > range.obj
refuses 1 "range.obj:2: vertex 2 is out of range" "a vertex that is not there" $palp remesh range.obj -o out.obj
refuses 2 "name it .obj" "an output of another format" $palp remesh files/plain.obj -o out.stl

# Units, components, surfaces that touch themselves.
awk '/^v / {printf "v %.9g %.9g %.9g\n", 1000 * $2, 1000 * $3, 1000 * $4; next} {print}' ball.obj > mm.obj
$palp subdivide mm.obj -o metres.obj --levels 0 --units mm > /dev/null 2> err.txt
awk -v a="$(volume metres.obj)" -v b="$ball" 'BEGIN {d = a / b - 1; exit !(d < 1e-5 && d > -1e-5)}' && [ ! -s err.txt ]; ok $? "--units mm"
$palp subdivide mm.obj -o far.obj --levels 0 > /dev/null 2> err.txt; grep -q 'm across: .*--units mm' err.txt; ok $? "a body of 2 km is warned of: $(cat err.txt)"
$palp subdivide ball.obj -o small.obj --levels 0 --units mm 2> err.txt > /dev/null; $palp subdivide small.obj -o speck.obj --levels 0 --units mm > /dev/null 2> err.txt
grep -q 'mm across: is the file in metres' err.txt; ok $? "a body of 3 um is warned of: $(cat err.txt)"
refuses 2 "'feet' is not one of" "an unknown unit" $palp subdivide mm.obj -o out.obj --units feet
n=$(grep -c '^v ' ball.obj)
cube() { # cube X Y Z FIRST: a cube of 0.4 with its vertices numbered from FIRST
    awk -v x="$1" -v y="$2" -v z="$3" -v o="$4" 'BEGIN {for (i = 0; i < 8; i++) print "v", x + 0.4 * (i % 2), y + 0.4 * (int(i / 2) % 2), z + 0.4 * int(i / 4)
        split("0 2 3 1 4 5 7 6 0 1 5 4 2 6 7 3 0 4 6 2 1 3 7 5", f, " "); for (i = 0; i < 6; i++) print "f", f[4*i+1]+o, f[4*i+2]+o, f[4*i+3]+o, f[4*i+4]+o}'
}
{ cube 0 0 0 1; cube 0.5 0 0 9; awk '/^v/ {print "v", $2 + 3, $3, $4}' ball.obj; awk '/^f/ {print "f", $2 + 16, $3 + 16, $4 + 16}' ball.obj; } > three.obj
refuses 1 "several components: 3" "three bodies in a file" $palp remesh three.obj -o out.obj
$palp subdivide three.obj -o read.obj --levels 0 --largest > /dev/null 2> err.txt && [ "$(grep -c '^v ' read.obj)" -eq "$n" ] && grep -q 'component 0 of 3 kept' err.txt; ok $? "--largest: $(cat err.txt)"
$palp subdivide three.obj -o read.obj --levels 0 --component 2 > /dev/null 2>&1 && [ "$(grep -c '^v ' read.obj)" -eq 8 ]; ok $? "--component 2"
refuses 2 "no component 3: there are 3" "a component that is not there" $palp subdivide three.obj -o out.obj --component 3
$palp bake three.obj --as-is --each -o each.palp --young 1e4 --poisson 0.4 --fix-below z 0.001 > bake.txt 2> err.txt && [ "$(for i in 0 1 2; do $palp info each-$i.palp | sed -n 's/^nodes *\([0-9]*\).*/\1/p'; done | tr '\n' ' ')" = "$n 8 8 " ]
ok $? "--each: three blobs"
refuses 1 "no node of component 1 is fixed" "--each: a component that nothing holds" $palp bake three.obj --as-is --each -o each.palp --young 1e4 --poisson 0.4 --fix-below z -0.5
{ cat ball.obj; sed -n '/^v/p' ball.obj | awk '{print "v", 0.5 * $2, 0.5 * $3, 0.5 * $4}'; awk -v n="$n" '/^f/ {print "f", $2 + n, $4 + n, $3 + n}' ball.obj; } > hollow.obj
refuses 1 "component 1 lies inside component 0" "a hollow body" $palp remesh hollow.obj -o out.obj
for touch in "0.4 0.4 0 edge" "0.4 0.4 0.4 corner"; do
    set -- $touch
    { cube 0 0 0 1; cube "$1" "$2" "$3" 9; } > touching.obj
    # one numbering: places that are shared become one vertex
    awk '/^v/ {k = $2 " " $3 " " $4; n++; if (!(k in at)) {at[k] = ++m; print} now[n] = at[k]; next} {print "f", now[$2], now[$3], now[$4], now[$5]}' touching.obj > shared.obj
    $palp subdivide shared.obj -o read.obj --levels 0 --component 1 > /dev/null 2> err.txt && [ "$(grep -c '^v ' read.obj)" -eq 8 ] && grep -q 'touches itself' err.txt
    ok $? "two cubes that share an $4 are two bodies: $(head -1 err.txt)"
done
# One surface, one result, in whatever order a file has it.
$palp remesh files/binary.stl -o stl.obj --levels 1 > /dev/null 2>&1; $palp remesh files/binary.ply -o ply.obj --levels 1 > /dev/null 2>&1
[ -s stl.obj ] && cmp -s stl.obj ply.obj; ok $? "remesh of an STL and of a PLY of the same surface: the same file"
# A cylinder whose caps are polygons of 300 corners: no needles are left.
angle() { sed -n 's/^smallest angle *\([0-9.]*\) .*/\1/p'; }
a=$($palp remesh files/caps.obj -o out.obj --levels 1 2> err.txt | angle); [ ! -s err.txt ] && awk -v a="$a" 'BEGIN {exit !(a > 5)}'
ok $? "caps of 300 corners, remeshed: smallest angle $a degrees"
# A bar with sharp edges keeps them: 80 x 20 x 4 mm, with its volume.
bar() { awk 'BEGIN {for (i = 0; i < 8; i++) print "v", 0.08 * (i % 2), 0.02 * (int(i / 2) % 2), 0.004 * int(i / 4)
    split("0 2 3 1 4 5 7 6 0 1 5 4 2 6 7 3 0 4 6 2 1 3 7 5", f, " "); for (i = 0; i < 6; i++) print "f", f[4*i+1]+1, f[4*i+2]+1, f[4*i+3]+1, f[4*i+4]+1}'; }
bar > bar.obj; $palp remesh bar.obj -o out.obj --levels 2 > /dev/null 2>&1
awk -v a="$(volume out.obj)" 'BEGIN {d = a / 6.4e-6 - 1; exit !(d < 0.01 && d > -0.01)}'; ok $? "a bar with sharp edges, remeshed: volume $(volume out.obj) m^3 of 6.4e-6"
# A thorn that is narrower than the mesh keeps its tip.
awk '/^v/ && !done {print "v", 1.4 * $2, 1.4 * $3, 1.4 * $4; done = 1; next} {print}' ball.obj > thorn.obj
far() { awk '/^v/ {d = sqrt($2 * $2 + $3 * $3 + $4 * $4); if (d > m) m = d} END {print m}' "$1"; }
$palp remesh thorn.obj -o out.obj --levels 2 > /dev/null 2>&1; awk -v a="$(far thorn.obj)" -v b="$(far out.obj)" 'BEGIN {exit !(b > 0.99 * a)}'
ok $? "a thorn keeps its tip: $(far out.obj) of $(far thorn.obj)"

# Holes: up to a stated size, or named.
awk '/^f/ && n++ < 1 {next} {print}' ball.obj > holed.obj
refuses 1 "add --holes" "a hole in a mesh that is taken as it is" $palp subdivide holed.obj -o out.obj --levels 0
$palp subdivide holed.obj -o read.obj --levels 0 --holes 10 > /dev/null 2> err.txt && grep -q '1 hole(s) closed, the longest rim' err.txt; ok $? "--holes: $(cat err.txt)"
refuses 1 "the longest rim has" "a hole that is larger than asked for" $palp remesh holed.obj -o out.obj --holes 0.01
refuses 2 "holes" "a rim of no length" $palp remesh holed.obj -o out.obj --holes -1
awk '/^v / {printf "v %.9g %.9g %.9g\n", 654321 + 0.03 * $2, 5432109 + 0.03 * $3, 0.03 * $4; next} {print}' ball.obj > digits.obj
refuses 1 "lost their digits" "a body whose places have too few digits, far from the origin" $palp remesh digits.obj -o out.obj

printf '%s\n' 'v 2 2 0' 'v 0 2 0' 'v 0 2 1' 'v 1 1 1' 'v 0 0 1' 'v 2 2 1' 'v 2 2 0' 'v 1 0 0' 'f 4 7 2' 'f 1 5 2' 'f 5 3 4' 'f 4 2 5' 'f 2 4 3' 'f 3 1 2' 'f 8 4 2' 'f 6 5 2' > folds.obj
timeout 20 $palp check folds.obj > /dev/null 2> err.txt; [ $? -eq 1 ] && grep -q "non-manifold" err.txt; ok $? "folds at an edge end: $(tail -1 err.txt | cut -c1-90)"
{ cube 0 0 0 1; cube 0.1 0.1 0.4 9 | awk '/^v/ && $2 > 0.2 {$2 -= 0.2} /^v/ && $3 > 0.2 {$3 -= 0.2} {print}'; } > stacked.obj
refuses 1 "several components: 2" "a small body that stands on a large one is not within it" $palp remesh stacked.obj -o out.obj
awk '/^f/ && n++ == 0 {next} /^f/ && n == 3 {print "f", $3, $2, $4; next} {print}' ball.obj > mixed.obj
$palp subdivide mixed.obj -o read.obj --levels 0 --holes 10 > /dev/null 2> err.txt && grep -q '1 hole(s) closed' err.txt; ok $? "a hole beside a triangle that runs the other way: $(cat err.txt)"

# palp check.
$palp check ball.obj > check.txt 2> err.txt && [ ! -s err.txt ] && grep -q 'size  .* cm' check.txt && grep -q 'genus 0' check.txt && grep -q 'wall  ' check.txt && grep -q 'nodes, 4 levels with --levels 3' check.txt
ok $? "palp check: $(grep -c . check.txt) lines"
$palp check three.obj > check.txt 2> err.txt; [ $? -eq 1 ] && grep -q 'component   2: 12 triangles' check.txt && grep -q -- '--largest' err.txt; ok $? "palp check of several bodies: $(cat err.txt)"
awk '/^v/ && !done {print "v", -0.7 * $2, -0.7 * $3, -0.7 * $4; done = 1; next} {print}' ball.obj > inside.obj
awk '/^v/ && !done {print "v", -1.3 * $2, -1.3 * $3, -1.3 * $4; done = 1; next} {print}' ball.obj > through.obj
$palp check through.obj > check.txt 2> err.txt; grep -q 'crosses     itself near' check.txt; ok $? "palp check of a surface that crosses itself: $(grep crosses check.txt)"
$palp check inside.obj > check.txt 2> err.txt; ! grep -q crosses check.txt; ok $? "and not of one that only comes near"
$palp bake through.obj --as-is -o out.palp --young 1e4 --poisson 0.4 --fix-below x 0 > /dev/null 2> err.txt; grep -q 'crosses itself near' err.txt; ok $? "palp bake --as-is says so: $(head -1 err.txt)"
refuses 2 "no mesh" "palp check without a mesh" $palp check

# Moduli with units.
bake="$palp bake ball.obj --as-is -o ball.palp --poisson 0.4 --fix-below z -0.5"
young() { $palp info ball.palp --json | sed -n 's/.*"young_pa": \([0-9.e+]*\).*/\1/p'; }
$bake --young 20 kPa > /dev/null 2>&1 && [ "$(young)" = 20000 ]; ok $? "--young 20 kPa"
printf 'mesh ball.obj\nas-is\nyoung 2 MPa # rubber\npoisson 0.4\nfix-below z -0.5\n' > ball.model
$palp bake ball.model -o ball.palp > bake.txt 2>&1 && [ "$(young)" = 2000000 ] && grep -q '^size .* cm' bake.txt; ok $? "young 2 MPa in a model file"
refuses 2 "'kN' is not one of" "an unknown unit of a modulus" $palp bake ball.obj --as-is -o out.palp --poisson 0.4 --fix-below z -0.5 --young 2 kN
$bake --young 5 > /dev/null 2> err.txt; grep -q "Young's modulus is 5 Pa" err.txt; ok $? "a modulus of 5 Pa is warned of"
done_testing
