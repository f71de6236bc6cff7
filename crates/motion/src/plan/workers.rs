//! Threads for pure computation.
//!
//! In:  jobs that depend on nothing but what they own.
//! Out: their results by number, never by time of completion, so that no plan depends on how many threads there are.
//!
//! [`Workers::run`] is for many small jobs that are known at once, [`Ordered`] for larger ones that come one after the
//! other; a [`queue`] joins two stages of which each has a thread of its own. Who waits for a result, or at a queue, does waiting
//! jobs meanwhile; no thread spins. Threads inherit affinity and rights of the
//! thread that starts them, and a hook can change both: they must keep off the core of real time.
//!
//! Not real time; allocates.

use super::timeline::{Task, Timeline, during};
use std::any::Any;
use std::collections::VecDeque;
use std::fmt;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::{Builder, JoinHandle, current};

/// A job failed by a defect in it: it panicked.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct JobPanicked {
    /// Number of the job.
    pub number: u64,
    /// What it said.
    pub message: String,
}

impl fmt::Display for JobPanicked {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "planning job {} panicked: {}", self.number, self.message)
    }
}

impl std::error::Error for JobPanicked {}

type Job = Box<dyn FnOnce() + Send>;

#[derive(Default)]
struct Waiting {
    jobs: VecDeque<Job>,
    closed: bool,
}

#[derive(Default)]
struct Shared {
    waiting: Mutex<Waiting>,
    changed: Condvar,
    timeline: Option<Timeline>,
}

impl Shared {
    /// No job runs under the lock, so that it is never left in a state that makes no sense.
    fn lock(&self) -> MutexGuard<'_, Waiting> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn add(&self, jobs: impl Iterator<Item = Job>) {
        let mut waiting = self.lock();
        for job in jobs {
            waiting.jobs.push_back(job);
            self.changed.notify_one();
        }
    }

    /// Gives what `ready` gives once it gives something, and does jobs until then. Who makes it ready calls `wake` behind.
    fn wait_until<T>(&self, mut ready: impl FnMut() -> Option<T>) -> T {
        let mut waiting = self.lock();
        loop {
            if let Some(result) = ready() {
                if !waiting.jobs.is_empty() {
                    // This thread may have been woken for a job that it leaves to another one.
                    self.changed.notify_one();
                }
                return result;
            }
            if let Some(job) = waiting.jobs.pop_front() {
                drop(waiting);
                job();
                waiting = self.lock();
            } else {
                let wait = || self.changed.wait(waiting).unwrap_or_else(PoisonError::into_inner);
                waiting = during(self.timeline.as_ref(), None, wait);
            }
        }
    }

    /// Has everybody who waits look again.
    fn wake(&self) {
        // Who is about to wait has seen what was before, and waits by the time that the lock is free.
        drop(self.lock());
        self.changed.notify_all();
    }

    /// A job that no thread has begun.
    fn next_job(&self) -> Option<Job> {
        self.lock().jobs.pop_front()
    }

    /// Does jobs until the pool is closed and nothing is left.
    fn work(&self) {
        let mut waiting = self.lock();
        loop {
            if let Some(job) = waiting.jobs.pop_front() {
                drop(waiting);
                job();
                waiting = self.lock();
            } else if waiting.closed {
                return;
            } else {
                waiting = self.changed.wait(waiting).unwrap_or_else(PoisonError::into_inner);
            }
        }
    }
}

struct Pool {
    shared: Arc<Shared>,
    threads: Vec<JoinHandle<()>>,
    /// Threads of others, which do jobs while they wait.
    helpers: usize,
}

impl Drop for Pool {
    fn drop(&mut self) {
        self.shared.lock().closed = true;
        self.shared.changed.notify_all();
        for thread in self.threads.drain(..) {
            // The last handle may belong to a job, and no thread can wait for itself.
            if thread.thread().id() != current().id() {
                // Panics of jobs are caught; that of a hook has ended its thread only.
                let _ = thread.join();
            }
        }
    }
}

/// Stack of a thread, octets: in a control all of it is locked in memory. Jobs have their large data on the heap.
const STACK_SIZE: usize = 512 * 1024;

/// A pool of threads; clones share it, and the last one ends it after all jobs that were handed in.
#[derive(Clone)]
pub struct Workers(Arc<Pool>);

