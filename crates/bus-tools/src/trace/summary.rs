//! What the frames of a capture add up to.
//!
//! In:  every frame with its place and its meaning.
//! Out: cycles, polls and latency per node, states over time, identity, and a list of what is not as it should be.

use super::super::words::{self, counted};
use super::decode::{Content, Line};
use super::devices::{self, Devices};
use super::{Placed, time};
use host::terminal::table;
use powerlink::link::pcap::PcapError;
use powerlink::nmt::NmtState;
use powerlink::wire::{Asnd, Frame, Mac, RequestedService, node};
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt;

/// State changes that are kept per node; a node that changes for ever would fill the memory.
const STATES_MAX: usize = 1000;
/// State changes that are printed per node.
const STATES_SHOWN: usize = 12;
/// Different troubles that are told one by one.
const TROUBLES_SHOWN: usize = 30;
/// A cycle longer than this part of the median counts as interrupted: 3 / 2.
const INTERRUPTED: (u64, u64) = (3, 2);

/// Frames taken so far.
#[derive(Debug, Default)]
pub(super) struct Summary {
    frames: Frames,
    octets: u64,
    last_ns: i64,
    first_ns: Option<i64>,
    soc_ns: Vec<i64>,
    managing: Option<Mac>,
    nodes: BTreeMap<u8, Node>,
    /// The poll without an answer so far, and when it was sent.
    poll: Option<(u8, i64)>,
    /// The invitation without an answer so far.
    invited: Option<u8>,
    devices: Devices,
    troubles: BTreeMap<Option<u8>, Vec<Trouble>>,
    troubles_left_out: u64,
}

/// Frames by type.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub(super) struct Frames {
    pub(super) total: u64,
    pub(super) soc: u64,
    pub(super) preq: u64,
    pub(super) pres: u64,
    pub(super) soa: u64,
    pub(super) asnd: u64,
    pub(super) sdo_udp: u64,
    pub(super) ethercat: u64,
    pub(super) other: u64,
    pub(super) unreadable: u64,
}

/// What happened how often, and when for the first time.
#[derive(Clone, Debug, PartialEq)]
struct Trouble {
    what: String,
    count: u64,
    first_ns: i64,
}

#[derive(Debug, Default)]
struct Node {
    mac: Option<Mac>,
    identity: Option<Identity>,
    polls: u64,
    answers: u64,
    lost: u64,
    lost_in_row: u64,
    lost_in_row_max: u64,
    first_lost_ns: Option<i64>,
    unasked: u64,
    latency_ns: Vec<i64>,
    invited: u64,
    silent: u64,
    states: Vec<(i64, NmtState)>,
    states_left_out: u64,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct Identity {
    device_type: u32,
    vendor_id: u32,
    product_code: u32,
    revision: u32,
    serial: u32,
    host_name: String,
}

impl Summary {
    /// Takes the next frame.
    pub(super) fn add(&mut self, placed: &Placed, content: &Content<'_>, line: &Line, octets: usize) {
        let t_ns = placed.t_ns;
        self.first_ns.get_or_insert(t_ns);
        self.last_ns = t_ns;
        self.frames.total += 1;
        self.octets += octets as u64;
        let (header, frame) = match content {
            Content::Frame(header, frame) => (header, frame),
            Content::SdoUdp { .. } => {
                self.frames.sdo_udp += 1;
                return self.note(line, t_ns);
            }
            Content::Ethercat(frame) => {
                self.frames.ethercat += 1;
                for what in self.devices.add(t_ns, frame) {
                    self.trouble(None, what, t_ns);
                }
                return;
            }
            Content::Other(_) => {
                self.frames.other += 1;
                return;
            }
            Content::Unreadable(_) | Content::UnreadableEthercat(_) => {
                self.frames.unreadable += 1;
                return self.trouble(None, format!("frame {}", line.what), t_ns);
            }
        };
        let from = header.source_node;
        match frame {
            Frame::Soc(_) => {
                self.frames.soc += 1;
                self.soc_ns.push(t_ns);
                self.end_poll(t_ns);
                self.end_invitation();
            }
            Frame::Preq(_) => {
                self.frames.preq += 1;
                self.end_poll(t_ns);
                self.node(header.destination_node).polls += 1;
                self.poll = Some((header.destination_node, t_ns));
            }
            Frame::Pres(pres) => {
                self.frames.pres += 1;
                self.answer(from, t_ns);
                self.state(from, t_ns, pres.nmt_state);
            }
            Frame::Soa(soa) => {
                self.frames.soa += 1;
                self.end_poll(t_ns);
                self.end_invitation();
                self.state(from, t_ns, soa.nmt_state);
                if soa.service != RequestedService::NoService && soa.target != from {
                    self.node(soa.target).invited += 1;
                    self.invited = Some(soa.target);
                }
            }
            Frame::Asnd(asnd) => {
                self.frames.asnd += 1;
                if self.invited == Some(from) {
                    self.invited = None;
                }
                match asnd {
                    Asnd::IdentResponse(ident) => {
                        self.node(from).identity = Some(Identity {
                            device_type: ident.device_type,
                            vendor_id: ident.vendor_id,
                            product_code: ident.product_code,
                            revision: ident.revision,
                            serial: ident.serial,
                            host_name: words::text(&ident.host_name),
                        });
                        self.state(from, t_ns, ident.nmt_state);
                    }
                    Asnd::StatusResponse(status) => self.state(from, t_ns, status.nmt_state),
                    Asnd::NmtRequest(_)
                    | Asnd::NmtCommand(_)
                    | Asnd::Sdo(_)
                    | Asnd::SyncResponse(_)
                    | Asnd::Other(_) => {}
                }
            }
            Frame::Amni(_) | Frame::Ainv(_) => self.frames.other += 1,
        }
        self.node(from).mac = Some(header.source);
        if matches!(frame, Frame::Soc(_) | Frame::Soa(_)) {
            let managing = *self.managing.get_or_insert(header.source);
            if managing != header.source {
                let what = format!("a second managing node is on the wire: {}", words::mac(header.source));
                self.trouble(None, what, t_ns);
            }
        }
        self.note(line, t_ns);
    }

