//! Lines of G-code on their way to the control.
//!
//! In:  lines of the sender, in their order. Out: orders to run them, with the modes that they count on; `ok` or an error for each.

use super::{Busy, Order, Session, Then, WAITING_MAX};
use crate::block::{Block, block};
use crate::number::ErrorNumber;
use crate::octets::Input;

impl Session {
    /// Takes lines as long as nothing has to be waited for.
    pub(super) fn go_on(&mut self) {
        self.send_lines();
        while self.busy.is_none()
            && let Some(input) = self.waiting_inputs.pop_front()
        {
            match input {
                Input::Line(line) => self.line(&line),
                _ => self.say(ErrorNumber::LineLong),
            }
            self.send_lines();
        }
        self.settle();
    }

    /// Hands the control what it has room for.
    fn send_lines(&mut self) {
        if self.sent.is_none() && !self.text.is_empty() {
            let text = std::mem::take(&mut self.text);
            self.sent = Some(self.give(Order::Lines { text, wait: false }));
            if let Some((_, others)) = &mut self.settling {
                *others = true;
            }
        }
        if self.busy == Some(Busy::Room) && self.text.len() <= WAITING_MAX {
            self.busy = None;
            self.say("ok");
        }
    }

    /// Finds out when all lines have been executed.
    fn settle(&mut self) {
        if self.is_under_way && self.settling.is_none() && self.sent.is_none() && self.text.is_empty() {
            let order = Order::Lines {
                text: String::new(),
                wait: true,
            };
            self.settling = Some((self.give(order), false));
        }
    }

    fn line(&mut self, line: &str) {
        match line.strip_prefix('$') {
            Some(rest) => self.dollar(rest),
            None if line.is_empty() || line.chars().all(|c| c == '%') => self.say("ok"),
            None if self.is_locked() && !self.is_check => self.say(ErrorNumber::Locked),
            None => match block(line, &self.modes) {
                Err(error) => self.say(error),
                Ok(block) if self.is_check => {
                    self.modes = block.modes;
                    self.say("ok");
                }
                Ok(block) => self.accept_line(block),
            },
        }
    }

    fn accept_line(&mut self, block: Block) {
        let (waits, probes, ends) = (block.waits, block.probes, block.ends);
        if !waits {
            self.accept(block);
            match self.text.len() <= WAITING_MAX {
                true => self.say("ok"),
                false => self.busy = Some(Busy::Room),
            }
            return;
        }
        let text = self.with_modes(&block);
        self.modes = block.modes;
        // Behind an end, the control is in modes of its own.
        self.modes_unknown |= ends;
        self.is_under_way = true;
        let before = std::mem::take(&mut self.text);
        if let Some((_, others)) = &mut self.settling {
            *others = true;
        }
        let (order, then) = match probes {
            true => {
                if !before.is_empty() {
                    self.give(Order::Lines {
                        text: before,
                        wait: false,
                    });
                }
                (Order::Probe { text }, Then::Probed)
            }
            false => (
                Order::Lines {
                    text: before + &text,
                    wait: true,
                },
                Then::Ok,
            ),
        };
        let number = self.give(order);
        self.busy = Some(Busy::On(number, then));
        // Then all before it has been executed, too.
        if !probes {
            self.settling = Some((number, false));
        }
    }

    pub(super) fn accept(&mut self, block: Block) {
        let text = self.with_modes(&block);
        self.modes = block.modes;
        if !text.is_empty() {
            self.text.push_str(&text);
            self.is_under_way = true;
        }
        self.jog.to = None;
        self.send_lines();
    }

    /// The text of a line, behind the modes that it counts on where the control may be in others.
    fn with_modes(&mut self, block: &Block) -> String {
        match self.modes_unknown && !block.text.is_empty() {
            true => {
                self.modes_unknown = false;
                self.modes.line() + &block.text
            }
            false => block.text.clone(),
        }
    }
}
