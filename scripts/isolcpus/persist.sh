# shellcheck shell=bash
# The commands that concern the next boot: persist, undo of it, status of it.
#
# In $library, beside the copies of files.sh: `loader`, its name; `words`, what was added for systemd-boot; `grubby`, what
# was given to grubby; `unfinished`, while the boot loader has not yet taken over what the files say.

unit=/etc/systemd/system/isocnc-isolcpus.service
unit_link=/etc/systemd/system/multi-user.target.wants/isocnc-isolcpus.service
irqbalance_file=/etc/default/irqbalance

persist() {
    local path
    local -a changed=()
    [ -n "$loader" ] || refuse "no boot loader that we know: $loader_reason. Add to the kernel command line by hand:
  ${words[*]}"
    check_library
    if [ -s "$library/loader" ] && [ "$(cat "$library/loader")" != "$loader" ]; then
        refuse "an earlier persist was for $(cat "$library/loader"), now it is $loader: $0 undo first"
    fi
    printf 'boot loader %s (%s)\n' "$loader" "$loader_reason"
    plan_boot
    if [ ${#conflicts[@]} -gt 0 ]; then
        refuse "the kernel command line is already set otherwise:
$(printf '  %s\n' "${conflicts[@]}")
Nothing was changed. Remove those words there, or choose the same CPUs with --cpus; what an earlier persist has written,
$0 undo removes"
    fi
    plan_irqbalance
    if [ -n "$reapply" ]; then
        plan_reapply
    elif ours "$unit" && ! grep -q -- "^ExecStart=.* --cpus $realtime_list " "$library/after$unit"; then
        refuse "the unit that runs apply at boot is for other CPUs:
  $(sed -n 's/^ExecStart=//p' "$library/after$unit")
Nothing was changed. Repeat this with --reapply and the options for it"
    fi
    # What an earlier persist has written and this one needs no more is put back.
    for path in $(paths "$library/after"); do
        present "$work/plan$path" || is_gone_entry "$path" || plan_original "$path"
    done
    for path in $(paths "$work/plan"); do
        if ! same_file "$root$path" "$work/plan$path" || ! ours "$path"; then changed+=("$path"); fi
    done
    # shellcheck disable=SC2046 # a path, a word
    refuse_foreign $(paths "$library/after")
    if ! show_plan; then
        printf 'nothing to do: all of it is configured; %s status says whether this kernel was started with it\n' "$0"
        return 0
    fi
    if [ -n "$dry_run" ]; then
        printf '\nnothing was changed (--dry-run)\n'
        return 0
    fi
    ask "Write this for the next boot?"
    # From here to the end without interruption.
    trap '' INT TERM
    make_library
    printf '%s\n' "$loader" >"$library/loader"
    printf '%s\n' "${added[*]}" >"$library/words"
    : >"$library/unfinished"
    for path in "${changed[@]}"; do change "$path"; done
    sync
    if ! rebuild run "${missing[*]}"; then
        printf 'The files stay as written. Repair what is said above and repeat persist, or: %s undo\n' "$0" >&2
        return 1
    fi
    # kernelstub may write its file in its own way.
    if [ "$loader" = kernelstub ] && ours "$kernelstub_file"; then
        place "$root$kernelstub_file" "$library/after$kernelstub_file"
    fi
    rm -f "$library/unfinished"
    sync
    printf 'Done; it takes effect with the next reboot. Take it back with: %s undo\n' "$0"
}

# A file that only an earlier version of ours has changed.
plan_original() {
    mkdir -p "$work/plan${1%/*}"
    if present "$library/before$1"; then
        cp -dp "$library/before$1" "$work/plan$1"
    else
        # It did not exist: it stays until undo.
        cp -dp "$library/after$1" "$work/plan$1"
    fi
}

# irqbalance is told to leave the CPUs alone, for the time until apply or in place of it.
plan_irqbalance() {
    local file
    file=$(base "$irqbalance_file")
    tool irqbalance >/dev/null || [ -e "$root$irqbalance_file" ] || return 0
    {
        [ ! -e "$file" ] || grep -vE '^[[:space:]]*IRQBALANCE_BANNED_CPU(S|LIST)=' "$file" || true
        # Versions before 1.8 know the mask only.
        printf 'IRQBALANCE_BANNED_CPULIST=%s\nIRQBALANCE_BANNED_CPUS=%s\n' "$realtime_list" "${realtime_mask//,/}"
    } | plan "$irqbalance_file"
}

# A copy of this script and a unit that runs its `apply` at each boot: the original may be in a folder that others can
# write to, or be gone.
plan_reapply() {
    local part command="$installed/isolcpus.sh apply --cpus $realtime_list --nic-irq $nic_irq" device=""
    [ -z "$no_throttling" ] || command+=" --no-throttling"
    [ -z "$no_deep_idle" ] || command+=" --no-deep-idle"
    if [ -n "$interface" ]; then
        command+=" --interface $interface"
        device=" $(device_unit "$interface")"
    fi
    plan "$installed/isolcpus.sh" <"$here/isolcpus.sh"
    chmod 755 "$work/plan$installed/isolcpus.sh"
    for part in "$here"/isolcpus/*.sh; do plan "$installed/isolcpus/${part##*/}" <"$part"; done
    plan "$unit" <<END
[Unit]
Description=Keep the CPUs of the real-time threads free of other work
After=irqbalance.service systemd-sysctl.service$device
Before=isocnc.service
${device:+Wants=${device# }
}
[Service]
Type=oneshot
RemainAfterExit=yes
ExecStart=$command

[Install]
WantedBy=multi-user.target
END
    with_unit=yes
    plan_link "$unit_link" ../isocnc-isolcpus.service
}

# systemd's name for an interface; a - in it is written \x2d.
device_unit() {
    printf 'sys-subsystem-net-devices-%s.device' "${1//-/\\x2d}"
}

# show_plan: every difference and every command; false where there is none.
show_plan() {
    local path shown=""
    for path in $(paths "$work/plan"); do
        if show_difference "$root$path" "$work/plan$path" "$path"; then shown=yes; fi
    done
    if [ "$loader" = grubby ] && ! grubby_is_done "${missing[*]}"; then shown=yes; fi
    if [ -e "$library/unfinished" ]; then shown=yes; fi
    [ -n "$shown" ] || return 1
    rebuild show "${missing[*]}"
}

grubby_is_done() {
    local word have
    [ "$(cat "$library/grubby" 2>/dev/null)" = "$1" ] || return 1
    have=" $(grubby_words) "
    for word in $1; do
        [[ $have == *" $word "* ]] || return 1
    done
}

# rebuild show|run WORDS: brings the files to the boot loader. WORDS: those that grubby is to have; "": none.
rebuild() {
    local version old=""
    case $loader in
        grub)
            case $(basename "$(grub_tool)") in
                update-grub) step "$1" update-grub || return 1 ;;
                grub-mkconfig) step "$1" grub-mkconfig -o "$root/boot/grub/grub.cfg" || return 1 ;;
                grub2-mkconfig) step "$1" grub2-mkconfig -o "$root/boot/grub2/grub.cfg" || return 1 ;;
                *) step "$1" update-grub || return 1 ;;
            esac
            ;;
        grubby)
            [ ! -s "$library/grubby" ] || old=$(cat "$library/grubby")
            if [ -n "$old" ] && [ "$old" != "$2" ]; then
                step "$1" grubby --update-kernel=ALL --remove-args="$old" || return 1
            fi
            if [ -n "$2" ]; then
                [ "$1" = show ] || printf '%s\n' "$2" >"$library/grubby"
                step "$1" grubby --update-kernel=ALL --args="$2" || return 1
            fi
            ;;
        systemd-boot)
            # Unified kernel images hold the command line: each is made again.
            if [ -z "$(entries)" ]; then
                for version in "$root"/usr/lib/modules/*/vmlinuz; do
                    [ -e "$version" ] || continue
                    step "$1" kernel-install add "$(basename "${version%/*}")" "$version" || return 1
                done
            fi
            ;;
        kernelstub) step "$1" kernelstub || return 1 ;;
    esac
    if [ -n "$with_unit" ] && tool systemctl >/dev/null; then step "$1" systemctl daemon-reload || return 1; fi
}

# step show|run TOOL ARGUMENT...
step() {
    local tool
    if [ "$1" = show ]; then
        printf 'then run: %s\n' "${*:2}"
        return
    fi
    printf 'run: %s\n' "${*:2}"
    tool=$(tool "$2") || { printf 'FAILED  %s: not installed\n' "$2" >&2; return 1; }
    "$tool" "${@:3}" || { printf 'FAILED  %s: exit code %s\n' "$2" "$?" >&2; return 1; }
}

# ---- undo -----------------------------------------------------------------------------------------------------------

check_library() {
    [ -e "$library/loader" ] || return 0
    case $(cat "$library/loader") in
        grub | grubby | systemd-boot | kernelstub) ;;
        *) refuse "$library/loader is not understood: expected grub, grubby, systemd-boot or kernelstub.
Nothing was changed at boot. The files as they were before are in $library/before" ;;
    esac
}

is_entry() {
    [[ $1 == */loader/entries/*.conf ]]
}

# The entry of a kernel that was removed meanwhile.
is_gone_entry() {
    is_entry "$1" && [ ! -e "$root$1" ]
}

undo_boot() {
    local path
    local -a back=()
    if [ ! -e "$library" ]; then
        printf 'next boot: nothing to undo (no %s)\n' "$library"
        return 0
    fi
    check_library
    loader=$(cat "$library/loader" 2>/dev/null) || loader=""
    missing=()
    for path in $(paths "$library/after"); do
        if is_gone_entry "$path"; then
            printf 'gone    %s\n' "$path"
        elif is_entry "$path" && changed_by_others "$path"; then
            plan_without_words "$path"
        else
            back+=("$path")
        fi
    done
    refuse_foreign "${back[@]}"
    # Kernels that were installed meanwhile have taken our words over.
    for path in $(entries); do
        ours "$path" || plan_without_words "$path"
    done
    if [ -e "$library/after$unit" ]; then with_unit=yes; fi
    for path in "${back[@]}"; do show_difference "$root$path" "$library/before$path" "$path" || true; done
    for path in $(paths "$work/plan"); do show_difference "$root$path" "$work/plan$path" "$path" || true; done
    rebuild show ""
    [ -z "$dry_run" ] || return 0
    ask "Write this for the next boot?"
    trap '' INT TERM
    for path in "${back[@]}"; do restore "$path"; done
    for path in $(paths "$work/plan"); do
        place "$work/plan$path" "$root$path"
        printf 'written %s\n' "$path"
    done
    if ! rebuild run ""; then
        printf 'The files are put back, the boot loader has not read them. Repair what is said above, then repeat undo\n' >&2
        return 1
    fi
    # kernelstub may have written its file in its own way.
    for path in "${back[@]}"; do restore "$path"; done
    forget_files
    sync
    printf 'next boot: put back; it takes effect with the next reboot\n'
}

# plan_without_words PATH: an entry of systemd-boot without what we have added, if it has any of it.
plan_without_words() {
    awk -v words="$(cat "$library/words" 2>/dev/null)" '
        BEGIN { n = split(words, word, " "); for (i = 1; i <= n; i++) ours[word[i]] = 1 }
        $1 == "options" {
            text = $1
            for (i = 2; i <= NF; i++) if (!($i in ours)) text = text " " $i; else found = 1
            if (found) { print text; next }
        }
        { print }' "$root$1" >"$work/entry"
    cmp -s "$work/entry" "$root$1" || plan "$1" <"$work/entry"
}

# ---- status ---------------------------------------------------------------------------------------------------------

# status_boot: each word of the kernel command line; counts those that the running kernel lacks in `differing`.
status_boot() {
    local word running
    running=" $(tr -s ' \n' ' ' <"$root/proc/cmdline") "
    printf '\nKernel command line (boot loader: %s; %s):\n' "${loader:-unknown}" "$loader_reason"
    for word in "${words[@]}"; do
        if [[ $running == *" $word "* ]]; then
            printf '  ok      %s\n' "$word"
            continue
        fi
        differing=$((differing + 1))
        if configured_everywhere "$word"; then
            printf '  waits   %s: configured, a reboot sets it\n' "$word"
        elif [[ $word == *=* && $running == *" ${word%%=*}="* ]]; then
            printf '  differs %s: is %s\n' "$word" "$(tr ' ' '\n' <<<"$running" | grep -F -- "${word%%=*}=" | tr '\n' ' ')"
        elif [ -n "$loader" ]; then
            printf '  missing %s: persist adds it\n' "$word"
        else
            printf '  missing %s: add it by hand\n' "$word"
        fi
    done
}

# Whether the boot loader has the word, by us or by somebody else.
configured_everywhere() {
    local path
    case $loader in
        grub) { cat "$root$grub_file" "$root${grub_drop_in%/*}"/*.cfg 2>/dev/null || true; } | has_word "$1" ;;
        grubby) grubby_words | has_word "$1" ;;
        kernelstub) has_word "$1" <"$root$kernelstub_file" ;;
        systemd-boot)
            for path in $(entries); do has_word "$1" <"$root$path" || return 1; done
            [ -n "$(entries)" ] || has_word "$1" <"$root$kernel_cmdline" 2>/dev/null
            ;;
        *) return 1 ;;
    esac
}

has_word() {
    { grep -v '^[[:space:]]*#' || true; } | tr -s '[:space:]"'\' '\n' >"$work/words"
    grep -qxF -- "$1" "$work/words"
}
