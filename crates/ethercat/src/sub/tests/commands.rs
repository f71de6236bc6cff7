//! Commands, addresses, working counters; logical data; EEPROM; cables.

use super::*;
use crate::wire::register::{DlStatus, eeprom};
use proptest::prelude::*;

/// ADP counts the devices, data are ORed, the counter counts them, too.
#[test]
fn a_broadcast_passes_all() {
    let mut bench = Bench::new(vec![drive(), terminal(), drive()]);
    let at = register::station(0, register::STATION);
    let (data, counter, adp, _) = bench.exchange(Command::Brd, at, &[0, 0x80]).unwrap();
    assert_eq!(
        (data, counter, adp),
        (vec![0x03, 0x90], 3, 3),
        "0x1001 | 0x1002 | 0x1003 | 0x8000"
    );
    assert_eq!(bench.send(Command::Bwr, at, &[5, 0]).1, 3);
    for number in 0..3 {
        let address = register::position(number, register::STATION);
        assert_eq!(bench.send(Command::Aprd, address, &[0; 2]), (vec![5, 0], 1));
    }
    // What is written is what the frame held before; each device sees what the ones before have ORed in.
    let (data, counter) = bench.send(Command::Brw, at, &[2, 0]);
    assert_eq!((data, counter), (vec![7, 0], 9));
    assert_eq!(
        bench
            .send(Command::Aprd, register::position(2, register::STATION), &[0; 2])
            .0,
        [7, 0]
    );
}

#[test]
fn positions_and_stations_reach_one_device() {
    let mut bench = Bench::new(vec![drive(), drive()]);
    let alias = register::ALIAS;
    let second = register::position(1, register::STATION);
    let (data, counter, adp, _) = bench.exchange(Command::Aprd, second, &[0; 2]).unwrap();
    assert_eq!((data, counter, adp), (vec![0x02, 0x10], 1, 1));
    assert_eq!(
        bench.send(Command::Aprd, register::position(2, alias), &[0; 2]).1,
        0,
        "there are two"
    );
    assert_eq!(
        bench.send(Command::Fprd, register::station(0x1002, alias), &[0; 2]),
        (vec![7, 0], 1)
    );
    assert_eq!(
        bench.send(Command::Fprd, register::station(0x1003, alias), &[0; 2]),
        (vec![0, 0], 0)
    );
    // Read and write at once: swapped.
    let mask = register::station(0x1001, register::PDI_EVENT_MASK);
    assert_eq!(bench.send(Command::Fprw, mask, &[1, 2, 3, 4]), (vec![0; 4], 3));
    assert_eq!(bench.send(Command::Fprw, mask, &[0; 4]), (vec![1, 2, 3, 4], 3));
    let by_position = register::position(0, register::PDI_EVENT_MASK);
    assert_eq!(bench.send(Command::Aprw, by_position, &[9; 4]), (vec![0; 4], 3));
    // The alias counts where bit 24 of 0100h says so.
    let by_alias = register::station(7, register::STATION);
    assert_eq!(bench.send(Command::Fprd, by_alias, &[0; 2]).1, 0);
    bench.write(0x1002, register::DL_CONTROL + 3, &[1]);
    assert_eq!(bench.send(Command::Fprd, by_alias, &[0; 2]), (vec![0x02, 0x10], 1));
    for nobody in [Command::Nop, Command::Unknown(99)] {
        assert_eq!(bench.send(nobody, by_alias, &[5; 2]), (vec![5; 2], 0));
    }
}

