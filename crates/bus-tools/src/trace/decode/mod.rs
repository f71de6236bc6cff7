//! One captured frame in words.
//!
//! In:  octets of one frame of a capture, in the order of the capture (an SDO answer is told with what was asked).
//! Out: who says what to whom, as columns and one sentence.

mod sdo;

use super::super::words::{self, counted, node_name};
use ethercat::wire::Addressing;
use ethercat::wire::register::{self, AlState};
use powerlink::nmt::{NmtCommand, NmtState};
use powerlink::wire::{
    Asnd, ETHER_TYPE, Frame, Header, IdentResponse, NmtCommandFrame, NmtRequestFrame, Preq, Pres, RequestedService,
    Requests, ServiceId, Soa, Soc, StatusResponse, SyncRequest, SyncResponse, WireError, message, node,
};
use sdo::Conversations;

/// EtherType of IPv4.
const ETHER_TYPE_IPV4: u16 = 0x0800;
/// UDP port of SDO.
const UDP_PORT: u16 = 3819;
/// MessageType, destination, source and ServiceID in front of the SDO in a UDP datagram.
const UDP_HEADER_LEN: usize = 4;

/// What a captured frame is.
#[derive(Clone, Copy, Debug, PartialEq)]
#[allow(clippy::large_enum_variant, reason = "frames are looked at one at a time")]
pub(super) enum Content<'a> {
    /// POWERLINK.
    Frame(Header, Frame<'a>),
    /// SDO in a UDP datagram.
    SdoUdp {
        /// Node id of the sender.
        from: u8,
        /// Node id of the receiver.
        to: u8,
        /// From the sequence layer on.
        service_data: &'a [u8],
    },
    /// EtherCAT.
    Ethercat(ethercat::wire::Frame<'a>),
    /// Another protocol, by its EtherType.
    Other(u16),
    /// POWERLINK that cannot be read, or too short for any protocol.
    Unreadable(WireError),
    /// EtherCAT that cannot be read.
    UnreadableEthercat(ethercat::wire::WireError),
}

/// Reads any octets.
pub(super) fn parse(frame: &[u8]) -> Content<'_> {
    if let Some(content) = sdo_in_udp(frame) {
        return content;
    }
    match ethercat::wire::Frame::parse(frame) {
        Ok(frame) => return Content::Ethercat(frame),
        Err(error) if frame.get(12..14) == Some(&ethercat::wire::ETHER_TYPE.to_be_bytes()) => {
            return Content::UnreadableEthercat(error);
        }
        Err(_) => {}
    }
    match (Header::parse(frame), Frame::parse(frame)) {
        (Ok(header), Ok(frame)) => Content::Frame(header, frame),
        (Err(WireError::EtherType { got }), _) => Content::Other(got),
        (Err(error), _) | (_, Err(error)) => match frame.get(12..14) {
            Some(ether_type) if ether_type != ETHER_TYPE.to_be_bytes() => {
                Content::Other(u16::from_be_bytes([ether_type[0], ether_type[1]]))
            }
            _ => Content::Unreadable(error),
        },
    }
}

/// `None`: no SDO in UDP over IPv4, or cut off.
fn sdo_in_udp(frame: &[u8]) -> Option<Content<'_>> {
    const UDP: u8 = 17;
    if frame.get(12..14)? != ETHER_TYPE_IPV4.to_be_bytes() {
        return None;
    }
    let ip = frame.get(14..)?;
    let (version, header_len) = (ip.first()? >> 4, usize::from(ip.first()? & 0x0F) * 4);
    let total = usize::from(u16::from_be_bytes([*ip.get(2)?, *ip.get(3)?]));
    if version != 4 || *ip.get(9)? != UDP {
        return None;
    }
    let udp = ip.get(header_len..total)?;
    let port = |at: usize| Some(u16::from_be_bytes([*udp.get(at)?, *udp.get(at + 1)?]));
    if port(0)? != UDP_PORT && port(2)? != UDP_PORT {
        return None;
    }
    let (header, service_data) = udp.get(8..)?.split_at_checked(UDP_HEADER_LEN)?;
    let sdo = header[0] & 0x7F == message::ASND && ServiceId::from(header[3]) == ServiceId::Sdo;
    sdo.then_some(Content::SdoUdp {
        from: header[2],
        to: header[1],
        service_data,
    })
}

