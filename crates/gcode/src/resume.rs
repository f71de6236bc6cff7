//! A start in the middle of a program.
//!
//! In:  a run before its first event, and a line of the program.
//! Out: the run before that line, with the exact state that the lines before have left, and what the machine has to be
//!      given so that it is in that state.
//!
//! The lines before are run, so parameters, loops and subroutines are what they would be; only their calls are not
//! handed out.

use crate::error::{Error, ErrorKind};
use crate::interpreter::Run;
use crate::scan::Span;
use crate::state::Calls;
use crate::state::{Question, State};
use motion::canon::{Axis, Call, FeedMode, Position};

/// What a machine must be given before a program goes on in its middle.
#[derive(Clone, Debug, PartialEq)]
pub struct Resume {
    /// Calls that re-establish the state, in the order in which they are to be run; the last one is the way to
    /// [`Self::from`].
    pub calls: Vec<Call>,
    /// Where the program expects the axes to be, work coordinates.
    pub from: Position,
    /// The same in machine coordinates.
    pub machine: Position,
    /// Lines whose outcome only the machine knows (a probing move, an input, a tool), in the words of the operator: their
    /// answers are those of the present [`Machine`](crate::Machine).
    pub assumptions: Vec<String>,
}

/// How a machine comes to the place where a program goes on in its middle: never by one rapid move of all axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Approach {
    /// Z goes up to here first, machine coordinates, mm; where it stands higher, it stays.
    pub retract_mm: f64,
    /// The last piece of the way down that is gone at feed, mm.
    pub clearance_mm: f64,
    /// That feed, mm/min.
    pub feed_mm_per_minute: f64,
}

impl Run<'_> {
    /// Begins before a line of the program, as [`Run::start_at_line`] says, and hands out first what brings the machine there: Z
    /// up; modes, tool and spindle; rotary axes; the others; Z down by rapid and, at last, at feed. An error is the first event.
    pub fn begin_at_line(mut self, line: u32, approach: &Approach) -> Self {
        match self.start_at_line(line) {
            Ok(_) => self.calls.extend(self.state.approach(approach)),
            Err(error) => self.errors.push(*error),
        }
        self
    }

    /// Goes on to a line of the program, counted from 1, without handing out the events before it. The next event is the
    /// first one of that line.
    ///
    /// In a loop or subroutine the line is reached when it is run for the first time.
    ///
    /// # Errors
    /// The first error of the lines before; a line that is not run; one at which cutter compensation is on or a NURBS is
    /// open, since the moves before belong to it.
    pub fn start_at_line(&mut self, line: u32) -> Result<Resume, Box<Error>> {
        self.stop_before = Some(line);
        let mut assumptions = Vec::new();
        self.calls.clear();
        while self.stop_before.is_some() && !self.ended && self.errors.is_empty() {
            for question in &self.state.questions {
                assumptions.push(assumption(self.source().line, question));
            }
            self.step();
            self.calls.clear();
        }
        if self.errors.is_empty() {
            let not_here = if self.stop_before.take().is_some() {
                Some(ErrorKind::LineNotRun { line })
            } else if self.state.compensation.cutter.is_some() {
                Some(ErrorKind::StartUnderCompensation { line })
            } else if self.state.nurbs.is_some() {
                Some(ErrorKind::StartInNurbs { line })
            } else {
                None
            };
            if let Some(kind) = not_here {
                self.fail(Span::default(), kind);
            }
        }
        if !self.errors.is_empty() {
            self.ended = true;
            return Err(Box::new(self.errors.remove(0)));
        }
        Ok(Resume {
            calls: self.state.re_establish(),
            from: self.state.at,
            machine: self.state.machine(),
            assumptions,
        })
    }
}

fn assumption(line: u32, question: &Question) -> String {
    match question {
        Question::Probe { .. } => format!("line {line}: where the probe tripped"),
        Question::Input { .. } => format!("line {line}: what the input read"),
        Question::UserCode { number, .. } => format!("line {line}: that M{number} did what it is to do"),
        Question::Tool { tool, .. } => format!("line {line}: that the change brought tool {tool}"),
    }
}

