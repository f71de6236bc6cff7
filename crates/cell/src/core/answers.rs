//! What controls answer, and what becomes of it.

use super::{Asked, Core, NO_ANSWER, Outcome, REST_S};
use cell_link::message::{Envelope, OrderState, Phase, Stored};
use serde_json::{Value, json};

impl Core {
    pub(super) fn answer(&mut self, ticket: u64, answer: Result<Vec<u8>, String>, now: f64) -> Outcome<()> {
        fn read<B: serde::de::DeserializeOwned>(answer: Result<Vec<u8>, String>) -> Result<B, String> {
            let envelope = Envelope::from_octets(&answer?).map_err(|bad| bad.to_string())?;
            Ok(envelope.body)
        }
        let Some((asked, _)) = self.asked.remove(&ticket) else {
            return Ok(());
        };
        match asked {
            Asked::Journal(name) => {
                if let Some(machine) = self.machines.get_mut(&name) {
                    machine.is_asked_journal = false;
                }
                match read(answer) {
                    Ok(journal) => self.journal(&name, &journal)?,
                    Err(why) => tracing::debug!("{name}: journal: {why}"),
                }
            }
            Asked::Described(name) => match read::<Value>(answer) {
                Ok(described) => {
                    self.store.set_described(&name, &described)?;
                    if let Some(machine) = self.machines.get_mut(&name) {
                        machine.described = described;
                        machine.unfit.clear();
                    }
                    self.is_queue_due = true;
                }
                Err(why) => {
                    tracing::debug!("{name}: description: {why}");
                    if let Some(machine) = self.machines.get_mut(&name) {
                        machine.is_asked_described = false;
                    }
                }
            },
            Asked::Upload {
                machine,
                name,
                sha256,
                order,
                reply,
            } => {
                let outlook = read::<Stored>(answer).map(|stored| stored.outlook);
                if let Some(known) = self.machines.get_mut(&machine) {
                    known.uploads = known.uploads.saturating_sub(1);
                    match (&outlook, order) {
                        (Ok(Err(why)), Some(order)) => _ = known.unfit.insert(order, why.clone()),
                        (Err(_), Some(_)) => known.rests_until_s = now + REST_S,
                        _ => {}
                    }
                }
                let outlook = outlook.and_then(|outlook| outlook);
                if outlook.is_ok() {
                    self.store.set_stored(&machine, &name, Some(&sha256))?;
                }
                self.is_queue_due = true;
                if let Some(reply) = reply {
                    let answer = outlook.map_err(|why| in_words(&machine, why)).map(
                        |outlook| json!({ "machine": machine, "program": name, "sha256": sha256, "outlook": outlook }),
                    );
                    self.replies.push((reply, answer));
                }
            }
            Asked::Attempt(machine, id, reply) => {
                let state = read::<OrderState>(answer);
                if let Ok(state) = &state {
                    let unknown = state.phase == Phase::Unknown && state.id == id;
                    let is_cancelled = unknown && !self.is_wanted(&id)?;
                    match is_cancelled {
                        // It never came there, and nobody wants it any more.
                        true => {
                            let never = OrderState {
                                phase: Phase::Refused,
                                note: "cancelled before it was sent".into(),
                                ..state.clone()
                            };
                            self.attempt_is(&machine, &never, now)?;
                        }
                        false => self.attempt_is(&machine, state, now)?,
                    }
                }
                if let Some(reply) = reply {
                    let answer = match state {
                        Ok(state) if state.phase == Phase::Refused => Err(format!("{machine} refuses: {}", state.note)),
                        Ok(state) => Ok(json!({ "id": state.id, "phase": state.phase, "note": state.note })),
                        Err(why) => Err(format!(
                            "{machine} has not answered ({why}); the order stands, as {id}: isocnc-cell queue"
                        )),
                    };
                    self.replies.push((reply, answer));
                }
            }
            Asked::Passing(machine, reply) => {
                let state = read::<OrderState>(answer).map_err(|why| in_words(&machine, why));
                let answer = state.and_then(|state| match state.phase {
                    Phase::Completed => Ok(json!({})),
                    _ => Err(state.note),
                });
                self.replies.push((reply, answer));
            }
        }
        Ok(())
    }
}

/// Why an order of people came to nothing.
fn in_words(machine: &str, why: String) -> String {
    match why == NO_ANSWER {
        true => format!(
            "{machine} has not answered, and may not have got it: isocnc-cell machines tells whether it is reached"
        ),
        false => why,
    }
}
