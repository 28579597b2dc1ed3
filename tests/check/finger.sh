# SPDX-License-Identifier: MIT
# The sample finger: ticks on time with a new configuration each, levels used, what each level of the seams is worth.
. "$(dirname "$0")/../cli/lib.sh"
"$palp" bake "$here/blobs/finger.model" -o finger.palp > bake.txt 2>/dev/null
ok $? "the finger is baked: $(grep '^zone distal' bake.txt)"
scene=$here/sim/finger.scene
play() { # play NAME OPTIONS...
    name=$1
    shift
    "$palp" play finger.palp --scene "$scene" -o "$name.csv" --report "$name.html" "$@" > "$name.txt" && grep -q ', 0 late' "$name.txt"
    ok $? "$name: $(sed -n '3p;5p' "$name.txt" | tr '\n' ' ' | tr -s ' ')"
    sed 's/^/# /' "$name.txt"
}
play "as-it-comes" --ns-per-operation 0.25
play "coarse-seams" --finest 2 --ns-per-operation 0.25
play "coarsest-seams" --finest 0 --ns-per-operation 0.25
play "tight" --finest 3 --ns-per-operation 0.33
awk -F, 'NR > 1 {d = 0; for (k = 9; k <= 11; k++) {f[k] = $k - l[k]; d += f[k]^2; l[k] = $k} n = sqrt($9^2 + $10^2 + $11^2); if (n > m) m = n; if (NR > 2 && d > s) s = d}
    END {printf "# largest step of the force %.3g N, largest force %.3g N\n", sqrt(s), m; exit !(m > 0.1 && sqrt(s) < 0.05 * m)}' tight.csv > step.txt
ok $? "the force has no jump while levels change: $(cat step.txt)"
awk -F, 'NR > 1 {t[++n] = $15} END {for (i = 2; i <= n; i++) {x = t[i]; for (j = i - 1; j > 0 && t[j] > x; j--) t[j + 1] = t[j]; t[j + 1] = x}
    printf "p50 %.1f, p99 %.1f, max %.1f us by operations at 0.25 ns", t[int(n / 2)], t[int(n * 0.99)], t[n]; exit !(t[int(n / 2)] < 100)}' coarse-seams.csv > goal.txt
ok $? "three pads, coarse seams, the tick: $(cat goal.txt)"
/usr/bin/python3 - "$palp" <<'P'
import subprocess, sys
import numpy as np
palp = sys.argv[1]
def solve(level, knuckle, tip, *more):
    out = subprocess.run([palp, "solve", "finger.palp", "--joint", "knuckle", str(knuckle), "--joint", "tip", str(tip),
                          "--level", level, *more], capture_output=True, text=True, check=True).stdout
    return np.array([[float(x) for x in l.split(",")] for l in out.splitlines()[1:] if not l.startswith("#")])
rest, bent = solve("5", 0, 0), solve("5", 0.3, 0.2)  # free nodes carry no force; the lowest of the last two pads are pushed
zone = [(z["first_node"], z["body"]["nodes"]) for z in __import__("json").loads(subprocess.run([palp, "info", "finger.palp", "--json"],
        capture_output=True, text=True, check=True).stdout)["zones"]]
push = []
for first, count in zone[1:]:
    part = bent[first:first + count]
    free = rest[first:first + count][np.abs(part[:, 4:7]).sum(1) == 0]
    push.append(int(free[np.argmin(free[:, 9]), 0]))
open("push.csv", "w").write("node,kind,x,y,z\n%d,f,0.05,0,0.1\n%d,f,0,0,0.2\n" % tuple(push))
for knuckle, tip in ((0.0, 0.0), (0.3, 0.2), (1.0, 0.7)):
    exact = solve("5", knuckle, tip, "--set", "push.csv")[:, 1:4]
    errors = [np.linalg.norm(solve(l, knuckle, tip, "--set", "push.csv")[:, 1:4] - exact) / np.linalg.norm(exact) for l in ("diagonal", "0", "1", "2", "3", "4")]
    print("# pushed, knuckle %g tip %g rad: error of the displacements, block diagonal %.2g, levels 0 to 4: %s" % (
        knuckle, tip, errors[0], " ".join("%.2g" % e for e in errors[1:])))
    if max(errors[2:]) > 0.1 or errors[5] > errors[1]: sys.exit(1)
P
ok $? "coarser levels of the seams against all of their modes"
done_testing
