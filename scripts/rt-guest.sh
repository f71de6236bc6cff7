#!/usr/bin/env bash
# Runs isocnc on a PREEMPT_RT kernel with an isolated core, in a virtual machine, and judges how it does there.
#
# In:  a static build of this tree (made here), a Debian real-time kernel (fetched once, kept in a cache folder), QEMU.
# Out: what the check prints; exit code 0 if all of it is as it should be. The PC itself is not changed; no root needed.
#
# The guest has two CPUs, the second one isolated as on a PC that is set up for control:
#   isolcpus=managed_irq,domain,1 nohz_full=1 rcu_nocbs=1 irqaffinity=0
# Its system is busybox in memory: scripts/rt-guest/init starts it, scripts/rt-guest/CHECK-check.sh is what runs in it.
#
# A guest that QEMU emulates (tcg) has no time of its own: this PC's load shows in it, a cycle of 1 ms is often too much for
# it. With icount the guest's time is the number of instructions it has executed, one a nanosecond: this PC's load does not
# show, however long it takes, and figures repeat. That makes `jitter` a gate against changes that make the cycle less steady.
set -euo pipefail
export LC_ALL=C
# dpkg-deb and modinfo are where an ordinary user's PATH may not look.
PATH=$PATH:/usr/sbin:/sbin

usage() {
    cat <<'EOF'
usage: rt-guest.sh [options] demo|dense|doctor|jitter|isolcpus|shell
       rt-guest.sh [options] build

checks, in a virtual machine with a PREEMPT_RT kernel and an isolated core:
  demo        the demo reaches OPERATIONAL and ends its program; both real-time threads run on the isolated core
              under SCHED_FIFO; `run` with rt.require = "strict" refuses nothing
  dense       10,000 blocks a second for --seconds S: no cycle waits for the plan, none is left out or late
              (left out and late are judged with icount only)
  doctor      `isocnc doctor` sees the kernel, the isolated core and its tick as they are
  jitter      `isocnc jitter` on one CPU shared with everything else; the SoC period at the far end of the wire must
              have a standard deviation of 0.3 us at most and a range below 12 us (judged with icount only)
  isolcpus    scripts/isolcpus.sh applies its settings and undoes every one of them
  shell       a shell in the guest, isocnc in its path; `exit` ends the guest

  build       only makes the static program and prints where it is

  --kernel K      kernel series, 6.12 (default) or 6.1, or a file linux-image-...-rt-amd64.deb
  --accel A       icount: time is counted in instructions, slow and repeatable (default of demo, dense, jitter);
                  tcg: emulated as fast as this PC can (default of the others)
  --cycles N      cycles of `jitter` (default 20000; as a gate 100000, some ten minutes)
  --seconds S     seconds of motion of `dense` (default 10)
  --program FILE  use this program instead of building one; where it needs libraries, the guest gets those of this PC
  --target T      build for x86_64-unknown-linux-gnu (default) or x86_64-unknown-linux-musl
  --timeout S     give up after so many seconds, boot included (default 3600)
  --keep DIR      keep the guest's results and its kernel's messages in DIR

needs: qemu-system-x86, busybox-static, cpio, xz-utils (apt-get install); apt-get and dpkg-deb for the kernel
cache: ${ISOCNC_RT_GUEST_CACHE:-${XDG_CACHE_HOME:-~/.cache}/isocnc-rt-guest}

exit code: 0 as it should be, 1 the check failed, 2 wrong usage, 3 something is missing here or the guest did not run
EOF
}

wrong_usage() {
    printf 'rt-guest.sh: %s\n\n' "$1" >&2
    usage >&2
    exit 2
}

# Nothing was found out: the rig, not isocnc, has failed.
cannot() {
    printf 'rt-guest.sh: %s\n' "$*" >&2
    exit 3
}

say() {
    printf '%s\n' "$*" >&2
}

root=$(cd "$(dirname "$0")/.." && pwd)
cache=${ISOCNC_RT_GUEST_CACHE:-${XDG_CACHE_HOME:-$HOME/.cache}/isocnc-rt-guest}
kernel=6.12 accel="" cycles=20000 program="" target=x86_64-unknown-linux-gnu timeout_s=3600 keep="" check="" seconds=10

while [ $# -gt 0 ]; do
    case $1 in
        --kernel | --accel | --cycles | --program | --target | --timeout | --keep | --seconds)
            [ $# -ge 2 ] || wrong_usage "$1 needs a value"
            case $1 in
                --kernel) kernel=$2 ;;
                --accel) accel=$2 ;;
                --cycles) cycles=$2 ;;
                --program) program=$2 ;;
                --target) target=$2 ;;
                --timeout) timeout_s=$2 ;;
                --keep) keep=$2 ;;
                --seconds) seconds=$2 ;;
            esac
            shift 2
            ;;
        -h | --help)
            usage
            exit 0
            ;;
        demo | dense | doctor | jitter | isolcpus | shell | build)
            [ -z "$check" ] || wrong_usage "one check at a time, not $check and $1"
            check=$1
            shift
            ;;
        *) wrong_usage "'$1' is none of demo, dense, doctor, jitter, isolcpus, shell, build or an option" ;;
    esac
