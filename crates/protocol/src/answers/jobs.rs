//! Simple jobs: kinds, their numbers, programs.

use super::*;

/// The kinds of jobs.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct JobKinds(pub Vec<JobKind>);

/// A kind of job.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct JobKind {
    /// Its name.
    pub kind: String,
    /// What it makes, in English.
    pub about: String,
    /// Its numbers, in the order of a form.
    pub fields: Vec<JobField>,
}

/// A number of a job, or a word or a text.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct JobField {
    /// Its name.
    pub name: String,
    /// What it means, in English.
    pub doc: String,
    /// `mm`, `degrees`, `mm/min`, `1/min`, `s`, `%`; empty without one.
    pub unit: String,
    /// It is a whole number.
    pub whole: bool,
    /// What it is if it is not given.
    pub default: JobValue,
    /// Min; null for a word or a text.
    pub min: Option<f64>,
    /// Max; null for a word or a text.
    pub max: Option<f64>,
    /// Max number of characters of a text; null otherwise.
    pub length_max: Option<u64>,
    /// The words that it can be; empty if it is no choice.
    pub choices: Vec<String>,
}

/// A value of a job.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum JobValue {
    /// A number.
    Number(f64),
    /// A word or a text.
    Text(String),
}

/// The program of a job.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Job {
    /// A name for its file.
    pub name: String,
    /// The program, at most 10,000 lines.
    pub text: String,
}
