//! `isocnc bus nodes|state|pdo|report`: the network of a machine, beside its running control or from its machine file.
//!
//! In:  a control's socket; or a machine file, where no control runs.
//! Out: tables and sentences, or JSON. What is wrong with a node is told with object, expected and actual value, and with
//! the line of the machine file.

use super::words::counted;
use anyhow::{Context, bail};
use api::client::{self, ClientError};
use api::network_view::{MappedView, NetworkView, NodeView};
use bus::service::BudgetView;
use bus::service::NodeLive;
use clap::Args;
use config::{self, Protocol};
use host::terminal::table;
use machine::faults::silenced;
use protocol::params::NoParams;
use protocol::{State, Status, method};
use serde_json::json;
use std::io::{self, Write};
use std::path::PathBuf;
use std::process::ExitCode;
use terminal::refusal::Refusal;

/// Which network.
#[derive(Clone, Debug, Args)]
pub struct NetworkArgs {
    /// Machine file; may be left out while exactly one control runs
    machine_file: Option<PathBuf>,
    /// Name of the machine of a running control, where it is not that of the machine file
    #[arg(long, value_name = "NAME")]
    machine: Option<String>,
}

/// What of it is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Topic {
    /// Who is there.
    Nodes,
    /// How they are.
    State,
    /// Which object is where in the payloads.
    Pdo,
    /// All of it on one page.
    Report,
}

/// Runs the command. Exit code 1: a node is not operational, or no control runs whose nodes could be.
///
/// # Errors
/// No control and no machine file; an answer that cannot be understood.
pub(super) fn show(args: &NetworkArgs, topic: Topic, as_json: bool, out: &mut impl Write) -> anyhow::Result<ExitCode> {
    let (view, status) = fetch(args)?.map_err(Refusal::from)?;
    let status = status.as_ref();
    let not_known_yet = view.live.is_none() && status.is_some();
    match (as_json, topic) {
        (true, _) => {
            let mut value = serde_json::to_value(&view)?;
            value["trouble"] = troubles(&view, status).into();
            value["control"] = json!(status);
            writeln!(out, "{value:#}")?;
        }
        (false, Topic::Nodes) => nodes(&view, status, out)?,
        (false, Topic::State) => state(&view, status, out)?,
        (false, Topic::Pdo) => pdo(&view, status, out)?,
        (false, Topic::Report) => report(&view, status, out)?,
    }
    out.flush()?;
    // The mapping is as the machine file says, whatever the nodes do.
    let trouble = is_silenced(status) || topic != Topic::Pdo && (not_known_yet || !troubles(&view, status).is_empty());
    Ok(if trouble { ExitCode::FAILURE } else { ExitCode::SUCCESS })
}

/// The network, and the status of its control (`None`: none runs).
fn fetch(args: &NetworkArgs) -> anyhow::Result<Result<(NetworkView, Option<Status>), config::ConfigErrors>> {
    let from_file = match args.machine_file.as_deref().map(bus::read) {
        Some(Err(errors)) => return Ok(Err(errors)),
        Some(Ok(config)) => Some(NetworkView::from_config(&config)),
        None => None,
    };
    let in_file = from_file.as_ref().map(|view| view.machine.as_str());
    match client::connect(args.machine.as_deref().or(in_file)) {
        Ok(mut client) => {
            let status = client.ask::<method::Status>(&NoParams {})?;
            let network = client.ask::<method::Network>(&NoParams {})?;
            let view = serde_json::from_value(network.0).context("the control's answer cannot be understood")?;
            Ok(Ok((view, Some(status))))
        }
        Err(error @ ClientError::NotRunning { .. }) if args.machine.is_none() => match from_file {
            Some(view) => Ok(Ok((view, None))),
            None => bail!("{error}; or name a machine file to see what it says"),
        },
        Err(error) => Err(error.into()),
    }
}

