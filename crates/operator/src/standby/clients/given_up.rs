//! What is given up: programs that are being checked or drawn, and what waits to begin.
//!
//! In:  a stop, a client that has gone, the end of the session. Out: refusals for those who wait.

use super::{Clients, before_it_began};
use crate::console::Operator;
use api::server::Ticket;
use protocol::Message;

impl Clients<'_, '_> {
    /// Nothing of what waits begins; whoever waits is told why.
    pub(super) fn refuse_queue(&mut self, why: &Message) {
        let early = self.early.drain(..).map(|(ticket, ..)| ticket);
        for ticket in self.mdi.drain(..).map(|(ticket, ..)| ticket).chain(early) {
            self.inbox.answer(ticket, Err(why.clone().into()));
        }
        let streamed = self.streamed.take().map(|streamed| streamed.end(Some(why)));
        for (ticket, answer) in streamed.into_iter().flatten() {
            self.inbox.answer(ticket, answer);
        }
    }

    /// An end of all that is under way or about to begin.
    pub(crate) fn stop(&mut self, operator: &mut Operator, now_ns: u64) {
        self.refuse_queue(&before_it_began());
        self.give_up_check();
        operator.stop(now_ns);
    }

    /// Whoever wants a stop while a program is being checked does not want it to begin behind that. False: there is none.
    pub(crate) fn give_up_check(&mut self) -> bool {
        let Some(checking) = &mut self.checking else {
            return false;
        };
        checking.cancel.cancel();
        let Some(ticket) = checking.wanted.take() else {
            return false;
        };
        self.inbox.answer(ticket, Err(before_it_began().into()));
        true
    }

    /// A machine must not begin to move for somebody who has given up waiting for it.
    pub(in crate::standby) fn withdraw(&mut self, ticket: Ticket) {
        self.mdi.retain(|(wanted, ..)| *wanted != ticket);
        if let Some(streamed) = &mut self.streamed {
            streamed.withdraw(ticket);
        }
        self.early.retain(|(wanted, ..)| *wanted != ticket);
        self.unsettled.retain(|(wanted, _)| *wanted != ticket);
        for (_, cancel, _) in self.inspected.iter().filter(|(wanted, ..)| *wanted == ticket) {
            cancel.cancel();
        }
        if let Some(checking) = &mut self.checking
            && checking.wanted == Some(ticket)
        {
            checking.wanted = None;
            checking.cancel.cancel();
        }
    }

    /// Nobody wants pictures and checks any more.
    pub(crate) fn give_up_drawing(&mut self) {
        for (_, cancel, thread) in self.inspected.drain(..) {
            cancel.cancel();
            let _ = thread.join();
        }
        for (cancel, thread) in self.drawn.drain(..) {
            cancel.cancel();
            // Whatever became of it: it only looked.
            let _ = thread.join();
        }
    }
}
