#!/bin/sh
# SPDX-License-Identifier: MIT
# Bakes the models of the web page and puts it together: models.sh FOLDER ENGINE.wasm. The first model is in the page.
set -e
folder=$1
wasm=$2
palp=${BUILD:-build}/palp
blobs=$folder/models
mkdir -p "$blobs"
bake() { # NAME ARGUMENT..
    name=$1
    shift
    [ -f "$blobs/$name.palp" ] && [ "$blobs/$name.palp" -nt "$palp" ] && return
    echo "  BAKE $name"
    "$palp" bake "$@" -o "$blobs/$name.palp" > /dev/null
}
[ -f "$blobs/rabbit.obj" ] || "$palp" subdivide blobs/rabbit.obj --levels 2 -o "$blobs/rabbit.obj" > /dev/null
rubber="--as-is --young 3e4 --poisson 0.45 --density 1000 --fix-below z 0.004"
bake rabbit "$blobs/rabbit.obj" $rubber
bake wavelets "$blobs/rabbit.obj" $rubber --form wavelet --epsilon 0.2
sed -e "s#^mesh .*#mesh $(pwd)/blobs/finger.obj#; s/^loop .*/loop 1/" blobs/finger.model > "$blobs/finger.model"
bake finger "$blobs/finger.model"
bake liver blobs/liver.model
set -- "rabbit=Rabbit, rubber=$blobs/rabbit.palp" "wavelets=Rabbit, wavelets of epsilon 0.2=$blobs/wavelets.palp" \
    "finger=Finger with joints=$blobs/finger.palp" "liver=Liver, which moves=$blobs/liver.palp"
sh sim/web/build.sh "$folder/index.html" "$wasm" "$@"
echo "Open $folder/index.html, or host the folder; $(gzip -9nc "$folder/index.html" | wc -c) bytes of it compressed"
