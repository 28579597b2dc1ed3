# SPDX-License-Identifier: MIT
# The examples, built against installed headers and the installed library only, and run.
. "$(dirname "$0")/lib.sh"
small_body body.palp
make -s -C "$here" install BUILD="$BUILD" DESTDIR="$work/root" PREFIX=/usr >/dev/null 2>&1; ok $? "make install"
export PKG_CONFIG_PATH=$work/root/usr/lib/pkgconfig PKG_CONFIG_SYSROOT_DIR=$work/root
if command -v pkg-config >/dev/null; then flags=$(pkg-config --cflags --libs palp); else flags="-Iroot/usr/include/palp -Lroot/usr/lib -lpalp"; fi
cp "$here"/tools/examples/* .
for e in sphere two_tools servo scene; do
    gcc -std=c11 -O2 -Wall -Wextra -Werror $e.c $flags -o $e 2>errors; ok $? "$e builds $(head -3 errors)"
    ./$e body.palp >$e.txt 2>&1; ok $? "$e runs: $(tail -1 $e.txt)"
    undefined=$(nm -u $e | grep -wE 'malloc|calloc|realloc')
    [ -z "$undefined" ]; ok $? "$e allocates nothing $undefined"
done
awk -F, 'NR > 1 {if ($2 < f) bad = 1; f = $2} END {exit bad || f < 0.03}' sphere.txt; ok $? "the sphere is pushed harder the deeper it is"
awk '/^tick/ {if ($3 > 0.05 && $6 > 0.05) both = 1} END {exit !both}' two_tools.txt; ok $? "both tools feel the body"
./sphere none.palp >out.txt 2>err.txt; [ $? -eq 1 ] && grep -q none.palp err.txt; ok $? "no blob: $(cat err.txt)"
cat >user.cpp <<'EOF'
#include "core/palp.h"
#include <cstdio>
#include <cstdlib>
int main(int, char **argv) {
    std::FILE *f = std::fopen(argv[1], "rb");
    std::size_t room = 64u << 20;
    void *data = std::aligned_alloc(PALP_ALIGN, room);
    palp_blob blob;
    if (palp_blob_open(&blob, data, std::fread(data, 1, room, f)) != PALP_OK) return 1;
    const palp_tool sphere = palp_tool_sphere(3 * blob.meta->mean_edge_m);
    palp_contact_config config = {};
    config.blob = &blob;
    config.tools = &sphere;
    config.tool_count = 1;
    config.finest = PALP_CONTACT_FINEST;
    const std::size_t bytes = palp_contact_memsize(&config);
    static palp_contact contact;
    if (palp_contact_init(&contact, &config, std::aligned_alloc(PALP_ALIGN, (bytes + 63) / 64 * 64), bytes) != PALP_OK) return 1;
    std::printf("%u nodes, %zu bytes, palp %s\n", blob.meta->nodes, bytes, PALP_VERSION);
}
EOF
if command -v g++ >/dev/null; then
    g++ -std=c++17 -Wall -Wextra -Wpedantic -Werror user.cpp $flags -o user 2>errors; ok $? "a C++ program builds without a warning $(head -3 errors)"
    ./user body.palp >user.txt; ok $? "and runs: $(cat user.txt)"
else
    count=$((count + 1)); echo "ok $count - C++ # SKIP g++ is not installed (make deps)"
fi
done_testing
