#!/bin/sh
# SPDX-License-Identifier: MIT
# A Debian package from what was built: sh port/linux/deb.sh BUILD ARCH VERSION. Made by `make deb`.
set -e
build=$1 arch=$2 version=$3
root=$build/deb
rm -rf "$root"
make -s install BUILD="$build" CROSS="$CROSS" DESTDIR="$root" PREFIX=/usr
install -D -m 644 port/linux/palpd.service "$root/lib/systemd/system/palpd.service"
install -D -m 644 port/linux/palpd.default "$root/usr/share/palp/palpd.default"
install -D -m 644 port/linux/CONTROLLER.md "$root/usr/share/doc/palp/CONTROLLER.md"
install -D -m 644 LICENSE "$root/usr/share/doc/palp/copyright"
gzip -9n "$root"/usr/share/man/man*/*
depends="libc6 (>= 2.34)"
[ -n "$DDS" ] && depends="$depends, libddsc0debian"
mkdir -p "$root/DEBIAN" "$root/var/lib/palp"
cat >"$root/DEBIAN/control" <<EOF
Package: palp
Version: $version
Architecture: $arch
Maintainer: The Palp developers <palp@localhost>
Installed-Size: $(du -sk "$root/usr" | cut -f1)
Depends: $depends
Recommends: linux-image-rt-$arch
Suggests: can-utils
Section: science
Priority: optional
Description: feel deformable objects in bounded time
 A hard-real-time controller for haptic devices on CAN drives: elastic contact
 from precompiled Green's functions, solved within each period, with the tools
 that bake and study them and a simulated device.
EOF
dpkg-deb --root-owner-group -Zxz --build "$root" "$build/palp_${version}_$arch.deb"