    fn node(&mut self, id: u8) -> &mut Node {
        self.nodes.entry(id).or_default()
    }

    fn state(&mut self, id: u8, t_ns: i64, state: NmtState) {
        let node = self.node(id);
        if node.states.last().is_some_and(|(_, last)| *last == state) {
            return;
        }
        match node.states.len() < STATES_MAX {
            true => node.states.push((t_ns, state)),
            false => node.states_left_out += 1,
        }
    }

    fn answer(&mut self, id: u8, t_ns: i64) {
        match self.poll {
            Some((polled, sent_ns)) if polled == id => {
                self.poll = None;
                let node = self.node(id);
                node.answers += 1;
                node.lost_in_row = 0;
                node.latency_ns.push(t_ns - sent_ns);
            }
            // The managing node's own PRes, and that of a chained node, are not asked for by a PReq.
            _ => self.node(id).unasked += 1,
        }
    }

    /// Another frame of the managing node: the poll before it has got no answer.
    fn end_poll(&mut self, t_ns: i64) {
        if let Some((id, _)) = self.poll.take() {
            let node = self.node(id);
            node.lost += 1;
            node.lost_in_row += 1;
            node.lost_in_row_max = node.lost_in_row_max.max(node.lost_in_row);
            node.first_lost_ns.get_or_insert(t_ns);
        }
    }

    fn end_invitation(&mut self) {
        if let Some(id) = self.invited.take() {
            self.node(id).silent += 1;
        }
    }

    fn note(&mut self, line: &Line, t_ns: i64) {
        if line.trouble {
            self.trouble(line.from, line.what.clone(), t_ns);
        }
    }

    fn trouble(&mut self, from: Option<u8>, what: String, t_ns: i64) {
        let told: usize = self.troubles.values().map(Vec::len).sum();
        let list = self.troubles.entry(from).or_default();
        match list.iter_mut().find(|trouble| trouble.what == what) {
            Some(trouble) => trouble.count += 1,
            None if told >= TROUBLES_SHOWN => self.troubles_left_out += 1,
            None => list.push(Trouble {
                what,
                count: 1,
                first_ns: t_ns,
            }),
        }
    }

