#!/usr/bin/env bash
# Keeps the CPUs of the real-time threads free of other work, and puts everything back.
#
# In:  the CPUs of the real-time threads (--cpus); all other online CPUs do the housekeeping.
# Out: apply: kernel settings, until the next reboot; each old value in a record before it is changed.
#      persist: the kernel command line, by the boot loader's configuration; a copy of each file before it is changed.
#      undo: both as they were.
# The parts are in the folder isolcpus/ beside this file.
set -euo pipefail
export LC_ALL=C
# What is written is for all to read, whatever the caller keeps to himself.
umask 022
PATH=$PATH:/usr/sbin:/sbin
here=$(cd "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")" && pwd)
# shellcheck source=isolcpus/cpus.sh
. "$here/isolcpus/cpus.sh"
# shellcheck source=isolcpus/items.sh
. "$here/isolcpus/items.sh"
# shellcheck source=isolcpus/runtime.sh
. "$here/isolcpus/runtime.sh"
# shellcheck source=isolcpus/files.sh
. "$here/isolcpus/files.sh"
# shellcheck source=isolcpus/boot.sh
. "$here/isolcpus/boot.sh"
# shellcheck source=isolcpus/persist.sh
. "$here/isolcpus/persist.sh"

usage() {
    cat <<'END'
usage: isolcpus.sh status|apply|persist|undo [OPTION...]

  status     what is set, what apply and persist would change; changes nothing
  apply      now, until the next reboot: move interrupts and kernel work off the CPUs, steady their clock
  persist    from the next boot on: take the CPUs out of the kernel's own use, by the kernel command line;
             shows the exact difference and asks first
  undo       put back what apply and persist have changed, exactly as it was

which CPUs:
  --cpus LIST        CPUs of the real-time threads, for example 3 or 2-3; without it those that are isolated
                     since boot, else the last one that is online
  --force            take CPU 0, too; persist, undo: overwrite what somebody else has changed meanwhile
apply and status:
  --interface IF     the fieldbus interface: coalescing, offloads, Energy-Efficient Ethernet, flow control (with
                     ethtool) and IPv6 off
  --nic-irq WHERE    its interrupts on rt (beside the thread that waits for frames; default) or housekeeping
  --no-deep-idle     forbid the CPUs idle states that take more than 2 us to leave; isocnc does so itself while it runs
  --no-throttling    no limit for threads that never sleep; isocnc needs none, and the limit is a safety net
persist:
  --reapply          also install a systemd unit that runs apply, with the options above, at each boot
  --parameter WORD   one more word for the kernel command line, for example tsc=reliable; may be repeated
  --loader NAME      grub, grubby, systemd-boot or kernelstub; without it the one that is found
  --yes              do not ask (undo, too)
all:
  --dry-run          say what would be changed, change nothing
  --root DIR         work on the tree below DIR, and only with the tools in it

exit code: 0 done, or status: all as wanted; 1 refused or not everything done; 2 wrong usage;
           3 status: something is not as wanted
END
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

parse_arguments() {
    while [ $# -gt 0 ]; do
        case $1 in
            status | apply | persist | undo)
                [ -z "$command" ] || wrong_usage "one command, not $command and $1"
                command=$1
                ;;
            --dry-run) dry_run=yes ;;
            --force) force=yes ;;
            --yes) yes=yes ;;
            --reapply) reapply=yes ;;
            --no-deep-idle) no_deep_idle=yes ;;
            --no-throttling) no_throttling=yes ;;
            --root | --cpus | --interface | --nic-irq | --parameter | --loader)
                [ $# -ge 2 ] || wrong_usage "$1 needs a value"
                option "$1" "$2"
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
    [ -n "$command" ] || wrong_usage "which command: status, apply, persist or undo?"
}

option() {
    case $1 in
        --root)
            root=$(cd "$2" 2>/dev/null && pwd) || wrong_usage "--root $2: no such folder"
            root=${root%/}
            ;;
        --cpus) realtime_list=$2 ;;
        --interface)
            [[ $2 =~ ^[^/[:space:]]{1,15}$ && $2 != .* ]] || wrong_usage "--interface $2: a name such as enp2s0 was expected"
            interface=$2
            ;;
        --nic-irq)
            [[ $2 =~ ^(rt|housekeeping)$ ]] || wrong_usage "--nic-irq $2: rt or housekeeping was expected"
            nic_irq=$2
            ;;
        --parameter)
            # Nothing that a shell, GRUB or JSON would take for more than a word.
            [[ $2 =~ ^[A-Za-z0-9_.-]+(=[A-Za-z0-9_.,:/-]+)?$ ]] ||
                wrong_usage "--parameter $2: one word such as tsc=reliable was expected"
            parameters+=("$2")
            ;;
        --loader)
            [[ $2 =~ ^(grub|grubby|systemd-boot|kernelstub)$ ]] ||
                wrong_usage "--loader $2: grub, grubby, systemd-boot or kernelstub was expected"
            loader=$2
            ;;
    esac
}

