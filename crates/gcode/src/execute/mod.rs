//! Blocks to canonical calls, in the order in which RS274/NGC runs the words of a line.
//!
//! In:  a [`Block`] and the [`State`] left by the blocks before it.
//! Out: canonical calls, or the rule that the block breaks.
//!
//! [`State::execute`] is the table of contents; each subject has a file of its own.

mod arc;
pub(crate) mod circle;
mod compensation;
pub(crate) mod cycle;
mod feed;
mod io;
mod offset;
mod probe;
mod remark;
mod saved;
mod spindle;
mod spline;
mod straight;
mod thread;
mod tool;
pub(crate) mod turning;
mod usage;

use crate::block::{Assignment, Block, Parameter};
use crate::code::{Distance, Motion, NonModal, PathCode, Retract, Stop};
use crate::error::{ErrorKind, ExpressionError, OWordError};
use crate::machine::Machine;
use crate::parameter::{self, is_read_only, is_read_only_number};
use crate::remap::Phase;
use crate::scan::{Fault, Span};
use crate::state::{Calls, Question, State};
use motion::canon::{Call, LengthUnit, PathMode, Plane};
use std::ops::RangeInclusive;

/// Least share of the speed in corners that R of G64 names.
const CORNER_SHARE_MIN: f64 = 0.1;

/// Whether the program goes on behind a block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Flow {
    On,
    /// M2 or M30 was run.
    End,
    /// M98: the program of this number is called so many times.
    Call {
        program: u32,
        times: u32,
        span: Span,
    },
    /// M99
    Return,
    /// G70 to G72.2: the subroutine of this number is the profile.
    Profile {
        program: u32,
        span: Span,
    },
}

impl State {
    /// Runs a block that was read without faults. After a fault `calls` holds what came before it.
    #[inline]
    pub(crate) fn execute(&mut self, block: &Block, line: &[u8], calls: &mut Calls) -> Result<Flow, Fault> {
        if self.turning.is_some() {
            return self.execute_in_profile(block, line, calls);
        }
        self.execute_phases(block, line, Phase::Feed..=Phase::Stop, calls)
    }

    /// Runs a part of a block: what stands before, between or behind its remapped codes.
    pub(crate) fn execute_phases(
        &mut self,
        block: &Block,
        line: &[u8],
        phases: RangeInclusive<Phase>,
        calls: &mut Calls,
    ) -> Result<Flow, Fault> {
        let runs = |phase| phases.contains(&phase);
        let motion = self.motion_now(block);
        if runs(Phase::Feed) {
            self.check_usage(block, line, motion)?;
            self.check_words(block, motion)?;
            self.assign(&block.assignments)?;
            if let Some(text) = block.remark {
                self.remark(text, line, calls)?;
            }
            self.spindle_mode(block, calls)?;
            self.feed_unit(block, calls);
            self.feed(block, calls);
        }
        if runs(Phase::Speed) {
            self.spindle_speed(block, calls)?;
        }
        if runs(Phase::SelectTool) {
            self.select_tool(block, calls)?;
        }
        if runs(Phase::InputOutput) {
            self.check_before_compensation(block)?;
            self.inputs_and_outputs(block, calls)?;
        }
        if runs(Phase::Tool) {
            self.change_tool(block, calls)?;
        }
        if runs(Phase::Spindle) {
            self.spindle_action(block, calls)?;
        }
        if runs(Phase::Coolant) {
            self.saved_modes(block, calls)?;
            self.coolant(block, calls);
        }
        if runs(Phase::Override) {
            self.overrides(block, calls)?;
        }
        if runs(Phase::User) {
            self.user_code(block, calls)?;
        }
        if runs(Phase::Modes) {
            self.modes(block, motion, calls)?;
        }
        if runs(Phase::Motion) {
            self.motion(motion, block, calls)?;
        }
        if let Some(turning) = &self.turning {
            let program = turning.profile;
            let span = block.motion_span();
            return Ok(Flow::Profile { program, span });
        }
        if runs(Phase::Stop) {
            return self.stop(block, calls);
        }
        Ok(Flow::On)
    }

    /// G codes that set something, in their order.
    #[inline]
    fn modes(&mut self, block: &Block, motion: Option<Motion>, calls: &mut Calls) -> Result<(), Fault> {
        self.dwell(block, calls)?;
        self.plane(block, calls);
        self.unit(block, calls);
        self.diameter(block, calls);
        self.compensation(block, calls)?;
        self.check_behind_compensation(block, motion)?;
        self.length_offset(motion, block, calls)?;
        self.system(block, calls);
        self.path_mode(block, calls)?;
        self.distances(block, calls);
        self.retract(block, calls);
        self.non_modal(block, calls)
    }

