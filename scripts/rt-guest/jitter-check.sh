#!/bin/sh
# `isocnc jitter`: the SoC period at the far end of the wire while a program runs; judged where the guest's time is counted in
# instructions, only printed where it is that of a PC that emulates.
#
# The timing is set, not calibrated, so that every run is the same; nothing keeps the core awake, because emulated idleness
# costs no time to leave.
# shellcheck source=scripts/rt-guest/lib.sh
. /check/lib.sh
std_max_us=0.3
range_max_us=12

sed -e 's/^calibrate = true/calibrate = false/' -e 's/^# spin_us = 50/spin_us = 50/' -e 's/^# phase_us = 375/phase_us = 375/' \
    -e 's/^# keep_awake = "dma-latency"/keep_awake = "none"/' /configs/mill3-demo.toml >/results/machine.toml
# The program is that of the demo, repeated: to plan the large one that `jitter` generates takes the guest minutes before it begins.
isocnc jitter --machine /results/machine.toml --program /configs/sample-part.ngc --cycles "$RT_GUEST_CYCLES" --rounds 1 --no-floor \
    --out /results/jitter --json >/results/jitter.json
expect "exit code" $? 0
# Without white space, whatever the layout of the JSON is.
tr -d ' \n' </results/jitter.json >/results/compact.json
expect "result" "$(sed -n 's/^[^}]*"result":"\([a-z]*\)".*/\1/p' /results/compact.json)" completed

# The far end's figures: those of `soc_period` in `all`.
sed -n 's/.*"all":{"soc_period":{[^}]*"figures":{\([^}]*\)}.*/\1/p' /results/compact.json | tr ',' '\n' >/results/figures
figure() {
    sed -n "s/^\"$1\"://p" /results/figures
}
printf '        SoC period at the far end, us:'
for key in n mean_us std_us min_us max_us range_us p50_us p99_us p99_9_us p99_99_us; do printf ' %s %s' "${key%_us}" "$(figure $key)"; done
echo

# at_most NAME FIGURE LIMIT
at_most() {
    if awk "BEGIN { exit !(\"$2\" != \"\" && $2 + 0 <= $3) }"; then
        printf '  ok    %s: %s us, at most %s\n' "$1" "$2" "$3"
    else
        printf '  WRONG %s: %s us, expected at most %s\n' "$1" "$2" "$3"
        failures=$((failures + 1))
    fi
}

if [ "$RT_GUEST_ACCEL" = icount ]; then
    at_most "standard deviation of the SoC period" "$(figure std_us)" $std_max_us
    at_most "range of the SoC period" "$(figure range_us)" $range_max_us
else
    echo "        not judged: an emulated guest has this PC's time, with this PC's load; see --accel icount"
fi
exit $((failures > 0))
