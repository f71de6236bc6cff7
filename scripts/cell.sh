#!/usr/bin/env bash
# A supervisor and a control with a simulated machine, as a user starts them: certificates, a program sent and run, parts ordered, the
# supervisor killed while a part is made.
#
#   cargo build --features cell && cargo build -p isocnc-cell
#   scripts/cell.sh target/debug/isocnc target/debug/isocnc-cell
set -euo pipefail
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
        cat control.log supervisor.log >&2
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
"$cell" ca init --dir ca
"$cell" ca issue mill-1 --dir ca
supervisor
mkdir machine
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
remote = "run"
EOF
"$isocnc" run machine.toml >control.log 2>&1 &
running+=($!)
try says 'drives are not on' "$cell" machines --dir state
echo "linked: $("$cell" machines --dir state)"

printf 'G21 G90\nG1 X10 F3000\nG1 X0\nM2\n' >part.ngc
printf 'G21 G90\nG1 X99999 F3000\nM2\n' >far.ngc
"$cell" upload mill-1 part.ngc --dir state
if "$cell" upload mill-1 far.ngc --dir state >out 2>&1; then fail "a program beyond the travel was taken"; fi
echo "refused: $(cat out)"
if "$cell" run-program mill-1 part.ngc --dir state >out 2>&1; then fail "ran with drives off"; fi
echo "refused: $(cat out)"

try "$isocnc" home --machine "$name"
try says ' ready$' "$cell" machines --dir state
"$cell" run-program mill-1 part.ngc --dir state
try says 'part.ngc .*completed' "$cell" queue --dir state
echo "ran: $("$cell" queue --dir state | tail -1)"

"$cell" queue --dir state add part.ngc --count 5 --axes XYZ --travel X=10
sleep 2
kill -9 "$supervisor"
echo "supervisor killed"
sleep 2
supervisor
try says '5 of 5 parts.* done' "$cell" queue --dir state
"$cell" queue --dir state | head -1
curl -s "http://127.0.0.1:$((port + 1))/overview" | grep -q '"mill-1"' || fail "the page shows no mill-1"
"$cell" journal mill-1 --dir state | tail -3
echo "all as it should be"
