#!/usr/bin/env bash
# Everything that others install: scripts/package.sh [--out FOLDER] [--programs FOLDER] [--key FILE] [--version VERSION].
#
# In:  this tree; the programs, built here by release.sh or given; the secret key that signs the apt repository, made where there is none.
# Out: in FOLDER, target/package as a rule:
#      isocnc_VERSION_amd64.deb, isocnc-cell_VERSION_amd64.deb
#      isocnc-VERSION-linux-amd64.tar.xz   runs from any folder
#      isocnc-VERSION-oci.tar              image for podman and docker: isocnc demo --memory --panel
#      apt/                                repository of the Debian packages; apt/isocnc.gpg is the public key
#
# The same commit, compiler and PC give the same octets in every folder: names are sorted, times are those of the last commit, owners root,
# and each compressor has one thread. Only signatures differ where the key is another one.
set -euo pipefail
export LC_ALL=C
umask 022
cd "$(dirname "$0")/.."

usage() {
    printf 'usage: package.sh [--out FOLDER] [--programs FOLDER] [--key FILE] [--version VERSION]\n' >&2
    exit 2
}

target=$(realpath -m "${CARGO_TARGET_DIR:-target}")
out=$target/package programs="" key=$target/package-key.asc version=$(sed -n 's/^version = "\(.*\)"/\1/p' Cargo.toml | head -n 1)
while [ $# -gt 0 ]; do
    [ $# -ge 2 ] || usage
    case $1 in
        --out) out=$(realpath -m "$2") ;;
        --programs) programs=$2 ;;
        --key) key=$(realpath -e "$2") ;;
        --version) version=$2 ;;
        *) usage ;;
    esac
    shift 2
done
SOURCE_DATE_EPOCH=${SOURCE_DATE_EPOCH:-$(git log -1 --format=%ct)}
export SOURCE_DATE_EPOCH

if [ -z "$programs" ]; then
    scripts/release.sh
    programs=$target/x86_64-unknown-linux-gnu/dist
fi
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
rm -rf "$out"
mkdir -p "$out"

# packed FOLDER: as a tar archive, the same each time.
packed() {
    tar --sort=name --format=gnu --mtime="@$SOURCE_DATE_EPOCH" --owner=0 --group=0 --numeric-owner -C "$1" -cf - "${@:2}"
}

# put FILE... FOLDER: files and folders with the rights that they have in git, whatever the umask was when they were checked out.
put() {
    local to="${*: -1}"
    mkdir -p "$to"
    cp -r "${@:1:$#-1}" "$to"
    chmod -R u=rwX,go=rX "$to"
}

# filled CRATE FOLDER [OPTIONS OF CARGO TREE]: what is of a program in all packages: itself, its manual, completion and licences.
filled() {
    local crate=$1 usr=$2/usr page
    install -D -m 755 "$programs/$crate" "$usr/bin/$crate"
    "$programs/$crate" man "$usr/share/man/man1" >/dev/null
    for page in "$usr"/share/man/man1/*; do gzip -9n "$page"; done
    mkdir -p "$usr"/share/{bash-completion/completions,zsh/vendor-completions,fish/vendor_completions.d,"doc/$crate"}
    "$programs/$crate" completions bash >"$usr/share/bash-completion/completions/$crate"
    "$programs/$crate" completions zsh >"$usr/share/zsh/vendor-completions/_$crate"
    "$programs/$crate" completions fish >"$usr/share/fish/vendor_completions.d/$crate.fish"
    gzip -9n <CHANGELOG.md >"$usr/share/doc/$crate/changelog.gz"
    scripts/package/bill.py "$crate" "$version" "$usr/share/doc/$crate/sbom.cdx.json" "$usr/share/doc/$crate/copyright" "${@:3}"
    # A package puts the program elsewhere than a user does.
    mkdir -p "$usr/lib/systemd/system"
    sed "s#/usr/local/bin/#/usr/bin/#" "configs/$crate.service" >"$usr/lib/systemd/system/$crate.service"
}

control=$work/isocnc
filled isocnc "$control" --features isocnc/cell
cat crates/panel/dist/licences.txt >>"$control/usr/share/doc/isocnc/copyright"
doc=$control/usr/share/doc/isocnc
put configs/*.toml configs/*.ngc configs/*.var configs/*.tbl configs/machine.schema.json configs/cell configs/logic examples/python \
    examples/own-component drives "$doc/examples"
put programs/probing "$control/usr/share/isocnc/programs"
put hal-pins/clients/* "$control/usr/share/isocnc/clients"
put scripts/isolcpus.sh scripts/isolcpus "$control/usr/share/isocnc"
mkdir -p "$control/etc/isocnc" "$control/usr/lib/udev/rules.d"
echo 'KERNEL=="cpu_dma_latency", GROUP="isocnc", MODE="0660"' >"$control/usr/lib/udev/rules.d/80-isocnc.rules"

cell=$work/isocnc-cell
filled isocnc-cell "$cell"
cat crates/cell/dist/licences.txt >>"$cell/usr/share/doc/isocnc-cell/copyright"
put configs/cell-cost.toml docs/cell.md "$cell/usr/share/doc/isocnc-cell/examples"

# ---- Debian packages ------------------------------------------------------------------------------------------------

# The newest symbols of glibc that a program needs.
glibc() {
    objdump -T "$1" | sed -n 's/.*GLIBC_\([0-9][0-9.]*\).*/\1/p' | sort -V | tail -n 1
}

