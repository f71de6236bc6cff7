# shellcheck shell=bash
# What is set in the running kernel: one item each, with its kind, its key and the value wanted.
#
#   kind     key                          value
#   list     file under /proc or /sys     CPUs: 0,2-3
#   mask     file                         CPUs: d
#   least    file                         number; a larger one is as good
#   text     file                         the word
#   choice   file                         one of several words; the file shows all, the chosen one in brackets
#   thread   PID COMMAND                  CPUs on which this kernel thread may run
#   nic      INTERFACE GROUP NAME         setting of ethtool; GROUP is coalesce, feature, pause or eee
#   service  irqbalance                   running or stopped

# items: all of them that this PC has, one line each, in the order of apply; undo goes backwards.
items() {
    interrupt_items
    network_items
    work_items
    frequency_items
    memory_items
    [ -z "$no_throttling" ] || throttling_items
    [ -z "$interface" ] || interface_items
}

# slurp FILE: what is in it, in `content`, without the last newline. Starts no process: there are hundreds to read.
slurp() {
    content=""
    { IFS= read -r -d '' content <"$1" || [ -n "$content" ]; } 2>/dev/null || return 1
    content=${content%$'\n'}
}

# item KIND VALUE FILE...
item() {
    local file
    for file in "${@:3}"; do
        # A pattern without a match stands for itself; not every kernel has every file.
        if [ -e "$file" ]; then printf '%s\t%s\t%s\n' "$1" "${file#"$root"}" "$2"; fi
    done
}

interrupt_items() {
    local folder number kept=" "
    # First: it would move them back.
    if irqbalance_runs; then
        printf 'service\tirqbalance\t%s\n' "$(irqbalance_wanted)"
    fi
    [ -z "$interface" ] || kept=" $(interface_interrupts) "
    for folder in "$root"/proc/irq/[0-9]*; do
        number=${folder##*/}
        # An interrupt without a handler does not come; a handler to come starts from the default affinity.
        if [ -e "$root/sys/kernel/irq/$number/actions" ]; then
            slurp "$root/sys/kernel/irq/$number/actions" || true
            [ -n "$content" ] || continue
        fi
        if [[ $kept == *" $number "* ]]; then
            item list "$nic_list" "$folder/smp_affinity_list"
        else
            item list "$housekeeping_list" "$folder/smp_affinity_list"
        fi
    done
    item mask "$housekeeping_mask" "$root/proc/irq/default_smp_affinity"
}

# Numbers of the interrupts of the fieldbus interface.
interface_interrupts() {
    local device=$root/sys/class/net/$interface/device folder name
    # Of a virtio interface the PCI device is one higher.
    case $(readlink "$device/subsystem" 2>/dev/null) in */virtio) device=$device/.. ;; esac
    for folder in "$device"/msi_irqs/[0-9]*; do
        [ ! -e "$folder" ] || printf '%s ' "${folder##*/}"
    done
    # Others carry the name of the interface, as in enp2s0-TxRx-0.
    for folder in "$root"/proc/irq/[0-9]*/*/; do
        name=${folder%/}
        name=${name##*/}
        case $name in
            "$interface" | "$interface"[-:]*)
                folder=${folder%/*/}
                printf '%s ' "${folder##*/}"
                ;;
        esac
    done
}

irqbalance_runs() {
    grep -qsx irqbalance "$root"/proc/[0-9]*/comm
}

# irqbalance may run on if it leaves the real-time CPUs alone: its own ban, or none and they are isolated since boot.
# It knows nothing of the interface's interrupts that are to stay there.
irqbalance_wanted() {
    local comm banned="" isolated
    if [ -z "$interface" ] || [ "$nic_irq" = housekeeping ]; then
        comm=$(grep -lsx irqbalance "$root"/proc/[0-9]*/comm) || true
        comm=${comm%%$'\n'*}
        # Its environment is readable to root only; unknown counts as no ban.
        banned=$({ tr '\0' '\n' <"${comm%/*}/environ" | sed -n 's/^IRQBALANCE_BANNED_CPULIST=//p'; } 2>/dev/null) || true
        isolated=$(cat "$cpu_folder/isolated" 2>/dev/null) || true
        banned=$(expand "${banned:-$isolated}") || banned=""
        if [ -z "$(without "${realtime[*]}" "$banned")" ]; then
            printf running
            return
        fi
    fi
    printf stopped
}

