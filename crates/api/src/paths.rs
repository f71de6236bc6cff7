//! Ways of programs that clients fetch part by part, for a picture.
//!
//! In:  what a thread of the operator's draws. Out: one part for each request, when it is there.
//!
//! The thread waits for its client with a few parts ready, so that memory is bounded however long the program is. A way goes with its
//! client, with the next one of the same client, or once nobody has asked for a part for a minute.

use super::rpc::{RpcError, code, to_base64};
use super::server::{ClientId, Ticket};
use crate::methods::value;
use motion::cancel::Cancel;
use nix::sys::eventfd::EventFd;
use protocol::PathPart;
use serde_json::Value;
use std::sync::Arc;
use std::sync::mpsc::TrySendError;
use std::sync::mpsc::{Receiver, SyncSender, TryRecvError, sync_channel};
use std::time::Duration;

/// Ways that are being drawn, of all clients.
const COUNT_MAX: usize = 4;
/// Parts that wait for their client.
const READY_MAX: usize = 4;
/// Nobody has asked for so long, s.
const IDLE_S: u64 = 60;
/// Between two looks whether there is room.
const PAUSE: Duration = Duration::from_millis(2);

/// Some of a way.
#[derive(Debug)]
pub enum Part {
    Records(Vec<u8>),
    /// There is no more: all is told, or something is wrong.
    End(Result<(), String>),
}

/// What the operator is to have drawn.
#[derive(Clone, Debug)]
pub struct PathOrder {
    pub number: u64,
    pub tolerance_mm: f64,
    /// Nobody wants it any more.
    pub cancel: Cancel,
    to: SyncSender<Part>,
    /// Ends a wait of whoever serves the client.
    wake: Option<Arc<EventFd>>,
}

impl PartialEq for PathOrder {
    fn eq(&self, other: &PathOrder) -> bool {
        self.number == other.number
    }
}

impl PathOrder {
    /// Hands a part out once there is room; false: nobody wants it.
    pub fn send(&self, part: Part) -> bool {
        let mut part = part;
        loop {
            if self.cancel.is_cancelled() {
                return false;
            }
            match self.to.try_send(part) {
                Ok(()) => {
                    if let Some(wake) = &self.wake {
                        // It can fail only where it is full, and then it wakes, too.
                        let _ = wake.write(1);
                    }
                    return true;
                }
                Err(TrySendError::Disconnected(_)) => return false,
                Err(TrySendError::Full(back)) => part = back,
            }
            std::thread::sleep(PAUSE);
        }
    }
}

#[derive(Debug)]
struct Drawn {
    number: u64,
    client: ClientId,
    parts: Receiver<Part>,
    cancel: Cancel,
    heard_ns: u64,
    /// Who waits for the next part.
    wanted: Option<Ticket>,
}

impl Drop for Drawn {
    fn drop(&mut self) {
        self.cancel.cancel();
    }
}

/// Ways that are being fetched.
#[derive(Debug, Default)]
pub struct Paths {
    all: Vec<Drawn>,
    last: u64,
    wake: Option<Arc<EventFd>>,
}

impl Paths {
    /// `wake`: as of [`Serve::wake`](super::server::Serve::wake).
    pub fn new(wake: Option<Arc<EventFd>>) -> Paths {
        Paths {
            wake,
            ..Paths::default()
        }
    }

    /// A new way of a client.
    ///
    /// # Errors
    /// There are too many.
    pub fn begin(&mut self, client: ClientId, tolerance_mm: f64, now_ns: u64) -> Result<PathOrder, RpcError> {
        self.left(client);
        self.forget_idle(now_ns);
        if self.all.len() >= COUNT_MAX {
            let what =
                format!("{COUNT_MAX} paths are being fetched already; one that nobody asks for goes after {IDLE_S} s");
            return Err(RpcError::new(code::REFUSED, what));
        }
        let (to, parts) = sync_channel(READY_MAX);
        let cancel = Cancel::default();
        self.last += 1;
        self.all.push(Drawn {
            number: self.last,
            client,
            parts,
            cancel: cancel.clone(),
            heard_ns: now_ns,
            wanted: None,
        });
        Ok(PathOrder {
            number: self.last,
            tolerance_mm,
            cancel,
            to,
            wake: self.wake.clone(),
        })
    }

    /// The next part, if it is there; else [`Paths::later`] has it.
    pub fn next(
        &mut self,
        client: ClientId,
        number: u64,
        ticket: Ticket,
        now_ns: u64,
    ) -> Option<Result<Value, RpcError>> {
        let found = (self.all.iter_mut()).find(|drawn| drawn.number == number && drawn.client == client);
        let Some(drawn) = found else {
            let what =
                format!("no path {number} of this client: it has come to its end, or nobody has asked for {IDLE_S} s");
            return Some(Err(RpcError::new(code::INVALID_PARAMS, what)));
        };
        drawn.heard_ns = now_ns;
        if drawn.wanted.is_some() {
            return Some(Err(RpcError::new(code::REFUSED, "its next part is asked for already")));
        }
        drawn.wanted = Some(ticket);
        self.look(number).map(|(_, answer)| answer)
    }

