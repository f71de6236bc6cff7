#!/usr/bin/env bash
# A PC that is a control as soon as it is switched on: an image for a USB stick or a disk, and a try of it in QEMU.
#
#   image.sh [--out FILE] [--package FILE.deb] [--suite SUITE]    makes the image; as root
#   image.sh --try [--uefi] [--out FILE] [--keep FOLDER] [--timeout S]    boots a copy of it: how long to the panel, what the doctor says
#
# In:  the Debian package of scripts/package.sh; Debian, by mmdebstrap, from where this PC's apt takes it.
# Out: FILE, target/package/isocnc.img: boots by BIOS and by UEFI (without Secure Boot). PREEMPT_RT kernel, CPU 1 isolated, the machine of the
#      demo in memory as service `isocnc`, its panel on the screen and at port 8402 for whoever has a token.
set -euo pipefail
export LC_ALL=C PATH=$PATH:/usr/sbin:/sbin
cd "$(dirname "$0")/.."

folder=${CARGO_TARGET_DIR:-target}/package
out=$folder/isocnc.img package="" suite=trixie try="" keep="" timeout_s=900 firmware=()
while [ $# -gt 0 ]; do
    case $1 in
        --try) try=yes && shift && continue ;;
        --uefi) firmware=(-bios /usr/share/ovmf/OVMF.fd) && shift && continue ;;
        --out) out=$2 ;;
        --package) package=$2 ;;
        --suite) suite=$2 ;;
        --keep) keep=$2 ;;
        --timeout) timeout_s=$2 ;;
        *) sed -n 4,5p "$0" >&2 && exit 2 ;;
    esac
    shift 2
done
cannot() {
    printf 'image.sh: %s\n' "$*" >&2
    exit 3
}
needs() {
    local tool
    for tool in "$@"; do command -v "${tool%%=*}" >/dev/null || cannot "missing here; as root: apt-get install ${tool##*=}"; done
}
work=$(mktemp -d -p "$(dirname "$out")")
trap 'rm -rf --one-file-system "$work"' EXIT

# ---- the image ------------------------------------------------------------------------------------------------------

packages=systemd-sysv,systemd-repart,udev,dbus,libpam-systemd,linux-image-rt-amd64,initramfs-tools,zstd,grub-pc-bin,grub-efi-amd64-bin
packages+=,grub-common,cage,chromium,fonts-dejavu-core,iproute2,ethtool,kmod,procps,less,nano

# The machine of the demo, on a wire in memory, as a service has it.
machine_file() {
    sed -e '/^\[machine\]/a state_directory = "/var/lib/isocnc"' -e 's/^kind = "powerlink"/kind = "memory"/' configs/mill3-demo.toml
    # Addresses of the loopback need no token, all others do.
    printf '\n[panel]\naddress = "0.0.0.0:8402"\n'
}

root_folder() {
    local mirror root=$work/root unit
    # shellcheck disable=SC2016
    mirror=$(apt-get indextargets --format '$(REPO_URI)' 'Created-By: Packages' 'Origin: Debian' | head -n 1)
    mmdebstrap --variant=minbase --include="$packages" --components=main "$suite" "$root" "$mirror"
    cp "$package" "$root/isocnc.deb"
    chroot "$root" dpkg -i /isocnc.deb
    rm "$root/isocnc.deb"
    machine_file >"$root/etc/isocnc/machine.toml"
    install -D -m 755 scripts/image/isocnc-first-look "$root/usr/local/sbin/isocnc-first-look"
    for unit in scripts/image/*.service; do install -D -m 644 "$unit" "$root/etc/systemd/system/${unit##*/}"; done
    systemctl --root "$root" enable isocnc isocnc-isolcpus isocnc-first-look isocnc-kiosk systemd-networkd
    # The console, for whoever stands at the PC, is that of root; no password is asked for and none opens anything from elsewhere.
    install -D -m 644 scripts/image/tty2-root.conf "$root/etc/systemd/system/getty@tty2.service.d/root.conf"
    systemctl --root "$root" enable getty@tty2
    printf 'cat /var/lib/isocnc/doctor.txt\n' >>"$root/root/.profile"
    echo isocnc >"$root/etc/hostname"
    mkdir -p "$root/etc/systemd/network" "$root/etc/repart.d"
    # An interface that is reserved for drives gets a file of its own, with a lower number.
    printf '[Match]\nType=ether\n[Network]\nDHCP=yes\n' >"$root/etc/systemd/network/80-dhcp.network"
    # The whole stick, from the first boot on.
    printf '[Partition]\nType=root\n' >"$root/etc/repart.d/root.conf"
    echo 'LABEL=isocnc / ext4 noatime,errors=remount-ro,x-systemd.growfs 0 1' >"$root/etc/fstab"
    install -D -m 644 scripts/image/grub.cfg "$root/boot/grub/grub.cfg"
    if [ ! -e "$root/vmlinuz" ] || [ ! -e "$root/initrd.img" ]; then cannot "no kernel in the root"; fi
}

# boot_loader FORMAT FILE MODULE...: GRUB in one file, which looks for the root by its name.
boot_loader() {
    cp scripts/image/early.cfg "$work/root/tmp"
    chroot "$work/root" grub-mkimage -O "$1" -c /tmp/early.cfg -p /boot/grub -o /tmp/loader \
        part_gpt ext2 search search_label normal configfile linux boot "${@:3}"
    mv "$work/root/tmp/loader" "$2"
    rm "$work/root/tmp/early.cfg"
}

# number BYTES VALUE: little endian.
number() {
    local hex=""
    for ((i = 0; i < $1; i++)); do hex+=$(printf '\\x%02x' $((($2 >> (8 * i)) & 255))); done
    printf '%b' "$hex"
}

