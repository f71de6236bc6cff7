//! Work offsets and the tool table.

use super::*;

/// Nothing, or a warning that the disk has not taken it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Kept {
    /// Why it will be forgotten.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "String")]
    pub warning: Option<String>,
}

/// Origins and rotations of work systems, in machine coordinates.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Offsets {
    /// `mm` or `inch`; rotary axes are in degrees.
    pub unit: String,
    /// G54 to G59.3.
    pub systems: Vec<WorkSystem>,
    /// G92, by letter.
    pub g92: BTreeMap<String, f64>,
    /// G92 is active.
    pub g92_active: bool,
    /// Where G28 goes, by letter, in machine coordinates.
    pub g28: BTreeMap<String, f64>,
    /// Where G30 goes, by letter, in machine coordinates.
    pub g30: BTreeMap<String, f64>,
}

/// A work system.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct WorkSystem {
    /// G54 to G59.3.
    pub system: String,
    /// It is active.
    pub active: bool,
    /// Its origin, by letter.
    pub origin: BTreeMap<String, f64>,
    /// About Z of its origin, counter-clockwise from above, degrees.
    pub rotation_degrees: f64,
}

/// The tool table.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Tools {
    /// `mm` or `inch`.
    pub unit: String,
    /// Tool in the spindle; 0: none.
    pub in_spindle: u32,
    /// Its tools.
    pub tools: Vec<Tool>,
}

/// A tool.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Tool {
    /// Its number.
    pub tool: u32,
    /// Its place in the magazine.
    pub pocket: u32,
    /// Length, in the unit of the machine.
    pub length: f64,
    /// Diameter, in the unit of the machine.
    pub diameter: f64,
    /// What is written next to it in the table.
    pub remark: String,
    /// To be added to the length since it was measured, in the unit of the machine.
    #[serde(default)]
    pub length_wear: f64,
    /// The same of the diameter.
    #[serde(default)]
    pub diameter_wear: f64,
    /// How long it may be used.
    #[serde(default)]
    pub life: ToolLife,
    /// Its life is over.
    #[serde(default)]
    pub worn_out: bool,
}

/// How long a tool may be used, and how long it has been.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct ToolLife {
    /// Minutes that it may be used; null: nobody has said.
    pub minutes: Option<f64>,
    /// Parts that it may be used for; null: nobody has said.
    pub parts: Option<u32>,
    /// Minutes that programs have moved with it in the spindle and the spindle on.
    pub used_minutes: f64,
    /// Parts of programs that have used it.
    pub used_parts: u32,
    /// The tool that is called in its place when its life is over.
    pub sister: Option<u32>,
}

impl ToolLife {
    /// Whether it has been used for as long as it may be.
    pub fn is_over(&self) -> bool {
        self.minutes.is_some_and(|minutes| self.used_minutes >= minutes)
            || self.parts.is_some_and(|parts| self.used_parts >= parts)
    }
}