#[test]
fn what_is_not_there_is_refused_and_what_cannot_be_written_stays() {
    let mut bench = Bench::new(vec![drive(), terminal()]);
    let at = |register: u16| register::station(0x1001, register);
    assert_eq!(
        bench.send(Command::Fpwr, at(0x0680), &[1; 16]).1,
        0,
        "there are eight FMMUs"
    );
    assert_eq!(
        bench.send(Command::Fprd, at(0x3000), &[1; 2]),
        (vec![1; 2], 0),
        "behind the memory"
    );
    assert_eq!(bench.send(Command::Fprd, at(0xFFFF), &[1; 2]).1, 0);
    assert_eq!(bench.send(Command::Fpwr, at(register::AL_STATUS), &[8; 2]).1, 1);
    assert_eq!(bench.status(0x1001).0, ok(AlState::Init));
    // Spans: 256 octets at 0600h, 32 at 0910h, 14 at 0502h.
    assert_eq!(bench.send(Command::Bwr, register::station(0, 0x0600), &[0; 256]).1, 2);
    assert_eq!(bench.send(Command::Fpwr, at(0x0910), &[0; 32]).1, 1);
    assert_eq!(bench.read(0x1001, 0x0502, 14).len(), 14);
    // The terminal has no clock.
    assert_eq!(
        bench.send(Command::Fprd, register::station(0x1002, 0x0910), &[0; 8]).1,
        0
    );
    assert_eq!(bench.send(Command::Brd, register::station(0, 0x0910), &[0; 8]).1, 1);
    // Registers that are not known here read 0.
    assert_eq!(bench.send(Command::Fprw, at(0x0E00), &[7; 4]), (vec![0; 4], 3));
    assert_eq!(bench.send(Command::Fprw, at(0x0E00), &[7; 4]), (vec![0; 4], 3));
}

/// 3: good; 2: it is written only; 1: it is read only, as in SAFE-OP; 0: gone.
#[test]
fn the_counter_of_lrw_tells_what_a_drive_does() {
    let mut bench = Bench::new(vec![drive()]);
    let counter = |bench: &mut Bench| bench.send(Command::Lrw, 0x10000, &[0; 8]).1;
    assert_eq!(counter(&mut bench), 0);
    bench.pre_op(0x1001);
    bench.map(0x1001, 0x10000);
    assert_eq!(bench.ask(0x1001, 4), (ok(AlState::SafeOp), 0));
    assert_eq!(counter(&mut bench), 1);
    assert_eq!(bench.send(Command::Lrd, 0x10000, &[0; 8]).1, 1);
    assert_eq!(bench.send(Command::Lwr, 0x10000, &[0; 8]).1, 0);
    bench.write(0x1001, register::AL_CONTROL, &[8, 0]);
    bench.wait(1_000_000);
    assert_eq!(counter(&mut bench), 3);
    assert_eq!(bench.send(Command::Lwr, 0x10000, &[0; 8]).1, 1);
    assert_eq!(bench.status(0x1001), (ok(AlState::Op), 0));
    bench.fmmu(0x1001, 1, Fmmu::default());
    assert_eq!(counter(&mut bench), 2);
    bench.segment.power_off(0);
    assert_eq!(bench.exchange(Command::Lrw, 0x10000, &[0; 8]), None);
}

/// Outputs at bits 4 to 11 of the image, inputs at bits 13 to 20.
#[test]
fn fmmus_map_bit_by_bit() {
    let mut bench = Bench::new(vec![terminal()]);
    bench.manager(0x1001, 0, 0x0F00, 1, 0x44);
    bench.manager(0x1001, 1, 0x1000, 1, 0x00);
    let out = Fmmu {
        logical: 0x100,
        length: 2,
        first_bit: 4,
        last_bit: 3,
        physical: 0x0F00,
        physical_bit: 0,
        kind: Fmmu::WRITE,
        active: true,
    };
    bench.fmmu(0x1001, 0, out);
    let back = Fmmu {
        logical: 0x101,
        first_bit: 5,
        last_bit: 4,
        physical: 0x1000,
        kind: Fmmu::READ,
        ..out
    };
    bench.fmmu(0x1001, 1, back);
    bench.write(0x1001, register::AL_CONTROL, &[8, 0]);
    assert_eq!(bench.status(0x1001), (ok(AlState::Op), 0), "it mirrors");
    let terminal = bench.segment.device_mut(0).application_mut().as_terminal().unwrap();
    terminal.inputs = vec![0xC3];
    bench.send(Command::Lrw, 0x100, &[0x50, 0x0A, 0]);
    let (data, counter) = bench.send(Command::Lrw, 0x100, &[0x5F, 0x1A, 0xE0]);
    assert_eq!(
        (data, counter),
        (vec![0x5F, 0x7A, 0xF8], 3),
        "C3h at bit 13, other bits as they were"
    );
    let terminal = bench.segment.device_mut(0).application_mut().as_terminal().unwrap();
    assert_eq!(terminal.outputs, [0xA5]);
    // A datagram that covers a part of the image moves that part only.
    let (data, _) = bench.send(Command::Lrw, 0x102, &[0]);
    assert_eq!(data, [0x18]);
    let (_, counter) = bench.send(Command::Lwr, 0x100, &[0x30]);
    assert_eq!(counter, 1);
    let terminal = bench.segment.device_mut(0).application_mut().as_terminal().unwrap();
    assert_eq!(terminal.outputs, [0xA3], "lower half only");
    assert_eq!(bench.send(Command::Lrw, 0x103, &[0; 4]).1, 0);
}