impl Workers {
    /// Starts `threads` threads beside the caller's; with none, all is done by the caller. Each calls `start` first. Where
    /// the system refuses threads, there are fewer: see [`Workers::threads`].
    pub fn new(threads: usize, start: impl Fn() + Send + Sync + 'static) -> Workers {
        Workers::with_helpers(threads, 0, None, start)
    }

    /// The same where so many further threads do jobs as well: while they wait at a [`queue`]. Jobs and waits are recorded, if there
    /// is a recording.
    pub fn with_helpers(
        threads: usize,
        helpers: usize,
        timeline: Option<Timeline>,
        start: impl Fn() + Send + Sync + 'static,
    ) -> Workers {
        let shared = Arc::new(Shared {
            timeline,
            ..Shared::default()
        });
        let start = Arc::new(start);
        let spawn = |number: usize| {
            let (shared, start) = (Arc::clone(&shared), Arc::clone(&start));
            let thread = Builder::new().name(format!("planner {number}")).stack_size(STACK_SIZE);
            thread.spawn(move || {
                start();
                shared.work();
            })
        };
        let threads = (1..=threads).map_while(|number| spawn(number).ok()).collect();
        Workers(Arc::new(Pool {
            shared,
            threads,
            helpers,
        }))
    }

    /// No threads: the caller does everything.
    pub fn none() -> Workers {
        Workers::new(0, || ())
    }

    /// Threads beside the caller's.
    pub fn threads(&self) -> usize {
        self.0.threads.len() + self.0.helpers
    }

    /// What jobs and waits are recorded to.
    pub fn timeline(&self) -> Option<&Timeline> {
        self.0.shared.timeline.as_ref()
    }

    /// Does the jobs with the numbers below `count`, the caller as well as all threads, and returns what they give, in the
    /// order of their numbers.
    ///
    /// # Errors
    /// The first of them (by number) that panicked; the others have been done.
    pub fn run<Out: Send + 'static>(
        &self,
        count: usize,
        job: impl Fn(usize) -> Out + Send + Sync + 'static,
    ) -> Result<Vec<Out>, JobPanicked> {
        let helpers = self.threads().min(count.saturating_sub(1));
        if helpers == 0 {
            return (0..count)
                .map(|number| guarded(self.timeline(), number as u64, || job(number)))
                .collect();
        }
        let (job, next) = (Arc::new(job), Arc::new(AtomicUsize::new(0)));
        let (sender, receiver) = channel();
        let part = |sender: Sender<Vec<(usize, Result<Out, JobPanicked>)>>| {
            let (job, next, timeline) = (Arc::clone(&job), Arc::clone(&next), self.timeline().cloned());
            move || {
                let mut done = Vec::new();
                loop {
                    let number = next.fetch_add(1, Ordering::Relaxed);
                    if number >= count {
                        break;
                    }
                    done.push((number, guarded(timeline.as_ref(), number as u64, || job(number))));
                }
                // The caller waits for the numbers, and may be gone before a helper that came too late for any.
                let _ = sender.send(done);
            }
        };
        self.0
            .shared
            .add((0..helpers).map(|_| Box::new(part(sender.clone())) as Job));
        part(sender)();
        let mut results: Vec<Option<Result<Out, JobPanicked>>> = Vec::new();
        results.resize_with(count, || None);
        let mut left = count;
        while left > 0 {
            let Ok(done) = during(self.timeline(), None, || receiver.recv()) else {
                break;
            };
            left -= done.len();
            for (number, result) in done {
                results[number] = Some(result);
            }
        }
        let lost = |number: usize| JobPanicked {
            number: number as u64,
            message: "its thread ended".to_owned(),
        };
        let results = results.into_iter().enumerate();
        results
            .map(|(number, result)| result.unwrap_or_else(|| Err(lost(number))))
            .collect()
    }
}

impl fmt::Debug for Workers {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Workers").field("threads", &self.threads()).finish()
    }
}

/// What two threads have in common of a queue.
struct Line<T> {
    items: Mutex<Items<T>>,
    workers: Workers,
}

struct Items<T> {
    waiting: VecDeque<T>,
    room: usize,
    /// One of the ends is gone.
    closed: bool,
}

impl<T> Line<T> {
    fn lock(&self) -> MutexGuard<'_, Items<T>> {
        self.items.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Tells the other end.
    fn wake(&self) {
        self.workers.0.shared.wake();
    }

