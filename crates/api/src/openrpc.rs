//! The control socket for programs: its methods, their parameters, results and errors as an OpenRPC document.
//!
//! In:  the table of methods and the types of [`protocol`]. Out: one JSON value, which `rpc.discover` and `isocnc schema --rpc` give.

use super::methods::table::{API_VERSION, METHODS, Method};
use super::rpc::code;
use protocol::limits::{ID_MAX, REQUEST_ID};
use protocol::schema::{Param, generator};
use protocol::{Role, StateChange};
use schemars::SchemaGenerator;
use serde_json::{Value, json};

/// The document.
pub fn document() -> Value {
    let mut generator = generator();
    let methods: Vec<Value> = METHODS.iter().map(|of| method(of, &mut generator)).collect();
    let schemas = generator.take_definitions(true);
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
            "params": fields(&generator.into_root_schema_for::<StateChange>().to_value()),
        }],
    })
}

/// What a method answers, as a schema that holds all that it refers to: for whoever checks an answer.
pub fn result_schema(method: &Method) -> Value {
    let mut generator = generator();
    let mut schema = (method.answer)(&mut generator).to_value();
    schema["components"] = json!({ "schemas": generator.take_definitions(true) });
    schema
}

fn method(method: &Method, generator: &mut SchemaGenerator) -> Value {
    let mut params: Vec<Value> = method.params.iter().map(param).collect();
    if !method.only_looks() {
        let schema = json!({ "type": "string", "minLength": 1, "maxLength": ID_MAX });
        params.push(json!({ "name": REQUEST_ID, "required": false, "schema": schema }));
    }
    json!({
        "name": method.name,
        "summary": method.does,
        "paramStructure": "by-name",
        "params": params,
        "result": { "name": "result", "schema": (method.answer)(generator) },
        "errors": errors(method),
        "x-role": method.role,
    })
}

fn param(param: &Param) -> Value {
    json!({ "name": param.name, "description": param.description, "required": param.required, "schema": param.schema })
}

/// The fields of a notification, as parameters.
fn fields(schema: &Value) -> Vec<Value> {
    let required = schema["required"].as_array().map(Vec::as_slice).unwrap_or_default();
    let fields = schema["properties"].as_object().into_iter().flatten();
    fields
        .map(|(name, schema)| json!({ "name": name, "required": required.contains(&json!(name)), "schema": schema }))
        .collect()
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
    if method.role != Role::Watch || method.name == "override" {
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
        for method in METHODS.iter() {
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
            json!({ "name": "on", "description": "Whether it is on from now on.", "required": true, "schema": { "type": "boolean" } })
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
