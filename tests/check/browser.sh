# SPDX-License-Identifier: MIT
# Pages in a browser: the report of a long run, a blob's card, and the web page with real pointer events, whose recording the native
# program repeats bit for bit. Pictures stay in build/pages.
. "$(dirname "$0")/../cli/lib.sh"
for need in chromium node; do
    command -v $need >/dev/null && continue
    echo "ok 1 - pages in a browser # SKIP $need is not installed (make deps)"; echo 1..1; exit 0
done
pages=$here/$BUILD/pages
mkdir -p "$pages"
scripts=$here/tests/check
run() { # SCRIPT ARGUMENT..: its lines become ours
    timeout 420 node "$@" >lines.txt 2>errors.txt || { cat errors.txt >&2; false; }; ok $? "$(basename "$1") runs to its end"
    while IFS= read -r line; do
        case $line in ok*) ok 0 "${line#*- }" ;; 'not ok'*) ok 1 "${line#*- }" ;; esac
    done <lines.txt
}
$palp bake "$here/blobs/ball.obj" --loop 1 --units cm --as-is -o b.palp --young 1e4 --poisson 0.3 --fix-below z -0.007 >/dev/null 2>&1

# A minute at 1 kHz.
$palpd b.palp --bus loop --device arm3 --seconds 60 --no-wait --log r.log --report r.html >/dev/null && $palp export r.log --csv -o r.csv >/dev/null
ok $? "a run of a minute, with log and report"
run "$scripts/report.mjs" "$work/r.html" "$work/r.csv" "$pages"
$palp report r.log b.palp -o again.html && grep -q '"motion": {' again.html; ok $? "palp report runs the log again and shows the body: $(wc -c <again.html) bytes"
$palp info b.palp --html card.html >/dev/null && grep -q 'How it feels on which' card.html && ! grep -qE 'src=|href="h' card.html; ok $? "a card of $(wc -c <card.html) bytes"

if [ ! -d /usr/lib/wasm32-wasi ] || ! command -v wasm-ld >/dev/null; then
    count=$((count + 1)); echo "ok $count - the web page # SKIP wasi-libc or lld is not installed (make deps)"; done_testing; exit
fi
make -s -C "$here" BUILD="$BUILD" WEB="$work/web" web >web.txt 2>&1; ok $? "make web: $(tail -1 web.txt)"
bytes=$(gzip -9nc web/index.html | wc -c); [ "$bytes" -le 1000000 ]; ok $? "the page with its first model, compressed: $bytes bytes"
$palpd b.palp --bus loop --device arm3 --seconds 2 --no-wait --log short.log >/dev/null
$palp view short.log --port 8397 >address.txt 2>&1 &
view=$!
sleep 1
run "$scripts/page.mjs" "$work/web/index.html" "$(cat address.txt)" "$work/b.palp" "$work/short.log" "$pages"
kill $view; wait $view; ok $? "palp view ends when it is told to"
$palp replay "$pages/page.log" web/models/rabbit.palp >replay.txt 2>&1; ok $? "the page's recording natively: $(cut -d: -f2- replay.txt)"
[ "$(cat "$pages/page.digest")" = "$(sed 's/.*digest //' replay.txt)" ]; ok $? "forces of the page and of the native core are the same bits"
done_testing
