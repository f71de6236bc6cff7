#!/usr/bin/env bash
# Prints the standing figures of this tree, one line each: name, value, unit.
#
# usage: scripts/figures.sh [--quick] [--row NAME] [--programs DIR]
#   --quick         leaves out the clean build and the tests
#   --row NAME      prints a row for the table of docs/figures.md as well, with this name
#   --programs DIR  motion times of the programs (*.ngc) of this folder; left out: of our own (examples/proof_programs.rs)
#
# Timings are as good as the PC is quiet: its load and the time taken by a host are printed beside them. The builds use a
# folder of their own, so that they are clean and what stands in target/ stays.
set -euo pipefail
export LC_ALL=C
cd "$(dirname "$0")/.."

quick='' row='' programs=''
while [ $# -gt 0 ]; do
    case $1 in
        --quick) quick=yes ;;
        --row) row=$2; shift ;;
        --programs) programs=$2; shift ;;
        *) sed -n '2,11s/^# \{0,1\}//p' "$0" >&2; exit 2 ;;
    esac
    shift
done
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

names=() values=()
figure() {
    printf '%-44s %12s %s\n' "$1" "$2" "${3:-}"
    names+=("$1")
    values+=("$2")
}
# Ticks that the host took, of all ticks.
steal() { awk '/^cpu /{ print $9, $2 + $3 + $4 + $5 + $6 + $7 + $8 + $9 }' /proc/stat; }
# What a command takes: seconds, and those of all processors together, which tell the same on a busy PC. Its output goes to $work/log.
cost() {
    local name=$1 TIMEFORMAT='%R %U %S' taken
    shift
    taken=$({ time "$@" >"$work/log" 2>&1; } 2>&1) || { tail -n 20 "$work/log" >&2; echo "figures.sh: failed: $*" >&2; exit 1; }
    read -r real user system <<<"$taken"
    figure "$name" "$real" s
    figure "$name, of all processors" "$(awk -v u="$user" -v s="$system" 'BEGIN { printf "%.0f", u + s }')" s
}
# The first number behind a key of a JSON file.
value() { sed -n "s/^ *\"$2\": \([-0-9.eE+]*\),\?$/\1/p" "$1" | sed -n 1p; }

read -r stolen_before ticks_before < <(steal)

lines=$(git ls-files 'src/*.rs' '*/src/*.rs' ':!fuzz' | grep -vE '(^|/)(tests|testing)(/|_|\.rs)|_tests?\.rs$|/tests?_' \
    | xargs awk 'FNR == 1 { skip = 0 } /^#\[cfg\(test\)\]/ { skip = 1 } !skip { n++ } END { print n }')
figure "lines of product code" "$lines" "without tests"

if [ -z "$quick" ]; then
    cost "clean release build" cargo build --release --target-dir "$work/target"
    cost "clean build of all tests" cargo test --workspace --no-run --target-dir "$work/target"
    cost "all tests" cargo test --workspace --target-dir "$work/target"
    rm -rf "$work/target"
fi
cargo build --release --quiet
isocnc=target/release/isocnc
figure "size of the program" "$(($(stat -c %s "$isocnc") / 1024))" KiB
strip -o "$work/stripped" "$isocnc"
figure "size of the program, stripped" "$(($(stat -c %s "$work/stripped") / 1024))" KiB

# The control of the demo: the process that leads; memory at its greatest.
"$isocnc" demo --program configs/short-part.ngc --out "$work/out" >"$work/demo.log" 2>&1 &
demo=$!
peak=0 locked=0
while kill -0 "$demo" 2>/dev/null; do
    read -r rss lck < <(awk '/^VmHWM/{ r = $2 } /^VmLck/{ l = $2 } END { print r + 0, l + 0 }' "/proc/$demo/status" 2>/dev/null || echo 0 0)
    [ "${rss:-0}" -gt "$peak" ] && peak=$rss
    [ "${lck:-0}" -gt "$locked" ] && locked=$lck
    sleep 0.1
done
wait "$demo" || echo "figures.sh: the demo ended with exit code $?: its figures are those of a run with trouble" >&2
figure "memory of the control, greatest resident" "$peak" KiB
figure "memory of the control, locked" "$locked" KiB
figure "time to OPERATIONAL" "$(sed -n 's/.*operational  *after  *\([0-9.]*\) s.*/\1/ip' "$work/demo.log" | sed -n 1p)" s

if [ -z "$programs" ]; then
    cargo run --release --quiet --example proof_programs -- "$work/programs" >/dev/null
    programs=$work/programs
fi
for program in "$programs"/*.ngc; do
    name=$(basename "$program" .ngc)
    "$isocnc" plan tests/proof_programs/three-axes.toml "$program" --json >"$work/plan.json" 2>"$work/log" || true
    figure "motion time: $name" "$(value "$work/plan.json" motion_time_s)" s
    figure "planning: $name" "$(value "$work/plan.json" blocks_per_s)" blocks/s
done

read -r stolen ticks < <(steal)
figure "load average" "$(cut -d' ' -f1 /proc/loadavg)"
figure "taken by the host" "$(awk -v s=$((stolen - stolen_before)) -v t=$((ticks - ticks_before)) 'BEGIN { printf "%.1f", t ? 100 * s / t : 0 }')" %

if [ -n "$row" ]; then
    printf '\n| %s |' "$row"
    printf ' %s |' "${values[@]}"
    printf '\n'
fi
