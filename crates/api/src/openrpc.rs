//! The control socket for programs: its methods, their parameters, results and errors as an OpenRPC document.
//!
//! In:  the table of methods. Out: one JSON value, which `rpc.discover` and `isocnc schema --rpc` give.

use super::methods::table::{API_VERSION, Gives, Kind, METHODS, Method, Param};
use super::repeats::{ID_MAX, REQUEST_ID};
use super::roles::Role;
use super::rpc::code;
use motion::canon::Axis;
use serde_json::{Map, Value, json};

/// The document.
pub fn document() -> Value {
    let methods: Vec<Value> = METHODS.iter().map(method).collect();
    let mut schemas: Map<String, Value> = ALL
        .iter()
        .map(|gives| (name(*gives).to_owned(), result(*gives)))
        .collect();
    schemas.insert("Waiting".into(), waiting());
    schemas.insert("Entry".into(), entry());
    json!({
        "openrpc": "1.3.2",
        "info": {
            "title": "The control socket of isocnc",
            "version": API_VERSION,
            "description": "JSON-RPC 2.0, one message a line, over a Unix stream socket. Parameters go by name.",
        },
        "methods": methods,
        "components": { "schemas": schemas },
        "x-notifications": [{
            "name": "state",
            "summary": "to subscribers: the fields of the state that have changed, each as a whole",
            "paramStructure": "by-name",
            "params": [
                { "name": "monotonic_s", "required": true, "schema": { "type": "number" } },
                { "name": "unix_s", "required": true, "schema": { "type": "number" } },
                { "name": "changed", "required": true, "schema": { "type": "object", "minProperties": 1 } },
            ],
        }],
    })
}

/// What a method answers, as a schema that holds all that it refers to: for whoever checks an answer.
pub fn result_schema(method: &Method) -> Value {
    json!({
        "$ref": format!("#/components/schemas/{}", name(method.gives)),
        "components": document()["components"],
    })
}

fn method(method: &Method) -> Value {
    let mut params: Vec<Value> = (method.params.iter())
        .map(|param| json!({ "name": param.name, "required": param.required, "schema": kind(param) }))
        .collect();
    if !method.only_looks() {
        let schema = json!({ "type": "string", "minLength": 1, "maxLength": ID_MAX });
        params.push(json!({ "name": REQUEST_ID, "required": false, "schema": schema }));
    }
    json!({
        "name": method.name,
        "summary": method.does,
        "paramStructure": "by-name",
        "params": params,
        "result": { "name": "result", "schema": refer(name(method.gives)) },
        "errors": errors(method),
        "x-role": method.role,
    })
}

fn errors(method: &Method) -> Value {
    let mut codes = vec![(code::INVALID_PARAMS, "parameters that the method does not take")];
    if !method.only_looks() {
        codes.push((
            code::REFUSED,
            "it cannot be done now; the message says why, and what would help",
        ));
    }
    // Overrides may be turned down by everyone, and up by who may give orders.
    if method.role != Role::Watch || method.gives == Gives::Overrides {
        codes.push((
            code::NOT_ALLOWED,
            "this client has not the role for it; the data say which",
        ));
    }
    if method.asks_for_control() {
        codes.push((code::NO_CONTROL, "another client has control; the data say which"));
    }
    if matches!(method.name, "program.load" | "program.check" | "program.run") {
        codes.push((code::UNREADABLE, "the control cannot read the file: upload it"));
    }
    if method.name.starts_with("bus.sdo") || method.name == "sim.fault" {
        codes.push((code::NODE, "the node does not answer, or cannot be asked now"));
        codes.push((code::NODE_ABORT, "the node has refused it, with an abort code"));
        codes.push((code::NODE_NO_OBJECT, "the node does not have the object"));
    }
    let errors = codes
        .iter()
        .map(|(code, message)| json!({ "code": code, "message": message }));
    errors.collect()
}

