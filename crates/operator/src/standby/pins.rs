//! What pins want of the operator's loop: drives on and off, the program that is loaded, the switch for lines that begin with a slash,
//! buttons of the user, the counter of parts.
//!
//! In:  edges that the cycle thread has seen. Out: the same as orders of clients; how things are, for the pins.

use super::clients::Clients;
use crate::console::Operator;
use crate::table_writer::Keeper;
use api::buttons::pressed;
use api::orders::Order;
use api::server::Ticket;
use machine::permission::Wish;
use machine::tables::lock;
use rt::desk::{Desk, PinOrder};
use serde_json::Map;

/// Ticket of what a pin orders: no client has it, and no client is answered.
pub(super) const PIN_TICKET: Ticket = Ticket::MAX;

impl Clients<'_, '_> {
    /// Once a turn.
    pub(super) fn follow_pins(&mut self, operator: &mut Operator, keeper: &mut Keeper<'_, '_>) {
        let shared = operator.shared();
        let desk: &Desk = &shared.desk;
        // One that comes right behind another order waits until the cycle has taken that.
        if !self.is_settling(operator)
            && let Some(on) = desk.take_block_delete()
        {
            match self.may(Wish::BlockDelete, operator) {
                Ok(()) => {
                    lock(self.tables).block_delete = on;
                    operator.add_entry(format!("pin: block-delete {}", if on { "on" } else { "off" }));
                }
                Err(why) => operator.add_entry(format!("pin: block-delete refused: {why}")),
            }
        }
        let mut parts = keeper.memory.now().parts;
        if desk.take_reset() {
            parts.count = 0;
            keeper.memory.set_parts(parts);
            operator.add_entry(format!("pin: parts {parts}"));
        }
        for order in shared.desk.take_orders() {
            let order = match order {
                PinOrder::Off => Order::Off,
                PinOrder::On => Order::On,
                PinOrder::Start => Order::Start {
                    from_line: None,
                    yes: false,
                    runs: 1,
                    dry_feed_min: None,
                    revision: None,
                },
            };
            self.early.push_back((PIN_TICKET, order, None));
        }
        let panel = self.config.panel.as_ref();
        for button in desk.take_pressed().filter_map(|place| panel?.buttons.get(place)) {
            let programs = panel.and_then(|panel| panel.programs.as_deref());
            operator.add_entry(format!("pin: button {}", button.name));
            match pressed(button, &Map::new(), programs) {
                Ok(order) => self.early.push_back((PIN_TICKET, order, None)),
                Err(why) => operator.add_entry(format!("pin: button {} refused: {}", button.name, why.message)),
            }
        }
        desk.show_mode(self.mode);
        let block_delete = lock(self.tables).block_delete;
        desk.show(block_delete, [parts.count, parts.target.unwrap_or(0)]);
    }
}
