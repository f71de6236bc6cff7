//! Reading at the start, taking over what others edit, writing back.

use super::*;
use crate::safe_file::Disk;
use config::{self, ToolChanger};
use gcode::Tool;
use std::fs;

const DEMO: &str = include_str!("../../../../configs/mill3-demo.toml");

/// The demo machine in a folder of its own.
struct Machine {
    folder: tempfile::TempDir,
    config: Config,
}

fn machine(files: &[(&str, &str)], changer: ToolChanger) -> Machine {
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in files {
        fs::write(folder.path().join(name), text).unwrap();
    }
    let mut config = config::parse(DEMO, Path::new("demo.toml")).unwrap();
    config.program.parameter_file = Some(folder.path().join("m.var"));
    config.tools.table = Some(folder.path().join("m.tbl"));
    config.tools.changer = changer;
    Machine { folder, config }
}

impl Machine {
    fn text(&self, name: &str) -> Option<String> {
        fs::read_to_string(self.folder.path().join(name)).ok()
    }

    fn write(&self, name: &str, text: &str) {
        fs::write(self.folder.path().join(name), text).unwrap();
    }
}

fn value(tables: &Tables, number: u16) -> Option<f64> {
    let found = tables.parameters().iter().find(|entry| entry.0 == number);
    found.map(|entry| entry.1)
}

fn with_diameter(tables: &Tables, number: u32, diameter_mm: f64) -> ToolTable {
    let mut tools = tables.tools().clone();
    let tool = Tool {
        number,
        pocket: number,
        diameter_mm,
        ..Tool::default()
    };
    tools.set(tool).unwrap();
    tools
}

/// Parameter 31 and the number of tools.
fn held(tables: &Mutex<Tables>) -> (Option<f64>, usize) {
    let tables = lock(tables);
    (value(&tables, 31), tables.tools().tools().count())
}

fn take(tables: &Mutex<Tables>, parameters: &[(u16, f64)], tools: ToolTable) {
    lock(tables).adopt(gcode::Settings {
        parameters: parameters.iter().copied().collect(),
        tools,
        tool_in_spindle: 4, // as far as it was read, not as far as it was run
        ..gcode::Settings::default()
    });
}

#[test]
fn a_machine_without_a_table_has_tools_without_measures() {
    let config = config::parse(DEMO, Path::new("demo.toml")).unwrap();
    let tables = Tables::read(&config).unwrap();
    let numbers: Vec<u32> = tables.tools().tools().map(|tool| tool.number).collect();
    assert_eq!(numbers, (1..=99).collect::<Vec<u32>>());
    let bare = |tool: &Tool| tool.diameter_mm == 0.0 && tool.offset == Position::ZERO && tool.pocket == tool.number;
    assert!(tables.tools().tools().all(bare));
    save(&mut Disk, &Mutex::new(tables)).unwrap();
}

#[test]
fn a_g92_offset_outlives_the_process_where_the_machine_file_says_so() {
    let mut machine = machine(
        &[("m.tbl", ""), ("m.var", "5210 1\n5211 5\n5219 6\n5221 7\n")],
        ToolChanger::Fixed,
    );
    let found = |config: &Config| [5210, 5211, 5219, 5221].map(|number| value(&Tables::read(config).unwrap(), number));
    assert_eq!(found(&machine.config), [1.0, 5.0, 6.0, 7.0].map(Some));
    machine.config.program.dialect.keep_g92 = false;
    assert_eq!(found(&machine.config), [0.0, 0.0, 0.0, 7.0].map(Some));
}

#[test]
fn the_tool_in_the_spindle_is_that_of_pocket_0_or_the_last_change() {
    for (changer, before, after) in [(ToolChanger::Fixed, 0, 3), (ToolChanger::Random, 5, 5)] {
        let machine = machine(&[("m.tbl", "T3 P1\nT5 P0\n")], changer);
        let tables = Mutex::new(Tables::read(&machine.config).unwrap());
        assert_eq!(lock(&tables).tool_in_spindle(), before);
        let tools = lock(&tables).tools().clone();
        take(&tables, &[], tools);
        assert_eq!(lock(&tables).tool_in_spindle(), before);
        lock(&tables).set_tool_in_spindle(3);
        assert_eq!(lock(&tables).tool_in_spindle(), after);
        // What the machine has done is, also in the file.
        lock(&tables).tool_changed(3);
        assert_eq!(lock(&tables).tool_in_spindle(), 3);
        save(&mut Disk, &tables).unwrap();
        let pockets = |tables: &Tables| [3, 5].map(|tool| tables.tools().by_number(tool).unwrap().pocket);
        let wanted = if changer == ToolChanger::Random { [0, 1] } else { [1, 0] };
        assert_eq!(pockets(&Tables::read(&machine.config).unwrap()), wanted);
        // A program that was read ahead to a change which the machine has not done leaves no pocket changed, but measures.
        let mut tools = lock(&tables).tools().clone();
        tools.swap_pockets(0, 1);
        let mut longer = tools.by_number(5).unwrap().clone();
        longer.offset[Axis::Z] = 12.5;
        tools.set(longer).unwrap();
        take(&tables, &[], tools);
        let tables = lock(&tables);
        assert_eq!(tables.tools().by_number(5).unwrap().offset[Axis::Z], 12.5);
        if changer == ToolChanger::Random {
            assert_eq!(pockets(&tables), wanted);
        }
    }
}

