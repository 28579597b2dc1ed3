# SPDX-License-Identifier: MIT
# The Z-width study, of DEVICES (arm3): without the passivity controller the limit follows Colgate's line, with it nothing is unstable.
. "$(dirname "$0")/../cli/lib.sh"
# A wide flat face, since the study is of a wall: on a curved body (and near an edge) a tool without friction swings
# aside under a hand that hardly damps, and the servo does not stop that.
block 8 8 3 0.0075 slab.obj
$palp bake slab.obj --as-is -o stiff.palp --young 1e9 --poisson 0.45 --fix-below z 1e-6 >/dev/null 2>&1
for device in ${DEVICES:-arm3}; do # make soak takes all
    $palp zwidth stiff.palp --device $device -o $device >$device.txt 2>&1
    ok $? "$device: $(tail -1 $device.txt | sed 's/; see.*//')"
done
awk -F, 'NR>1{n++; if($4<0.97*$5) below++; if($4>3.5*$5) above++} END{exit !(n==30 && below+above==0)}' arm3/zwidth.csv
ok $? "arm3: the largest stable stiffness without it lies at 1 to 3.5 times Colgate's line in 30 of 30 settings"
awk -F, 'NR>1{k=$2","$3; if((k in last) && $4<=last[k]) bad++; last[k]=$4} END{exit bad>0}' arm3/zwidth.csv
ok $? "and grows with the rate"
grep -q '<svg' arm3/zwidth.svg; ok $? "plotted"
mkdir -p "$here/$BUILD/zwidth" && cp arm3/zwidth.* "$here/$BUILD/zwidth/"
done_testing
