//! Controls that run on this PC beside this one: the core of their real-time threads.
//!
//! In:  `/proc`. Out: cores and processes.

use std::fs::{read_dir, read_to_string};
use std::path::Path;

/// What the cycle thread of a control is called.
pub const CYCLE_THREAD: &str = "rt-cycle";

/// A control that has put its cycle thread on one core for good.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct OtherControl {
    pub cpu: usize,
    /// Number of the process.
    pub process: u32,
}

/// All but the process of this number. `proc`: `/proc`. Of processes that are hidden nothing is known.
pub fn find(proc: &Path, but: u32) -> Vec<OtherControl> {
    let number = |name: std::ffi::OsString| name.to_str()?.parse::<u32>().ok();
    let processes = read_dir(proc).into_iter().flatten().flatten();
    let mut found: Vec<OtherControl> = processes
        .filter_map(|entry| number(entry.file_name()))
        .filter(|process| *process != but)
        .filter_map(|process| {
            let tasks = read_dir(proc.join(format!("{process}/task"))).ok()?;
            let is_cycle =
                |task: &Path| read_to_string(task.join("comm")).is_ok_and(|name| name.trim_end() == CYCLE_THREAD);
            let cycle = tasks.flatten().map(|task| task.path()).find(|task| is_cycle(task))?;
            let status = read_to_string(cycle.join("status")).ok()?;
            let cores = status
                .lines()
                .find_map(|line| line.strip_prefix("Cpus_allowed_list:"))?;
            // One that may run anywhere is in nobody's way for long.
            let cpu = cores.trim().parse().ok()?;
            Some(OtherControl { cpu, process })
        })
        .collect();
    found.sort_unstable();
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cycle_threads_that_are_bound_to_one_core_are_found() {
        let root = tempfile::tempdir().unwrap();
        let task = |process: u32, task: u32, name: &str, cores: &str| {
            let folder = root.path().join(format!("{process}/task/{task}"));
            std::fs::create_dir_all(&folder).unwrap();
            std::fs::write(folder.join("comm"), format!("{name}\n")).unwrap();
            let status = format!("Name:\t{name}\nCpus_allowed_list:\t{cores}\n");
            std::fs::write(folder.join("status"), status).unwrap();
        };
        task(20, 20, "isocnc", "0-2");
        task(20, 21, CYCLE_THREAD, "3");
        task(30, 31, CYCLE_THREAD, "0-3");
        task(40, 41, CYCLE_THREAD, "2");
        task(50, 51, CYCLE_THREAD, "3");
        std::fs::create_dir_all(root.path().join("self/task")).unwrap();
        let other = |cpu, process| OtherControl { cpu, process };
        assert_eq!(find(root.path(), 50), [other(2, 40), other(3, 20)]);
        assert_eq!(find(&root.path().join("nowhere"), 1), []);
    }
}
