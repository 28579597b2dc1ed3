# SPDX-License-Identifier: MIT
# Dynamic bodies from the command line: filling, baking, playing, and everything that can be wrong.
. "$(dirname "$0")/lib.sh"
bar 4 bar.obj
lines() { # lines FILE LINE|LINE|..
    echo "$2" | tr '|' '\n' > "$1"
}
common="mesh bar.obj|young 1e4|poisson 0.4|fix-below x 1e-6|damping 2e-4|drag 4"
lines bar.model "$common|tets 120 400 1500"
"$palp" bake bar.model -o bar.palp --save-mesh bar.mesh > bake.txt 2>/dev/null
ok $? "three resolutions are baked: $(grep '^level 2' bake.txt)"
[ "$(grep -c '^level' bake.txt)" -eq 3 ] && awk '/^level/ {for (i = 1; i <= NF; i++) if ($i == "angles") {if ($(i + 1) < 10.7 || $(i + 3) > 164.8) bad = 1}} END {exit bad}' bake.txt
ok $? "dihedral angles within isosurface stuffing's bounds"
"$palp" bake bar.model -o again.palp --threads 1 > /dev/null 2>&1 && cmp -s bar.palp again.palp
ok $? "baking twice, on any number of threads, gives the same bytes"
"$palp" bake bar.obj -o again.palp --tets 120 400 1500 --young 1e4 --poisson 0.4 --fix-below x 1e-6 --damping 2e-4 --drag 4 > /dev/null 2>&1 && cmp -s bar.palp again.palp
ok $? "the same from the command line"
lines from.model "young 1e4|poisson 0.4|fix-below x 1e-6|damping 2e-4|drag 4|tets-from bar-0.mesh bar-1.mesh bar-2.mesh"
"$palp" bake from.model -o from.palp > from.txt 2>/dev/null && [ "$("$palp" info from.palp | grep -c '^level')" -eq 3 ]
ok $? "the same from files"
"$palp" info bar.palp --json > info.json && python3 -c 'import json; d = json.load(open("info.json")); assert d["dynamic"] and len(d["levels"]) == 3' 2>/dev/null
ok $? "palp info describes it"
"$palp" fill bar.obj --nodes 100 --nodes 400 -o fill.mesh > fill.txt && [ -s fill-0.mesh ] && [ -s fill-1.mesh ] && [ "$(wc -l < fill.txt)" -eq 3 ]
ok $? "palp fill: $(tail -1 fill.txt | tr -s ' ')"
lines poke.scene "seconds 0.6|rate 1000|probe 0.006|touch 0 0.05 0.01 0.04|touch 0.1 0.05 0.01 0.022|touch 0.3 0.05 0.01 0.022|touch 0.35 0.05 0.01 0.05"
"$palp" play bar.palp --scene poke.scene --ns-per-operation 0.15 -o out1.csv --report poke.html > play.txt && grep -q ', 0 late' play.txt
ok $? "poked and let go: $(grep '^contact' play.txt | tr -s ' ')"
awk -F, 'NR == 1 {for (i = 1; i <= NF; i++) c[$i] = i} NR > 1 && $c["probe_fz"] > 0.01 {push = 1} NR > 1 && $c["splits"] > 0 {s = 1} NR > 1 && $c["merges"] > 0 {m = 1} END {exit !(push && s && m)}' out1.csv
ok $? "it pushes back, splits and merges"
"$palp" play bar.palp --scene poke.scene --ns-per-operation 0.15 -o out2.csv > /dev/null && cut -d, -f1-24 out1.csv > a.txt && cut -d, -f1-24 out2.csv > b.txt && cmp -s a.txt b.txt
ok $? "twice the same to the last digit"
grep -q '"motion": {' poke.html && ! grep -q 'http://[^w]' poke.html
ok $? "a report with the body in motion, self-contained"
"$palp" play bar.palp --scene poke.scene --uniform --ns-per-operation 0.001 > uniform.txt && grep -q '1.0 times as many' uniform.txt
ok $? "the finest mesh everywhere, for comparison"
for material in jelly fat liver muscle gel rubber hard-rubber; do
    "$palp" play bar.palp --scene poke.scene --ns-per-operation 0.15 --material $material > m.txt && grep -q ', 0 late' m.txt
    ok $? "$material: $(grep '^element' m.txt | tr -s ' ' | cut -c1-60)"