    /// Rules for the words of a motion that hold before anything of its line is run.
    #[inline]
    fn check_words(&self, block: &Block, motion: Option<Motion>) -> Result<(), Fault> {
        match motion {
            Some(Motion::Cycle(_)) => self.check_cycle(block),
            Some(Motion::SpindleSynchronised | Motion::RigidTap) => self.check_synchronised(block),
            Some(Motion::Thread) => self.check_thread(block),
            Some(
                Motion::Traverse
                | Motion::Feed
                | Motion::ArcClockwise
                | Motion::ArcCounterclockwise
                | Motion::CubicSpline
                | Motion::QuadraticSpline
                | Motion::Nurbs
                | Motion::NurbsEnd
                | Motion::NurbsKnot
                | Motion::NurbsKnotEnd
                | Motion::Probe(_)
                | Motion::Finish
                | Motion::Rough(_),
            )
            | None => Ok(()),
        }
    }

    /// A line of the profile of a lathe cycle.
    fn execute_in_profile(&mut self, block: &Block, line: &[u8], calls: &mut Calls) -> Result<Flow, Fault> {
        self.assign(&block.assignments)?;
        if let Some(remark) = block.remark {
            self.remark(remark, line, calls)?;
        }
        self.read_profile_block(block)?;
        Ok(Flow::On)
    }

    /// What a listener must know before the first block.
    pub(crate) fn push_initial_calls(&self, calls: &mut Calls) {
        calls.extend([
            Call::UseLengthUnit(self.modal.unit),
            self.g5x_call(),
            self.g92_call(),
            self.rotation_call(),
            Call::SelectPlane(self.modal.plane),
            Call::SetPathMode(self.modal.path_mode),
            Call::Reset,
        ]);
    }

    /// Asks the machine what the calls of the last line were to find out.
    pub(crate) fn ask_machine(&mut self, machine: &mut dyn Machine) -> Result<(), ErrorKind> {
        for question in std::mem::take(&mut self.questions) {
            self.ask(question, machine)?;
        }
        Ok(())
    }

    fn ask(&mut self, question: Question, machine: &mut dyn Machine) -> Result<(), ErrorKind> {
        match question {
            Question::Probe { from, to, mode } => self.probed(from, to, mode, machine.probed(from, to, mode)),
            Question::Input { input, mode, timeout_s } => {
                let value = machine.waited(input, mode, timeout_s);
                self.parameters.set(parameter::INPUT_RESULT, value.unwrap_or(-1.0));
                Ok(())
            }
            Question::UserCode { number, p, q } => {
                let ended = machine.user_code_ended(number, p, q);
                ended.map_err(|reason| ErrorKind::UserCodeFailed { number, reason })
            }
            Question::Tool { tool, before } => {
                let brought = machine.tool_changed(tool);
                if brought != tool {
                    self.tool_changed(brought);
                }
                if let Some(before) = before {
                    self.at = machine.place_after_tool_change(before, self.at);
                }
                Ok(())
            }
        }
    }

    /// What this line does with its axis words; `None`: no motion.
    fn motion_now(&self, block: &Block) -> Option<Motion> {
        if let Some(coded) = block.codes.motion {
            return coded.value;
        }
        if block.codes.non_modal.is_some_and(|coded| coded.value.takes_axes()) || usage::length_offset_takes_axes(block)
        {
            return None;
        }
        let modal = self.modal.motion?;
        let moves = block.first_axis().is_some() || usage::moves_without_axes(modal, block);
        moves.then_some(modal)
    }

    fn assign(&mut self, assignments: &[Assignment]) -> Result<(), Fault> {
        for Assignment { target, value, span } in assignments {
            match target {
                Parameter::Numbered(index) if is_read_only_number(*index) => {
                    let name = index.to_string();
                    return Err((*span, ExpressionError::ReadOnlyParameter { name }.into()));
                }
                Parameter::Numbered(index) => self.parameters.set(*index, *value),
                Parameter::Named(name) if is_read_only(name) => {
                    let name = format!("<{name}>");
                    return Err((*span, ExpressionError::ReadOnlyParameter { name }.into()));
                }
                Parameter::Named(name) => self.parameters.set_named(name, *value),
            }
        }
        Ok(())
    }

