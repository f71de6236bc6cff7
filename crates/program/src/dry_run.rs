//! Dry run: moves at feed run at a feed that is set by hand, spindles and coolant are not switched on. All else is as programmed.
//!
//! In:  canonical calls. Out: those that the planner is to hear in their place.
//!
//! Rapid moves, dwells, tool changes, outputs and stops are those of the program, and so are probing moves with their feed, which a
//! probe has to bear. What moves in step with the spindle cannot be run without it.

use motion::canon::{Call, FeedMode};

/// What becomes of a call.
pub(super) enum Dry {
    /// The planner hears it, behind a feed if there is one.
    Passes { before: Option<Call> },
    /// The same, with a feed behind it, too.
    Between { before: Call, behind: Call },
    /// The planner does not hear of it.
    Dropped,
}

/// The feed by hand, and that of the program.
#[derive(Debug)]
pub(super) struct DryRun {
    feed: Call,
    programmed: Option<Call>,
    per_turn: bool,
    is_set: bool,
}

impl DryRun {
    /// `feed_s`: mm/s, or degrees/s where only rotary axes move.
    pub(super) fn new(feed_s: f64) -> DryRun {
        DryRun {
            feed: Call::SetFeedRate {
                linear: feed_s,
                angular: feed_s,
            },
            programmed: None,
            per_turn: false,
            is_set: false,
        }
    }

    /// # Errors
    /// Why it cannot be run dry.
    pub(super) fn change(&mut self, call: &Call) -> Result<Dry, &'static str> {
        Ok(match call {
            Call::SetFeedRate { .. } => {
                self.programmed = Some(call.clone());
                Dry::Dropped
            }
            Call::SetFeedMode(mode) => {
                self.per_turn = matches!(mode, FeedMode::PerTurn { .. });
                Dry::Dropped
            }
            Call::StraightFeed { .. } | Call::ArcFeed { .. } | Call::NurbsFeed { .. } => Dry::Passes {
                before: (!std::mem::replace(&mut self.is_set, true)).then(|| self.feed.clone()),
            },
            Call::StraightProbe { .. } if self.per_turn => {
                return Err("a probing move at a feed per turn (G95): the spindle stands in a dry run");
            }
            Call::StraightProbe { .. } => match &self.programmed {
                Some(programmed) => Dry::Between {
                    before: programmed.clone(),
                    behind: self.feed.clone(),
                },
                None => Dry::Passes { before: None },
            },
            Call::RigidTap { .. } | Call::StartSpindleSync { velocity: false, .. } => {
                return Err("a move in step with the spindle (G33, G33.1, G76), which stands in a dry run");
            }
            Call::StartSpindleSync { velocity: true, .. }
            | Call::StopSpindleSync
            | Call::SetSpindleMode { .. }
            | Call::SetSpindleSpeed { .. }
            | Call::StartSpindle { .. }
            | Call::OrientSpindle { .. }
            | Call::WaitSpindleOriented { .. }
            | Call::Mist(true)
            | Call::Flood(true) => Dry::Dropped,
            _ => Dry::Passes { before: None },
        })
    }
}
