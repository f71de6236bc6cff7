//! The PC that is looked at.
//!
//! In:  a root folder (`/`, or a copy of some files in a test), what is really tried, which core and interface.
//! Out: contents of files, as text, numbers and lists of cores, or why there is none.

use super::Cpus;
use crate::doctor::experiments::Tries;
use std::fmt;
use std::fs::File;
use std::io::{self, ErrorKind, Read as _};
use std::os::unix::fs::FileExt as _;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// No file that is looked at is longer; what is behind it is not read.
const FILE_LEN_MAX: u64 = 4 << 20;
/// Cores that run.
pub(super) const ONLINE: &str = "/sys/devices/system/cpu/online";
/// Cores isolated at boot.
pub(super) const ISOLATED: &str = "/sys/devices/system/cpu/isolated";

/// What the control is to use.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Target {
    /// Core of the real-time threads.
    pub cpu: usize,
    /// Why this one.
    pub cpu_from: String,
    /// Priority of the thread that has the highest one.
    pub priority: u8,
    /// Interface of the field bus.
    pub interface: Option<String>,
    /// How long to measure, twice; `None`: not at all.
    pub test_time: Option<Duration>,
    /// The file of the running program.
    pub program: PathBuf,
    /// `isolcpus.sh`, where this PC has it.
    pub isolcpus: Option<PathBuf>,
}

/// Why a file tells nothing.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Unread {
    /// There is none: this kernel or PC does not have it.
    Absent(String),
    /// It cannot be read, or holds what was not expected.
    Refused(String),
}

impl fmt::Display for Unread {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Unread::Absent(path) => write!(f, "no {path}"),
            Unread::Refused(why) => f.write_str(why),
        }
    }
}

/// What grows by itself, at two times.
#[derive(Clone, Debug, Default)]
pub struct Activity {
    /// `/proc/stat`.
    pub stat: [String; 2],
    /// `/proc/interrupts`.
    pub interrupts: [String; 2],
    /// System management interrupts of the core since it was switched on.
    pub smi: Option<[Result<u64, Unread>; 2]>,
    /// What lies between, s.
    pub seconds: f64,
}

/// A PC. All paths are absolute ones, below the root folder.
pub struct Pc<'a> {
    root: PathBuf,
    /// What can only be told by trying it.
    pub tries: &'a dyn Tries,
    /// What the control is to use.
    pub target: Target,
    /// What has grown while the PC was watched.
    pub activity: Activity,
}

