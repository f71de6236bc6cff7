//! What the cycle thread tells, and what becomes of it: entries of the journal, alarms, warnings, marks for the operator's loop.
//!
//! In:  notices, in their order. Out: entries; what a program and the sequence of a job have to know.

use super::*;
use hal_pins::Change;

impl Operator {
    pub(super) fn apply_notice(&mut self, TimedNotice { cycle, notice }: TimedNotice) {
        let time_s = cycle as f64 * self.cycle_s;
        match notice {
            Notice::State(state) => {
                let before = std::mem::replace(&mut self.state, state);
                // However that came: by an order, a pin, a latch in the chain.
                if before == State::Estop && state == State::Disabling {
                    self.take_for_acknowledged("estop reset");
                }
                if state == State::Disabled && self.operational_s.is_none() {
                    self.operational_s = Some(time_s);
                }
                if state == State::Stopping {
                    self.sequence.stopped();
                }
                self.log.note(time_s, format!("machine {}", state.name()));
            }
            Notice::Bus(event) => self.take_bus(time_s, event),
            Notice::Fault {
                fault: Fault::CyclesSkipped { cycles },
                ..
            } => self.lateness.cycles += cycles,
            // The time-out thread says more of it, and may have said it already.
            Notice::Fault {
                fault: Fault::CycleHung,
                ..
            } => {
                if !self.needs_restart {
                    self.enter_silenced(cycle, self.names.silenced.into());
                }
            }
            Notice::Fault { fault, first } => self.take_fault(time_s, &fault, first),
            Notice::Action(action) => {
                if let Action::ChangeTool { tool } = action {
                    self.tool_changes.under_way = Some(tool);
                }
                let text = match action {
                    Action::Message { number } => self.message(number).map(|text| format!("message: {text}")),
                    _ => None,
                };
                self.log.note(time_s, text.unwrap_or_else(|| format!("program: {action}")));
            }
            Notice::Obstructed(Obstruction { joint, why }) => {
                let why = match why {
                    Obstacle::Travel => "is at the end of its travel",
                    Obstacle::Speed => "would have to be too fast: the place is near a singularity",
                    Obstacle::Reach(why) => why,
                };
                let text = format!("jog ended: {}: {why}", self.names.joints[joint]);
                self.log.note(time_s, text.clone());
                self.obstruction = Some(text);
            }
            Notice::Logic { task, text } => {
                let text = self.endpoints.logic.text(task, text);
                self.log.note(time_s, format!("message: {text}"));
            }
            Notice::Touched => {
                let what = "jog ended: the probe has touched something";
                self.obstruction = Some(what.into());
                self.log.note(time_s, what.into());
            }
            Notice::NoWayBack => {
                let what = "the machine did not come back to where the program is held: jog nearer to it, then isocnc resume";
                self.obstruction = Some(what.into());
                self.log.note(time_s, format!("warning: {what}"));
            }
            Notice::SpindleHeld { line, share } => self.log.note(
                time_s,
                format!(
                    "line {line}: spindle override held to {:.0} %: the axes cannot follow more in step with the spindle",
                    (share * 100.0).floor()
                ),
            ),
            Notice::InStep { line, report } => self.log.note(time_s, format!("line {line}: {report}")),
            Notice::ToolChanged { tool } => {
                self.tool_changes.under_way = None;
                self.tool_changes.done.push(tool);
            }
            Notice::External { component, change, pid } => self.take_external(time_s, component, change, pid),
            Notice::StopPressed => self.signals.stop_pressed = true,
            // What the order itself has begun to stop is not stopped twice: what was ordered behind it may begin.
            Notice::StopTaken => {
                self.signals.stop_pressed |= matches!(
                    self.sequence.step(),
                    Step::Network | Step::Enable | Step::Home | Step::Program
                );
            }
            Notice::NotBegun => self.signals.not_begun = true,
            Notice::ProgramEnded => {
                self.signals.program_ended = true;
                if let Some(tool) = self.tool_changes.under_way.take() {
                    let what = format!("warning: stopped during the change to tool {tool}: {}", LOOK_AT_TOOL);
                    self.log.note(time_s, what);
                }
            }
        }
    }

    fn take_fault(&mut self, time_s: f64, fault: &Fault, first: bool) {
        let node = |index: usize| self.names.nodes[index].clone();
        let joint = |index: usize| self.names.joints[index].clone();
        let desk = &self.endpoints.logic;
        let logic = |task: usize, text: Option<u32>| match text {
            Some(text) => desk.text(task, text),
            None => desk.file(task),
        };
        let external = |index: usize| self.names.external[index].clone();
        let cause = fault.text(node, joint, logic, external);
        if first {
            let record = self.fault_record(fault, true);
            self.note_alarm(time_s, cause, record);
        } else if fault.reaction() != Reaction::Count {
            self.warn(time_s, fault, cause);
        }
    }

