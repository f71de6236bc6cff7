#!/usr/bin/env bash
# Keeps the CPUs of the real-time threads free of other work, without a reboot, and puts everything back.
#
# In:  the CPUs of the real-time threads (--cpus); all other online CPUs do the housekeeping.
# Out: kernel settings under /proc and /sys; each old value in a state file before it is changed, for `undo`.
# What only the boot loader can set is printed, never changed. Nothing here outlives a reboot.
set -euo pipefail
export LC_ALL=C

usage() {
    cat <<'EOF'
usage: isolcpus.sh status|apply|undo [--cpus LIST] [--dry-run] [--force] [--root DIR]

  status       what is set, what apply would change, what the kernel command line lacks
  apply        move interrupts and kernel work off the CPUs, steady their clock
  undo         put every value back that apply has changed

  --cpus LIST  CPUs of the real-time threads, for example 3 or 2-3;
               without it: the CPUs isolated at boot, else the last one that is online
  --dry-run    say what would be written, write nothing
  --force      take CPU 0, too
  --root DIR   use DIR/proc, DIR/sys and DIR/run

exit code: 0 done, 1 refused or not everything done, 2 wrong usage
EOF
}

wrong_usage() {
    printf 'isolcpus.sh: %s\n\n' "$1" >&2
    usage >&2
    exit 2
}

refuse() {
    printf 'isolcpus.sh: %s\n' "$1" >&2
    exit 1
}

# ---- lists and masks of CPUs ----------------------------------------------------------------------------------------