    fn dwell(&mut self, block: &Block, calls: &mut Calls) -> Result<(), Fault> {
        let Some(coded) = block.codes.non_modal.filter(|coded| coded.value == NonModal::Dwell) else {
            return Ok(());
        };
        let seconds = block.word_value(b'P').ok_or((coded.span, ErrorKind::DwellMissing))?;
        block.check_dwell(b'P')?;
        self.doubts.dwell(self.source, seconds);
        calls.push_back(Call::Dwell { seconds });
        Ok(())
    }

    fn plane(&mut self, block: &Block, calls: &mut Calls) {
        if let Some(code) = block.codes.plane {
            self.use_plane(code.value, calls);
        }
    }

    fn use_plane(&mut self, plane: Plane, calls: &mut Calls) {
        self.modal.plane = plane;
        calls.push_back(Call::SelectPlane(plane));
    }

    fn unit(&mut self, block: &Block, calls: &mut Calls) {
        if let Some(code) = block.codes.unit {
            self.use_unit(code.value, calls);
        }
    }

    fn use_unit(&mut self, unit: LengthUnit, calls: &mut Calls) {
        self.modal.unit = unit;
        calls.push_back(Call::UseLengthUnit(unit));
    }

    fn diameter(&mut self, block: &Block, calls: &mut Calls) {
        if let Some(code) = block.codes.diameter {
            self.use_diameter(code.value, calls);
        }
    }

    fn use_diameter(&mut self, diameter: bool, calls: &mut Calls) {
        if diameter != self.modal.diameter {
            calls.push_back(Call::Comment(match diameter {
                true => "interpreter: Lathe diameter mode changed to diameter".into(),
                false => "interpreter: Lathe diameter mode changed to radius".into(),
            }));
        }
        self.modal.diameter = diameter;
    }

    fn path_mode(&mut self, block: &Block, calls: &mut Calls) -> Result<(), Fault> {
        let Some(code) = block.codes.path else {
            return Ok(());
        };
        if code.value == PathCode::Continuous
            && let Some(share) = block.word_value(b'R')
        {
            block.check_not_negative(b'R')?;
            calls.push_back(Call::SetPlanner {
                corner_share: (share > 0.0).then(|| share.clamp(CORNER_SHARE_MIN, 1.0)),
            });
        }
        self.modal.path_mode = match code.value {
            PathCode::ExactPath => PathMode::ExactPath,
            PathCode::ExactStop => PathMode::ExactStop,
            PathCode::Continuous => {
                let tolerance = |letter| {
                    let number = block.word_value(letter);
                    number.map(|number| number * self.modal.unit.mm())
                };
                let tolerance_mm = tolerance(b'P').map(|tolerance| tolerance.max(0.0));
                PathMode::Continuous {
                    tolerance_mm,
                    // LinuxCNC takes a Q below 0 as none.
                    naive_cam_tolerance_mm: tolerance(b'Q').filter(|tolerance| *tolerance >= 0.0).or(tolerance_mm),
                }
            }
        };
        calls.push_back(Call::SetPathMode(self.modal.path_mode));
        Ok(())
    }

    fn distances(&mut self, block: &Block, calls: &mut Calls) {
        if let Some(code) = block.codes.distance {
            self.use_distance(code.value, calls);
        }
        if let Some(code) = block.codes.arc_distance {
            self.use_arc_distance(code.value, calls);
        }
    }

    fn retract(&mut self, block: &Block, calls: &mut Calls) {
        let Some(code) = block.codes.retract else { return };
        self.use_retract(code.value, calls);
    }

    fn use_retract(&mut self, retract: Retract, calls: &mut Calls) {
        calls.push_back(Call::Comment(match retract {
            Retract::OldZ => "interpreter: retract mode set to old_z".into(),
            Retract::R => "interpreter: retract mode set to r_plane".into(),
        }));
        self.modal.retract = retract;
    }

    fn motion(&mut self, motion: Option<Motion>, block: &Block, calls: &mut Calls) -> Result<(), Fault> {
        if let Some(code) = block.codes.motion {
            self.check_nurbs_closed(code.value).map_err(|kind| (code.span, kind))?;
            self.change_motion(code.value, calls);
        }
        match motion {
            None => Ok(()),
            Some(Motion::Traverse) => self.traverse(block, calls),
            Some(Motion::Feed) => self.straight_feed(block, calls),
            Some(motion @ (Motion::ArcClockwise | Motion::ArcCounterclockwise)) => self.arc(motion, block, calls),
            Some(motion @ (Motion::CubicSpline | Motion::QuadraticSpline)) => self.spline(motion, block, calls),
            Some(Motion::Nurbs) => self.nurbs_point(block),
            Some(Motion::NurbsEnd) => self.end_nurbs(block, calls),
            Some(Motion::NurbsKnot) => self.nurbs_knot(block, calls),
            Some(Motion::NurbsKnotEnd) => self.end_nurbs_knots(block),
            Some(Motion::SpindleSynchronised) => self.spindle_synchronised(block, calls),
            Some(Motion::RigidTap) => self.rigid_tap(block, calls),
            Some(Motion::Probe(mode)) => self.probe(mode, block, calls),
            Some(Motion::Thread) => self.thread(block, calls),
            Some(Motion::Cycle(cycle)) => self.cycle(cycle, block, calls),
            Some(Motion::Finish) => self.finish(block, calls),
            Some(Motion::Rough(roughing)) => self.rough(roughing, block, calls),
        }
    }