/// Schema of a parameter.
fn kind(param: &Param) -> Value {
    let whole = |least: u64, most: u64| match most {
        u64::MAX => json!({ "type": "integer", "minimum": least }),
        most => json!({ "type": "integer", "minimum": least, "maximum": most }),
    };
    match param.kind {
        Kind::Whole(least, most) => whole(least, most),
        Kind::Wholes(least, most) => list(whole(least, most)),
        Kind::Texts(most) => json!({ "type": "array", "items": text(), "minItems": 1, "maxItems": most }),
        Kind::Number => json!({ "type": "number" }),
        Kind::Percent(least, most) => json!({ "type": "number", "minimum": least, "maximum": most }),
        Kind::Flag => json!({ "type": "boolean" }),
        Kind::Text => json!({ "type": "string" }),
        Kind::Octets(most) => json!({ "type": "string", "pattern": "^([0-9A-Fa-f]{2})*$", "maxLength": 2 * most }),
        Kind::Axis => {
            let letters: Vec<String> = Axis::ALL.iter().map(|axis| axis.letter().to_string()).collect();
            json!({ "type": "string", "enum": letters })
        }
        Kind::SimFault => json!({ "type": "string", "enum": super::methods::sim_faults() }),
        Kind::WorkSystem => json!({ "type": "string", "enum": super::methods::WORK_SYSTEMS }),
    }
}

const ALL: [Gives; 40] = [
    Gives::Nothing,
    Gives::Methods,
    Gives::OpenRpc,
    Gives::Status,
    Gives::Identified,
    Gives::Described,
    Gives::Metrics,
    Gives::Text,
    Gives::Subscribed,
    Gives::Control,
    Gives::Network,
    Gives::Octets,
    Gives::Outlook,
    Gives::UploadBegun,
    Gives::UploadGrown,
    Gives::PathBegun,
    Gives::PathPart,
    Gives::Offsets,
    Gives::Tools,
    Gives::Jog,
    Gives::Overrides,
    Gives::Journal,
    Gives::Resumed,
    Gives::Skipped,
    Gives::Kept,
    Gives::Lines,
    Gives::Report,
    Gives::Pins,
    Gives::ScopeBegun,
    Gives::ScopePart,
    Gives::LogicTasks,
    Gives::LogicVariables,
    Gives::LogicForced,
    Gives::LogicReleased,
    Gives::LogicReloaded,
    Gives::MachineFile,
    Gives::Errors,
    Gives::FileWritten,
    Gives::Doctor,
    Gives::Times,
];

fn name(gives: Gives) -> &'static str {
    match gives {
        Gives::Nothing => "Nothing",
        Gives::Methods => "Methods",
        Gives::OpenRpc => "OpenRpc",
        Gives::Status => "Status",
        Gives::Identified => "Identified",
        Gives::Described => "Described",
        Gives::Metrics => "Metrics",
        Gives::Text => "Text",
        Gives::Subscribed => "Subscribed",
        Gives::Control => "Control",
        Gives::Network => "Network",
        Gives::Octets => "Octets",
        Gives::Outlook => "Outlook",
        Gives::UploadBegun => "UploadBegun",
        Gives::UploadGrown => "UploadGrown",
        Gives::PathBegun => "PathBegun",
        Gives::PathPart => "PathPart",
        Gives::Offsets => "Offsets",
        Gives::Tools => "Tools",
        Gives::Jog => "Jog",
        Gives::Overrides => "Overrides",
        Gives::Journal => "Journal",
        Gives::Resumed => "Resumed",
        Gives::Skipped => "Skipped",
        Gives::Kept => "Kept",
        Gives::Lines => "Lines",
        Gives::Report => "Report",
        Gives::Pins => "Pins",
        Gives::ScopeBegun => "ScopeBegun",
        Gives::ScopePart => "ScopePart",
        Gives::LogicTasks => "LogicTasks",
        Gives::LogicVariables => "LogicVariables",
        Gives::LogicForced => "LogicForced",
        Gives::LogicReleased => "LogicReleased",
        Gives::LogicReloaded => "LogicReloaded",
        Gives::MachineFile => "MachineFile",
        Gives::Errors => "Errors",
        Gives::FileWritten => "FileWritten",
        Gives::Doctor => "Doctor",
        Gives::Times => "Times",
    }
}