    /// A part that somebody waits for and that is there.
    pub fn later(&mut self) -> Option<(Ticket, Result<Value, RpcError>)> {
        let waiting: Vec<u64> = (self.all.iter())
            .filter(|drawn| drawn.wanted.is_some())
            .map(|drawn| drawn.number)
            .collect();
        waiting.into_iter().find_map(|number| self.look(number))
    }

    fn look(&mut self, number: u64) -> Option<(Ticket, Result<Value, RpcError>)> {
        let at = self.all.iter().position(|drawn| drawn.number == number)?;
        let drawn = &mut self.all[at];
        let part = match drawn.parts.try_recv() {
            Ok(part) => part,
            Err(TryRecvError::Empty) => return None,
            Err(TryRecvError::Disconnected) => Part::End(Err("the path was given up".into())),
        };
        let ticket = drawn.wanted.take()?;
        let (records, end) = match part {
            Part::Records(records) => (records, None),
            Part::End(how) => (Vec::new(), Some(how)),
        };
        let is_over = end.is_some();
        let error = end.and_then(Result::err);
        if is_over {
            self.all.remove(at);
        }
        let part = PathPart {
            base64: to_base64(&records),
            end: is_over,
            error,
        };
        Some((ticket, value(&part)))
    }

    /// Whoever waits for this answer has gone.
    pub fn gone(&mut self, ticket: Ticket) {
        for drawn in self.all.iter_mut().filter(|drawn| drawn.wanted == Some(ticket)) {
            drawn.wanted = None;
        }
    }

    /// A client has gone, or wants none any more.
    pub fn left(&mut self, client: ClientId) {
        self.all.retain(|drawn| drawn.client != client);
    }

    /// Gives up what nobody goes on with, and what could not begin.
    pub fn forget_idle(&mut self, now_ns: u64) {
        self.all.retain(|drawn| {
            let is_heard = now_ns.saturating_sub(drawn.heard_ns) < IDLE_S * 1_000_000_000;
            drawn.wanted.is_some() || is_heard && !drawn.cancel.is_cancelled()
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn octets(answer: Option<Result<Value, RpcError>>) -> Value {
        answer.expect("at once").expect("a part")
    }

    #[test]
    fn parts_come_in_their_order_and_the_end_once() {
        let mut paths = Paths::default();
        let order = paths.begin(1, 0.1, 0).unwrap();
        assert_eq!(paths.next(1, order.number, 7, 0), None);
        assert!(paths.next(1, order.number, 8, 0).unwrap().is_err(), "one at a time");
        assert_eq!(paths.later(), None);
        assert!(order.send(Part::Records(vec![1, 2, 3])));
        let (ticket, answer) = paths.later().unwrap();
        assert_eq!((ticket, answer.unwrap()["base64"].as_str()), (7, Some("AQID")));
        assert!(order.send(Part::Records(vec![4])) && order.send(Part::End(Err("wrong".into()))));
        assert_eq!(octets(paths.next(1, order.number, 9, 0))["end"], false);
        assert!(paths.next(2, order.number, 9, 0).unwrap().is_err(), "another's");
        let end = octets(paths.next(1, order.number, 9, 0));
        assert_eq!((&end["end"], &end["error"]), (&json!(true), &json!("wrong")));
        assert!(paths.next(1, order.number, 9, 0).unwrap().is_err());
    }

    #[test]
    fn whoever_draws_hears_that_nobody_fetches_any_more() {
        let mut paths = Paths::default();
        let orders: Vec<PathOrder> = (0..COUNT_MAX as u64)
            .map(|client| paths.begin(client, 0.1, client).unwrap())
            .collect();
        assert!(paths.begin(99, 0.1, 0).is_err());
        paths.left(0);
        let again = paths.begin(1, 0.1, 5).unwrap();
        assert!(!orders[0].send(Part::Records(vec![])) && !orders[1].send(Part::Records(vec![])));
        assert!(again.send(Part::Records(vec![])));
        // Somebody who waits is there.
        assert_eq!(paths.next(2, orders[2].number, 4, 2), None);
        paths.forget_idle(IDLE_S * 1_000_000_000 + 3);
        assert!(orders[2].send(Part::Records(vec![])) && !orders[3].send(Part::Records(vec![])));
        paths.gone(4);
        paths.forget_idle(IDLE_S * 1_000_000_000 + 3);
        assert!(!orders[2].send(Part::Records(vec![])));
        // What could not begin makes room.
        again.cancel.cancel();
        for client in 10..10 + COUNT_MAX as u64 {
            paths.begin(client, 0.1, 10).unwrap();
        }
    }
}
