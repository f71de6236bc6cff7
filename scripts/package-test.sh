#!/usr/bin/env bash
# The Debian packages as users have them: scripts/package-test.sh [--packages FOLDER] [--kills N] [--suite SUITE]...
#
# In:  what package.sh made; mmdebstrap, which takes bare Debian roots (bookworm and trixie) from where this PC's apt does. Needs root.
# Out: for each suite what was found. Without a compiler: from the start of the installation to the first motion; an upgrade and a downgrade
#      keep state folder and machine file; after an upgrade killed at N random moments (50) the control starts, and the next one goes through;
#      a truncated package, one for another architecture, a full disk and a forged repository leave everything as it was.
# Exit code: 0 all as it should be, 1 something is not, 3 nothing can be tested here. SEED=... repeats the moments of another run.
set -euo pipefail
export LC_ALL=C
missing() {
    echo "skipped: $*"
    exit 3
}
[ "$(id -u)" -eq 0 ] || missing "needs root"
command -v mmdebstrap >/dev/null || missing "needs mmdebstrap"
# A namespace of its own: what is mounted goes with this process.
[ -n "${ISOCNC_PACKAGE_TEST:-}" ] || ISOCNC_PACKAGE_TEST=1 exec unshare --mount --propagation private "$0" "$@"
cd "$(dirname "$0")/.."

packages=${CARGO_TARGET_DIR:-target}/package kills=50 suites=()
while [ $# -gt 0 ]; do
    case $1 in
        --packages) packages=$2 ;;
        --kills) kills=$2 ;;
        --suite) suites+=("$2") ;;
        *) sed -n 2p "$0" >&2 && exit 2 ;;
    esac
    shift 2