# debian CRATE FOLDER SUMMARY TEXT
debian() {
    local crate=$1 folder=$2 script
    mkdir "$folder/DEBIAN"
    (cd "$folder" && find usr -type f -print0 | sort -z | xargs -0 md5sum >DEBIAN/md5sums)
    cat >"$folder/DEBIAN/control" <<END
Package: $crate
Version: $version
Architecture: amd64
Maintainer: isocnc contributors <isocnc@localhost>
Installed-Size: $(find "$folder/usr" -type f -printf '%s\n' | awk '{ kb += int(($1 + 1023) / 1024) } END { print kb }')
Depends: libc6 (>= $(glibc "$folder/usr/bin/$crate")), passwd
Section: misc
Priority: optional
Description: $3
 $4
END
    for script in postinst prerm postrm; do
        sed "s/@CRATE@/$crate/g" "scripts/package/$script" >"$folder/DEBIAN/$script"
        chmod 755 "$folder/DEBIAN/$script"
    done
    find "$folder" -exec touch -h -d "@$SOURCE_DATE_EPOCH" {} +
    dpkg-deb --root-owner-group --threads-max=1 -Zxz --build "$folder" "$out/${crate}_${version}_amd64.deb" >/dev/null
    rm -r "$folder/DEBIAN"
}
debian isocnc "$control" "CNC control for Linux PCs" \
    "Reads G-code, plans jerk-limited motion, drives CiA 402 servo drives over EtherCAT or Ethernet POWERLINK, and stepper motors by pulses."
debian isocnc-cell "$cell" "supervisor of a cell of isocnc controls" \
    "Uploads programs, collects alarms and results, and works through orders of parts, on up to 256 machines."

# ---- tarball --------------------------------------------------------------------------------------------------------

name=isocnc-$version
mkdir "$work/$name"
cp -r "$control/usr/." "$cell/usr/." "$work/$name"
packed "$work" "$name" | xz -T1 >"$out/$name-linux-amd64.tar.xz"

# ---- image of a container -------------------------------------------------------------------------------------------

# It has the control and, of this PC's C library, what that needs.
layer=$work/layer
mkdir -p "$layer/tmp" "$layer/etc"
chmod 1777 "$layer/tmp"
cp -r "$control/usr" "$layer"
ldd "$layer/usr/bin/isocnc" | grep -o '/[^ ]*' | while read -r library; do
    install -D -m 755 "$(realpath "$library")" "$layer$library"
done
install -D -m 644 /usr/share/doc/libc6/copyright "$layer/usr/share/doc/libc6/copyright"
echo 'root:x:0:0:root:/tmp:/sbin/nologin' >"$layer/etc/passwd"

