//! `[spindle]`, `[spindle.drive]`, `[spindle.encoder]`.

use super::{Mapped, Spindle, SpindleCounter, SpindleDrive, SpindleEncoder, parse};
use std::path::Path;

const LATHE: &str = include_str!("../../../configs/lathe2-demo.toml");

fn with(old: &str, new: &str) -> Result<Spindle, String> {
    assert_eq!(LATHE.matches(old).count(), 1, "{old}");
    let text = LATHE.replace(old, new);
    let spindle = parse(&text, Path::new("m.toml")).map(|config| config.spindle);
    spindle.map_err(|errors| errors.to_string())
}

#[test]
fn the_lathe_has_an_encoder_with_an_index_and_a_speed() {
    let spindle = with("rpm_max = 3000.0", "rpm_max = 3000.0").unwrap();
    let object = |index, sub, bits| Mapped { index, sub, bits };
    assert_eq!(
        spindle,
        Spindle {
            rpm_max: 3000.0,
            drive: Some(SpindleDrive {
                node: 2,
                speed: object(0x6411, 1, 16)
            }),
            encoder: Some(SpindleEncoder::Counter(SpindleCounter {
                node: 2,
                counter: object(0x3000, 1, 32),
                counts_per_turn: 4096,
                index: Some(object(0x3000, 2, 32)),
            })),
            encoder_lead_cycles: 3.5,
            ..Spindle::default()
        }
    );
    // Left out it is the same, and a cycle less for pins, which are not latched by a node.
    let left_out = with("lead_cycles = 3.5 ", "# ");
    assert_eq!(left_out.unwrap().encoder_lead_cycles, 3.5);
    let from = LATHE.find("[spindle.encoder]").unwrap();
    let pins = format!("{}[spindle.encoder]\nsource = \"pins\"\n", &LATHE[..from]);
    let pins = parse(&pins, Path::new("m.toml")).unwrap();
    assert_eq!(pins.spindle.encoder_lead_cycles, 2.5);
    // A counter whose zero is at the index, counting down.
    let spindle = with(
        "counts_per_turn = 4096          # below 0: counts down with M3\nindex = \"0x3000:2\" ",
        "counts_per_turn = -4096\n#",
    );
    let Some(SpindleEncoder::Counter(counter)) = spindle.unwrap().encoder else {
        panic!("a counter expected")
    };
    assert_eq!((counter.counts_per_turn, counter.index), (-4096, None));
}

#[test]
fn wrong_spindles_are_refused_where_they_stand() {
    let cases = [
        (
            "counts_per_turn = 4096 ",
            "counts_per_turn = 3 ",
            "spindle.encoder.counts_per_turn = 3: must be at least 4",
        ),
        (
            "index = \"0x3000:2\"",
            "index = \"0x3000:4\"",
            "spindle.encoder.index = \"0x3000:4\": does not stand among the `inputs`",
        ),
        (
            "index = \"0x3000:2\"",
            "index = \"0x6000:2\"",
            "spindle.encoder.index = \"0x6000:2\": must have the length of the counter",
        ),
        (
            "index = \"0x3000:2\"",
            "indx = \"0x3000:2\"",
            "spindle.encoder.indx: unknown key; did you mean `index`?",
        ),
        (
            "counter = \"0x3000:1\"",
            "counter = \"3000\"",
            "spindle.encoder.counter = \"3000\": must be an object",
        ),
        (
            "speed = \"0x6411:1\"",
            "speed = \"0x6411:2\"",
            "spindle.drive.speed = \"0x6411:2\": does not stand among the `outputs`",
        ),
        (
            "source = \"node\" ",
            "source = \"nodes\" ",
            "spindle.encoder.source = \"nodes\": must be \"pins\" or \"node\"",
        ),
        (
            "source = \"node\" ",
            "source = \"pins\" ",
            "spindle.encoder.node: unknown key",
        ),
        (
            "wait_for_speed = true ",
            "wait_for_speed = 1 ",
            "spindle.wait_for_speed",
        ),
        (
            "speed_timeout_s = 20.0",
            "speed_timeout_s = 0",
            "spindle.speed_timeout_s = 0: must lie between",
        ),
    ];
    for (old, new, expected) in cases {
        let errors = with(old, new).unwrap_err();
        assert!(errors.contains(expected), "{errors}\nnot {expected}");
        assert!(errors.contains(" m.toml:"), "{errors}");
    }
    let no_latch = LATHE
        .replace("index = \"0x3000:2\" ", "#")
        .replace("counts_per_turn = 4096 ", "counts_per_turn = 4000 ");
    let errors = parse(&no_latch, Path::new("m.toml")).unwrap_err().to_string();
    assert!(
        errors.contains("counts_per_turn = 4000: must be a power of two"),
        "{errors}"
    );
    let node = LATHE.replace("node = 10\ncounter", "node = 11\ncounter");
    let errors = parse(&node, Path::new("m.toml")).unwrap_err().to_string();
    assert!(
        errors.contains("spindle.encoder.node = 11: is no node of the bus"),
        "{errors}"
    );
}
