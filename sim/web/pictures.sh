#!/bin/sh
# SPDX-License-Identifier: MIT
# The pictures of README, taken of our own pages by a browser: pictures.sh FOLDER, behind make web. With chromium and node.
set -e
out=$1
palp=${BUILD:-build}/palp
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
models=${BUILD:-build}/web/models
cp "$models/rabbit.palp" "$models/finger.palp" "$work"
printf 'seconds 10\nrate 1000\nbody rabbit.palp\ndevice arm3\ntool ball\n' > "$work/rabbit.scene"
"$palp" play "$work/rabbit.scene" --ns-per-operation 0.25 --report "$work/run.html" > /dev/null
"$palp" play "$work/finger.palp" --scene sim/finger.scene --ns-per-operation 0.25 --report "$work/finger.html" > /dev/null
node tests/check/pictures.mjs "$(pwd)/${BUILD:-build}/web/index.html" "$work" "$out"
