//! What pins want of the operator's loop: the switch for lines that begin with a slash, the counter of parts.
//!
//! In:  edges that the cycle thread has seen. Out: the same as orders of clients; how things are, for the pins.

use super::clients::Clients;
use crate::console::Operator;
use crate::table_writer::Keeper;
use machine::permission::Wish;
use machine::tables::lock;
use rt::desk::Desk;

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
        let block_delete = lock(self.tables).block_delete;
        desk.show(block_delete, [parts.count, parts.target.unwrap_or(0)]);
    }
}