    /// Adds everything up; `only` leaves out all other controlled nodes.
    pub(super) fn finish(self, only: Option<u8>, damage: Option<PcapError>) -> Report {
        let mut trouble: Vec<String> = damage
            .iter()
            .map(|error| format!("the file is damaged: {error}"))
            .collect();
        for (from, list) in &self.troubles {
            if only.is_some() && from.is_some() && *from != only {
                continue;
            }
            for entry in list {
                let who = from.map_or(String::new(), |id| format!("{}: ", words::node_name(id)));
                let when = match entry.count {
                    1 => format!(" at {} s", time(entry.first_ns)),
                    count => format!(", {count} times, first at {} s", time(entry.first_ns)),
                };
                trouble.push(format!("{who}{}{when}", entry.what));
            }
        }
        if self.troubles_left_out > 0 {
            trouble.push(format!("and {} more", self.troubles_left_out));
        }
        let cycles = cycles(&self.soc_ns);
        if let Some(cycles) = cycles.as_ref().filter(|cycles| cycles.interrupted > 0) {
            trouble.push(format!(
                "{} took longer than one and a half, {:.3} ms at the most",
                counted(cycles.interrupted, "cycle"),
                cycles.period_max_us / 1e3
            ));
        }
        let ethercat = self.devices.finish(&mut trouble);
        let mut nodes = Vec::new();
        for (id, node) in self.nodes {
            if only.is_some_and(|only| only != id && id != node::MN) {
                continue;
            }
            if let Some(first_ns) = node.first_lost_ns {
                trouble.push(format!(
                    "{}: {} of {} without an answer, {} in a row at the most, first at {} s",
                    words::node_name(id),
                    node.lost,
                    counted(node.polls, "poll"),
                    node.lost_in_row_max,
                    time(first_ns)
                ));
            }
            nodes.push(node.finish(id));
        }
        Report {
            duration_s: (self.last_ns - self.first_ns.unwrap_or(0)) as f64 / 1e9,
            octets: self.octets,
            frames: self.frames,
            cycles,
            nodes,
            ethercat,
            trouble,
        }
    }
}

impl Node {
    fn finish(self, id: u8) -> NodeReport {
        NodeReport {
            node: id,
            mac: self.mac.map(words::mac),
            identity: self.identity,
            polls: self.polls,
            answers: self.answers,
            lost: self.lost,
            lost_in_row_max: self.lost_in_row_max,
            unasked: self.unasked,
            latency_us: Span::from_values(&self.latency_ns),
            invited: self.invited,
            silent: self.silent,
            states: (self.states.iter())
                .map(|(t_ns, state)| Change {
                    t_s: *t_ns as f64 / 1e9,
                    nmt_state: words::state(*state),
                })
                .collect(),
            states_left_out: self.states_left_out,
        }
    }
}

fn cycles(soc_ns: &[i64]) -> Option<Cycles> {
    let mut periods: Vec<i64> = soc_ns.windows(2).map(|pair| pair[1] - pair[0]).collect();
    periods.sort_unstable();
    let median_ns = *periods.get(periods.len() / 2)?;
    let limit_ns = median_ns.saturating_mul(INTERRUPTED.0 as i64) / INTERRUPTED.1 as i64;
    let span = Span::from_values(&periods)?;
    Some(Cycles {
        count: soc_ns.len() as u64,
        period_us: median_ns as f64 / 1e3,
        period_min_us: span.min,
        period_mean_us: span.mean,
        period_max_us: span.max,
        interrupted: periods.iter().filter(|period| **period > limit_ns).count() as u64,
    })
}

/// Everything about a capture.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct Report {
    pub(super) duration_s: f64,
    pub(super) octets: u64,
    pub(super) frames: Frames,
    /// `None`: less than two SoC.
    pub(super) cycles: Option<Cycles>,
    pub(super) nodes: Vec<NodeReport>,
    /// `None`: no frame of it.
    pub(super) ethercat: Option<devices::Report>,
    /// What is not as it should be, in sentences.
    pub(super) trouble: Vec<String>,
}

/// SoC to SoC, by the stamps of the capture.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct Cycles {
    pub(super) count: u64,
    /// Median.
    pub(super) period_us: f64,
    pub(super) period_min_us: f64,
    pub(super) period_mean_us: f64,
    pub(super) period_max_us: f64,
    /// Cycles longer than one and a half.
    pub(super) interrupted: u64,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct NodeReport {
    pub(super) node: u8,
    pub(super) mac: Option<String>,
    pub(super) identity: Option<Identity>,
    pub(super) polls: u64,
    pub(super) answers: u64,
    pub(super) lost: u64,
    pub(super) lost_in_row_max: u64,
    /// PRes without a PReq.
    pub(super) unasked: u64,
    /// From PReq to PRes.
    pub(super) latency_us: Option<Span>,
    pub(super) invited: u64,
    pub(super) silent: u64,
    pub(super) states: Vec<Change>,
    pub(super) states_left_out: u64,
}

