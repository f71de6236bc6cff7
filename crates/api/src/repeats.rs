//! Orders that carry an id: an order that comes twice is carried out once, and both get the same answer.
//!
//! In:  ids and orders as they come, answers as they are given. Out: whether an order is new, or what the first of its id came to.
//!
//! A client that has lost its connection cannot know whether its last order arrived: it asks again with the same id. An order whose
//! client has gone before it began does not begin (nothing starts by a reconnect); its id says so from then on.

use super::rpc::{Params, RpcError, code};
use super::server::Ticket;
use protocol::limits::{ID_MAX, REQUEST_ID};
use serde_json::Value;
use sha2::{Digest, Sha256};
use std::collections::{HashMap, VecDeque};

/// An id is remembered for so long, s.
pub const REMEMBERED_S: u64 = 600;
/// Ids that are remembered at the most: as many orders as hands can give.
pub const IDS_MAX: usize = 16_384;

type Answer = Result<Value, RpcError>;

#[derive(Debug)]
struct Known {
    /// Digest of method and parameters.
    what: [u8; 32],
    /// Of the first order.
    ticket: Ticket,
    /// Who else waits for its answer.
    also: Vec<Ticket>,
    answer: Option<Answer>,
}

/// What an order with an id is.
#[derive(Debug, PartialEq)]
pub enum Seen {
    /// It has not come before: to be carried out, and its answer told.
    New,
    /// It has, and this is what it came to.
    Answered(Answer),
    /// It has, and is under way: its answer goes to this ticket, too.
    UnderWay,
}

/// Orders of the last [`REMEMBERED_S`].
#[derive(Debug, Default)]
pub struct Repeats {
    known: HashMap<String, Known>,
    /// Ids by the time of their first order, ns.
    order: VecDeque<(u64, String)>,
    /// Ids of orders under way.
    under_way: HashMap<Ticket, String>,
    /// Answers for those who asked again.
    ready: Vec<(Ticket, Answer)>,
}

/// The id of an order, if it has one.
///
/// # Errors
/// It is none.
pub fn id(params: &Params) -> Result<Option<&str>, RpcError> {
    let id = params.text(REQUEST_ID)?;
    match id {
        Some(id) if id.is_empty() || id.len() > ID_MAX => {
            let what = format!("parameter \"{REQUEST_ID}\": expected 1 to {ID_MAX} octets, as of a UUID");
            Err(RpcError::new(code::INVALID_PARAMS, what))
        }
        id => Ok(id),
    }
}

impl Repeats {
    /// Whether an order is new.
    ///
    /// # Errors
    /// Another order has had this id, or there are too many.
    pub fn see(
        &mut self,
        id: &str,
        method: &str,
        params: &Params,
        ticket: Ticket,
        now_ns: u64,
    ) -> Result<Seen, RpcError> {
        self.forget(now_ns);
        let what = digest(method, params);
        if let Some(known) = self.known.get_mut(id) {
            if known.what != what {
                let what =
                    format!("parameter \"{REQUEST_ID}\": another order has had this id in the last {REMEMBERED_S} s");
                return Err(RpcError::new(code::INVALID_PARAMS, what));
            }
            return Ok(match &known.answer {
                Some(answer) => Seen::Answered(answer.clone()),
                None => {
                    known.also.push(ticket);
                    Seen::UnderWay
                }
            });
        }
        if self.known.len() >= IDS_MAX {
            let what = format!(
                "{IDS_MAX} orders with an id in {REMEMBERED_S} s: no more are remembered, so this one is refused"
            );
            return Err(RpcError::new(code::REFUSED, what));
        }
        self.known.insert(
            id.to_owned(),
            Known {
                what,
                ticket,
                also: Vec::new(),
                answer: None,
            },
        );
        self.order.push_back((now_ns, id.to_owned()));
        self.under_way.insert(ticket, id.to_owned());
        Ok(Seen::New)
    }

    /// An order has been answered, whether it has an id or not.
    pub fn answered(&mut self, ticket: Ticket, answer: &Answer) {
        let Some(known) = self.under_way.remove(&ticket).and_then(|id| self.known.get_mut(&id)) else {
            return;
        };
        let also = std::mem::take(&mut known.also);
        self.ready
            .extend(also.into_iter().map(|ticket| (ticket, answer.clone())));
        known.answer = Some(answer.clone());
    }

    /// An answer for whoever asked again.
    pub fn ready(&mut self) -> Option<(Ticket, Answer)> {
        self.ready.pop()
    }

    /// Whoever waits with this ticket has gone. True: the order is still wanted, or was never this one's; false: nobody wants it any
    /// more.
    pub fn gone(&mut self, ticket: Ticket) -> bool {
        if let Some(id) = self.under_way.get(&ticket) {
            let Some(known) = self.known.get_mut(id) else {
                return false;
            };
            if !known.also.is_empty() {
                return true;
            }
            // What it came to is told once that is known; until then, that nobody waited for it.
            let what = "its client had gone before it began, so it did not begin: order it again with another id";
            known.answer = Some(Err(RpcError::new(code::REFUSED, what)));
            return false;
        }
        for known in self.known.values_mut() {
            if let Some(at) = known.also.iter().position(|also| *also == ticket) {
                known.also.swap_remove(at);
                return true;
            }
        }
        false
    }