done
[ -n "$check" ] || wrong_usage "no check given"
if [ -z "$accel" ]; then
    case $check in demo | dense | jitter) accel=icount ;; *) accel=tcg ;; esac
fi
case $accel in tcg | icount) ;; *) wrong_usage "--accel $accel: expected tcg or icount" ;; esac
case $target in
    x86_64-unknown-linux-gnu | x86_64-unknown-linux-musl) ;;
    *) wrong_usage "--target $target: expected x86_64-unknown-linux-gnu or x86_64-unknown-linux-musl" ;;
esac
[[ $cycles =~ ^[1-9][0-9]{0,8}$ ]] || wrong_usage "--cycles $cycles: expected a number from 1 on"
[[ $seconds =~ ^[1-9][0-9]{0,3}$ ]] || wrong_usage "--seconds $seconds: expected seconds from 1 on"
[[ $timeout_s =~ ^[1-9][0-9]{0,6}$ ]] || wrong_usage "--timeout $timeout_s: expected seconds"

# ---- the program ----------------------------------------------------------------------------------------------------

# Static, so that the guest needs no library.
build_static() {
    say "static build for $target"
    (cd "$root" && RUSTFLAGS="-C target-feature=+crt-static" cargo build --release --quiet --target "$target" --bin isocnc) ||
        cannot "the static build failed"
    program=${CARGO_TARGET_DIR:-$root/target}/$target/release/isocnc
}

is_static() {
    ! ldd "$1" 2>/dev/null | grep -q '=>'
}

if [ "$check" = build ]; then
    build_static
    printf '%s\n' "$program"
    exit 0
fi

missing=()
command -v qemu-system-x86_64 >/dev/null || missing+=(qemu-system-x86)
command -v cpio >/dev/null || missing+=(cpio)
command -v xz >/dev/null || missing+=(xz-utils)
busybox=$(command -v busybox || true)
if [ -z "$busybox" ] || ! is_static "$busybox"; then missing+=(busybox-static); fi
[ ${#missing[@]} -eq 0 ] || cannot "missing here; as root: apt-get install ${missing[*]}"

[ -n "$program" ] || build_static
[ -x "$program" ] || cannot "$program: no such program"

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
trap 'exit 130' INT
trap 'exit 143' TERM

# ---- the kernel -----------------------------------------------------------------------------------------------------

# Debian's package with the newest real-time kernel of a series.
kernel_package() {
    local meta package
    for meta in "linux-image-$1-rt-amd64" linux-image-rt-amd64; do
        package=$(apt-cache depends "$meta" 2>/dev/null | sed -n 's/^ *Depends: \(linux-image-[0-9].*-rt-amd64\)$/\1/p' | head -n 1)
        case $package in "linux-image-$1."*)
            printf '%s\n' "$package"
            return
            ;;
        esac
    done
    return 1
}

# unpack_kernel DEB FOLDER: the two files of it that are needed, vmlinuz and veth.ko.
unpack_kernel() {
    local module
    dpkg-deb -x "$1" "$work/kernel" || cannot "$1 cannot be unpacked"
    mkdir -p "$2"
    cp "$work"/kernel/boot/vmlinuz-* "$2/vmlinuz" || cannot "$1 holds no kernel"
    module=$(find "$work/kernel" -path '*/drivers/net/veth.ko*' -print -quit)
    case $module in
        *.ko) cp "$module" "$2/veth.ko" ;;
        *.ko.xz) xz -dc "$module" >"$2/veth.ko" ;;
        *) cannot "$1 has no module veth that can be read here (found: ${module:-none})" ;;
    esac
    rm -rf "$work/kernel"
}

