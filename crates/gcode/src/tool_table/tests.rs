//! Reading and writing of tool tables.

use super::*;
use crate::{Interpreter, Settings};
use motion::canon::{Axis, Call, LengthUnit, Position};
use proptest::prelude::*;
use std::collections::BTreeMap;

fn read(text: &str) -> ToolTable {
    ToolTable::parse(text.as_bytes(), LengthUnit::Millimetre, ToolChanger::Fixed).unwrap()
}

fn errors(text: &str, changer: ToolChanger) -> Vec<String> {
    let errors = ToolTable::parse(text.as_bytes(), LengthUnit::Millimetre, changer).unwrap_err();
    errors.iter().map(TableError::to_string).collect()
}

#[test]
fn every_entry_has_its_place() {
    let table = read("T7 P12 X1 Y-2 Z+3. A4 B5 C6 U.7 V8 W9 D10 I11 J12 Q9 ; all of them");
    let tool = Tool {
        number: 7,
        pocket: 12,
        offset: Position([1.0, -2.0, 3.0, 4.0, 5.0, 6.0, 0.7, 8.0, 9.0]),
        diameter_mm: 10.0,
        front_angle_deg: 11.0,
        back_angle_deg: 12.0,
        orientation: 9,
        remark: " all of them".into(),
    };
    assert_eq!(table.tools().collect::<Vec<_>>(), [&tool]);
    assert_eq!(table.by_number(7), Some(&tool));
    assert_eq!(table.in_pocket(12), Some(&tool));
    assert_eq!(table.by_number(12), None);
    assert_eq!(table.in_pocket(7), None);
}

#[test]
fn order_case_blanks_and_exponents_are_free() {
    let table = read("\t d1e1\tz5E-1  p3   t2\t;\r\n");
    let tool = table.by_number(2).unwrap();
    assert_eq!((tool.pocket, tool.diameter_mm, tool.offset[Axis::Z]), (3, 10.0, 0.5));
    assert_eq!(tool.remark, "");
}

#[test]
fn lengths_are_in_the_unit_of_the_file_and_angles_are_not() {
    let text = b"T1 P1 X1 A1 B1 C1 W1 D1 I1 J1";
    let table = ToolTable::parse(text, LengthUnit::Inch, ToolChanger::Fixed).unwrap();
    let tool = table.by_number(1).unwrap();
    assert_eq!(tool.offset, Position([25.4, 0.0, 0.0, 1.0, 1.0, 1.0, 0.0, 0.0, 25.4]));
    assert_eq!(
        (tool.diameter_mm, tool.front_angle_deg, tool.back_angle_deg),
        (25.4, 1.0, 1.0)
    );
}

#[test]
fn tools_keep_the_order_of_the_file() {
    let table = read("T3 P1\n\n; a line of its own\nT1 P1\nT99999 P99999 Z+0.1 ;big tool number\n");
    let numbers: Vec<u32> = table.tools().map(|tool| tool.number).collect();
    assert_eq!(numbers, [3, 1, 99999]);
    // A fixed changer's pockets may repeat: the first counts.
    assert_eq!(table.in_pocket(1).map(|tool| tool.number), Some(3));
}

#[test]
fn all_errors_come_at_once_with_their_places() {
    let text =
        "T1 P1 Z1 Z2\nT1 P2\nT4 P4 ;fine\nP5\nT6 Z1\nT7 P7 Zinf Dx X1e10 Q10\nT-8 P8.0\nT 9 P9 Y\nT1P1Z1\nfoo T1\n";
    let unknown = "an entry is one of the letters T P X Y Z A B C U V W D I J Q with a number right behind it; \
                   remarks stand behind ;";
    let integer =
        |what: &str, max: u32| format!("{what} is an integer from 0 to {max}, with a blank before the next entry");
    let expected = [
        "1:10: Z appears twice in this line: once is allowed".into(),
        "4:1: T is missing: each line names its tool".into(),
        "5:1: P is missing: each tool has a pocket number; with a fixed tool changer any number will do, 1 say".into(),
        "6:7: Z needs a plain number such as -1.5, and a blank before the next entry".into(),
        "6:12: D needs a plain number such as -1.5, and a blank before the next entry".into(),
        "6:15: the number of X is too large: at most 1000000000".into(),
        format!("6:21: {}", integer("Q (orientation)", 9)),
        format!("7:1: {}", integer("T (tool number)", i32::MAX as u32)),
        "8:1: T needs a number right behind it, without a blank between".into(),
        format!("8:3: {unknown}"),
        "8:8: Y needs a number right behind it, without a blank between".into(),
        format!("9:1: {}", integer("T (tool number)", i32::MAX as u32)),
        "10:1: P is missing: each tool has a pocket number; with a fixed tool changer any number will do, 1 say".into(),
    ];
    // The second T1 is not told: the first one's line could not be read.
    assert_eq!(errors(text, ToolChanger::Fixed), expected);
}

