# SPDX-License-Identifier: MIT
# Multizone models from the command line: cutting, matching, posing, and every bad model.
. "$(dirname "$0")/lib.sh"

# model NAME LINES...: a model file of these lines behind the common ones
model() {
    name=$1
    shift
    printf 'young 1e5\npoisson 0.3\nepsilon 0\n' > "$name"
    for line in "$@"; do echo "$line" >> "$name"; done
}
bar 2 bar.obj
cut="zone a|fix-below x 1e-6|zone b|zone c|cut a b 0.02 0 0 1 0 0|cut b c 0.04 0 0 1 0 0|joint ab revolute a b|origin 0.02 0.01 0.01|limits -1 1|joint bc revolute b c|origin 0.04 0.01 0.01"
split() { echo "$1" | tr '|' '\n'; }
with() { printf 'young 1e5\npoisson 0.3\nepsilon 0\nmesh bar.obj\nas-is\n' > "$1"; split "$2" >> "$1"; }

with chain.model "$cut"
$palp bake chain.model -o chain.palp --save-mesh part.obj > bake.txt 2>/dev/null
ok $? "a chain is baked: $(grep '^seam' bake.txt | head -1)"
$palp solve chain.palp --joint ab 0 -o rest.csv && awk -F, 'NR > 1 && !/^#/ && ($2 != 0 || $3 != 0 || $4 != 0) {bad = 1} END {exit bad}' rest.csv
ok $? "at rest without load every displacement is exactly zero"
printf 'node,kind,x,y,z\nc:3,f,0,0,-0.05\n' > load.csv
$palp solve chain.palp --set load.csv --joint ab 0.4 -o a.csv && $palp solve chain.palp --set load.csv --joint ab 0.4 --joint bc 0 -o b.csv && cmp -s a.csv b.csv
ok $? "a joint without a value stands at zero"
number=$(awk -F'[ =]' '/^# zone=c/ {print $5}' a.csv)
printf 'node,kind,x,y,z\n%d,f,0,0,-0.05\n' $((number + 3)) > load.csv
$palp solve chain.palp --set load.csv --joint ab 0.4 -o b.csv && cmp -s a.csv b.csv
ok $? "ZONE:NODE and the number through all zones are the same node"
inner=$(awk '/^v / {if ($2 > 0.025 && $2 < 0.035) {print n + 0; exit} n++}' part-b.obj)
printf 'node,kind,x,y,z\nc:3,u,0.001,0,-0.002\nb:%d,n,-0.0005,,\n' "$inner" > given.csv
$palp solve chain.palp --set given.csv --joint bc 0.3 -o u.csv &&
    awk -F, -v n=$((number + 3)) '$1 == n {d = ($2 - 0.001)^2 + $3^2 + ($4 + 0.002)^2; ok = d < 1e-16} END {exit !ok}' u.csv
ok $? "prescribed displacements are met across the chain"
$palp info chain.palp --json > info.json && grep -q '"joints": \[{"name": "ab", "kind": "revolute"' info.json
ok $? "palp info describes joints and seams"
# the same chain from its own pieces
model pieces.model "zone a" "mesh part-a.obj" "fix-below x 1e-6" "zone b" "mesh part-b.obj" "zone c" "mesh part-c.obj" "seam a b" "seam b c" \
    "joint ab revolute a b" "origin 0.02 0.01 0.01" "joint bc revolute b c" "origin 0.04 0.01 0.01"
$palp bake pieces.model -o pieces.palp >/dev/null 2>&1 && $palp solve pieces.palp --joint ab 0.4 -o p.csv && $palp solve chain.palp --joint ab 0.4 -o q.csv &&
    awk -F, 'FNR > 1 && !/^#/ {if (NR == FNR) u[$1] = $4; else if (($4 - u[$1])^2 > 1e-14) bad = 1} END {exit bad}' p.csv q.csv
ok $? "separate meshes with matching seams give the same model"
awk '/^f/ {x = 0; for (k = 2; k <= 4; k++) {split($k, i, "/"); x += v[i[1]] / 3}; print x < 0.02 ? "a" : x < 0.04 ? "b" : "c"} /^v / {v[++n] = $2}' bar.obj > labels.txt
with labels.model "$(echo "$cut" | sed 's/|cut [^|]*//g')|labels labels.txt"
$palp bake labels.model -o labels.palp >/dev/null 2>&1 && $palp solve labels.palp --joint ab 0.4 -o p.csv &&
    awk -F, 'FNR > 1 && !/^#/ {if (NR == FNR) u[$1] = $4; else if (($4 - u[$1])^2 > 1e-14) bad = 1} END {exit bad}' p.csv q.csv
