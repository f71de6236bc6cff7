//! What a main device of any make finds: registers, states, mailboxes, process data, clocks, cables.

mod clocks;
mod commands;
mod mailboxes;
mod states;

use super::*;
use crate::wire::coe::Message;
use crate::wire::mailbox::Mail;
use crate::wire::register::{self, AlState, AlStatus, Fmmu, SyncManager};
use crate::wire::sii::Identity;
use crate::wire::{BROADCAST, Command, FRAME_LEN_MAX, Frame, FrameWriter};
use std::boxed::Box;
use std::vec;
use std::vec::Vec;

/// A segment and somebody who sends frames to it, one after the other.
struct Bench {
    segment: Segment,
    now_ns: u64,
    counter: u8,
}

fn drive() -> SubDeviceConfig {
    let model = models::DriveModel {
        alias: 7,
        ..models::DriveModel::default()
    };
    model.build(vec![Box::new(IdealMotor::default())]).unwrap()
}

fn terminal() -> SubDeviceConfig {
    models::digital_terminal(Identity {
        vendor: 2,
        product: 3,
        revision: 4,
        serial: 5,
    })
}

impl Bench {
    /// Devices in a line, whose station addresses are 0x1001 and so on.
    fn new(devices: Vec<SubDeviceConfig>) -> Bench {
        let mut segment = Segment::new();
        for device in devices {
            segment.push(SubDevice::new(device, 0), 500);
        }
        let mut bench = Bench {
            segment,
            now_ns: 1_000_000,
            counter: 0,
        };
        bench.address();
        bench
    }

    fn address(&mut self) {
        for position in 0..self.segment.len() as u16 {
            let address = register::position(position, register::STATION);
            self.send(Command::Apwr, address, &(0x1001 + position).to_le_bytes());
        }
    }

    /// One frame with one datagram; its data and its working counter, ADP and IRQ. `None`: it does not come back.
    fn exchange(&mut self, command: Command, address: u32, data: &[u8]) -> Option<(Vec<u8>, u16, u16, u16)> {
        let mut buffer = [0xA5; FRAME_LEN_MAX];
        let mut writer = FrameWriter::new(&mut buffer, BROADCAST, [0x10; 6]).unwrap();
        writer.push_data(command, 9, address, data).unwrap();
        let length = writer.finish();
        let answer = self.segment.receive(self.now_ns, &mut buffer[..length])?;
        assert_eq!(answer.length, length);
        assert!(answer.at_ns > self.now_ns);
        self.now_ns = answer.at_ns + 1000;
        let frame = Frame::parse(&buffer[..length]).unwrap();
        assert_eq!(frame.source, [0x12, 0x10, 0x10, 0x10, 0x10, 0x10]);
        let datagram = frame.datagrams().next().unwrap();
        assert_eq!((datagram.command, datagram.index), (command, 9));
        Some((
            datagram.data.to_vec(),
            datagram.working_counter,
            datagram.adp(),
            datagram.irq,
        ))
    }

    fn send(&mut self, command: Command, address: u32, data: &[u8]) -> (Vec<u8>, u16) {
        let (data, counter, ..) = self.exchange(command, address, data).expect("it comes back");
        (data, counter)
    }

    /// Reads registers of the device at a station address.
    fn read(&mut self, station: u16, at: u16, octets: usize) -> Vec<u8> {
        let (data, counter) = self.send(Command::Fprd, register::station(station, at), &vec![0; octets]);
        assert_eq!(counter, 1, "{station:#06x} {at:#06x}");
        data
    }

    fn read_u16(&mut self, station: u16, at: u16) -> u16 {
        let data = self.read(station, at, 2);
        u16::from_le_bytes([data[0], data[1]])
    }

    fn write(&mut self, station: u16, at: u16, data: &[u8]) {
        let (_, counter) = self.send(Command::Fpwr, register::station(station, at), data);
        assert_eq!(counter, 1, "{station:#06x} {at:#06x}");
    }