# Received packets are handled where the interrupt came in, never handed to a real-time CPU.
network_items() {
    local file old cpus
    for file in "$root"/sys/class/net/*/queues/rx-*/rps_cpus; do
        [ -e "$file" ] || continue
        case $file in "$root/sys/class/net/$interface/"*) continue ;; esac
        old=$(cat "$file" 2>/dev/null) || continue
        cpus=$(expand_mask "$old") || continue
        if meet "$cpus" "${realtime[*]}"; then
            # shellcheck disable=SC2046 # one CPU, one word
            item mask "$(mask $(without "$cpus" "${realtime[*]}"))" "$file"
        else
            item mask "$old" "$file"
        fi
    done
}

work_items() {
    local file
    item mask "$housekeeping_mask" "$root"/sys/devices/virtual/workqueue/cpumask \
        "$root"/sys/devices/virtual/workqueue/*/cpumask
    thread_items
    item text 0 "$root/proc/sys/kernel/timer_migration"
    # The lock-up detector keeps watch over the other CPUs where the kernel can tell them apart.
    if [ -e "$root/proc/sys/kernel/watchdog_cpumask" ]; then
        item list "$housekeeping_list" "$root/proc/sys/kernel/watchdog_cpumask"
    else
        item text 0 "$root/proc/sys/kernel/watchdog"
    fi
    item least 10 "$root/proc/sys/vm/stat_interval"
}

# Kernel threads that may run on a real-time CPU and that may be moved.
thread_items() {
    local folder comm
    local -a field
    for folder in "$root"/proc/[0-9]*; do
        # A process may end while we look at it.
        slurp "$folder/stat" || continue
        # After the command in parentheses: state, parent, group, session, terminal, its group, flags.
        read -ra field <<<"${content##*) }"
        [ "${field[1]:-}" = 2 ] || continue
        # PF_NO_SETAFFINITY: bound for good, as ksoftirqd is.
        [[ ${field[6]:-} =~ ^[0-9]{1,10}$ ]] || continue
        if ((field[6] & 0x04000000)); then continue; fi
        comm=${content#*(}
        comm=${comm%)*}
        # The thread of an interrupt follows the interrupt.
        case $comm in irq/*) continue ;; esac
        thread_cpus "${folder##*/}" || continue
        meet "$(expand "$found")" "${realtime[*]}" || continue
        printf 'thread\t%s %s\t%s\n' "${folder##*/}" "$comm" "$housekeeping_list"
    done
}

