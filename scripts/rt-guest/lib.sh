# shellcheck shell=dash
# What the checks of the guest share.

# shellcheck disable=SC2034
failures=0

# expect NAME FOUND WANTED: one line; counts what is not as it should be.
expect() {
    if [ "$2" = "$3" ]; then
        printf '  ok    %s: %s\n' "$1" "$2"
    else
        printf '  WRONG %s: %s, expected %s\n' "$1" "$2" "$3"
        failures=$((failures + 1))
    fi
}

# value FILE KEY: the first value of a key in JSON that has a line for each.
value() {
    sed -n "s/^ *\"$2\": \(.*[^,]\),\{0,1\}$/\1/p" "$1" | head -n 1
}

# threads_of PID: a line for each thread: name, policy (0 other, 1 FIFO, 5 idle), priority, CPU it ran on last, CPUs allowed.
# A thread that ends in this moment is left out.
threads_of() {
    for task in "/proc/$1/task/"*; do
        stat=$(cat "$task/stat" 2>/dev/null) || continue
        allowed=$(sed -n 's/^Cpus_allowed_list:[[:space:]]*//p' "$task/status" 2>/dev/null)
        name=${stat#*(}
        # Behind the name, which may hold spaces, the fields are numbered from 3 on; see proc(5).
        # shellcheck disable=SC2086
        set -- ${stat##*) }
        printf '%s %s %s %s %s\n' "${name%)*}" "${39}" "${38}" "${37}" "$allowed"
    done
}

# add_wire: the pair plk0, plk1 that machine files name, up and quiet.
add_wire() {
    # busybox cannot name the other end, which the kernel calls veth0.
    ip link add plk0 type veth
    ip link set veth0 name plk1
    for end in plk0 plk1; do
        echo 1 >/proc/sys/net/ipv6/conf/"$end"/disable_ipv6
        ip link set "$end" up
    done
}
