//! What the frames of EtherCAT in a capture add up to.
//!
//! In:  frames, as they are sent and as they come back from the devices.
//! Out: of each device its states, its mails and its EEPROM; of the process data their working counters; what is not as it should be.
//!
//! Working counters are judged by themselves: what all devices make of a datagram is the most that came back for it. A mailbox that is
//! asked while it is empty has 0, and that is no trouble.

use super::time;
use ethercat::wire::coe::{Message, SdoResponse};
use ethercat::wire::mailbox::{Mail, Protocol};
use ethercat::wire::register::{self, AlState, AlStatus, AlStatusCode, eeprom};
use ethercat::wire::{Addressing, Command, Datagram, Frame, MAC_PASSED};
use host::terminal::table;
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt;

/// State changes that are kept per device.
const STATES_MAX: usize = 1000;
/// State changes that are printed per device.
const STATES_SHOWN: usize = 12;
/// Devices and datagrams of process data that are kept: what anybody may write into a file.
const KEPT_MAX: usize = 4096;

/// Frames taken so far.
#[derive(Debug, Default)]
pub(super) struct Devices {
    sent: u64,
    back: u64,
    devices: BTreeMap<u16, Device>,
    process_data: BTreeMap<(u32, usize, String), Counters>,
}

#[derive(Debug, Default)]
struct Device {
    states: Vec<(i64, AlState)>,
    mails: u64,
    refused: u64,
    eeprom_reads: u64,
}

/// Working counters of one datagram of process data, each with how often and when first.
#[derive(Debug, Default)]
struct Counters {
    seen: BTreeMap<u16, (u64, i64)>,
}

impl Devices {
    /// Takes the next frame; what is wrong in it, in words.
    pub(super) fn add(&mut self, t_ns: i64, frame: &Frame<'_>) -> Vec<String> {
        if frame.source[0] & MAC_PASSED == 0 {
            self.sent += 1;
            return Vec::new();
        }
        self.back += 1;
        frame
            .datagrams()
            .filter_map(|datagram| self.datagram(t_ns, &datagram))
            .collect()
    }

    fn datagram(&mut self, t_ns: i64, datagram: &Datagram<'_>) -> Option<String> {
        let acted = datagram.working_counter > 0;
        match datagram.command.addressing() {
            Addressing::Logical => {
                let command = format!("{:?}", datagram.command).to_uppercase();
                let key = (datagram.address, datagram.data.len(), command);
                if self.process_data.len() < KEPT_MAX || self.process_data.contains_key(&key) {
                    let counters = self.process_data.entry(key).or_default();
                    let (count, _) = counters.seen.entry(datagram.working_counter).or_insert((0, t_ns));
                    *count += 1;
                }
                None
            }
            Addressing::Station if datagram.ado() >= register::MEMORY => {
                let is_read = matches!(datagram.command, Command::Fprd);
                (is_read && acted).then(|| self.mail(datagram)).flatten()
            }
            Addressing::Station if acted => self.register(t_ns, datagram),
            Addressing::Station => Some(format!(
                "device {:04X}h: nobody acted on {} of {:04X}h",
                datagram.adp(),
                format!("{:?}", datagram.command).to_uppercase(),
                datagram.ado()
            )),
            Addressing::Broadcast if !acted => Some("no device answers what all are asked".to_owned()),
            Addressing::Broadcast | Addressing::Position | Addressing::None => None,
        }
    }

    fn device(&mut self, station: u16) -> Option<&mut Device> {
        let has_room = self.devices.len() < KEPT_MAX || self.devices.contains_key(&station);
        has_room.then(|| self.devices.entry(station).or_default())
    }

    /// A register of a device.
    fn register(&mut self, t_ns: i64, datagram: &Datagram<'_>) -> Option<String> {
        let station = datagram.adp();
        let word = |at: usize| {
            Some(u16::from_le_bytes([
                *datagram.data.get(at)?,
                *datagram.data.get(at + 1)?,
            ]))
        };
        let is_read = matches!(datagram.command, Command::Fprd);
        match datagram.ado() {
            register::AL_STATUS if is_read => {
                let status = AlStatus::from(word(0)?);
                let device = self.device(station)?;
                let is_new = device.states.last().is_none_or(|(_, last)| *last != status.state);
                if is_new && device.states.len() < STATES_MAX {
                    device.states.push((t_ns, status.state));
                }
                let code = AlStatusCode(word(4).unwrap_or(0));
                // The bit without a code is what a chip mirrors that emulates the state machine.
                let is_error = status.error && code != AlStatusCode::NONE;
                is_error.then(|| format!("device {station:04X}h is in {} with an error: {code}", status.state))
            }
            register::EEPROM_CONTROL if is_read => {
                let errors = word(0)? & eeprom::ERRORS;
                (errors & !eeprom::NOT_LOADED != 0)
                    .then(|| format!("device {station:04X}h: its EEPROM shows an error, bits {errors:04X}h of 0502h"))
            }
            register::EEPROM_CONTROL => {
                let reads = word(0)? & eeprom::READ != 0;
                self.device(station)?.eeprom_reads += u64::from(reads);
                None
            }
            _ => None,
        }
    }

