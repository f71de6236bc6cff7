//! `[[logic]]`.

use super::*;
use std::path::PathBuf;

const MACHINE: &str = include_str!("../../../configs/mill3-demo.toml");

const PROGRAM: &str = "TYPE mode : (off, slow, fast); END_TYPE
PROGRAM cell
VAR_INPUT door_closed : BOOL := TRUE; level : INT; END_VAR
VAR_OUTPUT pump : BOOL; speed : REAL; rest : TIME; step : mode; alarm : STRING; END_VAR
VAR
    key AT %IX0.0 : BOOL;
    lamp AT %QX0.3 : BOOL;
    node AT 'io.10.in-03' : BOOL;
END_VAR
pump := door_closed AND key AND node; lamp := pump; alarm := SEL(level < 0, '', 'no oil');
END_PROGRAM";

fn folder(program: &str) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("cell.st"), program).unwrap();
    let machine = folder.path().join("m.toml");
    (folder, machine)
}

fn read(program: &str, keys: &str) -> Result<Config, String> {
    let (_folder, path) = folder(program);
    let text = format!("{MACHINE}\n{keys}");
    parse(&text, &path).map_err(|errors| errors.to_string())
}

const KEYS: &str = "[[logic]]\nfile = \"cell.st\"\nperiod_ms = 20\nalarms = [\"alarm\"]\n\
    at = { \"%I0.0\" = \"io.10.in-04\", \"%QX0.3\" = \"io.10.out-06\" }\n\
    safe = { pump = true, speed = 2, rest = 1500, step = \"slow\" }\n";

#[test]
fn variables_get_pins_by_their_names_and_addresses() {
    let config = read(PROGRAM, KEYS).unwrap();
    let [task] = &config.logics[..] else {
        panic!("{:?}", config.logics)
    };
    assert_eq!(
        (task.name.as_str(), task.every, task.goes_on, task.share_max),
        ("cell", 20, false, 0.5)
    );
    let ends = |pins: &[LogicPin]| pins.iter().map(|pin| pin.end.clone()).collect::<Vec<_>>();
    let own = |pin: &str, kind| End::Own { pin: pin.into(), kind };
    let elsewhere = |pin: &str, own: &str, kind| End::Elsewhere {
        pin: pin.into(),
        own: own.into(),
        kind,
    };
    use hal_pins::Type::{Bit, Float, S32};
    let inputs = [
        own("logic.cell.door-closed", Bit),
        own("logic.cell.level", S32),
        elsewhere("io.10.in-04", "logic.cell.key", Bit),
        elsewhere("io.10.in-03", "logic.cell.node", Bit),
    ];
    assert_eq!(ends(&task.interface.inputs), inputs);
    let outputs = [
        own("logic.cell.pump", Bit),
        own("logic.cell.speed", Float),
        own("logic.cell.rest", Float),
        own("logic.cell.step", S32),
        End::Operator { is_alarm: true },
        elsewhere("io.10.out-06", "logic.cell.lamp", Bit),
    ];
    assert_eq!(ends(&task.interface.outputs), outputs);
    let safe = ["pump", "speed", "rest", "step", "lamp"].map(|name| task.safe_value(name));
    assert_eq!(safe, [1, 2.0_f64.to_bits() as i64, 1_500_000_000, 1, 0]);
}

