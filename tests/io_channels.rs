//! Channels of I/O nodes of the example machine, on virtual time: values in their units, what is sent, and what is wrong with an input;
//! and machines with as many nodes as a bus can have.

use hal_pins::{AnyValue, Input};
use isocnc::config::{self, Config};
use isocnc::machine::state::State;
use isocnc::operator::console::Operator;
use isocnc::operator::rehearsal::{Rehearsal, rehearse_with};
use isocnc::sim::NetConfig;
use serde_json::Value;
use std::path::Path;
use std::process::{Command, Output};

const MACHINE: &str = include_str!("../configs/io-only.toml");

fn machine(changes: &[(&str, &str)]) -> Config {
    let mut text = MACHINE.to_owned();
    for (old, new) in changes {
        assert_eq!(text.matches(old).count(), 1, "{old:?}");
        text = text.replace(old, new);
    }
    config::parse(&text, Path::new("io-only.toml")).unwrap_or_else(|errors| panic!("{errors}"))
}

/// The machine in stand-by, all nodes operational.
fn standing_by(config: &Config, act: impl FnOnce(&mut Rehearsal<'_>)) {
    rehearse_with(config, b"", NetConfig::clean(1), Operator::standing_by, |run| {
        assert!(run.run_until(60_000, |run| run.control.state() == State::Disabled)?);
        act(run);
        Ok(())
    })
    .unwrap();
}

fn cycles(run: &mut Rehearsal<'_>, count: u64) {
    for _ in 0..count {
        run.cycle(0).unwrap();
    }
}

fn float(run: &Rehearsal<'_>, name: &str) -> f64 {
    run.hal.reader::<f64>(name).unwrap().get()
}

fn bit(run: &Rehearsal<'_>, name: &str) -> bool {
    run.hal.reader::<bool>(name).unwrap().get()
}

#[test]
fn a_named_channel_reads_in_its_unit() {
    let config = machine(&[("amplitude = 2000 ", "amplitude = 0 ")]);
    standing_by(&config, |run| {
        cycles(run, 1000);
        // Raw 16384 on 4 to 20 mA; the filter has settled.
        assert!((float(run, "io.10.pressure") - (16384.0 * 3.8147e-4 - 2.5)).abs() < 1e-9);
        assert_eq!(run.hal.reader::<i32>("io.10.pressure-raw").unwrap().get(), 16384);
        assert_eq!(run.hal.reader::<i32>("io.10.object-6401-01").unwrap().get(), 16384);
        assert!(!bit(run, "io.10.pressure-fault"));
        let list = run.hal.list();
        let pin = |name: &str| list.iter().find(|pin| pin.name == name).unwrap();
        assert_eq!(pin("io.10.pressure").unit, "bar");
        assert_eq!(pin("io.10.level").value, AnyValue::S32(0));
        assert_eq!(pin("io.10.table").alias_of.as_deref(), Some("io.10.table.position"));
        assert_eq!(pin("io.10.table").unit, "mm");
        // One pin an object, and bits of digital objects only.
        let names = |start: &str| list.iter().filter(|pin| pin.name.starts_with(start)).count();
        assert_eq!((names("io.10.in-"), names("io.10.object-")), (16, 5));
        assert_eq!((names("io.11.out-"), names("io.11.object-")), (16, 3));
    });
}

#[test]
fn an_input_beyond_its_range_has_a_pin_and_one_warning() {
    // It swings out of its range once in two seconds.
    let config = machine(&[
        ("amplitude = 2000 ", "amplitude = 12000 "),
        ("period_s = 4", "period_s = 2"),
        ("type = \"integer\"                # as it is", "raw_max = 499"),
        (
            "[[sim.signal]]\nnode = 10\nobject = \"0x3000:3\"",
            "[[sim.signal]]\nnode = 10\nobject = \"0x6401:2\"\nvalue = 500\n[[sim.signal]]\nnode = 10\nobject = \"0x3000:3\"",
        ),
    ]);
    standing_by(&config, |run| {
        let mut edges = 0;
        let mut before = bit(run, "io.10.pressure-fault");
        for _ in 0..4000 {
            run.cycle(0).unwrap();
            let now = bit(run, "io.10.pressure-fault");
            let raw = run.hal.reader::<i32>("io.10.pressure-raw").unwrap().get();
            assert_eq!(now, !(5900..=32_766).contains(&raw), "{raw}");
            edges += u32::from(now && !before);
            before = now;
        }
        assert_eq!(edges, 2);
        assert_eq!(run.control.state(), State::Disabled, "a warning stops nothing");
        let journal: String = (run.operator.journal().iter())
            .map(|entry| format!("{}\n", entry.text))
            .collect();
        let told = "analog input 0x6401:1 reads 5";
        assert!(journal.contains(told), "{journal}");
        assert!(
            journal.contains("below raw_min, 5900: look for an open wire"),
            "{journal}"
        );
        // Once, until it has come ten times; and each input for itself.
        assert_eq!(journal.matches("analog input").count(), 2, "{journal}");
        assert!(
            journal.contains("0x6401:2 reads 500, above raw_max, 499: look for a short circuit"),
            "{journal}"
        );
    });
}

#[test]
fn the_filter_follows_with_its_corner_frequency() {
    // A ramp of 1000 a second: a low-pass of the first order lags by 1 / (2 pi f).
    let config = machine(&[(
        "value = 16384                   # 3.75 bar ...\namplitude = 2000 ",
        "value = 8000\nper_second = 1000\namplitude = 0 ",
    )]);
    standing_by(&config, |run| {
        cycles(run, 2000);
        let now = f64::from(run.hal.reader::<i32>("io.10.pressure-raw").unwrap().get()) * 3.8147e-4 - 2.5;
        let lag_s = (now - float(run, "io.10.pressure")) / (1000.0 * 3.8147e-4);
        // A cycle more or less: filters of samples are half a cycle off, and counts are whole.
        assert!((lag_s - 1.0 / (std::f64::consts::TAU * 5.0)).abs() < 2e-3, "{lag_s}");
    });
}

#[test]
fn an_encoder_has_the_pins_of_linuxcnc() {
    standing_by(&machine(&[]), |run| {
        cycles(run, 500);
        let counts: Input<i32> = run.hal.reader("io.10.table.counts").unwrap();
        assert!((float(run, "io.10.table.velocity") - 2.5).abs() < 0.2);
        assert!((float(run, "io.10.table") - f64::from(counts.get()) / 1000.0).abs() < 1e-9);
        // The index is the zero once it is asked for.
        let before = counts.get();
        run.hal.set("io.10.table.index-enable", true).unwrap();
        cycles(run, 1);
        assert!(!bit(run, "io.10.table.indexed") && (counts.get() - before).abs() < 10);
        assert!(run.run_until(1000, |run| bit(run, "io.10.table.indexed")).unwrap());
        assert!((0..4).contains(&counts.get()), "{}", counts.get());
        assert_eq!(float(run, "io.10.table.position-latched"), 0.0);
        cycles(run, 1000);
        assert!((2490..2510).contains(&counts.get()), "only once: {}", counts.get());
        assert_eq!(run.hal.reader::<i32>("io.10.table.counts-latched").unwrap().get(), 2000);
        run.hal.set("io.10.table.reset", true).unwrap();
        cycles(run, 3);
        assert_eq!(counts.get(), 0);
        // A counter without a latch has no pins of an index.
        assert!(run.hal.reader::<bool>("io.10.parts.index-enable").is_err());
        assert!(float(run, "io.10.parts") >= 1.0);
    });
}

#[test]
fn outputs_are_sent_in_their_scale_and_never_beyond_it() {
    let raw = |run: &Rehearsal<'_>, name: &str| match run.hal.view().value(name) {
        Some(AnyValue::S32(value)) => i64::from(value),
        Some(AnyValue::U32(value)) => i64::from(value),
        other => panic!("{name}: {other:?}"),
    };
    let wired = format!(
        "{}[[sim.signal]]\nnode = 11\nobject = \"0x6401:1\"\nfrom = \"0x6411:2\"\n",
        MACHINE.replace("name = \"outputs\"", "name = \"outputs\"\ninputs = [\"0x6401:1/16\"]")
    );
    let config = config::parse(&wired, Path::new("io-only.toml")).unwrap();
    standing_by(&config, |run| {
        for (value, sent) in [(50.0, 16383), (1000.0, 32767), (-5.0, 0), (f64::NAN, 0)] {
            run.hal.set("io.11.valve", value).unwrap();
            cycles(run, 1);
            assert_eq!(raw(run, "io.11.valve-raw"), sent, "{value}");
        }
        for (duty, sent) in [(0.5, 32768), (2.0, 65535), (-1.0, 0), (f64::NAN, 0)] {
            run.hal.set("io.11.heater", duty).unwrap();
            cycles(run, 1);
            assert_eq!(raw(run, "io.11.heater-raw"), sent, "{duty}");
        }
        // What comes back over the wire at the far end.
        for (pin, sent) in [(40_000, 32767), (-40_000, -32768), (-2, -2)] {
            run.hal.set("io.11.object-6411-02", pin).unwrap();
            cycles(run, 5);
            assert_eq!(raw(run, "io.11.object-6401-01"), sent, "{pin}");
        }
        // By its name, and by its number; each switching is counted.
        run.hal.set("io.11.coolant-pump", true).unwrap();
        cycles(run, 3);
        assert!(bit(run, "io.11.out-03"));
        let outputs = run.net().machine().outputs(11);
        assert_eq!(outputs, Some([0b1000, 0]));
        run.hal.set("io.11.out-03", false).unwrap();
        cycles(run, 3);
        assert_eq!(raw(run, "io.11.coolant-pump-switchings"), 2);
    });
}

