# SPDX-License-Identifier: MIT
# Our logs and frames in the hands of others: python3-can, a DBC decoder that knows nothing of us, can-utils.
. "$(dirname "$0")/../cli/lib.sh"
python=$(for p in /usr/bin/python3 python3; do $p -c 'import can' 2>/dev/null && { echo $p; break; }; done)
small_body body.palp
for kind in palp palp-fd; do
    $palpd body.palp --bus loop --device arm3-$kind --seconds 4 --no-wait --log $kind.log >/dev/null 2>&1
    $palp replay $kind.log body.palp -o $kind.csv >/dev/null; ok $? "$kind: a log of $(grep -c . $kind.log) lines"
    if [ -n "$python" ]; then
        while read -r line; do
            case $line in "ok "*) ok 0 "$kind: ${line#ok * - }" ;; "not ok "* | *Error*) ok 1 "$kind: $line" ;; esac
        done <<EOF
$($python "$here/tests/check/dbc.py" "$here/core/device/$kind.dbc" $kind.log $kind.csv loop 2>&1)
EOF
    else
        count=$((count + 1)); echo "ok $count - $kind by python3-can # SKIP not installed (make deps)"
    fi
done
if command -v log2asc >/dev/null; then
    [ "$(log2asc -I palp-fd.log loop palp | grep -cE 'Rx|CANFD')" -ge "$(grep -c . palp-fd.log)" ]; ok $? "can-utils' log2asc reads every line"
else
    count=$((count + 1)); echo "ok $count - log2asc # SKIP can-utils is not installed (make deps)"
fi
done_testing