/// What a bus calls things.
struct Terms {
    /// State in which process data are exchanged.
    operational: &'static str,
    /// Process data to a node and from it.
    payloads: [&'static str; 2],
    /// The bus itself counts cycles that were skipped or cut off.
    has_skipped: bool,
    /// Beside the counts of the cycle: what did not answer, and frames of no use.
    unanswered: &'static str,
    unusable: &'static str,
    /// What came of a node and was of no use: too late, or with a wrong working counter.
    refused: fn(&NodeLive) -> u64,
    /// Columns of the table of states.
    columns: [&'static str; 10],
}

const POWERLINK: Terms = Terms {
    operational: "OPERATIONAL",
    payloads: ["PReq, to the node", "PRes, from the node"],
    has_skipped: true,
    unanswered: "silent in the asynchronous slot",
    unusable: "unusable frame",
    refused: |live| live.late,
    columns: [
        ">id",
        "name",
        "state",
        ">polls",
        ">lost",
        ">in row",
        ">late",
        ">PRes after",
        ">boots",
        ">given up",
    ],
};

const ETHERCAT: Terms = Terms {
    operational: "OP",
    payloads: ["RxPDO, to the SubDevice", "TxPDO, from the SubDevice"],
    has_skipped: false,
    unanswered: "mailbox frames lost",
    unusable: "late frame",
    refused: |live| live.refused,
    columns: [
        ">node",
        "name",
        "AL state",
        ">cycles",
        ">lost",
        ">in row",
        ">wrong WKC",
        ">back after",
        ">to OP",
        ">given up",
    ],
};

fn terms(view: &NetworkView) -> &'static Terms {
    match Protocol::named(&view.protocol) {
        Some(Protocol::Ethercat) => &ETHERCAT,
        #[cfg(feature = "testing")]
        Some(Protocol::Toy) => &ETHERCAT,
        Some(Protocol::Powerlink | Protocol::None) | None => &POWERLINK,
    }
}

/// `node 3 (z-drive)`
fn who(node: &NodeView) -> String {
    format!("node {} ({})", node.id, node.name)
}

/// Whether the control can do nothing any more.
fn is_silenced(status: Option<&Status>) -> bool {
    status.is_some_and(|status| status.state == State::Silenced)
}

/// What is wrong, in sentences.
fn troubles(view: &NetworkView, status: Option<&Status>) -> Vec<String> {
    if is_silenced(status) {
        // What is known of the nodes is from before.
        return vec![silenced(view.protocol != Protocol::None.name(), false).text];
    }
    let Some(live) = &view.live else {
        return Vec::new();
    };
    let mut list = Vec::new();
    if let Some(foreign) = &live.foreign {
        list.push(foreign.clone());
    }
    if live.nmt_state != terms(view).operational {
        let why = live.why.as_deref().unwrap_or("no reason is known");
        list.push(format!("the network is {}: {why}", live.nmt_state));
    }
    for node in &view.nodes {
        let place = match node.line {
            Some(line) => format!(" ([[bus.node]] line {line})"),
            None => String::new(),
        };
        match &node.live {
            Some(live) if live.operational => {}
            Some(live) => {
                let why = live.why.as_ref().map_or("no reason is known", |why| why.text.as_str());
                list.push(format!("{} not operational: {why}{place}", who(node)));
            }
            None => list.push(format!("{}: nothing is known yet{place}", who(node))),
        }
    }
    list
}

/// One line above everything: whose network, and where it is told from.
fn head(view: &NetworkView, status: Option<&Status>, out: &mut impl Write) -> io::Result<()> {
    match (&view.live, status) {
        (_, None) => writeln!(
            out,
            "{}: no control is running; this is what {} says",
            view.machine, view.file
        ),
        (None, _) => writeln!(
            out,
            "{}: the control has just started, the network is not known yet",
            view.machine
        ),
        (Some(live), Some(status)) => writeln!(
            out,
            "{}: network {} on {}, machine {}, process {}",
            view.machine, live.nmt_state, view.interface, status.state, status.pid
        ),
    }
}

fn tail(view: &NetworkView, status: Option<&Status>, out: &mut impl Write) -> io::Result<()> {
    let troubles = troubles(view, status);
    if troubles.is_empty() {
        return Ok(());
    }
    writeln!(out)?;
    troubles.iter().try_for_each(|trouble| writeln!(out, "{trouble}"))
}

fn nodes(view: &NetworkView, status: Option<&Status>, out: &mut impl Write) -> io::Result<()> {
    head(view, status, out)?;
    node_table(view, out)?;
    tail(view, status, out)
}

/// Identity as reported, or as expected where nothing was reported.
fn node_table(view: &NetworkView, out: &mut impl Write) -> io::Result<()> {
    let hex = |value: Option<u32>| value.map_or("any".into(), |value| format!("0x{value:08X}"));
    let decimal = |value: Option<u32>| value.map_or("any".into(), |value| value.to_string());
    let told = |value: u32| if value == 0 { "-".into() } else { hex(Some(value)) };
    let mut rows = Vec::new();
    for node in &view.nodes {
        let (id, name) = (node.id.to_string(), node.name.clone());
        let expected = &node.expected;
        let wanted = [
            hex(expected.device_type),
            hex(expected.vendor_id),
            hex(expected.product_code),
            hex(expected.revision),
            decimal(expected.serial),
        ];
        let mut row = |id: String, name: String, what: &str, identity: [String; 5], state: &str| {
            let [kind, vendor, product, revision, serial] = identity;
            rows.push(vec![
                id,
                name,
                what.into(),
                kind,
                vendor,
                product,
                revision,
                serial,
                state.into(),
            ]);
        };
        let reported = node.live.as_ref().map(|live| (live, live.identity.as_ref()));
        let Some((live, Some(identity))) = reported else {
            row(id, name, "expected", wanted, reported.map_or("", |_| "not heard of"));
            continue;
        };
        let got = [
            // A device of EtherCAT is not asked for it, and 0 stands for none.
            told(identity.device_type),
            hex(Some(identity.vendor_id)),
            hex(Some(identity.product_code)),
            hex(Some(identity.revision)),
            identity.serial.to_string(),
        ];
        let differs = wanted
            .iter()
            .zip(&got)
            .any(|(wanted, got)| wanted != "any" && got != "-" && wanted != got);
        row(id, name, "is", got, &live.nmt_state);
        if differs {
            row(String::new(), String::new(), "expected", wanted, "");
        }
    }
    let heading = [
        ">id",
        "name",
        "",
        "device type",
        "vendor",
        "product",
        "revision",
        "serial",
        "state",
    ];
    write!(out, "\n{}", table(&heading, rows))
}

fn state(view: &NetworkView, status: Option<&Status>, out: &mut impl Write) -> io::Result<()> {
    head(view, status, out)?;
    state_table(view, out)?;
    errors(view, out)?;
    tail(view, status, out)
}

fn state_table(view: &NetworkView, out: &mut impl Write) -> io::Result<()> {
    if let Some(live) = &view.live {
        let Terms {
            has_skipped,
            unanswered,
            unusable,
            ..
        } = terms(view);
        let skipped = match has_skipped {
            true => format!("{} skipped, {} cut off; ", live.cycles_skipped, live.cycles_overrun),
            false => String::new(),
        };
        writeln!(
            out,
            "{} of {} us; {skipped}{} {unanswered}, {}",
            counted(live.cycles, "cycle"),
            view.cycle_us,
            live.async_timeouts,
            counted(live.bad_frames, unusable)
        )?;
    }
    let rows = view.nodes.iter().map(|node| {
        let mut row = vec![node.id.to_string(), node.name.clone()];
        match &node.live {
            None => row.push("-".into()),
            Some(live) => row.extend([
                live.nmt_state.clone(),
                live.polls.to_string(),
                live.lost.to_string(),
                live.lost_in_row_max.to_string(),
                (terms(view).refused)(live).to_string(),
                format!("{:.1} us", live.response_max_us),
                live.boots.to_string(),
                live.faults.to_string(),
            ]),
        }
        row
    });
    write!(out, "\n{}", table(&terms(view).columns, rows))
}

/// What the nodes signalled, and what went wrong with them before.
fn errors(view: &NetworkView, out: &mut impl Write) -> io::Result<()> {
    let mut first = true;
    let mut line = |out: &mut dyn Write, text: String| {
        if std::mem::take(&mut first) {
            writeln!(out, "\nhistory")?;
        }
        writeln!(out, "{text}")
    };
    for node in &view.nodes {
        let Some(live) = &node.live else { continue };
        if let Some(fault) = &live.last_fault {
            line(out, format!("  {}: {fault}", who(node)))?;
        }
        for error in &live.errors {
            line(out, format!("  {}: signalled {error}", who(node)))?;
        }
        let older = live.errors_total.saturating_sub(live.errors.len() as u64);
        if older > 0 {
            line(out, format!("  {}: and {}", who(node), counted(older, "older error")))?;
        }
    }
    Ok(())
}

fn pdo(view: &NetworkView, status: Option<&Status>, out: &mut impl Write) -> io::Result<()> {
    head(view, status, out)?;
    mapping(view, out)?;
    match is_silenced(status) {
        true => tail(view, status, out),
        false => Ok(()),
    }
}

/// What each node gets and sends, side by side.
fn mapping(view: &NetworkView, out: &mut impl Write) -> io::Result<()> {
    /// Of the left side, at least.
    const WIDTH: usize = 44;
    for node in &view.nodes {
        writeln!(out, "\n{}", who(node))?;
        let octets = |objects: &[MappedView]| {
            objects
                .iter()
                .map(|object| u64::from(object.bits))
                .sum::<u64>()
                .div_ceil(8)
        };
        let [to_node, from_node] = terms(view).payloads;
        let left = format!("{to_node}: {}", counted(octets(&node.outputs), "octet"));
        let right = format!("{from_node}: {}", counted(octets(&node.inputs), "octet"));
        let cell = |object: Option<&MappedView>| {
            object.map_or(String::new(), |object| {
                let first = object.offset_bits / 8;
                let last = (object.offset_bits + u32::from(object.bits)).div_ceil(8).max(first + 1) - 1;
                let place = if first == last {
                    first.to_string()
                } else {
                    format!("{first}..{last}")
                };
                let name = super::words::profile_object_name(object.index);
                let at = bus::service::object(object.index, object.sub);
                format!("{place:>7} | {at:9} | {name}")
            })
        };
        let rows = (0..node.outputs.len().max(node.inputs.len()))
            .map(|row| [&node.outputs, &node.inputs].map(|objects| cell(objects.get(row))));
        let rows: Vec<[String; 2]> = [[left, right]].into_iter().chain(rows).collect();
        let width = rows
            .iter()
            .map(|[left, _]| left.chars().count())
            .max()
            .unwrap_or(0)
            .max(WIDTH);
        for [left, right] in rows {
            let text = format!("  {left:width$}  {right}");
            writeln!(out, "{}", text.trim_end())?;
        }
    }
    Ok(())
}

/// How the cycle is spent, with the latencies that the nodes have told.
fn budget(view: &NetworkView, out: &mut impl Write) -> io::Result<()> {
    let told = |line: &BudgetView| {
        let node = view.nodes.iter().find(|node| Some(node.id) == line.node)?;
        Some(node.live.as_ref()?.identity.as_ref()?.response_time_us)
    };
    let (mut expected_us, mut worst_us) = (0.0, 0.0);
    let rows = view.budget.iter().map(|line| {
        let latency_us = told(line).unwrap_or(line.latency_us);
        expected_us += line.wire_us + latency_us;
        worst_us += line.worst_us;
        let node = view.nodes.iter().find(|node| Some(node.id) == line.node);
        let us = |value: f64| format!("{value:.1}");
        vec![
            node.map_or("all".into(), |node| node.name.clone()),
            us(line.wire_us),
            us(latency_us),
            us(line.worst_us),
            line.part.clone(),
        ]
    });
    let cycle = format!("cycle of {} us", view.cycle_us);
    let rows = table(&[&cycle, ">wire us", ">latency us", ">worst us", "for"], rows);
    let share = |us: f64| 100.0 * us / f64::from(view.cycle_us);
    writeln!(
        out,
        "\n{rows}together {expected_us:.1} us when all goes well ({:.0} %), {worst_us:.1} us at worst ({:.0} %)",
        share(expected_us),
        share(worst_us)
    )
}

fn report(view: &NetworkView, status: Option<&Status>, out: &mut impl Write) -> io::Result<()> {
    writeln!(out, "isocnc {} bus report", env!("CARGO_PKG_VERSION"))?;
    head(view, status, out)?;
    if let Some(status) = status {
        writeln!(out, "machine file {}", view.file)?;
        writeln!(
            out,
            "cycles begin up to {:.1} us late, {} were skipped",
            status.late_max_us, status.cycles_skipped
        )?;
    }
    if view.live.is_some() || is_silenced(status) {
        match &troubles(view, status)[..] {
            [] => writeln!(out, "\nno trouble: every node is operational")?,
            _ => tail(view, status, out)?,
        }
    }
    node_table(view, out)?;
    if view.live.is_some() {
        writeln!(out)?;
        state_table(view, out)?;
        errors(view, out)?;
    }
    budget(view, out)?;
    mapping(view, out)
}

#[cfg(test)]
mod tests;
