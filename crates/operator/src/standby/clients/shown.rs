//! How the machine is: for clients, and for the table of orders.

use super::executed::Executed;
use super::{Clients, Typed};
use crate::console::Operator;
use crate::standby::check::Part;
use crate::table_writer::Keeper;
use api::orders::{MESSAGES, Shown, ShownProgram, ShownText};
use config::BusKind;
use machine::permission::{Activity, Condition, Power, Wish, permit};
use machine::sequence::{Outcome, Step};
use machine::state::State;
use machine::tables::lock;
use motion::canon::Axis;
use program::{Overview, modes_at_start};
use protocol::Waiting;
use std::sync::Arc;

impl Clients<'_, '_> {
    /// How the machine is, for the table of orders.
    pub(super) fn condition(&self, operator: &Operator) -> Condition {
        let live = operator.live();
        let (step, state) = (operator.step(), live.state);
        let power = match state {
            State::Booting => Power::Starting,
            State::Disabled => Power::Off,
            State::Enabling | State::Disabling => Power::Switching,
            State::Faulted => Power::Alarm,
            State::Estop if live.chain_open => Power::EstopOpen,
            State::Estop => Power::Estop,
            State::Ready
            | State::Homing
            | State::Jogging
            | State::Running
            | State::Held
            | State::Away
            | State::Returning
            | State::Stopping => Power::On,
            State::ShuttingDown | State::Down | State::Silenced => Power::Ending,
        };
        let is_checked = self.checking.is_some();
        let activity = match (step, state) {
            (_, State::Held) => Activity::Held,
            (_, State::Away) => Activity::Away,
            (_, State::Returning) => Activity::Returning,
            (Step::Stop, _) | (_, State::Stopping) => Activity::Stopping,
            (Step::Home, _) | (_, State::Homing) => Activity::Homing,
            (Step::Program, _) | (_, State::Running) => Activity::Running,
            (_, State::Jogging) => Activity::Jogging,
            _ if is_checked => Activity::Checking,
            // What is left of the last program is being put away, or an order has yet to be taken.
            (Step::StandBy, _) if self.is_planning || !operator.is_up_to_date() => Activity::Stopping,
            (Step::StandBy, _) => Activity::Idle,
            (Step::Network | Step::Enable | Step::Disable | Step::ShutDown | Step::Done, _) => Activity::Idle,
        };
        let power = match (step, power) {
            (Step::Enable | Step::Disable, Power::Off | Power::On) => Power::Switching,
            (_, power) => power,
        };
        Condition {
            stands_by: self.stands_by,
            power,
            network: self.config.bus.kind != BusKind::None,
            homed: operator.not_homed() == 0,
            on_limit: live.limits != [0; 2],
            activity,
            loaded: self.loaded.is_some(),
        }
    }