done
[ ${#suites[@]} -gt 0 ] || suites=(bookworm trixie)
cache=${XDG_CACHE_HOME:-$HOME/.cache}/isocnc-package-test
RANDOM=${SEED:=$$}
work=$(mktemp -d)
finish() {
    # A control that failed a test may still run.
    jobs -p | xargs -r kill 2>/dev/null || true
    umount -R -l "$work"/*/root 2>/dev/null || true
    rm -rf --one-file-system "$work"
}
trap finish EXIT
root="" inside=()

fail() {
    printf 'WRONG: %s (SEED=%s)\n' "$*" "$SEED" >&2
    exit 1
}

seconds_since() {
    awk "BEGIN { printf \"%.1f\", $EPOCHREALTIME - $1 }"
}

# bare SUITE: a Debian root, fetched once.
bare() {
    local mirror
    [ -s "$cache/$1.tar" ] && return
    # shellcheck disable=SC2016
    mirror=$(apt-get indextargets --format '$(REPO_URI)' 'Created-By: Packages' 'Origin: Debian' | head -n 1)
    mkdir -p "$cache"
    mmdebstrap --variant=minbase --quiet "$1" "$cache/$1.part" "${mirror:-}" && mv "$cache/$1.part" "$cache/$1.tar"
}

# enter FOLDER: the root there is the one that is tested, and commands run inside it.
enter() {
    local folder
    root=$1
    inside=(chroot "$root" /usr/bin/env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin DEBIAN_FRONTEND=noninteractive)
    mountpoint -q "$root" || mount --bind "$root" "$root"
    for folder in proc sys dev; do mount --rbind "/$folder" "$root/$folder"; done
    # Controls outside have their sockets and pins elsewhere.
    for folder in run dev/shm; do mount -t tmpfs tmpfs "$root/$folder"; done
}

# ---- packages to compare with ---------------------------------------------------------------------------------------

old=$(find "$packages" -maxdepth 1 -name 'isocnc_*_amd64.deb')
[ -s "$old" ] || fail "$packages: not one package"
# The next version: other numbers, other programs, as one octet more does not harm them.
dpkg-deb -R "$old" "$work/next"
sed -i -E 's/^(Version: .*)/\1+next/' "$work/next/DEBIAN/control"
echo >>"$work/next/usr/bin/isocnc"
(cd "$work/next" && find usr -type f -print0 | xargs -0 md5sum >DEBIAN/md5sums)
dpkg-deb --root-owner-group -Zgzip --build "$work/next" "$work/next.deb" >/dev/null
sed -i 's/^Architecture: .*/Architecture: arm64/' "$work/next/DEBIAN/control"
dpkg-deb --root-owner-group -Zgzip --build "$work/next" "$work/foreign.deb" >/dev/null
head -c $(($(stat -c %s "$old") * 2 / 3)) "$old" >"$work/truncated.deb"

# ---- what is asked of a control -------------------------------------------------------------------------------------

# The machine of the demo as a service would have it, on a wire in memory.
machine_file() {
    sed -e '/^\[machine\]/a state_directory = "/var/lib/isocnc"' -e 's/^kind = "powerlink"/kind = "memory"/' configs/mill3-demo.toml
}

# starts [ORDER...]: it comes up, answers, carries the order out, ends; what it said last is in $said.
starts() {
    local pid ended=0 tries=100
    "${inside[@]}" isocnc run /etc/isocnc/machine.toml >"$work/control.log" 2>&1 &
    pid=$!
    while ! "${inside[@]}" isocnc status >"$work/status.log" 2>&1; do
        [ $((tries -= 1)) -gt 0 ] || fail "no control after ${1:-a start}: $(tail -n 3 "$work/control.log" "$work/status.log")"
        sleep 0.1
    done
    said=$("${inside[@]}" isocnc "${@:-status}") || ended=$?
    kill -TERM "$pid"
    wait "$pid" || true
    [ "$ended" -eq 0 ] || fail "isocnc ${*:-status}: $said"
}

# What no package may change.
belongings() {
    (cd "$root" && find etc/isocnc var/lib/isocnc -type f -print0 | sort -z | xargs -0 sha256sum)
}

# unchanged WHAT: a control starts, with the state that it had.
unchanged() {
    [ "$(belongings)" = "$kept" ] || fail "$1: state folder or machine file changed"
    starts parts --json
    grep -q '"target": *50' <<<"$said" || fail "$1: what was remembered is lost: $said"
    kept=$(belongings)
}

installed() {
    # shellcheck disable=SC2016
    "${inside[@]}" dpkg-query -W -f '${Status} ${Version}' isocnc
}

# ---- the tests ------------------------------------------------------------------------------------------------------

first_motion() {
    local begun=$EPOCHREALTIME pid installed="" moved="" log=$work/demo.log
    # One process from the first command to the last one.
    "${inside[@]}" sh -c 'apt-get install -y /isocnc.deb && exec isocnc demo --program /short-part.ngc --out /tmp/out' >"$log" 2>&1 &
    pid=$!
    while [ -z "$moved" ]; do
        kill -0 "$pid" 2>/dev/null || fail "no demo: $(tail -n 5 "$log")"
        if [ -z "$installed" ] && grep -q "^isocnc demo:" "$log"; then installed=$(seconds_since "$begun"); fi
        if grep -q "machine homing" "$log"; then moved=$(seconds_since "$begun"); fi
        sleep 0.02
    done
    wait "$pid" || fail "the demo: $(tail -n 5 "$log")"
    echo "installed after $installed s, joints move after $moved s (wanted: 10)"
}

up_and_down() {
    machine_file >"$root/etc/isocnc/machine.toml"
    mkdir -p "$root/var/lib/isocnc"
    starts parts target 50
    kept=$(belongings)
    "${inside[@]}" dpkg -i /next.deb >/dev/null
    unchanged "upgrade"
    "${inside[@]}" dpkg -i --force-downgrade /isocnc.deb >/dev/null 2>&1
    unchanged "downgrade"
    echo "upgrade and downgrade: $(wc -l <<<"$kept") files of state and machine as they were"
}

killed() {
    local begun=$EPOCHREALTIME length_ms moment pid n half=0 to
    "${inside[@]}" dpkg -i /next.deb >/dev/null
    length_ms=$(awk "BEGIN { printf \"%d\", ($EPOCHREALTIME - $begun) * 1000 }")
    for ((n = 1; n <= kills; n++)); do
        case $(installed) in *+next) to=isocnc ;; *) to=next ;; esac
        moment=$((RANDOM % length_ms))
        setsid "${inside[@]}" dpkg -i --force-downgrade "/$to.deb" >/dev/null 2>&1 &
        pid=$!
        sleep "$(printf '%d.%03d' $((moment / 1000)) $((moment % 1000)))"
        kill -KILL -- "-$pid" 2>/dev/null || true
        { wait "$pid" || true; } 2>/dev/null
        case $(installed) in "install ok installed"*) ;; *) half=$((half + 1)) ;; esac
        unchanged "killed after $moment ms"
        "${inside[@]}" dpkg --configure -a >/dev/null 2>&1 || true
        "${inside[@]}" dpkg -i --force-downgrade "/$to.deb" >/dev/null 2>&1 || fail "killed after $moment ms: the next try does not go through"
        [ -z "$("${inside[@]}" dpkg --verify isocnc)" ] || fail "killed after $moment ms: $("${inside[@]}" dpkg --verify isocnc)"
    done
    "${inside[@]}" dpkg -i /next.deb >/dev/null
    echo "killed $kills times within $length_ms ms, $half times half done: the control started each time, the next try went through"
}

