//! Simple jobs: which there are, and their programs.

use super::{Call, value};
use crate::errands::Errand;
use crate::rpc::{RpcError, code};
use jobs::{KINDS, Values, Wrong};
use protocol::{Job, JobKinds};
use serde_json::{Value, json};

/// All kinds with their numbers.
pub(super) fn kinds() -> JobKinds {
    JobKinds(KINDS.iter().map(jobs::Kind::told).collect())
}

/// Writes the program of a job.
pub(super) fn make(call: &Call<'_>) -> Result<Errand, RpcError> {
    let invalid = |what: &str| Err(RpcError::new(code::INVALID_PARAMS, what));
    let Some(kind) = call.params.0.get("kind").and_then(Value::as_str) else {
        return invalid("parameter \"kind\": expected the name of a kind of job");
    };
    let numbers = match call.params.0.get("numbers") {
        None => Values::new(),
        Some(Value::Object(numbers)) => numbers.clone(),
        Some(_) => return invalid("parameter \"numbers\": expected an object, a member for each number"),
    };
    let kind = jobs::kind(kind).map_err(wrong)?;
    Ok(Box::new(move || {
        let made = kind.make(&numbers).map_err(wrong);
        Some(made.and_then(|text| {
            let name = format!("{}.ngc", kind.name);
            value(&Job { name, text })
        }))
    }))
}

fn wrong(wrong: Wrong) -> RpcError {
    let error = RpcError::new(code::INVALID_PARAMS, wrong.message);
    match wrong.field {
        Some(field) => error.with_data(json!({ "field": field })),
        None => error,
    }
}
