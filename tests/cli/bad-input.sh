# SPDX-License-Identifier: MIT
# Every bad input is one clear line, the exit code of INTERFACE, and no output file.
. "$(dirname "$0")/lib.sh"
ball=$here/blobs/ball.obj
bake="$palp bake m.obj --as-is -o out.palp --young 1e4 --poisson 0.3"
held="--fix-below z -0.5"

: >m.obj
refuses 1 empty "empty OBJ" $bake $held
head -c 1500 "$ball" >m.obj
refuses 1 . "truncated OBJ" $bake $held
sed '3s/.*/v nan 0 1/' "$ball" >m.obj
refuses 1 "not a finite" "NaN coordinate" $bake $held
sed '3s/.*/v 1e999 0 1/' "$ball" >m.obj
refuses 1 "not a finite" "infinite coordinate" $bake $held
{ cat "$ball"; echo "f 1 2 999"; } >m.obj
refuses 1 "999 is out of range" "index out of range" $bake $held
{ cat "$ball"; echo "f 1 2 0"; } >m.obj
refuses 1 "0 is out of range" "index zero" $bake $held
sed '$d' "$ball" >m.obj
refuses 1 "open" "open mesh" $bake $held
{ cat "$ball"; echo "v 0 0 9"; set -- $(grep '^f' "$ball" | head -1); echo "f $2 $3 43"; } >m.obj
refuses 1 "non-manifold" "non-manifold edge" $bake $held
n=$(grep -c '^v' "$ball")
{ cat "$ball"; awk '/^v/ {print "v", $2 + 5, $3, $4}' "$ball"; awk -v n="$n" '/^f/{print "f", $2+n, $3+n, $4+n}' "$ball"; } >m.obj
refuses 1 "several components" "two components" $bake $held
{ cat "$ball"; echo "v 5 5 5"; } >m.obj
$bake $held 2> err.txt > /dev/null && grep -q "1 unused vertices left out" err.txt; ok $? "an unused vertex, as is, is left out and named: $(cat err.txt)"; rm -f out.palp
awk '/^v/{print "v", $2, $3, 0} /^f/' "$ball" >m.obj
$bake $held > /dev/null 2> err.txt; [ $? -eq 1 ] && grep -q "is flat" err.txt && [ ! -e out.palp ]; ok $? "flat mesh: $(tail -1 err.txt)"

printf 'ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 1\nproperty list float int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\nnan 0 1 2 0 1 2 0 1 2\n' >n.ply
refuses 1 "corners" "PLY face of NaN corners" $palp bake n.ply --as-is -o out.palp --young 1 --poisson 0.3 $held
printf 'ply\nformat ascii 1.0\nelement foo 18446744073709551615\nend_header\n' >n.ply
refuses 1 "no triangles" "PLY element without end" $palp bake n.ply --as-is -o out.palp --young 1 --poisson 0.3 $held

cp "$ball" m.obj
refuses 2 "no fixed node" "no fixed node: no option" $bake
refuses 1 "no node is fixed" "no fixed node: none selected" $bake --fix-below z -7
refuses 1 "all .* nodes are fixed" "all nodes fixed" $bake --fix-below z 7
printf '0\n1\n' >two.txt
refuses 1 "one line" "fixed nodes collinear" $bake --fix-nodes two.txt
printf '0\n99999\n' >bad.txt
refuses 2 "not a node" "fixed node out of range" $bake --fix-nodes bad.txt
refuses 2 "cannot read" "missing node list" $bake --fix-nodes nothing.txt
refuses 2 "out of range" "Poisson 0.5" $palp bake m.obj --as-is -o out.palp --young 1e4 --poisson 0.5 $held
refuses 2 "out of range" "Poisson -1" $palp bake m.obj --as-is -o out.palp --young 1e4 --poisson -1 $held
refuses 2 "out of range" "negative Young" $palp bake m.obj --as-is -o out.palp --young -5 --poisson 0.3 $held
refuses 2 "not a finite number" "Young that is no number" $palp bake m.obj --as-is -o out.palp --young stiff --poisson 0.3 $held
refuses 2 "out of range" "epsilon 2" $bake $held --epsilon 2
refuses 2 "out of range" "negative epsilon" $bake $held --epsilon -0.1
refuses 2 "not x, y or z" "bad axis" $bake --fix-below w 0
refuses 2 "unknown option" "unknown option" $bake $held --frobnicate
refuses 2 "needs 1 value" "missing value" $bake $held --epsilon
refuses 2 "no stiffness" "no Young" $palp bake m.obj --as-is -o out.palp --poisson 0.3 $held
refuses 2 "no output" "no output" $palp bake m.obj --as-is --young 1e4 --poisson 0.3 $held
refuses 2 "cannot read" "missing mesh" $palp bake nothing.obj --as-is -o out.palp --young 1e4 --poisson 0.3 $held
refuses 2 "unknown mesh format" "unknown format" $palp bake "$here/Makefile" --as-is -o out.palp --young 1e4 --poisson 0.3 $held
refuses 2 "cannot write" "unwritable output" $palp bake m.obj --as-is -o /nonexistent/out.palp --young 1e4 --poisson 0.3 $held
refuses 2 "unknown command" "unknown command" $palp brew

