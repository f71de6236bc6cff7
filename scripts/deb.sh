#!/usr/bin/env bash
# The Debian package: scripts/deb.sh. Needs cargo-deb.
#
# Writes target/debian/isocnc_VERSION_ARCH.deb: program, systemd unit, examples, probing cycles, isolcpus.sh, pages of the manual, completion.
set -euo pipefail
cd "$(dirname "$0")/.."

scripts/release.sh
made=target/deb
rm -rf "$made" target/debian
mkdir -p "$made"
program=target/dist/isocnc
"$program" man "$made/man1"
for shell in bash zsh fish; do
    "$program" completions "$shell" >"$made/isocnc.$shell"
done
# A package puts the program elsewhere than a user does.
sed 's#/usr/local/bin/isocnc#/usr/bin/isocnc#' configs/isocnc.service >"$made/isocnc.service"
cargo deb --profile dist --no-build --no-strip