done
rm -f out1.csv out2.csv
play() { "$palp" play "$@" -o out.csv --report out.html; }
refuses 2 "no 'cheese'; there are: jelly" "unknown material" play bar.palp --scene poke.scene --ns-per-operation 0.15 --material cheese
refuses 2 "need 0 to 100" "negative damping" play bar.palp --scene poke.scene --ns-per-operation 0.15 --damping -1
refuses 2 "no-pairs is for multizone" "an option of multizone models" play bar.palp --scene poke.scene --ns-per-operation 0.15 --no-pairs
refuses 1 "coarsest mesh needs" "a budget that cannot be met" play bar.palp --scene poke.scene --ns-per-operation 0.15 --budget-us 20
lines pose.scene "seconds 1|pose 0 elbow 1"
refuses 2 "pose.scene:2: pose: a dynamic body has no joints" "a joint" play bar.palp --scene pose.scene --ns-per-operation 0.15
lines late.scene "seconds 1e-9"
refuses 2 "not one tick" "no time" play bar.palp --scene late.scene --ns-per-operation 0.15
bake() { "$palp" bake "$@" -o out.palp --save-mesh out.mesh; }
bad() { # bad CODE PATTERN NAME LINES
    lines bad.model "$4"
    refuses "$1" "$2" "$3" bake bad.model
}
bad 2 "not twice 100" "levels that are hardly different" "$common|tets 100 150"
bad 2 "tets: '7' is out of range\|tets:.*7" "too few nodes" "$common|tets 7"
bad 2 "zones or tets, not both" "zones and tets" "$common|tets 60 300|zone a"
bad 2 "out of range: need 0 to 1000" "drag" "$common|drag -3|tets 60"
bad 2 "no mesh" "no mesh" "young 1e4|poisson 0.4|tets 60"
bad 1 "has 0 of its .* nodes in the fixed region" "nothing fixed" "mesh bar.obj|young 1e4|poisson 0.4|fix-below x -1|tets 60"
bad 1 "all nodes of level 0 are fixed" "everything fixed" "mesh bar.obj|young 1e4|poisson 0.4|fix-below x 1|tets 60"
bad 2 "no Young's modulus\|young" "no material" "mesh bar.obj|poisson 0.4|tets 60"
bad 2 "nothing.mesh" "a missing file" "young 1e4|poisson 0.4|tets-from nothing.mesh"
echo "MeshVersionFormatted 2 Dimension 3 Vertices 1 0 0 zero" > bad.mesh
bad 2 "'zero' is not a number" "a bad number" "young 1e4|poisson 0.4|tets-from bad.mesh"
echo "MeshVersionFormatted 2 Dimension 3 Vertices 4 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1 0 Tetrahedra 1 1 2 3 9 0" > bad.mesh
bad 2 "bad.mesh:1: vertex 9 is not one of 1 to 4" "a corner that is not there" "young 1e4|poisson 0.4|tets-from bad.mesh"
echo "MeshVersionFormatted 2 Dimension 3 Vertices 4 0 0 0 0 1 0 0 0 0 1 0 0 1 1 0 0 Tetrahedra 1 1 2 3 4 0" > bad.mesh
bad 1 "tetrahedron 0 has no volume" "a flat tetrahedron" "young 1e4|poisson 0.4|tets-from bad.mesh"
echo "MeshVersionFormatted 2 Dimension 3" > bad.mesh
bad 1 "holds no section Tetrahedra" "an empty mesh" "young 1e4|poisson 0.4|tets-from bad.mesh"
echo "MeshVersionFormatted 2 Dimension 2" > bad.mesh
bad 2 "dimension 2" "a mesh in the plane" "young 1e4|poisson 0.4|tets-from bad.mesh"
{ sed '/^End/d' bar-0.mesh; echo "Hexahedra 1 1 2 3 4 5 6 7 8 0"; } > bad.mesh
bad 2 "1 Hexahedra: cut them into tetrahedra" "elements of another shape" "young 1e4|poisson 0.4|tets-from bad.mesh"
{ sed '/^End/d' bar-0.mesh; sed -n '/^Vertices/,/^Tetra/{/^Tetra/!p}' bar-0.mesh; } > bad.mesh
bad 2 "a second section 'Vertices'" "vertices twice" "young 1e4|poisson 0.4|tets-from bad.mesh"
# one mesh as programs write it: only the hash of the source and the two checksums differ
{ sed '/^Vertices/,$d' bar-0.mesh; sed -n '/^Tetra/,/^End/{/^End/!p}' bar-0.mesh; sed -n '/^Vertices/,/^Tetra/{/^Tetra/!p}' bar-0.mesh; } > turned.mesh
sed '/^Vertices/i\
Corners\
2\
1\
2\
Hexahedra 0\
NormalAtVertices 1 1 1
s/^End/Ridges 1\nSubDomainFromMesh 1 3 1 1 0\nRequiredVertices 2 1 2\nNormals 1 0.5 -1e-3 1\nEnd/' bar-0.mesh > more.mesh
sed 's/^[VTE].*/\L&/; /^end/d; s/$/\r/' bar-0.mesh > lower.mesh
lines plain.model "young 1e4|poisson 0.4|fix-below x 1e-6|tets-from bar-0.mesh"
"$palp" bake plain.model -o plain.palp > /dev/null 2>&1
for mesh in turned more lower; do
    sed "s/bar-0/$mesh/" plain.model > quirk.model
    "$palp" bake quirk.model -o quirk.palp > /dev/null 2> err.txt && [ "$(wc -c < plain.palp)" -eq "$(wc -c < quirk.palp)" ] && [ "$(cmp -l plain.palp quirk.palp | wc -l)" -le 40 ]
    ok $? "$mesh.mesh: the same body $(head -c 200 err.txt)"
done
refuses 2 "no resolution" "fill without a number" "$palp" fill bar.obj -o out.mesh
head -n -2 bar.obj > open.obj
"$palp" fill open.obj --nodes 100 -o fill.mesh > /dev/null 2> err.txt && grep -q "1 hole(s) closed" err.txt
ok $? "fill of an open surface: $(cat err.txt)"
refuses 1 "a dynamic body, which has no Green's functions" "solve" "$palp" solve bar.palp --gravity 0 0 -1 -o out.csv
"$palpd" bar.palp --bus loop --device arm3 --seconds 1 --rate 60 --target x86-64-avx2 --no-wait > felt.txt 2>&1 && grep -q 'bar (dynamic)' felt.txt
ok $? "the controller feels it: $(grep '^largest' felt.txt) $(head -1 felt.txt)"
head -c 60000 bar.palp > short.palp
refuses 1 "short.palp" "a truncated blob" "$palp" play short.palp --scene poke.scene --ns-per-operation 0.15 -o out.csv
done_testing
