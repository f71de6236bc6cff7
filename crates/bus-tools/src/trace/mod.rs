//! `isocnc bus trace`: a capture in words, one line a frame, or as a summary.
//!
//! In:  a pcap or pcapng file.
//! Out: lines or JSON on standard output. Octets that are no frame are told with their place; they end nothing but
//! themselves.

mod decode;
mod devices;
mod summary;
#[cfg(test)]
mod tests;

use super::words;
use anyhow::{Context, ensure};
use clap::Args;
use decode::{Content, Decoder, Line};
use powerlink::link::pcap::{PcapError, PcapReader};
use powerlink::wire::Frame;
use serde_json::json;
use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;
use summary::Summary;
use terminal::refusal::Refusal;

/// Arguments of `bus trace`.
#[derive(Clone, Debug, Args)]
pub struct TraceArgs {
    /// Capture (pcap or pcapng), as written by --capture, tcpdump or Wireshark
    file: PathBuf,
    /// Only frames from or to this node
    #[arg(long, value_name = "ID", value_parser = clap::value_parser!(u8).range(1..=254))]
    node: Option<u8>,
    /// Only frames from this time on, seconds since the first frame
    #[arg(long, value_name = "S", value_parser = seconds, allow_hyphen_values = true)]
    from: Option<f64>,
    /// Only frames up to this time, seconds since the first frame
    #[arg(long, value_name = "S", value_parser = seconds, allow_hyphen_values = true)]
    to: Option<f64>,
    /// No frames, but what they add up to: cycles, lost answers, working counters, latency and states per node, errors
    #[arg(long)]
    summary: bool,
}

fn seconds(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(seconds) if seconds.is_finite() => Ok(seconds),
        _ => Err("expected a number of seconds, like 1.5".into()),
    }
}

/// Longest capture that is read, octets: hours of a network with many nodes.
const CAPTURE_MAX: u64 = 8 << 30;

/// Runs the command. Exit code 1: the file is damaged, frames cannot be read, or the summary finds trouble.
///
/// # Errors
/// The file cannot be read or is no capture.
pub(super) fn trace(args: &TraceArgs, as_json: bool, out: &mut impl Write) -> anyhow::Result<ExitCode> {
    if let (Some(from), Some(to)) = (args.from, args.to) {
        ensure!(
            from <= to,
            Refusal::usage(format_args!("--from {from} is behind --to {to}"))
        );
    }
    let file = args.file.display();
    let octets = files::read(&args.file, CAPTURE_MAX).with_context(|| file.to_string())?;
    let ended = decode_all(args, &octets, as_json, out).with_context(|| file.to_string())?;
    out.flush()?;
    if let Some(error) = &ended.damage {
        files::errln!("isocnc: {file}: {error}; what stands before is shown");
    }
    if ended.unreadable > 0 && !args.summary {
        let frames = words::counted(ended.unreadable, "frame");
        files::errln!("isocnc: {file}: {frames} cannot be read (type \"bad\")");
    }
    Ok(match ended.trouble {
        false => ExitCode::SUCCESS,
        true => ExitCode::FAILURE,
    })
}

/// How a capture ended.
struct Ended {
    damage: Option<PcapError>,
    unreadable: u64,
    trouble: bool,
}

fn decode_all(args: &TraceArgs, octets: &[u8], as_json: bool, out: &mut impl Write) -> anyhow::Result<Ended> {
    let reader = PcapReader::new(octets)?;
    let mut decoder = Decoder::default();
    let mut summary = Summary::default();
    let mut ended = Ended {
        damage: None,
        unreadable: 0,
        trouble: false,
    };
    let (mut start_ns, mut cycle) = (None, 0u64);
    if !args.summary && !as_json {
        writeln!(out, "{HEAD}")?;
    }
    for (number, captured) in (1u64..).zip(reader) {
        let captured = match captured {
            Ok(captured) => captured,
            Err(error) => {
                ended.damage = Some(error);
                break;
            }
        };
        let content = decode::parse(captured.frame);
        if let Content::Frame(_, Frame::Soc(_)) = content {
            cycle += 1;
        }
        // Every frame is decoded, also one that is not shown: later ones are told with its help.
        let line = decoder.line(&content);
        // A stamp before the first one is possible in a file that was put together from several.
        let t_ns = captured.stamp_ns as i64 - *start_ns.get_or_insert(captured.stamp_ns) as i64;
        let t_s = t_ns as f64 / 1e9;
        let outside = args.from.is_some_and(|from| t_s < from) || args.to.is_some_and(|to| t_s > to);
        let others = |node| line.from != Some(node) && line.to != Some(node) && about(&content) != Some(node);
        // A summary needs all frames for what it says of one node.
        if outside || !args.summary && args.node.is_some_and(others) {
            continue;
        }
        if let Content::Unreadable(_) | Content::UnreadableEthercat(_) = content {
            ended.unreadable += 1;
        }
        let frame = Placed {
            number,
            t_ns,
            cycle: (cycle > 0).then_some(cycle),
        };
        match (args.summary, as_json) {
            (true, _) => summary.add(&frame, &content, &line, captured.frame.len()),
            (false, false) => writeln!(out, "{}", row(&frame, &line))?,
            (false, true) => writeln!(out, "{}", to_json(&frame, &line))?,
        }
    }
    ended.trouble = ended.damage.is_some() || ended.unreadable > 0;
    if args.summary {
        let summary = summary.finish(args.node, ended.damage);
        ended.trouble |= !summary.trouble.is_empty();
        match as_json {
            true => writeln!(out, "{:#}", serde_json::to_value(&summary)?)?,
            false => write!(out, "{summary}")?,
        }
    }
    Ok(ended)
}