# The real-time CPUs and the others: as lists, as masks, as arrays.
choose_cpus() {
    local text online cpu
    text=$(cat "$cpu_folder/online") || refuse "cannot read $cpu_folder/online"
    online=$(expand "$text") || refuse "$cpu_folder/online is not understood: $text"
    if [ -z "$realtime_list" ]; then
        realtime_list=$(cat "$cpu_folder/isolated" 2>/dev/null) || realtime_list=""
        [ -n "$realtime_list" ] || realtime_list=${online##* }
    fi
    text=$(expand "$realtime_list") || wrong_usage "--cpus $realtime_list: a list such as 3 or 2-3,5 was expected"
    read -ra realtime <<<"$text"
    read -ra housekeeping <<<"$(without "$online" "${realtime[*]}")"
    realtime_list=$(list "${realtime[@]}")
    housekeeping_list=$(list "${housekeeping[@]}")
    realtime_mask=$(mask "${realtime[@]}")
    housekeeping_mask=$(mask "${housekeeping[@]}")
    for cpu in "${realtime[@]}"; do
        is_in "$cpu" "$online" || refuse "CPU $cpu is not online (online: $(cat "$cpu_folder/online"))"
    done
    [ ${#housekeeping[@]} -gt 0 ] ||
        refuse "CPUs $realtime_list are all there are: at least one must do the housekeeping"
    if [ "${realtime[0]}" -eq 0 ] && [ -z "$force" ]; then
        refuse "CPU 0 keeps time and boots the others: choose another one, or say --force"
    fi
    nic_list=$realtime_list
    if [ "$nic_irq" = housekeeping ]; then nic_list=$housekeeping_list; fi
}

check_interface() {
    [ -n "$interface" ] || return 0
    [ ! -e "$root/sys/class/net/$interface" ] || return 0
    printf 'isolcpus.sh: no interface %s; there are: %s\n' "$interface" "$(cd "$root/sys/class/net" && echo *)" >&2
    # At boot the rest is still worth while.
    [ "$command" = apply ] || exit 1
    interface_gone=$interface
    interface=""
}

status() {
    local cpu siblings
    printf 'real-time CPUs     %s\n' "$realtime_list"
    printf 'housekeeping CPUs  %s\n' "$housekeeping_list"
    printf 'applied            %s\n' "$([ -e "$state" ] && echo "yes, $(wc -l <"$state") old values in $state" || echo no)"
    printf 'persisted          %s\n' "$([ -e "$library" ] && echo "yes, the files before it in $library" || echo no)"
    for cpu in "${realtime[@]}"; do
        siblings=$(cat "$cpu_folder/cpu$cpu/topology/thread_siblings_list" 2>/dev/null) || continue
        siblings=$(expand "$siblings") || continue
        siblings=$(without "$siblings" "${realtime[*]}")
        [ -z "$siblings" ] || printf 'note: CPU %s shares its core with CPU %s: take both, or switch SMT off in the firmware\n' \
            "$cpu" "$siblings"
    done
    differing=0
    status_runtime
    status_boot
    printf '\n'
    if [ "$differing" -eq 0 ]; then
        printf 'all as wanted\n'
        return
    fi
    printf '%s not as wanted. Now: %s apply. For the next boot: %s persist. Back again: %s undo\n' "$differing" "$0" "$0" "$0"
    exit 3
}

undo() {
    # Not in a condition: there bash would ignore a command that fails within.
    undo_runtime
    undo_boot
    [ -z "$undo_failed" ]
}

main() {
    parse_arguments "$@"
    state=$root/run/isocnc-isolcpus.state
    library=$root/var/lib/isocnc/isolcpus
    cpu_folder=$root/sys/devices/system/cpu
    # The fake tools of a fake tree find their tree by it.
    [ -z "$root" ] || export ISOLCPUS_ROOT=$root
    if [ "$command" != status ] && [ -z "$dry_run" ] && [ -z "$root" ] && [ "$(id -u)" -ne 0 ]; then
        refuse "$command changes the system: run it as root, or look with --dry-run"
    fi
    work=$(mktemp -d)
    trap 'rm -rf "$work"' EXIT
    if [ "$command" != status ] && [ -z "$dry_run" ]; then lock; fi
    if [ "$command" != undo ]; then
        choose_cpus
        check_interface
        boot_words
        find_loader
    fi
    "$command"
}

# One at a time: the unit at boot and a user may meet.
lock() {
    if command -v flock >/dev/null && [ -d "$root/sys" ]; then
        exec 9<"$root/sys"
        flock -w 60 9 || refuse "another isolcpus.sh has been running for a minute: wait for it, or end it"
    fi
}

command="" dry_run="" force="" yes="" root="" interface="" interface_gone="" nic_irq=rt
no_deep_idle="" no_throttling="" undo_failed="" reapply="" with_unit="" loader="" loader_reason=""
realtime_list="" found="" content="" name="" effective="" reason="" differing=0
declare -A records=()
parameters=() added=() missing=() conflicts=() words=()
# Where --reapply puts the copy that the unit runs.
installed=/usr/local/lib/isocnc
main "$@"