fn eeprom_read(bench: &mut Bench, station: u16, address: u32) -> (u16, Vec<u8>) {
    let mut request = eeprom::READ.to_le_bytes().to_vec();
    request.extend(address.to_le_bytes());
    bench.write(station, register::EEPROM_CONTROL, &request);
    let busy = bench.read_u16(station, register::EEPROM_CONTROL);
    assert_ne!(busy & eeprom::BUSY, 0);
    bench.wait(100_000);
    let status = bench.read_u16(station, register::EEPROM_CONTROL);
    assert_eq!(status & eeprom::BUSY, 0);
    (status, bench.read(station, register::EEPROM_DATA, 8))
}

#[test]
fn the_eeprom_is_read_by_four_or_by_eight_and_written_by_words() {
    let mut bench = Bench::new(vec![drive(), terminal()]);
    let (status, data) = eeprom_read(&mut bench, 0x1001, 8);
    assert_eq!(status, eeprom::EIGHT_OCTETS);
    assert_eq!(data, [0x1B, 0x0A, 0, 0, 1, 0, 2, 4], "vendor and product of the drive");
    let (status, data) = eeprom_read(&mut bench, 0x1002, 8);
    assert_eq!((status, &data[..4]), (0, &[2, 0, 0, 0][..]));
    // A write has to be enabled.
    let command =
        |control: u16, address: u8| [control.to_le_bytes().as_slice(), &[address, 0, 0, 0, 0xAB, 0xCD]].concat();
    bench.write(0x1001, register::EEPROM_CONTROL, &command(eeprom::WRITE, 4));
    assert_ne!(
        bench.read_u16(0x1001, register::EEPROM_CONTROL) & eeprom::NOT_ENABLED,
        0
    );
    bench.write(0x1001, register::EEPROM_CONTROL, &[0, 0]);
    assert_eq!(bench.read_u16(0x1001, register::EEPROM_CONTROL) & eeprom::ERRORS, 0);
    bench.write(0x1001, register::EEPROM_DATA, &[0xAB, 0xCD]);
    bench.write(
        0x1001,
        register::EEPROM_CONTROL,
        &command(eeprom::WRITE | eeprom::WRITE_ENABLE, 4)[..6],
    );
    bench.wait(100_000);
    assert_eq!(eeprom_read(&mut bench, 0x1001, 4).1[..2], [0xAB, 0xCD]);
    // The alias is loaded at power-on or on request; the check sum is wrong now.
    assert_eq!(bench.read_u16(0x1001, register::ALIAS), 7);
    bench.write(0x1001, register::EEPROM_CONTROL, &command(eeprom::RELOAD, 0)[..6]);
    bench.wait(100_000);
    assert_eq!(bench.read_u16(0x1001, register::ALIAS), 0xCDAB);
    assert_ne!(
        bench.read_u16(0x1001, register::EEPROM_CONTROL) & eeprom::BAD_CHECKSUM,
        0
    );
    // While the device has it, commands do nothing.
    bench.write(0x1002, register::EEPROM_OWNER, &[1]);
    bench.write(0x1002, register::EEPROM_CONTROL, &command(eeprom::READ, 8)[..6]);
    assert_eq!(bench.read_u16(0x1002, register::EEPROM_CONTROL) & eeprom::BUSY, 0);
    bench.write(0x1002, register::EEPROM_OWNER, &[2]);
    bench.write(0x1002, register::EEPROM_OWNER, &[0]);
    assert_eq!(eeprom_read(&mut bench, 0x1002, 10).1[..4], [3, 0, 0, 0]);
}

