use super::*;
use std::path::Path;

fn import(text: &str, ini: &str) -> Translation {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("m.hal");
    std::fs::write(&path, text).unwrap();
    std::fs::write(
        folder.path().join("more.hal"),
        "loadrt not names=from-more\naddf from-more servo-thread\n",
    )
    .unwrap();
    let config = config::parse(EXAMPLE, Path::new("example.toml")).unwrap();
    let own = OwnPins::new(&config).unwrap();
    translated(&[path], &Ini::parse(ini), &own, false).unwrap()
}

/// Line and reason of what was refused.
fn refused(translation: &Translation) -> Vec<(usize, &str)> {
    let refused = translation.refused.iter();
    refused
        .map(|refused| (refused.place.line, refused.why.as_str()))
        .collect()
}

#[test]
fn a_hal_file_becomes_components_in_their_order_and_nets() {
    let translation = import(
        "# a comment\n\
         loadrt trivkins\n\
         loadrt [EMCMOT]EMCMOT servo_period_nsec=1000000 num_joints=3\n\
         loadrt and2 count=2\n\
         loadrt estop_latch\n\
         loadrt near names=Spindle_Near\n\
         loadrt debounce cfg=2,1\n\
         loadrt logic personality=0x104\n\
         addf motion-command-handler servo-thread\n\
         addf and2.1 servo-thread 1\n\
         addf motion-controller servo-thread\n\
         addf estop-latch.0 servo-thread\n\
         addf and2.0 servo-thread\n\
         addf spindle_near servo-thread\n\
         addf debounce.0 servo-thread\n\
         addf debounce.1 servo-thread\n\
         addf logic.0 servo-thread\n\
         net estop-loop estop-latch.0.ok-out => \\\n  iocontrol.0.emc-enable-in\n\
         net reset-it iocontrol.0.user-request-enable => estop-latch.0.reset\n\
         setp spindle-near.scale [SPINDLE_0]SCALE\n\
         spindle-near.difference = 0x10\n\
         setp debounce.0.delay 7\n\
         net gate and2.1.out and2.0.in1\n\
         net gate debounce.1.0.in\n\
         sets nobody true\n\
         newsig nobody bit\n\
         net gone and2.1.in0 and2.0.in1\n\
         unlinkp and2.1.in0\n\
         delsig gone\n\
         linksp nobody => and2.0.in0\n\
         loadrt [KINS]KINEMATICS\n\
         start\n",
        "[KINS]\nKINEMATICS = trivkins coordinates=xz\n[EMCMOT]\nEMCMOT = motmod\n[SPINDLE_0]\nSCALE = 1.05\n",
    );
    assert_eq!(
        refused(&translation),
        [(22, "\"0x10\" is no float")],
        "{}",
        translation.toml
    );
    let expected = r#"[[hal.component]]
name = "and2.1"
type = "and2"

[[hal.component]]
name = "estop-latch.0"
type = "estop_latch"
place = "after-motion"

[[hal.component]]
name = "and2.0"
type = "and2"
place = "after-motion"
set = { in0 = true }

[[hal.component]]
name = "spindle-near"
type = "near"
place = "after-motion"
set = { scale = 1.05 }

[[hal.component]]
name = "debounce.0"
type = "debounce"
place = "after-motion"
options = { cfg = 2 }
set = { delay = 7 }

[[hal.component]]
name = "debounce.1"
type = "debounce"
place = "after-motion"
options = { cfg = 1 }

[[hal.component]]
name = "logic.0"
type = "logic"
place = "after-motion"
options = { personality = 4 }

[[hal.net]]
name = "estop-loop"
source = "estop-latch.0.ok-out"
targets = ["iocontrol.0.emc-enable-in"]

[[hal.net]]
name = "reset-it"
source = "iocontrol.0.user-request-enable"
targets = ["estop-latch.0.reset"]

[[hal.net]]
name = "gate"
source = "and2.1.out"
targets = ["and2.0.in1", "debounce.1.0.in"]

"#;
    assert_eq!(translation.toml, expected);
    // The machine file takes it as it is.
    let config = config::parse(&format!("{EXAMPLE}\n{}", translation.toml), Path::new("m.toml"));
    OwnPins::new(&config.unwrap_or_else(|errors| panic!("{errors}"))).unwrap();
}

