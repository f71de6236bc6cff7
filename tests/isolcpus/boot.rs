//! `persist` and `undo` of it: the kernel command line in the configuration of each boot loader.

use super::pc::{LIBRARY, Pc};
use std::fs;
use std::os::unix::fs::PermissionsExt;

/// What is added for CPU 3 of 4, without `skew_tick=1`, which the fake PCs have already.
const ADDED: &str = "isolcpus=managed_irq,domain,3 nohz_full=3 rcu_nocbs=3 irqaffinity=0-2 nowatchdog nosoftlockup \
                     nmi_watchdog=0 transparent_hugepage=never";
const PERSIST: &[&str] = &["persist", "--cpus", "3", "--yes"];
const UNDO: &[&str] = &["undo", "--yes"];
const DROP_IN: &str = "etc/default/grub.d/zz-isocnc.cfg";
const ENTRY: &str = "boot/efi/loader/entries/1234-6.1.0.conf";
const STUB: &str = "etc/kernelstub/configuration";

/// Writes boot/grub/grub.cfg as the true one does from the same files.
const MKCONFIG: &str = r#"GRUB_CMDLINE_LINUX= GRUB_CMDLINE_LINUX_DEFAULT=
. ./etc/default/grub
for file in etc/default/grub.d/*.cfg; do [ "$DEBIAN" ] && [ -e "$file" ] && . "./$file"; done
mkdir -p boot/grub
echo "linux /vmlinuz ro $GRUB_CMDLINE_LINUX $GRUB_CMDLINE_LINUX_DEFAULT" >boot/grub/grub.cfg"#;

/// Debian or Ubuntu.
fn grub() -> Pc {
    let pc = Pc::new();
    pc.tool("update-grub", &format!("DEBIAN=yes\n{MKCONFIG}"));
    pc.write(
        "etc/default/grub",
        "GRUB_DEFAULT=0\n# GRUB_CMDLINE_LINUX=\"nohz_full=1\"\nGRUB_CMDLINE_LINUX_DEFAULT=\"quiet\"\nGRUB_CMDLINE_LINUX='skew_tick=1'\n",
    );
    pc.write("boot/grub/grub.cfg", "linux /vmlinuz ro skew_tick=1 quiet\n");
    pc
}

/// Arch, openSUSE: no folder for additions.
fn grub_of_others() -> Pc {
    let pc = grub();
    pc.remove("usr/bin/update-grub");
    pc.tool(
        "grub-mkconfig",
        &format!("[ \"$1\" = -o ] || exit 1\nDEBIAN=\n{MKCONFIG}"),
    );
    pc
}

/// Fedora.
fn grubby() -> Pc {
    let pc = Pc::new();
    pc.tool(
        "grubby",
        r#"case $* in
        --info=DEFAULT) printf 'index=0\nargs="%s"\n' "$(cat boot/args)" ;;
        "--update-kernel=ALL --args="*) for word in ${2#--args=}; do
            case " $(cat boot/args) " in *" $word "*) ;; *) echo "$(cat boot/args) $word" >boot/args ;; esac; done ;;
        "--update-kernel=ALL --remove-args="*) for word in ${2#--remove-args=}; do
            sed -i "s/ $word\( \|$\)/\1/" boot/args; done ;;
        *) exit 1 ;;
        esac"#,
    );
    pc.write("boot/args", "ro quiet skew_tick=1\n");
    pc
}

/// Debian with systemd-boot: one kernel, and an entry that starts no Linux.
fn systemd_boot() -> Pc {
    let pc = Pc::new();
    pc.tool("kernel-install", "exit 1");
    pc.write("etc/kernel/cmdline", "root=UUID=1 ro quiet skew_tick=1\n");
    pc.write(
        ENTRY,
        "title Debian\nlinux /1234/6.1.0/linux\noptions root=UUID=1 ro\noptions  quiet skew_tick=1  \ninitrd /1234/6.1.0/initrd",
    );
    pc.write("boot/efi/loader/entries/shell.conf", "title Shell\nefi /shell.efi\n");
    pc
}

/// Pop!_OS.
fn kernelstub() -> Pc {
    let pc = Pc::new();
    pc.tool(
        "kernelstub",
        r#"mkdir -p boot/efi/loader/entries
        echo "linux /vmlinuz.efi
options root=UUID=1 $(tr -d '\n' <etc/kernelstub/configuration | sed 's/.*"user"[^[]*\[\([^]]*\)\].*/\1/' | tr -d ' "' |
        sed 's/,\([a-z_]*=\|[a-z]*\(,\|$\)\)/ \1/g')" >boot/efi/loader/entries/Pop_OS-current.conf"#,
    );
    pc.write(
        STUB,
        r#"{
  "default": {
    "kernel_options": [
      "quiet",
      "splash"
    ],
    "config_rev": 4
  },
  "user": {
    "kernel_options": [
      "quiet",
      "skew_tick=1"
    ],
    "esp_path": "/boot/efi"
  }
}"#,
    );
    pc
}