    fn take_external(&mut self, time_s: f64, component: usize, change: Change, pid: u32) {
        let name = &self.names.external[component];
        let text = match change {
            Change::Attached => format!("process {pid} writes its outputs"),
            Change::TakenOver => format!("process {pid} has taken over, its outputs went on"),
            Change::Released => "given up by its process; its outputs have their safe values".into(),
            Change::Lost => "its process does not renew its heartbeat; its outputs have their safe values".into(),
            Change::CutShort => "its file was cut short; its outputs have their safe values".into(),
        };
        self.log.note(time_s, format!("external component {name}: {text}"));
    }

    fn fault_record(&mut self, fault: &Fault, first: bool) -> AlarmRecord {
        let mut record = self.alarm_record(fault.code(), fault.reaction(), first);
        record.joint = fault.joint();
        let of_joint = || fault.joint().and_then(|joint| self.names.drives.get(joint)?.clone());
        let of_node = fault.node().and_then(|node| self.names.nodes.get(node)).cloned();
        record.node = of_node.or_else(of_joint);
        record
    }

    fn warn(&mut self, time_s: f64, fault: &Fault, cause: String) {
        let kind = Some((discriminant(fault), fault.input(), fault.external()));
        let Some(warning) = self.warnings.iter_mut().find(|warning| warning.kind == kind) else {
            let alarm = Some(self.fault_record(fault, false));
            let more = More {
                alarm,
                ..More::default()
            };
            self.log.write(time_s, format!("warning: {cause}"), more);
            self.warnings.push(Warning {
                time_s,
                times: 1,
                cause,
                kind,
            });
            return;
        };
        warning.times += 1;
        warning.cause = cause;
        let times = warning.times;
        if times == 10_u64.pow(times.ilog10()) {
            let text = format!("warning, {times} times by now: {}", warning.cause);
            let alarm = Some(self.fault_record(fault, false));
            self.log.write(
                time_s,
                text,
                More {
                    alarm,
                    ..More::default()
                },
            );
        }
    }

    fn take_bus(&mut self, time_s: f64, event: BusEvent) {
        let text = match event {
            BusEvent::Network(_) if !self.names.has_network => return,
            BusEvent::Network(BusState::Down) => "network down".into(),
            BusEvent::Network(BusState::Booting) => "network booting".into(),
            BusEvent::Network(BusState::Operational) => "network operational".into(),
            BusEvent::Identified(node) => {
                self.modules.present(node);
                format!("{} found", self.names.nodes[node])
            }
            BusEvent::WrongIdentity {
                node,
                object: (index, sub),
                expected,
                got,
            } => match Identity::of_object((index, sub), got) {
                Some(found) => self.modules.swapped(node, &found),
                None => format!(
                    "{}: {index:04X}h:{sub} is {got:#010x}, the machine file wants {expected:#010x}",
                    self.names.nodes[node]
                ),
            },
            BusEvent::ConfigurationRefused {
                node,
                object: (index, sub),
                abort,
            } => format!(
                "{}: refuses {index:04X}h:{sub} with SDO abort {:08X}h: {}",
                self.names.nodes[node],
                abort.0,
                abort.text()
            ),
            BusEvent::WrongValue {
                node,
                object: (index, sub),
                expected,
                got,
            } => format!(
                "{}: {index:04X}h:{sub} is {got:#010x}, expected {expected:#010x}: it is another drive, or set otherwise, than its profile or the machine file says",
                self.names.nodes[node]
            ),
            BusEvent::Missing(node) => self.modules.missing(node),
            BusEvent::Stranger { id, identity } => self.modules.stranger(id, &identity),
            BusEvent::BootFailed(node) => {
                format!("{} did not come up in time, is booted again", self.names.nodes[node])
            }
            BusEvent::NodeUp(node) => {
                format!("{} operational", self.names.nodes[node])
            }
            BusEvent::NodeLost(node) => format!("{} lost", self.names.nodes[node]),
            BusEvent::NodeError { node, code } => format!("{} reports error {code:04X}h", self.names.nodes[node]),
            BusEvent::ForeignMaster(sign) => sign.to_string(),
            BusEvent::LinkFailed(error) => format!("network adapter: {error}"),
            BusEvent::Remark(remark) => remark.text(&self.names.bus),
        };
        self.log.note(time_s, text);
    }

    /// Notes an override that has been turned, once it is not being turned any more.
    pub(super) fn note_overrides(&mut self) {
        for what in Overridden::ALL {
            let now = self.endpoints.live.overrides.percent(what);
            let [last, noted] = &mut self.overrides[what as usize];
            let rests = now == std::mem::replace(last, now);
            if rests && now != std::mem::replace(noted, now) {
                self.add_entry(format!("{} override {now} %", what.name()));
            }
        }
    }
}