#[test]
fn an_ini_file_may_include_others() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    // Some editors begin a text with a mark of its encoding.
    write("mill.ini", "\u{feff}[A]\nX = 1\n  #INCLUDE more.inc\nX = 2\n");
    write("more.inc", "\u{feff}[A]\nX = 3\n[B]\nY = 4\n# INCLUDE nothing\n");
    write("round.ini", "#INCLUDE round.ini\n");
    write("lost.ini", "#INCLUDE none.inc\n");
    let hal = folder.path().join("x.hal");
    std::fs::write(
        &hal,
        "\u{feff}loadrt scale\naddf scale.0 servo-thread\nsetp scale.0.gain [A]X\nsetp scale.0.offset [B]Y\n",
    )
    .unwrap();
    let ini = Ini::read(&folder.path().join("mill.ini")).unwrap();
    let own = OwnPins::new(&config::parse(EXAMPLE, Path::new("m.toml")).unwrap()).unwrap();
    let translation = translated(&[hal], &ini, &own, false).unwrap();
    assert!(
        translation.toml.contains("set = { gain = 1.0, offset = 4.0 }"),
        "{}",
        translation.toml
    );
    let refused = |name: &str| Ini::read(&folder.path().join(name)).unwrap_err().to_string();
    assert!(refused("round.ini").contains("in a circle"), "{}", refused("round.ini"));
    assert!(refused("lost.ini").contains("none.inc"), "{}", refused("lost.ini"));
}

#[test]
fn what_the_control_does_otherwise_is_told_with_what_takes_its_place() {
    let translation = import(
        "net x-pos joint.0.motor-pos-cmd => joint.0.motor-pos-fb\n\
         net x-on joint.0.amp-enable-out => parport.0.pin-01-out\n\
         net tool-number iocontrol.0.tool-prep-number => hal_manualtoolchange.number\n\
         net turns spindle.0.revs\n\
         net speed spindle.0.speed-out-rps => pyvcp.speed\n",
        "",
    );
    let expected = [
        (
            1,
            "joint.0.motor-pos-fb would be a second writer of x-pos: the control reads the position of a drive itself",
        ),
        (
            2,
            "no pin joint.0.amp-enable-out here: the control switches drives on itself; amp-enabled tells that one is on",
        ),
        (2, "no pin parport.0.pin-01-out here"),
        (
            3,
            "no pin hal-manualtoolchange.number here: `isocnc tool-changed` or the panel says that the tool is in",
        ),
        (
            4,
            "no pin spindle.0.revs here: [spindle.encoder] of the machine file with source = \"pins\" makes spindle.0.revs and \
             spindle.0.indexed",
        ),
        (5, "no pin pyvcp.speed here: it is of a user interface"),
    ];
    assert_eq!(refused(&translation), expected);
}

