//! When a run is given up, as a program may never end.

use crate::error::ErrorKind;
use motion::cancel::Cancel;
use std::time::{Duration, Instant};

/// What a check does at most, as a program may never end.
#[derive(Clone, Debug)]
pub struct CheckLimits {
    /// Lines that are run, those of loops counted each time.
    pub steps: u64,
    /// Lines that are run one after the other while nothing moves and nothing is waited for.
    pub idle_steps: u64,
    /// Time for running them.
    pub time: Duration,
    /// Mistakes that are told.
    pub errors: usize,
    /// Gives it up from outside: the last error is [`ErrorKind::Cancelled`](crate::ErrorKind::Cancelled) then.
    pub cancel: Cancel,
}

impl Default for CheckLimits {
    /// A hundred million lines, ten million without a move, ten minutes, a hundred mistakes.
    fn default() -> CheckLimits {
        CheckLimits {
            steps: 100_000_000,
            idle_steps: 10_000_000,
            time: Duration::from_secs(600),
            errors: 100,
            cancel: Cancel::default(),
        }
    }
}

/// What a run has spent of its limits.
#[derive(Debug)]
pub(crate) struct Spent {
    pub(crate) limits: CheckLimits,
    /// Since when it runs; `None`: it may run for any time.
    pub(crate) since: Option<Instant>,
    /// Lines that were read.
    steps: u64,
    /// Those since the machine was told to move or to wait.
    pub(crate) idle_steps: u64,
}

impl Default for Spent {
    /// Without limits.
    fn default() -> Spent {
        Spent {
            limits: CheckLimits {
                steps: u64::MAX,
                idle_steps: u64::MAX,
                ..CheckLimits::default()
            },
            since: None,
            steps: 0,
            idle_steps: 0,
        }
    }
}

impl Spent {
    /// Counts a line, and tells the limit that it passes. The time is looked at every 2^14 lines.
    #[inline]
    pub(crate) fn count_line(&mut self) -> Result<(), ErrorKind> {
        self.steps += 1;
        self.idle_steps += 1;
        let CheckLimits { steps, idle_steps, .. } = self.limits;
        if self.steps > steps || self.idle_steps > idle_steps || self.steps.is_multiple_of(1 << 14) {
            return self.check();
        }
        Ok(())
    }

    #[cold]
    fn check(&self) -> Result<(), ErrorKind> {
        let CheckLimits {
            steps,
            idle_steps,
            time,
            ..
        } = self.limits;
        if self.steps > steps {
            return Err(ErrorKind::TooManySteps { steps });
        }
        if self.idle_steps > idle_steps {
            return Err(ErrorKind::TooManyIdleSteps { steps: idle_steps });
        }
        match self.since {
            Some(since) if since.elapsed() > time => Err(ErrorKind::OutOfTime {
                seconds: time.as_secs(),
            }),
            Some(_) | None => Ok(()),
        }
    }
}
