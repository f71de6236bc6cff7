# shellcheck shell=bash
# The kernel command line, in the configuration of the boot loader: what is missing, and how each loader takes it.
#
#   grub          Debian, Ubuntu: a file of ours in /etc/default/grub.d; others: a line in /etc/default/grub
#   grubby        Fedora, RHEL: its own command
#   systemd-boot  /etc/kernel/cmdline for kernels to come, the entries of the boot partition for those that are there
#   kernelstub    Pop!_OS: /etc/kernelstub/configuration, which the command kernelstub brings to the boot partition

grub_file=/etc/default/grub
grub_drop_in=/etc/default/grub.d/zz-isocnc.cfg
kernel_cmdline=/etc/kernel/cmdline
kernelstub_file=/etc/kernelstub/configuration

# boot_words: what the kernel command line is to have, in `words`.
boot_words() {
    words=(
        "isolcpus=managed_irq,domain,$realtime_list" "nohz_full=$realtime_list" "rcu_nocbs=$realtime_list"
        "irqaffinity=$housekeeping_list" skew_tick=1 nowatchdog nosoftlockup nmi_watchdog=0
        transparent_hugepage=never "${parameters[@]}"
    )
}

# find_loader: its name in `loader`, how we know in `loader_reason`; empty where none is known.
find_loader() {
    local info
    if [ -n "$loader" ]; then
        loader_reason="as said by --loader"
        return
    fi
    # What has started this kernel, where the firmware keeps it: UTF-16, of which every other octet is 0.
    info=$(cat "$root"/sys/firmware/efi/efivars/LoaderInfo-* 2>/dev/null | tr -cd '[:print:]') || true
    if tool kernelstub >/dev/null && [ -e "$root$kernelstub_file" ]; then
        loader=kernelstub loader_reason="kernelstub and its configuration are there"
    elif [[ $info == *systemd-boot* ]] && ! tool grubby >/dev/null; then
        loader=systemd-boot loader_reason="it has started this kernel"
    elif tool grubby >/dev/null; then
        loader=grubby loader_reason="the command grubby is there"
    elif [ -e "$root$grub_file" ] && grub_tool >/dev/null; then
        loader=grub loader_reason="$grub_file and the command $(basename "$(grub_tool)") are there"
    elif [ -n "$(entries)" ]; then
        loader=systemd-boot loader_reason="its entries are there"
    else
        loader="" loader_reason="neither kernelstub, systemd-boot, grubby nor GRUB was found"
    fi
}

grub_tool() {
    tool update-grub || tool grub-mkconfig || tool grub2-mkconfig
}

