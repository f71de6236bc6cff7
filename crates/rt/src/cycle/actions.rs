//! What a program wants beside motion: tools, spindles, coolant, inputs and outputs, stops.
//!
//! In:  actions of the program. Out: what the parts are told; whether the program may go on.

use super::*;

impl MotionController<dyn CyclicBus + '_> {
    /// Does what a block without motion asks for.
    pub(super) fn begin_action(&mut self, action: Action) {
        let parts = &mut self.parts;
        match action {
            Action::SpindleOn {
                rpm,
                direction,
                surface,
            } => parts.spindles.first.command(rpm, direction, surface),
            Action::SpindleOff => parts.spindles.first.stop(),
            Action::OrientSpindle { degrees, direction } => parts.spindles.first.orient(degrees, direction),
            Action::AwaitOriented { timeout_s } => parts.spindles.first.await_oriented(timeout_s),
            Action::TurnSpindle { spindle, rpm } => parts.spindles.turn(spindle, rpm),
            Action::Mist(on) => parts.program_outputs.set_mist(on),
            Action::Flood(on) => parts.program_outputs.set_flood(on),
            Action::SelectTool { tool } => parts.changer.prepare(tool, self.outlets.live.pockets.pocket(tool)),
            Action::SetTool { tool } => parts.changer.set_tool(tool),
            Action::ChangeTool { .. } => parts.changer.begin_change(),
            Action::SetDigital { index, on } => parts.program_outputs.set_digital(index, on),
            Action::SetAnalog { index, value } => parts.program_outputs.set_analog(index, value),
            Action::AwaitInput { input, mode, timeout_s } => parts.program_inputs.await_input(input, mode, timeout_s),
            Action::ProgramEnd => parts.all_off(),
            Action::AwaitSpindle
            | Action::UserCode { .. }
            | Action::ProgramStop
            | Action::OptionalStop
            | Action::TextEnd
            | Action::Modes { .. }
            | Action::Message { .. } => {}
        }
    }

    /// A program has reached an action: nothing goes on before it is done.
    pub(super) fn reach_action(&mut self, action: Action) {
        if let Some(run) = &mut self.program {
            // The switch counts as M1 is reached: what waits then waits until somebody resumes.
            run.waiting = Some(match action {
                Action::OptionalStop if self.parts.desk.stops_optionally() => Action::ProgramStop,
                action => action,
            });
            if let Action::UserCode { .. } = action {
                run.program.answer(Answer::Reached);
            }
        }
        self.notice(Notice::Action(action));
        self.begin_action(action);
    }

    /// Lets the program go on behind an action that is done, and says what one that is not waits for too long.
    pub(super) fn see_action(&mut self) {
        let Some(run) = &mut self.program else { return };
        let has_more = run.program.has_more();
        let is_done =
            |action: &Action| self.parts.is_done(*action) || matches!(action, Action::UserCode { .. }) && has_more;
        match run.waiting.filter(is_done) {
            Some(Action::ChangeTool { tool } | Action::SetTool { tool }) => self.tool_is_changed(tool),
            Some(Action::AwaitInput { .. }) => {
                run.program.answer(Answer::Input(self.parts.program_inputs.read()));
                run.end_wait();
            }
            Some(_) => run.end_wait(),
            None => {
                if let Some(late) = self.parts.spindles.late() {
                    self.fault(Fault::SpindleLate { late });
                } else if let Some(failure) = self.parts.spindles.first.orient_failure() {
                    self.fault(Fault::SpindleOrient { failure });
                }
            }
        }
    }

    pub(super) fn tool_is_changed(&mut self, tool: u32) {
        self.outlets.live.set_tool(tool);
        self.notice(Notice::ToolChanged { tool });
        if let Some(run) = &mut self.program {
            run.end_wait();
        }
    }

    /// What the program waits for is given up.
    pub(super) fn skip(&mut self) {
        let Some(run) = &mut self.program else { return };
        match run.waiting {
            // As if its time had run out.
            Some(Action::AwaitInput { .. }) => {
                run.program.answer(Answer::Input(None));
                run.end_wait();
            }
            Some(Action::ProgramStop | Action::OptionalStop) => run.end_wait(),
            None => run.program.skip_dwell(),
            Some(_) => {}
        }
    }

    /// Spindle and coolant off, and whoever goes by what lines of MDI have switched on hears of it.
    pub(super) fn all_off(&mut self) {
        self.parts.all_off();
        self.switched_off += 1;
    }
}

impl CycleParts {
    /// Whether the program may go on behind an action; once in every cycle of it.
    fn is_done(&mut self, action: Action) -> bool {
        match action {
            Action::ChangeTool { tool } => self.changer.is_changed(tool),
            Action::AwaitSpindle => self.spindles.first.is_at_speed(),
            Action::AwaitOriented { .. } => self.spindles.first.is_oriented(),
            Action::TurnSpindle { spindle, .. } => self.spindles.is_at_speed(spindle),
            // More of the plan says when.
            Action::UserCode { .. } => false,
            Action::AwaitInput { .. } => self.program_inputs.is_over(),
            // The operator says when.
            Action::ProgramStop => false,
            // The switch for optional stops is off.
            Action::OptionalStop => true,
            Action::SpindleOn { .. }
            | Action::SpindleOff
            | Action::OrientSpindle { .. }
            | Action::Mist(_)
            | Action::Flood(_)
            | Action::SelectTool { .. }
            | Action::SetTool { .. }
            | Action::SetDigital { .. }
            | Action::SetAnalog { .. }
            | Action::ProgramEnd
            | Action::TextEnd
            | Action::Modes { .. }
            | Action::Message { .. } => true,
        }
    }

    /// Spindles and coolant off. The outputs of programs keep what they have, as in LinuxCNC.
    fn all_off(&mut self) {
        self.spindles.stop();
        self.program_outputs.set_mist(false);
        self.program_outputs.set_flood(false);
        self.changer.end();
    }
}
