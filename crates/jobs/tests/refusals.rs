//! What a machinist can get wrong: which field, and the sentence.

use jobs::{KINDS, kind, value};
use proptest::prelude::*;
use serde_json::{Map, Value, json};

#[track_caller]
fn assert_refused(name: &str, values: &Value, field: &str, sentence: &str) {
    let made = kind(name).and_then(|kind| kind.make(values.as_object().unwrap()));
    let wrong = made.expect_err("a refusal");
    assert_eq!(
        (wrong.field.unwrap_or_default(), wrong.message.text.as_str()),
        (field, sentence)
    );
    assert!(wrong.message.code.starts_with("job."));
}

#[test]
fn wrong_numbers_are_told_at_their_fields() {
    for (name, values, field, sentence) in [
        (
            "rectangular_pocket",
            json!({ "tool_diameter": 50 }),
            "tool_diameter",
            "a tool of 50 mm does not fit into a pocket of 40 mm: take a smaller one",
        ),
        (
            "circular_pocket",
            json!({ "diameter": 8 }),
            "tool_diameter",
            "a tool of 8 mm does not fit into a pocket of 8 mm: take a smaller one",
        ),
        (
            "rectangular_pocket",
            json!({ "stepover": 7 }),
            "stepover",
            "a stepover of 7 mm leaves ridges with a tool of 8 mm: at most 6.800 mm",
        ),
        (
            "facing",
            json!({ "stepover": 41 }),
            "stepover",
            "a stepover of 41 mm leaves ridges with a tool of 40 mm: at most 40.000 mm",
        ),
        (
            "facing",
            json!({ "finish": 1 }),
            "finish",
            "a last pass of 1 mm takes the whole depth of 1 mm: less, or 0",
        ),
        (
            "rectangular_pocket",
            json!({ "depth": -5 }),
            "depth",
            "a depth of -5 mm is not below the surface: depth is measured downwards and is above 0",
        ),
        (
            "bolt_circle",
            json!({ "safe_height": -1 }),
            "safe_height",
            "a safe height of -1 mm is not above the surface, which is at 0 mm: set it higher",
        ),
        (
            "bolt_circle",
            json!({ "retract": 11 }),
            "retract",
            "feed cannot begin at 11 mm, above the safe height of 10 mm: lower it, or raise the safe height",
        ),
        (
            "bolt_circle",
            json!({ "count": 40 }),
            "count",
            "holes of 5 mm are only 4.708 mm apart: they would run into each other",
        ),
        (
            "hole_rows",
            json!({ "row_spacing": -4 }),
            "row_spacing",
            "holes of 5 mm are only 4.000 mm apart: they would run into each other",
        ),
        (
            "rectangular_pocket",
            json!({ "corner_radius": 3 }),
            "corner_radius",
            "a tool of 8 mm cannot cut corners of a radius of 3 mm: at least 4 mm, or a smaller tool",
        ),
        (
            "rectangular_pocket",
            json!({ "corner_radius": 21 }),
            "corner_radius",
            "corners of a radius of 21 mm do not fit into a pocket of 40 mm: at most 20 mm",
        ),
        (
            "circular_pocket",
            json!({ "finish": 2 }),
            "finish",
            "an allowance of 2 mm is too much for this tool in this pocket: at most 1.600 mm",
        ),
        (
            "circular_pocket",
            json!({ "diameter": 8.5, "finish": 0 }),
            "entry",
            "the pocket is too narrow for a helix of a tool of 8 mm: take a smaller tool, or another entry",
        ),
        (
            "circular_pocket",
            json!({ "diameter": 10, "finish": 0, "entry": "ramp" }),
            "entry",
            "the pocket is too short for a ramp of a tool of 8 mm: take a smaller tool, or another entry",
        ),
        (
            "thread_milling",
            json!({ "tool_diameter": 9 }),
            "tool_diameter",
            "a tool of 9 mm does not fit into the hole of 8.376 mm of this thread: take a smaller one",
        ),
        (
            "thread_milling",
            json!({ "pitch": 10 }),
            "pitch",
            "a thread of 10 mm has no room for a profile 5.413 mm deep: take a smaller pitch",
        ),
        (
            "thread_milling",
            json!({ "depth": 0.3 }),
            "depth",
            "a thread 0.3 mm long is shorter than the entry of the tool: more than 0.375 mm",
        ),
        (
            "thread_milling",
            json!({ "safe_height": 0.5 }),
            "safe_height",
            "the tool leaves the thread at up to 1.875 mm, above the safe height of 0.5 mm: raise it",
        ),
        (
            "engraving",
            json!({ "text": "20 € 🙂 20 €\u{7}" }),
            "text",
            "the font does not have U+0007 € 🙂: write it in other letters",
        ),
        (
            "engraving",
            json!({ "text": "  " }),
            "text",
            "there is no text to engrave",
        ),
        (
            "engraving",
            json!({ "text": "HHHHHHHHHHHH", "layout": "arc_outwards", "radius": 10 }),
            "radius",
            "a text 82.000 mm long does not fit around a circle of 62.832 mm: take a larger radius",
        ),
        (
            "engraving",
            json!({ "text": "A", "layout": "arc_inwards", "radius": 8 }),
            "radius",
            "letters 8 mm high that point inwards do not fit into a radius of 8 mm: take a larger radius",
        ),
        (
            "facing",
            json!({ "feed": 0 }),
            "feed",
            "feed: expected 1 to 100000, got 0",
        ),
        (
            "facing",
            json!({ "feed": "fast" }),
            "feed",
            "feed: expected a number, got \"fast\"",
        ),
        (
            "bolt_circle",
            json!({ "count": 2.5 }),
            "count",
            "count: expected a whole number, got 2.5",
        ),
        (
            "facing",
            json!({ "along": "z" }),
            "along",
            "along: expected one of x, y",
        ),
        (
            "engraving",
            json!({ "text": "x".repeat(101) }),
            "text",
            "text: expected a text of at most 100 characters",
        ),
        (
            "facing",
            json!({ "stepdown": 0.001, "depth": 500 }),
            "",
            "the program would have more than 10000 lines: take larger steps or make it in parts",
        ),
    ] {
        assert_refused(name, &values, field, sentence);
    }
}

