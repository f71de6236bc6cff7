//! Simulated devices of EtherCAT that get any frames of any main device, lose their power and their cables.

use ethercat::sub::{IdealMotor, Segment, SubDevice, esi, models};
use ethercat::wire::register::AlState;
use ethercat::wire::{BROADCAST, Command, FRAME_LEN_MAX, Frame, FrameWriter, Mac};

const MAC: Mac = [0x10; 6];
/// Registers at which something begins: data that are sent there reach more than those that go anywhere.
const REGISTERS: [u16; 16] = [
    0x0010, 0x0100, 0x0120, 0x0300, 0x0400, 0x0500, 0x0502, 0x0600, 0x0800, 0x0810, 0x0900, 0x0910, 0x0980, 0x1000,
    0x1080, 0x1100,
];

/// Octets, one after the other.
struct Input<'a>(&'a [u8]);

impl<'a> Input<'a> {
    fn next(&mut self) -> Option<u8> {
        let (first, rest) = self.0.split_first()?;
        self.0 = rest;
        Some(*first)
    }

    fn take(&mut self, length: usize) -> &'a [u8] {
        let (taken, rest) = self.0.split_at(length.min(self.0.len()));
        self.0 = rest;
        taken
    }

    /// A frame of up to three datagrams; its length.
    fn frame(&mut self, buffer: &mut [u8; FRAME_LEN_MAX]) -> Option<usize> {
        let mut writer = FrameWriter::new(buffer, BROADCAST, MAC).expect("room");
        let datagrams = self.next()? % 3 + 1;
        for index in 0..datagrams {
            let command = Command::from(self.next()? % 15);
            let device = self.next()?;
            let place = self.next()?;
            let register = REGISTERS[usize::from(place % 16)] + u16::from(place / 16);
            // By position and by station: the first devices.
            let to = match device % 4 {
                0 => 0x1000 + u16::from(device / 4 % 4),
                1 => 0_u16.wrapping_sub((device / 4 % 4).into()),
                _ => device.into(),
            };
            let length = usize::from(self.next()?);
            let mut data = [0; 300];
            // Mails count from their last octet on: what is sent may be longer than what is said.
            let length = if length == 0xFF { 128 } else { length };
            let said = usize::from(self.next()?).min(length);
            let said = self.take(said);
            data[..said.len()].copy_from_slice(said);
            let address = u32::from(register) << 16 | u32::from(to);
            writer.push_data(command, index, address, &data[..length]).ok()?;
        }
        Some(writer.finish())
    }
}

/// Registers that lead the drive to PRE-OP, where it takes mails: SyncManagers of its mailboxes, AL control.
const TO_PRE_OP: [(u16, &[u8]); 2] = [
    (
        0x0800,
        &[0x00, 0x10, 128, 0, 0x26, 0, 1, 0, 0x80, 0x10, 128, 0, 0x22, 0, 1, 0],
    ),
    (0x0120, &[2, 0]),
];

/// One run of the fuzzer. The first octet: whether the drive is in PRE-OP from the start.
pub fn run(octets: &[u8]) {
    let mut segment = Segment::new();
    let motors = || {
        vec![
            Box::new(IdealMotor::default()) as _,
            Box::new(IdealMotor::default()) as _,
        ]
    };
    let drive = models::DriveModel::default().build(motors()).expect("a drive");
    segment.push(SubDevice::new(drive, 0), 300);
    segment.push(SubDevice::new(models::digital_terminal(esi::TERMINAL), 0), 300);
    let mut now_ns = 1_000_000_u64;
    let mut input = Input(octets);
    let mut buffer = [0; FRAME_LEN_MAX];
    if input.next().is_some_and(|first| first & 1 != 0) {
        for (register, data) in TO_PRE_OP {
            let mut writer = FrameWriter::new(&mut buffer, BROADCAST, MAC).expect("room");
            let address = u32::from(register) << 16;
            writer.push_data(Command::Apwr, 0, address, data).expect("room");
            let length = writer.finish();
            segment.receive(now_ns, &mut buffer[..length]).expect("both are there");
        }
        now_ns += 1_000_000;
        segment.poll(now_ns);
        assert_eq!(segment.device(0).state(), AlState::PreOp);
    }
    while let Some(kind) = input.next() {
        let length = match kind % 8 {
            0 => {
                now_ns += 50_000 * u64::from(kind);
                segment.poll(now_ns);
                continue;
            }
            1 => {
                let raw = usize::from(input.next().unwrap_or(0));
                let raw = input.take(raw);
                buffer[..raw.len()].copy_from_slice(raw);
                raw.len()
            }
            2 => {
                let device = usize::from(kind >> 3) % segment.len();
                match kind >> 5 {
                    0 => segment.cut(device),
                    1 => segment.heal(device),
                    2 => segment.power_off(device),
                    3 => segment.power_on(device, now_ns),
                    _ => segment.spoil_next(device),
                }
                continue;
            }
            _ => match input.frame(&mut buffer) {
                Some(length) => length,
                None => return,
            },
        };
        let frame = &mut buffer[..length];
        let datagrams = Frame::parse(frame).map_or(0, |frame| frame.datagrams().count());
        if let Some(answer) = segment.receive(now_ns, frame) {
            assert_eq!(answer.length, length);
            assert!(answer.at_ns > now_ns);
            assert_eq!(
                Frame::parse(frame).map_or(0, |frame| frame.datagrams().count()),
                datagrams
            );
        }
        now_ns += 10_000;
        assert!(segment.next_ns(now_ns) > 0);
    }
}