# thread_cpus PID: on which it may run, in `found`.
thread_cpus() {
    slurp "$root/proc/$1/status" || return 1
    [[ $content == *Cpus_allowed_list:* ]] || return 1
    found=${content#*Cpus_allowed_list:}
    found=${found%%$'\n'*}
    found=${found//[[:space:]]/}
}

frequency_items() {
    local cpu folder fastest
    for cpu in "${realtime[@]}"; do
        folder=$cpu_folder/cpu$cpu/cpufreq
        # The preference before the governor: under "performance" it is no longer free.
        item text performance "$folder/energy_performance_preference"
        if fastest=$(cat "$folder/scaling_max_freq" 2>/dev/null); then
            item text "$fastest" "$folder/scaling_min_freq"
        fi
        item text performance "$folder/scaling_governor"
        [ -z "$no_deep_idle" ] || idle_items "$cpu"
    done
    item choice performance "$root/sys/module/pcie_aspm/parameters/policy"
}

# Idle states that take longer than 2 us to leave.
idle_items() {
    local folder latency
    for folder in "$cpu_folder/cpu$1"/cpuidle/state[0-9]*; do
        latency=$(cat "$folder/latency" 2>/dev/null) || continue
        if [[ $latency =~ ^[0-9]{1,9}$ ]] && [ "$latency" -gt 2 ]; then item text 1 "$folder/disable"; fi
    done
}

# Kernel work that changes page tables behind the back of every process, and so interrupts every CPU.
memory_items() {
    item choice never "$root/sys/kernel/mm/transparent_hugepage/enabled"
    item text 0 "$root/sys/kernel/mm/ksm/run" "$root/proc/sys/kernel/numa_balancing" \
        "$root/proc/sys/vm/compaction_proactiveness"
}

# Only when asked for: it is the safety net against a thread that never sleeps.
throttling_items() {
    local cpu
    item text -1 "$root/proc/sys/kernel/sched_rt_runtime_us"
    for cpu in "${realtime[@]}"; do
        item text 0 "$root/sys/kernel/debug/sched/fair_server/cpu$cpu/runtime"
    done
}

# The fieldbus interface: no frames but ours, none held back.
interface_items() {
    local folder=$root/sys/class/net/$interface file group name state
    item text 1 "$root/proc/sys/net/ipv6/conf/$interface/disable_ipv6"
    item mask 0 "$folder"/queues/rx-*/rps_cpus
    item text 0 "$folder"/queues/rx-*/rps_flow_cnt
    for file in "$folder"/queues/tx-*/xps_cpus; do
        # An interface with one queue has the file and refuses to read it.
        if cat "$file" >/dev/null 2>&1; then item mask "$realtime_mask" "$file"; fi
    done
    tool ethtool >/dev/null || return 0
    while read -r group name state; do
        # "fixed" and "not available" are nobody's to change.
        case $state in "" | n/a | *fixed*) continue ;; esac
        printf 'nic\t%s %s %s\t%s\n' "$interface" "$group" "$name" "$(nic_wanted "$group $name")"
    done < <(nic_state "$interface")
}

# nic_state INTERFACE: what ethtool says of it, as lines "GROUP NAME VALUE", in the order of apply.
nic_state() {
    local ethtool
    ethtool=$(tool ethtool)
    "$ethtool" -c "$1" 2>/dev/null | sed -n \
        -e 's/^Adaptive RX: *\([a-z/]*\) *TX: *\([a-z/]*\).*/coalesce adaptive-rx \1\ncoalesce adaptive-tx \2/p' \
        -e 's/^\(rx-usecs\|tx-usecs\|rx-frames\):[[:space:]]*/coalesce \1 /p' || true
    "$ethtool" -k "$1" 2>/dev/null | sed -n \
        -e 's/^generic-receive-offload:/feature gro/p' -e 's/^large-receive-offload:/feature lro/p' \
        -e 's/^generic-segmentation-offload:/feature gso/p' \
        -e 's/^[[:space:]]*\(tx-tcp[a-z0-9-]*-segmentation\):/feature \1/p' \
        -e 's/^rx-vlan-offload:/feature rxvlan/p' -e 's/^tx-vlan-offload:/feature txvlan/p' || true
    "$ethtool" -a "$1" 2>/dev/null | sed -n \
        -e 's/^Autonegotiate:[[:space:]]*/pause autoneg /p' \
        -e 's/^RX:[[:space:]]*/pause rx /p' -e 's/^TX:[[:space:]]*/pause tx /p' || true
    "$ethtool" --show-eee "$1" 2>/dev/null | sed -n \
        -e 's/.*EEE status: *enabled.*/eee eee on/p' -e 's/.*EEE status: *disabled.*/eee eee off/p' || true
}

nic_wanted() {
    case $1 in
        "coalesce rx-frames") printf 1 ;;
        "coalesce "*-usecs) printf 0 ;;
        *) printf off ;;
    esac
}
