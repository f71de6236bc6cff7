#!/usr/bin/env bash
# SOEM brings our simulated EtherCAT devices to OP over a veth pair, in a network namespace of its own.
#
# In:  SIMULATE: the example `simulate` of isocnc-ethercat; PYTHON: an interpreter that has pysoem (python3); ISOCNC: where it is
#      given, that program simulates configs/mill3-ethercat.toml as well.
# Out: a line for each thing seen; exit code 0, or 1 and what failed; 3: a tool or a right is missing.
set -euo pipefail

here=$(dirname "$(readlink -f "$0")")
simulate=$(readlink -f "${1:-$here/../target/release/examples/simulate}")
python=${2:-python3}
isocnc=${3:+$(readlink -f "$3")}

missing() {
    printf 'soem: %s\n' "$*" >&2
    exit 3
}
[ -x "$simulate" ] || missing "$simulate is no program"
"$python" -c 'import pysoem' 2>/dev/null || missing "$python has no pysoem"
if [ -z "${SOEM_INSIDE:-}" ]; then
    user=()
    [ "$(id -u)" -eq 0 ] || user=(--map-root-user)
    unshare "${user[@]}" --net true || missing "no network namespace may be made here"
    SOEM_INSIDE=1 exec unshare "${user[@]}" --net "$0" "$simulate" "$python" ${isocnc:+"$isocnc"}
fi
ip link add main type veth peer name devices
ip link set main up
ip link set devices up
"$simulate" devices 2 &
simulated=$!
trap 'kill "$simulated" 2>/dev/null || true' EXIT
sleep 1
"$python" "$here/soem.py" main
[ -n "$isocnc" ] || exit 0
kill "$simulated"
wait "$simulated" 2>/dev/null || true
"$isocnc" simulate "$here/../configs/mill3-ethercat.toml" --interface devices &
simulated=$!
sleep 1
"$python" "$here/soem.py" main machine