fn refer(name: &str) -> Value {
    json!({ "$ref": format!("#/components/schemas/{name}") })
}

/// An object that has all of these members and no others.
fn object(members: Value) -> Value {
    let names: Vec<&String> = members.as_object().into_iter().flat_map(Map::keys).collect();
    json!({ "type": "object", "required": names, "properties": members, "additionalProperties": false })
}

fn list(of: Value) -> Value {
    json!({ "type": "array", "items": of })
}

fn or_null(mut of: Value) -> Value {
    match of.get_mut("type") {
        Some(kind) => {
            *kind = json!([*kind, "null"]);
            of
        }
        None => json!({ "anyOf": [of, { "type": "null" }] }),
    }
}

fn text() -> Value {
    json!({ "type": "string" })
}

fn pin_type() -> Value {
    let names: Vec<&str> = hal_pins::Type::ALL.iter().map(|kind| kind.name()).collect();
    json!({ "type": "string", "enum": names })
}

fn number() -> Value {
    json!({ "type": "number" })
}

fn whole() -> Value {
    json!({ "type": "integer", "minimum": 0 })
}

fn flag() -> Value {
    json!({ "type": "boolean" })
}

fn role() -> Value {
    json!({ "type": "string", "enum": Role::ALL })
}

fn waiting() -> Value {
    object(json!({ "for": text(), "text": text(), "release": text() }))
}

fn entry() -> Value {
    let acknowledged = || object(json!({ "unix_s": number(), "by": text() }));
    let mut entry = object(json!({
        "seq": whole(),
        "unix_s": number(),
        "time_s": number(),
        "kind": { "type": "string", "enum": ["alarm", "warning", "note"] },
        "text": text(),
    }));
    // These only where they are known.
    entry["properties"]["alarm"] = object(json!({
        "code": text(),
        "severity": text(),
        "reaction": text(),
        "first_cause": whole(),
        "joint": or_null(whole()),
        "node": or_null(text()),
        "program": or_null(text()),
        "line": or_null(whole()),
        "state": text(),
        "acknowledged": or_null(acknowledged()),
    }));
    entry["properties"]["program"] = object(json!({
        "name": text(),
        "begun_unix_s": number(),
        "result": or_null(text()),
        "took_s": or_null(number()),
        "line": or_null(whole()),
        "deviation_max_mm": or_null(number()),
        "report": or_null(whole()),
    }));
    entry["properties"]["acknowledges"] = json!({
        "type": "array",
        "prefixItems": [list(whole()), acknowledged()],
        "minItems": 2,
        "maxItems": 2,
    });
    entry
}

fn last_program() -> Value {
    object(json!({ "name": text(), "line": whole(), "result": or_null(text()) }))
}

fn parts() -> Value {
    object(json!({ "count": whole(), "target": or_null(whole()) }))
}

/// How much quicker than motion a program is planned.
fn real_time_factor() -> Value {
    object(json!({
        "whole": or_null(number()),
        "least": or_null(object(json!({
            "factor": number(),
            "from_line": whole(),
            "to_line": whole(),
            "from_s": number(),
            "to_s": number(),
        }))),
    }))
}

fn report() -> Value {
    object(json!({
        "number": whole(),
        "machine": text(),
        "begun_unix_s": number(),
        "took_s": number(),
        "parts": parts(),
        "cycles_skipped": whole(),
        "program": text(),
        "result": text(),
        "timed_out_step": or_null(text()),
        "alarms": list(object(json!({ "time_s": number(), "cause": text() }))),
        "warnings": list(object(json!({ "time_s": number(), "times": whole(), "cause": text() }))),
        "line_reached": whole(),
        "lines": whole(),
        "planned_time_s": number(),
        "real_time_factor": real_time_factor(),
        "motion_time_s": number(),
        "starved_cycles": whole(),
        "following_error_max_mm": number(),
        "following_error_max_line": whole(),
        "deviation": or_null(object(json!({
            "command_max_mm": number(),
            "actual_max_mm": number(),
            "tolerance_mm": number(),
        }))),
    }))
}