/// Each boot loader: its name, the PC, the file in which the kernel's command line ends up.
fn loaders() -> [(&'static str, Pc, &'static str); 5] {
    [
        ("grub", grub(), "boot/grub/grub.cfg"),
        ("grub", grub_of_others(), "boot/grub/grub.cfg"),
        ("grubby", grubby(), "boot/args"),
        ("systemd-boot", systemd_boot(), ENTRY),
        ("kernelstub", kernelstub(), STUB),
    ]
}

fn has_words(text: &str, words: &str) -> bool {
    let found: Vec<&str> = text.split([' ', '\n', '"']).collect();
    words.split_whitespace().all(|word| found.contains(&word))
}

#[test]
fn persist_adds_the_words_and_undo_restores_the_whole_tree() {
    for (name, pc, file) in loaders() {
        // kernelstub makes its entry again from its configuration.
        if name == "kernelstub" {
            pc.write(
                "boot/efi/loader/entries/Pop_OS-current.conf",
                "linux /vmlinuz.efi\noptions root=UUID=1 quiet skew_tick=1\n",
            );
        }
        let before = pc.tree();
        assert!(!has_words(&pc.read(file), ADDED), "{name}");
        let said = pc.good(PERSIST);
        assert!(said.starts_with(&format!("boot loader {name} (")), "{name}: {said}");
        assert!(said.contains("takes effect with the next reboot"), "{name}: {said}");
        assert!(has_words(&pc.read(file), ADDED), "{name}: {}", pc.read(file));
        assert!(has_words(&pc.read(file), "quiet skew_tick=1"), "{name}");
        assert_eq!(pc.read(file).matches("skew_tick=1").count(), 1, "{name}");

        // A second time there is nothing to do.
        let once = pc.tree();
        let said = pc.good(PERSIST);
        assert!(said.contains("nothing to do"), "{name}: {said}");
        assert_eq!(pc.tree(), once, "{name}");

        let (_, said) = pc.status(&["--cpus", "3"]);
        assert_eq!(
            said.matches(": configured, a reboot sets it\n").count(),
            8,
            "{name}: {said}"
        );
        assert!(said.contains("persisted          yes"), "{name}: {said}");

        let said = pc.good(UNDO);
        assert!(said.contains("next boot: put back"), "{name}: {said}");
        assert_eq!(pc.tree(), before, "{name}");
        let said = pc.good(UNDO);
        assert!(said.contains("next boot: nothing to undo"), "{name}: {said}");
        assert_eq!(pc.tree(), before, "{name}");
    }
}

#[test]
fn nothing_is_written_without_a_yes_or_with_dry_run() {
    for (name, pc, _) in loaders() {
        let before = pc.tree();
        let said = pc.good(&["persist", "--cpus", "3", "--dry-run"]);
        assert!(said.ends_with("nothing was changed (--dry-run)\n"), "{name}: {said}");
        assert!(
            has_words(&said, "nohz_full=3") || said.contains("nohz_full=3"),
            "{name}: {said}"
        );
        assert_eq!(pc.tree(), before, "{name}");
        let (code, said) = pc.bad(&["persist", "--cpus", "3"]);
        assert_eq!(code, Some(1), "{name}");
        assert!(said.contains("not confirmed"), "{name}: {said}");

        pc.good(PERSIST);
        let persisted = pc.tree();
        pc.good(&["undo", "--dry-run"]);
        assert_eq!(pc.tree(), persisted, "{name}");
        let (code, said) = pc.bad(&["undo"]);
        assert_eq!(code, Some(1), "{name}");
        assert!(said.contains("not confirmed"), "{name}: {said}");
    }
}

