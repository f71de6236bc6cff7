//! What is asked of a control and concerns no motion, but takes time: done by a thread of its own, one after the other for each.
//!
//! In:  work, and the ticket of whoever waits for it. Out: its answer, when it is there. The service goes on meanwhile.

use super::rpc::{RpcError, code};
use super::server::Ticket;
use host::capabilities::{self, Work};
use nix::sys::eventfd::EventFd;
use serde_json::Value;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};
use std::sync::mpsc::{Receiver, Sender, channel};

/// Errands under way at the same time.
const COUNT_MAX: usize = 4;

type Answer = Result<Value, RpcError>;

/// What is to be done; `None`: it has set something going that answers in its place.
pub type Errand = Box<dyn FnOnce() -> Option<Answer> + Send>;

/// Errands that are under way.
#[derive(Debug)]
pub struct Errands {
    answers: Receiver<(Ticket, Answer)>,
    answer: Sender<(Ticket, Answer)>,
    under_way: Arc<AtomicUsize>,
    wake: Option<Arc<EventFd>>,
}

impl Errands {
    /// `wake`: as of [`Serve::wake`](super::server::Serve::wake).
    pub fn new(wake: Option<Arc<EventFd>>) -> Errands {
        let (answer, answers) = channel();
        Errands {
            answers,
            answer,
            under_way: Arc::default(),
            wake,
        }
    }

    /// Begins one; its answer comes with the ticket.
    ///
    /// # Errors
    /// There are too many, or the system has no thread.
    pub fn begin(&self, ticket: Ticket, work: Errand) -> Result<(), RpcError> {
        let refused = |what: String| RpcError::new(code::REFUSED, what);
        if self.under_way.load(Relaxed) >= COUNT_MAX {
            return Err(refused(format!(
                "{COUNT_MAX} of these are under way already: ask again"
            )));
        }
        let (answer, wake, under_way) = (self.answer.clone(), self.wake.clone(), Arc::clone(&self.under_way));
        under_way.fetch_add(1, Relaxed);
        let begun = std::thread::Builder::new().name("errand".into()).spawn(move || {
            capabilities::give_up_or_warn(Work::Ordinary);
            let done = work();
            under_way.fetch_sub(1, Relaxed);
            if let Some(done) = done {
                // Nobody reads it any more where the service has ended.
                let _ = answer.send((ticket, done));
            }
            if let Some(wake) = wake {
                // It can fail only where it is full, and then it wakes, too.
                let _ = wake.write(1);
            }
        });
        begun.map(drop).map_err(|cause| {
            self.under_way.fetch_sub(1, Relaxed);
            refused(cause.to_string())
        })
    }

    /// An answer that is ready.
    pub fn later(&self) -> Option<(Ticket, Answer)> {
        self.answers.try_recv().ok()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;
    use std::sync::Barrier;
    use std::time::Duration;

    #[test]
    fn as_many_as_may_be_and_each_is_answered() {
        let errands = Errands::new(None);
        let gate = Arc::new(Barrier::new(COUNT_MAX + 1));
        for ticket in 0..COUNT_MAX as u64 {
            let gate = Arc::clone(&gate);
            let work = move || {
                gate.wait();
                Some(Ok(json!(ticket)))
            };
            errands.begin(ticket, Box::new(work)).unwrap();
        }
        assert!(errands.begin(99, Box::new(|| Some(Ok(json!(99))))).is_err());
        assert_eq!(errands.later(), None);
        gate.wait();
        let mut all: Vec<_> = (0..COUNT_MAX)
            .map(|_| errands.answers.recv_timeout(Duration::from_secs(60)).unwrap())
            .collect();
        all.sort_by_key(|(ticket, _)| *ticket);
        let wanted: Vec<_> = (0..COUNT_MAX as u64)
            .map(|ticket| (ticket, Ok(json!(ticket))))
            .collect();
        assert_eq!(all, wanted);
        errands.begin(5, Box::new(|| Some(Ok(json!(5))))).unwrap();
    }
}
