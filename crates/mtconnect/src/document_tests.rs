//! Documents as clients see them. Where xmllint is there, all of them are checked against the schemas of MTConnect.

use crate::{
    Agent, Alarm, Axis, AxisFacts, Document, Errors, Execution, Facts, Machine, Mode, Motion, Reply, Settings, Spindle,
    Stream, Subject, Tool, WaitFor,
};
use proptest::prelude::*;
use std::io::Write;
use std::path::Path;
use std::process::Command;
use std::time::Duration;

const NOW: Duration = Duration::from_millis(1_795_424_738_250);

fn machine() -> Machine {
    let axes = [('X', false), ('Y', false), ('Z', false), ('A', true)];
    Machine {
        name: "mill".into(),
        uuid: "isocnc-mill-0001".into(),
        description: "a mill <with> \"marks\" & more".into(),
        axes: axes
            .map(|(letter, is_rotary)| Axis {
                letter,
                is_rotary,
                is_measured: letter != 'Y',
                has_load: matches!(letter, 'X' | 'A'),
            })
            .to_vec(),
        has_spindle: true,
        measures_spindle: true,
    }
}

fn agent(buffer: usize) -> Agent {
    agent_with(buffer, Errors::Typed)
}

fn agent_with(buffer: usize, errors: Errors) -> Agent {
    let settings = Settings {
        sender: "pc".into(),
        instance: 1_795_424_738,
        buffer,
        errors,
    };
    Agent::new(&machine(), settings, NOW)
}

fn axis(commanded: f64, motion: Motion) -> AxisFacts {
    AxisFacts {
        commanded,
        motion,
        ..AxisFacts::default()
    }
}

fn facts() -> Facts {
    Facts {
        is_powered: true,
        mode: Mode::Automatic,
        execution: Execution::Active,
        program: Some("part & co.ngc".into()),
        line: Some(12),
        tool: 3,
        work_system: Some(7),
        parts: 4,
        parts_wanted: Some(10),
        feed_override: 80.0,
        rapid_override: 100.0,
        feed_mm_s: 12.5,
        place_mm: [1.0, -2.0, 0.5],
        program_s: Some(61.25),
        axes: vec![
            AxisFacts {
                actual: Some(9.9985),
                following_error: Some(0.0015),
                load_percent: Some(-12.5),
                ..axis(10.0, Motion::Travel)
            },
            axis(20.0, Motion::Stopped),
            axis(-1.25, Motion::Home),
            AxisFacts {
                actual: Some(90.0),
                ..axis(90.0, Motion::Stopped)
            },
        ],
        spindle: Some(Spindle {
            speed_rpm: -1000.0,
            actual_rpm: Some(-998.0),
            speed_override: 100.0,
        }),
        message: Some("turn it over".into()),
        ..Facts::default()
    }
}

fn tools() -> Vec<Tool> {
    let tool = |number, pocket, remark: &str| Tool {
        number,
        pocket,
        length_mm: 80.125,
        diameter_mm: 6.0,
        remark: remark.into(),
    };
    vec![tool(3, 0, "end mill <6>"), tool(12, 5, "")]
}

fn ask(agent: &Agent, path: &str, query: &str) -> Document {
    match agent.answer(path, query, NOW) {
        Reply::Document(document) => document,
        Reply::Stream(_) => panic!("{path}?{query} is a stream"),
    }
}

fn stream(agent: &Agent, path: &str, query: &str) -> Stream {
    match agent.answer(path, query, NOW) {
        Reply::Stream(stream) => stream,
        Reply::Document(document) => panic!("{}", document.xml),
    }
}

/// Text of the only item with this id.
fn value(document: &Document, id: &str) -> Option<String> {
    let read = roxmltree::Document::parse(&document.xml).unwrap();
    let mut found = read
        .descendants()
        .filter(|node| node.attribute("dataItemId") == Some(id));
    let node = found.next()?;
    assert!(found.next().is_none(), "{id} twice");
    Some(node.text().unwrap_or_default().trim().to_owned())
}

fn header(document: &Document, name: &str) -> u64 {
    let read = roxmltree::Document::parse(&document.xml).unwrap();
    let node = read
        .descendants()
        .find(|node| node.has_tag_name((node.tag_name().namespace().unwrap_or(""), "Header")));
    node.unwrap().attribute(name).unwrap().parse().unwrap()
}