fetch_kernel() {
    local package folder="$cache/$kernel"
    if [ -f "$kernel" ]; then
        kernel_folder=$work/own-kernel
        unpack_kernel "$kernel" "$kernel_folder"
        return
    fi
    kernel_folder=$folder
    [ ! -e "$folder/veth.ko" ] || return 0
    for tool in apt-cache apt-get dpkg-deb; do
        command -v "$tool" >/dev/null || cannot "no $tool here to fetch a kernel; give one with --kernel FILE.deb"
    done
    package=$(kernel_package "$kernel") ||
        cannot "apt knows no real-time kernel $kernel (apt-get update? Debian only); give one with --kernel FILE.deb"
    say "fetching $package into $cache"
    mkdir -p "$cache" "$work/deb"
    (cd "$work/deb" && apt-get download "$package" >&2) || cannot "$package cannot be fetched"
    unpack_kernel "$work"/deb/*.deb "$work/fetched"
    # Complete or not there, whatever else runs at the same time.
    rm -rf "$folder"
    mv -T "$work/fetched" "$folder" 2>/dev/null || [ -e "$folder/veth.ko" ] || cannot "$folder cannot be written"
    rm -rf "$work/deb"
}
fetch_kernel

# ---- the guest's file system ----------------------------------------------------------------------------------------

guest=$work/guest
mkdir -p "$guest"/{bin,check,modules,scripts,configs}

# add_libraries FILE: the shared libraries that it needs, if any.
add_libraries() {
    local library
    ldd "$1" 2>/dev/null | grep -o '/[^ ]*' | while read -r library; do
        mkdir -p "$guest${library%/*}"
        cp -Ln "$library" "$guest$library"
    done || true
}

cp "$root/scripts/rt-guest/init" "$guest/init"
cp "$root"/scripts/rt-guest/*.sh "$guest/check/"
cp -r "$root"/scripts/isolcpus.sh "$root"/scripts/isolcpus "$guest/scripts/"
cp -r "$root"/configs/. "$guest/configs/"
cp "$kernel_folder/veth.ko" "$guest/modules/"
cp "$busybox" "$guest/bin/busybox"
# Without what only a debugger reads: the guest unpacks it more slowly than this PC would.
strip --strip-debug -o "$guest/bin/isocnc" "$program" || cp "$program" "$guest/bin/isocnc"
add_libraries "$program"
# For isolcpus.sh.
bash=$(command -v bash)
cp -L "$bash" "$guest/bin/bash"
add_libraries "$bash"
chmod 755 "$guest/init" "$guest/bin"/*
if [ "$check" = dense ]; then
    # The bench of the same name knows the machine and the program.
    (cd "$root" && RUSTFLAGS="-C target-feature=+crt-static" cargo bench --quiet --target "$target" --bench dense -- \
        --seconds "$seconds" --write "$guest/dense") || cannot "the bench 'dense' gave no program"
fi
cat >"$guest/check/settings" <<EOF
export RT_GUEST_CHECK=$check RT_GUEST_ACCEL=$accel RT_GUEST_CYCLES=$cycles
EOF
(cd "$guest" && find . | cpio -o -H newc --quiet | gzip -1) >"$work/initramfs"

# ---- the run --------------------------------------------------------------------------------------------------------

cpus=2
command_line="console=ttyS0 quiet panic=-1 8250.nr_uarts=4 nowatchdog"
isolation=" isolcpus=managed_irq,domain,1 nohz_full=1 rcu_nocbs=1 irqaffinity=0"
case $accel in
    tcg) machine=(-accel "tcg,thread=multi") ;;
    icount)
        # One nanosecond an instruction, and no waiting for wall time where the guest idles.
        machine=(-accel "tcg,thread=single" -icount "shift=0,sleep=off")
        if [ "$check" = jitter ] || [ "$check" = dense ]; then
            # QEMU lets the CPUs of such a guest take turns, each until the next timer: a turn of the other one would show as
            # lateness of ours. So there is one CPU, which the real-time threads share with everything else.
            cpus=1 isolation=""
        else
            # A timer every 20 us bounds the turns; it is that of a network filter through which nothing goes.
            machine+=(-netdev "hubport,id=turns,hubid=0" -object "filter-buffer,id=turn,netdev=turns,interval=20")
        fi
        ;;
esac

say "guest: kernel $kernel, $cpus CPU(s), $accel, check '$check'"
code=0
began=$SECONDS
input=/dev/null
[ "$check" != shell ] || input=/dev/stdin
timeout --foreground -k 5 "$timeout_s" qemu-system-x86_64 -M q35 -cpu max -nodefaults -no-user-config -display none \
    -no-reboot -m 768 -smp "$cpus" "${machine[@]}" -kernel "$kernel_folder/vmlinuz" -initrd "$work/initramfs" \
    -append "$command_line$isolation" -chardev stdio,id=output,signal=off \
    -serial "file:$work/kernel.log" -serial chardev:output -serial "file:$work/results.tar" <"$input" 2>"$work/qemu.log" || code=$?

mkdir -p "$work/results"
tar -C "$work/results" -xf "$work/results.tar" 2>/dev/null || true
if [ -n "$keep" ]; then
    mkdir -p "$keep"
    cp -r "$work/results/." "$work/kernel.log" "$keep/"
    say "results: $keep"
fi
if [ ! -s "$work/results/status" ]; then
    say "messages of QEMU, last messages of the guest's kernel:"
    { cat "$work/qemu.log" && tail -n 8 "$work/kernel.log"; } >&2 || true
    case $code in
        124 | 137) cannot "the guest did not end within $timeout_s s (--timeout)" ;;
        *) cannot "the guest ended without a result (QEMU: $code)" ;;
    esac
fi
took="$((SECONDS - began)) s; load average of this PC $(cut -d ' ' -f 1 /proc/loadavg)"
status=$(cat "$work/results/status")
[ "$status" = 0 ] || { say "check '$check' FAILED ($took)"; exit 1; }
say "check '$check' passed ($took)"