/// A frame of EtherCAT: whether it has passed the devices, and what each datagram asks of whom.
fn datagrams(frame: &ethercat::wire::Frame<'_>) -> Line {
    let has_passed = frame.source[0] & ethercat::wire::MAC_PASSED != 0;
    let told: Vec<String> = frame
        .datagrams()
        .map(|datagram| one_datagram(&datagram, has_passed))
        .collect();
    let nobody = |datagram: ethercat::wire::Datagram<'_>| {
        datagram.command.addressing() != Addressing::None && datagram.working_counter == 0
    };
    Line {
        flags: if has_passed { vec!["back"] } else { Vec::new() },
        trouble: has_passed && frame.datagrams().any(nobody),
        ..plain("ECAT", told.join("; "))
    }
}

/// `FPRD 1001h 0130h/2, 1 acted`
fn one_datagram(datagram: &ethercat::wire::Datagram<'_>, has_passed: bool) -> String {
    let (low, high) = (datagram.address as u16, (datagram.address >> 16) as u16);
    let octets = datagram.data.len();
    let command = format!("{:?}", datagram.command).to_uppercase();
    let whom = match datagram.command.addressing() {
        Addressing::None => format!("{octets} octets"),
        // Who sees 0 there is meant: each device adds 1.
        Addressing::Position if has_passed => format!("{high:04X}h/{octets}"),
        Addressing::Position => format!("position {} {high:04X}h/{octets}", 1 + u32::from(low.wrapping_neg())),
        Addressing::Station => format!("{low:04X}h {high:04X}h/{octets}"),
        Addressing::Broadcast => format!("all {high:04X}h/{octets}"),
        Addressing::Logical => format!("logical {:08X}h/{octets}", datagram.address),
    };
    let state = match datagram.data {
        [state, ..] if high == register::AL_STATUS && datagram.working_counter == 1 => AlState::from(*state),
        _ => AlState::Unknown(0),
    };
    let shows = match state {
        AlState::Unknown(_) => String::new(),
        state => format!(": {state}"),
    };
    match has_passed {
        true => format!("{command} {whom}{shows}, working counter {}", datagram.working_counter),
        false => format!("{command} {whom}"),
    }
}

/// One frame as a line.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Line {
    /// Type of the frame.
    pub(super) kind: &'static str,
    /// Node id of the sender.
    pub(super) from: Option<u8>,
    /// Node id of the receiver.
    pub(super) to: Option<u8>,
    /// NMT state that the sender tells.
    pub(super) state: Option<NmtState>,
    /// Flags that are set, by the standard's names.
    pub(super) flags: Vec<&'static str>,
    /// What it means.
    pub(super) what: String,
    /// It tells of an error, or asks for what was refused.
    pub(super) trouble: bool,
}

/// Tells frames; remembers which object an SDO answer is about.
#[derive(Debug, Default)]
pub(super) struct Decoder {
    sdo: Conversations,
}

impl Decoder {
    /// The frame in words. Call it for every frame of a capture, in order.
    pub(super) fn line(&mut self, content: &Content<'_>) -> Line {
        match content {
            Content::Frame(header, frame) => Line {
                from: Some(header.source_node),
                to: Some(header.destination_node),
                ..self.frame(header, frame)
            },
            Content::SdoUdp { from, to, service_data } => Line {
                from: Some(*from),
                to: Some(*to),
                ..marked("UDP", self.sdo.frame(*from, *to, service_data))
            },
            Content::Ethercat(frame) => datagrams(frame),
            Content::Other(ether_type) => plain(
                "other",
                format!("neither POWERLINK nor EtherCAT: EtherType 0x{ether_type:04X}"),
            ),
            Content::UnreadableEthercat(error) => Line {
                trouble: true,
                ..plain("bad", format!("EtherCAT that cannot be read: {error}"))
            },
            Content::Unreadable(error) => Line {
                trouble: true,
                ..plain("bad", format!("cannot be read: {error}"))
            },
        }
    }

    fn frame(&mut self, header: &Header, frame: &Frame<'_>) -> Line {
        match frame {
            Frame::Soc(frame) => soc(frame),
            Frame::Preq(frame) => preq(frame),
            Frame::Pres(frame) => pres(frame),
            Frame::Soa(frame) => soa(frame),
            Frame::Asnd(frame) => self.asnd(header, frame),
            Frame::Amni(_) => plain("AMNI", "active managing node of a redundant network".into()),
            Frame::Ainv(_) => plain("AInv", "invites to send (multiple ASnd)".into()),
        }
    }