    fn close(&self) {
        self.lock().closed = true;
        self.wake();
    }
}

/// A queue between two threads with room for `room` items, at least one. Who waits at either end does jobs of the pool meanwhile.
pub fn queue<T>(room: usize, workers: &Workers) -> (QueueIn<T>, QueueOut<T>) {
    let line = Arc::new(Line {
        items: Mutex::new(Items {
            waiting: VecDeque::with_capacity(room),
            room: room.max(1),
            closed: false,
        }),
        workers: workers.clone(),
    });
    (QueueIn(Arc::clone(&line)), QueueOut(line))
}

/// Where items are put into a [`queue`]. Dropping it ends the queue behind them.
pub struct QueueIn<T>(Arc<Line<T>>);

impl<T> QueueIn<T> {
    /// Waits for room. `false`: nobody takes items any more.
    pub fn put(&self, item: T) -> bool {
        let mut item = Some(item);
        let put = self.0.workers.0.shared.wait_until(|| {
            let mut items = self.0.lock();
            if items.closed {
                return Some(false);
            }
            if items.waiting.len() >= items.room {
                return None;
            }
            items.waiting.extend(item.take());
            Some(true)
        });
        if put {
            self.0.wake();
        }
        put
    }

    /// Does jobs until nobody takes items any more.
    pub fn help(&self) {
        let is_closed = || self.0.lock().closed.then_some(());
        self.0.workers.0.shared.wait_until(is_closed);
    }
}

impl<T> Drop for QueueIn<T> {
    fn drop(&mut self) {
        self.0.close();
    }
}

/// Where items are taken out of a [`queue`]. Dropping it ends the queue, and what is in it is gone.
pub struct QueueOut<T>(Arc<Line<T>>);

impl<T> QueueOut<T> {
    /// Waits for the next item. `None`: none comes any more.
    pub fn take(&self) -> Option<T> {
        let taken = self.0.workers.0.shared.wait_until(|| {
            let mut items = self.0.lock();
            match items.waiting.pop_front() {
                Some(item) => Some(Some(item)),
                None => items.closed.then_some(None),
            }
        });
        if taken.is_some() {
            self.0.wake();
        }
        taken
    }
}

impl<T> Drop for QueueOut<T> {
    fn drop(&mut self) {
        self.0.close();
        self.0.lock().waiting.clear();
    }
}

/// Jobs one after the other, whose results come back in the order in which they were handed in.
pub struct Ordered<Out> {
    workers: Workers,
    sender: Sender<(u64, Result<Out, JobPanicked>)>,
    receiver: Receiver<(u64, Result<Out, JobPanicked>)>,
    /// Number of the result that comes out next.
    next: u64,
    /// Results from that number on.
    results: VecDeque<Option<Result<Out, JobPanicked>>>,
}

impl<Out: Send + 'static> Ordered<Out> {
    /// Nothing handed in yet.
    pub fn new(workers: &Workers) -> Ordered<Out> {
        let (sender, receiver) = channel();
        Ordered {
            workers: workers.clone(),
            sender,
            receiver,
            next: 0,
            results: VecDeque::new(),
        }
    }

    /// Hands in a job and returns its number, counted from 0. Without threads it is done at once.
    pub fn push(&mut self, job: impl FnOnce() -> Out + Send + 'static) -> u64 {
        let number = self.next + self.results.len() as u64;
        if self.workers.threads() == 0 {
            let result = guarded(self.workers.timeline(), number, job);
            self.results.push_back(Some(result));
            return number;
        }
        self.results.push_back(None);
        let (sender, timeline) = (self.sender.clone(), self.workers.timeline().cloned());
        let job: Job = Box::new(move || {
            // Whoever handed it in may no longer want it.
            let _ = sender.send((number, guarded(timeline.as_ref(), number, job)));
        });
        self.workers.0.shared.add(std::iter::once(job));
        number
    }

    /// Jobs handed in whose results have not been taken.
    pub fn under_way(&self) -> usize {
        self.results.len()
    }

    /// The next result if it is there already. Whether it is depends on time: no plan may depend on that.
    pub fn try_next(&mut self) -> Option<Result<Out, JobPanicked>> {
        while let Ok(result) = self.receiver.try_recv() {
            self.place(result);
        }
        self.results.front()?.as_ref()?;
        self.take_first()
    }

    /// The next result; `None` if nothing is under way. Waits for it, and does waiting jobs meanwhile.
    pub fn wait_next(&mut self) -> Option<Result<Out, JobPanicked>> {
        while self.results.front()?.is_none() {
            if let Ok(result) = self.receiver.try_recv() {
                self.place(result);
            } else if let Some(job) = self.workers.0.shared.next_job() {
                job();
            } else if let Ok(result) = during(self.workers.timeline(), None, || self.receiver.recv()) {
                self.place(result);
            }
        }
        self.take_first()
    }

    fn place(&mut self, (number, result): (u64, Result<Out, JobPanicked>)) {
        self.results[(number - self.next) as usize] = Some(result);
    }

    fn take_first(&mut self) -> Option<Result<Out, JobPanicked>> {
        let first = self.results.pop_front()?;
        self.next += 1;
        first
    }
}