#[test]
fn names_of_channels_connect_nets() {
    let text = MACHINE.replace("targets = [\"io.11.out-00\"]", "targets = [\"io.11.coolant-pump\"]");
    let text = text.replace("source = \"io.10.in-08\"", "source = \"io.10.door-closed\"");
    let config = config::parse(&text, Path::new("io-only.toml")).unwrap();
    standing_by(&config, |run| {
        assert!(run.net().machine_mut().set_inputs(10, 0b10));
        cycles(run, 5);
        assert!(bit(run, "io.10.door-closed") && bit(run, "io.11.coolant-pump") && bit(run, "io.11.out-03"));
        assert_eq!(run.net().machine().outputs(11), Some([0b1000, 0]));
    });
}

#[test]
fn check_names_the_channels_of_each_object() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/io-only.toml");
    let output = std::process::Command::new(env!("CARGO_BIN_EXE_isocnc"))
        .arg("check")
        .arg(file)
        .output()
        .expect("the program");
    let text = String::from_utf8(output.stdout).expect("text");
    for expected in [
        "0x6000:2   door-closed (bit 1)",
        "0x6401:1   pressure (bar)",
        "0x6200:1   coolant-pump (bit 3)",
    ] {
        assert!(text.contains(expected), "{expected}: {text}");
    }
}