#[test]
fn a_tool_number_stands_once() {
    let found = errors("T1 P1\nT2 P1\nT1 P3\n", ToolChanger::Fixed);
    assert_eq!(found, ["3:1: T1 is already in line 1: each tool number may stand once"]);
}

#[test]
fn a_random_changer_has_one_tool_in_each_pocket_of_its_range() {
    let found = errors("T1 P1\nT2 P0\nT3 P1\nT4 P1001\n", ToolChanger::Random);
    assert_eq!(
        found,
        [
            "3:4: P1 is already in line 1: one tool in each pocket of a random tool changer",
            "4:4: P (pocket number) is an integer from 0 to 1000, with a blank before the next entry",
        ]
    );
}

#[test]
fn the_columns_of_linuxcnc_before_2_4_are_refused() {
    let found = errors("TOOLNO POCKET LENGTH\n\n  1  1  +0.511\n", ToolChanger::Fixed);
    assert!(found.iter().all(|line| line.starts_with("3:")), "{found:?}");
    assert_eq!(found.len(), 3);
}

#[test]
fn a_table_holds_so_many_tools_and_no_more() {
    let line = |number: usize| format!("T{number} P{}\n", number % 1000);
    let full: String = (0..TOOLS_MAX).map(line).collect();
    let mut table = read(&full);
    let more = Tool {
        number: 5000,
        ..Tool::default()
    };
    assert_eq!(table.set(more), Err(SetToolError::Full));
    assert_eq!(table.tools().count(), TOOLS_MAX);
    let found = errors(&(full + "T5000 P1\nT5001 P1\n"), ToolChanger::Fixed);
    assert_eq!(found, ["1002:1: more than 1001 tools"]);
}

#[test]
fn what_did_not_change_is_written_as_it_was_read() {
    let text = "; mill\n\nt2 p4   z5 ;  reamer\nT1 P1 D3.00 Z1\n";
    let mut table = read(text);
    assert_eq!(table.write(), text);
    table.set(table.by_number(2).unwrap().clone()).unwrap();
    assert_eq!(table.write(), text);

    let mut tool = table.by_number(1).unwrap().clone();
    tool.offset[Axis::X] = -0.25;
    tool.orientation = 3;
    table.set(tool).unwrap();
    table
        .set(Tool {
            number: 10,
            pocket: 123,
            remark: "new\none".into(),
            ..Tool::default()
        })
        .unwrap();
    let expected = "; mill\n\nt2 p4   z5 ;  reamer\n\
                    T1   P1   D+3.000000 X-0.250000 Z+1.000000 Q3\n\
                    T10  P123 ;new one\n";
    assert_eq!(table.write(), expected);
    assert_eq!(read(expected), table);
}

#[test]
fn a_remark_in_latin_1_survives() {
    let text = b"T1 P1 ;fr\xE4ser\n";
    let table = ToolTable::parse(text, LengthUnit::Millimetre, ToolChanger::Fixed).unwrap();
    assert_eq!(table.by_number(1).unwrap().remark, "fräser");
    assert_eq!(read(&table.write()), table);
}

#[test]
fn a_random_changer_swaps_pockets() {
    let parse = |text: &[u8]| ToolTable::parse(text, LengthUnit::Millimetre, ToolChanger::Random).unwrap();
    let mut table = parse(b"T5 P0\nT6 P2 ;six\nT7 P3\n");
    table.swap_pockets(0, 2);
    let places = |table: &ToolTable| table.tools().map(|tool| (tool.number, tool.pocket)).collect::<Vec<_>>();
    assert_eq!(places(&table), [(5, 2), (6, 0), (7, 3)]);
    table.swap_pockets(0, 9); // an empty pocket: the tool is put back there
    assert_eq!(places(&table), [(5, 2), (6, 9), (7, 3)]);
    table.swap_pockets(3, 3);
    assert_eq!(table.write(), "T5   P2  \nT6   P9   ;six\nT7 P3\n");
    assert_eq!(parse(table.write().as_bytes()), table);
    let tool = Tool {
        number: 8,
        pocket: 9,
        ..Tool::default()
    };
    assert_eq!(table.set(tool), Err(SetToolError::PocketTaken { pocket: 9 }));
}