/// What is wrong with a machine file.
fn errors_of_a_file() -> Value {
    list(object(json!({
        "line": or_null(whole()),
        "column": or_null(whole()),
        "key": text(),
        "value": or_null(text()),
        "rule": text(),
        "hint": or_null(text()),
    })))
}

fn by_letter() -> Value {
    json!({ "type": "object", "additionalProperties": number() })
}

fn result(gives: Gives) -> Value {
    match gives {
        Gives::Nothing => object(json!({})),
        Gives::Methods => list(object(
            json!({ "name": text(), "params": list(text()), "does": text() }),
        )),
        Gives::OpenRpc | Gives::Network => json!({ "type": "object" }),
        Gives::Status => status(),
        Gives::Identified => object(json!({
            "client": whole(),
            "role": role(),
            "machine": text(),
            "version": text(),
            "api": text(),
        })),
        Gives::Described => object(json!({
            "machine": text(),
            "unit": text(),
            "cycle_us": whole(),
            "axes": list(object(json!({
                "axis": text(),
                "unit": text(),
                "joints": list(whole()),
                "joint": or_null(whole()),
                "travel": or_null(list(number())),
                "velocity_per_s": or_null(number()),
                "acceleration_per_s2": or_null(number()),
            }))),
            "joints": list(object(json!({
                "joint": whole(),
                "travel": list(number()),
                "velocity_per_s": number(),
                "following_error": number(),
            }))),
            "spindles": whole(),
            "spindle_rpm_max": number(),
            "programs": flag(),
        })),
        Gives::MachineFile => {
            object(json!({ "file": text(), "sha256": text(), "text": text(), "errors": errors_of_a_file() }))
        }
        Gives::Errors => object(json!({ "errors": errors_of_a_file() })),
        Gives::FileWritten => object(json!({ "before": text(), "sha256": text() })),
        Gives::Doctor => json!({ "type": "object" }),
        Gives::Times => {
            let times = || object(json!({ "edges_us": list(number()), "counts": list(whole()) }));
            object(json!({
                "cycle_us": whole(),
                "orders": object(json!({ "taken": whole(), "last_unix_s": or_null(number()) })),
                "period": times(),
                "lateness": times(),
                "exchange": times(),
                "compute": times(),
            }))
        }
        Gives::Metrics => object(json!({ "text": text() })),
        Gives::Text => object(json!({
            "name": text(),
            "revision": whole(),
            "first_line": whole(),
            "lines": list(text()),
            "more": flag(),
        })),
        Gives::Subscribed => object(json!({ "monotonic_s": number(), "unix_s": number(), "state": refer("Status") })),
        Gives::Control => or_null(object(json!({
            "client": whole(),
            "process": whole(),
            "name": text(),
            "taken": flag(),
        }))),
        Gives::Octets => object(json!({ "value": text() })),
        Gives::Outlook => object(json!({
            "program": text(),
            "revision": whole(),
            "lines": whole(),
            "planned_time_s": number(),
            "real_time_factor": real_time_factor(),
            "warning": or_null(text()),
        })),
        Gives::UploadBegun => object(json!({ "upload": whole(), "part_octets": whole() })),
        Gives::UploadGrown => object(json!({ "received": whole() })),
        Gives::PathBegun => object(json!({
            "path": whole(),
            "program": text(),
            "axes": list(text()),
            "record_octets": whole(),
        })),
        Gives::PathPart => object(json!({
            "base64": { "type": "string", "contentEncoding": "base64" },
            "end": flag(),
            "error": or_null(text()),
        })),
        Gives::Pins => object(json!({
            "pins": list(object(json!({
                "name": text(),
                "type": pin_type(),
                "direction": { "type": "string", "enum": ["in", "out", "net"] },
                "value": { "type": ["boolean", "number", "null"] },
                "net": or_null(text()),
                "source": or_null(text()),
                "alias_of": or_null(text()),
                "unit": or_null(text()),
            }))),
            "more": flag(),
        })),
        Gives::ScopeBegun => object(json!({
            "scope": whole(),
            "period_us": number(),
            "channels": list(object(json!({ "name": text(), "type": pin_type(), "unit": text() }))),
        })),
        Gives::ScopePart => object(json!({
            "scope": whole(),
            "record": whole(),
            "rows": whole(),
            "base64": { "type": "string", "contentEncoding": "base64" },
            "record_ends": flag(),
            "state": { "type": "string", "enum": ["waiting", "recording", "done"] },
            "lost": whole(),
            "more": flag(),
            "error": or_null(text()),
        })),
        Gives::Offsets => object(json!({
            "unit": text(),
            "systems": list(object(json!({
                "system": text(),
                "active": flag(),
                "origin": by_letter(),
                "rotation_degrees": number(),
            }))),
            "g92": by_letter(),
            "g92_active": flag(),
        })),
        Gives::Tools => object(json!({
            "unit": text(),
            "in_spindle": whole(),
            "tools": list(object(json!({
                "tool": whole(),
                "pocket": whole(),
                "length": number(),
                "diameter": number(),
                "remark": text(),
            }))),
        })),
        // Empty where a jog goes on or ends.
        Gives::Jog => json!({
            "type": "object",
            "properties": {
                "axis": text(),
                "unit": text(),
                "velocity_mm_s": number(),
                "soft_limit_mm": or_null(number()),
            },
            "additionalProperties": false,
        }),
        Gives::Overrides => overrides(),
        // The way back, one leg each, where the machine is not where the program is held.
        Gives::Resumed => json!({
            "type": "object",
            "properties": { "returns": list(text()) },
            "additionalProperties": false,
        }),
        Gives::Skipped => object(json!({ "skips": text() })),
        Gives::Kept => json!({
            "type": "object",
            "properties": { "warning": text() },
            "additionalProperties": false,
        }),
        Gives::Lines => object(json!({ "lines": list(text()) })),
        Gives::Report => report(),
        Gives::LogicTasks => object(json!({
            "programs": list(object(json!({
                "name": text(), "file": text(), "period_ms": number(), "steps_max": whole(), "scans": whole(), "overruns": whole(),
                "overflows": whole(), "scan_us": number(), "scan_max_us": number(), "stands": flag(), "forced": whole(),
            }))),
        })),
        Gives::LogicVariables => object(json!({
            "program": text(),
            "time_ms": number(),
            "variables": list(object(json!({
                "name": text(),
                "type": text(),
                "value": text(),
                "line": whole(),
                "role": { "type": "string", "enum": ["input", "output", "internal"] },
                "retain": flag(),
                "pin": or_null(text()),
                "forced": flag(),
            }))),
            "more": flag(),
        })),
        Gives::LogicForced => object(json!({ "forced": text() })),
        Gives::LogicReleased => object(json!({ "released": whole() })),
        Gives::LogicReloaded => object(json!({ "carried": whole() })),
        Gives::Journal => {
            object(json!({ "entries": list(refer("Entry")), "more": flag(), "last": whole(), "on_disk": whole() }))
        }
    }
}