#[test]
fn what_cannot_be_translated_is_told_with_its_line_and_reason() {
    let translation = import(
        "loadrt hostmot2\n\
         loadrt hypott\n\
         loadrt pid names=x-pid bits=3\n\
         addf x-pid.do-pid-calcs base-thread\n\
         addf hm2_5i25.0.read servo-thread\n\
         loadusr -W hal_manualtoolchange\n\
         net probe hm2_5i25.0.gpio.001.in => motion.probe-input\n\
         net two x-pid.output x-pid.saturated\n\
         net float x-pid.error => motion.feed-hold\n\
         setp x-pid.pgian 3\n\
         setp x-pid.Pgain many\n\
         setp motion.feed-hold 1\n\
         setp x-pid.error 1\n\
         net lonely => x-pid.command\n\
         setp x-pid.maxerror [AXIS_X]MAX_ERROR\n\
         setp x-pid.bias \"3\n\
         source none.hal\n\
         unload all\n\
         net\n\
         loadrt and2\n",
        "",
    );
    let expected = [
        (1, "no component of this name here"),
        (2, "no component of this name here; hypot is the nearest"),
        (3, "bits=3: is no option here"),
        (4, "there is no base-thread: it runs once a cycle"),
        (5, "a function of a module that was not translated"),
        (6, "programs beside the control are not started by it"),
        (7, "no pin hm2-5i25.0.gpio.001.in here"),
        (8, "x-pid.saturated would be a second writer of two"),
        (
            9,
            "x-pid.error is float, motion.feed-hold is bit here: nothing converts that",
        ),
        (10, "pid has no pin pgian here; pgain is the nearest"),
        (11, "\"many\" is no float"),
        (
            12,
            "the control's own: `isocnc hal set motion.feed-hold 1` while it runs",
        ),
        (13, "is an output, which the component writes"),
        (14, "nothing writes lonely here"),
        (15, "[AXIS_X]MAX_ERROR is not known: name the INI file with --ini"),
        (16, "a quotation mark without its end"),
        (18, "has nothing like it in a machine file"),
        (19, "words are missing or too many"),
        (
            20,
            "no addf adds it to a thread: put it where it is to run; it stands last",
        ),
    ];
    let mut refused = refused(&translation);
    let source = refused
        .iter()
        .position(|(line, _)| *line == 17)
        .expect("a file that is not there");
    assert!(refused.remove(source).1.contains("none.hal") || translation.refused[source].why.contains("No such file"));
    assert_eq!(refused, expected);
    // What is known of a net stays, to be completed.
    assert!(translation.toml.contains(
        "# not here: hm2-5i25.0.gpio.001.in\n[[hal.net]]\nname = \"probe\"\nsource = \"unwired\"\n\
                       targets = [\"motion.probe-input\"]\n"
    ));
    assert!(translation.toml.contains("# [[hal.net]]\n# name = \"lonely\""));
}

/// Pins by whose values a machine with this translation starts, and whether the chain is kept open.
fn started(translation: &Translation, pins: &[&str]) -> (Vec<hal_pins::AnyValue>, bool) {
    // Nothing is wired to the probe but what the translation wires.
    let example = EXAMPLE.replace(
        "targets = [\"motion.probe-input\"]",
        "targets = [\"motion.digital-in-03\"]",
    );
    assert_ne!(example, EXAMPLE);
    let text = format!("{example}\n{}", translation.toml);
    let config = config::parse(&text, Path::new("m.toml")).unwrap_or_else(|errors| panic!("{errors}"));
    let name = format!("import-test-{}-{}", std::process::id(), translation.toml.len());
    let mut hal = Hal::create_in(&[std::env::temp_dir()], &name, capacity(&config)).unwrap();
    let held = Pins::new(&mut hal, &config, &bus::plan(&config), &StepDrives::new(&config)).unwrap();
    let view = hal.view();
    (
        pins.iter().map(|pin| view.value(pin).unwrap()).collect(),
        held.estop.is_held_open(),
    )
}

