//! `docs/stops.md`: how the demo machine stops for each kind of fault, measured on virtual time.

use super::{compare, head, row};
use isocnc::config::{self, Config, StopCategory};
use isocnc::machine::state::State;
use isocnc::operator::rehearsal::{Rehearsal, rehearse};
use isocnc::rt::shared::Command;
use isocnc::sim::{Disturbance, NetConfig};
use powerlink::wire::{Header, Soc, multicast};
use std::path::Path;

/// Two long lines and an arc between them, at 3 m/min; nothing is near its limit of travel.
const PART: &str =
    "G21 G90 G94 G54 G17 G64 P0.01\nG0 X40 Y40 Z0\nS1000 M3\nG1 X90 Y60 F3000\nG3 X110 Y80 J20\nG1 X80 Y130\nM5\nM2\n";
/// A thread of 1.5 mm at 600 1/min.
const THREAD: &str = "G21 G90 G18 G94 G54 G64\nG0 X20 Z5\nS600 M3\nG33 Z-40 K1.5\nG0 X25\nM5\nM2\n";
/// The line that is cut.
const CUT: u32 = 4;
const CYCLES_MAX: u64 = 60_000;
/// Cycles after which what stands is taken to stand for good: longer than a spindle is waited for.
const STILL_CYCLES: u32 = 6_000;
/// What a load moves in a cycle at the most that stands.
const STILL_MM: f64 = 1e-4;

/// A cause, and what sets it going.
type Cause = (&'static str, fn(&mut Rehearsal<'_>));

/// While the lathe cuts a thread.
const OF_SPINDLES: [Cause; 2] = [
    ("counts of the spindle's encoder get lost in a thread", |run| {
        run.net().machine_mut().slip_encoder(10, -20);
    }),
    ("the spindle sticks in a thread", |run| {
        run.net().machine_mut().block_spindle(10, true);
    }),
];

/// Where the machine file has the category 0.
const OF_CATEGORY_0: [Cause; 1] = [("emergency stop by order, `[estop] category = 0`", |run| {
    run.operator.give(Command::Estop)
})];

const CAUSES: [Cause; 17] = [
    ("`isocnc hold`", |run| run.operator.give(Command::Hold)),
    ("`isocnc stop`", |run| run.operator.give(Command::Stop)),
    ("`isocnc off`", |run| run.operator.give(Command::Disable)),
    ("the mains fail", |run| {
        run.hal.set("iocontrol.0.mains-ok", false).expect("a pin")
    }),
    ("a limit switch closes", |run| {
        run.hal.set("joint.2.pos-lim-sw-in", true).expect("a pin")
    }),
    ("following error: an axis jams", |run| {
        run.net().machine_mut().jam(1, true);
    }),
    ("fault of a drive", |run| {
        let error_code = 0x7305;
        disturb(run, Disturbance::DriveFault { node: 1, error_code });
    }),
    ("warning of a drive", |run| {
        run.net().machine_mut().drive_injected(1).expect("a drive").warning = true;
    }),
    ("cable of a drive pulled", |run| {
        disturb(run, Disturbance::Unplug { node: 1 })
    }),
    ("power of a drive cut", |run| {
        disturb(run, Disturbance::PowerOff { node: 1 })
    }),
    ("cable of the I/O node pulled", |run| {
        disturb(run, Disturbance::Unplug { node: 10 })
    }),
    ("another managing node is heard", |run| {
        let header = Header::multicast(multicast::SOC, [2, 0, 0, 0, 0, 9], 240);
        let mut frame = [0; 60];
        let length = Soc::default().emit(&header, &mut frame).expect("room for a SoC");
        run.net().inject(&frame[..length]);
    }),
    ("emergency stop by order", |run| run.operator.give(Command::Estop)),
    ("the emergency stop chain opens", |run| {
        run.hal.set("iocontrol.0.emc-enable-in", false).expect("a pin");
    }),
    ("the safety circuit of one drive opens (STO)", |run| {
        run.net().machine_mut().drive_injected(1).expect("a drive").sto_open = true;
    }),
    ("the safety circuits of all drives open (STO)", |run| {
        for node in [1, 2, 3] {
            run.net().machine_mut().drive_injected(node).expect("a drive").sto_open = true;
        }
    }),
    ("the cycle thread hangs", |run| run.control.inhibit_soc()),
];

fn disturb(run: &mut Rehearsal<'_>, disturbance: Disturbance) {
    let now_ns = run.now_ns();
    run.net().at(now_ns, disturbance);
}

fn machine(text: &str) -> Config {
    let text = text.replace("[[joint]]", "[[joint]]\nsto = { object = \"0x60FD\", bit = 3 }");
    let mut config = config::parse(&text, Path::new("machine.toml")).expect("a good machine file");
    config.bus.pres_lost_max = 3;
    config
}

/// Where they are; a joint that is none stands at 0.
fn loads(run: &mut Rehearsal<'_>) -> [f64; 3] {
    let machine = run.net().machine();
    [0, 1, 2].map(|joint| machine.joint_position_mm(joint).unwrap_or(0.0))
}

