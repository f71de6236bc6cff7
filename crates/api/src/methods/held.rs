//! Why a program that is held, or whose feed is held, does not go on.
//!
//! In:  orders as they are given, how the machine is, its pins and nets. Out: a sentence for each cause that stands.

use super::Methods;
use crate::control::Who;
use crate::orders::Order;
use ::machine::state::State;
use config::Config;
use protocol::{Message, WaitingFor, message};
use rt::overrides::Overridden;
use rt::shared::Snapshot;

const FEED_HOLD: &str = "motion.feed-hold";
const ADAPTIVE: &str = "motion.adaptive-feed";

/// Who has held the program, until it goes on.
#[derive(Debug, Default)]
pub(super) struct Holder {
    said: Option<Message>,
    /// The machine has come to rest by it.
    rested: bool,
}

impl Holder {
    /// An order of a client.
    pub(super) fn follow(&mut self, order: &Order, who: Option<&Who>) {
        match (order, who) {
            (Order::Hold, Some(who)) => {
                let said = message!(
                    "held.client",
                    "held by {name} (process {process})",
                    name = &who.name,
                    process = who.process
                );
                *self = Holder {
                    said: Some(said),
                    rested: false,
                };
            }
            (Order::Resume | Order::Reverse(_) | Order::Stop | Order::Start { .. } | Order::Run(_), _) => {
                *self = Holder::default();
            }
            _ => {}
        }
    }

    /// The client that has control is lost, and the program is held for that.
    pub(super) fn lose(&mut self, name: Option<String>) {
        *self = Holder {
            said: name.map(|name| message!("held.lost_control", "held: {name} had control and is lost", name = name)),
            rested: false,
        };
    }

    /// What holds it in a state; a pin may have let it go on.
    fn in_state(&mut self, state: State) -> Option<Message> {
        match state {
            State::Held | State::Away | State::Returning => self.rested = true,
            State::Running if !self.rested => {}
            _ => *self = Holder::default(),
        }
        self.said.clone()
    }
}

/// Nets of the pins that hold the feed: name and source.
#[derive(Clone, Debug, Default)]
pub(super) struct FeedNets {
    hold: Option<(String, String)>,
    adaptive: Option<(String, String)>,
}

impl FeedNets {
    pub(super) fn of(config: &Config) -> FeedNets {
        let net = |pin: &str| {
            let found = config
                .nets
                .iter()
                .find(|net| net.targets.iter().any(|target| target == pin));
            found.map(|net| (net.name.clone(), net.source.clone()))
        };
        FeedNets {
            hold: net(FEED_HOLD),
            adaptive: net(ADAPTIVE),
        }
    }
}

impl Methods {
    /// Causes that stand, none where nothing is held.
    pub(super) fn held_by(&mut self, live: &Snapshot) -> Vec<Message> {
        let mut causes = Vec::new();
        let said = self.holder.in_state(live.state);
        let is_held = matches!(live.state, State::Held | State::Away);
        let waits_for_feed = live.waiting.is_some_and(|waiting| waiting.code() == WaitingFor::Feed);
        if !is_held && !waits_for_feed {
            return causes;
        }
        if is_held {
            causes.extend(said.or_else(|| match (live.reversing, live.single_block) {
                (true, _) => Some(message!("held.way_back", "held at the end of the way back")),
                (false, true) => Some(message!(
                    "held.single_block",
                    "single block: held at the end of a block"
                )),
                (false, false) => None,
            }));
        }
        let acts = self.overrides();
        if acts.feed_hold_acts && (self.pins)(FEED_HOLD) == Some(1.0) {
            causes.push(match &self.feed_nets.hold {
                Some((net, source)) => message!(
                    "held.input",
                    "{pin} is on: net {net}, driven by {source}",
                    pin = FEED_HOLD,
                    net = net,
                    source = source
                ),
                None => message!(
                    "held.set",
                    "{pin} is on: it was set by hand, no net drives it",
                    pin = FEED_HOLD
                ),
            });
        }
        if !waits_for_feed {
            return causes;
        }
        if acts.feed_acts && self.live.overrides.percent(Overridden::Feed) == 0.0 {
            causes.push(message!("held.feed_override", "feed override at 0 %"));
        }
        if self.live.overrides.percent(Overridden::Rapid) == 0.0 {
            causes.push(message!("held.rapid_override", "rapid override at 0 %"));
        }
        // Not a number holds as well.
        if acts.adaptive_feed_acts && !(self.pins)(ADAPTIVE).is_some_and(|share| share > 0.0) {
            causes.push(match &self.feed_nets.adaptive {
                Some((net, source)) => message!(
                    "held.adaptive",
                    "{pin} is at 0: net {net}, driven by {source}",
                    pin = ADAPTIVE,
                    net = net,
                    source = source
                ),
                None => message!("held.adaptive_set", "{pin} is at 0: no net drives it", pin = ADAPTIVE),
            });
        }
        causes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn who() -> Who {
        Who {
            client: 3,
            process: 77,
            name: "pendant".into(),
        }
    }

    #[test]
    fn who_has_held_is_told_until_the_program_goes_on_however_that_comes() {
        let mut holder = Holder::default();
        let said = |holder: &mut Holder, state| holder.in_state(state).map(|said| said.text);
        let pendant = || Some("held by pendant (process 77)".to_owned());
        holder.follow(&Order::Hold, Some(&who()));
        // It comes to rest first.
        assert_eq!(said(&mut holder, State::Running), pendant());
        assert_eq!(said(&mut holder, State::Held), pendant());
        assert_eq!(said(&mut holder, State::Away), pendant());
        holder.follow(&Order::Resume, Some(&who()));
        assert_eq!(said(&mut holder, State::Held), None);
        // By a pin.
        holder.follow(&Order::Hold, Some(&who()));
        assert_eq!(said(&mut holder, State::Held), pendant());
        assert_eq!(said(&mut holder, State::Running), None);
        assert_eq!(said(&mut holder, State::Held), None);
        holder.lose(Some("panel".into()));
        assert_eq!(
            said(&mut holder, State::Held),
            Some("held: panel had control and is lost".to_owned())
        );
    }
}
