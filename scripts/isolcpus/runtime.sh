# shellcheck shell=bash
# Reads, sets and puts back the items of items.sh.
#
# The record $state has one line for each item that apply has changed: kind, key, old value, separated by tabs. It is
# written before the item is, so that `undo` works after an apply that was interrupted at any point.

# tool NAME: where it is. With --root only what that tree brings along: never a tool that would change this PC.
tool() {
    local folder
    if [ -z "$root" ]; then
        command -v "$1"
        return
    fi
    for folder in usr/sbin usr/bin; do
        if [ -x "$root/$folder/$1" ]; then
            printf '%s' "$root/$folder/$1"
            return
        fi
    done
    return 1
}

# read_item KIND KEY: its value in `found`; on failure the reason is in `reason`.
read_item() {
    local group name state
    found=""
    case $1 in
        thread) thread_cpus "${2%% *}" || found="" ;;
        nic)
            while read -r group name state; do
                if [ "$group $name" = "${2#* }" ]; then found=$state; fi
            done < <(nic_state "${2%% *}")
            ;;
        service) if irqbalance_runs; then found=running; else found=stopped; fi ;;
        *) if slurp "$root$2"; then found=$content; fi ;;
    esac
    if [ "$1" = choice ]; then
        # "always [madvise] never" -> "madvise"
        [[ $found == *\[*\]* ]] || found=""
        found=${found#*\[}
        found=${found%%\]*}
    fi
    reason="unreadable"
    [ -n "$found" ] || return 1
    reason="not understood"
    [[ $found != *[[:cntrl:]]* ]]
}

# write_item KIND KEY VALUE; on failure the reason is in `reason`.
write_item() {
    local tool group
    local -a word
    read -ra word <<<"$2"
    case $1 in
        thread)
            tool=$(tool taskset) || { reason="no taskset here (package util-linux)"; return 1; }
            reason=$("$tool" -pc "$3" "${word[0]}" 2>&1) && return
            ;;
        nic)
            tool=$(tool ethtool) || { reason="no ethtool here"; return 1; }
            case ${word[1]} in coalesce) group=-C ;; feature) group=-K ;; pause) group=-A ;; *) group=--set-eee ;; esac
            reason=$("$tool" "$group" "${word[0]}" "${word[2]}" "$3" 2>&1) && return
            ;;
        service)
            tool=$(tool systemctl) || { reason="no systemctl here: stop irqbalance by hand"; return 1; }
            if [ "$3" = running ]; then group=start; else group=stop; fi
            reason=$("$tool" "$group" "$2.service" 2>&1) && return
            ;;
        *) reason=$({ printf '%s\n' "$3" >"$root$2"; } 2>&1) && return ;;
    esac
    reason=${reason##*$'\n'}
    reason=${reason##*: }
    return 1
}

# same KIND A B: whether two values mean the same.
same() {
    local a=$2 b=$3
    [ "$a" != "$b" ] || return 0
    case $1 in
        list | thread)
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

# What the kernel or a driver answers for what it lets nobody change: some interrupts, some settings of some cards.
unchangeable() {
    case $1 in
        nic | thread) return 0 ;;
    esac
    case $reason in
        "Input/output error" | "Operation not permitted" | "Invalid argument" | "Operation not supported") return 0 ;;
    esac
    return 1
}

# name_item KIND KEY: what it is called in messages, in `name`.
name_item() {
    case $1 in
        thread) name="kernel thread ${2#* } (pid ${2%% *})" ;;
        nic) name="ethtool $2" ;;
        service) name="service $2" ;;
        *) name=$2 ;;
    esac
}

# read_record: what is in the record, for `recorded`.
read_record() {
    local kind key value
    records=()
    [ -e "$state" ] || return 0
    while IFS=$'\t' read -r kind key value; do records["$kind $key"]=$value; done <"$state"
}

recorded() {
    [ -n "${records["$1 $2"]:-}" ]
}

# Takes back the last line, of an item that could not be changed.
forget_last() {
    sed -i '$d' "$state"
    [ -s "$state" ] || rm -f "$state"
}

