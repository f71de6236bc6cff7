//! Any octets as a message of a cell: read or refused; what is read can be said again.

#[path = "../../crates/cell-link/src/message.rs"]
#[allow(dead_code, reason = "the link has more use of it")]
mod message;

use message::{Envelope, Journal, Order, OrderState, Since, State, Stored, Upload};
use serde::Serialize;
use serde::de::DeserializeOwned;

fn read<B: Serialize + DeserializeOwned>(octets: &[u8]) {
    if let Ok(envelope) = Envelope::<B>::from_octets(octets) {
        let again = envelope.to_octets();
        assert!(Envelope::<B>::from_octets(&again).is_ok());
    }
}

/// One run of the fuzzer.
pub fn run(octets: &[u8]) {
    read::<State>(octets);
    read::<Journal>(octets);
    read::<Since>(octets);
    read::<Upload>(octets);
    read::<Order>(octets);
    read::<OrderState>(octets);
    read::<Stored>(octets);
    if let Ok(upload) = Envelope::<Upload>::from_octets(octets) {
        assert!(upload.body.verify(octets).is_err(), "no message has its own sum in it");
    }
    if let Ok(text) = str::from_utf8(octets)
        && let Some((machine, topic)) = message::parse_key(text)
    {
        assert_eq!(topic.key(machine), text);
    }
}
