#!/bin/sh
# 10,000 blocks a second: no cycle waits for the plan, none is left out. Left out and late are judged where the guest's time is
# counted in instructions, only printed where it is that of a PC that emulates.
#
# The timing is set and nothing keeps the core awake, as in the check of jitter.
# shellcheck source=scripts/rt-guest/lib.sh
. /check/lib.sh
late_max_us=50

sed -e 's/^calibrate = true/calibrate = false/' -e 's/^# spin_us = 50/spin_us = 50/' -e 's/^# phase_us = 375/phase_us = 375/' \
    -e 's/^# keep_awake = "dma-latency"/keep_awake = "none"/' /dense/router.toml >/results/router.toml
isocnc demo --machine /results/router.toml --program /dense/dense.ngc --out /results/dense --json >/results/dense.json 2>/results/dense.err
expect "exit code" $? 0
report=/results/dense/run.json
expect "result" "$(value $report result)" '"completed"'
expect "alarms" "$(value $report alarms)" "[]"
expect "last line of $(value $report lines) reached" "$(value $report line_reached)" "$(value $report lines)"
expect "cycles that waited for the plan" "$(value $report starved_cycles)" 0
printf '        %s lines in %s s of motion\n' "$(value $report lines)" "$(value $report motion_time_s)"

# The cycle thread's own figures.
tr -d ' \n' <$report | sed 's/.*"cycle":{//' >/results/cycle
cycles=$(sed 's/.*"cycles":\([0-9]*\).*/\1/' /results/cycle)
skipped=$(sed 's/[^}]*"skipped":\([0-9]*\).*/\1/' /results/cycle)
late=$(sed 's/.*"lateness":{[^}]*"max_us":\([0-9.]*\).*/\1/' /results/cycle)
printf '        %s cycles; SoC late by %s us at most\n' "$cycles" "$late"
if [ "$RT_GUEST_ACCEL" = icount ]; then
    expect "cycles left out" "$skipped" 0
    expect "SoC late by at most $late_max_us us" "$(awk "BEGIN { print (\"$late\" != \"\" && $late + 0 <= $late_max_us) }")" 1
else
    echo "        cycles left out: $skipped; not judged: an emulated guest has this PC's time, with this PC's load"
fi
[ "$failures" = 0 ] || head -n 20 /results/dense.err
exit $((failures > 0))
