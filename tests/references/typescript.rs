//! `crates/panel/web/src/types.ts`: what goes over the control socket, for the panel in the browser.
//!
//! In:  the OpenRPC document. Out: an interface or a type for each schema, and the methods with what they take and answer.

use serde_json::Value;
use std::fmt::Write;

const HEAD: &str =
    "/** What goes over the control socket: made by tests/references of the types in crates/protocol, not edited. */\n";

/// The whole file.
pub(crate) fn of_document(document: &Value) -> String {
    let mut text = HEAD.to_owned();
    for (name, schema) in members(&document["components"]["schemas"]) {
        text += "\n";
        text += &comment(schema, "");
        match schema["properties"].is_object() {
            true => _ = write!(text, "export interface {name} {{\n{}}}\n", fields(schema)),
            false => _ = writeln!(text, "export type {name} = {};", kind(schema)),
        }
    }
    text += "\n/** The methods: what each takes and answers. */\nexport interface Calls {\n";
    for method in document["methods"].as_array().into_iter().flatten() {
        let params = params(method);
        let answer = kind(&method["result"]["schema"]);
        _ = writeln!(text, "  {}: {{ params: {params}; answer: {answer} }};", method["name"]);
    }
    text += "}\n\n/** What comes without being asked for. */\nexport interface Notifications {\n";
    for told in document["x-notifications"].as_array().into_iter().flatten() {
        _ = writeln!(text, "  {}: {};", told["name"], params(told));
    }
    text + "}\n"
}

fn members(object: &Value) -> impl Iterator<Item = (&String, &Value)> {
    object.as_object().into_iter().flatten()
}

fn comment(schema: &Value, indent: &str) -> String {
    let text = schema["description"].as_str();
    text.map_or_else(String::new, |text| {
        format!("{indent}/** {} */\n", text.replace('\n', " "))
    })
}

/// The parameters of a method or of a notification.
fn params(of: &Value) -> String {
    let params: Vec<String> = of["params"].as_array().into_iter().flatten().map(param).collect();
    match params.is_empty() {
        true => "Record<string, never>".to_owned(),
        false => format!("{{ {} }}", params.join("; ")),
    }
}

/// A parameter.
fn param(param: &Value) -> String {
    let mark = if param["required"] == true { "" } else { "?" };
    format!(
        "{}{mark}: {}",
        param["name"].as_str().unwrap_or_default(),
        kind(&param["schema"])
    )
}

/// The fields of an object, one a line.
fn fields(schema: &Value) -> String {
    let required = schema["required"].as_array().map(Vec::as_slice).unwrap_or_default();
    let field = |(name, of): (&String, &Value)| {
        let mark = if required.iter().any(|required| required == name) {
            ""
        } else {
            "?"
        };
        format!("{}  {name}{mark}: {};\n", comment(of, "  "), kind(of))
    };
    members(&schema["properties"]).map(field).collect()
}

/// A schema as a type.
fn kind(schema: &Value) -> String {
    if let Some(place) = schema["$ref"].as_str() {
        return place.rsplit('/').next().unwrap_or_default().to_owned();
    }
    if schema.get("const").is_some() {
        return schema["const"].to_string();
    }
    for several in ["oneOf", "anyOf"] {
        if schema[several].is_array() {
            return kinds(&schema[several]).join(" | ");
        }
    }
    if let Some(words) = schema["enum"].as_array() {
        let words: Vec<String> = words.iter().map(Value::to_string).collect();
        return words.join(" | ");
    }
    match &schema["type"] {
        Value::Array(words) => {
            let one = |word: &Value| {
                let mut schema = schema.clone();
                schema["type"] = word.clone();
                kind(&schema)
            };
            let kinds: Vec<String> = words.iter().map(one).collect();
            kinds.join(" | ")
        }
        Value::String(word) => match word.as_str() {
            "integer" => "number".into(),
            "array" if schema["prefixItems"].is_array() => {
                format!("[{}]", kinds(&schema["prefixItems"]).join(", "))
            }
            "array" => match kind(&schema["items"]) {
                items if items.contains(' ') => format!("({items})[]"),
                items => format!("{items}[]"),
            },
            "object" => match &schema["additionalProperties"] {
                of if of.is_object() => format!("Record<string, {}>", kind(of)),
                Value::Bool(false) => "Record<string, never>".into(),
                _ => "Record<string, unknown>".into(),
            },
            word => word.to_owned(),
        },
        _ => "unknown".into(),
    }
}

/// Schemas of a list as types.
fn kinds(schemas: &Value) -> Vec<String> {
    schemas.as_array().into_iter().flatten().map(kind).collect()
}
