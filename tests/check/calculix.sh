# SPDX-License-Identifier: MIT
# A cantilever's sag under a small load and its first frequency against CalculiX on the same tetrahedra.
. "$(dirname "$0")/../cli/lib.sh"
if ! command -v ccx >/dev/null; then
    echo "ok 1 - a cantilever against CalculiX # SKIP no ccx (calculix-ccx)"
    echo "1..1"
    exit 0
fi
bar 4 bar.obj # 60 x 20 x 20 mm
cat > sag.scene <<E
seconds 4
rate 4000
gravity 0 0 -0.1
E
cat > swing.scene <<E
seconds 1
rate 4000
gravity 0 0 -0.1
E
for nodes in 120 600 3000; do
    printf 'mesh bar.obj\nyoung 2e4\npoisson 0.3\ndensity 1000\ntets %d\nfix-below x 1e-6\n' $nodes > c.model
    "$palp" bake c.model -o c.palp --save-mesh c.mesh > bake.txt 2>/dev/null || ok 1 "bake"
    mv c-0.mesh c$nodes.mesh 2>/dev/null || mv c.mesh c$nodes.mesh
    "$palp" play c.palp --scene sag.scene --drag 40 --budget-us 200 --ns-per-operation 0.001 -o sag$nodes.csv > /dev/null
    "$palp" play c.palp --scene swing.scene --budget-us 200 --ns-per-operation 0.001 -o swing$nodes.csv > /dev/null
done
/usr/bin/python3 - > table.txt <<'P'
import csv, subprocess, sys
import numpy as np
def mesh(path):
    w = open(path).read().split()
    i = w.index("Vertices"); n = int(w[i + 1]); x = np.array(w[i + 2:i + 2 + 4 * n], float).reshape(n, 4)[:, :3]
    i = w.index("Tetrahedra"); t = int(w[i + 1]); return x, np.array(w[i + 2:i + 2 + 5 * t], int).reshape(t, 5)[:, :4]
def ccx(x, t, step):
    fixed = [i + 1 for i in range(len(x)) if x[i][0] <= 1e-6]
    with open("job.inp", "w") as f:
        f.write("*NODE, NSET=ALL\n" + "".join("%d,%.12g,%.12g,%.12g\n" % (i + 1, *p) for i, p in enumerate(x)))
        f.write("*ELEMENT, TYPE=C3D4, ELSET=E\n" + "".join("%d,%d,%d,%d,%d\n" % (i + 1, *e) for i, e in enumerate(t)))
        f.write("*NSET, NSET=FIX\n" + "".join("%d,\n" % i for i in fixed))
        f.write("*MATERIAL, NAME=M\n*ELASTIC\n2e4,0.3\n*DENSITY\n1000\n*SOLID SECTION, ELSET=E, MATERIAL=M\n*BOUNDARY\nFIX,1,3\n*STEP\n" + step + "*END STEP\n")
    subprocess.run(["ccx", "job"], stdout=subprocess.DEVNULL, check=True)
    return open("job.dat").read()
worst = []
for nodes in (120, 600, 3000):
    x, t = mesh("c%d.mesh" % nodes)
    dat = ccx(x, t, "*STATIC\n*DLOAD\nE,GRAV,0.1,0,0,-1\n*NODE PRINT, NSET=ALL\nU\n")
    u = np.array([l.split()[1:] for l in dat.splitlines() if len(l.split()) == 4 and l.split()[0].isdigit()], float)
    sag = np.linalg.norm(u, axis=1).max()
    dat = ccx(x, t, "*FREQUENCY\n2\n")
    hz = [float(l.split()[3]) for l in dat.splitlines() if len(l.split()) == 5 and l.split()[0].isdigit()][0]
    rows = list(csv.DictReader(open("sag%d.csv" % nodes)))
    ours = np.mean([float(r["displaced_m"]) for r in rows[-2000:]])
    d = np.array([float(r["displaced_m"]) for r in csv.DictReader(open("swing%d.csv" % nodes))])
    mid = d.max() / 2
    at = [k - (d[k] - mid) / (d[k] - d[k - 1]) for k in range(1, len(d)) if d[k - 1] < mid <= d[k]]
    ourhz = (len(at) - 1) / (at[-1] - at[0]) * 4000
    print("%d nodes: sag %.5g m, CalculiX %.5g m, off %.2f %%; %.3f Hz, CalculiX (consistent mass) %.3f Hz, off %.2f %%" % (
        len(x), ours, sag, 100 * abs(ours / sag - 1), ourhz, hz, 100 * abs(ourhz / hz - 1)))
    worst.append((abs(ours / sag - 1), abs(ourhz / hz - 1)))
sys.exit(0 if max(w[0] for w in worst) < 0.01 and worst[-1][1] < 0.01 and worst[-1][1] < worst[0][1] else 1)
P
status=$?
sed 's/^/# /' table.txt
ok $status "sag within 1 %, frequency converging: $(tail -1 table.txt)"
done_testing
