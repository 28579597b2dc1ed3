# SPDX-License-Identifier: MIT
# --compliance with numpy: a body of springs baked from a .npy matrix answers like numpy's own solution.
. "$(dirname "$0")/../cli/lib.sh"
py=/usr/bin/python3
if ! $py -c 'import numpy' 2>/dev/null; then
    echo "ok 1 - compliance against numpy # SKIP python3-numpy is not installed (make deps)"; echo 1..1; exit 0
fi
cat >make.py <<'EOF'
import numpy as np
rng = np.random.default_rng(5)
x = np.array([[float(w) for w in l.split()[1:4]] for l in open("ball.obj") if l.startswith("v ")])
free = np.where(x[:, 2] > -0.5)[0]
m = len(free)
d = np.linalg.norm(x[free][:, None] - x[free][None], axis=2)
g = np.kron(np.exp(-2 * d), np.eye(3)) * 1e-3 + 1e-5 * np.eye(3 * m)
np.save("g.npy", g); np.save("f.npy", np.asfortranarray(g.astype(np.float32)))
nodes = [0, 3, 5]
rows = np.concatenate([[3 * list(free).index(n) + k for k in range(3)] for n in nodes if n in free])
nodes = [n for n in nodes if n in free]
u = rng.normal(size=len(rows)) * 1e-3
force = np.linalg.solve(g[np.ix_(rows, rows)], u)
full = g[:, rows] @ force
with open("set.csv", "w") as f:
    f.write("node,kind,x,y,z\n")
    for i, n in enumerate(nodes): f.write("%d,u,%.9g,%.9g,%.9g\n" % (n, *u[3 * i:3 * i + 3]))
np.save("u.npy", full); np.save("free.npy", free); np.save("force.npy", force); np.save("nodes.npy", nodes)
EOF
cat >compare.py <<'EOF'
import numpy as np, sys
a = np.genfromtxt(sys.argv[1], delimiter=",", names=True, comments="#")
u = np.stack([a["ux"], a["uy"], a["uz"]], 1)[np.load("free.npy")].ravel(); e = np.load("u.npy")
f = np.stack([a["fx"], a["fy"], a["fz"]], 1)[np.load("nodes.npy")].ravel(); g = np.load("force.npy")
err = max(np.linalg.norm(u - e) / np.linalg.norm(e), np.linalg.norm(f - g) / np.linalg.norm(g))
print("%.3g" % err); sys.exit(not err < 1e-5)
EOF
cp "$here/blobs/ball.obj" ball.obj
$py make.py
for matrix in g.npy f.npy; do
    $palp bake ball.obj --as-is -o c.palp --young 1e4 --poisson 0.3 --fix-below z -0.5 --compliance $matrix --epsilon 0 >/dev/null 2>err.txt || cat err.txt
    $palp solve c.palp --set set.csv -o out.csv && e=$($py compare.py out.csv)
    ok $? "$matrix: displacements and forces against numpy: $e (at most 1e-5)"
done
head -c 500 g.npy >cut.npy
refuses 1 . "truncated .npy" $palp bake ball.obj --as-is -o out.palp --young 1e4 --poisson 0.3 --fix-below z -0.5 --compliance cut.npy
refuses 1 "need 9.* or 126\|rows; need" ".npy for other fixed nodes" $palp bake ball.obj --as-is -o out.palp --young 1e4 --poisson 0.3 --fix-below z 0.5 --compliance g.npy
echo '0,free,,,' >one.csv
fixed=$($py -c "
import numpy as np
x=np.array([[float(w) for w in l.split()[1:4]] for l in open('ball.obj') if l.startswith('v ')]); print(np.where(x[:,2]<=-0.5)[0][0])")
printf 'node,kind,x,y,z\n%s,free,,,\n' "$fixed" >one.csv
refuses 1 "no column of fixed node" "a release that the matrix cannot answer" $palp solve c.palp --set one.csv -o out.csv
done_testing
