# SPDX-License-Identifier: MIT
# TAP helpers for shell tests. BUILD names the build folder; each test works in a folder of its own.
count=0
failed=0
here=$(pwd)
palp=$here/$BUILD/palp
palpd=$here/$BUILD/palpd
palp_sim=$here/$BUILD/palp-sim
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work" || exit 1

ok() { # ok STATUS NAME
    count=$((count + 1))
    if [ "$1" -eq 0 ]; then echo "ok $count - $2"; else echo "not ok $count - $2"; failed=1; fi
}

# refuses CODE PATTERN NAME COMMAND...: exits with CODE, says PATTERN in one line, leaves no output file
refuses() {
    code=$1 pattern=$2 name=$3
    shift 3
    rm -f out.*
    "$@" >stdout.txt 2>stderr.txt
    got=$?
    lines=$(grep -c . stderr.txt)
    left=$(ls out.* 2>/dev/null)
    if [ "$got" -eq "$code" ] && [ "$lines" -eq 1 ] && grep -q -- "$pattern" stderr.txt && [ -z "$left" ]; then
        ok 0 "$name: $(cat stderr.txt)"
    else
        ok 1 "$name: exit $got (wanted $code), $lines lines, left '$left': $(head -3 stderr.txt)"
    fi
}

# small_body OUT.palp [YOUNG]: the rabbit with 642 nodes
small_body() {
    $palp subdivide "$here/blobs/rabbit.obj" -o "$work/rabbit.obj" --levels 2 >/dev/null
    $palp bake "$work/rabbit.obj" --as-is -o "$1" --young "${2:-3e4}" --poisson 0.45 --fix-below z 0.004 >/dev/null 2>&1
}

# block NX NY NZ SIDE PATH: a block of so many squares of that side (metres) along its edges
block() {
    awk -v nx="$1" -v ny="$2" -v nz="$3" -v h="$4" 'BEGIN {
        L[0] = nx; L[1] = ny; L[2] = nz
        for (a = 0; a < 3; a++) for (side = 0; side < 2; side++) {
            b = (a + 1) % 3; c = (a + 2) % 3
            for (i = 0; i < L[b]; i++) for (j = 0; j < L[c]; j++) {
                for (k = 0; k < 4; k++) {
                    p[a] = side * L[a]; p[b] = i + (k == 1 || k == 2); p[c] = j + (k >= 2)
                    key = p[0] "," p[1] "," p[2]
                    if (!(key in id)) { id[key] = ++count; printf "v %.9g %.9g %.9g\n", p[0] * h, p[1] * h, p[2] * h }
                    q[side ? k : 3 - k] = id[key]
                }
                faces = faces "f " q[0] " " q[1] " " q[2] "\nf " q[0] " " q[2] " " q[3] "\n"
            }
        }
        printf "%s", faces }' > "$5"
}

# bar N PATH: three cubes of 20 mm in a row, N squares along an edge
bar() { block $((3 * $1)) "$1" "$1" "$(awk -v n="$1" 'BEGIN { print 0.02 / n }')" "$2"; }

# small_chain OUT.palp: three cubes on two joints, 294 nodes
small_chain() {
    bar 4 "$work/bar.obj"
    cat > "$work/chain.model" <<'M'
young 3e4
poisson 0.4
mesh bar.obj
as-is
zone a
fix-below z 1e-6
zone b
fix-below z 1e-6
zone c
fix-below z 1e-6
cut a b 0.02 0 0 1 0 0
cut b c 0.04 0 0 1 0 0
joint ab revolute a b
axis 0 1 0
origin 0.02 0.01 0.002
joint bc revolute b c
axis 0 0.8 0.6
origin 0.04 0.01 0.004
M
    $palp bake "$work/chain.model" -o "$1" >/dev/null 2>&1
}

done_testing() { echo "1..$count"; exit $failed; }
