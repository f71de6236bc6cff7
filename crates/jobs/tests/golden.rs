//! A few programs as they are written. `GOLDEN=write cargo test -p isocnc-jobs golden` writes them; read what has changed.

use jobs::{KINDS, kind};
use serde_json::{Value, json};
use std::path::Path;

fn program(name: &str, values: &Value) -> String {
    let values = values.as_object().unwrap();
    let made = kind(name).and_then(|kind| kind.make(values));
    made.unwrap_or_else(|wrong| panic!("{name}: {}", wrong.message))
}

#[test]
fn programs_are_written_as_before() {
    let cases = [
        (
            "facing",
            json!({ "length": 80, "width": 50, "depth": 1.2, "stepdown": 0.5, "finish": 0.2, "coolant": "flood" }),
        ),
        (
            "rectangular_pocket",
            json!({ "length": 30, "width": 20, "corner_radius": 5, "stepdown": 2.5 }),
        ),
        (
            "circular_pocket",
            json!({ "diameter": 24, "depth": 3, "stepdown": 3, "ramp_angle": 10, "x": 10, "y": -5 }),
        ),
        ("bolt_circle", json!({ "cycle": "peck", "angle": 30 })),
        (
            "hole_rows",
            json!({ "columns": 3, "rows": 2, "cycle": "chip_break", "tool": 0, "spindle": 0 }),
        ),
        ("thread_milling", json!({ "depth": 4, "passes": 2 })),
        (
            "engraving",
            json!({ "text": "Nr. 7 (ß)", "layout": "arc_outwards", "align": "middle", "angle": 90 }),
        ),
    ];
    for (name, values) in &cases {
        let written = program(name, values);
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("tests/golden/{name}.ngc"));
        if std::env::var_os("GOLDEN").is_some_and(|what| what == "write") {
            std::fs::write(&file, &written).unwrap();
        }
        assert_eq!(std::fs::read_to_string(&file).unwrap(), written, "{name}");
    }
    assert_eq!(cases.map(|(name, _)| name), KINDS.map(|kind| kind.name));
}

#[test]
fn every_kind_has_a_program_with_its_defaults_and_says_its_fields() {
    for kind in KINDS {
        let text = program(kind.name, &json!({}));
        crate::driven::ways(&text);
        let told = kind.told();
        assert_eq!(told.fields.len(), (kind.fields)().len());
        let defaults: serde_json::Map<String, Value> = told
            .fields
            .iter()
            .map(|field| (field.name.clone(), json!(field.default)))
            .collect();
        assert_eq!(program(kind.name, &Value::Object(defaults)), text, "{}", kind.name);
        for field in &told.fields {
            assert!(field.doc.ends_with('.'), "{}: {}", kind.name, field.name);
            assert_eq!(
                field.min.is_some(),
                field.choices.is_empty() && field.length_max.is_none()
            );
        }
    }
}
