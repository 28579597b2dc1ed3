# SPDX-License-Identifier: MIT
# The report opens in a browser: its charts are there and nothing is fetched.
. "$(dirname "$0")/../cli/lib.sh"
if ! command -v chromium >/dev/null; then
    echo "ok 1 - report in a browser # SKIP chromium is not installed (make deps)"; echo 1..1; exit 0
fi
$palp bake "$here/blobs/ball.obj" --as-is -o b.palp --young 1e4 --poisson 0.3 --fix-below z -0.5 >/dev/null 2>&1
$palpd b.palp --bus loop --device arm3 --seconds 3 --no-wait --report r.html >/dev/null
browse() {
    HOME=$work timeout 120 chromium --headless --no-sandbox --disable-gpu --disable-quic --no-first-run --disable-background-networking \
        --disable-component-update --disable-sync --window-size=1100,2400 --virtual-time-budget=3000 --user-data-dir="$work/profile" "$@" 2>/dev/null
}
browse --dump-dom "file://$work/r.html" >dom.html
for heading in "Force on the hand" "Energy" "Latency of the tick" "At the largest force"; do
    grep -q "$heading" dom.html; ok $? "the page shows: $heading"
done
[ "$(grep -c '<polyline' dom.html)" -ge 6 ]; ok $? "curves are drawn"
! grep -qE 'https?://' dom.html || [ "$(grep -oE 'https?://[^" '"'"']*' dom.html | grep -vc w3.org)" -eq 0 ]; ok $? "nothing is fetched"
browse --screenshot="$work/shot.png" "file://$work/r.html" >/dev/null
[ "$(wc -c <shot.png)" -gt 20000 ]; ok $? "a screenshot of $(wc -c <shot.png) bytes"
done_testing
