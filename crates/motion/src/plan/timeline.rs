//! Which thread planned what, and when.
//!
//! In:  beginnings and ends of work, told by the threads themselves.
//! Out: for every thread the time for each task in all, its share in equal parts of the whole time, and the first pieces of work
//! one by one. Memory does not grow with the program: where time does, its parts get longer.
//!
//! Not real time; allocates. Where nothing is recorded, it costs a test.

use std::cell::Cell;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{ThreadId, current};
use std::time::Instant;

/// What a thread can be at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Task {
    /// Text to calls, cutter compensation included.
    Interpret,
    /// Calls to a smoothed path.
    Smooth,
    /// The smoothed path to publications, but for what are jobs.
    Slope,
    /// Speeds of a part of the path: a job of the pool.
    LookAhead,
}

impl Task {
    /// All of them, in the order of the path.
    pub const ALL: [Task; 4] = [Task::Interpret, Task::Smooth, Task::Slope, Task::LookAhead];
}

/// Number of tasks.
pub const TASKS: usize = Task::ALL.len();
/// Parts of the whole time.
const PARTS: usize = 1024;
/// Their length at first, ns.
const PART_NS: u64 = 1 << 14;
/// Pieces of work of a thread that are kept one by one.
const PIECES: usize = 2048;

/// A piece of work.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Worked {
    /// What it was.
    pub task: Task,
    /// Since the timeline began, ns.
    pub begin_ns: u64,
    /// The same.
    pub end_ns: u64,
}

/// What one thread has done.
#[derive(Clone, Debug)]
pub struct Lane {
    thread: ThreadId,
    /// Its name.
    pub name: String,
    /// Time for each task, ns.
    pub total_ns: [u64; TASKS],
    /// The same in each part of the whole time; those behind the last are 0.
    pub parts: Vec<[u64; TASKS]>,
    /// Its first pieces of work.
    pub first: Vec<Worked>,
}

/// What all threads have done.
#[derive(Clone, Debug)]
pub struct Record {
    /// In the order in which they began.
    pub lanes: Vec<Lane>,
    /// Length of a part of the whole time, ns.
    pub part_ns: u64,
}

impl Record {
    fn add(&mut self, thread: ThreadId, worked: Worked) {
        while worked.end_ns >= self.part_ns * PARTS as u64 {
            self.part_ns *= 2;
            for lane in &mut self.lanes {
                lane.halve();
            }
        }
        let lane = match self.lanes.iter().position(|lane| lane.thread == thread) {
            Some(lane) => lane,
            None => {
                self.lanes.push(Lane {
                    thread,
                    name: current().name().unwrap_or_default().to_owned(),
                    total_ns: [0; TASKS],
                    parts: Vec::new(),
                    first: Vec::new(),
                });
                self.lanes.len() - 1
            }
        };
        self.lanes[lane].add(worked, self.part_ns);
    }

    /// End of the last piece of work, as far as parts tell, ns.
    pub fn end_ns(&self) -> u64 {
        let parts = self.lanes.iter().map(|lane| lane.parts.len()).max();
        parts.unwrap_or(0) as u64 * self.part_ns
    }
}

impl Lane {
    fn add(&mut self, worked: Worked, part_ns: u64) {
        let Worked { task, begin_ns, end_ns } = worked;
        let task = task as usize;
        self.total_ns[task] += end_ns - begin_ns;
        let last = (end_ns / part_ns) as usize;
        if self.parts.len() <= last {
            self.parts.resize(last + 1, [0; TASKS]);
        }
        for part in (begin_ns / part_ns) as usize..=last {
            let (from, to) = (part as u64 * part_ns, (part as u64 + 1) * part_ns);
            self.parts[part][task] += end_ns.min(to) - begin_ns.max(from);
        }
        if self.first.len() < PIECES {
            self.first.push(worked);
        }
    }

    /// Two parts become one.
    fn halve(&mut self) {
        let pairs = self.parts.chunks(2);
        self.parts = pairs
            .map(|pair| std::array::from_fn(|task| pair.iter().map(|part| part[task]).sum()))
            .collect();
    }
}

/// A recording that all threads write to; clones share it.
#[derive(Clone, Debug)]
pub struct Timeline {
    began: Instant,
    record: Arc<Mutex<Record>>,
}