/// The node that a SoA speaks of.
fn about(content: &Content<'_>) -> Option<u8> {
    match content {
        Content::Frame(_, Frame::Soa(soa)) => Some(soa.target),
        Content::Frame(..)
        | Content::SdoUdp { .. }
        | Content::Ethercat(_)
        | Content::Other(_)
        | Content::Unreadable(_)
        | Content::UnreadableEthercat(_) => None,
    }
}

/// Where a frame stands in the capture.
struct Placed {
    /// From 1, as Wireshark counts.
    number: u64,
    /// Since the first frame.
    t_ns: i64,
    /// Since the first SoC, from 1; `None` before it.
    cycle: Option<u64>,
}

const HEAD: &str = "      time s  cycle  frame  from   to  state        flags  meaning";

fn row(frame: &Placed, line: &Line) -> String {
    let id = |id: Option<u8>| id.map_or("-".into(), words::node_column);
    let text = format!(
        "{:>12}  {:>5}  {:5}  {:>4}  {:>3}  {:11}  {:5}  {}",
        time(frame.t_ns),
        frame.cycle.map_or("-".into(), |cycle| cycle.to_string()),
        line.kind,
        id(line.from),
        id(line.to),
        line.state.map_or("-".into(), words::state),
        line.flags.join(" "),
        line.what,
    );
    text.trim_end().to_owned()
}

/// Seconds with six places, exactly.
fn time(t_ns: i64) -> String {
    let sign = if t_ns < 0 { "-" } else { "" };
    let t_us = t_ns.unsigned_abs() / 1000;
    format!("{sign}{}.{:06}", t_us / 1_000_000, t_us % 1_000_000)
}

fn to_json(frame: &Placed, line: &Line) -> serde_json::Value {
    json!({
        "number": frame.number,
        "t_s": frame.t_ns as f64 / 1e9,
        "cycle": frame.cycle,
        "frame": line.kind,
        "from": line.from,
        "to": line.to,
        "nmt_state": line.state.map(words::state),
        "flags": line.flags,
        "meaning": line.what,
        "trouble": line.trouble,
    })
}

/// Frames that are heard live, as a summary.
#[derive(Default)]
pub(super) struct Heard {
    decoder: Decoder,
    summary: Summary,
    start_ns: Option<u64>,
    number: u64,
}

impl Heard {
    /// Takes the next frame.
    pub(super) fn add(&mut self, now_ns: u64, frame: &[u8]) {
        let content = decode::parse(frame);
        let line = self.decoder.line(&content);
        self.number += 1;
        let placed = Placed {
            number: self.number,
            t_ns: now_ns as i64 - *self.start_ns.get_or_insert(now_ns) as i64,
            cycle: None,
        };
        self.summary.add(&placed, &content, &line, frame.len());
    }

    /// Prints what was heard.
    pub(super) fn print(self, out: &mut impl Write) -> std::io::Result<()> {
        write!(out, "{}", self.summary.finish(None, None))
    }

    /// The same for programs.
    pub(super) fn into_json(self) -> serde_json::Result<serde_json::Value> {
        serde_json::to_value(self.summary.finish(None, None))
    }
}

/// For callers that hold octets already.
#[cfg(test)]
fn trace_octets(args: &TraceArgs, octets: &[u8], as_json: bool) -> anyhow::Result<(String, Ended)> {
    let mut out = Vec::new();
    let ended = decode_all(args, octets, as_json, &mut out)?;
    Ok((String::from_utf8(out)?, ended))
}