/// An unfinished import fails to stop: what the card would have told counts as open until somebody wires it.
#[test]
fn chain_limits_and_probe_without_a_source_stop_the_machine() {
    const SWITCHES: [&str; 4] = [
        "joint.0.neg-lim-sw-in",
        "joint.0.pos-lim-sw-in",
        "motion.probe-input",
        "motion.feed-hold",
    ];
    let [on, off] = [true, false].map(hal_pins::AnyValue::Bit);
    let translation = import(
        "loadrt hostmot2\nnet estop-ok hm2_7i96s.0.inm.00.input-08-not => iocontrol.0.emc-enable-in\n\
         net lim-x hm2_7i96s.0.inm.00.input-01 => joint.0.neg-lim-sw-in\n\
         net coolant iocontrol.0.coolant-flood => hm2_7i96s.0.outm.00.out-00\n\
         net arm hm2_7i96s.0.inm.00.input-02 => motion.digital-in-02\n",
        "",
    );
    assert_eq!(started(&translation, &SWITCHES), (vec![on, off, off, off], true));
    // What stops nothing stays a comment.
    assert!(translation.toml.contains("# name = \"arm\"") && translation.toml.contains("# name = \"coolant\""));
    // Nothing but switches: the chain of the machine is as it is.
    let translation = import(
        "net z hm2_7i96s.0.gpio.3 => joint.0.pos-lim-sw-in motion.probe-input\n",
        "",
    );
    assert_eq!(started(&translation, &SWITCHES), (vec![off, on, on, off], false));
    // Nobody writes the signal at all; a command that could not be read; a button in front of a latch.
    let translation = import("net hold => motion.feed-hold\n", "");
    assert_eq!(started(&translation, &SWITCHES), (vec![off, off, off, on], false));
    let translation = import("net e [HW]BUTTON => iocontrol.0.emc-enable-in\n", "");
    assert!(started(&translation, &[]).1, "{}", translation.toml);
    let latch = "loadrt estop_latch\naddf estop-latch.0 servo-thread\n\
                 net ok estop-latch.0.ok-out => iocontrol.0.emc-enable-in\n";
    let translation = import(
        &format!("{latch}net button parport.0.pin-10-in => estop-latch.0.ok-in\n"),
        "",
    );
    assert!(started(&translation, &[]).1, "{}", translation.toml);
    let translation = import(latch, "");
    assert!(!started(&translation, &[]).1, "{}", translation.toml);
    // Homing that waits for the switch is refused until somebody tells of it.
    let translation = import("net home parport.0.pin-11-in => joint.0.home-sw-in\n", "");
    assert!(
        translation
            .toml
            .contains("source = \"unwired\"\ntargets = [\"joint.0.home-sw-in\"]")
    );
}

/// In HAL `A-b` and `a_b` are two names.
#[test]
fn names_that_differ_there_differ_here() {
    let translation = import(
        "net Spindle-ok spindle.0.on => motion.digital-in-00\n\
         net spindle-ok spindle.0.at-speed-out => motion.digital-in-01\n\
         net spindle_ok motion.digital-out-00 => motion.digital-in-02\n\
         net jog+ motion.digital-out-01 => motion.digital-in-03\n\
         net jog- motion.digital-out-02 => io.10.out-05\n\
         loadrt not names=a_b,A-B\n\
         addf a_b servo-thread\naddf A-B servo-thread\n\
         net one a_b.out => io.10.out-06\n\
         net two A-B.out => io.10.out-07\n\
         setp A-B.in true\n",
        "",
    );
    let config = config::parse(&format!("{EXAMPLE}\n{}", translation.toml), Path::new("m.toml"))
        .unwrap_or_else(|errors| panic!("{errors}"));
    let own = config.nets.len() - config::parse(EXAMPLE, Path::new("m.toml")).unwrap().nets.len();
    let nets = config.nets[config.nets.len() - own..].iter();
    let nets: Vec<_> = nets
        .map(|net| (net.name.as_str(), net.source.as_str(), net.targets.join(" ")))
        .collect();
    assert_eq!(
        nets,
        [
            ("spindle-ok", "spindle.0.on", "motion.digital-in-00".to_owned()),
            (
                "spindle-ok-3",
                "motion.digital-out-00",
                "motion.digital-in-02".to_owned()
            ),
            ("jog", "motion.digital-out-01", "motion.digital-in-03".to_owned()),
            ("jog-2", "motion.digital-out-02", "io.10.out-05".to_owned()),
            ("one", "a-b.out", "io.10.out-06".to_owned()),
            ("two", "a-b-2.out", "io.10.out-07".to_owned()),
        ]
    );
    assert!(
        translation
            .toml
            .contains("# in HAL: jog-\n[[hal.net]]\nname = \"jog-2\"")
    );
    let set: Vec<usize> = config.components.iter().map(|component| component.set.len()).collect();
    assert_eq!(set, [0, 1]);
    assert_eq!(refused(&translation).len(), 1, "{:?}", refused(&translation));
}