#[test]
fn what_is_not_known_is_told_with_what_is() {
    let wrong = kind("drill").unwrap_err();
    assert!(
        wrong
            .message
            .text
            .starts_with("there is no kind of job \"drill\": facing, "),
        "{}",
        wrong.message
    );
    assert_eq!(wrong.field, None);
    let values = json!({ "dept": 1 });
    let wrong = kind("facing").unwrap().make(values.as_object().unwrap()).unwrap_err();
    assert!(
        wrong
            .message
            .text
            .starts_with("there is no number \"dept\": x, y, length"),
        "{}",
        wrong.message
    );
}

fn any_value() -> impl Strategy<Value = Value> {
    prop_oneof![
        any::<f64>().prop_map(|number| json!(number)),
        (-2000_i64..2000).prop_map(|number| json!(number as f64 / 100.0)),
        (0_u32..50).prop_map(|number| json!(number)),
        prop::sample::select(vec![
            "helix",
            "ramp",
            "plunge",
            "y",
            "outside",
            "left",
            "peck",
            "arc_inwards",
            "one_way"
        ])
        .prop_map(|word| json!(word)),
        any::<String>().prop_map(|text| json!(text)),
        Just(Value::Null),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    /// Any numbers give a program that the interpreter takes, or a sentence with a code.
    #[test]
    fn no_value_breaks_anything(which in 0..KINDS.len(), picked in prop::collection::vec((any::<prop::sample::Index>(), any_value(), any::<bool>()), 0..6)) {
        let kind = KINDS[which];
        let fields = (kind.fields)();
        let mut values = Map::new();
        for (index, any, typed) in picked {
            let field = index.get(&fields);
            let text = any.as_str().map_or_else(|| any.to_string(), str::to_owned);
            let value = if typed { value(field, &text).unwrap_or(any) } else { any };
            values.insert(field.name.to_owned(), value);
        }
        // Another one is not in the table.
        values.entry("tool").and_modify(|tool| if *tool != 0 { *tool = json!(1) });
        match kind.make(&values) {
            Ok(text) => {
                prop_assert!(text.lines().count() <= jobs::LINES_MAX as usize);
                crate::driven::ways(&text);
            }
            Err(wrong) => {
                prop_assert!(wrong.message.code.starts_with("job."), "{}", wrong.message);
                prop_assert!(wrong.field.is_none_or(|name| fields.iter().any(|field| field.name == name)));
            }
        }
    }
}
