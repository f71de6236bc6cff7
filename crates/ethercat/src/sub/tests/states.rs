//! The state machine: steps, refusals, watchdogs, what a drive does in OP.

use super::*;
use crate::wire::register::AlStatusCode;

#[test]
fn steps_go_up_one_by_one_and_down_to_any() {
    let mut bench = Bench::new(vec![drive()]);
    let init = AlState::Init;
    assert_eq!(bench.status(0x1001), (ok(init), 0));
    assert_eq!(bench.ask(0x1001, 8), (refused(init), AlStatusCode::STEP.0));
    // Nothing moves before it is acknowledged, but to INIT.
    bench.manager(0x1001, 0, 0x1000, 128, SyncManager::MAILBOX_OUT);
    bench.manager(0x1001, 1, 0x1080, 128, SyncManager::MAILBOX_IN);
    assert_eq!(bench.ask(0x1001, 2), (refused(init), AlStatusCode::STEP.0));
    assert_eq!(bench.ask(0x1001, 0x11), (ok(init), 0));
    assert_eq!(bench.ask(0x1001, 3), (refused(init), AlStatusCode::NO_BOOT.0));
    assert_eq!(bench.ask(0x1001, 1), (ok(init), 0));
    assert_eq!(bench.ask(0x1001, 7), (refused(init), AlStatusCode::UNKNOWN_STATE.0));
    assert_eq!(
        bench.ask(0x1001, 0x12),
        (ok(AlState::PreOp), 0),
        "acknowledged and asked at once"
    );
    assert_eq!(bench.ask(0x1001, 8), (refused(AlState::PreOp), AlStatusCode::STEP.0));
    assert_eq!(bench.ask(0x1001, 0x12), (ok(AlState::PreOp), 0));
    assert_eq!(bench.ask(0x1001, 3), (refused(AlState::PreOp), AlStatusCode::STEP.0));
    assert_eq!(bench.ask(0x1001, 1), (ok(init), 0));
}

#[test]
fn mailboxes_have_to_be_as_in_the_eeprom() {
    let mut bench = Bench::new(vec![drive()]);
    assert_eq!(bench.ask(0x1001, 2), (refused(AlState::Init), AlStatusCode::MAILBOX.0));
    for (start, length, control) in [
        (0x1000, 64, 0x26),
        (0x1010, 128, 0x26),
        (0x1000, 128, 0x22),
        (0x1000, 128, 0x24),
    ] {
        bench.ask(0x1001, 1);
        bench.manager(0x1001, 0, start, length, control);
        bench.manager(0x1001, 1, 0x1080, 128, SyncManager::MAILBOX_IN);
        assert_eq!(
            bench.ask(0x1001, 2),
            (refused(AlState::Init), AlStatusCode::MAILBOX.0),
            "{start:x} {length} {control:x}"
        );
    }
    bench.ask(0x1001, 1);
    bench.pre_op(0x1001);
}

#[test]
fn process_data_have_to_be_as_they_are_mapped() {
    let mut bench = Bench::new(vec![drive()]);
    bench.pre_op(0x1001);
    let pre_op = AlState::PreOp;
    bench.manager(0x1001, 2, 0x1100, 7, SyncManager::OUTPUTS);
    bench.manager(0x1001, 3, 0x1400, 8, SyncManager::INPUTS);
    assert_eq!(bench.ask(0x1001, 4), (refused(pre_op), AlStatusCode::OUTPUT_SM.0));
    bench.ask(0x1001, 0x12);
    bench.manager(0x1001, 2, 0x1100, 8, SyncManager::OUTPUTS);
    bench.manager(0x1001, 3, 0x1400, 9, SyncManager::INPUTS);
    assert_eq!(bench.ask(0x1001, 4), (refused(pre_op), AlStatusCode::INPUT_SM.0));
    bench.ask(0x1001, 0x12);
    // Three buffers reach into the next SyncManager.
    bench.manager(0x1001, 3, 0x1110, 8, SyncManager::INPUTS);
    assert_eq!(bench.ask(0x1001, 4), (refused(pre_op), AlStatusCode::OUTPUT_SM.0));
    bench.ask(0x1001, 0x12);
    // They reach beyond the memory.
    bench.manager(0x1001, 3, 0x2FF0, 8, SyncManager::INPUTS);
    assert_eq!(bench.ask(0x1001, 4), (refused(pre_op), AlStatusCode::INPUT_SM.0));
    bench.ask(0x1001, 0x12);
    bench.manager(0x1001, 3, 0x1400, 8, SyncManager::INPUTS);
    // SYNC0 without a cycle.
    bench.write(0x1001, register::DC_SYNC_ACTIVATION, &[3]);
    assert_eq!(bench.ask(0x1001, 4), (refused(pre_op), AlStatusCode::DC_SETUP.0));
    bench.ask(0x1001, 0x12);
    bench.write(0x1001, register::DC_SYNC_ACTIVATION, &[0]);
    assert_eq!(bench.ask(0x1001, 4), (ok(AlState::SafeOp), 0));
    // A SyncManager that is changed now ends it.
    bench.manager(0x1001, 2, 0x1100, 4, SyncManager::OUTPUTS);
    bench.wait(1_000_000);
    assert_eq!(bench.status(0x1001), (refused(pre_op), AlStatusCode::SYNC_MANAGER.0));
}

