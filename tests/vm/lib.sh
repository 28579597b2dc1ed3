# SPDX-License-Identifier: MIT
# PREEMPT_RT kernels in QEMU for shell tests: vm_fetch ARCH, vm_initrd ARCH SCRIPT OUT, vm_boot ARCH INITRD SECONDS.
# ARCH is amd64 or arm64. Kernels and busybox come from Debian's packages, unpacked into the build folder.
vm=$here/$BUILD/vm

vm_fetch() {
    arch=$1 place=$vm/$1
    [ -f "$place/kernel" ] && [ -f "$place/busybox" ] && return 0
    mkdir -p "$place/lists/partial" "$place/cache/archives/partial"
    set -- -o APT::Architecture=$arch -o APT::Architectures::=$arch -o Dir::State::Lists="$place/lists" -o Dir::Cache="$place/cache" \
        -o Dir::State::status=/dev/null -o APT::Sandbox::User=root
    (
        cd "$place" && apt-get "$@" -qq update && package=$(apt-cache "$@" depends linux-image-rt-$arch | awk '/Depends: linux-image/{print $2}') &&
            apt-get "$@" -qq download "$package" busybox-static && for deb in *.deb; do dpkg -x "$deb" root; done && rm -f *.deb &&
            cp root/boot/vmlinuz-* kernel && cp root/bin/busybox busybox &&
            rm -rf root/usr root/etc root/bin root/boot
    ) >"$place/log" 2>&1
}

vm_initrd() {
    arch=$1 script=$2 out=$3 root=$work/root-$1-$$
    case $arch in amd64) cc=gcc static=$here/$BUILD/static ;; arm64) cc=aarch64-linux-gnu-gcc static=$here/build/aarch64-linux-gnu/static ;; esac
    mkdir -p "$root/bin" "$root/mods" "$root/proc" "$root/sys" "$root/dev" "$root/tmp"
    for m in can can-raw can-dev vcan sja1000 kvaser_pci slcan; do
        file=$(find "$vm/$arch/root/lib/modules" -name "$m.ko" | head -1)
        [ -n "$file" ] && cp "$file" "$root/mods/"
    done
    cp "$vm/$arch/busybox" "$static/palpd" "$static/palp-sim" "$root/bin/"
    for tool in canlink slcan; do $cc -O1 -static -std=gnu11 -o "$root/bin/$tool" "$here/tests/vm/$tool.c" || return 1; done
    [ $arch = amd64 ] && for tool in candump canplayer strace; do # of the host, with their libraries
        file=$(command -v $tool) || continue
        cp "$file" "$root/bin/"
        for lib in $(ldd "$file" | grep -oE '/lib[^ ]+'); do mkdir -p "$root${lib%/*}" && cp "$lib" "$root$lib"; done
    done
    {
        cat <<'EOF'
#!/bin/busybox sh
/bin/busybox --install -s /bin
export PATH=/bin
mount -t proc none /proc; mount -t sysfs none /sys; mount -t devtmpfs none /dev
mkdir -p /dev/pts; mount -t devpts none /dev/pts
for m in can can-raw can-dev vcan sja1000 kvaser_pci slcan; do [ -f /mods/$m.ko ] && insmod /mods/$m.ko; done
for i in 0 1; do ip link add dev vcan$i type vcan; ip link set vcan$i mtu 72; ip link set vcan$i up; done
echo "KERNEL $(uname -m) $(uname -v)"
EOF
        cat "$script"
        echo "poweroff -f"
    } >"$root/init"
    chmod +x "$root/init"
    [ -d "$work/files" ] && cp -r "$work"/files/. "$root/"
    (cd "$root" && find . | cpio -o -H newc --quiet -R 0:0 | gzip -1) >"$out"
    rm -rf "$root"
}

# vm_boot ARCH INITRD SECONDS OPTIONS...: the console goes to standard output
vm_boot() {
    arch=$1 initrd=$2 limit=$3
    shift 3
    common="-smp 1 -m 512 -nodefaults -no-user-config -display none -serial stdio -no-reboot"
    case $arch in
    amd64)
        timeout "$limit" qemu-system-x86_64 -accel tcg -cpu qemu64 -M q35,hpet=off $common "$@" -kernel "$vm/amd64/kernel" -initrd "$initrd" \
            -append "console=ttyS0 quiet panic=-1 tsc=reliable mitigations=off" </dev/null ;;
    arm64)
        timeout "$limit" qemu-system-aarch64 -accel tcg -cpu cortex-a53 -M virt $common "$@" -kernel "$vm/arm64/kernel" -initrd "$initrd" \
            -append "console=ttyAMA0 quiet panic=-1" </dev/null ;;
    esac | tr -d '\r'
}
