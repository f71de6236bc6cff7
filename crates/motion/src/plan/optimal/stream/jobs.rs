//! Windows and borders that are being solved.
//!
//! In:  jobs, with what each was asked for.
//! Out: their answers, in the order in which they were handed in.

use std::collections::VecDeque;

use crate::plan::optimal::windows::{Answer, Job, States};
use crate::plan::workers::{Ordered, Workers};

/// Which job an answer belongs to.
#[derive(Debug)]
pub(super) enum Asked {
    /// The border at the right end of this window.
    Border {
        window: u64,
        before: usize,
    },
    Window(u64),
}

/// Jobs that have been handed in and not answered.
#[derive(Debug)]
pub(super) struct Jobs {
    workers: Workers,
    answers: Ordered<Answer>,
    asked: VecDeque<Asked>,
}

impl Jobs {
    pub(super) fn new(workers: &Workers) -> Jobs {
        Jobs {
            workers: workers.clone(),
            answers: Ordered::new(workers),
            asked: VecDeque::new(),
        }
    }

    pub(super) fn order(&mut self, asked: Asked, job: Job) {
        self.asked.push_back(asked);
        self.answers.push(move || job.run());
    }

    /// Nobody waits for an answer any more.
    pub(super) fn forget(&mut self) {
        *self = Jobs::new(&self.workers);
    }

    pub(super) fn are_under_way(&self) -> bool {
        self.answers.under_way() > 0
    }

    /// Whether they keep all threads busy. They wait in memory: there should be no more.
    pub(super) fn are_many(&self) -> bool {
        self.answers.under_way() > 4 * (self.workers.threads() + 1)
    }

    /// The next answer, where there is one or it is waited for: the states, or that there is no way.
    pub(super) fn next(&mut self, wait: bool) -> Option<(Asked, Option<States>)> {
        let answer = if wait {
            self.answers.wait_next()
        } else {
            self.answers.try_next()
        }?;
        // Only an answer takes its question away: one that is not there yet comes later.
        Some((self.asked.pop_front()?, answer.ok().and_then(Result::ok)))
    }
}