/// What `isocnc check` says of a machine file: good, with room for its pins and the memory of it, in words as in JSON. Gives the room.
fn checked(file: &Path, nodes: usize) -> usize {
    let check = |more: &[&str]| -> Output {
        let mut command = Command::new(env!("CARGO_BIN_EXE_isocnc"));
        let output = command.arg("check").arg(file).args(more).output().unwrap();
        let said = [&output.stdout, &output.stderr].map(|octets| String::from_utf8_lossy(octets).into_owned());
        assert!(output.status.success(), "{said:?}");
        output
    };
    let json: Value = serde_json::from_slice(&check(&["--json"]).stdout).unwrap();
    assert_eq!(json["nodes"].as_array().unwrap().len(), nodes);
    let [room, octets] = ["room", "memory_octets"].map(|key| json["pins"][key].as_u64().unwrap());
    // A pin has a name of its own and a value: tens of octets, and not a kilobyte.
    assert!(
        (64 * room..1024 * room).contains(&octets),
        "{room} pins in {octets} octets"
    );
    let told = format!(
        "pins      room for {room}: {:.1} MiB of memory that is locked\n",
        octets as f64 / f64::from(1 << 20)
    );
    let text = String::from_utf8(check(&[]).stdout).unwrap();
    assert!(text.contains(&told), "{told} in {text}");
    room as usize
}

