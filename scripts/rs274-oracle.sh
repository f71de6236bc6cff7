#!/usr/bin/env bash
# Makes LinuxCNC's stand-alone interpreter, `rs274`, runnable without installing LinuxCNC, and prints its path.
#
# In:  `rs274` on the PATH, else the package linuxcnc-uspace as this Debian or Ubuntu offers it (fetched once, with those of its
#      libraries that are not installed, and unpacked in a cache folder; no root needed, nothing is installed).
# Out: one line, the path of a program to call as `rs274`; exit code 0. Exit code 3 and the reason on stderr where this
#      distribution has no such package. The tests of crates/gcode/ compare with it: they look for $ISOCNC_RS274, then on the PATH.
#
# All of LinuxCNC with its dependencies would be 117 packages here; the interpreter needs two or three of them.
set -euo pipefail
export LC_ALL=C
# dpkg-deb is where an ordinary user's PATH may not look.
PATH=$PATH:/usr/sbin:/sbin

if [ $# -ne 0 ]; then
    echo "usage: rs274-oracle.sh     (no options; the cache folder is \$ISOCNC_CACHE or \$XDG_CACHE_HOME/isocnc)" >&2
    exit 2
fi

cache=${ISOCNC_CACHE:-${XDG_CACHE_HOME:-$HOME/.cache}/isocnc}/rs274-oracle
package=linuxcnc-uspace

unavailable() {
    printf 'rs274-oracle: %s\n' "$*" >&2
    exit 3
}

# Whether $1 interprets: a stand-alone rs274 wants a tool table and a parameter file, else it ends with 1 without a word.
works() {
    local folder output
    folder=$(mktemp -d)
    printf 'T1 P1 Z1 D2\n' >"$folder/tool.tbl"
    printf '5161 0\n' >"$folder/parameters.var"
    printf 'G0 X1\nM2\n' >"$folder/program.ngc"
    output=$("$1" -t "$folder/tool.tbl" -v "$folder/parameters.var" -g "$folder/program.ngc" </dev/null 2>/dev/null) || output=
    rm -rf "$folder"
    grep -q 'STRAIGHT_TRAVERSE(1.0000' <<<"$output"
}

if installed=$(command -v rs274) && works "$installed"; then
    printf '%s\n' "$installed"
    exit 0
fi
if [ -x "$cache/rs274" ] && works "$cache/rs274"; then
    printf '%s\n' "$cache/rs274"
    exit 0
fi

for tool in apt-get dpkg-deb; do
    command -v "$tool" >/dev/null || unavailable "no rs274 on the PATH, and no $tool to fetch it with"
done
candidate=$(apt-cache policy "$package" 2>/dev/null | sed -n 's/^ *Candidate: //p')
case $candidate in
    "" | "(none)") unavailable "no rs274 on the PATH, and no package $package in the package lists here" ;;
esac

is_installed() {
    [ "$(dpkg-query -W -f '${Status}' "$1" 2>/dev/null)" = "install ok installed" ]
}

# The libraries among the dependencies of package $1 whose names match the pattern $2.
libraries() {
    apt-cache depends "$1" | sed -n 's/^ *|\?Depends: \(lib[^ :]*\)$/\1/p' | grep -E "$2" || true
}

# The package and, of what it depends on, the libraries `rs274` itself is linked with, each with its own libraries.
wanted=("$package")
mapfile -t queue < <(libraries "$package" '^lib(boost-python|python3|tirpc|edit|readline)')
while [ "${#queue[@]}" -gt 0 ]; do
    library=${queue[0]}
    queue=("${queue[@]:1}")
    if is_installed "$library" || [[ " ${wanted[*]} " == *" $library "* ]]; then
        continue
    fi
    wanted+=("$library")
    mapfile -t -O "${#queue[@]}" queue < <(libraries "$library" .)
done

mkdir -p "$cache"
work=$(mktemp -d "$cache/new.XXXXXX")
trap 'rm -rf "$work"' EXIT
# What apt says goes to stderr: stdout is for the path. Run by root, apt wants a folder its own user may write to.
chmod 755 "$work"
(cd "$work" && apt-get download "${wanted[@]}" >&2)
for archive in "$work"/*.deb; do
    # Without the documentation and the examples: most of its 90 MB.
    dpkg-deb --fsys-tarfile "$archive" | tar -x -C "$work" --transform 's#^\./#root/#' --exclude './usr/share'
done

# Where shared libraries are found, relative to the unpacked root.
folders=$(find "$work/root" -name '*.so*' -printf '%P\n' | xargs -n 1 dirname | sort -u | grep -E '^(usr/)?lib(/[^/]*-linux-[^/]*)?$')
python=
if compgen -G "$work/root/usr/lib/python3*/encodings" >/dev/null; then
    # Python came with it: its library is here and nowhere else.
    python="export PYTHONHOME=\$root/usr"
fi
cat >"$work/rs274" <<END
#!/bin/sh
root="\$(dirname "\$(readlink -f "\$0")")/root"
for folder in $(tr '\n' ' ' <<<"$folders"); do
    LD_LIBRARY_PATH="\$root/\$folder\${LD_LIBRARY_PATH:+:\$LD_LIBRARY_PATH}"
done
export LD_LIBRARY_PATH
${python:+$python
}exec "\$root/usr/bin/rs274" "\$@"
END
chmod 755 "$work/rs274"

works "$work/rs274" ||
    unavailable "the unpacked $package does not run: $("$work/rs274" -x 2>&1 </dev/null | head -n 1)"
rm -rf "$cache/root" "$cache/rs274"
mv "$work/root" "$work/rs274" "$cache/"
printf '%s\n' "$cache/rs274"