    /// Time passes without a frame.
    fn wait(&mut self, ns: u64) {
        let until_ns = self.now_ns + ns;
        loop {
            let next_ns = self.segment.next_ns(self.now_ns).max(self.now_ns + 1);
            if next_ns > until_ns {
                break;
            }
            self.now_ns = next_ns;
            self.segment.poll(next_ns);
        }
        self.now_ns = until_ns;
        self.segment.poll(until_ns);
    }

    /// Asks for a state; the status and its code some time later.
    fn ask(&mut self, station: u16, control: u16) -> (AlStatus, u16) {
        self.write(station, register::AL_CONTROL, &control.to_le_bytes());
        self.wait(1_000_000);
        self.status(station)
    }

    fn status(&mut self, station: u16) -> (AlStatus, u16) {
        let data = self.read(station, register::AL_STATUS, 6);
        let word = |at: usize| u16::from_le_bytes([data[at], data[at + 1]]);
        (AlStatus::from(word(0)), word(4))
    }

    fn manager(&mut self, station: u16, number: u8, start: u16, length: u16, control: u8) {
        let manager = SyncManager {
            start,
            length,
            control,
            activate: u8::from(length > 0),
            ..SyncManager::default()
        };
        let mut octets = [0; 8];
        manager.emit(&mut octets).unwrap();
        self.write(station, register::sync_manager(number), &octets);
    }

    fn fmmu(&mut self, station: u16, number: u8, fmmu: Fmmu) {
        let mut octets = [0; 16];
        fmmu.emit(&mut octets).unwrap();
        self.write(station, register::fmmu(number), &octets);
    }

    /// A drive to PRE-OP.
    fn pre_op(&mut self, station: u16) {
        self.manager(station, 0, 0x1000, 128, SyncManager::MAILBOX_OUT);
        self.manager(station, 1, 0x1080, 128, SyncManager::MAILBOX_IN);
        assert_eq!(self.ask(station, 2), (ok(AlState::PreOp), 0));
    }

    /// Process data of a drive of one axis, outputs and inputs at the same logical address.
    fn map(&mut self, station: u16, logical: u32) {
        self.manager(station, 2, 0x1100, 8, SyncManager::OUTPUTS);
        self.manager(station, 3, 0x1400, 8, SyncManager::INPUTS);
        self.fmmu(station, 0, Fmmu::octets(logical, 8, 0x1100, Fmmu::WRITE));
        self.fmmu(station, 1, Fmmu::octets(logical, 8, 0x1400, Fmmu::READ));
    }

    /// A drive to OP, without SYNC0.
    fn op(&mut self, station: u16, logical: u32) {
        self.pre_op(station);
        self.map(station, logical);
        assert_eq!(self.ask(station, 4), (ok(AlState::SafeOp), 0));
        self.write(station, register::AL_CONTROL, &8_u16.to_le_bytes());
        for _ in 0..5 {
            self.wait(500_000);
            self.send(Command::Lrw, logical, &[0; 8]);
        }
        assert_eq!(self.status(station), (ok(AlState::Op), 0));
    }

    /// Sends a mail and fetches the next one; `None`: none comes within 20 ms.
    fn mail(&mut self, station: u16, message: Message<'_>) -> Option<Vec<u8>> {
        self.post(station, message);
        self.fetch(station)
    }

    fn post(&mut self, station: u16, message: Message<'_>) {
        self.counter = crate::wire::mailbox::next_counter(self.counter);
        let mut mail = [0xA5; 128];
        message.emit(self.counter, &mut mail).unwrap();
        self.write(station, 0x1000, &mail);
    }

    /// The mail that waits, without its header.
    fn fetch(&mut self, station: u16) -> Option<Vec<u8>> {
        for _ in 0..200 {
            self.wait(100_000);
            let manager = self.read(station, register::sync_manager(1), 8);
            if SyncManager::parse(&manager).unwrap().status & SyncManager::FULL != 0 {
                let mailbox = self.read(station, 0x1080, 128);
                return Some(Mail::parse(&mailbox).unwrap().data.to_vec());
            }
        }
        None
    }
}

fn ok(state: AlState) -> AlStatus {
    AlStatus {
        state,
        error: false,
        id_loaded: false,
    }
}

fn refused(state: AlState) -> AlStatus {
    AlStatus {
        error: true,
        ..ok(state)
    }
}