    /// Takes over the motion code of a line.
    fn change_motion(&mut self, motion: Option<Motion>, calls: &mut Calls) {
        if motion.is_none() {
            calls.push_back(Call::Comment("interpreter: motion mode set to none".into()));
        }
        if !matches!(motion, Some(Motion::Cycle(_))) {
            self.cycle.end_run();
        }
        if matches!(motion, Some(Motion::CubicSpline | Motion::QuadraticSpline)) {
            return; // for their line only
        }
        self.modal.motion = motion;
    }

    fn stop(&mut self, block: &Block, calls: &mut Calls) -> Result<Flow, Fault> {
        let Some(code) = block.codes.stop else {
            return Ok(Flow::On);
        };
        if matches!(code.value, Stop::Call | Stop::Return) && !self.settings.fanuc_subprograms {
            let word = if code.value == Stop::Call { "M98" } else { "M99" }.into();
            return Err((code.span, OWordError::FanucSubprogram { word }.into()));
        }
        if matches!(code.value, Stop::End | Stop::PalletEnd) {
            self.check_nurbs_closed(None).map_err(|kind| (code.span, kind))?;
        }
        match code.value {
            Stop::Program => calls.push_back(Call::ProgramStop),
            Stop::Optional => calls.push_back(Call::OptionalProgramStop),
            Stop::Pallet => calls.extend([Call::PalletShuttle, Call::ProgramStop]),
            Stop::End => {
                self.end_by_m2(calls);
                return Ok(Flow::End);
            }
            Stop::PalletEnd => {
                self.end_program(calls);
                calls.extend([Call::PalletShuttle, Call::ProgramEnd, Call::Reset, Call::Reset]);
                return Ok(Flow::End);
            }
            Stop::Call => {
                let program = block
                    .word_value(b'P')
                    .ok_or((code.span, OWordError::ProgramNumberMissing.into()))?;
                let integer = |letter: u8, value: f64| {
                    crate::code::integer_in(value, 0..=i64::from(u32::MAX))
                        .map(|integer| integer as u32)
                        .ok_or(block.span(letter).fault(ErrorKind::NotInteger {
                            letter: letter.into(),
                            value,
                        }))
                };
                let program = integer(b'P', program)?;
                let times = block.word_value(b'L').map_or(Ok(1), |times| integer(b'L', times))?;
                let span = block.span(b'P');
                return Ok(Flow::Call { program, times, span });
            }
            Stop::Return => return Ok(Flow::Return),
        }
        Ok(Flow::On)
    }

    /// M2, and M99 in the program itself.
    pub(crate) fn end_by_m2(&mut self, calls: &mut Calls) {
        self.end_program(calls);
        calls.extend([Call::ProgramEnd, Call::Reset, Call::Reset]);
    }

    /// What ends with every text: moves under it belong together.
    pub(crate) fn end_compensation(&mut self, calls: &mut Calls) {
        if self.compensation.cutter.take().is_some() {
            calls.push_back(Call::SetCutterCompensation(None));
        }
        if self.tool_centre_point {
            self.use_tool_frame(self.offsets.tool, false, calls);
        }
    }

    /// What M2 and M30 reset.
    fn end_program(&mut self, calls: &mut Calls) {
        self.end_compensation(calls);
        let mut offsets = self.offsets;
        offsets.system = 1;
        self.load_system(&mut offsets);
        self.set_offsets(offsets);
        calls.extend([self.g5x_call(), self.rotation_call()]);
        if self.modal.plane != Plane::Xy {
            calls.push_back(Call::SelectPlane(Plane::Xy));
            self.modal.plane = Plane::Xy;
        }
        self.end_feed(calls);
        self.end_overrides(calls);
        self.end_spindles(calls);
        self.end_coolant(calls);
        self.modal.distance = Distance::Absolute;
        self.modal.arc_distance = Distance::Incremental;
        self.modal.motion = Some(Motion::Feed);
    }
}