#[test]
fn without_outputs_there_is_no_op_and_after_100_ms_no_longer() {
    let mut bench = Bench::new(vec![drive()]);
    bench.pre_op(0x1001);
    bench.map(0x1001, 0);
    bench.ask(0x1001, 4);
    assert_eq!(bench.ask(0x1001, 8).0, ok(AlState::SafeOp), "it waits");
    bench.wait(100_000_000);
    assert_eq!(
        bench.status(0x1001),
        (refused(AlState::SafeOp), AlStatusCode::WATCHDOG.0)
    );
    bench.ask(0x1001, 0x14);
    bench.write(0x1001, register::AL_CONTROL, &[8, 0]);
    bench.wait(1_000_000);
    bench.send(Command::Lrw, 0, &[0; 8]);
    assert_eq!(bench.status(0x1001), (ok(AlState::Op), 0));
    let fed_ns = bench.now_ns;
    bench.send(Command::Lrw, 0, &[0; 8]);
    bench.wait(fed_ns + 99_900_000 - bench.now_ns);
    assert_eq!(bench.status(0x1001), (ok(AlState::Op), 0));
    assert_eq!(bench.read(0x1001, register::WATCHDOG_STATUS, 4), [1, 0, 0, 0]);
    bench.wait(200_000);
    assert_eq!(
        bench.status(0x1001),
        (refused(AlState::SafeOp), AlStatusCode::WATCHDOG.0)
    );
    assert_eq!(bench.read(0x1001, register::WATCHDOG_STATUS, 4), [0, 0, 1, 0]);
    assert_eq!(bench.send(Command::Lrw, 0, &[0; 8]).1, 1, "outputs are no longer taken");
}

#[test]
fn a_watchdog_of_0_is_off() {
    let mut bench = Bench::new(vec![drive()]);
    bench.write(0x1001, register::WATCHDOG_DATA, &[0, 0]);
    bench.op(0x1001, 0);
    bench.wait(5_000_000_000);
    assert_eq!(bench.status(0x1001), (ok(AlState::Op), 0));
}

#[test]
fn a_terminal_stays_in_op_and_clears_its_outputs() {
    let mut bench = Bench::new(vec![terminal()]);
    bench.manager(0x1001, 0, 0x0F00, 1, 0x44);
    bench.write(0x1001, register::AL_CONTROL, &[8, 0]);
    bench.write(0x1001, 0x0F00, &[0x81]);
    let outputs = |bench: &mut Bench| {
        let terminal = bench.segment.device_mut(0).application_mut().as_terminal().unwrap();
        terminal.outputs.clone()
    };
    assert_eq!(outputs(&mut bench), [0x81]);
    bench.wait(101_000_000);
    assert_eq!(outputs(&mut bench), [0]);
    assert_eq!(bench.status(0x1001), (ok(AlState::Op), 0));
}

#[test]
fn a_drive_is_switched_on_and_moves() {
    let mut bench = Bench::new(vec![drive()]);
    bench.op(0x1001, 0x10000);
    let mut last = vec![0; 8];
    for (control, state) in [(0x06_u8, 0x21), (0x07, 0x23), (0x0F, 0x27)] {
        for _ in 0..300 {
            bench.now_ns += 950_000;
            last = bench.send(Command::Lrw, 0x10000, &[control, 0, 8, 0, 0, 0, 0, 0]).0;
            if last[0] & 0x6F == state {
                break;
            }
        }
        assert_eq!(last[0] & 0x6F, state, "{control:#04x}: {last:02x?}");
    }
    assert_eq!(last[2], 8, "CSP");
    for step in 1..=20_i32 {
        bench.now_ns += 950_000;
        let target = (step * 10).to_le_bytes();
        last = bench
            .send(Command::Lrw, 0x10000, &[&[0x0F, 0, 8, 0], &target[..]].concat())
            .0;
    }
    let position = i32::from_le_bytes([last[4], last[5], last[6], last[7]]);
    assert!((170..=200).contains(&position), "{position}");
    // Without frames it stops by itself: the watchdog, then its reaction to a lost connection.
    bench.wait(300_000_000);
    assert_eq!(
        bench.status(0x1001),
        (refused(AlState::SafeOp), AlStatusCode::WATCHDOG.0)
    );
    let drive = bench.segment.device_mut(0).application_mut().as_drive().unwrap();
    assert_ne!(drive.state(0), Some(cia402::profile::State::OperationEnabled));
}

