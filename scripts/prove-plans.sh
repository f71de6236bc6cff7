#!/usr/bin/env bash
# Plans programs and shows whether every limit is kept: one row a program.
#
# usage: scripts/prove-plans.sh [options] [DIR | PROGRAM ...]
#   DIR, PROGRAM      programs (*.ngc); left out: our own (examples/proof_programs.rs)
#   --own             our own programs besides those named
#   --small           our own in the size of the tests
#   --machine FILE    machine file; default tests/proof_programs/three-axes.toml. Our own star and lissajous always run on
#                     three-axes-fast.toml
#   --planner NAME    optimal or classic
#   --checker FILE    judge the set-points by a script of your own as well:
#                     FILE samples.csv path.txt --v X,Y,Z --a X,Y,Z --j X,Y,Z --tol MM; exit code 0: nothing is wrong
#   --keep DIR        keep set-points, paths and reports there
#
# $ISOCNC names the program to be judged, else it is built; $PYTHON the Python of the checker. Exit code 0: nothing was over, off or missed.
set -euo pipefail
cd "$(dirname "$0")/.."

machine=tests/proof_programs/three-axes.toml
fast=tests/proof_programs/three-axes-fast.toml
checker='' planner=() own='' size=() keep='' programs=()
while [ $# -gt 0 ]; do
    case $1 in
        --own) own=yes ;;
        --small) size=(--small) ;;
        --machine) machine=$2; shift ;;
        --planner) planner=(--planner "$2"); shift ;;
        --checker) checker=$2; shift ;;
        --keep) keep=$2; shift ;;
        -*) echo "$1: no such option; see the head of this script" >&2; exit 2 ;;
        *) if [ -d "$1" ]; then programs+=("$1"/*.ngc); else programs+=("$1"); fi ;;
    esac
    shift
done
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
if [ -z "${ISOCNC:-}" ]; then
    cargo build --release --quiet
    ISOCNC=target/release/isocnc
fi
if [ -n "$own" ] || [ ${#programs[@]} -eq 0 ]; then
    cargo run --quiet --example proof_programs -- "$work/own" "${size[@]}" >/dev/null
    programs+=("$work"/own/*.ngc)
fi

# The value of a key of a report, the greatest of several.
value() { sed -n "s/^ *\"$2\": \"\?\([^\",]*\)\"\?,\?$/\1/p" "$1" | sort -g | tail -n 1; }
# A limit of all joints of a machine file, with commas.
limits() { sed -n "s/^$2 *= *\([0-9.eE+]*\).*/\1/p" "$1" | paste -sd,; }
percent() { awk -v part="$1" 'BEGIN { printf "%.1f", part * 100 }'; }

row='%-26s %10s %9s %9s %6s %6s %6s %5s %11s %11s  %s\n'
# shellcheck disable=SC2059
printf "$row" program 'motion s' 'plan s' 'blocks/s' 'v %' 'a %' 'j %' over 'off mm' 'missed mm' verdict
failed=0
for program in "${programs[@]}"; do
    name=$(basename "$program" .ngc)
    out=${keep:-$work}
    mkdir -p "$out"
    on=$machine
    case $program:$name in "$work"/own/*:star | "$work"/own/*:lissajous) on=$fast ;; esac
    report=$out/$name.json samples=$out/$name.csv path=$out/$name.path
    if ! "$ISOCNC" plan "$on" "$program" "${planner[@]}" --samples "$samples" --path "$path" --json >"$report" &&
        [ -z "$(value "$report" motion_time_s)" ]; then
        # shellcheck disable=SC2059
        printf "$row" "$name" - - - - - - - - - "REFUSED: $(sed -n 's/^ *"rule": "\(.*\)".*/\1/p' "$report" | head -n 1)"
        failed=$((failed + 1))
        continue
    fi
    allowed=$(value "$report" tolerance_mm)
    over=$(value "$report" cycles_over_limits)
    off=$(value "$report" deviation_max_mm) missed=$(value "$report" missed_max_mm)
    # What rounding of positions takes of an exact path; a polygon of an arc in the checker takes more.
    tolerance=$(awk -v mm="$allowed" 'BEGIN { print (mm > 1e-9 ? mm : 1e-9) }')
    verdict=$(awk -v over="$over" -v off="$off" -v missed="$missed" -v tol="$tolerance" -v len="$(value "$report" path_length_mm)" \
        -v reached="$(value "$report" path_reached_mm)" 'BEGIN {
            # Between two set-points the way is straight: a corner may be missed by the sagitta of that.
            if (over > 0) bad = bad " over-limits"
            if (off > tol * 1.000001) bad = bad " off-path"
            if (missed > tol * 1.01 + 1e-3) bad = bad " missed"
            if (len - reached > tol + 1e-3) bad = bad " not-to-the-end"
            print (bad == "" ? "ok" : "FAILED:" bad) }')
    if [ -n "$checker" ]; then
        if grep -q '^C' "$path"; then
            tolerance=$(awk -v mm="$allowed" 'BEGIN { print (mm > 1e-5 ? mm : 1e-5) }')
        fi
        if "${PYTHON:-python3}" "$checker" "$samples" "$path" --v "$(limits "$on" velocity_mm_s)" --a "$(limits "$on" acceleration_mm_s2)" \
            --j "$(limits "$on" jerk_mm_s3)" --tol "$tolerance" >"$out/$name.check" 2>&1; then
            verdict="$verdict, checker ok"
        else
            verdict="$verdict, CHECKER FAILED: $(grep -oE 'samples over(| programmed feed) [1-9][0-9]*|deviation max [0-9.]+|missed vertex max [0-9.]+|VIOLATIONS [0-9]+|[A-Za-z]*Error.*' "$out/$name.check" | paste -sd' ')"
        fi
    fi
    # shellcheck disable=SC2059
    printf "$row" "$name" "$(printf '%.3f' "$(value "$report" motion_time_s)")" "$(printf '%.3f' "$(value "$report" wall_time_s)")" \
        "$(printf '%.0f' "$(value "$report" blocks_per_s)")" "$(percent "$(value "$report" velocity_share)")" \
        "$(percent "$(value "$report" acceleration_share)")" "$(percent "$(value "$report" jerk_share)")" "$over" \
        "$(printf '%.2e' "$off")" "$(printf '%.2e' "$missed")" "$verdict"
    case $verdict in *FAILED*) failed=$((failed + 1)) ;; esac
    [ -n "$keep" ] || rm -f "$samples" "$path"
done
echo "${#programs[@]} programs, $failed with failures; load average $(cut -d' ' -f1-3 /proc/loadavg)"
[ "$failed" -eq 0 ]
