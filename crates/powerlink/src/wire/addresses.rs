//! Who may send which frame to whom: the first thing that is asked of a received frame.
//!
//! In:  message type, node id of the sender, node id of the receiver. Out: whether the standard knows such a frame.
//! MAC addresses say nothing here: a controlled node answers to the multicast or to the MAC of whoever asked.

use core::ops::RangeInclusive;

use super::header::{WireError, message, node};

/// Node ids from which a frame may come, and to which it may go.
struct Rule {
    message_type: u8,
    sources: &'static [RangeInclusive<u8>],
    destinations: &'static [RangeInclusive<u8>],
}

const MANAGING: RangeInclusive<u8> = node::MN..=node::MN;
const CONTROLLED: RangeInclusive<u8> = 1..=node::CN_MAX;
/// Redundant managing nodes. In the place of the active one they are node 240 as well.
const REDUNDANT: RangeInclusive<u8> = node::MN + 1..=node::MN_MAX;
/// Diagnostic device and router.
const TOOLS: RangeInclusive<u8> = node::DIAGNOSTIC..=node::ROUTER;
const ALL: RangeInclusive<u8> = node::BROADCAST..=node::BROADCAST;

/// One line for each message type (DS 301 ch. 4.5, 4.6); what is in no line is of an unknown type.
#[rustfmt::skip]
const RULES: [Rule; 7] = [
    Rule { message_type: message::SOC,  sources: &[MANAGING],                    destinations: &[ALL] },
    Rule { message_type: message::PREQ, sources: &[MANAGING],                    destinations: &[CONTROLLED] },
    Rule { message_type: message::PRES, sources: &[CONTROLLED, MANAGING],        destinations: &[ALL] },
    Rule { message_type: message::SOA,  sources: &[MANAGING],                    destinations: &[ALL] },
    Rule { message_type: message::ASND, sources: &[CONTROLLED, MANAGING, TOOLS], destinations: &[CONTROLLED, MANAGING, TOOLS, ALL] },
    Rule { message_type: message::AMNI, sources: &[REDUNDANT],                   destinations: &[ALL] },
    Rule { message_type: message::AINV, sources: &[MANAGING],                    destinations: &[CONTROLLED, MANAGING, TOOLS, ALL] },
];

fn contains(ranges: &[RangeInclusive<u8>], node: u8) -> bool {
    ranges.iter().any(|range| range.contains(&node))
}

/// Whether a frame of this type may go from this node to that one.
pub(super) fn check_addresses(message_type: u8, source: u8, destination: u8) -> Result<(), WireError> {
    let Some(rule) = RULES.iter().find(|rule| rule.message_type == message_type) else {
        return Err(WireError::MessageType { got: message_type });
    };
    if !contains(rule.sources, source) {
        return Err(WireError::Source {
            message_type,
            got: source,
        });
    }
    if !contains(rule.destinations, destination) {
        return Err(WireError::Destination {
            message_type,
            got: destination,
        });
    }
    Ok(())
}
