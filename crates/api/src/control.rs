//! Who may give orders: one client at a time has control, the others watch.
//!
//! In:  what clients want, when, and when they have gone. Out: whether they may, or who has control.
//!
//! An order takes control where nobody has taken it by name: commands of a person who works alone need no ceremony, and each
//! has it until the next one. Only the hand on a key keeps it meanwhile. Taken by `control.take`, it stays until it is released,
//! its client goes or is silent for [`LEASE_S`], or another takes it by force.

use super::rpc::{RpcError, code};
use super::server::ClientId;
use protocol::message;
use rt::joint_jog::HOLDS_S;
use serde_json::json;

/// Control that is not used is lost after this, s.
pub const LEASE_S: u64 = 30;
const LEASE_NS: u64 = LEASE_S * 1_000_000_000;
/// Longest name of a client, octets.
pub const NAME_MAX: usize = 64;

/// A client, as far as others are told of it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Who {
    /// Its connection.
    pub client: ClientId,
    /// Its process.
    pub process: i32,
    /// What it calls itself, or what its process is called.
    pub name: String,
}

#[derive(Clone, Debug)]
struct Holder {
    who: Who,
    /// Taken by `control.take`.
    taken: bool,
    since_ns: u64,
    heard_ns: u64,
    /// Something may move under its hand until then.
    jogs_until_ns: u64,
}

/// What an order has to do with control.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Needs {
    /// Anybody may ask for it at any time.
    Nothing,
    /// Whoever has control may.
    Control,
    /// The same, and the hand is on the key for a while.
    ControlForJog,
}

/// Who has control.
#[derive(Debug, Default)]
pub struct Control {
    holder: Option<Holder>,
}

impl Control {
    /// Lets a client give an order, or says who has control.
    ///
    /// # Errors
    /// Another client has it.
    pub fn permit(
        &mut self,
        client: ClientId,
        who: impl FnOnce() -> Who,
        needs: Needs,
        now_ns: u64,
    ) -> Result<(), RpcError> {
        if needs == Needs::Nothing {
            return Ok(());
        }
        self.refuse_others(client, now_ns)?;
        let holder = match &mut self.holder {
            Some(holder) if holder.who.client == client => holder,
            holder => holder.insert(Holder {
                who: who(),
                taken: false,
                since_ns: now_ns,
                heard_ns: now_ns,
                jogs_until_ns: 0,
            }),
        };
        if needs == Needs::ControlForJog {
            holder.jogs_until_ns = now_ns + (HOLDS_S * 1e9) as u64;
        }
        Ok(())
    }

    /// Gives a client control until it lets it go; `force`: even where another has it, who is told then.
    ///
    /// # Errors
    /// Another client has it.
    pub fn take(&mut self, who: Who, force: bool, now_ns: u64) -> Result<Option<Who>, RpcError> {
        let refused = self.refuse_others(who.client, now_ns);
        if !force {
            refused.clone()?;
        }
        let before = self.holder.take();
        let since_ns = match &before {
            Some(holder) if holder.taken && holder.who.client == who.client => holder.since_ns,
            _ => now_ns,
        };
        self.holder = Some(Holder {
            who,
            taken: true,
            since_ns,
            heard_ns: now_ns,
            jogs_until_ns: 0,
        });
        Ok(before.map(|holder| holder.who).filter(|_| refused.is_err()))
    }

    /// A client lets control go, if it has it. Whether something may still move under its hand.
    pub fn release(&mut self, client: ClientId, now_ns: u64) -> bool {
        let released = self.holder.take_if(|holder| holder.who.client == client);
        released.is_some_and(|holder| now_ns < holder.jogs_until_ns)
    }

    /// Whether this client has taken it by name.
    pub fn is_taken_by(&self, client: ClientId) -> bool {
        (self.holder.as_ref()).is_some_and(|holder| holder.taken && holder.who.client == client)
    }

    /// A client has said something.
    pub fn hear(&mut self, client: ClientId, now_ns: u64) {
        self.expire(now_ns);
        if let Some(holder) = &mut self.holder
            && holder.who.client == client
        {
            holder.heard_ns = now_ns;
        }
    }

    /// Who has control, for all to see.
    pub fn shown(&mut self, now_ns: u64) -> Option<protocol::Control> {
        self.expire(now_ns);
        let holder = self.holder.as_ref()?;
        Some(protocol::Control {
            client: holder.who.client,
            process: holder.who.process.unsigned_abs(),
            name: holder.who.name.clone(),
            taken: holder.taken,
        })
    }