fn sequences(document: &Document) -> Vec<u64> {
    let read = roxmltree::Document::parse(&document.xml).unwrap();
    let found = read
        .descendants()
        .filter_map(|node| node.attribute("sequence")?.parse().ok());
    let mut all: Vec<u64> = found.collect();
    all.sort_unstable();
    all
}

#[test]
fn current_tells_how_the_machine_is_and_was() {
    let mut agent = agent(1 << 10);
    let empty = ask(&agent, "/current", "");
    assert_eq!(value(&empty, "execution").as_deref(), Some("UNAVAILABLE"));
    agent.observe(&facts(), NOW);
    let before = agent.range().1 - 1;
    agent.observe(
        &Facts {
            execution: Execution::Wait(WaitFor::ToolLoad),
            line: Some(13),
            ..facts()
        },
        NOW,
    );
    let now = ask(&agent, "/mill/current", "");
    let told = |id: &str| value(&now, id).unwrap();
    assert_eq!(
        ["execution", "wait", "line", "mode", "program"].map(told),
        ["WAIT", "TOOL_LOAD", "13", "AUTOMATIC", "part & co.ngc"]
    );
    assert_eq!(
        [
            "z_com",
            "z_state",
            "feed",
            "place",
            "work_offset",
            "s_dir",
            "tool_asset"
        ]
        .map(told),
        ["-1.25", "HOME", "12.5", "1 -2 0.5", "G59.1", "COUNTER_CLOCKWISE", "T3"]
    );
    assert_eq!(
        ["x_act", "x_error", "x_load", "z_act", "a_act", "s_act"].map(told),
        ["9.9985", "0.0015", "-12.5", "UNAVAILABLE", "90", "998"]
    );
    assert_eq!(
        [value(&now, "y_act"), value(&now, "z_load")],
        [None, None],
        "nothing measures them"
    );
    let at = ask(&agent, "/current", &format!("at={before}"));
    assert_eq!(value(&at, "execution").as_deref(), Some("ACTIVE"));
    assert_eq!(value(&at, "line").as_deref(), Some("12"));
    let some = ask(&agent, "/current", "path=//Linear[@name=%22X%22]");
    assert_eq!(sequences(&some).len(), 7);
    assert_eq!(value(&some, "y_com"), None);
    agent.lose(NOW);
    assert_eq!(
        value(&ask(&agent, "/current", ""), "avail").as_deref(),
        Some("UNAVAILABLE")
    );
}

#[test]
fn states_of_the_control_have_the_words_of_the_standard() {
    let mut agent = agent(1 << 10);
    for (execution, word, wait) in [
        (Execution::Ready, "READY", "UNAVAILABLE"),
        (Execution::Active, "ACTIVE", "UNAVAILABLE"),
        (Execution::FeedHold, "FEED_HOLD", "UNAVAILABLE"),
        (Execution::Interrupted, "INTERRUPTED", "UNAVAILABLE"),
        (Execution::Wait(WaitFor::ToolLoad), "WAIT", "TOOL_LOAD"),
        (Execution::Wait(WaitFor::Pausing), "WAIT", "PAUSING"),
        (Execution::Wait(WaitFor::Resuming), "WAIT", "RESUMING"),
        (Execution::Wait(WaitFor::Other), "WAIT", "UNAVAILABLE"),
        (Execution::ProgramStopped, "PROGRAM_STOPPED", "UNAVAILABLE"),
        (Execution::OptionalStop, "PROGRAM_OPTIONAL_STOP", "UNAVAILABLE"),
        (Execution::Stopped, "STOPPED", "UNAVAILABLE"),
        (Execution::Completed, "PROGRAM_COMPLETED", "UNAVAILABLE"),
    ] {
        agent.observe(&Facts { execution, ..facts() }, NOW);
        let now = ask(&agent, "/current", "");
        assert_eq!(value(&now, "execution").as_deref(), Some(word));
        assert_eq!(value(&now, "wait").as_deref(), Some(wait));
    }
}