/// Values in microseconds.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(super) struct Span {
    pub(super) min: f64,
    pub(super) mean: f64,
    pub(super) max: f64,
}

impl Span {
    fn from_values(values_ns: &[i64]) -> Option<Span> {
        let sum: f64 = values_ns.iter().map(|value| *value as f64).sum();
        Some(Span {
            min: *values_ns.iter().min()? as f64 / 1e3,
            mean: sum / values_ns.len() as f64 / 1e3,
            max: *values_ns.iter().max()? as f64 / 1e3,
        })
    }
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct Change {
    pub(super) t_s: f64,
    pub(super) nmt_state: String,
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let frames = self.frames;
        writeln!(
            f,
            "frames  {} in {:.3} s: {} SoC, {} PReq, {} PRes, {} SoA, {} ASnd, {} SDO over UDP,",
            frames.total,
            self.duration_s,
            frames.soc,
            frames.preq,
            frames.pres,
            frames.soa,
            frames.asnd,
            frames.sdo_udp
        )?;
        writeln!(
            f,
            "        {} EtherCAT, {} other, {} that cannot be read",
            frames.ethercat, frames.other, frames.unreadable
        )?;
        if let Some(ethercat) = &self.ethercat {
            write!(f, "{ethercat}")?;
        }
        let is_powerlink = frames.total > frames.ethercat + frames.other + frames.unreadable;
        if is_powerlink || self.ethercat.is_none() {
            self.powerlink(f)?;
        }
        match &self.trouble[..] {
            [] => writeln!(f, "\nno trouble"),
            trouble => {
                writeln!(f, "\ntrouble")?;
                trouble.iter().try_for_each(|line| writeln!(f, "  {line}"))
            }
        }
    }
}

impl Report {
    /// Cycles and nodes.
    fn powerlink(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.cycles {
            None => writeln!(f, "cycle   none: less than two SoC")?,
            Some(cycles) => writeln!(
                f,
                "cycle   {:.3} ms (median of {}; {:.3} to {:.3} ms)",
                cycles.period_us / 1e3,
                cycles.count - 1,
                cycles.period_min_us / 1e3,
                cycles.period_max_us / 1e3
            )?,
        }
        let rows = self.nodes.iter().map(|node| {
            let us = |value: fn(&Span) -> f64| {
                let span = node.latency_us.as_ref();
                span.map_or("-".into(), |span| format!("{:.1}", value(span)))
            };
            vec![
                node.node.to_string(),
                node.mac.clone().unwrap_or("never heard".into()),
                node.polls.to_string(),
                node.lost.to_string(),
                node.lost_in_row_max.to_string(),
                us(|span| span.min),
                us(|span| span.mean),
                us(|span| span.max),
                node.invited.to_string(),
                node.silent.to_string(),
            ]
        });
        let heading = [
            ">node",
            "address",
            ">polls",
            ">lost",
            ">in a row",
            ">latency us: min",
            ">mean",
            ">max",
            ">invited",
            ">silent",
        ];
        write!(f, "\n{}", table(&heading, rows))?;
        writeln!(f, "\nidentity")?;
        for node in &self.nodes {
            if let Some(id) = &node.identity {
                write!(
                    f,
                    "{:>4}  type 0x{:08X}, vendor 0x{:X}, product 0x{:X}, revision 0x{:X}, serial {}",
                    node.node, id.device_type, id.vendor_id, id.product_code, id.revision, id.serial
                )?;
                match id.host_name.is_empty() {
                    true => writeln!(f)?,
                    false => writeln!(f, ", \"{}\"", id.host_name)?,
                }
            }
        }
        writeln!(f, "\nstates, with the time in s")?;
        for node in self.nodes.iter().filter(|node| !node.states.is_empty()) {
            let shown = node.states.iter().take(STATES_SHOWN);
            let shown: Vec<String> = shown
                .map(|change| format!("{} {:.3}", change.nmt_state, change.t_s))
                .collect();
            let more = node.states.len() as u64 + node.states_left_out - shown.len() as u64;
            let more = if more > 0 {
                format!(", and {more} more")
            } else {
                String::new()
            };
            writeln!(f, "{:>4}  {}{more}", node.node, shown.join(", "))?;
        }
        Ok(())
    }
}
