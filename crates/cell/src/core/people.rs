//! What people ask, and what they are shown.
//!
//! In:  questions and orders of people. Out: answers, some of them once a control has answered.

use super::{Asked, Core, Machine, Outcome, QUICK, Reply, SLOW};
use crate::store::{OrderIs, Wish};
use cell_link::message::{Order, OrderState, Phase, Topic, Upload, Use, What, is_program};
use serde_json::{Value, json};

/// Entries of a journal in one answer.
const ENTRIES_MAX: u32 = 500;
/// Entries that somebody sees who names no number.
const LAST_ENTRIES: u32 = 100;

/// What somebody asks.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Ask {
    /// All machines.
    Machines,
    /// Inputs and outputs that the machine files name, of one machine or of all.
    Ports {
        /// Name of the machine.
        machine: Option<String>,
    },
    /// Says which class a machine is of.
    SetClass {
        /// Name of the machine.
        machine: String,
        /// Name of the class.
        class: String,
    },
    /// Takes a machine that is not reached off the list.
    Forget {
        /// Name of the machine.
        machine: String,
    },
    /// Sends a program to a machine.
    Upload {
        /// Name of the machine.
        machine: String,
        /// Name of the program.
        name: String,
        #[serde(skip)]
        /// Its content.
        content: Vec<u8>,
    },
    /// Runs a program that was sent.
    RunProgram {
        /// Name of the machine.
        machine: String,
        /// Name of the program.
        program: String,
    },
    /// Runs a line of MDI.
    Mdi {
        /// Name of the machine.
        machine: String,
        /// The line.
        line: String,
    },
    /// Holds what runs.
    Hold {
        /// Name of the machine.
        machine: String,
    },
    /// Gives up what runs.
    Stop {
        /// Name of the machine.
        machine: String,
    },
    /// A control tells what has happened; or somebody asks for that.
    Journal {
        /// Name of the machine.
        machine: String,
        /// Entries behind this number, the first 500 of them; without it, the last hundred.
        #[serde(default)]
        since: Option<u64>,
    },
    /// Orders of parts.
    Queue,
    /// Orders parts.
    Add {
        /// What is wanted.
        wish: Wish,
        #[serde(skip)]
        /// Its content.
        content: Vec<u8>,
    },
    /// No further part of an order is begun.
    Cancel {
        /// Number of the order.
        order: i64,
    },
    /// Tries a held order again.
    Resume {
        /// Number of the order.
        order: i64,
    },
    /// All that the page shows.
    Overview,
}

