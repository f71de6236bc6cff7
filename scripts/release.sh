#!/usr/bin/env bash
# The programs as others get them: scripts/release.sh [OPTIONS OF CARGO BUILD]; without options isocnc, with the link to a supervisor, and
# isocnc-cell. Prints where each one is. Needs python3 with venv; the linker comes from PyPI.
#
# The profile `dist`: link-time optimisation, no symbols. Linked by zig against the symbols of an old glibc, so that the programs run on
# every distribution since then, not only on those that are as new as this PC. Without the paths of this PC: panics and logs name the places
# of sources, which would be those of the PC that built them, and two folders would give two programs. Fails where one of these paths is in
# a program all the same, or a newer glibc is needed.
set -euo pipefail
cd "$(dirname "$0")/.."
[ $# -gt 0 ] || set -- -p isocnc -p isocnc-cell --features isocnc/cell

triple=x86_64-unknown-linux-gnu
glibc=2.31
root=$(pwd -P)
target=$(realpath -m "${CARGO_TARGET_DIR:-target}")
cargo=${CARGO_HOME:-$HOME/.cargo}
sysroot=$(rustc --print sysroot)
commit=$(rustc -vV | sed -n 's/^commit-hash: //p')

# Versions are fixed: another linker makes another program.
linker=$target/zig
if ! "$linker/bin/cargo-zigbuild" --version >/dev/null 2>&1; then
    python3 -m venv "$linker" && "$linker/bin/pip" install --quiet ziglang==0.17.1 cargo-zigbuild==0.24.1 >&2
fi
export PATH=$linker/bin:$PATH CARGO_ZIGBUILD_CACHE_DIR=$linker/cache ZIG_GLOBAL_CACHE_DIR=$linker/cache/zig
# What a debugger reads has paths of this PC.
export CFLAGS=-g0

# A path may have blanks, so flags are separated as cargo wants it then. Of two prefixes that fit, the later one counts.
separator=$'\x1f'
flags=${RUSTFLAGS:-}
flags=${flags// /$separator}
for remap in "$root=/isocnc" "$target=/isocnc/target" "$cargo=/cargo" "$sysroot=/rust" "$sysroot/lib/rustlib/src/rust=/rustc/$commit"; do
    flags+="${flags:+$separator}--remap-path-prefix=$remap"
done
built=$(CARGO_INCREMENTAL=0 CARGO_ENCODED_RUSTFLAGS=$flags cargo zigbuild --locked --profile dist --target "$triple.$glibc" \
    --message-format json-render-diagnostics "$@")
programs=$(sed -n 's/.*"executable":"\([^"]*\)".*/\1/p' <<<"$built")
[ -n "$programs" ] || { printf 'no program was built: %s\n' "$*" >&2; exit 1; }

while read -r program; do
    found=$(LC_ALL=C grep -aoF -e "$root" -e "$target" -e "$cargo/" -e "$sysroot" -e .cargo/registry "$program" | sort | uniq -c) || true
    [ -z "$found" ] || { printf '%s: paths of this PC are in it, and how often:\n%s\n' "$program" "$found" >&2; exit 1; }
    needed=$(objdump -T "$program" | sed -n 's/.*GLIBC_\([0-9][0-9.]*\).*/\1/p' | sort -Vu | tail -n 1)
    [ "$(printf '%s\n' "$needed" "$glibc" | sort -V | tail -n 1)" = "$glibc" ] ||
        { printf '%s: needs glibc %s, more than %s\n' "$program" "$needed" "$glibc" >&2; exit 1; }
    printf '%s: %s MB, without paths of this PC, runs on glibc %s\n' "$program" "$(($(stat -c %s "$program") / 1000000))" "$needed"
done <<<"$programs"