#[test]
fn the_difference_is_shown_exactly() {
    let pc = grub();
    let said = pc.good(&["persist", "--cpus", "3", "--dry-run"]);
    let line = format!("+GRUB_CMDLINE_LINUX_DEFAULT=\"$GRUB_CMDLINE_LINUX_DEFAULT {ADDED}\"\n");
    assert!(said.contains("--- /etc/default/grub.d/zz-isocnc.cfg now\n"), "{said}");
    assert!(said.contains(&line), "{said}");
    assert!(said.contains("then run: update-grub\n"), "{said}");
    let pc = systemd_boot();
    let said = pc.good(&["persist", "--cpus", "3", "--dry-run"]);
    assert!(said.contains("\n-options  quiet skew_tick=1  \n"), "{said}");
    assert!(
        said.contains(&format!("\n+options  quiet skew_tick=1 {ADDED}\n")),
        "{said}"
    );
}

#[test]
fn other_cpus_replace_the_first_ones_and_undo_knows_the_original() {
    for (name, pc, file) in loaders() {
        if name == "kernelstub" {
            pc.write(
                "boot/efi/loader/entries/Pop_OS-current.conf",
                "linux /vmlinuz.efi\noptions root=UUID=1 quiet skew_tick=1\n",
            );
        }
        let before = pc.tree();
        pc.good(PERSIST);
        pc.good(&["persist", "--cpus", "2-3", "--yes", "--parameter", "tsc=reliable"]);
        let now = pc.read(file);
        assert!(
            has_words(&now, "nohz_full=2-3 irqaffinity=0-1 tsc=reliable"),
            "{name}: {now}"
        );
        assert!(!has_words(&now, "nohz_full=3"), "{name}: {now}");
        pc.good(UNDO);
        assert_eq!(pc.tree(), before, "{name}");
    }
}

#[test]
fn words_that_are_set_otherwise_are_refused() {
    for (name, pc, _) in loaders() {
        for path in ["etc/default/grub", "boot/args", "etc/kernel/cmdline", STUB] {
            if pc.exists(path) {
                let content = pc.read(path);
                pc.write(path, &content.replacen("skew_tick=1", "nohz_full=2", 1));
            }
        }
        let (code, said) = pc.bad(PERSIST);
        assert_eq!(code, Some(1), "{name}");
        assert!(
            said.contains(" has nohz_full=2, wanted nohz_full=3\n"),
            "{name}: {said}"
        );
        assert!(said.contains("Nothing was changed"), "{name}: {said}");
    }
}

#[test]
fn a_file_that_somebody_else_has_changed_is_kept_unless_forced() {
    for (pc, path) in [
        (grub(), DROP_IN),
        (grub_of_others(), "etc/default/grub"),
        (kernelstub(), STUB),
    ] {
        let original = pc.exists(path).then(|| pc.read(path));
        pc.good(PERSIST);
        let theirs = pc.read(path).replace("nosoftlockup", "audit=0");
        pc.write(path, &theirs);
        for command in [UNDO, PERSIST] {
            let output = pc.run(command);
            assert_eq!(output.status.code(), Some(1), "{path}");
            let said = super::pc::text(&output.stdout) + &super::pc::text(&output.stderr);
            assert!(
                said.contains(&format!("/{path} was changed by somebody else")),
                "{path}: {said}"
            );
            assert!(said.contains("--force"), "{path}: {said}");
            assert_eq!(pc.read(path), theirs);
        }
        pc.good(&["undo", "--yes", "--force"]);
        assert_eq!(pc.exists(path).then(|| pc.read(path)), original, "{path}");
        assert!(!pc.exists(LIBRARY));
    }
}