/// The machine of a file in stand-by, all nodes operational, and some hundred cycles later still.
fn running(file: &Path, act: impl FnOnce(&mut Rehearsal<'_>) + Send) {
    let text = std::fs::read_to_string(file).unwrap();
    let config = config::parse(&text, file).unwrap_or_else(|errors| panic!("{errors}"));
    let all = |run: &mut Rehearsal<'_>| {
        let machine = run.net().machine();
        let led = config
            .bus
            .nodes
            .iter()
            .filter(|node| machine.is_operational(node.id) == Some(true));
        led.count() == config.bus.nodes.len()
    };
    // A network for all ids is made on the stack before it comes to the heap.
    std::thread::scope(|scope| {
        let thread = std::thread::Builder::new().stack_size(64 << 20);
        let run = || {
            standing_by(&config, |run| {
                cycles(run, 200);
                assert!(
                    all(run) && run.control.state() == State::Disabled,
                    "{:#?}",
                    run.operator.journal()
                );
                act(run);
                assert!(
                    all(run) && run.control.state() == State::Disabled,
                    "{:#?}",
                    run.operator.journal()
                );
            });
        };
        thread.spawn_scoped(scope, run).unwrap().join().unwrap();
    });
}

#[test]
fn as_many_io_nodes_as_a_network_can_have_run() {
    const NODES: usize = 239;
    let mut text =
        "schema = 1\n[machine]\nname = \"many\"\nkinematics = \"none\"\ncycle_us = 10000\n[bus]\nkind = \"memory\"\n"
            .to_owned();
    for id in 1..=NODES {
        text += &format!(
            "[[bus.node]]\nid = {id}\nname = \"n{id}\"\nprofile = \"io\"\npres_timeout_us = 30\n\
             inputs = [\"0x6000:1/8\", \"0x6000:2/8\"]\noutputs = [\"0x6200:1/8\", \"0x6200:2/8\"]\n\
             [[bus.node.channel]]\nname = \"door\"\nobject = \"0x6000:2\"\nbit = 2\n"
        );
    }
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("many.toml");
    std::fs::write(&file, text).unwrap();
    let room = checked(&file, NODES);
    running(&file, |run| {
        let pins = run.hal.list().len();
        assert!((NODES * 32..=room).contains(&pins), "{pins} pins, room for {room}");
        let last = NODES as u8;
        let doors = |run: &Rehearsal<'_>| {
            let closed = (1..=last).filter(|id| bit(run, &format!("io.{id}.door")));
            closed.collect::<Vec<u8>>()
        };
        let lit = |run: &mut Rehearsal<'_>| {
            let machine = run.net().machine();
            let outputs = (1..=last).map(|id| (id, machine.outputs(id).unwrap()));
            outputs.filter(|(_, outputs)| *outputs != [0, 0]).collect::<Vec<_>>()
        };
        assert_eq!((doors(run), lit(run)), (vec![], vec![]));
        run.net().machine_mut().set_inputs(last, 0b100);
        run.hal.set(&format!("io.{last}.out-09"), true).unwrap();
        cycles(run, 3);
        assert_eq!((doors(run), lit(run)), (vec![last], vec![(last, [0, 0b10])]));
        assert!(bit(run, &format!("io.{last}.in-10")));
    });
}