#[test]
fn without_a_parameter_file_the_machine_file_has_the_offsets() {
    let mut machine = machine(&[("m.tbl", "")], ToolChanger::Fixed);
    let tables = Tables::read(&machine.config).unwrap();
    assert_eq!(
        [5220, 5221, 5222, 5223, 5241].map(|number| value(&tables, number)),
        [1.0, 20.0, 20.0, -60.0, 0.0].map(Some)
    );
    assert_eq!(tables.parameters().len(), parameter_file::required().count());

    machine.config.unit = LengthUnit::Inch;
    machine.config.work_offsets[8] = Position([25.4, 0.0, 0.0, 90.0, 0.0, 0.0, 0.0, 0.0, 50.8]);
    let tables = Tables::read(&machine.config).unwrap();
    assert_eq!(
        [5381, 5384, 5389].map(|number| value(&tables, number)),
        [1.0, 90.0, 2.0].map(Some)
    );

    // The file, once there, has them.
    machine.write("m.var", "5221 7\n");
    let tables = Tables::read(&machine.config).unwrap();
    assert_eq!(
        [5220, 5221, 5222].map(|number| value(&tables, number)),
        [0.0, 7.0, 0.0].map(Some)
    );
}

#[test]
fn all_mistakes_of_a_file_are_told_with_their_lines() {
    let machine = machine(
        &[("m.tbl", "tool pocket\nT1\nT2\n"), ("m.var", "5221 1\n5220 1\n")],
        ToolChanger::Fixed,
    );
    let here = machine.folder.path().display().to_string();
    let error = Tables::read(&machine.config)
        .unwrap_err()
        .to_string()
        .replace(&here, "HERE");
    assert_eq!(
        error,
        "error: parameter 5220 comes after 5221: numbers ascend, each stands once\n --> HERE/m.var:2:1\n  |\n2 | 5220 1\n  | ^^^^\n\
         HERE/m.var: 1 error in this file"
    );
    machine.write("m.var", "");
    let error = Tables::read(&machine.config)
        .unwrap_err()
        .to_string()
        .replace(&here, "HERE");
    assert!(
        error.contains("HERE/m.tbl:2:1") && error.contains("HERE/m.tbl:3:1"),
        "{error}"
    );
    assert!(error.ends_with("HERE/m.tbl: 2 errors in this file"), "{error}");
    // What is no entry is told, and the rest counts.
    machine.write("m.tbl", "tool pocket\nT1 P1 R5\n");
    let told = Tables::read(&machine.config)
        .unwrap()
        .warnings()
        .join("\n")
        .replace(&here, "HERE");
    assert!(
        told.starts_with("HERE/m.tbl:1:1: this counts for nothing") && told.contains("\nHERE/m.tbl:2:7: "),
        "{told}"
    );
}

#[test]
fn a_file_that_is_no_table_is_not_read_into_memory_for_ever() {
    let machine = machine(&[("m.tbl", "")], ToolChanger::Fixed);
    machine.write("m.var", &"\n".repeat(FILE_MAX as usize + 1));
    let error = Tables::read(&machine.config).unwrap_err().to_string();
    assert!(
        error.ends_with("m.var: is 4194305 octets long, 4194304 at the most can be read"),
        "{error}"
    );
    let folder = machine.folder.path().join("m.var");
    fs::remove_file(&folder).unwrap();
    fs::create_dir(&folder).unwrap();
    assert!(
        Tables::read(&machine.config)
            .unwrap_err()
            .to_string()
            .contains("is a folder, no file")
    );
}

#[test]
fn what_a_program_left_behind_is_written_with_a_backup() {
    let table = "; mine\nT1 P1 Z1.0 ;one\n";
    let machine = machine(&[("m.tbl", table), ("m.var", "31 1\n5221 1\n")], ToolChanger::Fixed);
    let tables = Mutex::new(Tables::read(&machine.config).unwrap());
    let mut parameters = lock(&tables).parameters().to_vec();
    parameters[0].1 = 2.5;
    let tools = with_diameter(&lock(&tables), 7, 3.0);
    take(&tables, &parameters, tools);
    save(&mut Disk, &tables).unwrap();
    assert!(
        machine
            .text("m.var")
            .unwrap()
            .starts_with("31\t2.500000\n5161\t0.000000\n")
    );
    assert_eq!(machine.text("m.var.bak").as_deref(), Some("31 1\n5221 1\n"));
    assert_eq!(machine.text("m.tbl").unwrap(), format!("{table}T7   P7   D+3.000000\n"));
    assert_eq!(machine.text("m.tbl.bak").as_deref(), Some(table));
    // A new process reads the same.
    let again = Tables::read(&machine.config).unwrap();
    let held = lock(&tables);
    assert_eq!((again.parameters(), again.tools()), (held.parameters(), held.tools()));
}