$palp bake m.obj --as-is -o good.palp --young 1e4 --poisson 0.3 $held >/dev/null 2>&1
ok $? "the ball itself bakes"
head -c 5000 good.palp >cut.palp
refuses 1 "truncated" "truncated blob" $palp info cut.palp
refuses 1 "not a Palp blob" "not a blob" $palp info m.obj
size=$(wc -c <good.palp)
for at in 0 9 40 70 300 $((size / 3)) $((size / 2)) $((size - 1)); do
    cp good.palp flip.palp
    byte=$(dd if=good.palp bs=1 skip=$at count=1 2>/dev/null | od -An -tu1 | tr -d ' ')
    printf "\\$(printf %o $(((byte + 1) % 256)))" | dd of=flip.palp bs=1 seek=$at conv=notrunc 2>/dev/null
    refuses 1 . "byte $at changed" $palp info flip.palp
done
set_csv() { printf 'node,kind,x,y,z\n%s\n' "$1" >set.csv; }
set_csv "9999,u,0,0,0"
refuses 2 "not a node" "solve: node out of range" $palp solve good.palp --set set.csv -o out.csv
set_csv "1,x,0,0,0"
refuses 2 "unknown kind" "solve: unknown kind" $palp solve good.palp --set set.csv -o out.csv
set_csv "1,u,0,0"
refuses 2 "needs 3" "solve: missing value" $palp solve good.palp --set set.csv -o out.csv
set_csv "1,u,inf,0,0"
refuses 2 "finite" "solve: infinite value" $palp solve good.palp --set set.csv -o out.csv
set_csv "1,free,,,"
refuses 2 "not fixed" "solve: released node that is free" $palp solve good.palp --set set.csv -o out.csv
printf 'node,kind,x,y,z\n1,f,1,0,0\n1,f,1,0,0\n' >set.csv
refuses 2 "already" "solve: a node twice" $palp solve good.palp --set set.csv -o out.csv
{ echo node,kind,x,y,z; awk '/^v/{if ($4 <= -0.5) print n",free,,,"; n++}' m.obj; } >all.csv
refuses 1 "no longer held" "solve: every fixed node released" $palp solve good.palp --set all.csv -o out.csv
echo "1,2,3" >set.csv
refuses 2 "header" "solve: no header" $palp solve good.palp --set set.csv -o out.csv
set_csv "1,f,1,0,0"
refuses 2 "not a constraint level" "solve: unknown level" $palp solve good.palp --set set.csv -o out.csv --level 7
refuses 2 "no device" "palpd: no device" $palpd good.palp --bus loop
refuses 2 "no device 'x'" "palpd: unknown device" $palpd good.palp --bus loop --device x
refuses 2 . "palpd: no such interface" $palpd good.palp --bus palp-none0 --device arm3
refuses 2 "not a free one of" "palpd: touching a node that is not there" $palpd good.palp --bus loop --device arm3 --touch 4242
if command -v python3 >/dev/null; then
    python3 "$here/tests/cli/pulled.py" good.palp pulled.palp
    refuses 1 "moves by .* against a push of 1 N" "palpd: a blob whose nodes are pulled" $palpd pulled.palp --bus loop --device arm3 --lockstep --seconds 1
else
    echo "# a blob whose nodes are pulled # SKIP python3 is not installed (make deps)"