#[test]
fn a_cut_cable_is_found_by_the_ports_and_counters_of_the_device_before_it() {
    let mut bench = Bench::new(vec![drive(), drive(), drive()]);
    let dl = |bench: &mut Bench, station: u16| DlStatus(bench.read_u16(station, register::DL_STATUS));
    assert_eq!(dl(&mut bench, 0x1002).0 & 0xFFF0, 0x5A30);
    assert_eq!(dl(&mut bench, 0x1003).0 & 0xFFF0, 0x5610);
    bench.segment.cut(2);
    let (_, counter, adp, _) = bench.exchange(Command::Brd, 0, &[0]).unwrap();
    assert_eq!((counter, adp), (2, 2));
    assert_eq!(dl(&mut bench, 0x1002).0 & 0xFFF0, 0x5610);
    assert_eq!(bench.read(0x1002, register::LOST_LINKS, 4), [0, 1, 0, 0]);
    assert_eq!(bench.read(0x1001, register::LOST_LINKS, 4), [0; 4]);
    bench.segment.heal(2);
    assert_eq!(bench.exchange(Command::Brd, 0, &[0]).unwrap().1, 3);
    assert_eq!(
        bench.read_u16(0x1003, register::STATION),
        0x1003,
        "it has kept what it was told"
    );
    // Counters are cleared by a write, and stop at FFh.
    bench.write(0x1002, register::LOST_LINKS, &[1]);
    assert_eq!(bench.read(0x1002, register::LOST_LINKS, 4), [0; 4]);
    for _ in 0..300 {
        bench.segment.cut(2);
        bench.segment.heal(2);
    }
    assert_eq!(bench.read(0x1002, register::LOST_LINKS, 4), [0, 255, 0, 0]);
    // A power cycle in the middle: the one behind is cut off, the one itself forgets.
    bench.segment.power_off(1);
    assert_eq!(bench.exchange(Command::Brd, 0, &[0]).unwrap().1, 1);
    bench.segment.power_on(1, bench.now_ns);
    assert_eq!(bench.exchange(Command::Brd, 0, &[0]).unwrap().1, 3);
    assert_eq!(bench.send(Command::Fprd, register::station(0x1002, 0), &[0]).1, 0);
    assert_eq!(bench.read_u16(0x1003, register::STATION), 0x1003);
}

#[test]
fn a_spoilt_frame_is_counted_where_it_was_spoilt_and_passed_on_as_such() {
    let mut bench = Bench::new(vec![drive(), drive(), drive()]);
    bench.segment.spoil_next(1);
    assert_eq!(bench.exchange(Command::Brd, 0, &[0]), None);
    assert_eq!(bench.read(0x1001, register::RX_ERRORS, 14), [0; 14]);
    assert_eq!(
        bench.read(0x1002, register::RX_ERRORS, 9)[..],
        [1, 0, 0, 0, 0, 0, 0, 0, 0]
    );
    assert_eq!(
        bench.read(0x1003, register::RX_ERRORS, 9)[..],
        [0, 0, 0, 0, 0, 0, 0, 0, 1]
    );
}

