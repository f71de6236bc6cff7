//! What only trying it can tell.
//!
//! In:  the running PC. Out: whether it was given, or the system's reason. Nothing that is tried sticks: each try has a
//! thread or a process of its own.

use std::time::Duration;

/// What is really tried. The tests have a PC of their own.
pub trait Tries {
    /// Lets time go by.
    fn pause(&self, time: Duration);

    /// Resolution of CLOCK_MONOTONIC, ns.
    fn timer_resolution_ns(&self) -> Result<u64, String>;

    /// Name of the hypervisor as the processor gives it; empty if it has none to give; `None`: there is no hypervisor.
    fn hypervisor(&self) -> Option<String>;

    /// Contents of a compressed file.
    fn unzip(&self, path: &std::path::Path) -> Result<String, String>;
}

/// The PC that this runs on.
#[derive(Clone, Copy, Debug)]
pub struct ThisPc;

impl Tries for ThisPc {
    fn pause(&self, time: Duration) {
        std::thread::sleep(time);
    }

    fn timer_resolution_ns(&self) -> Result<u64, String> {
        let resolution =
            nix::time::clock_getres(nix::time::ClockId::CLOCK_MONOTONIC).map_err(|errno| errno.to_string())?;
        let ns = Duration::from(resolution).as_nanos();
        Ok(u64::try_from(ns).unwrap_or(u64::MAX))
    }

    #[cfg(target_arch = "x86_64")]
    fn hypervisor(&self) -> Option<String> {
        use std::arch::x86_64::__cpuid;
        /// Leaf 1, ECX: the bit that every hypervisor sets and no processor does.
        const PRESENT: u32 = 1 << 31;
        if __cpuid(1).ecx & PRESENT == 0 {
            return None;
        }
        let leaf = __cpuid(0x4000_0000);
        let name: Vec<u8> = [leaf.ebx, leaf.ecx, leaf.edx]
            .iter()
            .flat_map(|part| part.to_le_bytes())
            .collect();
        let printable = name
            .iter()
            .filter(|octet| octet.is_ascii_graphic())
            .map(|octet| char::from(*octet));
        Some(printable.collect())
    }

    #[cfg(not(target_arch = "x86_64"))]
    fn hypervisor(&self) -> Option<String> {
        None
    }

    fn unzip(&self, path: &std::path::Path) -> Result<String, String> {
        let output = std::process::Command::new("gzip").arg("-dc").arg(path).output();
        let output = output.map_err(|error| format!("gzip cannot be started ({error})"))?;
        if !output.status.success() {
            return Err(format!("gzip cannot read {}", path.display()));
        }
        Ok(String::from_utf8_lossy(&output.stdout).into_owned())
    }
}
