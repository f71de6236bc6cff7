//! Pins by name: what they are, and values for those that nothing drives.

use super::{Call, Methods, done, pin, value_json, who};
use crate::orders::Order;
use crate::rpc::{RpcError, code};
use hal_pins::AnyValue;
use protocol::limits::VALUES_MAX;
use protocol::{Nothing, Pin, Pins, message};

fn refused(error: impl ToString) -> RpcError {
    RpcError::new(code::REFUSED, error.to_string())
}

impl Methods {
    /// The pins of a list.
    pub(super) fn pin_values(&self, call: &Call<'_>) -> Result<Pins, RpcError> {
        let names = call.params.texts("pins", VALUES_MAX)?;
        let pins = self.scopes.pins()?;
        let one = |name: &String| pins.get(name).map(|found| pin(&found));
        let values: Result<Vec<Pin>, _> = names.iter().map(one).collect();
        Ok(Pins {
            pins: values.map_err(refused)?,
            more: false,
        })
    }

    /// Sets an input that no net reaches; the journal tells it.
    pub(super) fn set_pin(&self, call: &Call<'_>) -> Result<Nothing, RpcError> {
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
        let before = pins.get(name).map_err(refused)?.value;
        pins.set(name, value).map_err(refused)?;
        let mut what = message!("pin.set", "pin {pin} set to {to}", pin = name, to = text);
        what.params
            .insert("from".to_owned(), value_json(before).to_string().into());
        // Nobody waits for its answer.
        let _ = self.operator.put_by(0, Order::Note(what), Some(who(call.caller).name));
        done()
    }
}
