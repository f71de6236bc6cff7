//! What the cycle thread tells, and what becomes of it: entries of the journal, alarms, warnings, marks for the operator's loop.
//!
//! In:  notices, in their order. Out: entries; what a program and the sequence of a job have to know.

use super::actions::done;
use super::*;
use hal_pins::Change;
use machine::faults::link_failed;

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
                self.log
                    .note(time_s, message!("machine.state", "machine {state}", state = state.message()));
                if before == State::Jogging && state == State::Ready {
                    self.note_jog(time_s);
                }
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
                    self.enter_silenced(cycle, self.names.silenced.clone());
                }
            }
            Notice::Fault { fault, first } => self.take_fault(time_s, &fault, first),
            Notice::Action(action) => {
                if let Action::ChangeTool { tool } = action {
                    self.tool_changes.under_way = Some(tool);
                }
                let text = match action {
                    Action::Message { number } => self.message(number).map(program_message),
                    _ => None,
                };
                self.log.note(time_s, text.unwrap_or_else(|| done(action)));
            }
            Notice::Obstructed(obstruction) => self.take_obstruction(time_s, obstruction),
            Notice::Logic { task, text } => {
                let text = self.endpoints.logic.text(task, text);
                self.log.note(time_s, program_message(text));
            }
            Notice::Touched => {
                let what = message!("jog.touched", "jog ended: the probe has touched something");
                self.log.note(time_s, what.clone());
                self.obstruction = Some(what);
            }
            Notice::NoWayBack => {
                let what = message!(
                    "return.failed",
                    "the machine did not come back to where the program is held: jog nearer to it, then isocnc resume"
                );
                self.log.note(time_s, warning(what.clone()));
                self.obstruction = Some(what);
            }
            Notice::SpindleHeld { line, share } => self.log.note(
                time_s,
                message!(
                    "sync.override_held",
                    "line {line}: spindle override held to {percent:.0} %: the axes cannot follow more in step with the spindle",
                    line = line,
                    percent = (share * 100.0).floor()
                ),
            ),
            Notice::InStep { line, report } => self.log.note(time_s, format!("line {line}: {report}").into()),
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
                    let what = message!(
                        "tool.change_stopped",
                        "stopped during the change to tool {tool}: {look}",
                        tool = tool,
                        look = look_at_tool()
                    );
                    self.log.note(time_s, warning(what));
                }
            }
        }
    }

    /// What was in the way of a jog.
    fn take_obstruction(&mut self, time_s: f64, Obstruction { joint, why }: Obstruction) {
        let why = match why {
            Obstacle::Travel => message!("jog.travel", "is at the end of its travel"),
            Obstacle::Speed => {
                message!(
                    "jog.speed",
                    "would have to be too fast: the place is near a singularity"
                )
            }
            Obstacle::Reach(why) => why.into(),
        };
        let what = message!(
            "jog.ended",
            "jog ended: {joint}: {why}",
            joint = self.names.joints[joint].clone(),
            why = why
        );
        self.log.note(time_s, what.clone());
        self.obstruction = Some(what);
    }

    fn take_fault(&mut self, time_s: f64, fault: &Fault, first: bool) {
        let node = |index: usize| Message::from(self.names.nodes[index].as_str());
        let joint = |index: usize| self.names.joints[index].clone();
        let desk = &self.endpoints.logic;
        let logic = |task: usize, text: Option<u32>| match text {
            Some(text) => desk.text(task, text),
            None => desk.file(task),
        };
        let external = |index: usize| self.names.external[index].clone();
        let cause = fault.message(node, joint, logic, external);
        if first {
            let record = self.fault_record(fault, true);
            self.note_alarm(time_s, cause, record);
        } else if fault.reaction() != Reaction::Count {
            self.warn(time_s, fault, cause);
        }
    }

    fn take_external(&mut self, time_s: f64, component: usize, change: Change, pid: u32) {
        let name = &self.names.external[component];
        let what = match change {
            Change::Attached => message!(
                "external.attached",
                "external component {name}: process {process} writes its outputs",
                name = name,
                process = pid
            ),
            Change::TakenOver => message!(
                "external.taken_over",
                "external component {name}: process {process} has taken over, its outputs went on",
                name = name,
                process = pid
            ),
            Change::Released => message!(
                "external.released",
                "external component {name}: given up by its process; its outputs have their safe values",
                name = name
            ),
            Change::Lost => message!(
                "external.lost",
                "external component {name}: its process does not renew its heartbeat; its outputs have their safe values",
                name = name
            ),
            Change::CutShort => message!(
                "external.cut_short",
                "external component {name}: its file was cut short; its outputs have their safe values",
                name = name
            ),
        };
        self.log.note(time_s, what);
    }

    fn fault_record(&mut self, fault: &Fault, first: bool) -> AlarmRecord {
        let mut record = self.alarm_record(fault.code(), fault.reaction(), first);
        record.joint = fault.joint();
        let of_joint = || fault.joint().and_then(|joint| self.names.drives.get(joint)?.clone());
        let of_node = fault.node().and_then(|node| self.names.nodes.get(node)).cloned();
        record.node = of_node.or_else(of_joint);
        record
    }

    fn warn(&mut self, time_s: f64, fault: &Fault, cause: Message) {
        let kind = Some((discriminant(fault), fault.input(), fault.external()));
        let Some(known) = self.warnings.iter_mut().find(|known| known.kind == kind) else {
            let alarm = Some(self.fault_record(fault, false));
            let more = More {
                alarm,
                ..More::default()
            };
            self.log.write(time_s, warning(cause.clone()), more);
            self.warnings.push(Warning {
                time_s,
                times: 1,
                cause,
                kind,
            });
            return;
        };
        known.times += 1;
        known.cause = cause;
        let times = known.times;
        if times == 10_u64.pow(times.ilog10()) {
            let what = message!(
                "warning.again",
                "warning, {times} times by now: {cause}",
                times = times,
                cause = known.cause.clone()
            );
            let alarm = Some(self.fault_record(fault, false));
            self.log.write(
                time_s,
                what,
                More {
                    alarm,
                    ..More::default()
                },
            );
        }
    }

    fn take_bus(&mut self, time_s: f64, event: BusEvent) {
        let what = match event {
            BusEvent::Network(_) if !self.names.has_network => return,
            BusEvent::Network(BusState::Down) => message!("network.down", "network down"),
            BusEvent::Network(BusState::Booting) => message!("network.booting", "network booting"),
            BusEvent::Network(BusState::Operational) => message!("network.operational", "network operational"),
            BusEvent::Identified(node) => {
                self.modules.present(node);
                message!("node.found", "{node} found", node = self.node(node))
            }
            BusEvent::WrongIdentity {
                node,
                object: (index, sub),
                expected,
                got,
            } => match Identity::of_object((index, sub), got) {
                Some(found) => self.modules.swapped(node, &found).into(),
                None => format!(
                    "{}: {index:04X}h:{sub} is {got:#010x}, the machine file wants {expected:#010x}",
                    self.names.nodes[node]
                )
                .into(),
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
            )
            .into(),
            BusEvent::WrongValue {
                node,
                object: (index, sub),
                expected,
                got,
            } => format!(
                "{}: {index:04X}h:{sub} is {got:#010x}, expected {expected:#010x}: it is another drive, or set otherwise, than its profile or the machine file says",
                self.names.nodes[node]
            )
            .into(),
            BusEvent::Missing(node) => self.modules.missing(node).into(),
            BusEvent::Stranger { id, identity } => self.modules.stranger(id, &identity).into(),
            BusEvent::BootFailed(node) => {
                message!(
                    "node.boot_failed",
                    "{node} did not come up in time, is booted again",
                    node = self.node(node)
                )
            }
            BusEvent::NodeUp(node) => {
                message!("node.operational", "{node} operational", node = self.node(node))
            }
            BusEvent::NodeLost(node) => message!("node.lost", "{node} lost", node = self.node(node)),
            BusEvent::NodeError { node, code } => message!(
                "node.error",
                "{node} reports error {number}",
                node = self.node(node),
                number = format!("{code:04X}h")
            ),
            BusEvent::ForeignMaster(sign) => sign.message(),
            BusEvent::LinkFailed(error) => link_failed(error),
            BusEvent::Remark(remark) => remark.text(&self.names.bus).into(),
        };
        self.log.note(time_s, what);
    }

    /// Name of a node.
    fn node(&self, node: usize) -> &str {
        &self.names.nodes[node]
    }

    /// Notes an override that has been turned, once it is not being turned any more.
    pub(super) fn note_overrides(&mut self) {
        for what in Overridden::ALL {
            let now = self.endpoints.live.overrides.percent(what);
            let [last, noted] = &mut self.overrides[what as usize];
            let rests = now == std::mem::replace(last, now);
            let from = *noted;
            if rests && now != std::mem::replace(noted, now) {
                let mut turned = match what {
                    Overridden::Feed => message!("override.feed", "feed override {percent} %", percent = now),
                    Overridden::Rapid => message!("override.rapid", "rapid override {percent} %", percent = now),
                    Overridden::Spindle => message!("override.spindle", "spindle override {percent} %", percent = now),
                };
                turned.params.insert("from".to_owned(), from.into());
                self.log.set_by(self.turned_by.clone());
                self.add_entry(turned);
                self.log.set_by(None);
            }
        }
    }

    /// Notes where a jog has led, unless that is next to where it began.
    fn note_jog(&mut self, time_s: f64) {
        let to = self.live().position;
        let from = std::mem::replace(&mut self.rested_at, to);
        self.log.set_by(self.jogged_by.take());
        for axis in self
            .axes
            .iter()
            .filter(|axis| (to[**axis] - from[**axis]).abs() >= JOG_TOLD)
        {
            let what = message!("changed.jog", "jog {axis}", axis = axis.letter().to_string());
            self.log.note(time_s, changed(what, from[*axis], to[*axis]));
        }
        self.log.set_by(None);
    }
}

/// Jogs from this length on are told, mm or degrees.
const JOG_TOLD: f64 = 1.0;

/// Something has another value than before; as many digits as matter at a machine.
pub(crate) fn changed(what: Message, from: f64, to: f64) -> Message {
    let [from, to] = [from, to].map(|value| (value * 1e4).round() / 1e4 + 0.0);
    message!("changed", "{what}: {from} -> {to}", what = what, from = from, to = to)
}

/// What a program tells the operator.
fn program_message(text: String) -> Message {
    message!("message", "message: {text}", text = text)
}