impl<'a> Pc<'a> {
    /// Watches the PC for some time.
    pub fn new(root: impl Into<PathBuf>, tries: &'a dyn Tries, target: Target, watch: Duration) -> Pc<'a> {
        let mut pc = Pc {
            root: root.into(),
            tries,
            target,
            activity: Activity::default(),
        };
        let snapshot = |path| pc.text(path).unwrap_or_default();
        let (stat, interrupts) = (snapshot("/proc/stat"), snapshot("/proc/interrupts"));
        let smi = pc.smi_count();
        tries.pause(watch);
        pc.activity = Activity {
            stat: [stat, snapshot("/proc/stat")],
            interrupts: [interrupts, snapshot("/proc/interrupts")],
            smi: Some([smi, pc.smi_count()]),
            seconds: watch.as_secs_f64(),
        };
        pc
    }

    /// Processor, number of cores, kernel.
    pub fn describe(&self) -> String {
        let cpuinfo = self.text("/proc/cpuinfo").unwrap_or_default();
        let model = cpuinfo.lines().find(|line| line.starts_with("model name"));
        let model = model
            .and_then(|line| line.split_once(':'))
            .map_or("unknown processor", |(_, model)| model.trim());
        let cores = match self.cpu_list(ONLINE) {
            Ok(online) => format!("{} cores", online.len()),
            Err(_) => "unknown cores".to_owned(),
        };
        let release = self.text("/proc/sys/kernel/osrelease").unwrap_or_default();
        format!("{}, {cores}, Linux {}", model.escape_debug(), release.escape_debug())
    }

    /// The core of the real-time threads.
    pub fn cpu(&self) -> usize {
        self.target.cpu
    }

    /// Contents of a file, without white space around them. Octets that are no text become replacement characters.
    pub fn text(&self, path: &str) -> Result<String, Unread> {
        let mut octets = Vec::new();
        File::open(self.at(path))
            .and_then(|file| file.take(FILE_LEN_MAX).read_to_end(&mut octets))
            .map_err(|error| unread(path, &error))?;
        Ok(String::from_utf8_lossy(&octets).trim().to_owned())
    }

    /// System management interrupts of the core: MSR_SMI_COUNT of Intel's processors, through the driver `msr`.
    fn smi_count(&self) -> Result<u64, Unread> {
        /// The address of the register, which is the offset in the file.
        const MSR_SMI_COUNT: u64 = 0x34;
        let path = format!("/dev/cpu/{}/msr", self.cpu());
        let mut value = [0; 8];
        File::open(self.at(&path))
            .and_then(|file| file.read_exact_at(&mut value, MSR_SMI_COUNT))
            .map_err(|error| unread(&path, &error))?;
        Ok(u64::from_le_bytes(value))
    }

    /// A file's only word.
    pub fn word(&self, path: &str) -> Result<String, Unread> {
        let text = self.text(path)?;
        let is_word = !text.is_empty() && text.chars().all(|c| c.is_ascii_graphic());
        is_word
            .then(|| text.clone())
            .ok_or_else(|| unexpected(path, &text, "a word"))
    }

    /// A whole number.
    pub fn number(&self, path: &str) -> Result<i64, Unread> {
        let text = self.text(path)?;
        text.parse().map_err(|_| unexpected(path, &text, "a number"))
    }

    /// A list of cores.
    pub fn cpu_list(&self, path: &str) -> Result<Cpus, Unread> {
        let text = self.text(path)?;
        Cpus::parse_list(&text).ok_or_else(|| unexpected(path, &text, "a list of cores"))
    }

    /// A mask of cores.
    pub fn cpu_mask(&self, path: &str) -> Result<Cpus, Unread> {
        let text = self.text(path)?;
        Cpus::parse_mask(&text).ok_or_else(|| unexpected(path, &text, "a mask of cores"))
    }

    /// The one of several words that stands in brackets of a kind: `always [madvise] never`.
    pub fn chosen(&self, path: &str, open: char, close: char) -> Result<String, Unread> {
        let text = self.text(path)?;
        let chosen = text.split_once(open).and_then(|(_, rest)| rest.split_once(close));
        chosen
            .map(|(word, _)| word.to_owned())
            .filter(|word| !word.is_empty() && word.chars().all(|c| c.is_ascii_graphic()))
            .ok_or_else(|| unexpected(path, &text, "a choice of words"))
    }

    /// Names in a folder, sorted as numbers where they are numbers.
    pub fn names(&self, path: &str) -> Result<Vec<String>, Unread> {
        let entries = std::fs::read_dir(self.at(path)).map_err(|error| unread(path, &error))?;
        let mut names: Vec<String> = entries
            .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
            .collect();
        names.sort_by_key(|name| (name.parse::<u64>().unwrap_or(u64::MAX), name.clone()));
        Ok(names)
    }

    /// Whether there is such a file or folder.
    pub fn exists(&self, path: &str) -> bool {
        self.at(path).exists()
    }

    /// Whether there is the folder of a file, or of that folder.
    pub fn has_folder_of(&self, path: &str) -> bool {
        Path::new(path).ancestors().skip(1).take(2).any(|folder| {
            // The root tells nothing.
            folder.components().count() > 2 && self.at(&folder.to_string_lossy()).is_dir()
        })
    }

    /// All processes, kernel threads among them: number and name.
    pub fn processes(&self) -> Result<Vec<(String, String)>, Unread> {
        let pids = self
            .names("/proc")?
            .into_iter()
            .filter(|name| name.parse::<u32>().is_ok());
        let comm = |pid: String| Some((pid.clone(), self.text(&format!("/proc/{pid}/comm")).ok()?));
        let all: Vec<(String, String)> = pids.filter_map(comm).collect();
        // The parent of all kernel threads is seen by who sees all.
        match all.iter().any(|(_, comm)| comm == "kthreadd") {
            true => Ok(all),
            false => Err(Unread::Refused(
                "the processes of the PC are hidden (container, or hidepid)".into(),
            )),
        }
    }

    /// Number of the process of that name.
    pub fn process(&self, name: &str) -> Result<Option<String>, Unread> {
        Ok(self
            .processes()?
            .into_iter()
            .find(|(_, comm)| comm == name)
            .map(|(pid, _)| pid))
    }

    /// Whether rights of this process do not count outside of a user namespace.
    pub fn is_user_namespace(&self) -> bool {
        let initial = ["0", "0", "4294967295"];
        self.text("/proc/self/uid_map")
            .is_ok_and(|map| !map.split_whitespace().eq(initial))
    }

    /// A number of `/proc/PID/stat`, counted as in proc(5), from the third on; `None`: it is not told.
    pub fn process_field(&self, pid: &str, field: usize) -> Option<u64> {
        let stat = self.text(&format!("/proc/{pid}/stat")).ok()?;
        // The second field is a name in brackets, which may hold anything.
        let rest = stat.rsplit_once(')')?.1;
        rest.split_whitespace().nth(field.checked_sub(3)?)?.parse().ok()
    }

    /// Where a symbolic link points to: the last part of it.
    pub fn link_name(&self, path: &str) -> Option<String> {
        let target = std::fs::read_link(self.at(path)).ok()?;
        target.file_name()?.to_str().map(str::to_owned)
    }

    /// Words of the kernel command line.
    pub fn boot_words(&self) -> Result<Vec<String>, Unread> {
        Ok(self
            .text("/proc/cmdline")?
            .split_whitespace()
            .map(str::to_owned)
            .collect())
    }

    /// Value of the last `name=value` on the kernel command line.
    pub fn boot_value(&self, name: &str) -> Result<Option<String>, Unread> {
        let words = self.boot_words()?;
        let value = |word: &String| Some(word.strip_prefix(name)?.strip_prefix('=')?.to_owned());
        Ok(words.iter().rev().find_map(value))
    }

    /// A path below the root folder.
    pub fn at(&self, path: &str) -> PathBuf {
        self.root.join(path.trim_start_matches('/'))
    }
}

fn unread(path: &str, error: &io::Error) -> Unread {
    match error.kind() {
        ErrorKind::NotFound | ErrorKind::NotADirectory => Unread::Absent(path.to_owned()),
        // Root gets this where the kernel is locked down.
        _ if error.raw_os_error() == Some(libc::EPERM) => Unread::Refused("closed by the kernel (lockdown)".into()),
        ErrorKind::PermissionDenied => Unread::Refused("for root only".into()),
        _ => Unread::Refused(format!("{path} cannot be read ({error})")),
    }
}

fn unexpected(path: &str, text: &str, wanted: &str) -> Unread {
    let start: String = text.escape_default().take(20).collect();
    Unread::Refused(format!("{path} holds \"{start}\", not {wanted}"))
}
