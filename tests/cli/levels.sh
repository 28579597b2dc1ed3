# SPDX-License-Identifier: MIT
# Constraint levels, wavelets and transport on the command line.
. "$(dirname "$0")/lib.sh"
held="--young 1e4 --poisson 0.3 --fix-below z -0.5"
$palp subdivide "$here/blobs/ball.obj" -o ball.obj --levels 1 >/dev/null 2>&1
bake() { $palp bake ball.obj --as-is $held "$@" >log.txt 2>err.txt || { cat err.txt; return 1; }; }
json() { $palp info "$1" --json | python3 -c "import json,sys; d=json.load(sys.stdin); print($2)"; }
total() { awk -F, '/^[0-9]/{x+=$5; y+=$6; z+=$7} END{printf "%.6g %.6g %.6g", x, y, z}' "$1"; }
have_python=$(command -v python3)

bake -o full.palp && bake -o coarse.palp --constraint-level 1 --table-mb 8 && bake -o zero.palp --epsilon 0 &&
    bake -o zero1.palp --epsilon 0 --constraint-level 1 --reciprocity raw && bake -o zeroraw.palp --epsilon 0 --reciprocity raw
ok $? "bakes with all levels and with coarse ones only"
if [ -n "$have_python" ]; then
    [ "$(json full.palp '[l["level"] for l in d["constraint_levels"]], d["levels"]')" = "[0, 1, 2] 3" ]
    ok $? "palp info lists every constraint level"
    [ "$(json coarse.palp '[l["level"] for l in d["constraint_levels"]], all(l["table_bytes"]>0 for l in d["constraint_levels"])')" = "[0, 1] True" ]
    ok $? "and of a coarse bake only those that it has, with their tables"
else
    ok 0 "palp info --json # SKIP no python3"
fi
# nodes of level 1 (the first of the mesh, which are coarse to fine) near the top, pushed down
{ echo node,kind,x,y,z; awk '/^v/{if ($4 > 0.75) print n",u,0,0,-0.01"; n++}' ball.obj; } >push.csv
for level in 0 1 2 finest auto; do
    $palp solve zero.palp --set push.csv --level $level -o out.$level.csv 2>err.txt
    ok $? "solve --level $level: $(tail -1 out.$level.csv) $(cat err.txt)"
done
tail -1 out.1.csv | grep -q "level=1 " && tail -1 out.finest.csv | grep -q "level=2 "
ok $? "the level that was used is said"
awk -F, 'FNR==1{f++} f>=1 && /^[0-9]/ && !($2==0 && $3==0 && $4==0) {if (f==1) a+=$7; else b+=$7}
    END{r=b/a; printf "%.4g N and %.4g N", a, b; exit !(r>0.8 && r<1.25)}' out.finest.csv out.1.csv >forces.txt
ok $? "the force on level 1 is near that on the finest: $(cat forces.txt)"
# a coarse bake answers as the same level of a full one does: hierarchical GFs from the solver and by refinement
$palp solve zeroraw.palp --set push.csv --level 1 -o a.csv && $palp solve zero1.palp --set push.csv --level 1 -o b.csv 2>err.txt
status=$?
grep -q "away from its displaced" err.txt && { # only the level's own nodes
    n=$($palp info zero1.palp | sed -n 's/.*1: \([0-9]*\) nodes.*/\1/p' | head -1)
    awk -F, 'NR==1 || $1 < 42' push.csv >own.csv
    $palp solve zeroraw.palp --set own.csv --level 1 -o a.csv && $palp solve zero1.palp --set own.csv --level 1 -o b.csv
    status=$?
}
[ $status -eq 0 ] && paste -d, a.csv b.csv | awk -F, '/^[0-9]/{for(k=2;k<5;k++){d=$k-$(k+7); if(d<0)d=-d; if(d>m)m=d; v=$k<0?-$k:$k; if(v>s)s=v}} END{exit !(m<1e-5*s)}'
ok $? "Green's functions of a level straight from the solver equal those by refinement"
$palp solve full.palp --set push.csv --level 1 --pairing collocated -o out.c.csv
ok $? "solve --pairing collocated"
for wavelet in "" "--epsilon 0.01" "--form wavelet" "--wavelet butterfly" "--wavelet butterfly --unlifted" "--unlifted" "--threshold global" "--storage f16"; do
    bake -o w.palp $wavelet && $palp solve w.palp --set push.csv -o w.csv
    ok $? "bake $wavelet: $(sed -n 's/^compression *//p' log.txt)"
    paste -d, out.finest.csv w.csv | awk -F, '/^[0-9]/{d=$4-$11; if(d<0)d=-d; if(d>m)m=d} END{exit !(m<0.0015)}'
    ok $? "and answers like the uncompressed blob"