/// A state that the device refuses, with its code; firmware that hangs.
#[test]
fn faults_refuse_and_hang() {
    let mut bench = Bench::new(vec![drive()]);
    bench.segment.device_mut(0).faults.refused = Some((AlState::PreOp, AlStatusCode::HARDWARE));
    bench.manager(0x1001, 0, 0x1000, 128, SyncManager::MAILBOX_OUT);
    bench.manager(0x1001, 1, 0x1080, 128, SyncManager::MAILBOX_IN);
    assert_eq!(bench.ask(0x1001, 2), (refused(AlState::Init), AlStatusCode::HARDWARE.0));
    bench.segment.device_mut(0).faults.refused = None;
    assert_eq!(bench.ask(0x1001, 0x12), (ok(AlState::PreOp), 0));
    bench.segment.device_mut(0).faults.hung = true;
    assert_eq!(bench.ask(0x1001, 1), (ok(AlState::PreOp), 0));
    assert_eq!(bench.read_u16(0x1001, register::DL_STATUS) & 3, 0);
}

#[test]
fn the_id_is_told_on_request() {
    let mut bench = Bench::new(vec![drive()]);
    let (status, id) = bench.ask(0x1001, 0x21);
    assert!(status.id_loaded && !status.error);
    assert_eq!(id, 7);
}

/// The event of a state that changes reaches the frame where the mask lets it.
#[test]
fn events_come_with_the_frame() {
    let mut bench = Bench::new(vec![drive()]);
    bench.write(0x1001, register::EVENT_MASK, &[0x08, 0]);
    bench.pre_op(0x1001);
    bench.ask(0x1001, 1);
    bench.write(0x1001, register::AL_CONTROL, &[1, 0]);
    bench.wait(1_000_000);
    let irq = |bench: &mut Bench| bench.exchange(Command::Nop, 0, &[0]).unwrap().3;
    assert_eq!(irq(&mut bench), 0x08);
    bench.status(0x1001);
    assert_eq!(irq(&mut bench), 0);
}

#[test]
fn drives_of_several_axes_have_them_800h_apart() {
    let motors: Vec<Box<dyn Motor>> = vec![Box::new(IdealMotor::default()), Box::new(IdealMotor::default())];
    let config = models::DriveModel::default().build(motors).unwrap();
    let objects = &config.objects;
    assert_eq!(objects.read(0x6841, 0).unwrap().len(), 2);
    assert_eq!(objects.read(0x1610, 4).unwrap(), 0x687A_0020_u32.to_le_bytes());
    assert_eq!(objects.process_data(true).unwrap().octets(), 16);
    let mut bench = Bench::new(vec![config]);
    bench.pre_op(0x1001);
    bench.manager(0x1001, 2, 0x1100, 16, SyncManager::OUTPUTS);
    bench.manager(0x1001, 3, 0x1400, 16, SyncManager::INPUTS);
    bench.fmmu(0x1001, 0, Fmmu::octets(0, 16, 0x1100, Fmmu::WRITE));
    bench.fmmu(0x1001, 1, Fmmu::octets(0, 16, 0x1400, Fmmu::READ));
    assert_eq!(bench.ask(0x1001, 4), (ok(AlState::SafeOp), 0));
    bench.write(0x1001, register::AL_CONTROL, &[8, 0]);
    let mut last = Vec::new();
    for _ in 0..400 {
        bench.now_ns += 950_000;
        // The first axis is left off.
        last = bench
            .send(Command::Lrw, 0, &[0, 0, 8, 0, 0, 0, 0, 0, 6, 0, 9, 0, 0, 0, 0, 0])
            .0;
    }
    assert_eq!((last[0] & 0x6F, last[8] & 0x6F), (0x40, 0x21));
    assert_eq!((last[2], last[10]), (8, 9));
}