ok $? "labels cut like planes"

bake() { $palp bake "$1" -o out.palp; }
bad() { # bad PATTERN NAME LINES
    with bad.model "$3"
    refuses "${4:-2}" "$1" "$2" bake bad.model
}
bad "no zone named 'x'" "a cut of an unknown zone" "zone a|zone b|cut a x 0.02 0 0 1 0 0"
bad "no zone named 'q'" "a joint to an unknown zone" "zone a|zone b|joint j revolute a q"
bad "not one of: fixed" "an unknown kind of joint" "zone a|zone b|joint j ball a b"
bad "already hangs on joint 'ab'" "a second joint for one zone" "$cut|joint again revolute a b"
bad "run in a circle" "joints in a circle" "$(echo "$cut" | sed 's/joint ab revolute a b/joint ab revolute c b/')|joint r revolute b a" 2
bad "no joint carries zone" "a zone without a joint" "$(echo "$cut" | sed 's/|joint bc.*//')"
bad "leaves out 0" "limits without the rest configuration" "$cut|limits 0.1 0.5"
bad "the axis is zero" "a zero axis" "$cut|axis 0 0 0"
bad "all of the zone lies behind" "a cut that meets nothing" "$(echo "$cut" | sed 's/0.04 0 0 1/0.4 0 0 1/')" 1
bad "nothing holds zone" "no bone anywhere" "$(echo "$cut" | sed 's/|fix-below x 1e-6//')" 1
bad "cuts must not touch\|three zones" "cuts that cross" "$(echo "$cut" | sed 's/cut b c 0.04 0 0 1 0 0/cut b c 0.03 0.01 0.01 0 1 0/')" 1
bad "zone 'a' already" "a zone twice" "zone a|zone a" 2
bad "says nothing of reactions" "a compliance matrix for zones" "compliance x.npy|$cut"
bad "letters, digits" "a name that no file can have" 'zone a"b|zone c' 2
bad "between -10000" "limits without sense" "$cut|limits -20000 1"
bad "off one line" "one bone node" "$(echo "$cut" | sed 's/fix-below x 1e-6/fix-box -1 -1 -1 1e-6 1e-6 1e-6/')" 1
printf 'a\nb\n' > labels.txt
bad "2 labels for 112" "too few labels" "$(echo "$cut" | sed 's/|cut [^|]*//g')|labels labels.txt"
printf 'a\nz\n' > labels.txt
bad "no zone named 'z'" "a label of an unknown zone" "$(echo "$cut" | sed 's/|cut [^|]*//g')|labels labels.txt"