/// A coupler with eight slots, and what may stand there.
const STATION: &str = r##"<?xml version="1.0"?>
<EtherCATInfo><Vendor><Id>#xFACE</Id></Vendor><Descriptions>
  <Devices><Device><Type ProductCode="#x1000" RevisionNo="#x1">STATION</Type>
    <Sm>MBoxOut</Sm><Sm>MBoxIn</Sm><Sm>Outputs</Sm><Sm>Inputs</Sm>
    <Mailbox><CoE PdoAssign="1"/></Mailbox>
    <Slots SlotPdoIncrement="1" SlotIndexIncrement="#x10" DownloadModuleIdentList="1">
      <Slot MinInstances="0" MaxInstances="8"><Name>Any</Name><ModuleIdent>#x20</ModuleIdent><ModuleIdent>#x21</ModuleIdent><ModuleIdent>#x22</ModuleIdent><ModuleIdent>#x23</ModuleIdent></Slot>
    </Slots>
  </Device></Devices>
  <Modules>
    <Module><Type ModuleIdent="#x20">DI8</Type><TxPdo Fixed="1" Sm="3"><Index DependOnSlot="1">#x1A00</Index>
      <Entry><Index DependOnSlot="1">#x6000</Index><SubIndex>1</SubIndex><BitLen>8</BitLen></Entry></TxPdo></Module>
    <Module><Type ModuleIdent="#x21">DO8</Type><RxPdo Fixed="1" Sm="2"><Index DependOnSlot="1">#x1600</Index>
      <Entry><Index DependOnSlot="1">#x7000</Index><SubIndex>1</SubIndex><BitLen>8</BitLen></Entry></RxPdo></Module>
    <Module><Type ModuleIdent="#x22">AI1</Type><TxPdo Fixed="1" Sm="3"><Index DependOnSlot="1">#x1A00</Index>
      <Entry><Index DependOnSlot="1">#x6000</Index><SubIndex>1</SubIndex><BitLen>16</BitLen></Entry></TxPdo></Module>
    <Module><Type ModuleIdent="#x23">AO1</Type><RxPdo Fixed="1" Sm="2"><Index DependOnSlot="1">#x1600</Index>
      <Entry><Index DependOnSlot="1">#x7000</Index><SubIndex>1</SubIndex><BitLen>16</BitLen></Entry></RxPdo></Module>
  </Modules>
</Descriptions></EtherCATInfo>"##;

/// At each station a wire leads from the last output module to the last input module, and from the analog output to the analog input.
#[test]
fn sixty_four_stations_of_eight_modules_run() {
    const STATIONS: usize = 64;
    let mut text = "schema = 1\n[machine]\nname = \"stations\"\nkinematics = \"none\"\ncycle_us = 1000\n[bus]\nkind = \"ethercat-memory\"\n".to_owned();
    for id in 1..=STATIONS {
        text += &format!(
            "[[bus.node]]\nid = {id}\nname = \"station-{id}\"\nprofile = \"io\"\ndevice_file = \"station.xml\"\n\
             modules = [\"DO8\", \"DI8\", \"DO8\", \"DI8\", \"AO1\", \"AI1\", \"DO8\", \"DI8\"]\n\
             [[bus.node.channel]]\nname = \"valve\"\nobject = \"0x7060:1\"\nbit = 5\n\
             [[bus.node.channel]]\nname = \"valve-open\"\nobject = \"0x6070:1\"\nbit = 5\n\
             [[bus.node.channel]]\nname = \"speed\"\nobject = \"0x7040:1\"\ntype = \"analog\"\nscale = 0.5\nsigned = true\n\
             [[bus.node.channel]]\nname = \"measured\"\nobject = \"0x6050:1\"\ntype = \"analog\"\nscale = 0.25\nsigned = true\n\
             [[sim.signal]]\nnode = {id}\nobject = \"0x6070:1\"\nfrom = \"0x7060:1\"\n\
             [[sim.signal]]\nnode = {id}\nobject = \"0x6050:1\"\nfrom = \"0x7040:1\"\n"
        );
    }
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("station.xml"), STATION).unwrap();
    let file = folder.path().join("stations.toml");
    std::fs::write(&file, text).unwrap();
    let room = checked(&file, STATIONS);
    running(&file, |run| {
        let pins = run.hal.list().len();
        assert!((STATIONS * 52..=room).contains(&pins), "{pins} pins, room for {room}");
        let seen = |run: &Rehearsal<'_>| {
            let station = |id: &usize| {
                let (open, measured) = (
                    bit(run, &format!("io.{id}.valve-open")),
                    float(run, &format!("io.{id}.measured")),
                );
                (open, measured) != (false, 0.0)
            };
            (1..=STATIONS).filter(station).collect::<Vec<_>>()
        };
        assert_eq!(seen(run), [0; 0]);
        run.hal.set(&format!("io.{STATIONS}.valve"), true).unwrap();
        run.hal.set(&format!("io.{STATIONS}.speed"), -600.0).unwrap();
        cycles(run, 5);
        assert_eq!(seen(run), [STATIONS]);
        // Raw -1200 at the output as at the input.
        assert!(bit(run, &format!("io.{STATIONS}.valve-open")));
        assert_eq!(float(run, &format!("io.{STATIONS}.measured")), -300.0);
    });
}
