# SPDX-License-Identifier: MIT
# palp export, view and info --html: what they make with nothing but our own programs, and what they refuse.
. "$(dirname "$0")/lib.sh"
$palp bake "$here/blobs/ball.obj" --units cm --as-is -o b.palp --young 1e4 --poisson 0.3 --fix-below z -0.007 >/dev/null 2>&1
$palpd b.palp --bus loop --device arm3 --seconds 2 --no-wait --log r.log >/dev/null 2>&1
$palp export b.palp --gltf -o b.glb >/dev/null && [ "$(head -c 4 b.glb)" = glTF ] && $palp export r.log b.palp --gltf --fps 10 -o r.gltf >/dev/null 2>&1 && grep -q '"animations"' r.gltf
ok $? "glTF of a blob and of a log"
$palp export r.log b.palp --vtu --fps 5 -o r.pvd >/dev/null 2>&1 && [ "$(ls r_*.vtu | wc -l)" -eq "$(grep -c '<DataSet' r.pvd)" ] && $palp export b.palp --vtu -o b.vtu >/dev/null
ok $? "ParaView's files, as many as are listed"
$palp export r.log --csv -o r.csv >/dev/null && [ "$(wc -l <r.csv)" -eq 2001 ] && $palp export r.log --csv --from 0.5 --to 0.9995 -o part.csv >/dev/null && [ "$(wc -l <part.csv)" -eq 501 ]
ok $? "a line for each tick, and for those of a part"
$palp export r.log --csv -o - | head -1 | grep -q '^t_s,device,state,'; ok $? "a table to standard output"
$palp export r.log --mcap -o r.mcap >/dev/null && [ "$(tail -c 7 r.mcap | head -c 4)" = MCAP ]; ok $? "MCAP ends as it begins"
$palp info b.palp --html card.html >/dev/null && grep -q 'What a tick may take' card.html && ! grep -qE '(src|href)=.http' card.html; ok $? "a blob's card, self-contained"
$palp report r.log b.palp -o r.html 2>/dev/null && grep -q '"motion": {' r.html; ok $? "a report with the body"
refuses 2 "what as" "a form is needed" $palp export b.palp -o out.glb
refuses 2 "ends in .glb" "a name that says nothing" $palp export b.palp --gltf -o out.bin
refuses 2 "name its blob" "a log without its blob" $palp export r.log --gltf -o out.glb
refuses 2 "for logs" "MCAP of a blob" $palp export b.palp --mcap -o out.mcap
refuses 2 "from < to" "a time that ends before it begins" $palp export r.log --csv --from 2 --to 1 -o out.csv
refuses 1 "no tick on record" "a part that is not there" $palp export r.log --csv --from 50 -o out.csv
refuses 2 "cannot read" "a file that is not there" $palp export none.palp --gltf -o out.glb
refuses 1 "not a line of a candump log" "what is no log" $palp export "$here/README.md" --csv -o out.csv
refuses 2 "neither a blob" "what is nothing to view" $palp view "$here/Makefile"
head -c 4000 r.log >cut.log
$palp export cut.log --csv -o cut.csv >/dev/null 2>&1; [ $? -le 1 ]; ok $? "a log cut off in its header is refused or read as far as it goes"
done_testing