    fn expire(&mut self, now_ns: u64) {
        self.holder
            .take_if(|holder| now_ns.saturating_sub(holder.heard_ns) >= LEASE_NS);
    }

    fn refuse_others(&mut self, client: ClientId, now_ns: u64) -> Result<(), RpcError> {
        self.expire(now_ns);
        let Some(holder) = &self.holder else { return Ok(()) };
        let is_jogging = now_ns < holder.jogs_until_ns;
        if holder.who.client == client || !(holder.taken || is_jogging) {
            return Ok(());
        }
        let Who { process, name, .. } = &holder.who;
        let since_s = now_ns.saturating_sub(holder.since_ns) / 1_000_000_000;
        let told = match holder.taken {
            true => message!(
                "refused.control_taken",
                "{holder} (process {process}) has had control for {since} s: wait until it lets it go, or take it over: --take-over, \
                 control.take {{\"force\": true}}; hold, stop and estop are taken from everyone",
                holder = name,
                process = *process,
                since = since_s
            ),
            false => message!(
                "refused.other_jogs",
                "{holder} (process {process}) is jogging: wait until it has ended; hold, stop and estop are taken from everyone",
                holder = name,
                process = *process
            ),
        };
        let data = json!({ "holder": name, "process": process, "since_s": since_s });
        Err(RpcError::new(code::NO_CONTROL, told).with_data(data))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const S: u64 = 1_000_000_000;

    fn who(client: ClientId) -> Who {
        Who {
            client,
            process: 100 + client as i32,
            name: format!("client {client}"),
        }
    }

    fn order(control: &mut Control, client: ClientId, now_ns: u64) -> Result<(), RpcError> {
        control.permit(client, || who(client), Needs::Control, now_ns)
    }

    #[test]
    fn who_orders_has_control_until_the_next_one_does() {
        let mut control = Control::default();
        assert_eq!(control.shown(0), None);
        for client in [1, 2, 1] {
            order(&mut control, client, 0).unwrap();
            let shown = control.shown(0).unwrap();
            assert_eq!((shown.client, shown.taken), (client, false));
        }
        control.release(2, 0);
        assert_eq!(control.shown(0).unwrap().client, 1);
        control.release(1, 0);
        assert_eq!(control.shown(0), None);
    }

    #[test]
    fn a_hand_on_the_key_keeps_control_for_as_long_as_it_holds() {
        let mut control = Control::default();
        control.permit(1, || who(1), Needs::ControlForJog, 0).unwrap();
        let refused = order(&mut control, 2, S / 5 - 1).unwrap_err();
        assert!(
            refused.message.text.starts_with("client 1 (process 101) is jogging"),
            "{refused}"
        );
        order(&mut control, 1, 1).unwrap();
        order(&mut control, 2, S / 5).unwrap();
    }

    #[test]
    fn control_that_was_taken_stays_until_it_is_released_lost_or_taken_by_force() {
        let mut control = Control::default();
        assert_eq!(control.take(who(1), false, 0).unwrap(), None);
        assert!(control.is_taken_by(1) && !control.is_taken_by(2));
        let refused = order(&mut control, 2, 12 * S).unwrap_err();
        assert_eq!(refused.code, code::NO_CONTROL);
        assert!(
            refused
                .message
                .text
                .starts_with("client 1 (process 101) has had control for 12 s: wait"),
            "{refused}"
        );
        assert_eq!(
            refused.data,
            Some(json!({ "holder": "client 1", "process": 101, "since_s": 12 }))
        );
        assert_eq!(control.take(who(2), false, 12 * S).unwrap_err().code, code::NO_CONTROL);
        // Taken again, it is renewed and no older.
        assert_eq!(control.take(who(1), false, 20 * S).unwrap(), None);
        assert_eq!(order(&mut control, 2, 49 * S).unwrap_err().data.unwrap()["since_s"], 49);
        // Whatever it says, it is there.
        control.hear(1, 49 * S);
        control.hear(2, 49 * S);
        assert!(order(&mut control, 2, 78 * S).is_err());
        assert_eq!(control.take(who(2), true, 78 * S).unwrap(), Some(who(1)));
        assert!(order(&mut control, 1, 78 * S).is_err());
        control.release(1, 0);
        assert!(order(&mut control, 1, 78 * S).is_err());
        // Silent for too long.
        assert!(order(&mut control, 1, 107 * S).is_err());
        assert_eq!(control.shown(108 * S), None);
        order(&mut control, 1, 108 * S).unwrap();
        // Nobody is robbed of what nobody has taken.
        assert_eq!(control.take(who(2), true, 108 * S).unwrap(), None);
    }
}