/// A frame that comes to a device whose port 0 is closed is marked; marked, it is destroyed.
#[test]
fn frames_do_not_go_round_for_ever() {
    let mut bench = Bench::new(vec![drive()]);
    bench.write(0x1001, register::DL_CONTROL + 1, &[0x03]);
    let mut buffer = [0; FRAME_LEN_MAX];
    let mut writer = FrameWriter::new(&mut buffer, BROADCAST, [0x10; 6]).unwrap();
    writer.push(Command::Brd, 0, 0, 1).unwrap();
    let length = writer.finish();
    assert!(bench.segment.receive(bench.now_ns, &mut buffer[..length]).is_some());
    assert!(
        Frame::parse(&buffer[..length])
            .unwrap()
            .datagrams()
            .next()
            .unwrap()
            .circulating
    );
    assert_eq!(bench.segment.receive(bench.now_ns, &mut buffer[..length]), None);
}

#[test]
fn what_is_not_ethercat_passes_unless_a_device_shall_destroy_it() {
    let mut bench = Bench::new(vec![drive()]);
    let ip = [8_u8; 64];
    let mut frame = ip;
    assert!(bench.segment.receive(bench.now_ns, &mut frame).is_some());
    assert_eq!(frame, ip);
    bench.write(0x1001, register::DL_CONTROL, &[1]);
    assert_eq!(bench.segment.receive(bench.now_ns, &mut frame), None);
}

/// Every command, at the registers and what lies around them, in every state: no panic, and a drive that nobody switches on stays where
/// it is.
#[test]
fn every_command_everywhere_in_every_state_moves_no_drive() {
    let registers = (0..0x30).map(|page| page << 8).chain([
        register::STATION,
        register::ALIAS,
        register::AL_CONTROL,
        register::AL_STATUS,
        register::EEPROM_CONTROL,
        register::FMMU + 0x70,
        register::SYNC_MANAGER + 0x38,
        register::DC_SYSTEM_TIME,
        register::DC_SYNC0_START,
        0x1080,
        0x107F,
        0x1100,
        0x1400,
        0x2FFF,
        0x3000,
        0xFFFF,
    ]);
    let registers: Vec<u16> = registers.collect();
    for state in [AlState::Init, AlState::PreOp, AlState::SafeOp, AlState::Op] {
        for command in 0..16 {
            // A segment for each, as a write to 0100h may close a port for good.
            let mut bench = Bench::new(vec![drive(), terminal()]);
            match state {
                AlState::Init => {}
                AlState::PreOp => bench.pre_op(0x1001),
                AlState::SafeOp => {
                    bench.pre_op(0x1001);
                    bench.map(0x1001, 0x10000);
                    bench.ask(0x1001, 4);
                }
                _ => bench.op(0x1001, 0x10000),
            }
            assert_eq!(bench.segment.device(0).state(), state);
            for octets in [1, 2, 8, 128] {
                for at in &registers {
                    for low in [0x1001, 0, 0xFFFF] {
                        let address = u32::from(*at) << 16 | low;
                        // Neither of these words switches a drive on.
                        for octet in [0, 0xFF] {
                            bench.exchange(Command::from(command), address, &vec![octet; octets]);
                        }
                    }
                    bench.wait(1_000_000);
                }
            }
            let position = bench.segment.device(0).objects().read(0x6064, 0).expect("a drive");
            assert_eq!(position, [0; 4], "{state} {command}");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    /// Any datagrams at any time: no panic, and the segment answers a broadcast behind them.
    #[test]
    fn any_datagrams_do_no_harm(
        all in prop::collection::vec(
            (0_u8..16, any::<u32>(), prop::collection::vec(any::<u8>(), 0..300), 0_u64..3_000_000),
            1..60,
        ),
        near in any::<bool>(),
    ) {
        let mut bench = Bench::new(vec![drive(), terminal()]);
        bench.op(0x1001, 0x10000);
        for (command, address, data, wait_ns) in &all {
            // Half of the runs write where something is: registers, mailboxes, process data of the drive.
            let address = if near { 0x1001 | (address & 0x1FFF) << 16 } else { *address };
            bench.exchange(Command::from(*command), address, data);
            bench.wait(*wait_ns);
        }
        let (_, counter) = bench.exchange(Command::Brd, 0, &[0]).map_or((vec![], 0), |(data, counter, ..)| (data, counter));
        // A closed port may have cut it off.
        prop_assert!(counter <= 2);
    }
}
