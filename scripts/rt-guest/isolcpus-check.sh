#!/bin/sh
# isolcpus.sh on a true kernel: apply moves what it says, a second time there is nothing to do, undo leaves no trace.
#
# In:  the script to check (default /scripts/isolcpus.sh), root, bash, a machine with CPUs 0 and 1 that nobody needs.
# Out: one line for each thing looked at; exit code 1 if one of them is not as it should be.
# shellcheck disable=SC2044 # no file here has a blank in its name
script=${1:-/scripts/isolcpus.sh}
work=$(mktemp -d)
failures=0

# expect NAME FOUND WANTED
expect() {
    if [ "$2" = "$3" ]; then
        printf '  ok    %s: %s\n' "$1" "$2"
    else
        printf '  WRONG %s: %s, expected %s\n' "$1" "$2" "$3"
        failures=$((failures + 1))
    fi
}

# isolcpus NAME CODE ARGUMENT...: runs it; what it says is in $work/NAME.
isolcpus() {
    name=$1
    wanted=$2
    shift 2
    bash "$script" "$@" >"$work/$name" 2>&1
    expect "isolcpus.sh $*: exit code" $? "$wanted"
}

lines() {
    grep -c "$1" "$work/$2"
}

# Everything that apply may change, looked at without it.
snapshot() {
    for file in /proc/irq/*/smp_affinity_list /proc/irq/default_smp_affinity \
        $(find /sys/devices/virtual/workqueue/ -name cpumask) /sys/class/net/*/queues/*/*ps_cpus \
        /sys/class/net/*/queues/*/rps_flow_cnt /proc/sys/net/ipv6/conf/*/disable_ipv6 \
        /proc/sys/kernel/timer_migration /proc/sys/kernel/watchdog* /proc/sys/kernel/numa_balancing \
        /proc/sys/kernel/sched_rt_* /proc/sys/vm/stat_interval /proc/sys/vm/compaction_proactiveness \
        /sys/kernel/debug/sched/fair_server/*/runtime /sys/kernel/mm/ksm/run \
        /sys/kernel/mm/transparent_hugepage/enabled /sys/module/pcie_aspm/parameters/policy \
        /sys/devices/system/cpu/*/cpufreq/scaling_* /sys/devices/system/cpu/*/cpuidle/*/disable; do
        [ ! -r "$file" ] || printf '%s = %s\n' "$file" "$(cat "$file" 2>/dev/null)"
    done
    for pid in $(cd /proc && echo [0-9]*); do
        # Workers come and go by themselves.
        case $(cat "/proc/$pid/comm" 2>/dev/null) in "" | kworker/*) continue ;; esac
        grep -q '^PPid:[[:space:]]*2$' "/proc/$pid/status" 2>/dev/null || continue
        printf '%s %s may run on %s\n' "$pid" "$(cat "/proc/$pid/comm")" "$(allowed "$pid")"
    done
}

allowed() {
    sed -n 's/^Cpus_allowed_list:[[:space:]]*//p' "/proc/$1/status" 2>/dev/null
}

