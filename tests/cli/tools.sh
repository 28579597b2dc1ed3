# SPDX-License-Identifier: MIT
# Rigid tools: palp tool on meshes as they come, palpd with them on devices with and without a wrist, logs, wrong input.
. "$(dirname "$0")/lib.sh"
small_body body.palp

# a box, a needle along z with its tip at the origin, two boxes that cross; faces outward
python3 - <<'PYTHON'
import math
def write(name, v, f):
    open(name, 'w').write(''.join('v %.9g %.9g %.9g\n' % p for p in v) + ''.join('f %d %d %d\n' % t for t in f))
def box(low, high, first=0):
    v = [tuple((low, high)[k >> a & 1][a] for a in range(3)) for k in range(8)]
    f = [(1,3,4),(1,4,2),(5,6,8),(5,8,7),(1,2,6),(1,6,5),(3,7,8),(3,8,4),(1,5,7),(1,7,3),(2,4,8),(2,8,6)]
    return v, [tuple(i + first for i in t) for t in f]
write('box.obj', *box((-.01, -.01, -.01), (.01, .01, .01)))
write('blade.obj', *box((-.006, -.0002, 0), (.006, .0002, .05)))
v, f = box((-.01, -.01, -.01), (.01, .01, .01))
w, g = box((0, -.004, -.004), (.03, .004, .004), 8)
write('cross.obj', v + w, f + g)
n, L, R = 32, .1, .002
v = [(0, 0, 0)] + [(R * math.cos(2 * math.pi * i / n), R * math.sin(2 * math.pi * i / n), z) for z in (.02, L) for i in range(n)] + [(0, 0, L)]
f = []
for i in range(n):
    j = (i + 1) % n
    f += [(1, 2 + j, 2 + i), (2 + i, 2 + j, 2 + n + j), (2 + i, 2 + n + j, 2 + n + i), (2 + 2 * n, 2 + n + i, 2 + n + j)]
write('needle.obj', v, f)
write('open.obj', v[:-1], [t for k, t in enumerate(f) if k % 4 < 3]) # without its end
PYTHON
off() { sed -n 's/^distance .*(\([0-9.e-]*\) % of the diagonal).*/\1/p' "$1"; }
for m in box blade needle cross; do
    $palp tool $m.obj -o $m.tool > $m.txt 2> $m.err; status=$?
    bytes=$(stat -c %s $m.tool)
    awk -v o="$(off $m.txt)" -v b="$bytes" 'BEGIN {exit !(o > 0 && o <= 0.5 && b <= 1000000)}' || status=1
    ok $status "$m: off by $(off $m.txt) % of its diagonal at most, $bytes bytes"
done
grep -q '2 components, all of them the tool' cross.err; ok $? "components that cross are one tool"
$palp tool needle.obj -o again.tool --threads 1 > /dev/null 2>&1 && cmp -s needle.tool again.tool; ok $? "the same bytes on one thread"
refuses 2 "ball.obj" "no such mesh" $palp tool ball.obj -o x.tool
$palp tool box.obj -o round.tool --radius 0.002 > round.txt 2>&1 && grep -q '^radius *2 mm' round.txt; ok $? "--radius: $(grep ^radius round.txt)"
$palp tool box.obj -o coarse.tool --cells 8 > coarse.txt 2>&1; grep -q '^field *1[0-9] x' coarse.txt; ok $? "--cells 8: $(grep ^field coarse.txt)"
$palp tool box.obj -o inch.tool --units inch 2> /dev/null | grep -q '^tool *0.0508 x'; ok $? "--units"
refuses 1 "open at edge" "a surface that is open" $palp tool open.obj -o x.tool --holes 1e-6
refuses 2 "no output" "no output named" $palp tool box.obj
refuses 2 "8 to 1000" "cells below 8" $palp tool box.obj -o x.tool --cells 2
refuses 2 "reference" "a reference of two numbers" $palp tool box.obj -o x.tool --reference 1 2
[ ! -e x.tool ]; ok $? "and nothing is left behind"
$palp tool box.obj -o far.tool --reference 1 0 0 2>&1 | grep -q 'beside the mesh'; ok $? "a reference point far from the mesh is warned of"

# ---- felt ----
printf '0 0 0 0.02\n0.8 0 0 0.002\n1.2 0 0 -0.004\n1.8 0 0 -0.004 15 10 40\n2.4 0.002 0 -0.005 0 0 0\n3 0 0 0.01\n' > turn.txt
feel() { $palpd body.palp --bus loop --no-wait --seconds 3 --hand turn.txt "$@"; }
for device in arm3 arm6-palp-fd arm7-palp-fd; do
    for tool in box needle blade; do
        feel --device $device --rate 500 --tool $tool.tool --log $device-$tool.log > out.txt 2> /dev/null; status=$?
        said=$($palp replay $device-$tool.log body.palp --tool $tool.tool 2>&1) || status=1
        grep -q '^largest force *0.000' out.txt && status=1
        ok $status "$device, $tool: $(sed -n 's/^largest force *//p' out.txt); $said"
    done
done
feel --device arm6-palp-fd > out.txt 2>&1; ok $? "a ball on a device with a wrist"
refuses 2 "add --tool" "replay without the tool" $palp replay arm3-box.log body.palp
refuses 1 "is not the tool of this session" "replay with another tool" $palp replay arm3-box.log body.palp --tool needle.tool
feel --device arm3 --tool-radius 0.02 2> /dev/null | grep -q 'tool radius 0.02 m'; ok $? "--tool-radius"
refuses 2 "not both" "a tool and a radius" feel --device arm3 --tool box.tool --tool-radius 0.01
feel --device arm3 --place 0 0 1 2> /dev/null | grep -q 'at node'; ok $? "--place"
refuses 2 "by one of them" "--place and --touch" feel --device arm3 --place 0 0 1 --touch 3
refuses 1 "not a tool: make one" "a mesh where a tool should be" feel --device arm3 --tool box.obj
refuses 1 "a blob, but not a tool" "a body where a tool should be" feel --device arm3 --tool body.palp
head -c 5000 box.tool > short.tool; refuses 1 "bake it again" "a tool cut short" feel --device arm3 --tool short.tool
cp box.tool bad.tool; printf '\001' | dd of=bad.tool bs=1 seek=4000 conv=notrunc 2> /dev/null; refuses 1 "bake it again" "a tool with a wrong byte" feel --device arm3 --tool bad.tool
printf '0 0 0 0.02 1\n' > five.txt; refuses 2 "or seven with a turn" "a hand with half a turn" $palpd body.palp --bus loop --device arm6-palp-fd --hand five.txt --seconds 1

# ---- device files ----
dev() { printf 'like arm3-palp-fd\n%b' "$1" > wrist.dev; shift; feel --device wrist.dev "$@"; }
six='gear 10 10 10 1 1 1\nnode 1 2 3 4 5 6\njoint-min -80 -60 -60 -170 -85 -170\njoint-max 80 100 100 170 85 170\n'
refuses 2 "needs 6 values" "a wrist whose gears are missing" dev 'wrist gimbal\nmotors 1 1 1 0 0 0\n'
refuses 2 "moment-max" "a wrist with motors and no largest moment" dev "wrist gimbal\n$six"
refuses 2 "only wrist and gripper can do without" "an arm without a motor" dev "wrist gimbal\n${six}motors 1 0 1 0 0 0\n"
dev "wrist gimbal\n${six}motors 1 1 1 0 0 1\nmoment-max 0.2\nturn-stiffness-max 1\nturn-damping-max 0.002\n" --tool box.tool > out.txt 2>&1; ok $? "a wrist with one motor of three"
done_testing
