#!/bin/sh
# SPDX-License-Identifier: MIT
# Turns device files into a C table of name and text: sh sim/embed.sh FILE.dev... > devices.c
echo 'extern const char *const builtin_devices[][2];'
echo 'const char *const builtin_devices[][2] = {'
for file in "$@"; do
    name=$(basename "$file" .dev)
    printf '    {"%s",\n' "$name"
    sed -e 's/\\/\\\\/g' -e 's/"/\\"/g' -e 's/.*/     "&\\n"/' "$file"
    echo '    },'
done
echo '    {0, 0}};'