# at OCTET: what comes, into the image.
at() {
    dd of="$work/image" bs=1 seek="$1" conv=notrunc status=none
}

disk() {
    local root_mib root=$work/root bios=2048 esp=4096 first=135168
    boot_loader i386-pc "$work/core.img" biosdisk all_video
    boot_loader x86_64-efi "$work/BOOTX64.EFI" efi_gop fat all_video
    root_mib=$(($(du -smx "$root" | cut -f 1) * 115 / 100 + 300))
    truncate -s "$((root_mib + 68))M" "$work/image"
    sfdisk --quiet "$work/image" <<END
label: gpt
start=$bios, size=2048, type=21686148-6449-6E6F-744E-656564454649
start=$esp, size=131072, type=uefi
start=$first, size=$((root_mib * 2048)), type=4f68bce3-e8cd-4db1-96e7-fbcaf984b709
END
    mke2fs -q -t ext4 -L isocnc -d "$root" -E "offset=$((first * 512))" "$work/image" "${root_mib}M"
    mformat -i "$work/image@@$((esp * 512))" -F -T 131072 -v EFI ::
    mmd -i "$work/image@@$((esp * 512))" ::/EFI ::/EFI/BOOT
    mcopy -i "$work/image@@$((esp * 512))" "$work/BOOTX64.EFI" ::/EFI/BOOT/
    # For a BIOS: the first sector says where GRUB begins, and GRUB's first sector where the rest of it is.
    head -c 440 "$root/usr/lib/grub/i386-pc/boot.img" | at 0
    number 8 $bios | at 92
    at $((bios * 512)) <"$work/core.img"
    number 8 $((bios + 1)) | at $((bios * 512 + 500))
}

make_image() {
    [ "$(id -u)" -eq 0 ] || cannot "needs root"
    needs mmdebstrap sfdisk=fdisk mke2fs=e2fsprogs mformat=mtools
    [ -n "$package" ] || package=$(find "$folder" -maxdepth 1 -name 'isocnc_*_amd64.deb')
    [ -s "$package" ] || cannot "no package: scripts/package.sh makes it, or --package FILE.deb"
    root_folder
    disk
    mv "$work/image" "$out"
    printf '%s: %s MB; onto a stick: dd if=%s of=/dev/STICK bs=4M conv=fsync status=progress\n' \
        "$out" "$(($(stat -c %s "$out") / 1000000))" "$out"
}

# ---- the try --------------------------------------------------------------------------------------------------------

# A text console makes a small picture, a panel a large one.
drawn=25000

try_image() {
    local machine=(-accel "tcg,thread=multi" -cpu max) begun now page="" screen="" port=18402
    needs qemu-system-x86_64=qemu-system-x86 qemu-img=qemu-utils curl
    [ -s "$out" ] || cannot "$out: no image"
    [ -n "$keep" ] || keep=$folder/try
    mkdir -p "$keep"
    keep=$(realpath "$keep")
    if [ -w /dev/kvm ] && grep -qwE 'vmx|svm' /proc/cpuinfo; then
        machine=(-accel kvm -cpu host)
        echo "with KVM: times are those of a PC"
    else
        echo "without KVM: every instruction is emulated, some ten times slower than on a PC"
    fi
    qemu-img create -q -f qcow2 -F raw -b "$(realpath "$out")" "$work/disk" 8G
    rm -f "$keep"/*.png
    : >"$keep/doctor.txt"
    coproc QEMU { exec qemu-system-x86_64 -M q35 "${machine[@]}" -m 2048 -smp 2 -nodefaults -no-user-config -display none -vga std \
        "${firmware[@]}" -drive "file=$work/disk,if=virtio,format=qcow2" \
        -nic "user,model=virtio-net-pci,hostfwd=tcp:127.0.0.1:$port-:8402" -device virtio-serial \
        -chardev "file,id=report,path=$keep/doctor.txt" -device virtserialport,chardev=report,name=org.isocnc.report \
        -monitor stdio >"$keep/qemu.log" 2>&1; }
    begun=$SECONDS
    while [ -z "$page" ] || [ -z "$screen" ] || [ ! -s "$keep/doctor.txt" ]; do
        now=$((SECONDS - begun))
        [ "$now" -lt "$timeout_s" ] || break
        sleep 3
        kill -0 "$QEMU_PID" || cannot "QEMU ended: $(tail -n 3 "$keep/qemu.log")"
        echo "screendump $keep/$(printf %04d "$now").png -f png" >&"${QEMU[1]}"
        # The address that the guest has of QEMU: a panel answers to no other one.
        if [ -z "$page" ] && curl -s -m 5 -H "Host: 10.0.2.15:8402" "http://127.0.0.1:$port/" | grep -qi "<html"; then
            page=$now
            echo "after $now s: the control serves its panel on the network"
        fi
        if [ -z "$screen" ] && [ -n "$(find "$keep" -name '*.png' -size "+${drawn}c")" ]; then
            screen=$now
            echo "after $now s: the screen shows more than text: $keep"
        fi
    done
    sleep 10
    echo "screendump $keep/last.png -f png" >&"${QEMU[1]}"
    sleep 3
    echo quit >&"${QEMU[1]}"
    wait "$QEMU_PID" || true
    cat "$keep/doctor.txt"
    if [ -z "$page" ] || [ -z "$screen" ]; then cannot "no panel within $timeout_s s"; fi
    grep -q "no must is missing" "$keep/doctor.txt" || { echo "the doctor misses a must"; exit 1; }
}

if [ -n "$try" ]; then try_image; else make_image; fi
