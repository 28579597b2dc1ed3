# SPDX-License-Identifier: MIT
# The same ball as OBJ (triangles, quads, v/vt/vn, negative indices), STL and PLY bakes to the same body.
. "$(dirname "$0")/lib.sh"
ball=$here/blobs/ball.obj
bake() { $palp bake "$1" --as-is -o "$2" --young 1e4 --poisson 0.3 --fix-below z -0.5 --threads 1 >/dev/null 2>err.txt || cat err.txt; }
answer() { printf 'node,kind,x,y,z\n5,f,0,0,-1\n' >set.csv; $palp solve "$1" --set set.csv | sed -n 7p; }
bake "$ball" ref.palp
awk '/^v/{print; n++} /^f/{print "f", $2"/1/1", $3"//7", $4"/2"}' "$ball" >a.obj
bake a.obj a.palp
[ "$(answer a.palp)" = "$(answer ref.palp)" ]
ok $? "v/vt/vn"
awk '/^v/{print; n++} /^f/{print "f", $2-n-1, $3-n-1, $4-n-1}' "$ball" >b.obj
bake b.obj b.palp
[ "$(answer b.palp)" = "$(answer ref.palp)" ]
ok $? "negative indices"
cat >tetra.obj <<'EOF'
v 0 0 0
v 1 0 0
v 0 1 0
f -3 -1 -2
v 0 0 1
f -4 -3 -1
f -4 -1 -2
f -3 -2 -1
EOF
$palp bake tetra.obj --as-is -o tetra.palp --young 1e4 --poisson 0.3 --fix-below z 0.1 >/dev/null 2>err.txt
ok $? "negative indices among vertices, counted from their own line $(cat err.txt | grep -v ' s$' | head -1)"
{ echo ply; echo format ascii 1.0; echo element vertex $(grep -c ^v "$ball"); echo property float x; echo property float y; echo property float z
  echo element face $(grep -c ^f "$ball"); echo property list uchar int vertex_indices; echo end_header
  sed -n 's/^v //p' "$ball"; awk '/^f/{print 3, $2-1, $3-1, $4-1}' "$ball"; } >c.ply
bake c.ply c.palp
[ "$(answer c.palp)" = "$(answer ref.palp)" ]
ok $? "text PLY"
awk 'BEGIN{print "solid ball"} /^v/{n++; v[n]=$2" "$3" "$4} /^f/{print "facet normal 0 0 0\nouter loop"; for(i=2;i<5;i++) print "vertex", v[$i]; print "endloop\nendfacet"} END{print "endsolid ball"}' "$ball" >d.stl
bake d.stl d.palp
[ "$($palp info d.palp --json | grep -o '"nodes": [0-9]*')" = "$($palp info ref.palp --json | grep -o '"nodes": [0-9]*')" ]
ok $? "text STL, welded"
if command -v perl >/dev/null; then
    perl -e 'while(<>){if(/^v (\S+) (\S+) (\S+)/){push @v,[$1,$2,$3]} if(/^f (\d+) (\d+) (\d+)/){push @f,[$1,$2,$3]}}
        print "\0"x80,pack("V",scalar @f); for $f(@f){print pack("f<3",0,0,0); print pack("f<3",@{$v[$_-1]}) for @$f; print pack("v",0)}' "$ball" >e.stl
    bake e.stl e.palp
    [ "$($palp info e.palp --json | grep -o '"nodes": [0-9]*')" = "$($palp info ref.palp --json | grep -o '"nodes": [0-9]*')" ]
    ok $? "binary STL, welded"
    for order in little big; do
        perl -e '$o=shift; ($F,$I)=$o eq "little"?("f<","l<"):("f>","l>"); while(<>){if(/^v (\S+) (\S+) (\S+)/){push @v,[$1,$2,$3]} if(/^f (\d+) (\d+) (\d+)/){push @f,[$1-1,$2-1,$3-1]}}
            printf "ply\nformat binary_%s_endian 1.0\nelement vertex %d\nproperty float x\nproperty float y\nproperty float z\nelement face %d\nproperty list uchar int vertex_indices\nend_header\n",$o,scalar @v,scalar @f;
            print pack("${F}3",@$_) for @v; print pack("C",3),pack("${I}3",@$_) for @f' $order "$ball" >f.ply
        bake f.ply f.palp
        [ "$($palp info f.palp --json | grep -o '"nodes": [0-9]*')" = "$($palp info ref.palp --json | grep -o '"nodes": [0-9]*')" ]
        ok $? "binary PLY, $order endian"
    done
    head -c 300 e.stl >out.stl.cut; mv out.stl.cut cut.stl
    refuses 1 "needs" "truncated binary STL" $palp bake cut.stl --as-is -o out.palp --young 1 --poisson 0.3 --fix-below z 0
else
    echo "ok $((count = count + 1)) - binary STL and PLY # SKIP no perl to write them"
fi
cat >box.obj <<'EOF'
v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0
v 0 0 1
v 1 0 1
v 1 1 1
v 0 1 1
f 4 3 2 1
f 5 6 7 8
f 1 2 6 5
f 2 3 7 6
f 3 4 8 7
f 4 1 5 8
EOF
bake() { $palp bake "$1" --as-is -o "$2" --young 1e4 --poisson 0.3 --fix-below z 0.1 >/dev/null 2>err.txt || cat err.txt; }
bake box.obj box.palp
$palp info box.palp --json | grep -q '"nodes": 8'
ok $? "quads"
cat >body.model <<EOF
# keys as options
mesh box.obj
as-is
young 1e4
poisson 0.3
fix-below z 0.1
EOF
$palp bake body.model -o model.palp >/dev/null 2>&1 && cmp -s box.palp model.palp
ok $? "a model file gives the same bytes as the options"
$palp bake box.obj --as-is -o t1.palp --young 1e4 --poisson 0.3 --fix-below z 0.1 --threads 1 >/dev/null 2>&1
$palp bake box.obj --as-is -o t3.palp --young 1e4 --poisson 0.3 --fix-below z 0.1 --threads 3 >/dev/null 2>&1
cmp -s t1.palp t3.palp
ok $? "the same bytes on one and three threads"
echo "young -4" >>body.model
refuses 2 "body.model:7" "a bad value in a model file is named with its line" $palp bake body.model -o out.palp
done_testing