impl Core {
    /// The answer; or nothing that counts, where the reply is taken for later.
    pub(super) fn asked_by_people(
        &mut self,
        ask: Ask,
        reply: &mut Option<Reply>,
        now: f64,
    ) -> Outcome<Result<Value, String>> {
        let answer = match ask {
            Ask::Ports { machine } => self.ports(machine.as_deref()),
            Ask::Machines => Ok(json!({ "machines": self.shown_machines(now) })),
            Ask::SetClass { machine, class } => match self.store.set_class(&machine, &class)? {
                0 => Err(unknown(&machine)),
                _ => {
                    self.machines.entry(machine).or_default().class = class;
                    self.is_queue_due = true;
                    Ok(json!({}))
                }
            },
            Ask::Forget { machine } => self.forget_machine(&machine, now)?,
            Ask::Upload { machine, name, content } => {
                let upload = Upload::of(&name, &content);
                match upload.verify(&content).and_then(|()| self.there(&machine, now)) {
                    Ok(()) => {
                        self.store.add_program(&upload.sha256, &content)?;
                        self.upload(&machine, &upload, content, None, reply.take());
                        Ok(Value::Null)
                    }
                    Err(why) => Err(why),
                }
            }
            Ask::RunProgram { machine, program } => {
                let stored = self.store.stored(&machine, &program)?;
                let known = self.machines.get(&machine);
                let busy = known.and_then(|machine| machine.attempt.as_ref());
                let no_orders = known.and_then(|machine| machine.gets_no_orders(now));
                match (self.there(&machine, now), stored, no_orders, busy) {
                    (Err(why), ..) => Err(why),
                    (_, None, ..) => Err(format!(
                        "{machine} has no {program} from here: isocnc-cell upload {machine} FILE"
                    )),
                    (.., Some(why), _) => Err(format!("{machine}: {why}")),
                    (.., Some((attempt, _))) => Err(format!("{machine} has an order already: {}", attempt.id)),
                    (Ok(()), Some(sha256), None, None) => {
                        self.run(&machine, &program, &sha256, None, reply, now)?;
                        Ok(Value::Null)
                    }
                }
            }
            Ask::Mdi { machine, line } => {
                let known = self.machines.get(&machine);
                let busy = known.and_then(|machine| machine.attempt.as_ref());
                match (known.and_then(|machine| machine.gets_no_orders(now)), busy) {
                    (Some(why), _) => Err(format!("{machine}: {why}")),
                    (None, Some((attempt, _))) => Err(format!("{machine} has an order already: {}", attempt.id)),
                    (None, None) => self.pass(&machine, What::Mdi { line }, reply, now),
                }
            }
            Ask::Hold { machine } => self.pass(&machine, What::Hold, reply, now),
            Ask::Stop { machine } => self.pass(&machine, What::Stop, reply, now),
            Ask::Journal { machine, since } => match self.machines.contains_key(&machine) {
                true => {
                    let entries = match since {
                        Some(since) => self.store.journal(&machine, since, ENTRIES_MAX)?,
                        None => self.store.last_entries(&machine, LAST_ENTRIES)?,
                    };
                    Ok(json!({ "machine": machine, "entries": entries }))
                }
                false => Err(unknown(&machine)),
            },
            Ask::Queue => Ok(json!({ "orders": self.shown_orders()?, "attempts": self.store.history(50)? })),
            Ask::Add { wish, content } => match check(&wish) {
                Ok(()) => {
                    let upload = Upload::of(&wish.program, &content);
                    match upload.verify(&content) {
                        Ok(()) => {
                            self.store.add_program(&upload.sha256, &content)?;
                            let order = self.store.add_order(&wish, &upload.sha256, now)?;
                            self.is_queue_due = true;
                            Ok(json!({ "order": order }))
                        }
                        Err(why) => Err(why),
                    }
                }
                Err(why) => Err(why),
            },
            Ask::Cancel { order } => self.change(order, OrderIs::Cancelled, &[OrderIs::Open, OrderIs::Held])?,
            Ask::Resume { order } => self.change(order, OrderIs::Open, &[OrderIs::Held])?,
            Ask::Overview => Ok(self.overview(now)?),
        };
        Ok(answer)
    }

    fn change(&mut self, id: i64, to: OrderIs, from: &[OrderIs]) -> Outcome<Result<Value, String>> {
        let Some(order) = self.store.orders(false)?.into_iter().find(|order| order.id == id) else {
            return Ok(Err(format!("there is no order {id}: isocnc-cell queue")));
        };
        if !from.contains(&order.state) {
            return Ok(Err(format!("order {id} is {}", order.state.word())));
        }
        self.store.set_order(id, to, "")?;
        for machine in self.machines.values_mut() {
            machine.unfit.remove(&id);
        }
        self.is_queue_due = true;
        Ok(Ok(json!({ "order": id })))
    }

    /// What it was doing for an order counts as cut off: its part is made elsewhere.
    fn forget_machine(&mut self, name: &str, now: f64) -> Outcome<Result<Value, String>> {
        match self.machines.get(name) {
            None => return Ok(Err(unknown(name))),
            Some(machine) if machine.is_there(now) => {
                return Ok(Err(format!(
                    "{name} is reached, and would be back at once: end its control, or revoke its certificate first: \
                     isocnc-cell ca revoke {name} --dir CA"
                )));
            }
            Some(_) => {}
        }
        if let Some((attempt, _)) = self.machines.get(name).and_then(|machine| machine.attempt.clone()) {
            let cut_off = OrderState {
                id: attempt.id,
                phase: Phase::Interrupted,
                note: "the machine was taken off the list".into(),
                took_s: None,
            };
            self.attempt_is(name, &cut_off, now)?;
        }
        self.store.forget_machine(name)?;
        self.machines.remove(name);
        Ok(Ok(json!({ "machine": name })))
    }

    fn there(&self, name: &str, now: f64) -> Result<(), String> {
        match self.machines.get(name) {
            None => Err(unknown(name)),
            Some(machine) if machine.is_there(now) => Ok(()),
            Some(_) => Err(format!("{name} is not reached; it works on alone")),
        }
    }

    fn pass(&mut self, name: &str, what: What, reply: &mut Option<Reply>, now: f64) -> Result<Value, String> {
        self.there(name, now)?;
        if let Some(reply) = reply.take() {
            let id = (self.ids)();
            let (topic, wait, boot) = match what {
                What::Run { .. } | What::Mdi { .. } => {
                    (Topic::Run, SLOW, self.machines.get(name).and_then(Machine::boot))
                }
                // Whoever has the certificate holds and stops.
                What::Hold | What::Stop | What::Status => (Topic::Order, QUICK, None),
            };
            let payload = self.say(Order { id, what, boot });
            self.question(name, topic, payload, None, wait, Asked::Passing(name.to_owned(), reply));
        }
        Ok(Value::Null)
    }