    fn forget(&mut self, now_ns: u64) {
        while let Some((begun_ns, id)) = self.order.front() {
            if now_ns.saturating_sub(*begun_ns) < REMEMBERED_S * 1_000_000_000 {
                return;
            }
            // The check of a long program may take longer.
            let is_under_way = self.known.get(id).is_some_and(|known| known.answer.is_none());
            let Some((_, id)) = self.order.pop_front() else { return };
            if is_under_way {
                self.order.push_back((now_ns, id));
            } else if let Some(known) = self.known.remove(&id) {
                self.under_way.remove(&known.ticket);
            }
        }
    }
}

fn digest(method: &str, params: &Params) -> [u8; 32] {
    let mut hash = Sha256::new();
    hash.update(method);
    hash.update([0]);
    // Names come sorted.
    hash.update(Value::Object(params.0.clone()).to_string());
    hash.finalize().into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    const S: u64 = 1_000_000_000;

    fn params(value: Value) -> Params {
        Params(value.as_object().unwrap().clone())
    }

    #[test]
    fn the_first_answer_is_the_answer_for_ten_minutes() {
        let mut repeats = Repeats::default();
        let line = params(json!({ "line": "G0 X1", "request_id": "a" }));
        let see = |repeats: &mut Repeats, ticket, now_ns| repeats.see("a", "mdi", &line, ticket, now_ns);
        assert_eq!(see(&mut repeats, 1, 0), Ok(Seen::New));
        assert_eq!(see(&mut repeats, 2, S), Ok(Seen::UnderWay));
        let answer = Ok(json!({ "n": 1 }));
        repeats.answered(1, &answer);
        assert_eq!(repeats.ready(), Some((2, answer.clone())));
        assert_eq!(repeats.ready(), None);
        assert_eq!(see(&mut repeats, 3, 599 * S), Ok(Seen::Answered(answer)));
        assert_eq!(see(&mut repeats, 4, 600 * S), Ok(Seen::New));
        assert_eq!(
            (repeats.known.len(), repeats.order.len(), repeats.under_way.len()),
            (1, 1, 1)
        );
    }

    #[test]
    fn an_id_is_that_of_one_order() {
        let mut repeats = Repeats::default();
        let of = |axis: &str| params(json!({ "axis": axis }));
        repeats.see("a", "jog", &of("X"), 1, 0).unwrap();
        assert!(repeats.see("a", "jog", &of("Y"), 2, 0).is_err());
        assert!(repeats.see("a", "jog.stop", &of("X"), 3, 0).is_err());
        assert_eq!(repeats.see("b", "jog", &of("Y"), 4, 0), Ok(Seen::New));
        for wrong in [
            json!({ "request_id": "" }),
            json!({ "request_id": "x".repeat(65) }),
            json!({ "request_id": 5 }),
        ] {
            assert!(id(&params(wrong)).is_err());
        }
        assert_eq!(id(&params(json!({}))), Ok(None));
    }

    #[test]
    fn what_nobody_waits_for_did_not_begin_unless_it_did() {
        let mut repeats = Repeats::default();
        let none = params(json!({}));
        let see = |repeats: &mut Repeats, id: &str, ticket| repeats.see(id, "home", &none, ticket, 0).unwrap();
        see(&mut repeats, "a", 1);
        see(&mut repeats, "a", 2);
        // Another one still wants it.
        assert!(repeats.gone(1));
        // He goes, too: he never was who ordered it.
        assert!(repeats.gone(2) && !repeats.gone(1) && !repeats.gone(3));
        assert!(
            matches!(see(&mut repeats, "a", 4), Seen::Answered(Err(error)) if error.message.text.contains("did not begin"))
        );
        // It had begun all the same.
        repeats.answered(1, &Ok(json!(true)));
        assert_eq!(see(&mut repeats, "a", 5), Seen::Answered(Ok(json!(true))));
    }

    #[test]
    fn as_many_are_remembered_as_there_is_room_for() {
        let mut repeats = Repeats::default();
        let none = params(json!({}));
        for number in 0..IDS_MAX as u64 {
            repeats.see(&number.to_string(), "home", &none, number, number).unwrap();
            repeats.answered(number, &Ok(json!({})));
        }
        assert!(
            repeats
                .see("x", "home", &none, 0, 0)
                .unwrap_err()
                .message
                .text
                .contains("no more are remembered")
        );
        assert!(matches!(repeats.see("7", "home", &none, 0, 0), Ok(Seen::Answered(_))));
        assert_eq!(repeats.see("x", "home", &none, 0, 600 * S), Ok(Seen::New));
    }
}
