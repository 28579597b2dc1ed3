# SPDX-License-Identifier: MIT
# The examples, built against installed headers and the installed library only, and run.
. "$(dirname "$0")/lib.sh"
small_body body.palp
make -s -C "$here" install BUILD="$BUILD" DESTDIR="$work/root" PREFIX=/usr >/dev/null 2>&1; ok $? "make install"
export PKG_CONFIG_PATH=$work/root/usr/lib/pkgconfig PKG_CONFIG_SYSROOT_DIR=$work/root
if command -v pkg-config >/dev/null; then flags=$(pkg-config --cflags --libs palp); else flags="-Iroot/usr/include/palp -Lroot/usr/lib -lpalp"; fi
cp "$here"/tools/examples/* .
for e in sphere two_tools servo; do
    gcc -std=c11 -O2 -Wall -Wextra -Werror -D_GNU_SOURCE $e.c $flags -o $e 2>errors; ok $? "$e builds $(head -3 errors)"
    ./$e body.palp >$e.txt 2>&1; ok $? "$e runs: $(tail -1 $e.txt)"
    undefined=$(nm -u $e | grep -wE 'malloc|calloc|realloc')
    [ -z "$undefined" ]; ok $? "$e allocates nothing $undefined"
done
awk -F, 'NR > 1 {if ($2 < f) bad = 1; f = $2} END {exit bad || f < 0.03}' sphere.txt; ok $? "the sphere is pushed harder the deeper it is"
awk '/^tick/ {if ($3 > 0.05 && $6 > 0.05) both = 1} END {exit !both}' two_tools.txt; ok $? "both tools feel the body"
./sphere none.palp >out.txt 2>err.txt; [ $? -eq 1 ] && grep -q none.palp err.txt; ok $? "no blob: $(cat err.txt)"
done_testing