pieces="zone a|mesh part-a.obj|fix-below x 1e-6|zone b|mesh part-b.obj|joint ab fixed a b"
loose() { printf 'young 1e5\npoisson 0.3\n' > bad.model; split "$2" >> bad.model; refuses 2 "$1" "$3" bake bad.model; }
seq 0 8 > na.txt
seq 0 7 > nb.txt
loose "different lengths, 9 nodes of 'a' and 8 of 'b'" "$pieces|seam a b na.txt nb.txt" "seam lists of different length"
awk '/^v / {n++; if ($2 > 0.0199999) print n - 1}' part-a.obj > na.txt
awk '/^v / {n++; if ($2 < 0.0200001) print n - 1, $3, $4}' part-b.obj > places.txt
awk 'NR == FNR {x[$1] = $2 "," $3; k[NR] = $1; m = NR; next} {n = 0} /^v / {v++; p[v - 1] = $3 "," $4} END {while ((getline i < "na.txt") > 0) for (j = 1; j <= m; j++) if (x[k[j]] == p[i]) print k[j]}' places.txt part-a.obj > nb.txt
printf 'young 1e5\npoisson 0.3\n' > good.model
split "$pieces|seam a b na.txt nb.txt" >> good.model
$palp bake good.model -o good.palp >/dev/null 2>&1
ok $? "seam lists in the same order are taken"
{ sed -n 2p nb.txt; sed -n 1p nb.txt; sed 1,2d nb.txt; } > turned.txt
loose "lie .* m apart: the lists must have the same order" "$pieces|seam a b na.txt turned.txt" "seam lists in another order"
{ sed -n 1p na.txt; sed 1d na.txt | sed '$d'; sed -n 1p na.txt; } > twice.txt
loose "" "$pieces|seam a b twice.txt nb.txt" "a node listed twice"
# one diagonal of the seam turned
awk '/^v / {x[++n] = $2} /^f/ {split($2, a, "/"); split($3, b, "/"); split($4, c, "/"); on = x[a[1]] < 0.0200001 && x[b[1]] < 0.0200001 && x[c[1]] < 0.0200001
     if (on) {key1 = 0; for (e = 1; e <= m && !done; e++) {split(f[e], t, " "); s = 0; for (i = 1; i <= 3; i++) s += (t[i] == a[1]) + (t[i] == b[1]) + (t[i] == c[1])
        if (s == 2) { # flip the edge they share
            v[1] = a[1]; v[2] = b[1]; v[3] = c[1]
            for (i = 1; i <= 3; i++) {o = 0; for (k = 1; k <= 3; k++) o += t[k] == v[i]; if (!o) {p = v[i]; q = v[i % 3 + 1]; r = v[(i + 1) % 3 + 1]}}
            for (k = 1; k <= 3; k++) if (t[k] != q && t[k] != r) w = t[k]
            f[e] = p " " q " " w; line[at[e]] = "f " f[e]; line[NR] = "f " p " " w " " r; done = 1; break}}
        if (!done) {f[++m] = a[1] " " b[1] " " c[1]; at[m] = NR}}}
     {if (!(NR in line)) line[NR] = $0} END {for (i = 1; i <= NR; i++) print line[i]}' part-b.obj > part-t.obj
loose "has not: both sides need the same triangles" "$(echo "$pieces" | sed 's/part-b/part-t/')|seam a b" "a seam triangulated differently"
loose "have 0 node(s) in common" "$(echo "$pieces" | sed 's/mesh part-b.obj/mesh part-b.obj|frame 0.5 0 0 0 0 0/')|seam a b" "zones that do not meet"

refuses 2 "1.2 is out of its range, -1 to 1 rad" "a joint value out of range" $palp solve chain.palp --joint ab 1.2
refuses 2 "no joint named 'elbow' (there are: ab, bc)" "an unknown joint" $palp solve chain.palp --joint elbow 0
refuses 2 "not a seam level" "an unknown level" $palp solve chain.palp --joint ab 0 --level 9
printf 'node,kind,x,y,z\nd:3,f,0,0,1\n' > set.csv
refuses 2 "'d:3' is not a node" "a node of an unknown zone" $palp solve chain.palp --set set.csv
printf 'node,kind,x,y,z\na:0,u,0,0,0\n' > set.csv
refuses 2 "held by a bone or a seam" "a condition on a held node" $palp solve chain.palp --set set.csv
refuses 2 "one body has no joints" "joints of one body" sh -c "$palp bake bar.obj --as-is -o one.palp --young 1e5 --poisson 0.3 --fix-below x 1e-6 >/dev/null 2>&1; $palp solve one.palp --joint ab 0"
refuses 1 "a multizone model, where one body is needed" "packing a multizone model" $palp pack chain.palp -o out.pack
head -c 100000 chain.palp > cut.palp
refuses 1 "bake it again" "a truncated model" $palp solve cut.palp --joint ab 0
# a closed loop: a ring is left open by one joint alone
awk 'BEGIN {n = 2; h = 0.02 / n
    split("0 0,1 0,2 0,2 1,2 2,1 2,0 2,0 1", c, ",")
    for (i = 1; i <= 8; i++) {split(c[i], q, " "); cube[q[1] "," q[2] ",0"] = i; X[i] = q[1]; Y[i] = q[2]}
    for (i = 1; i <= 8; i++) for (a = 0; a < 3; a++) for (s = 0; s < 2; s++) {
        o[0] = X[i]; o[1] = Y[i]; o[2] = 0; o[a] += s ? 1 : -1
        if ((o[0] "," o[1] "," o[2]) in cube) continue
        b = (a + 1) % 3; d = (a + 2) % 3
        for (u = 0; u < n; u++) for (w = 0; w < n; w++) {
            for (k = 0; k < 4; k++) {
                p[0] = X[i] * n; p[1] = Y[i] * n; p[2] = 0
                p[a] += s * n; p[b] += u + (k == 1 || k == 2); p[d] += w + (k >= 2)
                key = p[0] "," p[1] "," p[2]
                if (!(key in id)) {id[key] = ++m; printf "v %.9g %.9g %.9g\n", p[0] * h, p[1] * h, p[2] * h}
                t[s ? k : 3 - k] = id[key]}
            f = f "f " t[0] " " t[1] " " t[2] "\nf " t[0] " " t[2] " " t[3] "\n"
            z = substr("aabbccdd", i, 1); print z > "ring.txt"; print z > "ring.txt"}}
    printf "%s", f}' > ring.obj