layout=$work/layout
mkdir -p "$layout/blobs/sha256"
# blob FILE: into the layout; its digest.
blob() {
    local sum
    sum=$(sha256sum <"$1")
    mv "$1" "$layout/blobs/sha256/${sum%% *}"
    printf '%s\n' "${sum%% *}"
}
size() { stat -c %s "$layout/blobs/sha256/$1"; }
packed "$layer" . >"$work/layer.tar"
plain=$(sha256sum <"$work/layer.tar")
gzip -9n "$work/layer.tar"
layer_blob=$(blob "$work/layer.tar.gz")
cat >"$work/config" <<END
{"created":"$(date -u -d "@$SOURCE_DATE_EPOCH" +%FT%TZ)","architecture":"amd64","os":"linux","config":{"Env":["PATH=/usr/bin"],"Entrypoint":["/usr/bin/isocnc"],"Cmd":["demo","--memory","--panel"],"WorkingDir":"/tmp"},"rootfs":{"type":"layers","diff_ids":["sha256:${plain%% *}"]}}
END
config_blob=$(blob "$work/config")
media=application/vnd.oci.image
cat >"$work/manifest" <<END
{"schemaVersion":2,"mediaType":"$media.manifest.v1+json","config":{"mediaType":"$media.config.v1+json","digest":"sha256:$config_blob","size":$(size "$config_blob")},"layers":[{"mediaType":"$media.layer.v1.tar+gzip","digest":"sha256:$layer_blob","size":$(size "$layer_blob")}]}
END
manifest_blob=$(blob "$work/manifest")
# The first annotation is for podman, the second one for docker.
cat >"$layout/index.json" <<END
{"schemaVersion":2,"mediaType":"$media.index.v1+json","manifests":[{"mediaType":"$media.manifest.v1+json","digest":"sha256:$manifest_blob","size":$(size "$manifest_blob"),"annotations":{"org.opencontainers.image.ref.name":"isocnc:$version","io.containerd.image.name":"docker.io/library/isocnc:$version"}}]}
END
echo '{"imageLayoutVersion":"1.0.0"}' >"$layout/oci-layout"
packed "$layout" . >"$out/$name-oci.tar"

# ---- apt repository -------------------------------------------------------------------------------------------------

repository=$out/apt
mkdir -p "$repository/dists/stable/main/binary-amd64"
for crate in isocnc isocnc-cell; do
    deb=${crate}_${version}_amd64.deb
    pool=pool/main/i/$crate
    mkdir -p "$repository/$pool"
    cp "$out/$deb" "$repository/$pool"
    dpkg-deb -f "$out/$deb"
    printf 'Filename: %s\nSize: %s\nSHA256: %s\n\n' "$pool/$deb" "$(stat -c %s "$out/$deb")" "$(sha256sum <"$out/$deb" | cut -d ' ' -f 1)"
done >"$repository/dists/stable/main/binary-amd64/Packages"
gzip -9nk "$repository/dists/stable/main/binary-amd64/Packages"
cd "$repository/dists/stable"
cat >"$work/Release" <<END
Origin: isocnc
Label: isocnc
Suite: stable
Codename: stable
Date: $(date -u -R -d "@$SOURCE_DATE_EPOCH")
Architectures: amd64
Components: main
SHA256:
$(sha256sum main/binary-amd64/* | while read -r sum file; do printf ' %s %s %s\n' "$sum" "$(stat -c %s "$file")" "$file"; done)
END
mv "$work/Release" .

export GNUPGHOME=$work/gnupg
mkdir -m 700 "$GNUPGHOME"
trap 'gpgconf --kill gpg-agent; rm -rf "$work"' EXIT
# At the time of the last commit: who signs the same twice makes the same twice.
sign() { gpg --batch --quiet --yes --faked-system-time "$SOURCE_DATE_EPOCH!" --ignore-time-conflict --digest-algo SHA512 "$@"; }
if [ ! -e "$key" ]; then
    sign --passphrase '' --quick-generate-key "isocnc packages" ed25519 sign never
    (umask 077 && sign --armor --export-secret-keys >"$key")
    printf 'a key was made: %s; keep it in a safe place, and give it with --key the next time\n' "$key"
fi
sign --import "$key"
sign --clearsign --output InRelease Release
sign --armor --detach-sign --output Release.gpg Release
sign --export >"$repository/isocnc.gpg"

cd "$out"
sha256sum ./*.deb ./*.tar* apt/dists/stable/InRelease
