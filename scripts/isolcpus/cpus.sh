# shellcheck shell=bash
# Lists ("0,2-3") and masks ("d") of CPUs, as the kernel reads and writes them.

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
    local cpu=0 word text=""
    for cpu in "$@"; do
        words[cpu / 32]=$((${words[cpu / 32]:-0} | 1 << cpu % 32))
    done
    # cpu is the highest one now, and its word has a bit set.
    for ((word = cpu / 32; word >= 0; word--)); do
        if [ -z "$text" ]; then
            printf -v text '%x' "${words[word]:-0}"
        else
            printf -v text '%s,%08x' "$text" "${words[word]:-0}"
        fi
    done
    printf '%s' "$text"
}

# expand_mask MASK: "d" -> "0 2 3", ascending. Fails if MASK is none.
expand_mask() {
    local -a words=() cpus=()
    local word bit bits
    [[ $1 =~ ^[0-9a-fA-F]{1,8}(,[0-9a-fA-F]{8})*$ ]] || return 1
    IFS=, read -ra words <<<"$1"
    for ((word = ${#words[@]} - 1; word >= 0; word--)); do
        bits=$((16#${words[word]}))
        for ((bit = 0; bit < 32; bit++)); do
            ((bits >> bit & 1)) && cpus+=($(((${#words[@]} - 1 - word) * 32 + bit)))
        done
    done
    printf '%s' "${cpus[*]}"
}

# is_in CPU "0 2 3": whether the CPU is one of those.
is_in() {
    [[ " $2 " == *" $1 "* ]]
}

# meet "0 2 3" "2 4": whether the two have a CPU in common.
meet() {
    local cpu
    for cpu in $1; do
        if is_in "$cpu" "$2"; then return 0; fi
    done
    return 1
}

# without "0 2 3" "2 4" -> "0 3".
without() {
    local cpu
    local -a left=()
    for cpu in $1; do
        is_in "$cpu" "$2" || left+=("$cpu")
    done
    printf '%s' "${left[*]}"
}
