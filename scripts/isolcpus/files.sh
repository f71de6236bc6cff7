# shellcheck shell=bash
# Changes files for good, so that each can be put back byte for byte.
#
# $library keeps, under the path of each file that was changed, two copies: after/ as we left it and, where it existed
# before, before/ as we found it. after/ is there before the file itself is changed, so that `undo` works after an
# interruption at any point. A file that is neither of the two was changed by somebody else: not ours to overwrite.
# $work/plan has the files as they are to be; nothing is changed until the user has seen the difference.

# same_file A B: the same content, the same link, or both absent.
same_file() {
    if [ -L "$1" ] || [ -L "$2" ]; then
        [ -L "$1" ] && [ -L "$2" ] && [ "$(readlink "$1")" = "$(readlink "$2")" ]
    elif [ -e "$1" ] && [ -e "$2" ]; then
        cmp -s "$1" "$2"
    else
        [ ! -e "$1" ] && [ ! -e "$2" ]
    fi
}

present() {
    [ -e "$1" ] || [ -L "$1" ]
}

ours() {
    present "$library/after$1"
}

changed_by_others() {
    ours "$1" && ! same_file "$root$1" "$library/after$1" && ! same_file "$root$1" "$library/before$1"
}

# base PATH: the file that a new version of PATH is made from: as it was before us.
base() {
    if ours "$1" && ! changed_by_others "$1"; then
        printf '%s' "$library/before$1"
    else
        printf '%s' "$root$1"
    fi
}

# plan PATH <CONTENT
plan() {
    mkdir -p "$work/plan${1%/*}"
    cat >"$work/plan$1"
}

plan_link() {
    mkdir -p "$work/plan${1%/*}"
    ln -sfn "$2" "$work/plan$1"
}

# paths FOLDER: what is in it, without the folder, one a line.
paths() {
    [ ! -d "$1" ] || (cd "$1" && find . ! -type d | sed 's/^\.//' | sort)
}

# show_difference NOW THEN PATH: false where there is none.
show_difference() {
    if same_file "$1" "$2"; then return 1; fi
    if [ -L "$1" ]; then
        printf 'remove link %s\n' "$3"
    elif [ -L "$2" ]; then
        printf 'new link %s -> %s\n' "$3" "$(readlink "$2")"
    elif ! present "$1" && [[ $3 == "$installed"* ]]; then
        printf 'new file %s: copy of this script, %s lines\n' "$3" "$(wc -l <"$2")"
    elif ! present "$2" && [[ $3 == "$installed"* ]]; then
        printf 'remove file %s\n' "$3"
    else
        local now=$1 later=$2
        [ -e "$now" ] || now=/dev/null
        [ -e "$later" ] || later=/dev/null
        diff -u -L "$3 now" -L "$3 then" "$now" "$later" || true
        present "$2" || printf '(the file %s is removed)\n' "$3"
    fi
}

# ask WHAT: the user's yes; --yes says it in advance.
ask() {
    local answer=""
    [ -z "$yes" ] || return 0
    printf '\n%s [y/N] ' "$1"
    read -r answer || printf '\n'
    case $answer in
        y | Y | yes) return 0 ;;
    esac
    refuse "not confirmed: nothing was changed at boot. Answer y, or say --yes"
}

# Puts a copy in place at one instant: a reader sees the old file or the new one.
place() {
    make_folder "${2%/*}"
    # A boot partition (FAT) has no owners and modes to keep.
    cp -dp "$1" "$2.isocnc" 2>/dev/null || cp -d "$1" "$2.isocnc"
    mv "$2.isocnc" "$2"
}

# Folders that we make are noted, for undo to remove.
make_folder() {
    [ -d "$1" ] && return
    make_folder "${1%/*}"
    [[ $1 == "$library"* ]] || printf '%s\n' "${1#"$root"}" >>"$library/folders"
    mkdir "$1"
}

make_library() {
    local parent=${library%/*} new=""
    [ -d "$parent" ] || new=yes
    mkdir -p "$library"
    [ -z "$new" ] || printf '%s\n' "${parent#"$root"}" >>"$library/folders"
}

# change PATH: as planned.
change() {
    local file=$root$1
    if [ ! -L "$work/plan$1" ] && [ -e "$file" ]; then
        # Mode and owner stay what they are.
        cp -p "$file" "$work/new" && cat "$work/plan$1" >"$work/new" && mv "$work/new" "$work/plan$1"
    fi
    if ! ours "$1" || changed_by_others "$1"; then
        mkdir -p "$library/before${1%/*}" "$library/after${1%/*}"
        rm -f "$library/before$1"
        ! present "$file" || place "$file" "$library/before$1"
    else
        # Between two versions of ours the file is for a moment as we found it, so that undo knows it at every instant.
        restore "$1" >/dev/null
    fi
    place "$work/plan$1" "$library/after$1"
    place "$work/plan$1" "$file"
    printf 'written %s\n' "$1"
}

# restore PATH: as it was before us.
restore() {
    rm -f "$root$1.isocnc"
    if same_file "$root$1" "$library/before$1"; then return; fi
    if present "$library/before$1"; then
        place "$library/before$1" "$root$1"
        printf 'put back %s\n' "$1"
    else
        rm -f "$root$1"
        printf 'removed %s\n' "$1"
    fi
}

# refuse_foreign PATH...: unless forced.
refuse_foreign() {
    local path changed=""
    [ -z "$force" ] || return 0
    for path in "$@"; do
        if changed_by_others "$path"; then
            printf '%s was changed by somebody else after persist:\n' "$path"
            show_difference "$library/after$path" "$root$path" "$path" || true
            changed=yes
        fi
    done
    [ -z "$changed" ] || refuse "nothing was changed at boot, to keep what somebody else has written. --force overwrites it"
}

# Empties the library after undo, and removes the folders that persist has made.
forget_files() {
    local folder
    local -a folders=()
    [ ! -e "$library/folders" ] || mapfile -t folders < <(tac "$library/folders")
    rm -rf "$library"
    for folder in "${folders[@]}"; do
        rmdir "$root$folder" 2>/dev/null || true
    done
}