/// A pin that is u32 here and s32 there: what carries the value runs between its source and its target.
#[test]
fn whole_numbers_of_another_type_are_converted() {
    let translation = import(
        "loadrt carousel pockets=8\nloadrt not\nsetp carousel.0.decel-time 0.3\nsetp carousel.0.pocket-number 4\n\
         addf not.0 servo-thread\naddf motion-controller servo-thread\naddf carousel.0 servo-thread\n\
         net tool iocontrol.0.tool-prep-number => carousel.0.pocket-number\n",
        "",
    );
    assert_eq!(refused(&translation), [], "{}", translation.toml);
    let config = config::parse(&format!("{EXAMPLE}\n{}", translation.toml), Path::new("m.toml"))
        .unwrap_or_else(|errors| panic!("{errors}"));
    let order: Vec<_> = config
        .components
        .iter()
        .map(|made| (made.name.as_str(), made.kind, made.place))
        .collect();
    let after = config::Place::AfterMotion;
    assert_eq!(
        order,
        [
            ("not.0", "not", config::Place::BeforeMotion),
            ("tool-conv-u32-s32", "conv_u32_s32", after),
            ("carousel.0", "carousel", after),
        ]
    );
    // The value of `setp` has a writer; the other one stays.
    let set: Vec<&str> = config.components[2].set.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(set, ["decel-time"]);
    let nets: Vec<_> = config
        .nets
        .iter()
        .rev()
        .take(2)
        .map(|net| (net.source.as_str(), net.targets.join(" ")))
        .collect();
    assert_eq!(
        nets,
        [
            ("tool-conv-u32-s32.out", "carousel.0.pocket-number".to_owned()),
            ("iocontrol.0.tool-prep-number", "tool-conv-u32-s32.in".to_owned()),
        ]
    );
    let plans = bus::plan(&config);
    let mut hal = Hal::create_in(&[std::env::temp_dir()], "import-converted", capacity(&config)).unwrap();
    Pins::new(&mut hal, &config, &plans, &StepDrives::new(&config)).unwrap();
}

#[test]
fn a_function_that_nothing_makes_is_told_with_its_line() {
    let translation = import(
        "loadrt and2 count=2\nloadrt pid\naddf and2.0 t\naddf and2.2 t\naddf pid.0.do-pid-calc t\naddf motion-controler t\n\
         addf and2.1 t\naddf pid.0.do-pid-calcs t\naddf pid.1.do-pid-calcs t\naddf pid.2.do-pid-calcs t\n",
        "",
    );
    assert_eq!(
        refused(&translation),
        [
            (4, "no loadrt makes a function and2.2; and2.0 is the nearest"),
            (
                5,
                "no loadrt makes a function pid.0.do-pid-calc; pid.0.do-pid-calcs is the nearest"
            ),
            (6, "a function of a module that was not translated"),
        ]
    );
}

#[test]
fn other_periods_and_other_kinematics_are_told() {
    let translation = import(
        "loadrt threads name1=servo-thread period1=1000000 name2=slow period2=10000000\n\
         loadrt motmod servo_period_nsec=2000000\n\
         loadrt debounce cfg=1\n\
         addf debounce.0 slow\n\
         loadrt scarakins\n\
         loadrt genhexkins\n",
        "[EMCMOT]\nSERVO_PERIOD = 500000\n",
    );
    assert_eq!(
        refused(&translation),
        [
            (
                2,
                "the servo thread runs every 2 ms, the cycle here is 1 ms: write cycle_us = 2000 in [machine], or convert what counts \
                 its calls"
            ),
            (
                4,
                "slow runs every 10 ms, here it runs once a cycle of 1 ms: convert what counts its calls"
            ),
            (
                5,
                "machine.kinematics = \"scara\" does the same, its measures are keys of [kinematics]"
            ),
            (
                6,
                "there are no such kinematics here: docs/machine-file.md has those that there are"
            ),
        ]
    );
    let note = "[EMCMOT]SERVO_PERIOD: the servo thread runs every 0.5 ms, the cycle here is 1 ms: write cycle_us = 500 in [machine], or \
                convert what counts its calls";
    assert_eq!(translation.notes, [note]);
    assert_eq!(import("", "[EMCMOT]\nSERVO_PERIOD = 1000000\n").notes, [""; 0]);
}

