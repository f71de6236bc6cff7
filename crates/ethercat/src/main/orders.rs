//! SDOs that the application orders while devices run.

use super::event::SetupError;
use crate::wire::coe::Object;

/// Orders that may be under way at once.
pub const ORDERS: usize = 4;
/// Octets of the longest value.
pub const VALUE_MAX: usize = 4096;

/// Where an order is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    Free,
    Waiting,
    UnderWay,
    Done(Result<usize, SetupError>),
}

/// One order.
#[derive(Clone, Copy, Debug)]
struct Order {
    state: State,
    device: usize,
    object: Object,
    /// Octets to be written; `None`: read.
    write: Option<usize>,
    value: [u8; VALUE_MAX],
}

/// All of them.
#[derive(Clone, Debug)]
pub(super) struct Orders {
    orders: [Order; ORDERS],
}

impl Orders {
    pub(super) const NONE: Orders = Orders {
        orders: [Order {
            state: State::Free,
            device: 0,
            object: Object {
                index: 0,
                sub: 0,
                complete: false,
            },
            write: None,
            value: [0; VALUE_MAX],
        }; ORDERS],
    };

    /// Takes an order; its number, or `None` while all are in use or where the value is too long.
    pub(super) fn put(&mut self, device: usize, object: Object, write: Option<&[u8]>) -> Option<usize> {
        let number = self.orders.iter().position(|order| order.state == State::Free)?;
        let order = &mut self.orders[number];
        if let Some(value) = write {
            order.value.get_mut(..value.len())?.copy_from_slice(value);
        }
        order.state = State::Waiting;
        order.device = device;
        order.object = object;
        order.write = write.map(<[u8]>::len);
        Some(number)
    }

    /// The next one for a device, which is under way then.
    pub(super) fn take(&mut self, device: usize) -> Option<(usize, Object, Option<usize>)> {
        let waits = |order: &Order| order.state == State::Waiting && order.device == device;
        let number = self.orders.iter().position(waits)?;
        let order = &mut self.orders[number];
        order.state = State::UnderWay;
        Some((number, order.object, order.write))
    }

    pub(super) fn value(&self, order: usize) -> &[u8] {
        &self.orders[order].value
    }

    pub(super) fn value_mut(&mut self, order: usize) -> &mut [u8] {
        &mut self.orders[order].value
    }

    pub(super) fn finish(&mut self, order: usize, result: Result<usize, SetupError>) {
        self.orders[order].state = State::Done(result);
    }

    /// A device goes: what it was asked for will not be answered.
    pub(super) fn drop_device(&mut self, device: usize, error: SetupError) {
        for order in self.orders.iter_mut().filter(|order| order.device == device) {
            if matches!(order.state, State::Waiting | State::UnderWay) {
                order.state = State::Done(Err(error));
            }
        }
    }

    /// The result of an order that is done; `Ok`: the value that was read, or nothing. Its number is free then.
    pub(super) fn result(&mut self, number: usize) -> Option<Result<&[u8], SetupError>> {
        let order = self.orders.get_mut(number)?;
        let State::Done(result) = order.state else { return None };
        order.state = State::Free;
        let is_read = order.write.is_none();
        Some(result.map(|octets| &order.value[..if is_read { octets.min(VALUE_MAX) } else { 0 }]))
    }
}
