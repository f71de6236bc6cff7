//! Channels of I/O nodes: one case per rule, and what a good list becomes.

use super::tests::{changed, messages};
use super::*;

const PAYLOADS: &str = "inputs = [\"0x6000:1/8\", \"0x6401:1/16\", \"0x6403:1/32\", \"0x3000:1/32\", \"0x3000:2/32\", \"0x2000/16\"]\n\
                        outputs = [\"0x6200:1/8\", \"0x6411:1/16\", \"0x3100:1/16\", \"0x2100:1/8\"]\n";

fn machine(channels: &str) -> String {
    changed(
        "id = 2\nprofile = \"io\"\n",
        &format!("id = 2\nprofile = \"io\"\n{PAYLOADS}{channels}\n"),
    )
}

fn node(channels: &str) -> Node {
    let config = parse(&machine(channels), Path::new("m.toml")).unwrap_or_else(|errors| panic!("{errors}"));
    config.bus.nodes[1].clone()
}

#[test]
fn types_are_those_of_the_object_where_the_list_says_nothing() {
    let node = node(
        "channel = [
        { name = \"a\", object = \"0x6200:1\", bit = 3 },
        { name = \"b\", object = \"0x6401:1\", unit = \"°C\" },
        { name = \"c\", object = \"0x2000\" },
        { name = \"d\", object = \"0x3000:1\", type = \"encoder\", counts_per_unit = -400, latch = \"0x3000:2\" },
        { name = \"e\", object = \"0x3100:1\", type = \"pwm\", scale = 100 },
        { name = \"f\", object = \"0x6200:1\", bit = 4, type = \"relay\" },
        { name = \"g\", object = \"0x6411:1\", scale = 0.5, offset = -1, raw_min = 0 } ]",
    );
    let latch = Mapped {
        index: 0x3000,
        sub: 2,
        bits: 32,
    };
    let follow = Follow {
        counts_per_unit: -400.0,
        latch: Some(latch),
    };
    let analog = |scale, offset, raw_min| ChannelKind::Analog {
        signed: None,
        scale,
        offset,
        filter_hz: None,
        raw_min,
        raw_max: None,
    };
    let kinds: Vec<_> = node.channels.iter().map(|channel| channel.kind).collect();
    assert_eq!(
        kinds,
        [
            ChannelKind::Bit { bit: 3 },
            analog(1.0, 0.0, None),
            ChannelKind::Integer { signed: None },
            ChannelKind::Counter { follow },
            ChannelKind::Pwm {
                scale: 100.0,
                full: 65_535
            },
            ChannelKind::Relay { bit: 4 },
            analog(0.5, -1.0, Some(0)),
        ]
    );
    assert_eq!(node.channels[1].unit, "°C");
    let outputs: Vec<_> = node.channels.iter().map(|channel| channel.output).collect();
    assert_eq!(outputs, [true, false, false, false, true, true, true]);
}

#[test]
fn objects_are_bits_or_numbers_by_channel_device_file_or_profile() {
    let kinds = |node: &Node| -> Vec<ObjectKind> {
        let objects = node.inputs.iter().chain(&node.outputs);
        objects.map(|object| node.object_kind(*object)).collect()
    };
    use ObjectKind::{Bits, Real, Signed, Unsigned};
    let plain = [
        Bits, Signed, Real, Unsigned, Unsigned, Unsigned, // inputs
        Bits, Signed, Unsigned, Bits,
    ];
    assert_eq!(kinds(&node("")), plain);
    let said = node(
        "channel = [
        { name = \"a\", object = \"0x2000\", bit = 15 },
        { name = \"b\", object = \"0x6401:1\", type = \"integer\", signed = false },
        { name = \"c\", object = \"0x2100:1\", type = \"integer\", signed = true },
        { name = \"d\", object = \"0x6000:1\", type = \"integer\" } ]",
    );
    let said_kinds = [
        Unsigned, Unsigned, Real, Unsigned, Unsigned, Bits, // inputs
        Bits, Signed, Unsigned, Signed,
    ];
    assert_eq!(kinds(&said), said_kinds);
    // By the data type of its device file: 2000h is none that CiA 401 knows.
    let text = changed(
        "id = 2\nprofile = \"io\"",
        "id = 2\nprofile = \"io\"\ndevice_file = \"../../obd/tests/data/io.xdd\"",
    );
    let config = parse(&text, Path::new("m.toml")).unwrap_or_else(|errors| panic!("{errors}"));
    let node = &config.bus.nodes[1];
    assert_eq!(node.object_kind(node.inputs[1]), Signed);
}

#[test]
fn what_cannot_be_is_refused_at_its_place_with_what_would_be_right() {
    let cases = [
        (
            "object = \"0x6000:1\", bit = 1",
            "name: is missing: the name of the channel, like \"coolant-pump\"",
        ),
        (
            "name = \"Pump\", object = \"0x6000:1\", bit = 1",
            "name = \"Pump\": must be lower-case letters, digits and dashes",
        ),
        (
            "name = \"in-07\", object = \"0x6000:1\", bit = 1",
            "must not begin with in-, out- or object-",
        ),
        (
            "name = \"a-raw\", object = \"0x6000:1\", bit = 1",
            "must not end with -raw",
        ),
        (
            "name = \"a\", object = \"6000\", bit = 1",
            "object = \"6000\": must be an object like \"0x6200:1\"",
        ),
        (
            "name = \"a\", object = \"0x6001:1\"",
            "must stand among the `inputs` or `outputs` of the node, with its length (inputs: 0x6000:1/8,",
        ),
        (
            "name = \"a\", object = \"0x6000:1\"",
            "has 8 bits: `bit` says which, counted from 0",
        ),
        (
            "name = \"a\", object = \"0x6000:1\", bit = 8",
            "bit = 8: must be an integer from 0 to 7: 0x6000:1/8",
        ),
        (
            "name = \"a\", object = \"0x6000:1\", type = \"bits\", bit = 1",
            "did you mean \"bit\"?",
        ),
        (
            "name = \"a\", object = \"0x6000:1\", type = \"relay\", bit = 1",
            "must be one of the outputs of the node for this type",
        ),
        (
            "name = \"a\", object = \"0x6411:1\", type = \"counter\"",
            "must be one of the inputs of the node for this type",
        ),
        (
            "name = \"a\", object = \"0x6401:1\", type = \"integer\", scale = 2",
            "scale = 2: is not for a channel of type \"integer\", which has: signed",
        ),
        (
            "name = \"a\", object = \"0x6401:1\", scale = 0",
            "scale = 0: must not be 0",
        ),
        (
            "name = \"a\", object = \"0x6401:1\", raw_min = 9, raw_max = 8",
            "raw_max = 8: must be above raw_min, 9",
        ),
        (
            "name = \"a\", object = \"0x6401:1\", raw_min = 40000",
            "raw_min = 40000: must lie between -32768 and 32767, what 0x6401:1/16 holds as a signed number",
        ),
        (
            "name = \"a\", object = \"0x6401:1\", signed = false, raw_max = 65536",
            "raw_max = 65536: must lie between 0 and 65535, what 0x6401:1/16 holds as an unsigned number",
        ),
        (
            "name = \"a\", object = \"0x6411:1\", filter_hz = 8",
            "filter_hz = 8: is for inputs",
        ),
        (
            "name = \"a\", object = \"0x6403:1\", type = \"integer\"",
            "holds a real number: its type is \"analog\"",
        ),
        (
            "name = \"a\", object = \"0x3000:1\", type = \"encoder\", latch = \"0x6401:1\"",
            "must be another object of the length of the counter 0x3000:1/32, is 0x6401:1/16",
        ),
        (
            "name = \"a\", object = \"0x3000:1\", type = \"encoder\", latch = \"0x6411:1\"",
            "must stand among the `inputs` of the node",
        ),
        (
            "name = \"a\", object = \"0x3100:1\", type = \"pwm\", raw_max = 65536",
            "raw_max = 65536: must lie between 1 and 65535",
        ),
        (
            "name = \"a\", object = \"0x6401:1\", unit = \"litres/min\"",
            "must be at most 8 octets",
        ),
        (
            "name = \"a\", object = \"0x6401:1\" }, { name = \"a\", object = \"0x6000:1\", bit = 0",
            "is taken by a channel above",
        ),
        (
            "name = \"a\", object = \"0x6000:1\", bit = 0 }, { name = \"b\", object = \"0x6000:1\", bit = 0",
            "is the channel \"a\" above already",
        ),
        (
            "name = \"a\", object = \"0x2000\", bit = 0 }, { name = \"b\", object = \"0x2000\"",
            "is single bits or one number: the channel \"a\" above has it otherwise",
        ),
        (
            "name = \"a\", object = \"0x6000:1\", bit = 0, ofset = 1",
            "unknown key; did you mean `offset`?",
        ),
    ];
    for (channel, rule) in cases {
        let told = messages(&machine(&format!("channel = [ {{ {channel} }} ]")));
        assert_eq!(told.len(), 1, "{channel}: {told:#?}");
        assert!(told[0].starts_with("m.toml:14:"), "{channel}: {}", told[0]);
        assert!(told[0].contains("bus.node[1].channel["), "{channel}: {}", told[0]);
        assert!(told[0].contains(rule), "{channel}: {}", told[0]);
    }
    let of_drive = changed(
        "profile = \"cia402\"\n",
        "profile = \"cia402\"\nchannel = [ { name = \"a\", object = \"0x6041\", type = \"integer\" } ]\n",
    );
    assert!(messages(&of_drive)[0].contains("is for nodes of profile \"io\""));
    let spindle = machine("channel = [ { name = \"a\", object = \"0x6411:1\" } ]")
        + "[spindle.drive]\nnode = 2\nspeed = \"0x6411:1\"\n";
    let told = messages(&spindle);
    assert!(
        told[0].contains("is the channel \"a\" of the node already: an output has one writer"),
        "{told:?}"
    );
}

#[test]
fn signals_of_the_simulated_node_are_at_its_objects() {
    for (signal, rule) in [
        (
            "node = 1\nobject = \"0x6401:1\"",
            "must be a [[bus.node]] of profile \"io\"",
        ),
        (
            "node = 2",
            "object: is missing: an object of the node, like \"0x6401:1\"",
        ),
        ("node = 2\nobject = \"6401\"", "must be an object like \"0x6401:1\""),
        (
            "node = 2\nobject = \"0x6411:1\"",
            "must stand among the `inputs` of the node",
        ),
        (
            "node = 2\nobject = \"0x6401:1\"\nfrom = \"0x6401:1\"",
            "must stand among the `outputs` of the node",
        ),
    ] {
        let told = messages(&(machine("") + "[[sim.signal]]\n" + signal + "\n"));
        assert_eq!(told.len(), 1, "{signal}: {told:#?}");
        assert!(told[0].contains(rule), "{signal}: {}", told[0]);
    }
}
