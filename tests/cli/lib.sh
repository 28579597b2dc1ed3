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

done_testing() { echo "1..$count"; exit $failed; }