#[test]
fn what_is_wrong_with_a_program_or_its_keys_is_told_at_its_place() {
    let cases = [
        ("file = \"none.st\"\n", "cannot be read"),
        (
            "file = \"cell.st\"\nperiod_ms = 2.5\n",
            "must be a whole number of cycles, which take 1 ms",
        ),
        (
            "file = \"cell.st\"\n",
            "key: %IX0.0 is bound to no pin: say at = { \"%IX0.0\" = \"..\" } here",
        ),
        ("file = \"cell.st\"\nalarms = [\"alarms\"]\n", "did you mean \"alarm\"?"),
        (
            "file = \"cell.st\"\nsafe = { pomp = true }\n",
            "is no output of the program; did you mean \"pump\"?",
        ),
        (
            "file = \"cell.st\"\nsafe = { pump = 1 }\n",
            "must be a value of type BOOL",
        ),
        (
            "file = \"cell.st\"\nsafe = { rest = \"1s\" }\n",
            "must be a value of type TIME, in ms",
        ),
        (
            "file = \"cell.st\"\nat = { \"pump\" = \"io.10.out-01\" }\n",
            "is no address",
        ),
        (
            "file = \"cell.st\"\nat = { \"%IX0.0\" = \"io.10.in-1\", \"%i0.0\" = \"io.10.in-2\" }\n",
            "is bound above",
        ),
        (
            "file = \"cell.st\"\nat = { \"%IX0.0\" = \"IO 3\" }\n",
            "must be a name of lower-case letters",
        ),
        (
            "file = \"cell.st\"\nname = \"a.b\"\n",
            "it is part of the names of pins",
        ),
        (
            "file = \"cell.st\"\non_error = \"go\"\n",
            "must be \"safe\" or \"continue\"",
        ),
        ("file = \"cell.st\"\nbudget_percent = 95\n", "must lie between 1 and 90"),
        (
            "file = \"cell.st\"\noverruns_stop = 1001\n",
            "must be an integer from 0 to 1000",
        ),
        ("", "is missing: a file of Structured Text"),
    ];
    for (keys, rule) in cases {
        let told = read(PROGRAM, &format!("[[logic]]\n{keys}")).unwrap_err();
        assert!(told.contains(rule) && told.contains("logic[0]"), "{keys}\n{told}");
    }
    let told = read(
        "PROGRAM p VAR x : INT; END_VAR\nx = 5;\nEND_PROGRAM",
        "[[logic]]\nfile = \"cell.st\"\n",
    )
    .unwrap_err();
    assert!(told.contains("cell.st:2:3: = compares: write := to assign"), "{told}");
    let twice = "[[logic]]\nfile = \"cell.st\"\n".repeat(2);
    let told = read("PROGRAM p END_PROGRAM", &twice).unwrap_err();
    assert!(told.contains("is taken by a program above"), "{told}");
    let told = read(
        "PROGRAM p VAR_INPUT s : STRING; END_VAR END_PROGRAM",
        "[[logic]]\nfile = \"cell.st\"\n",
    )
    .unwrap_err();
    assert!(told.contains("a STRING is no input"), "{told}");
    let many: String = (0..9)
        .map(|number| format!("[[logic]]\nfile = \"cell.st\"\nname = \"p{number}\"\n"))
        .collect();
    let told = read("PROGRAM p END_PROGRAM", &many).unwrap_err();
    assert!(told.contains("must not be more than 8 programs, are 9"), "{told}");
}

#[test]
fn a_program_cannot_stand_alone_between_an_input_and_what_has_to_act_at_once() {
    const CHAIN: &str =
        "PROGRAM cell VAR_INPUT stop : BOOL; END_VAR VAR_OUTPUT ok : BOOL; END_VAR ok := NOT stop; END_PROGRAM";
    let net = |name: &str, source: &str, target: &str| {
        format!("[[hal.net]]\nname = \"{name}\"\nsource = \"{source}\"\ntargets = [\"{target}\"]\n")
    };
    let logic = "[[logic]]\nfile = \"cell.st\"\n";
    let chain = "iocontrol.0.emc-enable-in";
    let refused = |keys: String| {
        let told = read(CHAIN, &(keys + logic)).err();
        told.is_some_and(|told| {
            assert!(
                told.contains("has to act in the cycle in which its input is read, up to 10 cycles late"),
                "{told}"
            );
            true
        })
    };
    let and = "[[hal.component]]\nname = \"and2.0\"\ntype = \"and2\"\n";
    assert!(refused(net("chain", "logic.cell.ok", chain)));
    assert!(refused(net("limit", "logic.cell.ok", "joint.1.neg-lim-sw-in")));
    assert!(refused(
        net("chain", "and2.0.out", chain) + &net("said", "logic.cell.ok", "and2.0.in0") + and
    ));
    // Beside an input of its own.
    let with_input = net("chain", "and2.0.out", chain)
        + &net("said", "logic.cell.ok", "and2.0.in0")
        + &net("stop", "io.10.in-00", "and2.0.in1");
    assert!(!refused(with_input + and));
    assert!(!refused(net("hold", "logic.cell.ok", "motion.feed-hold")));
    // By a name in the program it is no other.
    let direct = CHAIN.replace(
        "ok : BOOL;",
        "none : BOOL; END_VAR VAR ok AT 'joint.0.home-sw-in' : BOOL;",
    );
    let told = read(&direct, logic).unwrap_err();
    assert!(told.contains("would lead joint.0.home-sw-in"), "{told}");
    // A ring of components ends.
    let ring = "[[hal.component]]\nname = \"or2.0\"\ntype = \"or2\"\n";
    let around = net("a", "or2.0.out", "and2.0.in0")
        + &net("b", "and2.0.out", "or2.0.in0")
        + &net("c", "logic.cell.ok", "or2.0.in1");
    let told = read(CHAIN, &(around + and + ring + logic));
    assert!(told.is_ok(), "{told:?}");
}