#[test]
fn alarms_are_conditions_of_what_they_are_about() {
    let mut agent = agent(1 << 10);
    let alarm = |subject, code: &str, is_warning| Alarm {
        subject,
        code: code.into(),
        text: format!("{code} it is"),
        is_warning,
    };
    let alarms = vec![
        alarm(Subject::Travel(0), "J-205", false),
        alarm(Subject::Drive(2), "J-201", false),
        alarm(Subject::Program, "P-601", false),
        alarm(Subject::Logic, "L-1", true),
        alarm(Subject::Communications, "N-101", false),
        alarm(Subject::Communications, "N-102", true),
        alarm(Subject::System, "S-301", false),
    ];
    agent.observe(&Facts { alarms, ..facts() }, NOW);
    let now = ask(&agent, "/current", "");
    for (id, told) in [
        ("x_travel", "J-205 it is"),
        ("z_drive", "J-201 it is"),
        ("motion", "P-601 it is"),
        ("system", "S-301 it is"),
    ] {
        assert_eq!(value(&now, id).as_deref(), Some(told));
    }
    let read = roxmltree::Document::parse(&now.xml).unwrap();
    let comms: Vec<_> = read
        .descendants()
        .filter(|node| node.attribute("dataItemId") == Some("comms"))
        .collect();
    let levels: Vec<&str> = comms.iter().map(|node| node.tag_name().name()).collect();
    assert_eq!(levels, ["Fault", "Warning"]);
    assert_eq!(comms[0].attribute("conditionId"), Some("N-101"));
    valid("Streams", &now);
    agent.observe(&facts(), NOW);
    let now = ask(&agent, "/current", "path=//DataItem[@category='CONDITION']");
    assert!(
        !now.xml.contains("<Fault") && !now.xml.contains("<Warning") && now.xml.contains("<Normal"),
        "{}",
        now.xml
    );
    let sample = ask(&agent, "/sample", "count=10000");
    assert!(sample.xml.contains("<Warning") && sample.xml.contains("nativeCode=\"N-101\""));
    valid("Streams", &sample);
}

#[test]
fn samples_go_on_by_their_numbers_and_what_is_lost_is_an_error() {
    let mut agent = agent(100);
    for line in 0..300 {
        agent.observe(
            &Facts {
                line: Some(line),
                ..facts()
            },
            NOW,
        );
    }
    let (first, next) = agent.range();
    assert_eq!(next - first, 100);
    let mut from = first;
    let mut all = Vec::new();
    while from < next {
        let part = ask(&agent, "/sample", &format!("from={from}&count=7"));
        assert_eq!(
            (header(&part, "firstSequence"), header(&part, "lastSequence")),
            (first, next - 1)
        );
        let told = sequences(&part);
        assert!(told.len() <= 7);
        all.extend(told);
        from = header(&part, "nextSequence");
    }
    assert_eq!(all, (first..next).collect::<Vec<_>>());
    let empty = ask(&agent, "/sample", &format!("from={next}"));
    assert_eq!((sequences(&empty).len(), header(&empty, "nextSequence")), (0, next));
    for query in [format!("from={}", first - 1), format!("from={}", next + 1)] {
        let error = ask(&agent, "/sample", &query);
        assert_eq!(error.status, 404);
        assert!(error.xml.contains("<OutOfRange>"), "{}", error.xml);
        valid("Error", &error);
    }
    let to = ask(&agent, "/sample", &format!("from={first}&to={}", first + 4));
    assert_eq!((sequences(&to).len(), header(&to, "nextSequence")), (5, first + 5));
}

#[test]
fn assets_are_the_tools_and_their_changes_are_observed() {
    let mut agent = agent(1 << 10);
    agent.tools(tools(), NOW);
    let probe = ask(&agent, "/probe", "");
    assert_eq!(header(&probe, "assetCount"), 2);
    let all = ask(&agent, "/assets", "");
    let ids = |document: &Document| -> Vec<String> {
        let read = roxmltree::Document::parse(&document.xml).unwrap();
        read.descendants()
            .filter_map(|node| node.attribute("assetId").map(str::to_owned))
            .collect()
    };
    assert_eq!(ids(&all), ["T3", "T12"]);
    assert_eq!(ids(&ask(&agent, "/asset/T12", "")), ["T12"]);
    assert_eq!(ids(&ask(&agent, "/mill/asset/T12;T3", "")), ["T12", "T3"]);
    assert_eq!(ids(&ask(&agent, "/assets", "type=CuttingTool&count=1")), ["T3"]);
    assert_eq!(ids(&ask(&agent, "/assets", "type=Fixture")).len(), 0);
    assert!(
        all.xml.contains("<Location type=\"SPINDLE\">") && all.xml.contains("<Location type=\"POT\">5<"),
        "{}",
        all.xml
    );
    let now = ask(&agent, "/current", "");
    assert_eq!(value(&now, "asset_changed").as_deref(), Some("T12"));
    agent.tools(tools()[..1].to_vec(), NOW);
    let now = ask(&agent, "/current", "");
    assert_eq!(value(&now, "asset_removed").as_deref(), Some("T12"));
    valid("Streams", &now);
    let before = agent.range();
    agent.tools(tools()[..1].to_vec(), NOW);
    assert_eq!(agent.range(), before, "nothing has changed");
    let none = ask(&agent, "/asset/T77", "");
    assert!(none.status == 404 && none.xml.contains("<AssetId>T77<"), "{}", none.xml);
    valid("Error", &none);
}

