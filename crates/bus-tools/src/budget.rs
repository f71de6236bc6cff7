//! How a cycle is spent, for a terminal and as JSON, in the terms of each protocol.
//!
//! In:  the checked machine description, the plans of its nodes. Out: a line for each part of the exchange, and what is left.

use crate::check::with_mn_config;
use bus::plan::NodePlan;
use bus::powerlink::managing_node::latencies;
use config::{Config, Protocol};
use powerlink::mn::{Budget, BudgetLine, Part};
use serde_json::{Value as Json, json};
use std::fmt;

/// How a protocol shows what a cycle costs.
trait Shown {
    /// As [`write`].
    fn write(&self, f: &mut fmt::Formatter<'_>, config: &Config, plans: &[NodePlan]) -> fmt::Result;

    /// As [`json`].
    fn json(&self, config: &Config, plans: &[NodePlan]) -> Json;
}

fn shown(config: &Config) -> &'static dyn Shown {
    match config.bus.kind.protocol() {
        Protocol::Powerlink | Protocol::None => &Powerlink,
        Protocol::Ethercat => &Ethercat,
        #[cfg(feature = "testing")]
        Protocol::Toy => &Ethercat,
    }
}

/// The budget of the cycle as a table.
pub fn write(f: &mut fmt::Formatter<'_>, config: &Config, plans: &[NodePlan]) -> fmt::Result {
    shown(config).write(f, config, plans)
}

/// The budget as JSON, times in ns.
pub fn json(config: &Config, plans: &[NodePlan]) -> Json {
    shown(config).json(config, plans)
}

/// Expected and worst times: nodes answer one after another, each within its time-out.
struct Powerlink;

impl Shown for Powerlink {
    fn write(&self, f: &mut fmt::Formatter<'_>, config: &Config, plans: &[NodePlan]) -> fmt::Result {
        let latencies_ns = latencies(&config.bus);
        with_mn_config(config, plans, |mn| {
            let budget = Budget::new(mn, &latencies_ns);
            let us = |ns: u64| ns as f64 / 1000.0;
            let of_round = match budget.longest_cycle() {
                0 => String::new(),
                cycle => format!(", cycle {cycle} of a round of {}", mn.multiplex_cycles),
            };
            writeln!(
                f,
                "{:<10}{:<46}{:>11}{:>9}",
                "cycle",
                format!("{} us{of_round}", config.cycle_us),
                "expected us",
                "worst us"
            )?;
            let takes_part = |line: &BudgetLine| match line.part {
                Part::Poll { multiplex_cycle, .. } => multiplex_cycle == 0 || multiplex_cycle == budget.longest_cycle(),
                Part::Soc | Part::SocToPreq | Part::PresMn { .. } => true,
                Part::Chained { .. } | Part::Chain | Part::Soa | Part::AsyncSlot { .. } => true,
            };
            for line in budget.lines().filter(takes_part) {
                let part = part(&line, config, &latencies_ns);
                writeln!(
                    f,
                    "          {part:<48}{:>9.1}{:>9.1}",
                    us(line.expected_ns()),
                    us(line.worst_ns)
                )?;
            }
            let (expected_ns, worst_ns) = (budget.expected_ns(), budget.worst().total_ns());
            let left = |ns: u64| us(u64::from(mn.cycle_ns)) - us(ns);
            writeln!(
                f,
                "          {:<48}{:>9.1}{:>9.1}",
                "sum",
                us(expected_ns),
                us(worst_ns)
            )?;
            writeln!(
                f,
                "          {:<48}{:>9.1}{:>9.1}",
                "left for computing",
                left(expected_ns),
                left(worst_ns)
            )
        })
    }

    fn json(&self, config: &Config, plans: &[NodePlan]) -> Json {
        let latencies_ns = latencies(&config.bus);
        with_mn_config(config, plans, |mn| {
            let budget = Budget::new(mn, &latencies_ns);
            let lines = budget.lines().map(|line| {
                json!({
                    "part": part(&line, config, &latencies_ns),
                    "wire_ns": line.wire_ns,
                    "expected_ns": line.expected_ns(),
                    "worst_ns": line.worst_ns,
                })
            });
            json!({
                "parts": lines.collect::<Vec<_>>(),
                "longest_cycle_of_round": budget.longest_cycle(),
                "expected_ns": budget.expected_ns(),
                "worst_ns": budget.worst().total_ns(),
                "left_ns": u64::from(mn.cycle_ns).saturating_sub(budget.worst().total_ns()),
            })
        })
    }
}

/// One time: half of the cycle is that of the frames, which pass all devices.
struct Ethercat;

impl Shown for Ethercat {
    fn write(&self, f: &mut fmt::Formatter<'_>, config: &Config, _plans: &[NodePlan]) -> fmt::Result {
        let us = |ns: u64| ns as f64 / 1000.0;
        writeln!(f, "{:<10}{:<57}{:>9}", "cycle", format!("{} us", config.cycle_us), "us")?;
        for line in bus::budget(config) {
            writeln!(f, "          {:<57}{:>9.1}", line.part, line.worst_us)?;
        }
        let sum_ns = bus::worst_exchange_ns(config);
        let left_ns = (u64::from(config.cycle_us) * 1000).saturating_sub(sum_ns);
        writeln!(f, "          {:<57}{:>9.1}", "sum", us(sum_ns))?;
        writeln!(f, "          {:<57}{:>9.1}", "left for computing", us(left_ns))
    }

    fn json(&self, config: &Config, _plans: &[NodePlan]) -> Json {
        let ns = |us: f64| (us * 1e3).round() as u64;
        let sum_ns = bus::worst_exchange_ns(config);
        let lines = bus::budget(config).into_iter().map(|line| {
            let (wire_ns, worst_ns) = (ns(line.wire_us), ns(line.worst_us));
            json!({ "part": line.part, "wire_ns": wire_ns, "expected_ns": worst_ns, "worst_ns": worst_ns })
        });
        json!({
            "parts": lines.collect::<Vec<_>>(),
            "longest_cycle_of_round": 0,
            "expected_ns": sum_ns,
            "worst_ns": sum_ns,
            "left_ns": (u64::from(config.cycle_us) * 1000).saturating_sub(sum_ns),
        })
    }
}

/// What a line of the budget is for.
fn part(line: &BudgetLine, config: &Config, latencies_ns: &[Option<u32>]) -> String {
    let name = |node: usize| config.bus.nodes.get(node).map_or("", |node| node.name.as_str());
    match line.part {
        Part::Soc => "SoC".to_owned(),
        Part::SocToPreq => "pause before the first PReq".to_owned(),
        Part::Poll {
            node,
            preq_octets,
            pres_octets,
            ..
        } => {
            let unknown = latencies_ns.get(node).copied().flatten().is_none();
            let by_timeout = if unknown { ", latency unknown" } else { "" };
            format!("{:<12} {preq_octets} + {pres_octets} octets{by_timeout}", name(node))
        }
        Part::PresMn { octets } => format!("PRes of the managing node, {octets} octets"),
        Part::Chained { node, octets } => format!("{:<12} chained, {octets} octets", name(node)),
        Part::Chain => "wait for the chain".to_owned(),
        Part::Soa => "SoA".to_owned(),
        Part::AsyncSlot { octets } => format!("asynchronous slot, ASnd of up to {octets} octets"),
    }
}
