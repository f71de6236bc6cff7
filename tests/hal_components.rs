//! Components of the machine file in a running control, on virtual time: in which cycle they act.

use isocnc::config;
use isocnc::machine::sequence::Outcome;
use isocnc::operator::rehearsal::rehearse;
use isocnc::sim::NetConfig;
use std::path::Path;

const MACHINE: &str = include_str!("../configs/mill3-demo.toml");
const CYCLES_MAX: u64 = 200_000;

/// Behind a rise of X above 30 mm, a pulse of 500 ms holds the machine. What programs say by M62 leaves inverted for a node.
const COMPONENTS: &str = r#"
[[hal.component]]
name = "comp.0"
type = "comp"
set = { in0 = 30 }

[[hal.component]]
name = "oneshot.0"
type = "oneshot"
set = { width = 0.5 }

[[hal.component]]
name = "not.0"
type = "not"
place = "after-motion"

[[hal.net]]
name = "x"
source = "axis.x.pos-cmd"
targets = ["comp.0.in1"]

[[hal.net]]
name = "beyond"
source = "comp.0.out"
targets = ["oneshot.0.in"]

[[hal.net]]
name = "hold"
source = "oneshot.0.out"
targets = ["motion.feed-hold"]

[[hal.net]]
name = "laser"
source = "motion.digital-out-01"
targets = ["not.0.in"]

[[hal.net]]
name = "no-laser"
source = "not.0.out"
targets = ["io.10.out-05"]
"#;

const PROGRAM: &str = "G21 G90 G53 G0 X10\nM64 P1\nG53 G1 X60 F3000\nM65 P1\nM2\n";

/// What is seen behind a cycle.
#[derive(Clone, Copy, Debug)]
struct Seen {
    x: f64,
    speed: f64,
    held: bool,
    output: bool,
    node_bit: bool,
}

fn seen() -> Vec<Seen> {
    let text = format!("{MACHINE}{COMPONENTS}");
    let config = config::parse(&text, Path::new("mill3-demo.toml")).unwrap_or_else(|errors| panic!("{errors}"));
    rehearse(&config, PROGRAM.as_bytes(), NetConfig::clean(1), |run| {
        let bit = |name: &str| run.hal.reader::<bool>(name).expect("a pin");
        let number = |name: &str| run.hal.reader::<f64>(name).expect("a pin");
        let (held, output, node_bit) = (
            bit("motion.feed-hold"),
            bit("motion.digital-out-01"),
            bit("io.10.out-05"),
        );
        let (x, speed) = (number("axis.x.pos-cmd"), number("motion.current-vel"));
        let mut seen = Vec::new();
        let ended = run.run_until(CYCLES_MAX, |run| {
            seen.push(Seen {
                x: x.get(),
                speed: speed.get(),
                held: held.get(),
                output: output.get(),
                node_bit: node_bit.get(),
            });
            run.operator.outcome().is_some()
        });
        assert!(ended.expect("a good program"), "{:#?}", run.operator.journal());
        assert_eq!(run.operator.outcome(), Some(Outcome::Completed));
        Ok(seen)
    })
    .expect("a machine to rehearse on")
}

#[test]
fn components_act_in_the_cycle_that_their_list_says() {
    let seen = seen();
    // After motion: the output of the node changes in the very cycle in which the program says so.
    assert!(seen.iter().any(|seen| seen.output) && seen.iter().any(|seen| !seen.output));
    assert!(seen.iter().skip(1).all(|seen| seen.node_bit != seen.output));
    // Before motion: X is that of the cycle before, and the hold acts at once, for 500 calls.
    let beyond = seen.iter().position(|seen| seen.x > 30.0).expect("X gets there");
    let held: Vec<usize> = (0..seen.len()).filter(|cycle| seen[*cycle].held).collect();
    assert_eq!(held.first(), Some(&(beyond + 1)));
    assert_eq!(held.len(), 500);
    // It comes to rest, waits, and goes on to the end.
    let rest = (held[0]..=held[499]).filter(|cycle| seen[*cycle].speed == 0.0).count();
    assert!(rest > 100, "{rest}");
    assert!(seen.iter().any(|seen| seen.x > 59.9));
}