#[test]
fn errors_name_what_was_asked_for() {
    let (agent, coded) = (agent(100), agent_with(100, Errors::Coded));
    for (path, query, status, element, code) in [
        ("/lathe/probe", "", 404, "NoDevice", "NO_DEVICE"),
        ("/probe/x/y", "", 404, "InvalidURI", "INVALID_URI"),
        ("/current", "path=//[", 400, "InvalidXPath", "INVALID_PATH"),
        ("/current", "interval=5&at=3", 400, "Unsupported", "UNSUPPORTED"),
        ("/sample", "count=0", 400, "InvalidParameterValue", "INVALID_REQUEST"),
        ("/sample", "interval=x", 400, "InvalidParameterValue", "INVALID_REQUEST"),
        ("/sample", "from=1000000", 404, "OutOfRange", "OUT_OF_RANGE"),
        ("/current", "at=1000000", 404, "ErrorDeprecated", "OUT_OF_RANGE"),
        ("/sample", "to=x", 400, "ErrorDeprecated", "INVALID_REQUEST"),
        ("/sample", "to=1000000", 404, "ErrorDeprecated", "OUT_OF_RANGE"),
        ("/asset/1 2", "", 404, "ErrorDeprecated", "ASSET_NOT_FOUND"),
    ] {
        let old = ask(&coded, path, query);
        assert_eq!(old.status, status, "{path}?{query}");
        assert!(
            old.xml.contains(&format!("<Error errorCode=\"{code}\">")),
            "{}",
            old.xml
        );
        valid_as("Error", "2.2", &old);
        let error = ask(&agent, path, query);
        assert_eq!(error.status, status, "{path}?{query}");
        assert!(
            error.xml.contains(&format!("<{element}")),
            "{path}?{query}: {}",
            error.xml
        );
        valid("Error", &error);
    }
}

#[test]
fn streams_have_a_part_when_there_is_something_and_a_sign_of_life() {
    let mut agent = agent(100);
    let ms = |ms: u64| NOW + Duration::from_millis(ms);
    let (_, next) = agent.range();
    let mut stream = stream(&agent, "/sample", &format!("from={next}&interval=100&heartbeat=1000"));
    let first = stream.part(&agent, ms(0)).expect("an empty one at once");
    let text = String::from_utf8(first).unwrap();
    let (head, body) = text.split_once("\r\n\r\n").unwrap();
    assert!(
        head.starts_with("--") && Stream::content_type().ends_with(&head[2..head.find('\r').unwrap()]),
        "{head}"
    );
    let length: usize = head.rsplit(": ").next().unwrap().parse().unwrap();
    assert_eq!(body.len(), length + 2);
    assert_eq!(stream.part(&agent, ms(500)), None);
    agent.observe(&facts(), NOW);
    assert!(stream.part(&agent, ms(550)).is_some());
    agent.observe(&Facts::default(), NOW);
    assert_eq!(stream.part(&agent, ms(600)), None, "not more often than was asked for");
    assert!(stream.part(&agent, ms(650)).is_some());
    assert_eq!(stream.part(&agent, ms(1600)), None);
    assert!(stream.part(&agent, ms(1650)).is_some(), "a sign of life");
    // One that reads too slowly is told that it has lost something.
    for line in 0..500 {
        agent.observe(
            &Facts {
                line: Some(line),
                ..facts()
            },
            NOW,
        );
    }
    let last = String::from_utf8(stream.part(&agent, ms(3000)).unwrap()).unwrap();
    assert!(last.contains("<OutOfRange>") && stream.is_over(), "{last}");
    assert_eq!(stream.part(&agent, ms(9000)), None);
}