#[test]
fn entries_of_kernels_that_came_and_went_meanwhile() {
    let pc = systemd_boot();
    pc.write("boot/efi/loader/entries/old.conf", "linux /old\noptions ro\n");
    pc.good(PERSIST);
    let cmdline = pc.read("etc/kernel/cmdline");
    assert!(
        cmdline.starts_with("root=UUID=1 ro quiet skew_tick=1 isolcpus="),
        "{cmdline}"
    );
    // A kernel is removed, a new one takes the command line over, one entry is written again.
    pc.remove("boot/efi/loader/entries/old.conf");
    pc.write(
        "boot/efi/loader/entries/new.conf",
        &format!("linux /new\noptions {cmdline}"),
    );
    pc.write(
        ENTRY,
        &format!("title Debian 12\nlinux /1234/6.1.0/linux\noptions {cmdline}"),
    );
    let said = pc.good(UNDO);
    assert!(said.contains("gone    /boot/efi/loader/entries/old.conf\n"), "{said}");
    assert!(!pc.exists("boot/efi/loader/entries/old.conf"));
    assert_eq!(
        pc.read("boot/efi/loader/entries/new.conf"),
        "linux /new\noptions root=UUID=1 ro quiet skew_tick=1\n"
    );
    assert_eq!(
        pc.read(ENTRY),
        "title Debian 12\nlinux /1234/6.1.0/linux\noptions root=UUID=1 ro quiet skew_tick=1\n"
    );
    assert_eq!(pc.read("etc/kernel/cmdline"), "root=UUID=1 ro quiet skew_tick=1\n");
}

#[test]
fn without_etc_kernel_cmdline_the_running_one_is_taken_as_kernel_install_does() {
    let pc = systemd_boot();
    pc.remove("etc/kernel/cmdline");
    fs::remove_dir(pc.path("etc/kernel")).unwrap();
    let before = pc.tree();
    pc.good(PERSIST);
    assert_eq!(
        pc.read("etc/kernel/cmdline"),
        format!("root=UUID=1 ro quiet skew_tick=1 {ADDED}\n")
    );
    pc.good(UNDO);
    assert_eq!(pc.tree(), before);
}

#[test]
fn unified_kernel_images_are_made_anew() {
    let pc = systemd_boot();
    fs::remove_dir_all(pc.path("boot/efi/loader/entries")).unwrap();
    pc.write("boot/efi/EFI/Linux/6.1.0.efi", "");
    // UTF-16, as the firmware has it.
    pc.write(
        "sys/firmware/efi/efivars/LoaderInfo-4a67b082",
        "s\0y\0s\0t\0e\0m\0d\0-\0b\0o\0o\0t\0 \x002\x005\x002\0",
    );
    pc.write("usr/lib/modules/6.1.0/vmlinuz", "");
    pc.tool(
        "kernel-install",
        r#"[ "$1" = add ] && cp etc/kernel/cmdline "boot/efi/EFI/Linux/$2.efi""#,
    );
    let image = "boot/efi/EFI/Linux/6.1.0.efi";
    let said = pc.good(PERSIST);
    assert!(
        said.contains("boot loader systemd-boot (it has started this kernel)"),
        "{said}"
    );
    assert!(has_words(&pc.read(image), ADDED), "{}", pc.read(image));
    pc.good(UNDO);
    assert_eq!(pc.read(image), "root=UUID=1 ro quiet skew_tick=1\n");
}

#[test]
fn a_boot_loader_that_fails_is_said_and_persist_can_be_repeated_or_undone() {
    let pc = grub();
    let before = pc.tree();
    let update_grub = pc.read("usr/bin/update-grub");
    pc.write("usr/bin/update-grub", "#!/bin/sh\necho no space >&2; exit 7\n");
    let output = pc.run(PERSIST);
    assert_eq!(output.status.code(), Some(1));
    let said = super::pc::text(&output.stderr);
    assert!(said.contains("FAILED  update-grub: exit code 7\n"), "{said}");
    assert!(said.contains("repeat persist"), "{said}");
    assert_eq!(pc.run(UNDO).status.code(), Some(1));
    assert!(pc.exists(LIBRARY), "undo is not complete");

    pc.write("usr/bin/update-grub", &update_grub);
    pc.good(PERSIST);
    assert!(has_words(&pc.read("boot/grub/grub.cfg"), ADDED));
    pc.good(UNDO);
    assert_eq!(pc.tree(), before);
}