done
[ -n "$have_python" ] && bake -o w.palp --wavelet butterfly && [ "$(json w.palp 'd["wavelet"], d["form"]')" = "butterfly wavelet" ]
ok $? "palp info names the wavelet"
[ -n "$have_python" ] && [ "$(json full.palp 'd["form"], d["storage"], d["rms_error"] < 0.03')" = "split f16 True" ]
ok $? "and the form, split unless an option is for the paper's columns"
$palp bake ball.obj --as-is $held -o w2.palp --form split --unlifted > /dev/null 2> err.txt
[ $? -eq 2 ] && grep -q -- "--unlifted" err.txt && [ ! -e w2.palp ]
ok $? "split form with the paper's options is refused: $(cat err.txt)"
# gravity, a fixed node displaced, another let go, in both forms
{ echo node,kind,x,y,z; awk '/^v/{if ($4 < -0.8 && f < 2) {f++; print f==1 ? n",u,0.01,0,0.005" : n",free,,,"} else if ($4 > 0.9) print n",f,0,30,-20"; n++}' ball.obj; } >mixed.csv
bake -o wavelet.palp --epsilon 0 && for form in wavelet full; do $palp solve $form.palp --set mixed.csv --gravity 0 1 -9.81 -o m.$form.csv || break; done
paste -d, m.wavelet.csv m.full.csv | awk -F, '/^[0-9]/{for(k=2;k<8;k++){d=$k-$(k+7); e[k>4]+=d*d; n[k>4]+=$k*$k}}
    END{printf "displacements within %.2g %%, forces %.2g %%", 100*sqrt(e[0]/n[0]), 100*sqrt(e[1]/n[1]); exit !(n[0]>0 && e[0]<4e-4*n[0] && e[1]<4e-4*n[1])}' >both.txt
ok $? "a problem of every kind answered from both forms: $(cat both.txt)"
$palp pack full.palp -o full.pack >pack.txt && $palp unpack full.pack -o back.palp >/dev/null && $palp solve back.palp --set push.csv -o p.csv
ok $? "pack, unpack, solve: $(cat pack.txt)"
paste -d, out.finest.csv p.csv | awk -F, '/^[0-9]/{d=$4-$11; if(d<0)d=-d; if(d>m)m=d} END{exit !(m<0.0015)}'
ok $? "and the answer is that of the blob"
$palp pack back.palp -o - 2>/dev/null | $palp unpack - -o again.palp >/dev/null && $palp info again.palp >/dev/null
ok $? "through a pipe"
bake -o h.palp --storage f16 && $palp pack h.palp -o h.pack >/dev/null && $palp unpack h.pack -o h2.palp >/dev/null && $palp info h2.palp | grep -q f16
ok $? "half storage goes through too"
head -c 4000 full.pack >cut.pack
refuses 1 "damaged or cut short" "unpack: cut short" $palp unpack cut.pack -o out.palp
{ head -c 5000 full.pack; printf x; tail -c +5002 full.pack; } >bad.pack
refuses 1 "damaged" "unpack: a byte changed" $palp unpack bad.pack -o out.palp
if [ -n "$have_python" ]; then
    python3 - << 'END'
import struct
table = [i for i in range(256)]
for i in range(256):
    for _ in range(8):
        table[i] = table[i] >> 1 ^ (0x82f63b78 if table[i] & 1 else 0)
data = b"PALPPACK" + struct.pack("<IIQdd", 1, 1, 1 << 32, 1e-3, 0.01) + struct.pack("<IIQQ", 1, 4096, 1 << 20, 0)
crc = 0xffffffff
for b in data:
    crc = crc >> 8 ^ table[(crc ^ b) & 255]
open("bomb.pack", "wb").write(data + struct.pack("<I", crc ^ 0xffffffff))
END
    refuses 1 "an unsound section" "unpack: 4 GiB out of 68 bytes" timeout 5 $palp unpack bomb.pack -o out.palp
else
    ok 0 "unpack: 4 GiB out of 68 bytes # SKIP no python3"
fi
refuses 1 "not a packed blob" "unpack: not packed at all" $palp unpack full.palp -o out.palp
refuses 2 "no output" "pack: no output" $palp pack full.palp
refuses 2 "out of range" "pack: an error of 2" $palp pack full.palp -o out.x --error 2
refuses 2 "has the levels 0 to 2" "bake: a constraint level that is not there" $palp bake ball.obj --as-is $held -o out.palp --constraint-level 3
refuses 2 "not a constraint level" "solve: a level that the blob does not hold" $palp solve coarse.palp --set push.csv --level 2 -o out.csv
refuses 2 "no mesh or blob" "study: nothing to study" $palp study
refuses 2 "two models" "reproduce: one model" $palp reproduce x.model
$palp study ball.obj full.palp -o study >study.txt 2>err.txt && [ -s study/study.csv ] && [ -s study/index.html ] && [ -s study/ball-compression.svg ]
ok $? "palp study: $(sed -n 1p study.txt) $(grep -v ' s$' err.txt | head -1)"
$palpd full.palp --bus loop --device arm3 --seconds 2 --no-wait >/dev/null 2>err.txt && $palpd coarse.palp --bus loop --device arm3 --seconds 2 --no-wait >/dev/null 2>>err.txt
ok $? "both kinds of blob are felt $(cat err.txt | head -1)"
for program in "$palp study" "$palp reproduce" "$palp pack" "$palp unpack"; do
    $program --help >help.txt 2>&1 && grep -q usage help.txt
    ok $? "$(basename "$program") --help"
done
done_testing