#[test]
fn a_stream_of_current_tells_all_each_time() {
    let agent = agent(100);
    let mut stream = stream(&agent, "/current", "interval=100");
    let parts = (0..10_u64).filter_map(|k| stream.part(&agent, NOW + Duration::from_millis(50 * k)));
    assert_eq!(parts.count(), 5);
}

/// Whether xmllint finds the document as the schema wants it. Passes where there is no xmllint.
fn valid(kind: &str, document: &Document) {
    valid_as(kind, "2.7", document);
}

fn valid_as(kind: &str, version: &str, document: &Document) {
    if let Err(told) = lint(kind, version, &document.xml) {
        panic!("{told}\n{}", document.xml);
    }
}

fn lint(kind: &str, version: &str, xml: &str) -> Result<(), String> {
    let schema = format!("tests/schemas/MTConnect{kind}_{version}_1.0.xsd");
    let schema = Path::new(env!("CARGO_MANIFEST_DIR")).join(schema);
    let mut file = tempfile::NamedTempFile::new().unwrap();
    file.write_all(xml.as_bytes()).unwrap();
    let checked = Command::new("xmllint")
        .args(["--noout", "--nonet", "--schema"])
        .arg(schema)
        .arg(file.path())
        .output();
    let Ok(checked) = checked else {
        println!("skipped: there is no xmllint");
        return Ok(());
    };
    match checked.status.success() {
        true => Ok(()),
        false => Err(String::from_utf8_lossy(&checked.stderr).into_owned()),
    }
}

/// Else the others would pass with a check that finds nothing.
#[test]
fn a_document_that_is_wrong_is_found() {
    if Command::new("xmllint").arg("--version").output().is_err() {
        println!("skipped: there is no xmllint");
        return;
    }
    let mut agent = agent(100);
    agent.observe(&facts(), NOW);
    let xml = ask(&agent, "/current", "").xml;
    assert!(lint("Streams", "2.7", &xml.replace(">ACTIVE<", ">RUNNING<")).is_err());
    assert!(lint("Streams", "2.7", &xml.replace("nextSequence", "next")).is_err());
}

#[test]
fn all_documents_are_as_the_schemas_want_them() {
    let mut agent = agent(1 << 10);
    valid("Streams", &ask(&agent, "/current", ""));
    agent.tools(tools(), NOW);
    agent.observe(&facts(), NOW);
    valid("Devices", &ask(&agent, "/probe", ""));
    valid("Streams", &ask(&agent, "/current", ""));
    valid("Streams", &ask(&agent, "/sample", "count=1000"));
    valid("Assets", &ask(&agent, "/assets", ""));
    valid("Assets", &ask(&agent, "/assets", "type=Fixture"));
    agent.lose(NOW);
    valid("Streams", &ask(&agent, "/current", ""));
    for execution in [
        Execution::FeedHold,
        Execution::Interrupted,
        Execution::Wait(WaitFor::Pausing),
        Execution::Wait(WaitFor::Resuming),
        Execution::ProgramStopped,
        Execution::OptionalStop,
        Execution::Stopped,
        Execution::Completed,
    ] {
        agent.observe(&Facts { execution, ..facts() }, NOW);
    }
    for mode in [Mode::Manual, Mode::Mdi, Mode::SemiAutomatic] {
        agent.observe(
            &Facts {
                mode,
                is_emergency_stop: true,
                single_block: true,
                spindle: Some(Spindle::default()),
                ..Facts::default()
            },
            NOW,
        );
    }
    valid("Streams", &ask(&agent, "/sample", "count=1000"));
}

proptest! {
    /// Whatever is asked for: an answer that can be read.
    #[test]
    fn any_request_is_answered_in_xml(path in "/[a-z/;%0-9 <&]{0,20}", query in "[a-z=&%0-9/\\[\\]@\"']{0,40}") {
        let mut agent = agent(50);
        agent.observe(&facts(), NOW);
        if let Reply::Document(document) = agent.answer(&path, &query, NOW) {
            roxmltree::Document::parse(&document.xml).map_err(|error| TestCaseError::fail(format!("{error}: {}", document.xml)))?;
        }
    }
}
