//! A tree that looks like a PC's `/proc`, `/sys`, `/etc` and `/boot`, with the tools that the script calls.

use std::collections::BTreeMap;
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

/// Record of `apply`.
pub(crate) const STATE: &str = "run/isocnc-isolcpus.state";
/// Record of `persist`.
pub(crate) const LIBRARY: &str = "var/lib/isocnc/isolcpus";

/// What there is at one path.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Entry {
    Folder,
    Link(PathBuf),
    File { mode: u32, content: Vec<u8> },
}

pub(crate) struct Pc {
    root: tempfile::TempDir,
}

impl Pc {
    /// Four CPUs, no boot loader, no tool.
    pub(crate) fn new() -> Pc {
        let pc = Pc {
            root: tempfile::tempdir().unwrap(),
        };
        pc.write("proc/cmdline", "BOOT_IMAGE=/vmlinuz root=UUID=1 ro quiet skew_tick=1\n");
        pc.write("sys/devices/system/cpu/online", "0-3\n");
        pc.write("sys/devices/system/cpu/isolated", "\n");
        for folder in ["run", "etc/default", "var/lib", "usr/bin"] {
            fs::create_dir_all(pc.path(folder)).unwrap();
        }
        pc
    }

    pub(crate) fn path(&self, path: &str) -> PathBuf {
        self.root.path().join(path)
    }

    pub(crate) fn exists(&self, path: &str) -> bool {
        self.path(path).symlink_metadata().is_ok()
    }

    pub(crate) fn write(&self, path: &str, content: &str) {
        let path = self.path(path);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, content).unwrap();
    }

    pub(crate) fn read(&self, path: &str) -> String {
        fs::read_to_string(self.path(path)).unwrap_or_else(|error| panic!("{path}: {error}"))
    }

    pub(crate) fn remove(&self, path: &str) {
        fs::remove_file(self.path(path)).unwrap_or_else(|error| panic!("{path}: {error}"));
    }

    /// A tool of the fake PC: a shell script that finds its tree in `$ISOLCPUS_ROOT`.
    pub(crate) fn tool(&self, name: &str, script: &str) {
        let path = format!("usr/bin/{name}");
        self.write(
            &path,
            &format!("#!/bin/sh\ncd \"$ISOLCPUS_ROOT\" || exit 1\n{script}\n"),
        );
        fs::set_permissions(self.path(&path), fs::Permissions::from_mode(0o755)).unwrap();
    }

    /// Everything in the tree.
    pub(crate) fn tree(&self) -> BTreeMap<PathBuf, Entry> {
        fn visit(folder: &Path, tree: &mut BTreeMap<PathBuf, Entry>) {
            for entry in fs::read_dir(folder).unwrap() {
                let path = entry.unwrap().path();
                let metadata = path.symlink_metadata().unwrap();
                let found = if metadata.is_dir() {
                    visit(&path, tree);
                    Entry::Folder
                } else if metadata.is_symlink() {
                    Entry::Link(fs::read_link(&path).unwrap())
                } else {
                    Entry::File {
                        mode: metadata.permissions().mode(),
                        content: fs::read(&path).unwrap(),
                    }
                };
                tree.insert(path, found);
            }
        }
        let mut tree = BTreeMap::new();
        visit(self.root.path(), &mut tree);
        tree
    }

    pub(crate) fn run(&self, arguments: &[&str]) -> Output {
        Command::new("bash")
            .arg(script())
            .args(arguments)
            .arg("--root")
            .arg(self.root.path())
            .stdin(Stdio::null())
            .output()
            .expect("bash")
    }

    /// Runs a command that must succeed; its standard output.
    pub(crate) fn good(&self, arguments: &[&str]) -> String {
        let output = self.run(arguments);
        assert!(output.status.success(), "{arguments:?}: {output:?}");
        assert_eq!(text(&output.stderr), "", "{arguments:?}");
        text(&output.stdout)
    }

    /// Runs `status`; its exit code and standard output. It changes nothing.
    pub(crate) fn status(&self, arguments: &[&str]) -> (Option<i32>, String) {
        let before = self.tree();
        let output = self.run(&[&["status"], arguments].concat());
        assert_eq!(self.tree(), before, "status changed something");
        assert_eq!(text(&output.stderr), "", "{arguments:?}");
        (output.status.code(), text(&output.stdout))
    }

    /// Runs a command that must be refused without changing anything; exit code and standard error.
    pub(crate) fn bad(&self, arguments: &[&str]) -> (Option<i32>, String) {
        let before = self.tree();
        let output = self.run(arguments);
        assert_eq!(self.tree(), before, "{arguments:?} changed something");
        (output.status.code(), text(&output.stderr))
    }
}

pub(crate) fn script() -> &'static str {
    concat!(env!("CARGO_MANIFEST_DIR"), "/scripts/isolcpus.sh")
}

pub(crate) fn text(octets: &[u8]) -> String {
    String::from_utf8(octets.to_vec()).unwrap()
}
