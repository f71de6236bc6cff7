#!/usr/bin/env bash
# Makes the functions of LinuxCNC's HAL components callable row by row without installing LinuxCNC, and prints the path of the
# program that calls them, or compares ours with them.
#
# usage: halrun-oracle.sh                      prints the path; $ISOCNC_HALRUN names it to the tests of components/
#        halrun-oracle.sh compare [CASES]      the long form: CASES (12 if left out) of 2000 rows for each component and set of options
#
# In:  the package linuxcnc-uspace, installed or fetched by scripts/rs274-oracle.sh; a C compiler for halrun-oracle.c.
# Out: exit code 3 and the reason on stderr where there is no such package or compiler; of `compare`, 1 and the differences on stdout.
set -euo pipefail
export LC_ALL=C
here=$(dirname "$(readlink -f "$0")")

unavailable() {
    printf 'halrun-oracle: %s\n' "$*" >&2
    exit 3
}

if [ $# -gt 2 ] || [ "${1-compare}" != compare ]; then
    sed -n '5,6s/^# \(usage: \)\?//p' "$0" >&2
    exit 2
fi
command -v cc >/dev/null || unavailable "no cc to compile halrun-oracle.c with"
rs274=$("$here/rs274-oracle.sh")
modules=$(dirname "$rs274")/root/usr/lib/linuxcnc/modules
[ -d "$modules" ] || modules=/usr/lib/linuxcnc/modules
[ -f "$modules/and2.so" ] || unavailable "$rs274 is there, but no modules of LinuxCNC in $modules"

cache=${ISOCNC_CACHE:-${XDG_CACHE_HOME:-$HOME/.cache}/isocnc}/halrun-oracle
mkdir -p "$cache"
new=$(mktemp "$cache/new.XXXXXX")
cc -O2 -Wall -Wextra -rdynamic -DMODULES="\"$modules\"" -o "$new" "$here/halrun-oracle.c" -ldl -lm
mv "$new" "$cache/halrun-oracle"
"$cache/halrun-oracle" and2 </dev/null | grep -qx 'and2.0.out out bit 0' || unavailable "$modules/and2.so does not run"

if [ $# -eq 0 ]; then
    printf '%s\n' "$cache/halrun-oracle"
    exit 0
fi
cd "$here/.."
ISOCNC_HALRUN=$cache/halrun-oracle ISOCNC_DIFFERENTIAL_CASES=${2-12} ISOCNC_DIFFERENTIAL_ROWS=2000 \
    cargo test -p isocnc-components --test all differential -- --nocapture
