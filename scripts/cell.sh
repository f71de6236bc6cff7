#!/usr/bin/env bash
# A supervisor and a control with a simulated machine, as a user starts them: certificates, a program sent and run, parts ordered, the
# supervisor killed while a part is made; the control without a supervisor, and with less consent; who is refused.
#
#   cargo build --features cell && cargo build -p isocnc-cell
#   scripts/cell.sh target/debug/isocnc target/debug/isocnc-cell
set -euo pipefail
if [ $# -ne 2 ] || [ ! -x "$1" ] || [ ! -x "$2" ]; then
    printf 'usage: %s ISOCNC ISOCNC-CELL, the two programs; they are built by\n' "$0" >&2
    printf '  cargo build --features cell && cargo build -p isocnc-cell\n' >&2
    exit 2
fi
root=$(cd "$(dirname "$0")/.." && pwd)
isocnc=$(realpath "$1")
cell=$(realpath "$2")
folder=$(mktemp -d)
cd "$folder"
running=()

finish() {
    local code=$?
    for process in "${running[@]}"; do kill "$process" 2>/dev/null || true; done
    wait 2>/dev/null || true
    if [ "$code" -ne 0 ]; then
        cat control.log supervisor.log >&2 || true
    fi
    rm -rf "$folder"
    exit "$code"
}
trap finish EXIT

fail() {
    printf '%s\n' "$*" >&2
    exit 1
}

# Tries a command until it succeeds.
try() {
    local left=120
    until "$@" >out 2>&1; do
        left=$((left - 1))
        [ "$left" -gt 0 ] || fail "never succeeded: $*: $(cat out)"
        sleep 0.5
    done
}

says() {
    local wanted=$1
    shift
    "$@" | grep -q "$wanted"
}

supervisor() {
    "$cell" run --dir state --ca ca --listen "127.0.0.1:$port" --page "127.0.0.1:$((port + 1))" >>supervisor.log 2>&1 &
    supervisor=$!
    running+=("$supervisor")
}

port=$((20000 + RANDOM % 20000))
name="cell-$$"
page="http://127.0.0.1:$((port + 1))"

# Starts the control with this consent.
control() {
    sed -e "s/\"mill3-demo\"/\"$name\"/" -e 's/^kind = "powerlink"/kind = "memory"/' -e '/^interface = /d' \
        -e 's/^cycle_us = 1000/state_directory = "machine"\ncycle_us = 1000/' \
        -e 's/^lock_memory = true/overruns_stop = 0\nlock_memory = true/' -e 's/pres_lost_max = 20/pres_lost_max = 1000/' \
        -e 's/following_error_mm = 2.0/following_error_mm = 100.0/' \
        "$root/configs/mill3-demo.toml" >machine.toml
    cat >>machine.toml <<EOF

[cell]
supervisor = "127.0.0.1:$port"
certificate = "ca/mill-1.crt"
key = "ca/mill-1.key"
ca = "ca/ca.crt"
remote = "$1"
EOF
    "$isocnc" run machine.toml >>control.log 2>&1 &
    control=$!
    running+=("$control")
}

# A command that fails, saying this.
refused() {
    local why=$1
    shift
    if "$@" >out 2>&1; then fail "was not refused: $*"; fi
    grep -q "$why" out || fail "refused, but not with '$why': $*: $(cat out)"
    echo "refused: $(cat out)"
}

# Whether the page tells of somebody who was refused for this.
refusals() {
    curl -s "$page/overview" | grep -q "$1"
}

"$cell" ca init --dir ca
"$cell" ca issue mill-1 --dir ca

# The control is there first, works without a supervisor, and says that there is none.
mkdir machine
control run
try "$isocnc" home --machine "$name"
printf 'G21 G90\nG1 X10 F3000\nG1 X0\nM2\n' >part.ngc
printf 'G21 G90\nG1 X99999 F3000\nM2\n' >far.ngc
"$isocnc" program run part.ngc --machine "$name" >out 2>&1 || fail "$(cat out)"
grep -q "127.0.0.1:$port is not reached" control.log || fail "the control does not say that it has no supervisor"
echo "alone: $(grep -m1 'is not reached' control.log)"

supervisor
try says ' ready$' "$cell" machines --dir state
echo "linked: $("$cell" machines --dir state)"
try says 'part.ngc' "$cell" journal mill-1 --dir state

"$cell" upload mill-1 part.ngc --dir state
refused 'far.ngc' "$cell" upload mill-1 far.ngc --dir state
refused 'has no other.ngc' "$cell" run-program mill-1 other.ngc --dir state
refused 'no machine' "$cell" upload mill-2 part.ngc --dir state

# Moved by hand, it is the operator's until he hands it over.
"$isocnc" jog X 5 --machine "$name" >out 2>&1 || fail "$(cat out)"
try says 'moved by hand' "$cell" machines --dir state
refused 'moved by hand' "$cell" run-program mill-1 part.ngc --dir state
try "$isocnc" home --machine "$name"
try says ' ready$' "$cell" machines --dir state
"$cell" run-program mill-1 part.ngc --dir state
try says 'part.ngc .*completed' "$cell" queue --dir state
echo "ran: $("$cell" queue --dir state | grep -m1 completed)"

"$cell" queue --dir state add part.ngc --count 5 --axes XYZ --travel X=10
sleep 2
kill -9 "$supervisor"
echo "supervisor killed"
"$isocnc" status --machine "$name" >out 2>&1 || fail "the control does not bear it: $(cat out)"
sleep 2
supervisor
try says '5 of 5 parts.* done' "$cell" queue --dir state
"$cell" queue --dir state | head -1
curl -s "$page/overview" | grep -q '"mill-1"' || fail "the page shows no mill-1"
"$cell" journal mill-1 --dir state | tail -3
for ask in machines queue 'journal mill-1'; do
    # Words apart.
    # shellcheck disable=SC2086
    "$cell" $ask --dir state --json | python3 -m json.tool >out || fail "$ask --json is no JSON"
done

# Who is not of this cell: without a certificate, with that of another one.
curl -sk --max-time 5 "https://127.0.0.1:$port/" >out || true
try refusals 'encryption'
"$cell" ca init --dir other >out
"$cell" ca issue mill-1 --dir other >out
curl -sk --max-time 5 --cert other/mill-1.crt --key other/mill-1.key "https://127.0.0.1:$port/" >out || true

# Another consent, after a restart: looking, holding and stopping only.
kill "$control"
wait "$control" || true
control off
try says 'does not let the supervisor run' "$cell" machines --dir state
refused 'remote = "upload"' "$cell" upload mill-1 part.ngc --dir state
refused 'remote = "run"' "$cell" run-program mill-1 part.ngc --dir state
try "$isocnc" home --machine "$name"
printf 'G21 G90\nG1 X50 F60\nM2\n' >slow.ngc
"$isocnc" program run slow.ngc --machine "$name" >slow.log 2>&1 &
running+=($!)
try says ' running ' "$cell" machines --dir state
"$cell" hold mill-1 --dir state
try says ' held ' "$cell" machines --dir state
"$cell" stop mill-1 --dir state
try says ' idle ' "$cell" machines --dir state
echo "held and stopped by the supervisor, which may do nothing else"

refused 'is reached, and would be back at once' "$cell" machines --forget mill-1 --dir state
"$cell" ca revoke mill-1 --dir ca
try refusals 'mill-1.1 is revoked'
try says 'not reached; it works on alone' "$cell" machines --dir state
curl -s "$page/overview" | python3 -c 'import json, sys; [print("page:", one["text"]) for one in json.load(sys.stdin)["refusals"]]'
"$isocnc" status --machine "$name" >out 2>&1 || fail "the control does not bear it: $(cat out)"
"$cell" machines --forget mill-1 --dir state
[ -z "$("$cell" machines --dir state)" ] || fail "it is on the list still: $("$cell" machines --dir state)"
refused 'no machine' "$cell" machines --forget mill-1 --dir state
refused 'no machine' "$cell" journal mill-1 --dir state
echo "all as it should be"
