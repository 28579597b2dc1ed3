#!/bin/sh
# SPDX-License-Identifier: MIT
# The page in one file: sh sim/web/build.sh OUT.html ENGINE.wasm [NAME=TITLE=BLOB]...
# The first model goes into the page; the others into scripts beside it, that it loads when they are chosen.
set -e
out=$1
wasm=$2
shift 2
work=$out.parts
rm -rf "$work"
mkdir -p "$work"
cp port/host/page/*.css port/host/page/*.js sim/web/*.css sim/web/*.js "$work"
packed() { gzip -9nc "$1" | base64; }
packed "$wasm" > "$work/page.wasm"
{
    echo '<script>window.MODELS = ['
    first=1
    for m in "$@"; do
        name=${m%%=*}; rest=${m#*=}
        [ $first = 1 ] && script= || script=", script: '$name.js'"
        echo "    {name: '$name', title: '${rest%%=*}'$script},"
        first=0
    done
    echo '];</script>'
} > "$work/models"
first=1
for m in "$@"; do
    name=${m%%=*}; blob=${m##*=}
    if [ $first = 1 ]; then
        { printf '<script>palpModel(%s, `' "'$name'"; packed "$blob"; echo '`);</script>'; } > "$work/first"
    else
        { printf 'palpModel(%s, `' "'$name'"; packed "$blob"; echo '`);'; } > "$(dirname "$out")/$name.js"
    fi
    first=0
done
# A line @@NAME@@ stands for the file of that name.
awk -v work="$work" '
    /^@@.*@@$/ { gsub("@", ""); while ((getline line < (work "/" $0)) > 0) print line; close(work "/" $0); next }
    { print }' sim/web/page.html > "$work/page.html"
mv "$work/page.html" "$out"
rm -rf "$work"