/// Does `work` and records it, if there is a recording: as a task, or as a wait. What the thread was at before goes on behind it.
pub fn during<T>(timeline: Option<&Timeline>, task: Option<Task>, work: impl FnOnce() -> T) -> T {
    match timeline {
        None => work(),
        Some(timeline) => timeline.during(task, work),
    }
}

thread_local! {
    /// What this thread is at, and since when, ns; `None`: it waits.
    static AT: Cell<Option<(Task, u64)>> = const { Cell::new(None) };
}

impl Default for Timeline {
    fn default() -> Timeline {
        Timeline {
            began: Instant::now(),
            record: Arc::new(Mutex::new(Record {
                lanes: Vec::new(),
                part_ns: PART_NS,
            })),
        }
    }
}

impl Timeline {
    /// What has been recorded so far.
    pub fn record(&self) -> Record {
        self.lock().clone()
    }

    fn lock(&self) -> MutexGuard<'_, Record> {
        self.record.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Does what is `task`, or waits if it is none. What the thread was at before goes on behind it.
    fn during<T>(&self, task: Option<Task>, work: impl FnOnce() -> T) -> T {
        let before = self.turn_to(task);
        let result = work();
        self.turn_to(before);
        result
    }

    /// Ends what the thread is at, begins `task`; gives what it was at.
    fn turn_to(&self, task: Option<Task>) -> Option<Task> {
        let now_ns = self.began.elapsed().as_nanos() as u64;
        let (task_before, begin_ns) = AT.replace(task.map(|task| (task, now_ns)))?;
        if now_ns > begin_ns {
            let end_ns = now_ns;
            self.lock().add(
                current().id(),
                Worked {
                    task: task_before,
                    begin_ns,
                    end_ns,
                },
            );
        }
        Some(task_before)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn worked(task: Task, begin_ns: u64, end_ns: u64) -> Worked {
        Worked { task, begin_ns, end_ns }
    }

    fn empty() -> Record {
        Record {
            lanes: Vec::new(),
            part_ns: PART_NS,
        }
    }

    proptest! {
        /// Whatever the times, nothing is lost and memory is bounded.
        #[test]
        fn parts_add_up_to_the_whole(steps in prop::collection::vec((0u64..40_000_000_000, 0u64..5_000_000_000, 0usize..4), 1..60)) {
            let mut record = empty();
            let (mut now, mut total) = (0, [0; TASKS]);
            for (waited, took, task) in steps {
                let begin = now + waited;
                now = begin + took;
                total[task] += took;
                record.add(current().id(), worked(Task::ALL[task], begin, now));
            }
            let lane = &record.lanes[0];
            prop_assert_eq!(record.lanes.len(), 1);
            prop_assert_eq!(lane.total_ns, total);
            prop_assert!(lane.parts.len() <= PARTS && record.end_ns() >= now);
            for task in 0..TASKS {
                prop_assert_eq!(lane.parts.iter().map(|part| part[task]).sum::<u64>(), total[task]);
            }
            for part in &lane.parts {
                prop_assert!(part.iter().sum::<u64>() <= record.part_ns);
            }
        }
    }

    #[test]
    fn work_within_work_is_no_part_of_it_and_a_wait_is_none_at_all() {
        let timeline = Timeline::default();
        let pause = || std::thread::sleep(std::time::Duration::from_millis(2));
        timeline.during(Some(Task::Slope), || {
            pause();
            timeline.during(None, pause);
            pause();
            timeline.during(Some(Task::LookAhead), pause);
            pause();
        });
        pause();
        let record = timeline.record();
        let first = &record.lanes[0].first;
        let tasks: Vec<Task> = first.iter().map(|worked| worked.task).collect();
        assert_eq!(tasks, [Task::Slope, Task::Slope, Task::LookAhead, Task::Slope]);
        assert!(first[0].end_ns < first[1].begin_ns, "the wait lies between them");
        assert_eq!(
            (first[1].end_ns, first[2].end_ns),
            (first[2].begin_ns, first[3].begin_ns)
        );
        assert_eq!(record.lanes[0].name, current().name().unwrap_or_default());
    }

    #[test]
    fn no_more_pieces_are_kept_than_memory_is_for() {
        let mut record = empty();
        for k in 0..10 * PIECES as u64 {
            record.add(current().id(), worked(Task::Smooth, 10 * k, 10 * k + 5));
        }
        assert_eq!(record.lanes[0].first.len(), PIECES);
        assert_eq!(record.lanes[0].total_ns, [0, 50 * PIECES as u64, 0, 0]);
    }
}
