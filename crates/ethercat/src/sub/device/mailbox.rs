//! The mailbox of a simulated device: mails to its firmware and answers from it, one at a time on the wire.
//!
//! In:  mails in the memory of the chip, emergencies. Out: answers, in the order in which they wait.

use super::SubDevice;
use crate::sub::coe::{Abilities, Mails, Server};
use crate::sub::esc::Esc;
use crate::sub::objects::ObjectStore;
use crate::wire::coe::{Emergency, Message};
use crate::wire::mailbox::{self, Mail, MailError, Protocol};
use crate::wire::register::AlState;
use crate::wire::sii::{Area, Mailboxes};
use std::collections::VecDeque;
use std::vec;
use std::vec::Vec;

/// SyncManagers of the mailboxes.
pub(super) const MAILBOX_OUT: u8 = 0;
pub(super) const MAILBOX_IN: u8 = 1;
/// Answers that wait at most.
const MAILS_MAX: usize = 64;

/// Both directions of it, and the mails under way.
#[derive(Debug)]
pub(super) struct Mailbox {
    pub(super) server: Server,
    pub(super) receive: Area,
    pub(super) send: Area,
    /// The EEPROM knows of one.
    pub(super) exists: bool,
    /// When the mail that came is taken.
    pub(super) due_ns: Option<u64>,
    pub(super) queue: VecDeque<Vec<u8>>,
    /// Counter of the last mail that came, and of the last that left.
    counters: (u8, u8),
    /// What is in the mailbox, and what was fetched from it last.
    posted: Vec<u8>,
    last: Vec<u8>,
}

impl Mailbox {
    pub(super) fn new(mailboxes: Mailboxes, abilities: Abilities) -> Mailbox {
        Mailbox {
            server: Server::new(abilities),
            receive: mailboxes.receive,
            send: mailboxes.send,
            exists: mailboxes.protocols != 0 && mailboxes.receive.length > 0,
            due_ns: None,
            queue: VecDeque::new(),
            counters: (0, 0),
            posted: Vec::new(),
            last: Vec::new(),
        }
    }

    /// Forgets all mails.
    pub(super) fn clear(&mut self) {
        self.queue.clear();
        self.due_ns = None;
        self.counters = (0, 0);
        self.posted.clear();
        self.last.clear();
    }

    /// A mail was fetched, if one was there and is not any more.
    pub(super) fn emptied(&mut self, esc: &Esc) {
        if !esc.is_full(MAILBOX_IN) && !self.posted.is_empty() {
            self.last = core::mem::take(&mut self.posted);
        }
    }

    /// Puts the next answer into the mailbox, where that is free.
    fn post(&mut self, esc: &mut Esc) {
        if !esc.is_full(MAILBOX_IN)
            && esc.sync_manager(MAILBOX_IN).is_active()
            && let Some(mut mail) = self.queue.pop_front()
        {
            // One that has made room for a repetition has its number.
            if let Some(octet) = mail.get_mut(5).filter(|octet| **octet & 0x70 == 0) {
                self.counters.1 = mailbox::next_counter(self.counters.1);
                *octet |= self.counters.1 << 4;
            }
            self.put(esc, mail);
        }
    }

    fn put(&mut self, esc: &mut Esc, mail: Vec<u8>) {
        let area = esc.area_mut(self.send.start, self.send.length);
        let octets = area.len().min(mail.len());
        area[..octets].copy_from_slice(&mail[..octets]);
        esc.set_full(MAILBOX_IN, true);
        self.posted = mail;
    }

    /// The mail that was fetched last comes once more, and behind it what is in the mailbox.
    pub(super) fn repeat(&mut self, esc: &mut Esc) {
        if !self.last.is_empty() {
            let waiting = core::mem::take(&mut self.posted);
            if !waiting.is_empty() && waiting != self.last {
                self.queue.push_front(waiting);
            }
            self.put(esc, self.last.clone());
        }
        esc.acknowledge_repeat(MAILBOX_IN);
    }

    /// Takes the mail that came; its answers, or `None` where it was here before.
    fn take(&mut self, esc: &mut Esc, objects: &mut ObjectStore, in_pre_op: bool) -> Option<Mails> {
        let octets = esc.area(self.receive.start, self.receive.length).to_vec();
        esc.set_full(MAILBOX_OUT, false);
        let Ok(mail) = Mail::parse(&octets) else {
            return Some(self.complain(MailError::SIZE));
        };
        if mail.counter != 0 && mail.counter == self.counters.0 {
            return None;
        }
        self.counters.0 = mail.counter;
        if mail.protocol != Protocol::CoE {
            return Some(self.complain(MailError::PROTOCOL));
        }
        let Ok(message) = Message::parse(mail.data) else {
            return Some(self.complain(MailError::SERVICE));
        };
        let room = usize::from(self.send.length);
        Some(self.server.receive(message, objects, in_pre_op, room))
    }

    fn complain(&self, error: MailError) -> Mails {
        let mut mail = vec![0; usize::from(self.send.length)];
        match error.emit(0, &mut mail) {
            Ok(()) => vec![mail],
            Err(_) => Vec::new(),
        }
    }
}

impl SubDevice {
    /// Sends an emergency, unasked.
    pub fn report(&mut self, emergency: Emergency) {
        let mailbox = &mut self.mailbox;
        if mailbox.exists && self.state != AlState::Init && mailbox.queue.len() < MAILS_MAX {
            let mut mail = vec![0; usize::from(mailbox.send.length)];
            if Message::Emergency(emergency).emit(0, &mut mail).is_ok() {
                mailbox.queue.push_back(mail);
            }
        }
    }

    pub(super) fn mails(&mut self, now_ns: u64) {
        if self.mailbox.due_ns.is_some_and(|due_ns| due_ns <= now_ns) && self.mailbox.queue.is_empty() {
            self.mailbox.due_ns = None;
            self.take_mail();
        }
        if !self.faults.withholds {
            self.mailbox.post(&mut self.esc);
        }
    }

    fn take_mail(&mut self) {
        let in_pre_op = self.state == AlState::PreOp;
        let Some(answers) = self.mailbox.take(&mut self.esc, &mut self.objects, in_pre_op) else {
            return;
        };
        if self.faults.mute {
            return;
        }
        if let Some(emergency) = self.faults.emergency.take() {
            self.report(emergency);
        }
        self.mailbox.queue.extend(answers);
    }
}