    /// `is_settled`: the last job has ended, and what came of it is on the disk.
    pub(super) fn shown(&mut self, operator: &Operator, keeper: &Keeper<'_, '_>, is_settled: bool) -> Shown {
        let in_force = self.in_force();
        let condition = self.condition(operator);
        let live = operator.live();
        // What was loaded last is what a start begins: it is shown from then on, and how it was begun while it runs.
        let under_way = self
            .part
            .as_ref()
            .filter(|part| !part.is_mdi() && operator.has_program());
        let program = under_way.or(self.loaded.as_ref());
        let has_run = |part: &Arc<Part>| self.part.as_ref().is_some_and(|last| last.revision == part.revision);
        let last = operator.program_outcome().filter(|_| !operator.has_program());
        let is_under_way = operator.step() == Step::Program;
        let dry_run = self.part.as_ref().is_some_and(|part| part.dry_feed_min().is_some());
        let revision = program.map_or(0, |part| part.revision);
        let shown_program = |name: &str, overview: &Overview, is_last: bool| ShownProgram {
            dry_run: dry_run && is_last,
            name: name.to_owned(),
            revision,
            lines: overview.lines,
            planned_time_s: overview.time_s,
            tools: overview.tools.clone(),
            outline: Some(overview.outline.clone()).filter(|_| is_last && is_under_way),
            result: last.filter(|_| is_last).map(Outcome::code),
        };
        let mut mdi = Vec::new();
        let line = self
            .part
            .as_ref()
            .filter(|part| part.is_mdi() && operator.has_program());
        mdi.extend(line.map(|part| part.line.clone()));
        mdi.extend(self.mdi.iter().map(|(_, typed, _)| match typed {
            Typed::Line(line) => line.clone(),
            Typed::Lines(lines, _) => lines.lines().next().unwrap_or_default().to_owned(),
        }));
        let (block_delete, tool) = {
            let tables = lock(self.tables);
            (tables.block_delete, tables.tool_in_spindle())
        };
        Shown {
            step: operator.step_code(),
            power: condition.power,
            activity: condition.activity,
            mode: self.mode,
            program: match (program, self.given) {
                (Some(part), _) => Some(shown_program(&part.name, &part.overview, has_run(part))),
                (None, Some((name, overview))) => Some(shown_program(name, overview, true)),
                (None, None) => None,
            },
            text: program.map(|part| ShownText {
                revision: part.revision,
                text: Arc::clone(&part.text),
            }),
            job: operator.job_outcome().filter(|_| is_settled).map(Outcome::code),
            mdi,
            waiting: live.waiting.map(|waiting| Waiting {
                r#for: waiting.code(),
                what: waiting.message(),
                release: waiting.release(),
            }),
            codes: in_force.codes,
            work_offset: in_force.work_offset,
            work_rotation_degrees: in_force.work_rotation_degrees,
            next: permit(Wish::Start, &condition).err().map(|refusal| refusal.next),
            block_delete,
            tool,
            alarm: operator.alarm().map(|alarm| alarm.cause.clone()),
            alarms: operator.unacknowledged().take(MESSAGES).cloned().collect(),
            obstruction: operator.obstruction().cloned(),
            messages: operator.journal().iter().rev().take(MESSAGES).rev().cloned().collect(),
            parts: keeper.memory.now().parts,
            runs_left: operator.runs_left(),
            last_program: keeper.memory.now().program.clone(),
        }
    }

    /// What is in force: of what runs, at the block that is executed; else for the next line of MDI, with the tables as they are.
    fn in_force(&mut self) -> ShownModes {
        if let Some(executed) = self.executed.as_ref().and_then(Executed::now) {
            return ShownModes {
                codes: executed.words(),
                work_offset: executed.work_zero().0.to_vec(),
                work_rotation_degrees: executed.work_rotation_degrees(),
            };
        }
        let tables = lock(self.tables);
        let modes = match &self.modes {
            Some(modes) => &**modes,
            None => {
                let initial = match self.initial.take() {
                    Some(initial) if initial.0 == *tables => initial,
                    _ => (tables.clone(), modes_at_start(self.config, &tables)),
                };
                &self.initial.insert(initial).1
            }
        };
        let work_rotation_degrees = tables.work_rotation_degrees();
        let [origin, mut g92] = tables.work_offset(self.config.unit);
        // Of a system that is turned, G92 is turned with it.
        let (sin, cos) = work_rotation_degrees.to_radians().sin_cos();
        (g92.0[0], g92.0[1]) = (g92.0[0] * cos - g92.0[1] * sin, g92.0[0] * sin + g92.0[1] * cos);
        let tool = modes.tool_offset().unwrap_or_default();
        ShownModes {
            codes: modes.words(),
            work_offset: Axis::ALL.map(|axis| origin[axis] + g92[axis] + tool[axis]).to_vec(),
            work_rotation_degrees,
        }
    }
}

/// What is in force, as clients see it: fields of [`Shown`].
struct ShownModes {
    codes: Vec<String>,
    work_offset: Vec<f64>,
    work_rotation_degrees: f64,
}
