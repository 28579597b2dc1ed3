# SPDX-License-Identifier: MIT
# What `make install` and `make deb` put where: programs that run, manuals that know every option, headers that compile alone.
. "$(dirname "$0")/../cli/lib.sh"
cd "$here" || exit 1
make -s install BUILD="$BUILD" DESTDIR="$work/root" PREFIX=/usr >/dev/null 2>&1; ok $? "make install"
cd "$work" || exit 1
cat >user.c <<'EOF'
#include "core/palp.h"
int main(void) { return palp_blob_open(&(palp_blob){0}, 0, 0) == PALP_OK; }
EOF
flags=$(PKG_CONFIG_PATH=root/usr/lib/pkgconfig PKG_CONFIG_SYSROOT_DIR=$work/root pkg-config --cflags --libs palp 2>/dev/null)
gcc user.c $flags -o user && ./user; ok $? "a program against the installed headers and library: $flags"
for program in palp palpd palp-sim; do root/usr/bin/$program --version; done | uniq >versions.txt
[ "$(cat versions.txt)" = "palp $(PKG_CONFIG_PATH=root/usr/lib/pkgconfig pkg-config --modversion palp)" ]; ok $? "programs and palp.pc agree: $(cat versions.txt)"
(cd "$here" && make lib TARGET=z80 2>&1) | grep -q "no target 'z80': there are x86-64"; ok $? "make lib for a processor that is none is refused with those that there are"
(cd "$here" && make lib CROSS=arm-none-eabi- 2>&1) | grep -q 'name a processor with TARGET='; ok $? "and so is a bare Arm compiler without a processor"
if command -v arm-none-eabi-gcc >/dev/null; then
    (cd "$here" && make -s lib TARGET=cortex-m7 BUILD="$work/m7") >/dev/null 2>&1
    arm-none-eabi-readelf -A "$work/m7/libpalp.a" 2>/dev/null | grep -q 'Tag_ABI_VFP_args'; ok $? "make lib TARGET=cortex-m7 passes floats in registers"
else
    count=$((count + 1)); echo "ok $count - make lib TARGET=cortex-m7 # SKIP arm-none-eabi-gcc is not installed (make deps)"
fi
missing=""
for program in palpd:8 palp-sim:1; do
    page=root/usr/share/man/man${program#*:}/${program%:*}.${program#*:}
    for option in $(root/usr/bin/${program%:*} --help | grep -oE '^ *\[?--[a-z-]+|  --[a-z-]+' | tr -d ' [' | sort -u); do
        sed 's/\\-/-/g' "$page" | grep -q -- "$option" || missing="$missing ${program%:*}:$option"
    done
done
for command in $(root/usr/bin/palp --help | awk '/^  [a-z]/{print $1}' | grep -v "^'"); do grep -q "$command" root/usr/share/man/man1/palp.1 || missing="$missing palp:$command"; done
[ -z "$missing" ]; ok $? "every option and command is in a manual page$missing"
if command -v dpkg-deb >/dev/null; then
    (cd "$here" && make -s deb BUILD="$BUILD") >/dev/null 2>&1; ok $? "make deb"
    deb=$(ls "$here/$BUILD"/palp_*_*.deb | head -1)
    dpkg-deb -x "$deb" out && out/usr/bin/palp info --device arm3 | grep -q 'bus load' && [ -f out/lib/systemd/system/palpd.service ]
    ok $? "$(basename "$deb") unpacks and runs, with a systemd unit"
    if command -v aarch64-linux-gnu-gcc >/dev/null && command -v qemu-aarch64-static >/dev/null; then
        (cd "$here" && make -s deb CROSS=aarch64-linux-gnu- BUILD="$BUILD/package-arm64") >/dev/null 2>&1
        deb=$(ls "$here/$BUILD"/package-arm64/palp_*_arm64.deb)
        dpkg-deb -x "$deb" arm && qemu-aarch64-static -L /usr/aarch64-linux-gnu arm/usr/bin/palp info --device arm3 | grep -q 'bus load'
        ok $? "$(basename "$deb") unpacks and runs"
    else
        count=$((count + 1)); echo "ok $count - arm64 package # SKIP aarch64-linux-gnu-gcc or qemu-aarch64-static is not installed (make deps)"
    fi
    if command -v systemd-analyze >/dev/null; then
        said=$(systemd-analyze verify out/lib/systemd/system/palpd.service 2>&1 | grep -vE 'not executable|man palpd')
        [ -z "$said" ]; ok $? "systemd finds nothing wrong with the unit $said"
    fi
else
    count=$((count + 1)); echo "ok $count - packages # SKIP dpkg-deb is not installed"
fi
done_testing
