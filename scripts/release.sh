#!/usr/bin/env bash
# The programs as others get them: scripts/release.sh [OPTIONS OF CARGO BUILD], such as `-p isocnc-cell`, for another one than isocnc.
#
# The profile `dist`: link-time optimisation, no symbols. Without the paths of this PC: panics and logs name the places of sources, which
# would be those of the PC that built them. Fails where one of these paths is in a program all the same.
set -euo pipefail
cd "$(dirname "$0")/.."

root=$(pwd -P)
target=$(realpath -m "${CARGO_TARGET_DIR:-target}")
cargo=${CARGO_HOME:-$HOME/.cargo}
sysroot=$(rustc --print sysroot)
commit=$(rustc -vV | sed -n 's/^commit-hash: //p')

# A path may have blanks, so flags are separated as cargo wants it then. Of two prefixes that fit, the later one counts.
separator=$'\x1f'
flags=${RUSTFLAGS:-}
flags=${flags// /$separator}
for remap in "$root=/isocnc" "$target=/isocnc/target" "$cargo=/cargo" "$sysroot=/rust" "$sysroot/lib/rustlib/src/rust=/rustc/$commit"; do
    flags+="${flags:+$separator}--remap-path-prefix=$remap"
done
built=$(CARGO_ENCODED_RUSTFLAGS=$flags cargo build --profile dist --message-format json-render-diagnostics "$@")
programs=$(sed -n 's/.*"executable":"\([^"]*\)".*/\1/p' <<<"$built")
[ -n "$programs" ] || { printf 'no program was built: %s\n' "$*" >&2; exit 1; }

while read -r program; do
    found=$(LC_ALL=C grep -aoF -e "$root" -e "$target" -e "$cargo/" -e "$sysroot" -e .cargo/registry "$program" | sort | uniq -c) || true
    [ -z "$found" ] || { printf '%s: paths of this PC are in it, and how often:\n%s\n' "$program" "$found" >&2; exit 1; }
    printf '%s: %s MB, without paths of this PC\n' "$program" "$(($(stat -c %s "$program") / 1000000))"
done <<<"$programs"
