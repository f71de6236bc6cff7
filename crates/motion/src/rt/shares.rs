//! Which share of the planned speed is wanted, by what the machine is at.
//!
//! In:  what holds the machine or slows it down: the operator, switches, overrides, the machine itself.
//! Out: one share for the element under way. RT.

use crate::element::{Element, Enables};

/// Shares of the planned speed, 0 to 1 each; those that act on an element are multiplied.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shares {
    /// Of everything, waits as well: 0 is a hold.
    pub all: f64,
    /// The same where the program lets the switch for feed hold act (M53).
    pub switch: f64,
    /// Of feed moves where the program lets overrides act (M48 to M50).
    pub feed: f64,
    /// Of rapid moves there.
    pub rapid: f64,
    /// Of moves where the program lets the machine adapt the feed (M52).
    pub adaptive: f64,
    /// Of feed moves by turns of the spindle (G95): its speed as a share of the one that they are planned for.
    pub turning: f64,
}

impl Shares {
    /// Everything runs as planned.
    pub const FULL: Shares = Shares::all(1.0);

    /// This share of everything.
    pub const fn all(share: f64) -> Shares {
        Shares {
            all: share,
            switch: 1.0,
            feed: 1.0,
            rapid: 1.0,
            adaptive: 1.0,
            turning: 1.0,
        }
    }

    /// Whether nothing that is done at rest may begin: held, or on the way back.
    pub fn hold(&self, enables: Enables) -> bool {
        self.on(None, enables) <= 0.0
    }

    /// The share of an element; of what is done at rest, with `enables` of the move before. Motion in step with the spindle
    /// keeps the pace of the spindle: only what stands for a hold acts on it, before it begins.
    pub(super) fn on(&self, element: Option<&Element>, enables: Enables) -> f64 {
        let pick = |acts: bool, share: f64| if acts { share } else { 1.0 };
        // What has a pace of its own, or none, is held by none.
        let moves = |share: f64| if share > 0.0 { 1.0 } else { 0.0 };
        let held = self.all * pick(enables.feed_hold, self.switch) * pick(enables.adaptive_feed, moves(self.adaptive));
        match element {
            Some(Element::Span(span)) => {
                let enables = span.enables;
                let pace = if span.rapid { self.rapid } else { self.feed };
                self.all
                    * pick(enables.feed_hold, self.switch)
                    * pick(enables.feed_override, pace)
                    * pick(enables.adaptive_feed, self.adaptive)
                    * pick(enables.spindle_speed && !span.rapid, self.turning)
            }
            Some(Element::Probing(_)) => held * pick(enables.feed_override, moves(self.feed)),
            None | Some(Element::Synced(_) | Element::Dwell { .. } | Element::Action { .. }) => held,
        }
    }
}