#[test]
fn values_that_no_file_can_hold_are_refused() {
    let mut table = ToolTable::default();
    let good = Tool::default;
    let offset = |value: f64| {
        let mut tool = good();
        tool.offset[Axis::V] = value;
        tool
    };
    let diameter = Tool {
        diameter_mm: -1.1e9,
        ..good()
    };
    let number = Tool {
        number: 1 << 31,
        ..good()
    };
    let pocket = Tool {
        pocket: 1 << 31,
        ..good()
    };
    let orientation = Tool {
        orientation: 10,
        ..good()
    };
    let tools = [
        offset(f64::NAN),
        offset(f64::INFINITY),
        diameter,
        number,
        pocket,
        orientation,
    ];
    for (tool, letter) in tools.into_iter().zip(['V', 'V', 'D', 'T', 'P', 'Q']) {
        assert_eq!(table.set(tool), Err(SetToolError::OutOfRange { letter }));
    }
    assert_eq!(table.tools().count(), 0);
}

fn tools() -> impl Strategy<Value = Vec<Tool>> {
    let value = prop_oneof![
        Just(0.0),
        -1e4..1e4,
        (-9_999_999..9_999_999).prop_map(|micro| f64::from(micro) / 1e6)
    ];
    let values = prop::collection::vec(value, 12);
    let tool = (0..50_u32, 0..2000_u32, values, 0..=9_u8, "[ -~ä]{0,20}");
    let tool = tool.prop_map(|(number, pocket, values, orientation, remark)| Tool {
        number,
        pocket,
        offset: Position(std::array::from_fn(|axis| values[axis])),
        diameter_mm: values[9],
        front_angle_deg: values[10],
        back_angle_deg: values[11],
        orientation,
        remark,
    });
    prop::collection::vec(tool, 0..20)
}

proptest! {
    /// A metric file holds every value; what is read is what was written.
    #[test]
    fn a_metric_table_reads_back_equal(tools in tools()) {
        let mut table = ToolTable::default();
        for tool in tools {
            table.set(tool).unwrap();
        }
        let text = table.write();
        let again = ToolTable::parse(text.as_bytes(), LengthUnit::Millimetre, ToolChanger::Fixed).unwrap();
        prop_assert_eq!(&again, &table);
        prop_assert_eq!(again.write(), text);
    }

    /// Some lengths in mm have no number of inches that is exactly theirs; the nearest is written.
    #[test]
    fn a_table_in_inches_reads_back_to_the_last_place(tools in tools()) {
        let mut table = ToolTable::new(LengthUnit::Inch, ToolChanger::Fixed);
        for tool in tools {
            table.set(tool).unwrap();
        }
        let read = |text: &str| ToolTable::parse(text.as_bytes(), LengthUnit::Inch, ToolChanger::Fixed).unwrap();
        let once = read(&table.write());
        for (one, other) in table.tools().zip(once.tools()) {
            let pairs = one.offset.0.iter().zip(&other.offset.0).chain([(&one.diameter_mm, &other.diameter_mm)]);
            for (one, other) in pairs {
                prop_assert!((one - other).abs() <= 4.0 * f64::EPSILON * one.abs());
            }
        }
        // What came from a file comes again, even when each line is written again.
        let mut twice = ToolTable::new(LengthUnit::Inch, ToolChanger::Fixed);
        for tool in once.tools() {
            twice.set(tool.clone()).unwrap();
        }
        prop_assert_eq!(&read(&twice.write()), &once);
    }

    /// Any octets give a table whose text gives the same table, or errors in order at places that exist.
    #[test]
    fn any_octets_are_read_or_refused(
        text in prop_oneof![
            prop::collection::vec(any::<u8>(), 0..200),
            "([TPXDQIJ;ä \n\t.+-]|[tpz][0-9]{1,3} ){0,60}".prop_map(String::into_bytes),
        ],
        random in any::<bool>(),
    ) {
        let changer = if random { ToolChanger::Random } else { ToolChanger::Fixed };
        match ToolTable::parse(&text, LengthUnit::Inch, changer) {
            Ok(table) => {
                let again = ToolTable::parse(table.write().as_bytes(), LengthUnit::Inch, changer);
                prop_assert_eq!(again, Ok(table));
            }
            Err(errors) => {
                prop_assert!(!errors.is_empty());
                prop_assert!(errors.is_sorted_by_key(|error| (error.line, error.column)));
                for error in errors {
                    prop_assert!(!error.render("tool.tbl", &text).is_empty());
                }
            }
        }
    }
}