    fn shown_orders(&self) -> Outcome<Vec<Value>> {
        let orders = self.store.orders(false)?;
        let shown = orders.into_iter().rev().take(200).map(|order| {
            let why: Vec<Value> = (self.machines.iter())
                .filter_map(|(name, machine)| {
                    let why = machine.unfit.get(&order.id).cloned().or(machine.lacks(&order))?;
                    Some(json!({ "machine": name, "why": why }))
                })
                .collect();
            let mut shown = json!(order);
            shown["unfit"] = json!(why);
            shown
        });
        Ok(shown.collect())
    }

    fn shown_machines(&self, now: f64) -> Vec<Value> {
        let mut all: Vec<(&String, &Machine)> = self.machines.iter().collect();
        all.sort_by_key(|(name, _)| *name);
        all.into_iter()
            .map(|(name, machine)| {
                json!({
                    "name": name,
                    "class": machine.class,
                    "alive": machine.is_there(now),
                    "silent_s": (machine.heard_s > 0.0).then(|| (now - machine.heard_s).max(0.0)),
                    "use": if machine.is_there(now) { machine.state.use_of_time() } else { Use::Unknown }.word(),
                    "state": machine.state,
                    "journal": machine.journal,
                    "attempt": machine.attempt.as_ref().map(|(attempt, _)| attempt),
                    "panel": machine.described["panel"],
                })
            })
            .collect()
    }

    fn ports(&self, machine: Option<&str>) -> Result<Value, String> {
        if let Some(name) = machine
            && !self.machines.contains_key(name)
        {
            return Err(unknown(name));
        }
        let mut all: Vec<_> = (self.machines.iter())
            .filter(|(name, _)| machine.is_none_or(|machine| machine == *name))
            .collect();
        all.sort_by_key(|(name, _)| *name);
        let ports = all.into_iter().flat_map(|(name, machine)| {
            let ports = machine.described["ports"].as_array().into_iter().flatten();
            ports.map(move |port| {
                let mut port = port.clone();
                port["machine"] = json!(name);
                port
            })
        });
        Ok(json!({ "ports": ports.take(PORTS_MAX).collect::<Vec<Value>>() }))
    }

    fn overview(&self, now: f64) -> Outcome<Value> {
        let day = (now / 86_400.0).floor() as i64;
        let alarms = self.store.alarms()?.into_iter().map(
            |(machine, seq, unix_s, text)| json!({ "machine": machine, "seq": seq, "unix_s": unix_s, "text": text }),
        );
        let times = self.store.times(day - 6)?.into_iter().map(
            |(machine, day, what, seconds)| json!({ "machine": machine, "day": day, "what": what, "seconds": seconds }),
        );
        let refusals = self.store.refusals(20)?.into_iter();
        Ok(json!({
            "unix_s": now,
            "machines": self.shown_machines(now),
            "alarms": alarms.collect::<Vec<Value>>(),
            "orders": self.shown_orders()?,
            "attempts": self.store.history(50)?,
            "times": times.collect::<Vec<Value>>(),
            "refusals": refusals.map(|(unix_s, text)| json!({ "unix_s": unix_s, "text": text })).collect::<Vec<Value>>(),
        }))
    }
}

/// Ports of one answer.
const PORTS_MAX: usize = 10_000;

fn unknown(machine: &str) -> String {
    format!("there is no machine {machine:?}: isocnc-cell machines")
}

/// Whether an order can be.
fn check(wish: &Wish) -> Result<(), String> {
    if !is_program(&wish.program) {
        return Err(format!("{:?} cannot name a program", wish.program));
    }
    if !(1..=100_000).contains(&wish.count) {
        return Err(format!("{} parts: 1 to 100000 can be ordered", wish.count));
    }
    let is_axis = |letter: char| "XYZABCUVW".contains(letter);
    if let Some(letter) = wish
        .axes
        .chars()
        .chain(wish.travel.iter().map(|(letter, _)| *letter))
        .find(|letter| !is_axis(*letter))
    {
        return Err(format!("{letter:?} is no axis: X Y Z A B C U V W"));
    }
    if let Some((letter, travel)) = wish.travel.iter().find(|(_, travel)| !(0.0..=1e6).contains(travel)) {
        return Err(format!("travel of {letter}: {travel} must be 0 to 1e6"));
    }
    Ok(())
}