#[test]
fn files_that_are_included_and_variables_are_followed() {
    let translation = import("source more.hal\nnet a from-more.out $PATH\n", "");
    assert!(
        translation
            .toml
            .starts_with("[[hal.component]]\nname = \"from-more\"\ntype = \"not\"\n")
    );
    let translation = import("source m.hal\n", "");
    assert_eq!(refused(&translation), [(1, "files include each other")]);
}

#[test]
fn no_text_makes_the_reader_panic() {
    use proptest::prelude::*;
    let word = prop_oneof![
        Just("net"),
        Just("loadrt"),
        Just("setp"),
        Just("addf"),
        Just("and2"),
        Just("count=2"),
        Just("and2.0.out"),
        Just("and2.0.in0"),
        Just("servo-thread"),
        Just("-1"),
        Just("[A]B"),
        Just("$X"),
        Just("[A"),
        Just("\""),
        Just("\\"),
        Just("\n"),
        Just("#"),
        Just("="),
        Just("personality=-1"),
        Just("logic"),
        Just("names=,,"),
        Just("ä"),
        Just("."),
        Just("motion-controller"),
        Just("sets"),
    ];
    let config = config::parse(EXAMPLE, Path::new("example.toml")).unwrap();
    let own = OwnPins::new(&config).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("m.hal");
    let mut runner = proptest::test_runner::TestRunner::default();
    runner
        .run(&proptest::collection::vec(word, 0..40), |words| {
            std::fs::write(&path, words.join(" ")).unwrap();
            let translation = translated(std::slice::from_ref(&path), &Ini::default(), &own, false).unwrap();
            // Whatever comes of it can be read.
            let text = format!("{EXAMPLE}\n{}", translation.toml);
            prop_assert!(
                config::parse(&text, Path::new("m.toml")).is_ok(),
                "{}",
                translation.toml
            );
            Ok(())
        })
        .unwrap();
}

/// Backlash and pitch errors of an INI file are no HAL; which keys stand for them is told.
#[test]
fn backlash_and_compensation_files_of_the_ini_file_are_told_with_their_keys() {
    let ini = "[TRAJ]\nLINEAR_UNITS = inch\n[JOINT_0]\nBACKLASH = 0.02\nCOMP_FILE = x.comp\nCOMP_FILE_TYPE = 1\n\
               [JOINT_1]\nBACKLASH = 0.015\n[JOINT_2]\nCOMP_FILE = z.comp\nBACKLASH = 0.0\n[SPINDLE_0]\nBACKLASH = 3\n";
    let translation = import("loadrt trivkins\n", ini);
    assert_eq!(
        translation.notes,
        [
            "[JOINT_0]COMP_FILE: write compensation_file = \"x.comp\" and compensation_type = \"corrections\" in its [[joint]]",
            "[JOINT_0]BACKLASH: LinuxCNC takes no account of it beside a COMP_FILE, and backlash_mm is refused there: leave it out",
            "[JOINT_1]BACKLASH: write backlash_mm = 0.015 in its [[joint]]",
            "[JOINT_2]COMP_FILE: write compensation_file = \"z.comp\" and compensation_type = \"positions\" in its [[joint]]",
            "[TRAJ]LINEAR_UNITS: values and compensation files are in inches; here they are in mm",
        ]
    );
    assert!(
        translation.report().starts_with("[JOINT_0]COMP_FILE: write"),
        "{}",
        translation.report()
    );
    assert_eq!(
        translation.to_json()["notes"][2],
        "[JOINT_1]BACKLASH: write backlash_mm = 0.015 in its [[joint]]"
    );
    assert_eq!(import("loadrt trivkins\n", "").notes, [""; 0]);
}

