//! Commands that several lines have in common. The same words for the same cure: the summary counts them as one.

use super::{Cpus, Pc};
use std::path::Path;

/// What can be had without a reboot: interrupts, kernel work, frequency, memory, the interface of the field bus.
pub(super) fn apply(pc: &Pc<'_>) -> String {
    let interface = super::nic::present(pc)
        .map(|name| format!(" --interface {name}"))
        .unwrap_or_default();
    format!("{} apply --cpus {}{interface}", isolcpus(pc), cpus(pc))
}

/// What the kernel takes from its command line only.
pub(super) fn persist(pc: &Pc<'_>) -> String {
    format!("{} persist --cpus {}, then reboot", isolcpus(pc), cpus(pc))
}

/// The script where it is; an installed program has it in itself.
fn isolcpus(pc: &Pc<'_>) -> String {
    match &pc.target.isolcpus {
        Some(script) => format!("sudo {}", word(script)),
        None => "isocnc doctor --write-isolcpus . && sudo ./isolcpus.sh".into(),
    }
}

/// A path as one word of a shell.
pub(super) fn word(path: &Path) -> String {
    let path = path.display().to_string();
    let plain = |character: char| character.is_alphanumeric() || "/._-+".contains(character);
    match !path.is_empty() && path.chars().all(plain) {
        true => path,
        false => format!("'{}'", path.replace('\'', "'\\''")),
    }
}

/// The core, and what shares its units, unless something else must run there.
fn cpus(pc: &Pc<'_>) -> Cpus {
    if super::core::can_isolate_siblings(pc) {
        super::core::with_siblings(pc)
    } else {
        Cpus::default().with(pc.cpu())
    }
}

/// Another word on the kernel command line.
pub(super) fn boot_with(word: &str) -> String {
    format!("add {word} to the kernel command line (GRUB: /etc/default/grub, then sudo update-grub), then reboot")
}

/// A setting of the running kernel; `/etc/sysctl.d` keeps it over a reboot.
pub(super) fn sysctl(setting: &str) -> String {
    format!("sudo sysctl {setting}")
}

/// A value for a file.
pub(super) fn write(value: &str, path: &str) -> String {
    format!("echo {value} | sudo tee {path}")
}

/// What only root may see.
pub(super) const AS_ROOT: &str = "run sudo isocnc doctor to see it";