# entries: those of systemd-boot that start Linux, without root.
entries() {
    local file
    for file in "$root"/{boot,boot/efi,efi}/loader/entries/*.conf; do
        if grep -qsE '^linux[[:space:]]' "$file"; then printf '%s\n' "${file#"$root"}"; fi
    done
}

# ---- what is configured now, without what we have added -------------------------------------------------------------

# configured FILE: the words for the kernel in one file of a boot loader.
configured() {
    [ -e "$2" ] || return 0
    case $1 in
        grub) sed -nE "s/^[[:space:]]*(export[[:space:]]+)?GRUB_CMDLINE_LINUX(_DEFAULT)?\+?=//p" "$2" | tr -d "\"'" ;;
        entry) sed -nE 's/^options[[:space:]]+//p' "$2" ;;
        cmdline) cat "$2" ;;
        kernelstub)
            # In the list kernel_options of the section "user".
            awk '/"user"[[:space:]]*:/ { user = 1 } user && /"kernel_options"/ { list = 1; next } /\]/ { list = 0 } list' "$2" |
                sed 's/^[[:space:]]*"\(.*\)",\{0,1\}[[:space:]]*$/\1/'
            ;;
    esac
}

# grubby_words: the arguments of the kernel that is started by default.
grubby_words() {
    "$(tool grubby)" --info=DEFAULT 2>/dev/null | sed -n 's/^args="\(.*\)"$/\1/p'
}

# add_words FILE <WORDS: which of ours are missing there, in `missing`; those that have another value in `conflicts`.
add_words() {
    local have word other
    have=$(tr -s '[:space:]' '\n')
    missing=()
    for word in "${words[@]}"; do
        if grep -qxF -- "$word" <<<"$have"; then continue; fi
        missing+=("$word")
        [[ $word == *=* ]] || continue
        while read -r other; do
            conflicts+=("$1 has $other, wanted $word")
        done < <(grep -F -- "${word%%=*}=" <<<"$have" | grep -E "^${word%%=*}=" || true)
    done
}

# ---- the plan of each loader ----------------------------------------------------------------------------------------

plan_boot() {
    conflicts=()
    case $loader in
        grub) plan_grub ;;
        grubby) plan_grubby ;;
        systemd-boot) plan_systemd_boot ;;
        kernelstub) plan_kernelstub ;;
    esac
}

plan_grub() {
    local file line
    add_words "$grub_file" < <(
        for file in "$root$grub_file" "$root${grub_drop_in%/*}"/*.cfg; do
            case ${file#"$root"} in
                "$grub_drop_in") ;;
                "$grub_file") configured grub "$(base "$grub_file")" ;;
                *) configured grub "$file" ;;
            esac
        done
    )
    [ ${#missing[@]} -gt 0 ] || return 0
    # shellcheck disable=SC2016 # GRUB expands it
    printf -v line 'GRUB_CMDLINE_LINUX_DEFAULT="$GRUB_CMDLINE_LINUX_DEFAULT %s"' "${missing[*]}"
    if tool update-grub >/dev/null; then
        # Debian reads this folder, too.
        plan "$grub_drop_in" <<<"# The real-time CPUs, by isolcpus.sh persist; isolcpus.sh undo takes it back.
$line"
    else
        {
            [ ! -e "$(base "$grub_file")" ] || cat "$(base "$grub_file")"
            printf '\n# The real-time CPUs, by isolcpus.sh persist; isolcpus.sh undo takes it back.\n%s\n' "$line"
        } | plan "$grub_file"
    fi
}

# grubby changes files of its own; what it was given is kept in $library/grubby.
plan_grubby() {
    local word
    local -a added=()
    [ ! -e "$library/grubby" ] || read -ra added <"$library/grubby"
    add_words "the default kernel" < <(
        for word in $(grubby_words); do
            [[ " ${added[*]} " == *" $word "* ]] || printf '%s\n' "$word"
        done
    )
}

plan_systemd_boot() {
    local path found="" uki=""
    for path in $(entries); do
        found=yes
        add_words "$path" < <(configured entry "$(base "$path")")
        note_added
        [ ${#missing[@]} -eq 0 ] || append_to_entry "${missing[*]}" "$(base "$path")" | plan "$path"
    done
    [ -n "$found" ] || uki=yes
    # Without the file kernel-install takes the command line of the running kernel.
    if [ -e "$root$kernel_cmdline" ] || tool kernel-install >/dev/null; then
        add_words "$kernel_cmdline" < <(old_cmdline)
        added=("${missing[@]}")
        [ ${#missing[@]} -eq 0 ] || printf '%s\n' "$(old_cmdline | tr -s '[:space:]' ' ' | sed 's/ $//') ${missing[*]}" |
            plan "$kernel_cmdline"
    elif [ -n "$uki" ]; then
        refuse "systemd-boot without entries in loader/entries and without kernel-install: add by hand
  ${words[*]}"
    fi
}

# What undo takes out of entries that were made meanwhile: what /etc/kernel/cmdline hands on, without it what any has got.
note_added() {
    local word
    for word in "${missing[@]}"; do
        [[ " ${added[*]} " == *" $word "* ]] || added+=("$word")
    done
}

# What /etc/kernel/cmdline says, or what kernel-install takes in its place.
old_cmdline() {
    local file
    file=$(base "$kernel_cmdline")
    if [ -e "$file" ]; then
        cat "$file"
    elif [ -e "$root/usr/lib/kernel/cmdline" ]; then
        cat "$root/usr/lib/kernel/cmdline"
    else
        # The loader's own words, and ours from an earlier persist, stay out.
        tr -s ' \n' '\n' <"$root/proc/cmdline" | grep -vE '^(BOOT_IMAGE|initrd)=' | grep -vxF "$(recorded_words)" | tr '\n' ' '
    fi
}

recorded_words() {
    if [ -s "$library/words" ]; then tr ' ' '\n' <"$library/words"; else printf '(none)\n'; fi
}

# append_to_entry WORDS FILE: to its last line of options.
append_to_entry() {
    awk -v words="$1" '
        { line[NR] = $0 }
        $1 == "options" { last = NR }
        END {
            for (i = 1; i <= NR; i++) {
                sub(/[ \t]+$/, i == last ? "" : "&", line[i])
                print line[i] (i == last ? " " words : "")
            }
            if (!last) print "options " words
        }' "$2"
}

plan_kernelstub() {
    local file
    file=$(base "$kernelstub_file")
    add_words "$kernelstub_file" < <(configured kernelstub "$file")
    [ ${#missing[@]} -gt 0 ] || return 0
    # As kernelstub itself writes it: one word a line, no newline at the end.
    awk -v words="${missing[*]}" '
        function out(text) { printf "%s%s", separator, text; separator = "\n" }
        /"user"[[:space:]]*:/ { user = 1 }
        user && !done && /"kernel_options"[[:space:]]*:[[:space:]]*\[[[:space:]]*$/ { list = 1; count = 0; out($0); next }
        list && /^[[:space:]]*\]/ {
            if (count) out(previous ",")
            n = split(words, word, " ")
            for (i = 1; i <= n; i++) out("      \"" word[i] "\"" (i < n ? "," : ""))
            list = 0; done = 1
            out($0)
            next
        }
        list { if (count++) out(previous); previous = $0; next }
        { out($0) }
        END { exit !done }' "$file" >"$work/kernelstub" ||
        refuse "$kernelstub_file is not understood: expected a section \"user\" with a list \"kernel_options\", one a line.
Add the words by hand: kernelstub --add-options \"${missing[*]}\""
    [ -n "$(tail -c1 "$file")" ] || printf '\n' >>"$work/kernelstub"
    plan "$kernelstub_file" <"$work/kernelstub"
}