    fn asnd(&mut self, header: &Header, frame: &Asnd<'_>) -> Line {
        let (from, to) = (header.source_node, header.destination_node);
        match frame {
            Asnd::IdentResponse(frame) => ident_response(frame),
            Asnd::StatusResponse(frame) => status_response(frame),
            Asnd::NmtRequest(frame) => plain("ASnd", nmt_request(frame)),
            Asnd::NmtCommand(frame) => {
                let told = [frame.data[0], frame.data[1]] != [0, 0];
                let trouble =
                    frame.command == NmtCommand::InvalidService || frame.command == NmtCommand::ResetNode && told;
                marked("ASnd", (nmt_command(to, frame), trouble))
            }
            Asnd::Sdo(service_data) => marked("ASnd", self.sdo.frame(from, to, service_data)),
            Asnd::SyncResponse(frame) => plain("ASnd", sync_response(frame)),
            Asnd::Other(service) => plain("ASnd", format!("service 0x{:02X}", u8::from(service.id))),
        }
    }
}

fn plain(kind: &'static str, what: String) -> Line {
    Line {
        kind,
        what,
        ..Line::default()
    }
}

/// A line that may tell of trouble.
fn marked(kind: &'static str, (what, trouble): (String, bool)) -> Line {
    Line {
        trouble,
        ..plain(kind, what)
    }
}