#[test]
fn mode_of_a_changed_file_stays() {
    let pc = grub_of_others();
    let file = pc.path("etc/default/grub");
    fs::set_permissions(&file, fs::Permissions::from_mode(0o600)).unwrap();
    let before = pc.tree();
    pc.good(PERSIST);
    assert_eq!(fs::metadata(&file).unwrap().permissions().mode() & 0o777, 0o600);
    pc.good(UNDO);
    assert_eq!(pc.tree(), before);
}

#[test]
fn what_is_not_understood_is_refused_with_the_words_to_add_by_hand() {
    // No boot loader.
    let (code, said) = Pc::new().bad(PERSIST);
    assert_eq!(code, Some(1));
    assert!(
        said.contains("no boot loader that we know") && said.contains(ADDED.split(' ').next().unwrap()),
        "{said}"
    );
    // Not JSON of kernelstub.
    let pc = kernelstub();
    for content in ["", "garbage\n", "{\"user\": {\"kernel_options\": [\"quiet\"]}}\n"] {
        pc.write(STUB, content);
        let (code, said) = pc.bad(PERSIST);
        assert_eq!(code, Some(1), "{content}");
        assert!(said.contains("is not understood") && said.contains("by hand"), "{said}");
    }
    // A record of somebody else.
    let pc = grub();
    pc.good(PERSIST);
    pc.write(&format!("{LIBRARY}/loader"), "lilo\n");
    for command in [UNDO, PERSIST] {
        let (code, said) = pc.bad(command);
        assert_eq!(code, Some(1));
        assert!(said.contains("is not understood"), "{said}");
    }
}

#[test]
fn irqbalance_is_told_to_leave_the_cpus_alone() {
    let pc = grub();
    let file = "etc/default/irqbalance";
    pc.write(
        file,
        "IRQBALANCE_ARGS=\n#IRQBALANCE_BANNED_CPULIST=\nIRQBALANCE_BANNED_CPULIST=1\n",
    );
    let before = pc.tree();
    pc.good(PERSIST);
    assert_eq!(
        pc.read(file),
        "IRQBALANCE_ARGS=\n#IRQBALANCE_BANNED_CPULIST=\nIRQBALANCE_BANNED_CPULIST=3\nIRQBALANCE_BANNED_CPUS=8\n"
    );
    pc.good(UNDO);
    assert_eq!(pc.tree(), before);
}

#[test]
fn reapply_installs_a_unit_with_a_copy_of_the_script_and_undo_removes_both() {
    let pc = grub();
    pc.tool("systemctl", r#"[ "$*" = daemon-reload ]"#);
    pc.write("sys/class/net/en-2/mtu", "1500\n");
    let before = pc.tree();
    pc.good(&[
        "persist",
        "--cpus",
        "3",
        "--yes",
        "--reapply",
        "--interface",
        "en-2",
        "--no-deep-idle",
    ]);
    let unit = pc.read("etc/systemd/system/isocnc-isolcpus.service");
    assert!(
        unit.contains("\nExecStart=/usr/local/lib/isocnc/isolcpus.sh apply --cpus 3 --nic-irq rt --no-deep-idle --interface en-2\n"),
        "{unit}"
    );
    assert!(
        unit.contains("\nWants=sys-subsystem-net-devices-en\\x2d2.device\n"),
        "{unit}"
    );
    let link = pc.path("etc/systemd/system/multi-user.target.wants/isocnc-isolcpus.service");
    assert_eq!(fs::read_to_string(link).unwrap(), unit);
    // The copy works.
    let output = std::process::Command::new(pc.path("usr/local/lib/isocnc/isolcpus.sh"))
        .arg("--help")
        .output()
        .unwrap();
    assert!(output.status.success(), "{output:?}");
    assert_eq!(
        pc.read("usr/local/lib/isocnc/isolcpus.sh"),
        fs::read_to_string(super::pc::script()).unwrap()
    );

    // The unit goes with the CPUs.
    let (code, said) = pc.bad(&["persist", "--cpus", "2-3", "--yes"]);
    assert_eq!(code, Some(1));
    assert!(said.contains("Repeat this with --reapply"), "{said}");
    let said = pc.good(PERSIST);
    assert!(said.contains("nothing to do"), "{said}");
    pc.good(UNDO);
    assert_eq!(pc.tree(), before);
}
