//! Schemas of what goes over the socket, made of its types.
//!
//! Schemas of answers refer to `#/components/schemas`, as in an OpenRPC document; those of parameters stand by themselves.

use crate::Method;
use schemars::generate::{Contract, SchemaSettings};
use schemars::transform::{Transform, transform_subschemas};
use schemars::{Schema, SchemaGenerator};
use serde::de::value::Error;
use serde::de::{DeserializeOwned, Deserializer, Visitor};
use serde_json::{Value, json};

/// A parameter of a method.
#[derive(Clone, Debug, PartialEq)]
pub struct Param {
    /// Its name.
    pub name: &'static str,
    /// It must be there.
    pub required: bool,
    /// What it is for.
    pub description: String,
    /// What it may be.
    pub schema: Value,
}

/// The parameters of a method, in the order of their fields.
pub fn params<M: Method>() -> Vec<Param> {
    let mut settings = settings(Plain { has_widths: true });
    settings.inline_subschemas = true;
    settings.contract = Contract::Deserialize;
    let schema = settings.into_generator().into_root_schema_for::<M::Params>().to_value();
    let is_required = |name: &str| {
        let required = schema["required"].as_array().into_iter().flatten();
        required.into_iter().any(|required| required == name)
    };
    let param = |name: &&'static str| {
        let mut schema = schema["properties"][*name].clone();
        let description = schema.as_object_mut().and_then(|schema| schema.remove("description"));
        bound(&mut schema);
        Param {
            name,
            required: is_required(name),
            description: description
                .and_then(|text| text.as_str().map(str::to_owned))
                .unwrap_or_default(),
            schema,
        }
    };
    names::<M::Params>().iter().map(param).collect()
}

/// Makes schemas of answers, each type under its name.
pub fn generator() -> SchemaGenerator {
    settings(Plain { has_widths: false }).into_generator()
}

fn settings(plain: Plain) -> SchemaSettings {
    let mut settings = SchemaSettings::draft2020_12().for_serialize();
    settings.meta_schema = None;
    settings.definitions_path = "/components/schemas".into();
    settings.with_transform(plain)
}

/// An object has no other members than those that are named, and numbers have no format: their bounds say all.
#[derive(Clone, Debug)]
struct Plain {
    /// But for the width of whole numbers, of which a parameter takes its bounds.
    has_widths: bool,
}

impl Transform for Plain {
    fn transform(&mut self, schema: &mut Schema) {
        transform_subschemas(self, schema);
        let Some(members) = schema.as_object_mut() else { return };
        members.remove("title");
        let format = members.get("format").and_then(Value::as_str);
        if !(self.has_widths && format.is_some_and(|format| format.starts_with("uint"))) {
            members.remove("format");
        }
        if members.get("type") == Some(&json!("object")) && !members.contains_key("additionalProperties") {
            members.insert("additionalProperties".into(), json!(false));
        }
    }
}

/// A parameter that is there is no null, and a whole number ends where its type does.
fn bound(schema: &mut Value) {
    if let Some(kinds) = schema["type"].as_array() {
        let kind = kinds.iter().find(|kind| *kind != "null").cloned();
        schema["type"] = kind.unwrap_or_default();
    }
    let most = match schema["format"].as_str() {
        Some("uint8") => Some(u64::from(u8::MAX)),
        Some("uint16") => Some(u64::from(u16::MAX)),
        Some("uint32") => Some(u64::from(u32::MAX)),
        _ => None,
    };
    if let Some(members) = schema.as_object_mut() {
        members.remove("format");
        if let Some(most) = most {
            members.entry("maximum").or_insert_with(|| json!(most));
        }
        if let Some(items) = members.get_mut("items") {
            bound(items);
        }
    }
}

/// Names of the fields of a type, in their order.
fn names<P: DeserializeOwned>() -> &'static [&'static str] {
    struct Fields<'a>(&'a mut &'static [&'static str]);

    impl<'de> Deserializer<'de> for Fields<'_> {
        type Error = Error;

        fn deserialize_any<V: Visitor<'de>>(self, _: V) -> Result<V::Value, Error> {
            Err(serde::de::Error::custom("no value, only names"))
        }

        fn deserialize_struct<V: Visitor<'de>>(
            self,
            _: &'static str,
            fields: &'static [&'static str],
            visitor: V,
        ) -> Result<V::Value, Error> {
            *self.0 = fields;
            self.deserialize_any(visitor)
        }

        serde::forward_to_deserialize_any! {
            bool i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 f32 f64 char str string bytes byte_buf option unit unit_struct
            newtype_struct seq tuple tuple_struct map enum identifier ignored_any
        }
    }

    let mut names: &'static [&'static str] = &[];
    // Never a value: what is wanted has been noted by then.
    let _ = P::deserialize(Fields(&mut names));
    names
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::method;

    #[test]
    fn parameters_come_in_their_order_with_their_bounds() {
        let params = params::<method::SdoWrite>();
        let shown: Vec<_> = params.iter().map(|param| (param.name, param.required)).collect();
        assert_eq!(shown, [("node", true), ("index", true), ("sub", true), ("value", true)]);
        assert_eq!(
            params[0].schema,
            json!({ "type": "integer", "minimum": 1, "maximum": 239 })
        );
        assert_eq!(
            params[1].schema,
            json!({ "type": "integer", "minimum": 0, "maximum": 65535 })
        );
        assert_eq!(
            params[3].schema,
            json!({ "type": "string", "pattern": "^([0-9A-Fa-f]{2})*$", "maxLength": 8192 })
        );
        assert_eq!(params[0].description, "Id of the node.");
        assert_eq!(super::params::<method::Ping>(), []);
    }

    #[test]
    fn parameters_that_may_be_missing_are_never_null() {
        let params = params::<method::Home>();
        assert_eq!(
            params[0].schema,
            json!({ "type": "array", "items": { "type": "integer", "minimum": 0, "maximum": 15 } })
        );
        assert!(!params[0].required);
    }
}