/// The names of the flags that are set.
fn flags<const N: usize>(flags: [(bool, &'static str); N]) -> Vec<&'static str> {
    flags
        .into_iter()
        .filter(|(set, _)| *set)
        .map(|(_, name)| name)
        .collect()
}

fn soc(frame: &Soc) -> Line {
    Line {
        flags: flags([(frame.multiplexed_cycle, "MC"), (frame.prescaled_slot, "PS")]),
        ..plain(
            "SoC",
            format!("start of cycle, relative time {} us", frame.relative_time_us),
        )
    }
}

fn preq(frame: &Preq<'_>) -> Line {
    Line {
        flags: flags([
            (frame.ready, "RD"),
            (frame.multiplexed, "MS"),
            (frame.exception_acknowledge, "EA"),
        ]),
        ..plain("PReq", payload(frame.payload, frame.ready, frame.pdo_version))
    }
}

fn pres(frame: &Pres<'_>) -> Line {
    let what = payload(frame.payload, frame.ready, frame.pdo_version) + &queued(frame.requests);
    Line {
        state: Some(frame.nmt_state),
        flags: flags([
            (frame.ready, "RD"),
            (frame.multiplexed, "MS"),
            (frame.exception_new, "EN"),
        ]),
        ..plain("PRes", what)
    }
}

fn payload(payload: &[u8], ready: bool, version: u8) -> String {
    let mut text = match payload {
        [] => "no data".to_owned(),
        payload => {
            let valid = if ready { "" } else { ", not valid yet" };
            format!(
                "{}{valid}: {}",
                counted(payload.len() as u64, "octet"),
                words::octets(payload)
            )
        }
    };
    if version != 0 {
        text += &format!(", mapping version {}.{}", version >> 4, version & 0x0F);
    }
    text
}

/// RS and PR, where something is queued.
fn queued(requests: Requests) -> String {
    match requests.count {
        0 => String::new(),
        count => {
            let more = if count == 7 { " or more" } else { "" };
            let nmt = if requests.priority == Requests::PRIORITY_NMT {
                ", NMT first"
            } else {
                ""
            };
            format!("; wants to send {count}{more}{nmt}")
        }
    }
}

fn soa(frame: &Soa) -> Line {
    let target = node_name(frame.target);
    let own = frame.target == node::MN;
    let what = match frame.service {
        RequestedService::NoService => "nobody may send".into(),
        RequestedService::IdentRequest => format!("IdentRequest to {target}"),
        RequestedService::StatusRequest => format!("StatusRequest to {target}"),
        RequestedService::NmtRequestInvite if own => "will send an NMT command itself".into(),
        RequestedService::NmtRequestInvite => format!("invites {target} to send an NMT request"),
        RequestedService::SyncRequest => format!("SyncRequest to {target}{}", sync_request(&frame.sync)),
        RequestedService::UnspecifiedInvite if own => "will send itself".into(),
        RequestedService::UnspecifiedInvite => format!("invites {target} to send"),
        RequestedService::Unknown(service) => format!("unknown service 0x{service:02X} to {target}"),
    };
    Line {
        state: Some(frame.nmt_state),
        flags: flags([
            (frame.exception_acknowledge, "EA"),
            (frame.exception_reset, "ER"),
            (frame.redundancy_active, "MR"),
        ]),
        ..plain("SoA", what)
    }
}

/// PRes chaining: what a SyncRequest sets.
fn sync_request(sync: &SyncRequest) -> String {
    let mut text = String::new();
    if let Some(time_ns) = sync.pres_time_first_ns {
        text += &format!(", to answer {time_ns} ns after the PRes of the managing node");
    }
    if sync.mode_set {
        text += ", by time from now on";
    }
    if sync.mode_reset {
        text += ", when polled from now on";
    }
    text
}

fn sync_response(frame: &SyncResponse) -> String {
    let mode = if frame.mode_set { "by time" } else { "when polled" };
    format!(
        "SyncResponse: {} ns behind node {}, needs {} ns, answers {mode}",
        frame.delay_ns, frame.sync_node, frame.latency_ns
    )
}

fn ident_response(frame: &IdentResponse) -> Line {
    // What is zero says nothing and would fill the line; the summary has all of it.
    let number = |name: &str, value: u32| match value {
        0 => String::new(),
        value => format!(", {name} 0x{value:X}"),
    };
    let mut what = format!("IdentResponse: type 0x{:08X}", frame.device_type)
        + &number("vendor", frame.vendor_id)
        + &number("product", frame.product_code)
        + &number("revision", frame.revision)
        + &number("serial", frame.serial);
    if words::is_text(&frame.host_name) {
        what += &format!(", \"{}\"", words::text(&frame.host_name));
    }
    Line {
        state: Some(frame.nmt_state),
        ..plain("ASnd", what + &queued(frame.requests))
    }
}

fn status_response(frame: &StatusResponse<'_>) -> Line {
    let mut errors: Vec<String> = frame.entries.iter().map(|entry| format!("error {entry}")).collect();
    if frame.static_errors[0] != 0 {
        errors.insert(0, format!("error register 0x{:02X}", frame.static_errors[0]));
    }
    let what = match &errors[..] {
        [] => "StatusResponse: no errors".to_owned(),
        errors => format!("StatusResponse: {}", errors.join("; ")),
    };
    Line {
        state: Some(frame.nmt_state),
        trouble: !errors.is_empty(),
        flags: flags([(frame.exception_new, "EN"), (frame.exception_clear, "EC")]),
        ..plain("ASnd", what + &queued(frame.requests))
    }
}

/// The code, and what it means where the communication profile says so.
fn error_code(code: u16) -> String {
    match words::error_name(code) {
        "" => format!("0x{code:04X}"),
        name => format!("0x{code:04X} ({name})"),
    }
}

fn nmt_command(to: u8, frame: &NmtCommandFrame) -> String {
    let command = frame.command;
    let id = u8::from(command);
    match command {
        NmtCommand::Unknown(id) => format!("unknown NMT command 0x{id:02X} to {}", node_name(to)),
        NmtCommand::InvalidService => {
            let refused = NmtCommand::from(frame.data[0]);
            format!("refuses the request {refused:?} of {}", node_name(to))
        }
        command if (0x40..0x60).contains(&id) || (0x80..0xA0).contains(&id) => {
            let link = if id < 0x60 { " to" } else { ":" };
            let listed = (1..=u8::MAX).filter(|id| frame.nodes().contains(*id));
            let listed: Vec<String> = listed.map(|id| id.to_string()).collect();
            match listed.is_empty() {
                true => format!("{command:?}{link} no node"),
                false => format!("{command:?}{link} nodes {}", listed.join(", ")),
            }
        }
        command => {
            let reason = match u16::from_le_bytes([frame.data[0], frame.data[1]]) {
                0 => String::new(),
                code if command == NmtCommand::ResetNode => format!(" because of {}", error_code(code)),
                _ => String::new(),
            };
            format!("{command:?} to {}{reason}", node_name(to))
        }
    }
}

fn nmt_request(frame: &NmtRequestFrame) -> String {
    format!(
        "asks the managing node for {:?} to {}",
        frame.command,
        node_name(frame.target)
    )
}
