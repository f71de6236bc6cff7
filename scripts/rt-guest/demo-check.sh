#!/bin/sh
# The demo on the guest's kernel: the network comes up, the program ends, both real-time threads are where they belong;
# then the same machine with rt.require = "strict", which refuses to run where anything is missing.
# shellcheck source=scripts/rt-guest/lib.sh
. /check/lib.sh
program=/configs/short-part.ngc

# watch_threads PID: waits for a control to end; the threads it had when they were last seen at work, into $threads.
watch_threads() {
    threads=""
    # One that has ended and was not waited for yet still has a number, but no program.
    while readlink "/proc/$1/exe" >/dev/null; do
        now=$(threads_of "$1")
        case $now in *"rt-cycle "*) threads=$now ;; esac
        sleep 1
    done
}

expect_threads() {
    printf '%s\n' "$threads" | awk 'BEGIN { print "    thread           policy  priority  last CPU  CPUs allowed" }
        { policy = $2 == 1 ? "FIFO" : $2 == 5 ? "idle" : "other"; printf "    %-16s %-7s %-9s %-9s %s\n", $1, policy, $3, $4, $5 }'
    expect "cycle thread: policy 1 (FIFO), priority 80, last on CPU 1, allowed on CPU" \
        "$(printf '%s\n' "$threads" | sed -n 's/^rt-cycle //p')" "1 80 1 1"
    expect "time-out thread: the same, one above" \
        "$(printf '%s\n' "$threads" | sed -n 's/^rt-timeout //p')" "1 81 1 1"
    expect "ordinary threads off CPU 0" "$(printf '%s\n' "$threads" | awk '$2 == 0 && $4 != 0 { n++ } END { print n + 0 }')" 0
}

# expect_report FOLDER
expect_report() {
    expect "result" "$(value "$1/run.json" result)" '"completed"'
    expect "alarms" "$(value "$1/run.json" alarms)" "[]"
    expect "last line of $(value "$1/run.json" lines) reached" "$(value "$1/run.json" line_reached)" "$(value "$1/run.json" lines)"
    printf '        network operational after %s s\n' "$(value "$1/run.json" operational_s)"
}

# A thread that keeps an emulated core awake would take all of the emulator's time, and to leave idleness costs none there.
sed 's/^# keep_awake = "dma-latency"/keep_awake = "none"/' /configs/mill3-demo.toml >/results/demo.toml
sed 's/^require = "warn"/require = "strict"/' /results/demo.toml >/results/strict.toml

echo "isocnc demo"
isocnc demo --machine /results/demo.toml --program $program --out /results/demo --json >/results/demo.json 2>/results/demo.err &
control=$!
watch_threads $control
wait $control
expect "exit code" $? 0
expect_threads
expect_report /results/demo

echo "isocnc run, rt.require = \"strict\""
add_wire
isocnc simulate /results/strict.toml --interface plk1 >/results/simulate.out 2>/results/simulate.err &
machine=$!
isocnc run /results/strict.toml $program --out /results/strict --json >/results/strict.json 2>/results/strict.err &
control=$!
watch_threads $control
wait $control
expect "exit code" $? 0
kill $machine
wait $machine
expect_threads
expect_report /results/strict

[ "$failures" = 0 ] || head -n 20 /results/*.err
exit $((failures > 0))
