//! Pins and records of the oscilloscope.

use super::*;

/// Pins and nets.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Pins {
    /// Some of them.
    pub pins: Vec<Pin>,
    /// There are others after them.
    pub more: bool,
}

/// A pin or net.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Pin {
    /// Its name.
    pub name: String,
    /// Type of its value.
    #[serde(rename = "type")]
    pub kind: PinType,
    /// What it is.
    pub direction: PinDirection,
    /// Its value; null: not a number.
    #[schemars(schema_with = "pin_value")]
    pub value: Value,
    /// The net that reaches it.
    pub net: Option<String>,
    /// The pin that drives a net.
    pub source: Option<String>,
    /// The pin of which it is another name.
    pub alias_of: Option<String>,
    /// Unit of its value.
    pub unit: Option<String>,
}

fn pin_value(_: &mut SchemaGenerator) -> Schema {
    json_schema!({ "type": ["boolean", "number", "null"] })
}

/// Type of the value of a pin.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum PinType {
    /// Off or on.
    Bit,
    /// 32-bit signed integer.
    S32,
    /// 32-bit unsigned integer.
    U32,
    /// 64-bit signed integer.
    S64,
    /// 64-bit unsigned integer.
    U64,
    /// IEEE 754 double.
    Float,
}

/// What a pin is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum PinDirection {
    /// A net writes it.
    In,
    /// A component writes it.
    Out,
    /// A net.
    Net,
}

/// An oscilloscope that samples from now on.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ScopeBegun {
    /// Its number.
    pub scope: u64,
    /// Time between two samples, us.
    pub period_us: f64,
    /// What it samples.
    pub channels: Vec<Channel>,
}

/// A channel of an oscilloscope.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Channel {
    /// Name of the pin or net.
    pub name: String,
    /// Type of its value.
    #[serde(rename = "type")]
    pub kind: PinType,
    /// Unit of its value; empty: none.
    pub unit: String,
}

/// Rows of an oscilloscope: the answer of `scope.next`, and the notification `scope`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ScopePart {
    /// Its number.
    pub scope: u64,
    /// Number of the record that they are of.
    pub record: u64,
    /// How many rows.
    pub rows: usize,
    /// The rows.
    #[schemars(extend("contentEncoding" = "base64"))]
    pub base64: String,
    /// The record ends with them.
    pub record_ends: bool,
    /// How far the oscilloscope is.
    pub state: ScopeState,
    /// Cycles that were lost as no one fetched them in time.
    pub lost: u64,
    /// There are others already.
    pub more: bool,
    /// Why it has ended.
    pub error: Option<String>,
}

/// How far an oscilloscope is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum ScopeState {
    /// For a cycle, or for the trigger.
    #[default]
    Waiting,
    /// A record is under way.
    Recording,
    /// It is gone.
    Done,
}
