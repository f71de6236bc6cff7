//! What a cycle tells everyone else: pins, the latest values, a record for the trace, notices.

use super::*;
use crate::desk::ProgramState;

impl MotionController<dyn CyclicBus + '_> {
    /// Tells everyone else what happened.
    pub(super) fn show(&mut self) {
        let parts = &mut self.parts;
        parts
            .pins
            .publish(&self.bus, &parts.drives, &self.sample, self.state, self.fault_seen);
        let program = match &self.program {
            Some(run) if !run.is_mdi => match self.state {
                State::Running if run.waiting != Some(Action::ProgramStop) => ProgramState::Running,
                _ => ProgramState::Paused,
            },
            _ => ProgramState::Idle,
        };
        let pumps = [parts.program_outputs.has_flood(), parts.program_outputs.has_mist()];
        parts.desk.show(program, pumps);
        parts.nodes.publish(&self.bus);
        parts.estop.show(self.state);
        for (joint, drive) in parts.drives.iter().enumerate() {
            self.outlets.live.show_place(joint, drive.place());
        }
        let in_position = self.at_rest();
        self.parts.pins.show_in_position(in_position);
        self.outlets.live.show(&self.snapshot());
        if let Some(run) = &self.program {
            let phase = match self.sample.state {
                _ if run.away_from.is_some() || self.state == State::Held => Phase::Hold,
                SampleState::Moving if self.sample.rapid => Phase::Rapid,
                SampleState::Moving => Phase::Cut,
                _ => Phase::Wait,
            };
            self.outlets.live.count_phase(phase);
            if run.away_from.is_none() {
                self.outlets.trace(self.trace_of(run));
            }
        }
    }

    fn snapshot(&self) -> Snapshot {
        let run = self.program.as_ref();
        Snapshot {
            state: self.state,
            enables: self.sample.enables,
            orders_taken: self.orders_taken,
            cycles: self.cycle,
            homed: self.homed(),
            line: self.sample.line,
            modes: self.sample.modes,
            reversing: run.is_some_and(|run| run.reverse.is_some()),
            single_block: self.single_block,
            optional_stop: self.parts.desk.stops_optionally(),
            velocity_mm_s: self.sample.velocity_mm_s,
            position: self.sample.position,
            late_max_ns: self.late_max_ns,
            cycles_skipped: self.cycles_skipped,
            remaining_s: run.map_or(0.0, |run| run.program.remaining_s()),
            way: run.map_or(0.0, |run| run.program.way()),
            elapsed_s: run.map_or(0.0, |run| run.cycles as f64 * self.parts.cycle_s),
            waiting: self.waits_for(),
            switched_off: self.switched_off,
            spindle_on: self.parts.spindles.first.commanded().is_some(),
            jog_barred: self.is_jog_barred(),
            chain_open: self.chain_opened_by().is_some(),
            held_at: run.and_then(|run| run.away_from).map(|place| place.axes),
            piece_end: run.and_then(|run| run.program.piece_end()),
            limits: self.limits,
        }
    }

    fn trace_of(&self, run: &Run) -> Trace {
        let drives = &self.parts.drives;
        let errors_mm = drives.iter().map(|drive| drive.following_error_mm().abs());
        Trace {
            cycle: self.cycle,
            command: self.sample.position,
            actual: drives.measured(&self.parts.kinematics, &self.sample),
            line: self.sample.line,
            rapid: self.sample.rapid,
            following_error_mm: errors_mm.fold(0.0, f64::max),
            starved: run.has_moved && self.sample.state == SampleState::Starved,
            joint: drives.trace(self.outlets.live.traced_joint()),
        }
    }

    /// What the program waits for.
    pub(super) fn waits_for(&self) -> Option<Waiting> {
        self.program.as_ref()?.waits_for(self.state, &self.sample)
    }

    pub(super) fn notice(&mut self, notice: Notice) {
        self.outlets.notice(self.cycle, notice);
    }
}