fn apart(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    (0..3).map(|axis| (a[axis] - b[axis]).powi(2)).sum::<f64>().sqrt()
}

fn off_chord(at: &[f64; 3], [from, to]: [&[f64; 3]; 2]) -> f64 {
    let along = [0, 1, 2].map(|axis| to[axis] - from[axis]);
    let length2: f64 = along.iter().map(|by| by * by).sum();
    let dot: f64 = (0..3).map(|axis| (at[axis] - from[axis]) * along[axis]).sum();
    let share = if length2 > 0.0 {
        (dot / length2).clamp(0.0, 1.0)
    } else {
        0.0
    };
    apart(at, &[0, 1, 2].map(|axis| from[axis] + share * along[axis]))
}

/// Places of the loads from the cut on, to the end or until they stand; the cause comes 100 cycles behind its begin.
fn run_part(config: &Config, part: &str, cause: Option<fn(&mut Rehearsal<'_>)>) -> (Vec<[f64; 3]>, State) {
    rehearse(config, part.as_bytes(), NetConfig::clean(1), |run| {
        let cuts = |run: &mut Rehearsal<'_>| {
            let live = run.operator.live();
            live.line == CUT && live.velocity_mm_s > 0.0
        };
        assert!(run.run_until(CYCLES_MAX, cuts)?);
        let mut places = Vec::new();
        let mut still = 0;
        for cycle in 0..CYCLES_MAX {
            if let Some(cause) = cause.filter(|_| cycle == 100) {
                cause(run);
            }
            run.cycle(0)?;
            let at = loads(run);
            still = match places.last() {
                Some(before) if apart(before, &at) < STILL_MM => still + 1,
                _ => 0,
            };
            places.push(at);
            if still > STILL_CYCLES {
                break;
            }
        }
        Ok((places, run.control.state()))
    })
    .expect("a rehearsal")
}

/// Rows of a table: what comes of these causes while a machine runs a part.
fn rows(config: &Config, part: &str, causes: &[Cause]) -> String {
    let (path, _) = run_part(config, part, None);
    let mut rows = String::new();
    for &(what, cause) in causes {
        let (places, state) = run_part(config, part, Some(cause));
        let moved = places
            .windows(2)
            .rposition(|pair| apart(&pair[0], &pair[1]) >= STILL_MM);
        let last = moved.map_or(0, |at| at + 1);
        let stopping = &places[100..=last.max(100)];
        let way: f64 = stopping.windows(2).map(|pair| apart(&pair[0], &pair[1])).sum();
        let off = stopping.iter().map(|at| {
            let chords = path.windows(2).map(|chord| off_chord(at, [&chord[0], &chord[1]]));
            chords.fold(f64::INFINITY, f64::min)
        });
        let off_mm = off.fold(0.0, f64::max);
        assert!(last < 1_100, "{what}: {last} cycles");
        assert_ne!(state, State::Running, "{what}");
        let cells = [
            what.to_owned(),
            state.name().to_owned(),
            (last.saturating_sub(100)).to_string(),
            format!("{way:.2}"),
            format!("{off_mm:.3}"),
        ];
        rows += &row(&cells.each_ref().map(String::as_str));
    }
    rows
}

#[test]
fn how_the_machine_stops() {
    let mill = machine(include_str!("../../configs/mill3-demo.toml"));
    let mut category_0 = mill.clone();
    category_0.stops.emergency = StopCategory::Zero;
    let lathe = machine(include_str!("../../configs/lathe2-demo.toml"));
    let columns = [
        "cause",
        "final state",
        "to standstill, ms",
        "distance, mm",
        "max distance from the path, mm",
    ];
    let table = head(&columns)
        + &rows(&mill, PART, &CAUSES)
        + &rows(&category_0, PART, &OF_CATEGORY_0)
        + &rows(&lathe, THREAD, &OF_SPINDLES);
    let page = format!(
        "# How the machine stops\n\n\
         When the cause comes, the machine of [`configs/mill3-demo.toml`](../configs/mill3-demo.toml) cuts along a line at 3 m/min, or that of\n\
         [`configs/lathe2-demo.toml`](../configs/lathe2-demo.toml) cuts a thread at 0.9 m/min. `pres_lost_max` is 3, and the drives report their\n\
         safety circuits. The simulated loads are measured on virtual time: how they move from the cycle of the cause to the last one in which\n\
         a load moves by {STILL_MM} mm, and how far they leave the path that they follow without the cause. Motors without torque coast against a\n\
         friction that is as strong as their quick stop; that of a real machine seldom is.\n\n\
         Lost counts show at the next index of the spindle, at most a turn later. A spindle that does not reach its speed or its\n\
         angle is a fault, too, but then nothing moves. [faults.md](faults.md) describes each fault.\n\n\
         <!-- made by tests/references: do not edit -->\n\n{table}"
    );
    compare("docs/stops.md", &page);
}