# expand LIST: "0,2-3" -> "0 2 3", ascending, each once. Fails if LIST is none.
expand() {
    local part first last cpu
    local -a cpus=()
    [[ $1 =~ ^[0-9]{1,4}(-[0-9]{1,4})?(,[0-9]{1,4}(-[0-9]{1,4})?)*$ ]] || return 1
    for part in ${1//,/ }; do
        first=$((10#${part%-*}))
        last=$((10#${part#*-}))
        [ "$first" -le "$last" ] || return 1
        for ((cpu = first; cpu <= last; cpu++)); do cpus[cpu]=$cpu; done
    done
    printf '%s' "${cpus[*]}"
}

# list CPU...: "0 2 3" -> "0,2-3"; ascending numbers.
list() {
    local text="" first="" last="" cpu
    for cpu in "$@" end; do
        if [ -n "$last" ] && [ "$cpu" = "$((last + 1))" ]; then
            last=$cpu
            continue
        fi
        if [ -n "$first" ]; then
            text+=${text:+,}$first
            [ "$first" = "$last" ] || text+=-$last
        fi
        first=$cpu
        last=$cpu
    done
    printf '%s' "$text"
}

# mask CPU...: "0 2 3" -> "d"; ascending numbers. Hexadecimal, a comma every 32 bits, as the kernel writes it.
mask() {
    local -a words=()
    local cpu word text=""
    for cpu in "$@"; do
        words[cpu / 32]=$((${words[cpu / 32]:-0} | 1 << cpu % 32))
    done
    # cpu is the highest one now, and its word has a bit set.
    for ((word = cpu / 32; word >= 0; word--)); do
        if [ -z "$text" ]; then
            printf -v text '%x' "${words[word]}"
        else
            printf -v text '%s,%08x' "$text" "${words[word]:-0}"
        fi
    done
    printf '%s' "$text"
}

# same KIND A B: whether two values mean the same.
same() {
    local a=$2 b=$3
    case $1 in
        list)
            a=$(expand "$a") || return 1
            b=$(expand "$b") || return 1
            ;;
        mask)
            a=${a//,/}
            b=${b//,/}
            a=${a#"${a%%[!0]*}"}
            b=${b#"${b%%[!0]*}"}
            ;;
        least) [[ $a =~ ^[0-9]{1,9}$ ]] && [ "$a" -ge "$b" ] && a=$b ;;
    esac
    [ "$a" = "$b" ]
}

# ---- what is to be set ----------------------------------------------------------------------------------------------

# settings: one line each: KIND, path without root, value. The order of apply; undo goes backwards.
settings() {
    local file cpu
    emit list "$housekeeping_list" "$root"/proc/irq/[0-9]*/smp_affinity_list
    emit mask "$housekeeping_mask" "$root"/proc/irq/default_smp_affinity
    emit mask "$housekeeping_mask" "$root"/sys/devices/virtual/workqueue/cpumask \
        "$root"/sys/devices/virtual/workqueue/*/cpumask
    for cpu in "${realtime[@]}"; do
        emit text performance "$root/sys/devices/system/cpu/cpu$cpu/cpufreq/scaling_governor"
    done
    emit mask 0 "$root"/sys/class/net/*/queues/rx-*/rps_cpus
    emit text 0 "$root/proc/sys/kernel/timer_migration"
    # The lock-up detector keeps watch over the other CPUs where the kernel can tell them apart.
    if [ -e "$root/proc/sys/kernel/watchdog_cpumask" ]; then
        emit list "$housekeeping_list" "$root/proc/sys/kernel/watchdog_cpumask"
    else
        emit text 0 "$root/proc/sys/kernel/watchdog"
    fi
    emit least 10 "$root/proc/sys/vm/stat_interval"
}

emit() {
    local kind=$1 value=$2 file
    for file in "${@:3}"; do
        # A pattern without a match stands for itself; not every kernel has every file.
        if [ -e "$file" ]; then printf '%s\t%s\t%s\n' "$kind" "${file#"$root"}" "$value"; fi
    done
}

# put PATH VALUE: writes; on failure the reason is in `reason`.
put() {
    reason=$({ printf '%s\n' "$2" >"$root$1"; } 2>&1) && return 0
    reason=${reason##*: }
    return 1
}

# What the kernel answers for interrupts and work that it lets nobody move.
unmovable() {
    case $reason in
        "Input/output error" | "Operation not permitted" | "Invalid argument") return 0 ;;
        *) return 1 ;;
    esac
}

recorded() {
    # Not grep -q: it may leave before cut has written all, which pipefail takes for "not found".
    [ -e "$state" ] && cut -f1 "$state" | grep -xF -- "$1" >/dev/null
}

# ---- commands -------------------------------------------------------------------------------------------------------

status() {
    local kind path value now
    printf 'real-time CPUs     %s\n' "$realtime_list"
    printf 'housekeeping CPUs  %s\n' "$housekeeping_list"
    if [ -e "$state" ]; then
        printf 'applied            yes, %s old values in %s\n' "$(wc -l <"$state")" "$state"
    else
        printf 'applied            no\n'
    fi
    while IFS=$'\t' read -r kind path value; do
        now=$(cat "$root$path" 2>/dev/null) || now="unreadable"
        if same "$kind" "$now" "$value"; then
            printf 'ok      %s = %s\n' "$path" "$now"
        else
            printf 'differs %s = %s, apply: %s\n' "$path" "$now" "$value"
        fi
    done < <(settings)
    warn_irqbalance
    boot
}

apply() {
    local kind path value now changed=0 kept=0 skipped=0 failed=0
    while IFS=$'\t' read -r kind path value; do
        if ! now=$(cat "$root$path" 2>/dev/null); then
            printf 'skipped %s: unreadable\n' "$path"
            skipped=$((skipped + 1))
            continue
        fi
        if same "$kind" "$now" "$value"; then
            kept=$((kept + 1))
            continue
        fi
        if [ -n "$dry_run" ]; then
            printf 'would write %s = %s (now %s)\n' "$path" "$value" "$now"
            continue
        fi
        # The old value is safe before the new one is written; one that is there already is older.
        local new_record=""
        if ! recorded "$path"; then
            mkdir -p "${state%/*}"
            printf '%s\t%s\n' "$path" "$now" >>"$state"
            new_record=yes
        fi
        if put "$path" "$value"; then
            printf 'set     %s = %s (was %s)\n' "$path" "$value" "$now"
            changed=$((changed + 1))
            continue
        fi
        [ -z "$new_record" ] || forget_last
        if unmovable; then
            printf 'skipped %s: %s\n' "$path" "$reason"
            skipped=$((skipped + 1))
        else
            printf 'FAILED  %s: %s\n' "$path" "$reason" >&2
            failed=$((failed + 1))
        fi
    done < <(settings)
    warn_irqbalance
    if [ -z "$dry_run" ]; then
        printf '%s set, %s as wanted before, %s skipped, %s failed\n' "$changed" "$kept" "$skipped" "$failed"
    fi
    boot
    [ "$failed" -eq 0 ]
}

# Takes back the record of a value that could not be changed.
forget_last() {
    sed -i '$d' "$state"
    [ -s "$state" ] || rm -f "$state"
}

undo() {
    local path value line restored=0 failed=0
    local -a lines=() left=()
    [ -e "$state" ] || {
        printf 'nothing to undo: no %s\n' "$state"
        return 0
    }
    mapfile -t lines < <(tac "$state")
    for line in "${lines[@]}"; do
        path=${line%%$'\t'*}
        value=${line#*$'\t'}
        if [ ! -e "$root$path" ]; then
            # An interrupt or interface that is no longer there needs nothing.
            printf 'gone    %s\n' "$path"
        elif [ -n "$dry_run" ]; then
            printf 'would write %s = %s\n' "$path" "$value"
        elif put "$path" "$value"; then
            printf 'set     %s = %s\n' "$path" "$value"
            restored=$((restored + 1))
        else
            printf 'FAILED  %s: %s\n' "$path" "$reason" >&2
            failed=$((failed + 1))
            left=("$line" "${left[@]}")
        fi
    done
    [ -z "$dry_run" ] || return 0
    if [ "$failed" -eq 0 ]; then
        rm -f "$state"
    else
        printf '%s\n' "${left[@]}" >"$state"
    fi
    printf '%s put back, %s failed\n' "$restored" "$failed"
    [ "$failed" -eq 0 ]
}

warn_irqbalance() {
    if grep -qsx irqbalance "$root"/proc/[0-9]*/comm; then
        printf 'warning: irqbalance runs and moves interrupts back: systemctl stop irqbalance\n'
    fi
}

boot() {
    local word missing=""
    local -a words=(
        "isolcpus=managed_irq,domain,$realtime_list" "nohz_full=$realtime_list" "rcu_nocbs=$realtime_list"
        "irqaffinity=$housekeeping_list" skew_tick=1 nosoftlockup nmi_watchdog=0 transparent_hugepage=never
    )
    for word in "${words[@]}"; do
        tr -s ' \n' '\n' <"$root/proc/cmdline" | grep -xF -- "$word" >/dev/null || missing+=" $word"
    done
    if [ -z "$missing" ]; then
        printf 'kernel command line: complete\n'
        return
    fi
    printf 'kernel command line, recommended:\n  %s\n' "${words[*]}"
    printf 'missing now:\n %s\n' "$missing"
    printf 'where: GRUB_CMDLINE_LINUX_DEFAULT in /etc/default/grub, then update-grub and a reboot\n'
    printf '       (systemd-boot: the options line in /boot/loader/entries/*.conf)\n'
}

# ---- arguments ------------------------------------------------------------------------------------------------------

command="" dry_run="" force="" root="" realtime_list="" reason=""
while [ $# -gt 0 ]; do
    case $1 in
        status | apply | undo)
            [ -z "$command" ] || wrong_usage "one command, not $command and $1"
            command=$1
            ;;
        --dry-run) dry_run=yes ;;
        --force) force=yes ;;
        --root | --cpus)
            [ $# -ge 2 ] || wrong_usage "$1 needs a value"
            if [ "$1" = --root ]; then root=${2%/}; else realtime_list=$2; fi
            shift
            ;;
        --help | -h)
            usage
            exit 0
            ;;
        *) wrong_usage "unknown argument $1" ;;
    esac
    shift
done
[ -n "$command" ] || wrong_usage "which command: status, apply or undo?"
state=$root/run/isocnc/isolcpus.state

if [ "$command" != status ] && [ -z "$dry_run" ] && [ -z "$root" ] && [ "$(id -u)" -ne 0 ]; then
    refuse "$command changes kernel settings: run it as root, or look with --dry-run"
fi
if [ "$command" = undo ]; then
    undo
    exit
fi

cpu_folder=$root/sys/devices/system/cpu
online=$(expand "$(cat "$cpu_folder/online")") || refuse "cannot read $cpu_folder/online"
if [ -z "$realtime_list" ]; then
    realtime_list=$(cat "$cpu_folder/isolated" 2>/dev/null) || realtime_list=""
    [ -n "$realtime_list" ] || realtime_list=${online##* }
fi
wanted=$(expand "$realtime_list") || wrong_usage "--cpus $realtime_list: a list such as 3 or 2-3,5 was expected"
read -ra realtime <<<"$wanted"
realtime_list=$(list "${realtime[@]}")
housekeeping=()
for cpu in $online; do
    [[ " ${realtime[*]} " == *" $cpu "* ]] || housekeeping+=("$cpu")
done
for cpu in "${realtime[@]}"; do
    [[ " $online " == *" $cpu "* ]] || refuse "CPU $cpu is not online"
done
[ ${#housekeeping[@]} -gt 0 ] || refuse "CPUs $realtime_list are all there are: at least one must do the housekeeping"
if [ "${realtime[0]}" -eq 0 ] && [ -z "$force" ]; then
    refuse "CPU 0 keeps time and boots the others: choose another one, or say --force"
fi
housekeeping_list=$(list "${housekeeping[@]}")
housekeeping_mask=$(mask "${housekeeping[@]}")
"$command"
