//! Homing by the drive: mode 6, rising edge of controlword bit 4, result in statusword bits 13, 12 and 10.
//!
//! In:  the feedback of an enabled drive. Out: controlword and mode, until the drive has homed and is back in its
//! cyclic mode with the target at the new actual position.

use super::fault::{AxisFault, HomingFault, Step};
use super::interface::Feedback;
use super::state::{Axis, Homing, HomingState, HomingStep, Phase, command_stop};
use crate::profile::{Command, State, controlword, mode, statusword};

/// A drive that still shows *attained* from an earlier homing at the start edge has this long to take it back.
const STALE_RESULT_NS: u64 = 100_000_000;

/// Bits 13, 12 and 10 of the statusword in homing mode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Shown {
    Running,
    StoppedOrNotStarted,
    AttainedMoving,
    Done,
    Error,
}

fn shown(word: u16) -> Shown {
    let bit = |mask| word & mask != 0;
    match (
        bit(statusword::MODE_ERROR),
        bit(statusword::MODE_ACK),
        bit(statusword::TARGET_REACHED),
    ) {
        (false, false, false) => Shown::Running,
        (false, false, true) => Shown::StoppedOrNotStarted,
        (false, true, false) => Shown::AttainedMoving,
        (false, true, true) => Shown::Done,
        // 11x is reserved: with the error bit set it is no success.
        (true, _, _) => Shown::Error,
    }
}

impl Axis {
    /// One cycle of homing. The target copies the actual position throughout.
    pub(super) fn homing_step(&mut self, now_ns: u64, drive: State, feedback: &Feedback, mut homing: Homing) -> u16 {
        if drive != State::OperationEnabled {
            self.fail(self.unexpected_disable(drive));
            return command_stop(drive) as u16;
        }
        let started_ns = *homing.started_ns.get_or_insert(now_ns);
        if now_ns.saturating_sub(started_ns) > self.config.homing_timeout_ns {
            self.fail(AxisFault::Homing(HomingFault::Timeout));
            return command_stop(drive) as u16;
        }
        self.target = self.actual;
        let shown = shown(feedback.statusword);
        let start = Command::EnableOperation as u16 | controlword::MODE_START;
        let word = match homing.step {
            HomingStep::SetMode if feedback.mode_display != mode::HOMING => {
                self.limit(now_ns, Step::HomingMode);
                Command::EnableOperation as u16
            }
            HomingStep::SetMode => {
                let stale = matches!(shown, Shown::Done | Shown::AttainedMoving | Shown::Error);
                homing.step = HomingStep::Run {
                    edge_ns: now_ns,
                    stale,
                    ran: false,
                    stopped_ns: None,
                };
                start
            }
            HomingStep::Run {
                edge_ns,
                stale,
                ran,
                stopped_ns,
            } => {
                let stale = stale
                    && now_ns.saturating_sub(edge_ns) <= STALE_RESULT_NS
                    && !matches!(shown, Shown::Running | Shown::StoppedOrNotStarted);
                let run = |ran, stopped_ns| HomingStep::Run {
                    edge_ns,
                    stale,
                    ran,
                    stopped_ns,
                };
                match shown {
                    Shown::Done if !stale => {
                        // The drive has moved its zero: its own value is the position now.
                        self.actual = i64::from(feedback.position);
                        self.target = self.actual;
                        homing.step = HomingStep::Return;
                        self.operation()
                    }
                    Shown::Error if !stale => {
                        self.fail(AxisFault::Homing(HomingFault::Drive));
                        Command::QuickStop as u16
                    }
                    Shown::StoppedOrNotStarted if ran => {
                        let since_ns = stopped_ns.unwrap_or(now_ns);
                        homing.step = run(true, Some(since_ns));
                        if now_ns.saturating_sub(since_ns) > self.config.follow_grace_ns {
                            self.fail(AxisFault::Homing(HomingFault::Stopped));
                        }
                        start
                    }
                    Shown::Running => {
                        homing.step = run(true, None);
                        start
                    }
                    Shown::Done | Shown::Error | Shown::StoppedOrNotStarted | Shown::AttainedMoving => {
                        homing.step = run(ran, None);
                        start
                    }
                }
            }
            HomingStep::Return if feedback.mode_display != self.config.mode.code() => {
                self.limit(now_ns, Step::Mode);
                self.operation()
            }
            HomingStep::Return => {
                self.enter(Phase::Enabled);
                self.mark_ns = now_ns;
                self.homed = HomingState::Homed;
                return self.operation();
            }
        };
        if self.fault().is_some() {
            return command_stop(drive) as u16;
        }
        self.phase = Phase::Homing(homing);
        word
    }
}