fn overrides() -> Value {
    object(json!({
        "feed_percent": number(),
        "rapid_percent": number(),
        "spindle_percent": number(),
        "feed_acts": flag(),
        "spindle_acts": flag(),
        "adaptive_feed_acts": flag(),
        "feed_hold_acts": flag(),
    }))
}

fn status() -> Value {
    let positions = || json!({ "type": "array", "items": number(), "maxItems": Axis::ALL.len() });
    object(json!({
        "api": text(),
        "version": text(),
        "machine": text(),
        "file": text(),
        "pid": whole(),
        "state": text(),
        "cycles": whole(),
        "cycles_skipped": whole(),
        "late_max_us": number(),
        "homed": list(whole()),
        "line": whole(),
        "direction": { "type": "string", "enum": ["forward", "reverse"] },
        "single_block": flag(),
        "optional_stop": flag(),
        "block_delete": flag(),
        "velocity_mm_s": number(),
        "axes": list(object(json!({ "axis": text(), "joints": list(whole()), "unit": text() }))),
        "position_mm": positions(),
        "to_go_mm": or_null(positions()),
        "spindle": or_null(object(json!({ "on": flag(), "speed_rpm": number() }))),
        "coolant": object(json!({ "flood": flag(), "mist": flag() })),
        "external": list(object(json!({ "name": text(), "alive": flag(), "losses": whole() }))),
        "override": refer("Overrides"),
        "step": text(),
        "power": text(),
        "mode": { "type": "string", "enum": ["manual", "mdi", "auto"] },
        "activity": text(),
        "job": or_null(text()),
        "program": or_null(object(json!({
            "name": text(),
            "revision": whole(),
            "lines": whole(),
            "planned_time_s": number(),
            "dry_run": flag(),
            "result": or_null(text()),
        }))),
        "mdi": list(text()),
        "waiting": or_null(refer("Waiting")),
        "codes": list(text()),
        "tool": whole(),
        "work_offset_mm": positions(),
        "work_rotation_degrees": number(),
        "elapsed_s": number(),
        "remaining_s": or_null(number()),
        "done_percent": or_null(number()),
        "remaining_note": or_null(text()),
        "estop_chain_open": flag(),
        "held_at_mm": or_null(positions()),
        "limit_switches": object(json!({ "lower": list(whole()), "upper": list(whole()) })),
        "alarm": or_null(text()),
        "forced": list(object(json!({ "program": text(), "variable": text(), "value": text() }))),
        "next": or_null(text()),
        "obstruction": or_null(text()),
        "messages": list(refer("Entry")),
        "parts": parts(),
        "runs_left": whole(),
        "last_program": or_null(last_program()),
        "control": refer("Control"),
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn every_schema_is_used_and_there_and_is_one() {
        let document = document();
        let mut used = BTreeSet::new();
        fn collect(value: &Value, used: &mut BTreeSet<String>) {
            match value {
                Value::Object(members) => members.iter().for_each(|(name, value)| match value {
                    Value::String(place) if name == "$ref" => {
                        used.insert(place.rsplit('/').next().unwrap().to_owned());
                    }
                    value => collect(value, used),
                }),
                Value::Array(values) => values.iter().for_each(|value| collect(value, used)),
                _ => {}
            }
        }
        collect(&document, &mut used);
        let there: BTreeSet<String> = document["components"]["schemas"]
            .as_object()
            .unwrap()
            .keys()
            .cloned()
            .collect();
        assert_eq!(used, there);
        for (name, schema) in document["components"]["schemas"].as_object().unwrap() {
            assert!(jsonschema::meta::is_valid(schema), "{name}");
        }
        for method in METHODS {
            jsonschema::validator_for(&result_schema(method))
                .unwrap_or_else(|error| panic!("{}: {error}", method.name));
        }
    }

    #[test]
    fn parameters_that_must_be_there_come_with_their_types() {
        let document = document();
        let methods = document["methods"].as_array().unwrap();
        let named = |name: &str| methods.iter().find(|method| method["name"] == name).unwrap();
        assert_eq!(
            named("single_block")["params"][0],
            json!({ "name": "on", "required": true, "schema": { "type": "boolean" } })
        );
        let codes = |name: &str| -> Vec<i64> {
            let errors = named(name)["errors"].as_array().unwrap();
            errors.iter().map(|error| error["code"].as_i64().unwrap()).collect()
        };
        assert_eq!(codes("status"), [-32602]);
        assert_eq!(codes("stop"), [-32602, -32000]);
        assert_eq!(codes("mdi"), [-32602, -32000, -32006, -32004]);
        assert_eq!(codes("override"), [-32602, -32000, -32006, -32004]);
    }
}
