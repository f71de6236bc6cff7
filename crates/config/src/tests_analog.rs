//! Joints whose amplifiers have analog inputs: one case per rule, and what a good file becomes.

use super::*;

const CABINET: &str = include_str!("../../../configs/analog2-demo.toml");

#[test]
fn the_cabinet_that_ships_has_two_amplifiers_at_one_node() {
    let config = parse(CABINET, Path::new("c.toml")).unwrap_or_else(|errors| panic!("{errors}"));
    let nodes: Vec<usize> = config.joints.iter().map(|joint| joint.node).collect();
    assert_eq!(nodes, [1, 2], "behind the nodes of the bus");
    let [x, y] = [0, 1].map(|joint: usize| config.joints[joint].analog.unwrap());
    assert_eq!((x.node, x.full, x.enable.1, x.fault), (0, 200.0, 0, None));
    let fault = Mapped {
        index: 0x6000,
        sub: 2,
        bits: 8,
    };
    assert_eq!((y.command.sub, y.position.sub, y.fault), (3, 4, Some((fault, 2, true))));
}

#[test]
fn what_cannot_be_is_refused_with_its_place() {
    for (from, to, expected) in [
        (
            "mode = \"csv\"",
            "mode = \"csp\"",
            "joint[0].mode = \"csp\": must be \"csv\" (its input is a speed) or \"cst\" (a torque)",
        ),
        (
            "node = 10, command = \"0x6411:2\"",
            "node = 11, command = \"0x6411:2\"",
            "joint[0].analog.node = 11: is no node of the bus",
        ),
        (
            "command = \"0x6411:2\"",
            "command = \"0x6411:4\"",
            "joint[0].analog.command = \"0x6411:4\": does not stand among the `outputs` of the node",
        ),
        (
            "position = \"0x3000:3\"",
            "position = \"0x3000\"",
            "joint[0].analog.position = \"0x3000\": does not stand among the `inputs` of the node",
        ),
        (
            "enable_bit = 0",
            "enable_bit = 8",
            "joint[0].analog.enable_bit = 8: must be below 8, the bits of 0x6200:1/8",
        ),
        ("full = 200.0", "full = 0.0", "joint[0].analog.full = 0.0"),
        (
            ", fault_bit = 2",
            "",
            "joint[1].analog.fault_bit: is missing: the bit of `fault`",
        ),
        (
            "output = \"analog\"",
            "output = \"analog\"\nreactions = { quick_stop = 6 }",
            "is of a drive on the bus: this joint has output = \"analog\"",
        ),
        (
            "method = 37",
            "method = 1",
            "joint[1].homing.method = 1: must be 37 (it is homed where it stands)",
        ),
        (
            "output = \"analog\"",
            "output = \"analogue\"",
            "joint[0].output = \"analogue\": must be \"drive\" or \"step\" or \"analog\"",
        ),
        (
            "outputs = [\"0x6200:1/8\"",
            "channel = [{ name = \"speed\", object = \"0x6411:2\" }]\noutputs = [\"0x6200:1/8\"",
            "joint[0].analog.command = \"0x6411:2\": is the channel \"speed\" of the node already: an output has one writer",
        ),
    ] {
        let text = CABINET.replacen(from, to, 1);
        assert_ne!(text, CABINET, "{from}");
        let errors = parse(&text, Path::new("c.toml")).expect_err(to).to_string();
        assert!(errors.contains(expected), "{to}: {errors}");
    }
}