#[test]
fn what_a_pin_means_otherwise_here_is_told_once_with_its_line() {
    let translation = import(
        "loadrt biquad\nloadrt pid num_chan=1\nloadrt sim_spindle\naddf biquad.0 t\naddf pid.0.do-pid-calcs t\naddf sim-spindle.0 t\n\
         setp biquad.0.d1 0.5\nsetp biquad.0.d1 0.25\nsetp biquad.0.f0 100\nsetp sim-spindle.0.scale 0.0167\nsetp pid.0.tune-mode 1\n",
        "",
    );
    let [note] = &translation.notes[..] else {
        panic!("{:?}", translation.notes)
    };
    assert!(note.ends_with(
        ":7: biquad.0.d1 is otherwise here: own coefficients, for type 0 alone; in LinuxCNC: overwritten with those that are worked \
         out for types 1 and 2"
    ));
    assert_eq!(
        refused(&translation),
        [(11, "pid has no pin tune-mode here: there is no tuning")]
    );
    // What means the same is taken over.
    assert!(
        translation
            .toml
            .contains("type = \"sim_spindle\"\nset = { scale = 0.0167 }")
    );
}

#[test]
fn components_whose_pins_words_of_loadrt_name_are_translated() {
    let translation = import(
        "loadrt mux_generic config=bb4,Fu12\nloadrt enum enums=D;stop;fwd;;jog,E;low;high\n\
         loadrt message names=oil messages=\"Slideway oil low\"\nloadrt sim_encoder\nloadrt multiswitch cfg=6\n\
         addf mux-gen.00 t\naddf mux-gen.01 t\naddf enum-decode.00 t\naddf enum-encode.01 t\naddf oil t\n\
         addf sim-encoder.make-pulses t\naddf sim-encoder.update-speed t\naddf multiswitch.0 t\n\
         net level enum-encode.01.output => mux-gen.01.sel-int\nnet jog enum-decode.00.jog-out => oil.trigger mux-gen.00.in-bit-03\n\
         setp enum-encode.01.high-val 7\nsetp multiswitch.0.top-position 4\nsetp mux-gen.01.in-float-11 2.5\n",
        "",
    );
    let text = &translation.toml;
    for part in [
        "name = \"mux-gen.00\"\ntype = \"mux_generic\"\noptions = { size = 4, input = \"bit\", output = \"bit\" }\n",
        "options = { size = 12, input = \"float\", output = \"u32\" }\nset = { in-float-11 = 2.5 }\n",
        "name = \"enum-decode.00\"\ntype = \"enum\"\noptions = { mode = \"decode\", size = 3 }\nset = { val-02 = 3 }\n",
        "options = { mode = \"encode\", size = 2 }\nset = { val-01 = 7 }\n",
        "name = \"oil\"\ntype = \"message\"\n",
        "type = \"sim_encoder\"\n",
        "options = { personality = 6 }\nset = { top-position = 4 }\n",
        "source = \"enum-encode.01.output\"\ntargets = [\"mux-gen.01.sel-int\"]\n",
        "source = \"enum-decode.00.out-02\"\ntargets = [\"oil.trigger\", \"mux-gen.00.in-bit-03\"]\n",
    ] {
        assert!(text.contains(part), "{part}\n{text}");
    }
    assert_eq!(
        refused(&translation),
        [(
            3,
            "\"Slideway oil low\" is to be a text of a program, for oil.show: docs/logic.md"
        )]
    );
    for config in ["bb", "4", "xx4", "bbb4", "ff9999"] {
        assert_eq!(
            refused(&import(&format!("loadrt mux_generic config={config}\n"), "")).len(),
            2,
            "{config}"
        );
    }
}
