//! Answers of methods and what they are made of.
//!
//! Lengths are in mm and angles in degrees unless a field says that they are in the unit of the machine; times are in seconds. Lists
//! with a number for each letter have them in the order X Y Z A B C U V W.

mod jobs;
mod journal;
mod logic;
mod machine;
mod offsets;
mod pins;
mod programs;
mod status;

pub use jobs::*;
pub use journal::*;
pub use logic::*;
pub use machine::*;
pub use offsets::*;
pub use pins::*;
pub use programs::*;
pub use status::*;

use crate::codes::{Activity, LastResult, Mode, Next, Outcome, Power, Reaction, Severity, State, Step, WaitingFor};
use crate::limits::LETTERS;
use crate::message::{Message, Param};
use crate::role::Role;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use std::collections::BTreeMap;

/// Fields of the status, by name: as a notification brings them.
pub type Fields = Map<String, Value>;

/// Carried out.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Nothing {}

/// The methods that there are.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Methods(pub Vec<MethodInfo>);

/// A method.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct MethodInfo {
    /// Its name.
    pub name: String,
    /// Names of its parameters.
    pub params: Vec<String>,
    /// What it does.
    pub does: String,
}

/// An OpenRPC document.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct OpenRpc(#[schemars(with = "Fields")] pub Value);

/// Who a client is to the control.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Identified {
    /// Number of its connection.
    pub client: u64,
    /// What it may do.
    pub role: Role,
    /// Name of the machine.
    pub machine: String,
    /// Version of the control.
    pub version: String,
    /// Version of the methods.
    pub api: String,
}