#[test]
fn nothing_is_written_where_nothing_changed() {
    let table = "t1 p1 z1.0 ;one\n";
    let machine = machine(&[("m.tbl", table)], ToolChanger::Fixed);
    let tables = Mutex::new(Tables::read(&machine.config).unwrap());
    save(&mut Disk, &tables).unwrap();
    assert!(machine.text("m.var").is_some(), "it was missing");
    assert_eq!(
        (machine.text("m.tbl").as_deref(), machine.text("m.tbl.bak")),
        (Some(table), None)
    );
    let before = fs::metadata(machine.folder.path().join("m.var"))
        .unwrap()
        .modified()
        .unwrap();
    save(&mut Disk, &tables).unwrap();
    assert_eq!(machine.text("m.var.bak"), None);
    assert_eq!(
        fs::metadata(machine.folder.path().join("m.var"))
            .unwrap()
            .modified()
            .unwrap(),
        before
    );
}

#[test]
fn what_somebody_edits_counts_from_the_next_program_on() {
    let machine = machine(&[("m.tbl", "T1 P1\n"), ("m.var", "31 1\n")], ToolChanger::Random);
    let tables = Mutex::new(Tables::read(&machine.config).unwrap());
    // A program's values stay where nobody edits.
    let mut parameters = lock(&tables).parameters().to_vec();
    parameters[0].1 = 2.0;
    let tools = lock(&tables).tools().clone();
    take(&tables, &parameters, tools);
    machine.write("m.tbl", "T1 P1\nT2 P0 Z5\n");
    lock(&tables).refresh(&machine.config).unwrap();
    assert_eq!(held(&tables), (Some(2.0), 2));
    save(&mut Disk, &tables).unwrap();
    assert_eq!(machine.text("m.tbl").as_deref(), Some("T1 P1\nT2 P0 Z5\n"));
    assert!(machine.text("m.var").unwrap().starts_with("31\t2.000000\n"));
    // A mistake changes nothing; what was right beside it neither.
    machine.write("m.var", "31 3\n");
    machine.write("m.tbl", "T1 P1\nT2 P1\n");
    lock(&tables).refresh(&machine.config).unwrap_err();
    assert_eq!(held(&tables), (Some(2.0), 2));
    // A file that is gone is written again.
    fs::remove_file(machine.folder.path().join("m.tbl")).unwrap();
    lock(&tables).refresh(&machine.config).unwrap();
    assert_eq!(value(&lock(&tables), 31), Some(3.0));
}

#[test]
fn what_cannot_be_written_is_told_and_remembered() {
    let machine = machine(&[("m.tbl", "T1 P1\n"), ("m.var", "")], ToolChanger::Fixed);
    let mut config = machine.config.clone();
    config.program.parameter_file = None;
    let tables = Mutex::new(Tables::read(&config).unwrap());
    let tools = with_diameter(&lock(&tables), 1, 4.0);
    let parameters = lock(&tables).parameters().to_vec();
    take(&tables, &parameters, tools);
    let path = machine.folder.path().to_owned();
    drop(machine);
    let error = save(&mut Disk, &tables).unwrap_err();
    let expected = format!(
        "{}: No such file or directory (os error 2); the machine remembers until this process ends",
        path.join("m.tbl").display()
    );
    assert_eq!(error, expected);
    assert_eq!(lock(&tables).tools().by_number(1).unwrap().diameter_mm, 4.0);
    lock(&tables).refresh(&config).unwrap();
    assert_eq!(lock(&tables).tools().by_number(1).unwrap().diameter_mm, 4.0);
}

#[test]
fn a_link_stays_a_link() {
    let mut machine = machine(&[("m.tbl", ""), ("real.var", "31 1\n")], ToolChanger::Fixed);
    let link = machine.folder.path().join("m.var");
    std::os::unix::fs::symlink("real.var", &link).unwrap();
    machine.config.tools.table = None;
    let tables = Mutex::new(Tables::read(&machine.config).unwrap());
    save(&mut Disk, &tables).unwrap();
    assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
    assert!(machine.text("real.var").unwrap().starts_with("31\t1.000000\n"));
    assert!(machine.text("real.var.bak").is_some());
}