impl<Out> fmt::Debug for Ordered<Out> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Ordered")
            .field("next", &self.next)
            .field("under_way", &self.results.len())
            .finish_non_exhaustive()
    }
}

/// Does a job and turns its panic into an error. What the job leaves half done is its own, and gone with it.
fn guarded<Out>(timeline: Option<&Timeline>, number: u64, job: impl FnOnce() -> Out) -> Result<Out, JobPanicked> {
    let result = during(timeline, Some(Task::LookAhead), || catch_unwind(AssertUnwindSafe(job)));
    result.map_err(|payload| JobPanicked {
        number,
        message: message(payload.as_ref()),
    })
}

fn message(payload: &(dyn Any + Send)) -> String {
    let text = payload.downcast_ref::<String>().map(String::as_str);
    let text = text.or_else(|| payload.downcast_ref::<&str>().copied());
    text.unwrap_or("without a message").to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::mpsc;

    /// Takes longer the smaller the number is, so that results come in the wrong order.
    fn work(number: usize) -> u64 {
        let rounds = 20_000 / (number as u64 + 1);
        (0..rounds).fold(number as u64, |sum, k| {
            sum.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(k)
        })
    }

    #[test]
    fn results_are_the_same_for_any_number_of_threads() {
        let expected: Vec<u64> = (0..200).map(work).collect();
        for threads in 0..=8 {
            let workers = Workers::new(threads, || ());
            assert_eq!(workers.threads(), threads);
            assert_eq!(workers.run(200, work), Ok(expected.clone()), "{threads} threads");
            let mut ordered = Ordered::new(&workers);
            let mut got = Vec::new();
            for number in 0..200 {
                assert_eq!(ordered.push(move || work(number)), number as u64);
                // Some are taken meanwhile, one way or the other, as in a stream.
                if number % 7 == 6 {
                    got.push(ordered.wait_next().unwrap().unwrap());
                    got.extend(ordered.try_next().map(Result::unwrap));
                }
            }
            while let Some(result) = ordered.wait_next() {
                got.push(result.unwrap());
            }
            assert_eq!(got, expected, "{threads} threads");
            assert_eq!((ordered.under_way(), ordered.try_next()), (0, None));
        }
    }

    #[test]
    fn no_jobs_give_no_results() {
        let workers = Workers::new(2, || ());
        assert_eq!(workers.run(0, work), Ok(Vec::new()));
        assert_eq!(Ordered::<u64>::new(&workers).wait_next(), None);
    }

    #[test]
    fn a_panic_is_reported_with_its_number_and_the_threads_go_on() {
        for threads in [0, 3] {
            let workers = Workers::new(threads, || ());
            let failing = |number: usize| {
                assert!(!(number == 5 || number == 9), "bad data at {number}");
                number
            };
            let error = workers.run(12, failing).unwrap_err();
            assert_eq!((error.number, error.message.as_str()), (5, "bad data at 5"));
            assert_eq!(error.to_string(), "planning job 5 panicked: bad data at 5");
            let mut ordered = Ordered::new(&workers);
            for number in 0..12 {
                ordered.push(move || failing(number));
            }
            let results: Vec<_> = std::iter::from_fn(|| ordered.wait_next()).collect();
            assert_eq!(results.len(), 12);
            for (number, result) in results.into_iter().enumerate() {
                match number {
                    5 | 9 => assert_eq!(result.unwrap_err().number, number as u64),
                    _ => assert_eq!(result, Ok(number)),
                }
            }
            assert_eq!(workers.run(3, |number| number), Ok(vec![0, 1, 2]));
        }
    }

    #[test]
    fn threads_are_named_and_prepared_and_end_with_the_last_handle() {
        struct Ends(mpsc::Sender<String>);
        impl Drop for Ends {
            fn drop(&mut self) {
                let _ = self.0.send(format!("{} ends", current().name().unwrap_or_default()));
            }
        }
        thread_local!(static ENDS: std::cell::RefCell<Option<Ends>> = const { std::cell::RefCell::new(None) });
        let (sender, receiver) = channel();
        let workers = Workers::new(2, move || {
            let _ = sender.send(format!("{} starts", current().name().unwrap_or_default()));
            ENDS.with(|ends| *ends.borrow_mut() = Some(Ends(sender.clone())));
        });
        let other = workers.clone();
        drop(workers);
        assert_eq!(other.run(3, |number| number), Ok(vec![0, 1, 2]));
        drop(other);
        let mut told: Vec<String> = receiver.try_iter().collect();
        told.sort();
        assert_eq!(
            told,
            [
                "planner 1 ends",
                "planner 1 starts",
                "planner 2 ends",
                "planner 2 starts"
            ]
        );
    }

    #[test]
    fn what_was_handed_in_is_done_before_the_threads_end() {
        let workers = Workers::new(2, || ());
        let done = Arc::new(AtomicUsize::new(0));
        let mut ordered = Ordered::new(&workers);
        for number in 0..50 {
            let done = Arc::clone(&done);
            ordered.push(move || {
                work(number);
                done.fetch_add(1, Ordering::Relaxed)
            });
        }
        drop(workers);
        drop(ordered);
        assert_eq!(done.load(Ordering::Relaxed), 50);
    }

    /// Two stages behind each other, every one in a thread of its own; the last also hands in jobs.
    fn staged(threads: usize, room: usize) -> (Vec<u64>, Vec<u64>) {
        let workers = Workers::with_helpers(threads, 2, None, || ());
        let (numbers_in, numbers) = queue(room, &workers);
        let (squares_in, squares) = queue(room, &workers);
        std::thread::scope(|scope| {
            scope.spawn(move || {
                assert!((0..500_u64).all(|number| numbers_in.put(number)));
                drop(numbers_in);
            });
            scope.spawn(move || {
                while let Some(number) = numbers.take() {
                    squares_in.put(number * number);
                }
            });
            let mut ordered = Ordered::new(&workers);
            let mut got = Vec::new();
            while let Some(square) = squares.take() {
                got.push(square);
                ordered.push(move || work((square % 50) as usize));
            }
            (
                got,
                std::iter::from_fn(|| ordered.wait_next()).map(Result::unwrap).collect(),
            )
        })
    }

    #[test]
    fn a_queue_keeps_the_order_and_its_ends_do_jobs_while_they_wait() {
        let squares: Vec<u64> = (0..500).map(|number| number * number).collect();
        let worked: Vec<u64> = squares.iter().map(|square| work((square % 50) as usize)).collect();
        for (threads, room) in [(0, 0), (0, 1), (1, 3), (2, 64)] {
            assert_eq!(
                staged(threads, room),
                (squares.clone(), worked.clone()),
                "{threads} {room}"
            );
        }
    }

    #[test]
    fn a_queue_ends_at_both_ends_when_one_of_them_goes() {
        let workers = Workers::with_helpers(0, 1, None, || ());
        let (put, take) = queue(2, &workers);
        assert!(put.put(1) && put.put(2));
        drop(put);
        assert_eq!((take.take(), take.take(), take.take()), (Some(1), Some(2), None));
        let (put, take) = queue(1, &workers);
        std::thread::scope(|scope| {
            // Waits for room that never comes, or finds the end: it comes back either way.
            let thread = scope.spawn(move || {
                let both = put.put(1) && put.put(2);
                put.help();
                both
            });
            drop(take);
            assert!(!thread.join().unwrap());
        });
    }

    #[test]
    fn jobs_may_use_the_pool_themselves() {
        let workers = Workers::new(2, || ());
        let inner = workers.clone();
        let sums = workers.run(6, move |number| {
            let parts = inner.run(4, move |part| number * 10 + part);
            parts.unwrap().into_iter().sum::<usize>()
        });
        assert_eq!(sums, Ok((0..6).map(|number| number * 40 + 6).collect()));
    }
}
