//! What an order of a client is: its row in the table of orders, whether the journal has it, whether it is about motion.

use api::orders::Order;
use machine::permission::Wish;
use program::Change;

/// The row of the table of orders; `None`: it only looks.
pub(super) fn wish(order: &Order) -> Option<Wish> {
    Some(match order {
        Order::Offsets
        | Order::Tools
        | Order::Journal(_)
        | Order::Note(_)
        | Order::Turned
        | Order::TakenOver(_)
        | Order::MdiHistory
        | Order::Report(_)
        | Order::Path(_)
        | Order::Inspect(_)
        | Order::Parts { .. } => return None,
        Order::On => Wish::On,
        Order::Off => Wish::Off,
        Order::Home(_) => Wish::Home,
        Order::Load(_) => Wish::Load,
        Order::Start { .. } => Wish::Start,
        Order::Run(_) => Wish::Run,
        Order::Mdi(_) | Order::Lines { .. } => Wish::Mdi,
        Order::Change(
            Change::Offset { .. } | Change::Rotation { .. } | Change::Tool(_) | Change::DeleteTool { .. },
        ) => Wish::Set,
        Order::Change(_) => Wish::TouchOff,
        Order::Jog(_) => Wish::Jog,
        Order::Spindle(_) | Order::Coolant { .. } => Wish::ByHand,
        Order::Hold => Wish::Hold,
        Order::Resume | Order::ToolChanged => Wish::Resume,
        Order::Skip => Wish::Skip,
        Order::Reverse(_) => Wish::Reverse,
        Order::SingleBlock(_) => Wish::SingleBlock,
        Order::OptionalStop(_) => Wish::OptionalStop,
        Order::BlockDelete(_) => Wish::BlockDelete,
        Order::Stop | Order::Withdraw => Wish::Stop,
        Order::Estop => Wish::Estop,
        Order::EstopReset => Wish::EstopReset,
        Order::Acknowledge => Wish::Acknowledge,
    })
}

/// Whether the journal has it: not what a hand on a key sends many times a second, nor lines of MDI, which it has when they begin.
pub(super) fn is_told(order: &Order) -> bool {
    !matches!(order, Order::Jog(_) | Order::Mdi(_) | Order::Lines { .. })
}

/// Whether it is about motion, which a machine without joints has none of.
pub(super) fn moves(wish: Wish) -> bool {
    matches!(
        wish,
        Wish::On | Wish::Home | Wish::Jog | Wish::Mdi | Wish::TouchOff | Wish::Load | Wish::Start | Wish::Run
    )
}
