//! Joints with step pulses: one case per rule, and what a good file becomes.

use super::*;

const PLOTTER: &str = include_str!("../../../configs/plotter2-steps.toml");

fn errors(from: &str, to: &str) -> Vec<String> {
    let text = PLOTTER.replacen(from, to, 1);
    assert_ne!(text, PLOTTER, "{from}");
    match parse(&text, Path::new("p.toml")) {
        Ok(_) => Vec::new(),
        Err(errors) => errors.errors().iter().map(ToString::to_string).collect(),
    }
}

#[test]
fn the_plotter_that_ships_is_two_joints_on_six_pins() {
    let config = parse(PLOTTER, Path::new("p.toml")).unwrap_or_else(|errors| panic!("{errors}"));
    let steps = config.steps.unwrap();
    assert_eq!(
        (steps.pins, steps.tick_ns, steps.inverted),
        (vec![2, 3, 14, 4, 5, 16], 50_000, 0)
    );
    assert_eq!(config.bus.nodes.len(), 0);
    let nodes: Vec<usize> = config.joints.iter().map(|joint| joint.node).collect();
    assert_eq!(nodes, [0, 1]);
    let second = config.joints[1].step.unwrap();
    assert_eq!((second.lines, second.enable), ([3, 4], Some(5)));
    assert_eq!(second.timing.ticks_per_cycle, 20);
    // In parts of a step, which even out the pulses.
    assert_eq!(config.joints[0].counts_per_unit, [80 * SUBSTEPS, 1]);
}

#[test]
fn what_cannot_be_is_refused_with_its_place() {
    for (from, to, expected) in [
        (
            "velocity_mm_s = 100.0",
            "velocity_mm_s = 126.0",
            "joint[0].velocity_mm_s = 126.0: must not be above 125: a pulse of 1 and a pause of 1 ticks of 50 us make 10000 steps/s at the most",
        ),
        (
            "length_ticks = 1, space_ticks = 1",
            "length_ticks = 2, space_ticks = 1",
            "joint[0].velocity_mm_s = 100.0: must not be above 83.33",
        ),
        (
            "pins = [4, 5]",
            "pins = [4, 3]",
            "joint[1].step.pins = [4, 3]: pin 3 is taken by another line",
        ),
        (
            "pins = [4, 5]",
            "pins = [4]",
            "joint[1].step.pins = [4]: must be two: one for each line",
        ),
        (
            "pins = [4, 5], enable_pin = 16",
            "pins = [4, 5], enable_pin = 14",
            "joint[1].step.enable_pin = 14: pin 14 is taken by another line",
        ),
        (
            "type = \"step-dir\"",
            "type = \"quadrature\"",
            "joint[0].step.setup_ticks = 1: is of type = \"step-dir\": there is no line of the direction",
        ),
        (
            "type = \"step-dir\"",
            "type = \"dir-step\"",
            "joint[0].step.type = \"dir-step\": must be \"step-dir\" or \"up-down\" or \"quadrature\"",
        ),
        (
            "output = \"step\"",
            "output = \"step\"\nmode = \"csp\"",
            "joint[0].mode = \"csp\": is of a drive on the bus: this joint has output = \"step\"",
        ),
        (
            "method = 37",
            "method = 21",
            "joint[0].homing.method = 21: must be 37 (it is homed where it stands), or by = \"control\"",
        ),
        (
            "timeout_us = 50",
            "timeout_us = 60",
            "steps.port = \"simulated\": needs a cycle_us (1000) that is a multiple of rt.timeout_us (60)",
        ),
        (
            "port = \"simulated\"",
            "port = \"parallel\"",
            "steps.motor: is of port = \"simulated\"",
        ),
        (
            "port = \"simulated\"",
            "port = \"simulated\"\ndevice = \"/dev/parport0\"",
            "steps.device = \"/dev/parport0\": is of port = \"parallel\" or \"gpio\"",
        ),
        (
            "counts_per_unit = [80, 1]",
            "counts_per_unit = [20000000, 1]",
            "joint[0].counts_per_unit",
        ),
        (
            "kind = \"none\"",
            "kind = \"memory\"",
            "bus.node: is missing: at least one [[bus.node]] is needed",
        ),
        (
            "kind = \"none\"",
            "kind = \"none\"\n[[bus.node]]\nid = 1\nname = \"x\"\nprofile = \"io\"",
            "bus.node: cannot be: bus.kind is \"none\"",
        ),
        (
            "enable_pin = 14",
            "enable_inverted = true",
            "joint[0].step.enable_inverted = true: needs an enable_pin",
        ),
    ] {
        let errors = errors(from, to);
        assert!(errors.iter().any(|error| error.contains(expected)), "{to}: {errors:#?}");
    }
    // The parallel port has these pins only.
    let text = PLOTTER
        .replace("port = \"simulated\"", "port = \"parallel\"")
        .replace("motor =", "# motor =");
    let text = text.replace("pins = [4, 5]", "pins = [4, 10]");
    let error = parse(&text, Path::new("p.toml")).unwrap_err().to_string();
    assert!(
        error.contains("joint[1].step.pins = [4, 10]: must be an output of a parallel port"),
        "{error}"
    );
}

#[test]
fn a_table_or_a_joint_without_the_other_is_refused() {
    let without = |lines: fn(&str) -> bool| {
        PLOTTER
            .lines()
            .filter(|line| lines(line))
            .collect::<Vec<_>>()
            .join("\n")
    };
    let text =
        without(|line| !line.starts_with("[steps]") && !line.starts_with("port =") && !line.starts_with("motor ="));
    let error = parse(&text, Path::new("p.toml")).unwrap_err().to_string();
    assert!(
        error.contains("joint[0].output = \"step\": \"step\" needs a table [steps]"),
        "{error}"
    );
    let text =
        include_str!("../../../configs/mill3-demo.toml").replace("[[joint]]", "[steps]\nport = \"pins\"\n[[joint]]");
    let text = text
        .replacen("[steps]\nport = \"pins\"\n[[joint]]", "[STEPS]", 1)
        .replace("[steps]\nport = \"pins\"\n", "");
    let text = text.replace("[STEPS]", "[steps]\nport = \"pins\"\n[[joint]]");
    let error = parse(&text, Path::new("p.toml")).unwrap_err().to_string();
    assert!(
        error.contains("is used by no joint: one with output = \"step\""),
        "{error}"
    );
}
