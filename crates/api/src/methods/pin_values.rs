//! Pins by name: what they are, and values for those that nothing drives.

use super::{Call, Methods, done, pin_json};
use crate::orders::Order;
use crate::rpc::{RpcError, code};
use hal_pins::AnyValue;
use serde_json::{Value, json};

/// Pins that are told at once.
pub(super) const VALUES_MAX: usize = 64;

fn refused(error: impl ToString) -> RpcError {
    RpcError::new(code::REFUSED, error.to_string())
}

impl Methods {
    /// The pins of a list.
    pub(super) fn pin_values(&self, call: &Call<'_>) -> Result<Value, RpcError> {
        let names = call.params.texts("pins", VALUES_MAX)?;
        let pins = self.scopes.pins()?;
        let one = |name: &String| pins.get(name).map(|pin| pin_json(&pin));
        let values: Result<Vec<Value>, _> = names.iter().map(one).collect();
        Ok(json!({ "pins": values.map_err(refused)?, "more": false }))
    }

    /// Sets an input that no net reaches; the journal tells it.
    pub(super) fn set_pin(&self, call: &Call<'_>) -> Result<Value, RpcError> {
        let given = |name: &str| {
            let text = call.params.text(name)?;
            text.ok_or_else(|| {
                let what = format!("parameter \"{name}\": expected a text, it is missing");
                RpcError::new(code::INVALID_PARAMS, what)
            })
        };
        let (name, text) = (given("pin")?, given("value")?);
        let pins = self.scopes.pins()?;
        let kind = pins.get(name).map_err(refused)?.value_type();
        let value = AnyValue::parse(kind, text)
            .map_err(|error| RpcError::new(code::INVALID_PARAMS, format!("{name}: {error}")))?;
        pins.set(name, value).map_err(refused)?;
        // Nobody waits for its answer.
        let _ = self.operator.put(0, Order::Note(format!("pin {name} set to {text}")));
        done()
    }
}