# Interrupts with a handler whose affinity is not LIST, but those that the kernel lets nobody move.
interrupts_not_on() {
    for folder in /proc/irq/[0-9]*; do
        [ -n "$(cat "/sys/kernel/irq/${folder##*/}/actions")" ] || continue
        found=$(cat "$folder/smp_affinity_list")
        [ "$found" = "$1" ] || grep -q "^skipped $folder/" "$work/apply" || printf '%s=%s ' "${folder#/proc/irq/}" "$found"
    done
}

# Kernel threads that may run on CPU 1 and might be moved away; PF_NO_SETAFFINITY are those that cannot.
threads_on_1() {
    for pid in $(cd /proc && echo [0-9]*); do
        # shellcheck disable=SC2046 # fields
        set -- $(sed 's/.*) //' "/proc/$pid/stat" 2>/dev/null)
        [ "${2:-}" = 2 ] || continue
        [ $((${7:-0} & 0x04000000)) = 0 ] || continue
        case $(cat "/proc/$pid/comm" 2>/dev/null) in irq/*) continue ;; esac
        case $(allowed "$pid") in *1*) printf '%s ' "$(cat "/proc/$pid/comm")" ;; esac
    done
}

# bash opens its process substitutions there.
[ -e /dev/fd ] || ln -s /proc/self/fd /dev/fd
if ip link add iso0 type veth peer name iso1 2>/dev/null; then interface=iso0; else interface=; fi

echo "isolcpus.sh on kernel $(uname -r), isolated at boot: $(cat /sys/devices/system/cpu/isolated)"
# Where the CPU is isolated since boot there is little left to do: first spread all again.
for folder in /proc/irq/[0-9]*; do echo 0-1 >"$folder/smp_affinity_list"; done 2>/dev/null
echo 3 >/proc/irq/default_smp_affinity
taskset -p 3 "$(pidof kauditd || echo 2)" >/dev/null
snapshot >"$work/before"

isolcpus status 3 status --cpus 1
isolcpus dry-run 0 apply --cpus 1 --dry-run
snapshot >"$work/unchanged"
expect "changed by status and --dry-run" "$(diff "$work/before" "$work/unchanged" | grep -c '^[<>]')" 0

isolcpus apply 0 apply --cpus 1 ${interface:+--interface "$interface"}
tail -n 2 "$work/apply" | sed 's/^/        /;q'
expect "interrupts elsewhere than on CPU 0" "$(interrupts_not_on 0)" ""
expect "interrupts that the kernel lets nobody move, on CPU 1" \
    "$(sed -n 's/^skipped \(\/proc\/irq\/[0-9]*\)\/.*/\1/p' "$work/apply" | while read -r folder; do
        case $(cat "$folder/effective_affinity_list") in *1*) printf '%s ' "$folder" ;; esac
    done)" ""
expect "default_smp_affinity" "$(cat /proc/irq/default_smp_affinity)" 1
for file in $(find /sys/devices/virtual/workqueue/ -name cpumask); do expect "$file" "$(cat "$file")" 1; done
expect "kernel threads that may run on CPU 1" "$(threads_on_1)" ""
expect "stat_interval" "$(cat /proc/sys/vm/stat_interval)" 10
expect "throttling left alone" "$(cat /proc/sys/kernel/sched_rt_runtime_us)" 950000
if [ -n "$interface" ]; then
    expect "IPv6 off on $interface" "$(cat "/proc/sys/net/ipv6/conf/$interface/disable_ipv6")" 1
    expect "xps_cpus of $interface" "$(cat "/sys/class/net/$interface/queues/tx-0/xps_cpus")" 2
fi

isolcpus again 0 apply --cpus 1 ${interface:+--interface "$interface"}
expect "set by a second apply" "$(lines '^set ' again)" 0
bash "$script" status --cpus 1 ${interface:+--interface "$interface"} >"$work/applied" 2>&1
expect "items that differ after apply" "$(lines '^  differs [/ke]' applied)" 0

isolcpus undo 0 undo
snapshot >"$work/after"
expect "changed by apply and undo together" "$(diff "$work/before" "$work/after" | grep -c '^[<>]')" 0
diff "$work/before" "$work/after" | sed 's/^/        /'
isolcpus undo-again 0 undo
expect "record after undo" "$(ls /run/isocnc-isolcpus.state 2>/dev/null)" ""
# No boot loader here: it says what to do by hand.
isolcpus persist 1 persist --cpus 1
expect "words for the kernel command line" "$(lines '^  isolcpus=managed_irq,domain,1 nohz_full=1' persist)" 1

[ "$failures" = 0 ] || for name in apply again applied undo persist; do sed "s/^/    $name: /" "$work/$name" | head -n 80; done
[ -z "$interface" ] || ip link del "$interface"
rm -rf "$work"
exit $((failures > 0))