    /// A mail from a device.
    fn mail(&mut self, datagram: &Datagram<'_>) -> Option<String> {
        let station = datagram.adp();
        let mail = Mail::parse(datagram.data)
            .ok()
            .filter(|mail| mail.protocol == Protocol::CoE)?;
        let message = Message::parse(mail.data).ok()?;
        let device = self.device(station)?;
        device.mails += 1;
        match message {
            Message::Response(SdoResponse::Abort { object, code }) => {
                device.refused += 1;
                Some(format!(
                    "device {station:04X}h refused SDO {:04X}h:{}: {code}",
                    object.index, object.sub
                ))
            }
            Message::Emergency(emergency) => {
                Some(format!("device {station:04X}h reports error {:04X}h", emergency.code))
            }
            _ => None,
        }
    }

    /// Adds everything up; what is not as it should be goes to `trouble`. `None`: there was none of it.
    pub(super) fn finish(self, trouble: &mut Vec<String>) -> Option<Report> {
        if self.sent + self.back == 0 {
            return None;
        }
        if self.back > 0 && self.sent > self.back {
            let (lost, sent) = (self.sent - self.back, self.sent);
            trouble.push(format!("{lost} of {sent} frames of EtherCAT did not come back"));
        }
        let mut process_data = Vec::new();
        for ((address, octets, command), counters) in self.process_data {
            let whole = counters.seen.keys().next_back().copied().unwrap_or(0);
            let count: u64 = counters.seen.values().map(|(count, _)| count).sum();
            let (_, reached_ns) = counters.seen.get(&whole).copied().unwrap_or((0, 0));
            // Before all devices were up, less is no trouble.
            let below = counters
                .seen
                .range(..whole)
                .filter(|(_, (_, first_ns))| *first_ns > reached_ns);
            let below: Vec<(u16, u64, i64)> = below
                .map(|(counter, (count, first))| (*counter, *count, *first))
                .collect();
            if let Some(least) = below.first() {
                let times: u64 = below.iter().map(|(_, count, _)| count).sum();
                let first_ns = below.iter().map(|(_, _, first)| *first).min().unwrap_or(0);
                trouble.push(format!(
                    "{command} {address:08X}h/{octets}: working counter below {whole} in {times} of {count}, {} at the least, first at {} s",
                    least.0,
                    time(first_ns)
                ));
            }
            if whole == 0 {
                trouble.push(format!("{command} {address:08X}h/{octets}: no device acts on it"));
            }
            process_data.push(ProcessData {
                command,
                address,
                octets,
                count,
                working_counter: whole,
            });
        }
        let devices = self.devices.into_iter().map(|(station, device)| DeviceReport {
            station,
            states: (device.states.iter())
                .map(|(t_ns, state)| Change {
                    t_s: *t_ns as f64 / 1e9,
                    al_state: state.to_string(),
                })
                .collect(),
            mails: device.mails,
            refused: device.refused,
            eeprom_reads: device.eeprom_reads,
        });
        Some(Report {
            sent: self.sent,
            back: self.back,
            devices: devices.collect(),
            process_data,
        })
    }
}

/// What the frames of EtherCAT add up to.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct Report {
    pub(super) sent: u64,
    pub(super) back: u64,
    pub(super) devices: Vec<DeviceReport>,
    pub(super) process_data: Vec<ProcessData>,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct DeviceReport {
    pub(super) station: u16,
    pub(super) states: Vec<Change>,
    /// Mails of CoE that came from it.
    pub(super) mails: u64,
    /// SDOs that it refused.
    pub(super) refused: u64,
    pub(super) eeprom_reads: u64,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct Change {
    pub(super) t_s: f64,
    pub(super) al_state: String,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct ProcessData {
    pub(super) command: String,
    pub(super) address: u32,
    pub(super) octets: usize,
    pub(super) count: u64,
    /// The greatest that came back.
    pub(super) working_counter: u16,
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "\nEtherCAT  {} frames sent, {} back", self.sent, self.back)?;
        let rows = self.devices.iter().map(|device| {
            let shown = device.states.iter().take(STATES_SHOWN);
            let shown: Vec<String> = shown
                .map(|change| format!("{} {:.3}", change.al_state, change.t_s))
                .collect();
            let more = match device.states.len() - shown.len() {
                0 => String::new(),
                more => format!(", and {more} more"),
            };
            vec![
                format!("{:04X}h", device.station),
                device.mails.to_string(),
                device.refused.to_string(),
                device.eeprom_reads.to_string(),
                format!("{}{more}", shown.join(", ")),
            ]
        });
        let heading = [
            "device",
            ">mails",
            ">refused",
            ">EEPROM reads",
            "states, with the time in s",
        ];
        write!(f, "\n{}", table(&heading, rows))?;
        let rows = self.process_data.iter().map(|data| {
            vec![
                data.command.clone(),
                format!("{:08X}h", data.address),
                data.octets.to_string(),
                data.count.to_string(),
                data.working_counter.to_string(),
            ]
        });
        let heading = ["process data", "address", ">octets", ">times", ">working counter"];
        write!(f, "\n{}", table(&heading, rows))
    }
}