broken() {
    local before bad
    before=$(installed)
    for bad in truncated foreign; do
        if "${inside[@]}" dpkg -i "/$bad.deb" >"$work/bad.log" 2>&1; then fail "a $bad package was installed"; fi
        [ "$(installed)" = "$before" ] || fail "a $bad package: $(installed)"
        unchanged "a $bad package"
    done
    echo "a truncated package and one for another architecture: refused"
}

# In a root of its own, whose names do not outlive the subshell.
full_disk() (
    small=$work/small/root
    mkdir -p "$small"
    mount -t tmpfs -o "size=$(($(du -sxk "$root" | cut -f 1) + 60000))k" tmpfs "$small"
    cp -ax "$root/." "$small"
    enter "$small"
    # A control needs some of it.
    head -c "$(($(df --output=avail -k "$small" | tail -n 1) - 8000))K" /dev/zero >"$small/filling"
    if "${inside[@]}" dpkg -i /isocnc.deb >"$work/bad.log" 2>&1; then fail "a full disk was not full"; fi
    grep -q "No space left" "$work/bad.log" || fail "$(cat "$work/bad.log")"
    unchanged "a full disk"
    rm "$small/filling"
    "${inside[@]}" dpkg -i --force-downgrade /isocnc.deb >/dev/null 2>&1 || fail "with room again the package is not installed"
    unchanged "room again"
    umount -R "$small"
    echo "a full disk: refused, nothing lost; with room again installed"
)

# The supervisor comes out of the signed repository, and out of one that somebody has changed it does not.
repository() {
    cp -r "$packages/apt" "$root/srv"
    cp "$root/srv/apt/isocnc.gpg" "$root/usr/share/keyrings"
    rm -rf "$root"/etc/apt/sources.list.d/* "$root"/var/lib/apt/lists/*
    echo "deb [signed-by=/usr/share/keyrings/isocnc.gpg] file:/srv/apt stable main" >"$root/etc/apt/sources.list"
    "${inside[@]}" sh -c 'apt-get update && apt-get install -y isocnc-cell && isocnc-cell --version' >"$work/apt.log" 2>&1 || fail "$(cat "$work/apt.log")"
    "${inside[@]}" dpkg --purge isocnc-cell >/dev/null 2>&1
    rm -rf "$root"/var/lib/apt/lists/*
    sed -i 's/^Suite: .*/Suite: other/' "$root/srv/apt/dists/stable/InRelease"
    rm "$root/srv/apt/dists/stable/Release"
    if "${inside[@]}" sh -c 'apt-get update --error-on=any && apt-get install -y isocnc-cell' >"$work/apt.log" 2>&1; then fail "a forged repository: $(cat "$work/apt.log")"; fi
    echo "the apt repository: installed from there; a forged one is refused"
}

tested=0
echo "SEED=$SEED"
for suite in "${suites[@]}"; do
    if ! bare "$suite"; then
        echo "$suite: skipped, cannot be had here"
        continue
    fi
    mkdir -p "$work/$suite/root"
    tar -C "$work/$suite/root" --exclude './dev/*' -xf "$cache/$suite.tar"
    enter "$work/$suite/root"
    cp "$old" "$root/isocnc.deb"
    cp "$work"/{next,foreign,truncated}.deb configs/short-part.ngc "$root"
    if "${inside[@]}" sh -c 'command -v cc gcc rustc'; then fail "there is a compiler"; fi
    echo "== $suite: glibc $("${inside[@]}" ldd --version | sed -n '1s/.* //p'), no compiler =="
    first_motion
    up_and_down
    killed
    broken
    full_disk
    repository
    umount -R "$root"
    tested=$((tested + 1))
done
[ "$tested" -gt 0 ] || missing "no Debian root can be had here"
