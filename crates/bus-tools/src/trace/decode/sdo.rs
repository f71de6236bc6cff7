//! SDO frames in words: an answer is told with what was asked.

use super::super::super::words::{self, counted, node_name, object};
use powerlink::sdo::command::{Address, Command, Content, Segmentation, abort_code, split_initiate};
use powerlink::sdo::sequence::{self, Con, Sequence};
use std::collections::HashMap;

/// Conversations of clients with servers.
#[derive(Debug, Default)]
pub(super) struct Conversations {
    /// By client, server and transaction: the object that was asked for, where the command names one.
    asked: HashMap<(u8, u8, u8), Option<Address>>,
}

impl Conversations {
    /// An SDO frame: the command if there is one, else what it does to the connection; and whether it is trouble.
    pub(super) fn frame(&mut self, from: u8, to: u8, service_data: &[u8]) -> (String, bool) {
        let Some(sequence) = Sequence::parse(service_data) else {
            let length = counted(service_data.len() as u64, "octet");
            return (format!("SDO cut off: {length} in place of the sequence header"), true);
        };
        match Content::parse(&service_data[sequence::HEADER_LEN..]) {
            Content::Empty => (connection(&sequence, to), false),
            Content::Malformed => {
                let what = "SDO command cut off: it announces more octets than there are";
                (what.into(), true)
            }
            Content::Command(command) if command.header.response => {
                let key = (to, from, command.header.transaction);
                let asked = self.asked.get(&key).copied().flatten();
                (answer(&command, asked), command.header.abort)
            }
            Content::Command(command) => {
                let (text, address) = request(&command, to);
                let key = (from, to, command.header.transaction);
                // Only the first frame of a longer command names the object.
                if matches!(
                    command.header.segmentation,
                    Segmentation::Expedited | Segmentation::Initiate
                ) {
                    self.asked.insert(key, address);
                }
                (text, command.header.abort)
            }
        }
    }
}

/// What an SDO frame without a command does to its connection.
fn connection(sequence: &Sequence, to: u8) -> String {
    let to = node_name(to);
    match (sequence.received_con, sequence.sent_con) {
        (Con::None, Con::Init) => format!("SDO opens a connection to {to}"),
        (Con::Init, Con::Init) => format!("SDO agrees to a connection with {to}"),
        (Con::Init, Con::Valid) => format!("SDO confirms the connection to {to}"),
        (Con::None, Con::None) => format!("SDO closes the connection to {to}"),
        (Con::Request, Con::Init | Con::Valid | Con::Request | Con::None) => {
            format!(
                "SDO asks {to} to send again what follows frame {}",
                sequence.received.get()
            )
        }
        (Con::None | Con::Init | Con::Valid, Con::Request) => format!("SDO asks {to} for an acknowledge"),
        (Con::Valid, Con::Valid) => format!("SDO acknowledges frame {} of {to}", sequence.received.get()),
        (Con::None, Con::Valid) | (Con::Init | Con::Valid, Con::None) | (Con::Valid, Con::Init) => {
            format!(
                "SDO with a connection state out of place: {:?}, {:?}",
                sequence.received_con, sequence.sent_con
            )
        }
    }
}

/// A command of a client, and the object it is about.
fn request(command: &Command<'_>, to: u8) -> (String, Option<Address>) {
    let id = u8::from(command.header.id);
    let what = match command_name(id) {
        "" => format!("unknown command 0x{id:02X}"),
        name => name.to_owned(),
    };
    let to = node_name(to);
    if command.header.abort {
        let code = abort_code(command.data).map_or("no code".into(), |code| code.to_string());
        return (format!("SDO {what} given up: {code}"), None);
    }
    let part = match command.header.segmentation {
        Segmentation::Expedited => {
            let split = Address::split(command.data);
            return match (id, split) {
                (WRITE, Some((address, value))) => {
                    let object = object(address.index, address.sub);
                    let value = words::value(address.index, address.sub, value);
                    (format!("SDO write {object} = {value} to {to}"), Some(address))
                }
                (READ, Some((address, _))) => (
                    format!("SDO read {} of {to}", object(address.index, address.sub)),
                    Some(address),
                ),
                _ => (format!("SDO {what} to {to}"), None),
            };
        }
        Segmentation::Initiate => {
            let whole = split_initiate(command.data);
            if let (WRITE, Some((total, data))) = (id, whole)
                && let Some((address, _)) = Address::split(data)
            {
                let value = counted((total as u64).saturating_sub(4), "octet");
                let object = object(address.index, address.sub);
                return (
                    format!("SDO write {object} = {value} in several frames to {to}"),
                    Some(address),
                );
            }
            "first frame of several"
        }
        Segmentation::Segment => "next frame",
        Segmentation::Complete => "last frame",
    };
    let length = counted(command.data.len() as u64, "octet");
    (format!("SDO {what} to {to}, {part}, {length}"), None)
}

/// The answer of a server.
fn answer(command: &Command<'_>, asked: Option<Address>) -> String {
    let id = u8::from(command.header.id);
    let about = match (asked, command_name(id)) {
        (Some(address), _) => object(address.index, address.sub),
        (None, "") => format!("command 0x{id:02X}"),
        (None, name) => name.to_owned(),
    };
    if command.header.abort {
        return match abort_code(command.data) {
            None => format!("SDO refused: {about}: no abort code"),
            Some(code) => format!("SDO refused: {about}: {} (0x{:08X})", code.text(), code.0),
        };
    }
    match (id, command.header.segmentation, asked) {
        (WRITE, Segmentation::Expedited, _) => format!("SDO answer: {about} is written"),
        (READ, Segmentation::Expedited, Some(address)) => {
            let value = words::value(address.index, address.sub, command.data);
            format!("SDO answer: {about} = {value}")
        }
        (_, Segmentation::Expedited, _) => format!("SDO answer: {about}: {}", words::octets(command.data)),
        (_, Segmentation::Initiate, _) => match split_initiate(command.data) {
            Some((total, _)) => {
                let length = counted(total as u64, "octet");
                format!("SDO answer: {about} = {length} in several frames")
            }
            None => format!("SDO answer: {about}: a first frame that announces less than it holds"),
        },
        (_, Segmentation::Segment | Segmentation::Complete, _) => {
            let length = counted(command.data.len() as u64, "octet");
            format!("SDO answer: {about}, {length} of several frames")
        }
    }
}

const WRITE: u8 = 0x01;
const READ: u8 = 0x02;

fn command_name(id: u8) -> &'static str {
    match id {
        WRITE => "write",
        READ => "read",
        0x03 => "write of all objects",
        0x04 => "read of all objects",
        0x05 => "write by name",
        0x06 => "read by name",
        0x20 => "file write",
        0x21 => "file read",
        0x31 => "write of several objects",
        0x32 => "read of several objects",
        0x70 => "maximum segment size",
        0x71 => "link name",
        _ => "",
    }
}