printf 'young 1e5\npoisson 0.3\nmesh ring.obj\nas-is\nlabels ring.txt\nzone a\nfix-below y 1e-6\nzone b\nzone c\nzone d\n' > ring.model
printf 'joint ab revolute a b\norigin 0.04 0.01 0.01\njoint bc revolute b c\norigin 0.05 0.04 0.01\njoint cd revolute c d\norigin 0.02 0.05 0.01\n' >> ring.model
sed 's/^labels ring.txt$//; s/^zone d$/zone d\nlabels ring.txt/' ring.model > ring2.model
printf 'joint da revolute d a\norigin 0.01 0.02 0.01\n' | cat ring2.model - > cycle.model
refuses 2 "run in a circle" "a loop of joints without a closure" bake cycle.model
printf 'closure da revolute d a\norigin 0.01 0.02 0.01\n' | cat ring2.model - > ring3.model
$palp bake ring3.model -o ring.palp >/dev/null 2>&1
ok $? "a loop with its closure is baked"
refuses 1 "leave a loop open" "joint values that open a loop" $palp solve ring.palp --joint ab 0.1
refuses 2 "its value follows from the others" "a value for a closure" $palp solve ring.palp --joint da 0.1

# scenes
$palp bake chain.model -o bare.palp --modes 0 > /dev/null 2>&1
printf 'seconds 0.1\nprobe 0.004\ntouch 0 0.05 0.01 0.05\n' > probe.scene
refuses 1 "has no regular part" "playing a model that was baked without contact" $palp play bare.palp --scene probe.scene --ns-per-operation 0.25
printf 'seconds 0.2\npose 0 ab 0\npose 0.1 ab 0.3\ncylinder 0.006 0.02 0 1 0\nobject 0 0.05 0.01 0.05\nobject 0.15 0.05 0.01 0.025\n' > ok.scene
$palp play chain.palp --scene ok.scene --ns-per-operation 0.25 --report play.html -o play.csv > play.txt && grep -q '"series": \[' play.html && [ "$(wc -l < play.csv)" -eq 201 ] && grep -q ', 0 late' play.txt
ok $? "palp play: $(head -1 play.txt)"
$palp play chain.palp --scene ok.scene --ns-per-operation 0.25 -o again.csv > /dev/null && cut -d, -f1-14 play.csv > one.txt && cut -d, -f1-14 again.csv | cmp -s - one.txt
ok $? "by the clock of the work done a scene repeats to the digit"
{ cat ok.scene; echo 'gravity 0 0 -9.81'; } > heavy.scene
$palp play chain.palp --scene heavy.scene --ns-per-operation 0.25 -o heavy.csv > /dev/null && cut -d, -f9-11 play.csv > light.txt && ! cut -d, -f9-11 heavy.csv | cmp -s - light.txt
ok $? "a scene with gravity"
scene() { printf "$2" > bad.scene; refuses 2 "$1" "$3" $palp play chain.palp --scene bad.scene --ns-per-operation 0.25 -o out.csv; }
scene "no joint named 'x'" 'pose 0 x 0\n' "a scene with an unknown joint"
scene "out of its range" 'pose 0 ab 3\n' "a scene that leaves a joint's range"
scene "not behind the one before" 'pose 1 ab 0\npose 1 ab 0.1\n' "times that do not ascend"
scene "need a 'cylinder' line" 'object 0 0 0 0\n' "an object without a shape"
refuses 1 "neither a multizone model nor a dynamic body" "playing one body" $palp play one.palp --scene ok.scene --ns-per-operation 0.25
refuses 1 "the least answer may take" "a budget that nothing fits" $palp play chain.palp --scene ok.scene --ns-per-operation 0.25 --budget-us 5 -o out.csv
done_testing