# check_record: refuses a record that nobody but somebody else can have written: undo must not write anywhere.
check_record() {
    local kind key value number=0
    [ -e "$state" ] || return 0
    while IFS=$'\t' read -r kind key value; do
        number=$((number + 1))
        case $kind in
            list | mask | least | text | choice) [[ $key =~ ^/(proc|sys)/ && $key != */../* ]] || kind="" ;;
            thread) [[ $key =~ ^[0-9]+\ . ]] || kind="" ;;
            nic) [[ $key =~ ^[^/\ ]+\ (coalesce|feature|pause|eee)\ [a-z0-9-]+$ ]] || kind="" ;;
            service) [ "$key" = irqbalance ] || kind="" ;;
            *) kind="" ;;
        esac
        if [ -z "$kind" ] || [ -z "$value" ]; then
            refuse "$state, line $number is not understood: expected kind, key and old value with tabs between them.
Nothing was changed. Repair the line, or remove the file: all of this is gone after a reboot anyway"
        fi
    done <"$state"
}

apply() {
    local kind key value name new_record changed=0 kept=0 skipped=0 failed=0
    check_record
    read_record
    # Listed in full first: apply changes what the list is made from.
    items >"$work/items"
    while IFS=$'\t' read -r kind key value; do
        name_item "$kind" "$key"
        if ! read_item "$kind" "$key"; then
            printf 'skipped %s: %s\n' "$name" "$reason"
            skipped=$((skipped + 1))
            continue
        fi
        if same "$kind" "$found" "$value"; then
            kept=$((kept + 1))
            continue
        fi
        if [ -n "$dry_run" ]; then
            printf 'would set %s = %s (now %s)\n' "$name" "$value" "$found"
            changed=$((changed + 1))
            continue
        fi
        # The old value is safe before the new one is written; one that is there already is older.
        new_record=""
        if ! recorded "$kind" "$key"; then
            printf '%s\t%s\t%s\n' "$kind" "$key" "$found" >>"$state"
            new_record=yes
        fi
        if write_item "$kind" "$key" "$value"; then
            printf 'set     %s = %s (was %s)\n' "$name" "$value" "$found"
            changed=$((changed + 1))
            continue
        fi
        [ -z "$new_record" ] || forget_last
        if unchangeable "$kind"; then
            printf 'skipped %s: %s\n' "$name" "$reason"
            skipped=$((skipped + 1))
        else
            printf 'FAILED  %s: %s\n' "$name" "$reason" >&2
            failed=$((failed + 1))
        fi
    done <"$work/items"
    if [ -n "$dry_run" ]; then
        printf '%s to set, %s as wanted; nothing was changed\n' "$changed" "$kept"
        return
    fi
    printf '%s set, %s as wanted before, %s skipped, %s failed\n' "$changed" "$kept" "$skipped" "$failed"
    printf 'Until the next reboot; take it back with: %s undo\n' "$0"
    if [ -n "$interface_gone" ]; then
        printf 'interface %s is not there: nothing was set for it\n' "$interface_gone" >&2
        return 1
    fi
    [ "$failed" -eq 0 ]
}

undo_runtime() {
    local kind key value name line restored=0 failed=0
    local -a lines=() left=()
    if [ ! -e "$state" ]; then
        printf 'running kernel: nothing to undo (no %s)\n' "$state"
        return 0
    fi
    check_record
    mapfile -t lines < <(tac "$state")
    for line in "${lines[@]}"; do
        IFS=$'\t' read -r kind key value <<<"$line"
        name_item "$kind" "$key"
        if is_gone "$kind" "$key"; then
            printf 'gone    %s\n' "$name"
        elif [ -n "$dry_run" ]; then
            printf 'would set %s = %s\n' "$name" "$value"
        elif write_item "$kind" "$key" "$value"; then
            printf 'set     %s = %s\n' "$name" "$value"
            restored=$((restored + 1))
        else
            printf 'FAILED  %s: %s\n' "$name" "$reason" >&2
            failed=$((failed + 1))
            left=("$line" "${left[@]}")
        fi
    done
    [ -z "$dry_run" ] || return 0
    if [ "$failed" -eq 0 ]; then
        rm -f "$state"
    else
        printf '%s\n' "${left[@]}" >"$state.new"
        mv "$state.new" "$state"
    fi
    printf 'running kernel: %s put back, %s failed\n' "$restored" "$failed"
    [ "$failed" -eq 0 ] || undo_failed=yes
}

# is_gone KIND KEY: an interrupt, thread or interface that is no longer there needs nothing.
is_gone() {
    case $1 in
        thread) [ "$(cat "$root/proc/${2%% *}/comm" 2>/dev/null)" != "${2#* }" ] ;;
        nic) [ ! -e "$root/sys/class/net/${2%% *}" ] ;;
        service) return 1 ;;
        *) [ ! -e "$root$2" ] ;;
    esac
}

# is_immovable KIND KEY VALUE: an interrupt that apply has tried to move in vain, and that does no harm where it is: its
# CPU is in `effective`.
is_immovable() {
    local cpus
    [[ $1 = list && $2 == */smp_affinity_list ]] && ! recorded "$1" "$2" || return 1
    slurp "$root${2%/*}/effective_affinity_list" || return 1
    effective=$content
    cpus=$(expand "$effective") || return 1
    [ -z "$(without "$cpus" "$(expand "$3")")" ]
}

# status_runtime: each item; counts those that differ in `differing`.
status_runtime() {
    local kind key value name
    printf '\nRunning kernel (until the next reboot):\n'
    read_record
    items >"$work/items"
    while IFS=$'\t' read -r kind key value; do
        name_item "$kind" "$key"
        if ! read_item "$kind" "$key"; then
            printf '  unknown %s: %s\n' "$name" "$reason"
        elif same "$kind" "$found" "$value"; then
            printf '  ok      %s = %s\n' "$name" "$found"
        elif [ -e "$state" ] && is_immovable "$kind" "$key" "$value"; then
            printf '  fixed   %s = %s: the kernel lets nobody move it, but it comes on CPU %s only\n' "$key" "$found" "$effective"
        else
            printf '  differs %s = %s, wanted %s: apply sets it\n' "$name" "$found" "$value"
            differing=$((differing + 1))
        fi
    done <"$work/items"
}