fi
echo "0 0 0" >hand.txt
refuses 2 "four numbers" "palpd: bad hand script" $palpd good.palp --bus loop --device arm3 --hand hand.txt
printf "\\223NUMPY\\2\\0\\364\\377\\377\\377{'descr': '<f8', 'fortran_order': False, 'shape': (8, 8), }\\n" >wrap.npy
refuses 1 "the .npy header says 4294967284 bytes" "a .npy header longer than its file" $bake $held --compliance wrap.npy
awk '/^v/ {$2 += 30000} {print}' OFMT=%.12g CONVFMT=%.12g "$here/blobs/ball.obj" >far.obj
near="$palp bake $here/blobs/ball.obj --as-is -o near.palp --young 2e4 --poisson 0.45 --fix-below x -0.5" far="$palp bake far.obj --as-is -o far.palp --young 2e4 --poisson 0.45 --fix-below x 29999.5"
$near >/dev/null 2>&1; $far >/dev/null 2>err.txt; grep -q 'the body lies 3e+04 m from the origin: the blob has its own at (30000,' err.txt; ok $? "a body far from the origin: $(grep origin err.txt)"
for b in near far; do $palpd $b.palp --bus loop --device arm3 --seconds 3 --lockstep 2>/dev/null | sed -n 's/^largest force *//p' >$b.txt; done
[ -s near.txt ] && cmp -s near.txt far.txt; ok $? "it feels as it does at the origin: $(cat near.txt), $(cat far.txt)"
refuses 1 "far from the origin" "the same, filled" $palp bake far.obj -o far.palp --tets 100 --young 2e4 --poisson 0.45 --fix-below z -0.02
refuses 2 "needs 1 to 5 value(s)" "--tets without a number" $palp bake "$here/blobs/ball.obj" -o out.palp --tets --young 2e4 --poisson 0.45 --fix-below z -0.02
printf '1700000000.5 0 0 0.02\n1700000001 0 0 -0.004\n' >hand.txt
$palpd good.palp --bus loop --device arm3 --hand hand.txt --seconds 0.2 >/dev/null 2>err.txt && grep -q "for 1.7e+09 s, up to its first key" err.txt
ok $? "palpd: a hand script with the time of day is warned of"
sed 's/^mass.*/mass -1/' "$here/sim/devices/arm3.dev" >bad.dev
refuses 2 "out of range" "palpd: bad device file" $palpd good.palp --bus loop --device bad.dev
sed '/^mass/d' "$here/sim/devices/arm3.dev" >bad.dev
refuses 2 "'mass' is missing" "palpd: incomplete device file" $palpd good.palp --bus loop --device bad.dev
for bad in "upper 140" "force-max 1e8" "workspace 60" "slew-max 1e8" "mass 1000" "stiffness-max 1e8"; do
    printf 'like arm3\n%s\n' "$bad" >bad.dev
    refuses 2 "implausible for a device" "a device with $bad" $palp info --device bad.dev
done
printf 'like arm3\nworkspace 0.4\n' >odd.dev
$palp info --device odd.dev >out.txt 2>err.txt && grep -q "beyond the reach of 0.28 m" err.txt; ok $? "a workspace out of reach is warned of, with both figures"
printf 'like arm3\nforce-max 200\nslew-max 900000\n' >odd.dev
$palp info --device odd.dev >out.txt 2>err.txt && grep -q "motors make 25" err.txt && grep -q "limits nothing" err.txt; ok $? "and limits that limit nothing"
refuses 2 "inside palpd" "palp-sim: loop" $palp_sim --bus loop --device arm3
set_csv "1,f,1,0,0"
echo kept >real.csv; ln -s real.csv link.csv; $palp solve good.palp --set set.csv -o link.csv && [ -L link.csv ] && grep -q ux real.csv
ok $? "an output that is a symbolic link is written through it"
mkfifo pipe; cat pipe >got.txt & $palp solve good.palp --set set.csv -o pipe; wait
[ -p pipe ] && grep -q ux got.txt
ok $? "an output that is a pipe is written to, not replaced"
$palp bake m.obj --as-is -o - --young 1e4 --poisson 0.3 $held 2>/dev/null | cmp -s - good.palp
ok $? "a blob on standard output is nothing but the blob"
for program in "$palp" "$palp bake" "$palp remesh" "$palp subdivide" "$palp info" "$palp solve" "$palpd" "$palp_sim"; do
    $program --help >help.txt 2>&1 && grep -q usage help.txt
    ok $? "$(basename "$program") --help"
done
done_testing
