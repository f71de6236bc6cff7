#!/usr/bin/env bash
# openPOWERLINK's console demos as peers, in a network namespace of their own: their managing node starts our simulated nodes by
# the concise DCF of `isocnc check --cdc`; ours starts their controlled node. Either end is killed and started again.
#
# In:  DEMO_MN, DEMO_CN: demo_mn_console and demo_cn_console of openPOWERLINK 2.7, linked with the stack; ISOCNC: the program to
#      try (target/release/isocnc); SECONDS: how long each network stays under watch (60).
# Out: a line for each thing seen; exit code 0, or 1 and what failed, with the end of each log; 3: a tool or a right is missing.
#
# Nodes are not mandatory here: with mandatory ones that managing node asks for their states without a pause, and on a PC
# without real time its queue of events overflows, also with a controlled node of its own.
set -euo pipefail
export LC_ALL=C

usage="usage: openpowerlink.sh DEMO_MN DEMO_CN [ISOCNC [SECONDS]]"
here=$(dirname "$(readlink -f "$0")")
if [ $# -lt 2 ] || [ $# -gt 4 ]; then
    echo "$usage" >&2
    exit 2
fi
demo_mn=$(readlink -f "$1")
demo_cn=$(readlink -f "$2")
isocnc=$(readlink -f "${3:-$here/../target/release/isocnc}")
watch_s=${4:-60}

missing() {
    printf 'openpowerlink: %s\n' "$*" >&2
    exit 3
}
for program in "$demo_mn" "$demo_cn" "$isocnc"; do
    [ -x "$program" ] || missing "$program is no program"
done
for tool in ip dumpcap mergecap tshark; do
    command -v "$tool" >/dev/null || missing "no $tool"
done
if [ -z "${OPENPOWERLINK_INSIDE:-}" ]; then
    user=()
    [ "$(id -u)" -eq 0 ] || user=(--map-root-user)
    unshare "${user[@]}" --net true || missing "no network namespace may be made here"
    OPENPOWERLINK_INSIDE=1 exec unshare "${user[@]}" --net "$0" "$demo_mn" "$demo_cn" "$isocnc" "$watch_s"
fi

work=$(mktemp -d)
finish() {
    local running
    mapfile -t running < <(jobs -p)
    [ "${#running[@]}" -eq 0 ] || kill -KILL "${running[@]}" 2>/dev/null || true
    rm -rf "$work"
}
trap finish EXIT
cd "$work"

# Whether the pattern $1 is in what comes in, which is read to its end: nobody before the pipe fails because it is closed.
has() { grep -e "$1" >/dev/null; }
ok() { printf 'OK      %s\n' "$*"; }
fail() {
    printf 'FAILED  %s\n' "$*"
    tail -n 15 ./*.log
    exit 1
}
# Waits until the command behind the limit in seconds succeeds.
within() {
    local end=$((SECONDS + $1))
    shift
    until "$@"; do
        [ "$SECONDS" -lt "$end" ] || return 1
        sleep 0.2
    done
}
# Ends process $2 by signal $1 and waits for it.
end() {
    kill "-$1" "$2"
    wait "$2" 2>/dev/null || true
}
# Starts $2... in the background with its output added to $1.log; its process id is then in $started.
start() {
    local log=$1.log
    shift
    "$@" </dev/null >>"$log" 2>&1 &
    started=$!
}

ip link set lo up
ip link add ours type veth peer name theirs
for interface in ours theirs; do
    echo 1 >"/proc/sys/net/ipv6/conf/$interface/disable_ipv6"
    ip link set "$interface" up
done

# Neither end's socket shows the captures of its own PC what it sends: each frame is seen where it arrives.
capture_begins() {
    captures=()
    for interface in ours theirs; do
        dumpcap -q -P -i "$interface" -w "$1-$interface.pcap" 2>/dev/null &
        captures+=($!)
    done
    sleep 1
}
capture_is_clean() {
    local found frames
    for process in "${captures[@]}"; do
        end INT "$process"
    done
    mergecap -F nsecpcap -w "$1.pcap" "$1"-*.pcap
    frames=$(tshark -r "$1.pcap" -T fields -e frame.number 2>/dev/null | wc -l)
    found=$(tshark -r "$1.pcap" -Y 'not epl or _ws.malformed or _ws.expert' 2>/dev/null | head -n 5)
    if [ "$frames" -le 1000 ] || [ -n "$found" ]; then
        fail "$1: $frames frames; what tshark finds in them: $found"
    fi
    ok "$1: $frames frames, none malformed, no warning by tshark"
}

cat >nodes.toml <<END
schema = 1
[machine]
name = "openpowerlink-nodes"
kinematics = "trivial"
cycle_us = 10000
[rt]
require = "warn"
[bus]
kind = "powerlink"
interface = "ours"
async_slot_timeout_us = 2000
pres_lost_max = 20
soc_lost_max = 100
[[bus.node]]
id = 1
name = "x-drive"
profile = "cia402"
mandatory = false
pres_timeout_us = 1000
device_type = 0x00020192
[[bus.node]]
id = 10
name = "io"
profile = "io"
mandatory = false
pres_timeout_us = 1000
device_type = 0x000F0191
[[joint]]
node = 1
counts_per_unit = [10000, 1]
travel_mm = [-5.0, 305.0]
velocity_mm_s = 150.0
acceleration_mm_s2 = 1500.0
jerk_mm_s3 = 30000.0
stop_acceleration_mm_s2 = 3000.0
stop_jerk_mm_s3 = 120000.0
following_error_mm = 8.0
homing = { method = 21, search_mm_s = 40.0, latch_mm_s = 4.0, acceleration_mm_s2 = 500.0, position_mm = 0.0 }
[[axis]]
letter = "X"
joints = [0]
END
cat >io.toml <<END
schema = 1
[machine]
name = "openpowerlink-io"
kinematics = "none"
cycle_us = 10000
[rt]
require = "warn"
late_us_max = 5000
[bus]
kind = "powerlink"
interface = "ours"
async_slot_timeout_us = 2000
pres_lost_max = 20
soc_lost_max = 20
[[bus.node]]
id = 1
name = "io"
profile = "io"
pres_timeout_us = 2000
device_type = 0x000F0191
vendor_id = 0
outputs = ["0x6200:1/8"]
inputs = ["0x6000:1/8"]
END

# --- Their managing node, our controlled nodes ---

their_node_says() { grep -q "Node= *$1, .*State:NmtCs$2\$" theirs.log; }
both_operational() { their_node_says 1 Operational && their_node_says 10 Operational; }
is_lost() { grep -q "Node= *$1, NmtNodeEventError" theirs.log; }
both_lost() { is_lost 1 && is_lost 10; }
their_mn_starts() {
    : >theirs.log
    start theirs "$demo_mn" -d theirs -c nodes.cdc
    mn=$started
}
boots() {
    local began=$SECONDS
    within 60 both_operational || fail "their managing node, $1: not all nodes OPERATIONAL within 60 s"
    ok "their managing node, $1: our nodes OPERATIONAL after $((SECONDS - began)) s"
}
"$isocnc" check nodes.toml --cdc nodes.cdc >check.log 2>&1 || fail "our check refuses the machine file"
capture_begins their-mn
start ours "$isocnc" simulate nodes.toml --interface ours
nodes=$started
sleep 1
their_mn_starts
boots "start"
lost=$(grep -c NmtNodeEventError theirs.log || true)
sleep "$watch_s"
[ "$(grep -c NmtNodeEventError theirs.log || true)" = "$lost" ] || fail "their managing node lost a node in $watch_s s"
ok "their managing node: no node lost in $watch_s s"
for time in first second; do
    end KILL "$mn"
    sleep 1
    their_mn_starts
    boots "killed and started again for the $time time"
done
for time in first second; do
    : >theirs.log
    end KILL "$nodes"
    within 5 both_lost || fail "their managing node does not notice that our nodes are dead"
    : >theirs.log
    start ours "$isocnc" simulate nodes.toml --interface ours
    nodes=$started
    boots "nodes killed and started again for the $time time"
done
end INT "$mn"
end INT "$nodes"
capture_is_clean their-mn

# --- Our managing node, their controlled node ---

ours() { "$isocnc" "$@" --machine openpowerlink-io; }
alone() { "$isocnc" bus "$@" --interface ours; }
operational() { ours bus state 2>/dev/null | has '^ *1 .*OPERATIONAL'; }
machine_is() { ours status 2>/dev/null | has "^state  *$1"; }
alarm_names_node() { ours status | has '^alarm .*node 1.*lost'; }
pin_is() { ours hal get "$1" | has "$2\$"; }
their_cn_starts() {
    start theirs "$demo_cn" -n 1 -d theirs
    cn=$started
}
our_mn_starts() {
    start ours "$isocnc" run io.toml
    mn=$started
    within 30 operational || fail "our managing node, $1: node not OPERATIONAL within 30 s"
    ok "our managing node, $1: their node OPERATIONAL"
}
capture_begins our-mn
their_cn_starts
sleep 2
alone scan | has '^ *1 .*0x000F0191' || fail "bus scan does not find their node"
alone sdo get --node 1 0x1000 0x1018:1 0x1008 >sdo.log || fail "bus sdo get before the start"
alone sdo set --node 1 0x6200:1 5 | has 'after:.*0x05' || fail "bus sdo set before the start"
ok "our bus scan, SDO read and write before the start"
our_mn_starts "start"
for bit in 0 2 5 7; do
    ours hal set "io.1.out-0$bit" 1
done
within 5 pin_is io.1.in-00 true || fail "their input does not arrive at our pin"
ours bus sdo get --node 1 0x6200:1 >sdo.log || fail "bus sdo get beside the control"
grep -q 0xA5 sdo.log || fail "their outputs are not what our pins say"
ok "our managing node: process data both ways, SDO beside them"
sleep "$watch_s"
if ! operational || ! machine_is disabled; then
    fail "our managing node lost their node in $watch_s s"
fi
ok "our managing node: their node OPERATIONAL for $watch_s s more"
for time in first second; do
    end KILL "$cn"
    within 5 machine_is faulted || fail "the loss of their node is no fault"
    within 5 alarm_names_node || fail "the alarm does not name the lost node"
    their_cn_starts
    within 30 operational || fail "their node, started again, is not OPERATIONAL within 30 s"
    ours alarm acknowledge >>check.log 2>&1 || fail "the alarm cannot be acknowledged"
    within 5 machine_is disabled || fail "acknowledged, and still a fault"
    ok "their node killed and started again for the $time time: fault, alarm, OPERATIONAL, acknowledged"
done
end KILL "$mn"
our_mn_starts "killed and started again"
end INT "$mn"
our_mn_starts "ended and started again"
end INT "$mn"
end KILL "$cn"
capture_is_clean our-mn
echo "all good"