#[test]
fn what_counts_for_nothing_is_told_and_the_rest_counts() {
    let text = "Tool Pocket Z-offset D ; headline\nT1 P1.0 Z2.5 D0.4 I87.0 Q2.0 R0.4 drill ;right hand\n";
    let found = errors(text, ToolChanger::Fixed);
    assert_eq!(
        found,
        ["1:22: D needs a number right behind it, without a blank between"]
    );
    let table = read(&text.replace("-offset D", "-offset"));
    let told: Vec<String> = table.passed_over().iter().map(TableError::to_string).collect();
    let nothing = "this counts for nothing: an entry is one of the letters T P X Y Z A B C U V W D I J Q with a number right behind \
                   it; remarks stand behind ;";
    let places = ["1:1", "2:30", "2:35"].map(|place| format!("{place}: {nothing}"));
    assert_eq!(told, places);
    let tool = table.by_number(1).unwrap();
    assert_eq!((tool.pocket, tool.orientation, tool.front_angle_deg), (1, 2, 87.0));
    assert_eq!((tool.offset[Axis::Z], tool.diameter_mm), (2.5, 0.4));
    // What a program does not change stays as it was read, and is told once more when it is read again.
    assert_eq!(read(&table.write()).passed_over(), table.passed_over());
    // A number that could be meant is no word.
    let wrong = "T1 P1 Zinf\nT2 P2.5\nT3 P3 Q2.1\nT4 P4 5\n";
    let lines: Vec<String> = errors(wrong, ToolChanger::Fixed)
        .iter()
        .map(|line| line[..4].to_owned())
        .collect();
    assert_eq!(lines, ["1:7:", "2:4:", "3:7:", "4:7:"]);
}

#[test]
fn wear_is_counted_with_until_the_tool_is_measured_anew() {
    let text = b"T1 P1 Z+10 D6 ;mill\nT2 P2 Z20\n";
    let mut table = ToolTable::parse(text, LengthUnit::Millimetre, ToolChanger::Fixed).unwrap();
    let wear = Wear {
        length_mm: -0.02,
        diameter_mm: -0.05,
    };
    table.set_wear(1, wear).unwrap();
    table.set_wear(7, wear).unwrap();
    assert_eq!(
        (table.wear(1), table.wear(7)),
        (wear, Wear::default()),
        "there is no tool 7"
    );
    let worn = table.with_wear(1).unwrap();
    assert_eq!((worn.offset[Axis::Z], worn.diameter_mm), (9.98, 5.95));
    assert_eq!(table.write().as_bytes(), text, "LinuxCNC's file has no place for it");
    let mut tool = table.by_number(1).unwrap().clone();
    tool.remark = "end mill".into();
    table.set(tool.clone()).unwrap();
    assert_eq!(table.wear(1), wear);
    tool.offset[Axis::Z] = 9.9;
    table.set(tool).unwrap();
    let left = Wear { length_mm: 0.0, ..wear };
    assert_eq!(table.wear(1), left);
    // Somebody has edited the file: the diameter is another one.
    let mut edited = ToolTable::parse(b"T1 P1 Z+9.9 D5.9\n", LengthUnit::Millimetre, ToolChanger::Fixed).unwrap();
    edited.take_wear_of(&table);
    assert_eq!(edited.wear(1), Wear::default());
    assert!(table.remove(1));
    assert_eq!(table.wear(1), Wear::default());
    let beyond = Wear {
        length_mm: f64::NAN,
        ..wear
    };
    assert!(table.set_wear(2, beyond).is_err());
}

#[test]
fn a_sister_is_meant_where_the_tool_is_called() {
    let mut table = ToolTable::parse(
        b"T5 P5 Z50 D6\nT15 P15 Z30 D8\n",
        LengthUnit::Millimetre,
        ToolChanger::Fixed,
    )
    .unwrap();
    table.set_sisters(BTreeMap::from([(5, 15)]));
    let settings = Settings {
        tools: table,
        ..Settings::default()
    };
    let program = b"T5 M6 G43 H5\nG10 L1 P5 Z51\n#1=#5400 #2=#5403 #3=#5410\nM2\n";
    let mut run = Interpreter::new(settings).run(program);
    let calls: Vec<Call> = run.by_ref().map(|call| call.unwrap().call).collect();
    let changes = calls
        .iter()
        .filter(|call| matches!(call, Call::ChangeTool { tool: 15, .. }));
    assert_eq!(changes.count(), 1, "{calls:?}");
    let left = run.snapshot();
    assert_eq!(
        left.tools.by_number(5).unwrap().offset[Axis::Z],
        51.0,
        "the table is set as it is written"
    );
}
