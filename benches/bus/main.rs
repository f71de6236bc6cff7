//! What the bus costs: `cargo bench --bench bus`, shorter with `-- --quick`; `-- own`, `-- wire`, `-- ethercat`, `-- links`, `-- grid` run
//! one part.
//!
//! - own: parsing and writing frames; a whole isochronous cycle of the managing node without a wire, per node.
//! - wire: SoC to SoA over a veth pair, the nodes on the same core above the managing node.
//! - ethercat: the same on EtherCAT, in turns with POWERLINK; the shortest cycles that are kept.
//! - links: the same over the ring of the raw socket and over libpnet, in turns.
//! - grid: the shortest cycles that are kept, and what kept those that were not.
//!
//! Each is held against a minimal loop of fixed frames in the same run. Nothing is asserted but that the network works:
//! the figures are as good as the PC is quiet, so its load and the time that a host took from it are printed beside them.

mod ethercat;
mod minimal;
mod network;
mod own;
mod socket;
mod wire;

/// A figure of ours and that of the minimal loop.
pub(crate) struct Figures {
    pub(crate) own: f64,
    pub(crate) least: f64,
}

/// The middle value.
pub(crate) fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// Load average, and the share of time that the host took from this PC's cores since the last call.
fn pc(before: &mut Option<[u64; 2]>) -> String {
    let stat = std::fs::read_to_string("/proc/stat").unwrap_or_default();
    let ticks: Vec<u64> = stat
        .lines()
        .next()
        .unwrap_or_default()
        .split_whitespace()
        .filter_map(|word| word.parse().ok())
        .collect();
    // user nice system idle iowait irq softirq steal; guest times are in user already.
    let now = [ticks.iter().take(8).sum(), ticks.get(7).copied().unwrap_or(0)];
    let since = before.replace(now).unwrap_or([0; 2]);
    let [all, stolen] = [now[0] - since[0], now[1] - since[1]];
    let load = std::fs::read_to_string("/proc/loadavg").unwrap_or_default();
    let steal = 100.0 * stolen as f64 / all.max(1) as f64;
    format!("load average {}, steal {steal:.2} %", load.trim())
}

fn main() -> anyhow::Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let wanted = |part: &str| {
        let mut parts = arguments
            .iter()
            .filter(|argument| !argument.starts_with("--"))
            .peekable();
        parts.peek().is_none() || parts.any(|wanted| wanted == part)
    };
    let mut ticks = None;
    println!("since start        {}", pc(&mut ticks));
    if wanted("own") {
        own::parse_and_emit();
        own::cycle_of::<1>();
        own::cycle_of::<8>();
        own::cycle_of::<32>();
        own::cycle_of::<239>();
        println!("meanwhile          {}", pc(&mut ticks));
    }
    if !["wire", "ethercat", "links", "grid"].into_iter().any(wanted) {
        return Ok(());
    }
    let cycles = if arguments.iter().any(|argument| argument == "--quick") {
        300
    } else {
        2500
    };
    let bench = match wire::Bench::prepare() {
        Ok(bench) => bench,
        Err(why) => {
            println!("no wire: {why:#}");
            return Ok(());
        }
    };
    if wanted("wire") {
        wire::exchange::<2>(&bench, 1000, cycles, "");
        wire::exchange::<8>(&bench, 1000, cycles, " (goal: median <= 50 us)");
        wire::exchange::<32>(&bench, 1000, cycles, " (goal: median <= 130 us)");
        wire::exchange::<239>(&bench, 4000, cycles / 4, "");
        println!("meanwhile          {}", pc(&mut ticks));
    }
    if wanted("ethercat") {
        ethercat::exchange::<8>(&bench, cycles, " (goal: median <= 30 us)");
        ethercat::exchange::<32>(&bench, cycles, " (goal: median <= 60 us)");
        ethercat::shortest(&bench, 8, 125, 4 * cycles);
        ethercat::shortest(&bench, 32, 250, 4 * cycles);
        ethercat::shortest(&bench, 100, 2000, cycles);
        println!("meanwhile          {}", pc(&mut ticks));
    }
    if wanted("links") {
        wire::links::<2>(&bench, cycles / 5);
        wire::links::<8>(&bench, cycles / 5);
        println!("meanwhile          {}", pc(&mut ticks));
    }
    if wanted("grid") {
        wire::shortest::<2>(&bench, 150, 10_000, 4 * cycles);
        wire::shortest::<8>(&bench, 200, 10_000, 4 * cycles);
        wire::shortest::<32>(&bench, 400, 4_000, 4 * cycles);
        wire::shortest::<239>(&bench, 2000, 1_000, cycles);
        println!("meanwhile          {}", pc(&mut ticks));
    }
    Ok(())
}
