#!/bin/sh
# `isocnc doctor` in a guest of which we know what it is: a PREEMPT_RT kernel with core 1 isolated, virtual, run by root.
# shellcheck source=scripts/rt-guest/lib.sh
. /check/lib.sh

add_wire
isocnc doctor /configs/mill3-demo.toml --no-tests --json >/results/doctor.json
code=$?
isocnc doctor /configs/mill3-demo.toml --seconds 1 >/results/doctor.txt
cat /results/doctor.txt

# A line of the report in one: name|state|what was found.
awk -F'": ' '{ text = $2; gsub(/^"|",?$/, "", text) }
    /^ *"found":/ { found = text } /^ *"name":/ { name = text } /^ *"state":/ { state = text }
    /^ *"wanted":/ { print name "|" state "|" found }' /results/doctor.json >/results/lines

# expect_line NAME STATE
expect_line() {
    found=$(sed -n "s/^$1|//p" /results/lines)
    expect "$1 (${found#*|})" "${found%%|*}" "$2"
}

echo "isocnc doctor, against what the guest is"
expect "exit code (no must is missing)" "$code" 0
for name in PREEMPT_RT "timer resolution" core isolated nohz_full rcu_nocbs irqbalance "the core itself" SCHED_FIFO \
    "locked memory" "raw socket" interface; do
    expect_line "$name" ok
done
expect_line "virtual machine" missing
exit $((failures > 0))
