//! Methods about pins and their oscilloscopes.

use super::{Call, Methods, arguments};
use crate::rpc::{RpcError, code};
use crate::scopes::pin_type;
use hal_pins::{AnyValue, Kind, PinInfo};
use protocol::limits::SCOPE_RATE_MAX_HZ;
use protocol::{Pin, PinDirection, Pins, ScopeBegun};
use serde_json::Value;

/// Pins in an answer.
const PINS_PER_PAGE: usize = 500;

impl Methods {
    pub(super) fn begin_scope(&mut self, call: &Call<'_>) -> Result<ScopeBegun, RpcError> {
        let wanted = arguments::wanted(call.params)?;
        let per_row = match call.params.has("cycles_per_row") {
            true => call.params.number("cycles_per_row", 1, u64::from(u32::MAX))?,
            false => 1,
        };
        let rate_hz = match call.params.has("rate_hz") {
            true => Some(call.params.number("rate_hz", 1, SCOPE_RATE_MAX_HZ)?),
            false => None,
        };
        (self.scopes).begin(call.caller.client, &wanted, per_row, rate_hz, (self.now_ns)())
    }

    /// Pins and nets that a pattern fits, a page of them.
    pub(super) fn list_pins(&self, call: &Call<'_>) -> Result<Pins, RpcError> {
        let pattern = arguments::pattern(call.params)?;
        let from = match call.params.has("from") {
            true => call.params.number("from", 0, u64::from(u32::MAX))? as usize,
            false => 0,
        };
        let all = self.scopes.pins()?.list();
        let all = all.map_err(|error| RpcError::new(code::REFUSED, error.to_string()))?;
        let fits = |pin: &&PinInfo| pattern.as_ref().is_none_or(|pattern| pattern.matches(&pin.name));
        let mut fitting = all.iter().filter(fits).skip(from);
        let pins = fitting.by_ref().take(PINS_PER_PAGE).map(pin).collect();
        Ok(Pins {
            pins,
            more: fitting.next().is_some(),
        })
    }
}

/// A pin or net, as of "hal.list" and of `isocnc hal list --json`.
pub fn pin(pin: &PinInfo) -> Pin {
    Pin {
        name: pin.name.clone(),
        kind: pin_type(pin.value_type()),
        direction: match pin.kind {
            Kind::Output => PinDirection::Out,
            Kind::Input => PinDirection::In,
            Kind::Net => PinDirection::Net,
        },
        value: value_json(pin.value),
        net: pin.net.clone(),
        source: pin.source.clone(),
        alias_of: pin.alias_of.clone(),
        unit: Some(pin.unit.clone()).filter(|unit| !unit.is_empty()),
    }
}

/// The value of a pin; null: no number.
pub fn value_json(value: AnyValue) -> Value {
    match value {
        AnyValue::Bit(value) => value.into(),
        AnyValue::S32(value) => value.into(),
        AnyValue::U32(value) => value.into(),
        AnyValue::S64(value) => value.into(),
        AnyValue::U64(value) => value.into(),
        AnyValue::Float(value) => value.into(),
    }
}