impl State {
    /// Calls that bring a machine that stands where the settings say into this state and to the current point.
    fn approach(&self, approach: &Approach) -> Vec<Call> {
        let (now, target) = (self.settings.start, self.machine());
        let to = |machine: Position| Call::StraightTraverse {
            to: self.offsets.work(machine),
        };
        let mut at = now;
        at[Axis::Z] = at[Axis::Z].max(approach.retract_mm);
        // Where work coordinates lie, before the first move in them.
        let mut calls = vec![
            Call::UseLengthUnit(self.modal.unit),
            self.g5x_call(),
            self.g92_call(),
            self.rotation_call(),
            Call::SetToolLengthOffset {
                offset: self.offsets.tool,
            },
            to(at),
        ];
        calls.extend(self.modes_told());
        for axis in [Axis::A, Axis::B, Axis::C] {
            at[axis] = target[axis];
        }
        calls.push(to(at));
        at = Position(Axis::ALL.map(|axis| if axis == Axis::Z { at[axis] } else { target[axis] }));
        calls.push(to(at));
        at[Axis::Z] = at[Axis::Z].min(target[Axis::Z] + approach.clearance_mm);
        calls.push(to(at));
        calls.extend([
            Call::SetFeedMode(FeedMode::PerTime),
            Call::SetFeedRate {
                linear: approach.feed_mm_per_minute / 60.0,
                angular: approach.feed_mm_per_minute / 60.0,
            },
            Call::StraightFeed { to: self.at },
        ]);
        calls.extend(self.feed_told());
        calls
    }

    /// Calls that bring a machine into this state.
    fn re_establish(&self) -> Vec<Call> {
        let mut calls = self.modes_told();
        calls.push(Call::StraightTraverse { to: self.at });
        calls
    }

    /// The same without the way to the current point.
    pub(crate) fn modes_told(&self) -> Vec<Call> {
        let modal = &self.modal;
        let mut calls = Calls::new();
        calls.extend([
            Call::UseLengthUnit(modal.unit),
            self.g5x_call(),
            self.g92_call(),
            self.rotation_call(),
        ]);
        let tool = self.tools.in_spindle;
        let pocket = self.tools.table.by_number(tool).map_or(0, |tool| tool.pocket);
        if tool != self.settings.tool_in_spindle {
            calls.extend([
                Call::StartChange,
                Call::StopSpindle { spindle: 0 },
                Call::ChangeTool { tool, pocket },
            ]);
        }
        calls.push_back(Call::SetToolLengthOffset {
            offset: self.offsets.tool,
        });
        if self.tool_centre_point {
            calls.push_back(Call::SetToolCentrePoint(true));
        }
        if let Some(tool) = self.tools.selected {
            calls.push_back(Call::SelectTool { tool });
        }
        calls.extend([Call::SelectPlane(modal.plane), Call::SetPathMode(modal.path_mode)]);
        calls.push_back(Call::EnableFeedOverride(modal.overrides.feed));
        calls.push_back(Call::EnableAdaptiveFeed(modal.overrides.adaptive));
        calls.push_back(Call::EnableFeedHold(modal.overrides.hold));
        for (spindle, state) in (0..self.settings.spindles).zip(&modal.spindles) {
            let on = modal.overrides.speed[usize::from(spindle)];
            let (mode, speed) = (state.mode, self.spindle_speed_told(spindle));
            calls.push_back(Call::EnableSpeedOverride { spindle, on });
            calls.push_back(Call::SetSpindleMode { spindle, mode });
            calls.push_back(Call::SetSpindleSpeed { spindle, speed });
            if let Some(direction) = state.turning {
                calls.push_back(Call::StartSpindle {
                    spindle,
                    direction,
                    wait_for_speed: true,
                });
            }
        }
        calls.extend([Call::Mist(modal.mist), Call::Flood(modal.flood)]);
        calls.extend(self.feed_told());
        calls.into()
    }

    /// Unit and value of the feed.
    fn feed_told(&self) -> Vec<Call> {
        let mut calls = Calls::new();
        calls.push_back(Call::SetFeedMode(match self.modal.feed_unit {
            crate::code::FeedUnit::UnitsPerTurn => FeedMode::PerTurn { spindle: 0 },
            crate::code::FeedUnit::InverseTime | crate::code::FeedUnit::UnitsPerMinute => FeedMode::PerTime,
        }));
        self.push_feed(&mut calls);
        calls.into()
    }
}
