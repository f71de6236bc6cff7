//! The cyclic frame with simulated terminals: whose inputs are fresh, under lost, late, doubled, cut and changed frames.

use super::*;
use crate::sub::{Segment, SubDevice, models};
use crate::wire::register::{self, AlState, Fmmu};
use crate::wire::sii::Identity;
use crate::wire::{BROADCAST, Command, FRAME_LEN_MAX, Frame, FrameWriter, WireError};
use std::vec::Vec;

const MAC: [u8; 6] = [0x10; 6];

/// So many terminals in OP, each with an octet both ways at logical addresses 16 apart.
fn terminals(count: u16) -> Segment {
    let mut segment = Segment::new();
    for _ in 0..count {
        segment.push(SubDevice::new(models::digital_terminal(Identity::default()), 0), 300);
    }
    for position in 0..count {
        let mut send = |register: u16, data: &[u8]| {
            let mut buffer = [0; FRAME_LEN_MAX];
            let mut writer = FrameWriter::new(&mut buffer, BROADCAST, MAC).unwrap();
            writer
                .push_data(Command::Apwr, 0, register::position(position, register), data)
                .unwrap();
            let length = writer.finish();
            segment.receive(1000, &mut buffer[..length]).unwrap();
        };
        send(register::sync_manager(0), &[0x00, 0x0F, 1, 0, 0x44, 0, 1, 0]);
        send(register::sync_manager(1), &[0x00, 0x10, 1, 0, 0x00, 0, 1, 0]);
        let logical = 16 * u32::from(position);
        for (number, physical, kind) in [(0, 0x0F00, Fmmu::WRITE), (1, 0x1000, Fmmu::READ)] {
            let mut octets = [0; 16];
            Fmmu::octets(logical, 1, physical, kind).emit(&mut octets).unwrap();
            send(register::fmmu(number), &octets);
        }
        send(register::AL_CONTROL, &[8, 0]);
    }
    segment
}

fn cyclic(count: u16) -> CyclicFrames<8, 2> {
    let members: Vec<Member> = (0..count)
        .map(|position| Member::one(16 * u32::from(position), 1, 1))
        .collect();
    CyclicFrames::new(MAC, members).unwrap()
}

/// Sends what is ready; what comes back.
fn pass(segment: &mut Segment, cyclic: &mut CyclicFrames<8, 2>, now_ns: u64) -> Option<Vec<u8>> {
    cyclic.make_ready(0);
    let mut frame = cyclic.frame(0).to_vec();
    segment.receive(now_ns, &mut frame).map(|_| frame)
}

#[test]
fn outputs_go_inputs_come_and_a_device_that_is_cut_off_is_named() {
    let (mut segment, mut cyclic) = (terminals(3), cyclic(3));
    for cycle in 1..=20_u8 {
        if cycle == 10 {
            segment.cut(1);
        }
        if cycle == 15 {
            segment.heal(1);
        }
        for number in 0..3 {
            cyclic.outputs_mut(number)[0] = cycle + number as u8;
            let terminal = segment.device_mut(number).application_mut().as_terminal().unwrap();
            terminal.inputs = Vec::from([100 + cycle]);
        }
        let answer = pass(&mut segment, &mut cyclic, u64::from(cycle) * 1_000_000).unwrap();
        assert_eq!(cyclic.receive(&answer), Came::Answer);
        let cut = (10..15).contains(&cycle);
        assert_eq!(cyclic.finish(), if cut { 2 } else { 0 }, "cycle {cycle}");
        assert_eq!(cyclic.present(), if cut { 1 } else { 3 });
        assert_eq!(cyclic.states(), (AlState::Op, false));
        for number in 0..3 {
            let answered = cyclic.answered(number);
            let is_lost = cut && number > 0;
            let row = if is_lost { u32::from(cycle) - 9 } else { 0 };
            let counter = if is_lost { 0 } else { 3 };
            assert_eq!(
                (answered.fresh, answered.lost_in_row, answered.working_counter),
                (!is_lost, row, counter)
            );
            let terminal = segment.device_mut(number).application_mut().as_terminal().unwrap();
            if !is_lost {
                assert_eq!(terminal.outputs, [cycle + number as u8]);
            }
            // Inputs are read before the cycle of the application: those of the cycle before; lost ones hold.
            let expected = match cycle {
                1 => 0,
                _ if is_lost => 108,
                15 if number > 0 => 109,
                _ => 99 + cycle,
            };
            assert_eq!(cyclic.inputs(number), [expected], "cycle {cycle}, {number}");
        }
    }
}

#[test]
fn late_doubled_and_foreign_frames_change_nothing() {
    let (mut segment, mut cyclic) = (terminals(2), cyclic(2));
    let first = pass(&mut segment, &mut cyclic, 1_000_000).unwrap();
    assert_eq!(cyclic.finish(), 2);
    let second = pass(&mut segment, &mut cyclic, 2_000_000).unwrap();
    assert_eq!(cyclic.receive(&first), Came::Late);
    assert!(!cyclic.answered(0).fresh);
    assert_eq!(cyclic.receive(&second), Came::Answer);
    assert_eq!(cyclic.receive(&second), Came::Late, "once more");
    assert_eq!(cyclic.finish(), 0);
    cyclic.make_ready(0);
    let own = cyclic.frame(0).to_vec();
    assert_eq!(cyclic.receive(&own), Came::Other, "it has been nowhere");
    let mut other = pass(&mut segment, &mut cyclic, 3_000_000).unwrap();
    other[6] = 0x22;
    assert_eq!(cyclic.receive(&other), Came::Other);
    assert_eq!(cyclic.receive(&[0; 60]), Came::Other);
    assert_eq!(cyclic.finish(), 2);
    assert_eq!(cyclic.answered(1).working_counter, 0);
}

/// Whatever happens to frames: an input that is fresh is whole and of its cycle, who did not answer is counted, and after the
/// trouble all is as before.
#[test]
fn two_hundred_seeds_of_trouble() {
    for seed in 0..200_u64 {
        let mut bits = seed;
        let mut random = |end: u64| {
            bits = bits
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (bits >> 33) % end
        };
        let (mut segment, mut cyclic) = (terminals(4), cyclic(4));
        let mut held: Vec<Vec<u8>> = Vec::new();
        let (mut rows, mut passed) = ([0_u32; 4], [false; 4]);
        for cycle in 0..300_u64 {
            let trouble = if cycle < 250 { random(20) } else { 99 };
            let place = random(4) as usize;
            for number in 0..4 {
                cyclic.outputs_mut(number)[0] = cycle as u8;
                let terminal = segment.device_mut(number).application_mut().as_terminal().unwrap();
                terminal.inputs = Vec::from([(cycle as u8).wrapping_mul(4).wrapping_add(number as u8)]);
            }
            match trouble {
                0 => segment.cut(place),
                1 => segment.spoil_next(place),
                _ => (0..4).for_each(|number| segment.heal(number)),
            }
            let answer = pass(&mut segment, &mut cyclic, (cycle + 1) * 1_000_000);
            let mut counters_whole = true;
            if let Some(mut answer) = answer {
                match trouble {
                    2 => held.push(answer),
                    3 => {
                        assert_eq!(cyclic.receive(&answer), Came::Answer);
                        assert_eq!(cyclic.receive(&answer), Came::Late);
                    }
                    4 => {
                        let cut = random(answer.len() as u64) as usize;
                        // Cut in the padding, it is whole.
                        counters_whole = cyclic.receive(&answer[..cut]) != Came::Other;
                    }
                    5 => {
                        // A counter that is wrong: one member is not fresh.
                        let at = answer.len() - 1;
                        answer[at] ^= 0x40;
                        let _ = cyclic.receive(&answer);
                    }
                    _ => assert_eq!(cyclic.receive(&answer), Came::Answer, "seed {seed}, cycle {cycle}"),
                }
            }
            if trouble == 6
                && let Some(late) = held.pop()
            {
                assert_eq!(cyclic.receive(&late), Came::Late, "seed {seed}, cycle {cycle}");
            }
            let lost = cyclic.finish();
            let fresh = (0..4).filter(|number| cyclic.answered(*number).fresh).count() as u32;
            assert_eq!(lost + fresh, 4);
            assert!(counters_whole || fresh == 0, "seed {seed}, cycle {cycle}");
            for (number, row) in rows.iter_mut().enumerate() {
                let answered = cyclic.answered(number);
                *row = if answered.fresh { 0 } else { *row + 1 };
                assert_eq!(answered.lost_in_row, *row, "seed {seed}, cycle {cycle}, {number}");
                let terminal = segment.device_mut(number).application_mut().as_terminal().unwrap();
                if answered.fresh {
                    assert_eq!(terminal.outputs, [cycle as u8], "seed {seed}, cycle {cycle}, {number}");
                    // A terminal that no frame has passed before shows zeros.
                    let is_own = cyclic.inputs(number)[0] % 4 == number as u8;
                    assert!(
                        is_own || !passed[number],
                        "seed {seed}, cycle {cycle}: of another terminal"
                    );
                    passed[number] = true;
                }
            }
        }
        assert_eq!(rows, [0; 4], "seed {seed}");
    }
}

#[test]
fn what_does_not_fit_into_one_frame_goes_into_the_next() {
    let many = |count| (0..count).map(|number| Member::one(200 * number, 100, 120));
    // The first frame has room for 1498 - 20 - 14 octets.
    for (count, frames) in [(11, 1), (12, 2), (22, 2), (23, 3)] {
        let cyclic = CyclicFrames::<32, 3>::new(MAC, many(count)).unwrap();
        assert_eq!(cyclic.len(), frames, "{count}");
        assert!(cyclic.octets() > usize::try_from(count).unwrap() * 132);
        let parsed = (0..frames).flat_map(|number| {
            let frame = Frame::parse(cyclic.frame(number)).unwrap();
            frame
                .datagrams()
                .filter(|datagram| datagram.command == Command::Lrw)
                .collect::<Vec<_>>()
        });
        let addresses: Vec<u32> = parsed.map(|datagram| datagram.address).collect();
        assert_eq!(addresses, (0..count).map(|number| 200 * number).collect::<Vec<_>>());
    }
    assert!(matches!(
        CyclicFrames::<64, 2>::new(MAC, many(24)),
        Err(WireError::NoRoom { need: 3, got: 2 })
    ));
    assert!(matches!(
        CyclicFrames::<2, 2>::new(MAC, many(3)),
        Err(WireError::NoRoom { need: 3, got: 2 })
    ));
    assert!(matches!(
        CyclicFrames::<2, 2>::new(MAC, [Member::one(0, 1487, 0)]),
        Err(WireError::NoRoom { need: 1487, got: 1486 })
    ));
}

/// A hundred terminals in two frames: one frame that is lost costs its own members their inputs, no others.
#[test]
fn each_frame_stands_for_itself() {
    let mut segment = terminals(100);
    let members = (0..100).map(|number| Member {
        inputs: 16,
        ..Member::one(16 * number, 1, 1)
    });
    let mut cyclic = CyclicFrames::<100, 2>::new(MAC, members).unwrap();
    assert_eq!(cyclic.len(), 2);
    cyclic.make_ready(0);
    let mut frames = [cyclic.frame(0).to_vec(), cyclic.frame(1).to_vec()];
    for frame in &mut frames {
        segment.receive(1_000_000, frame).unwrap();
    }
    assert_eq!(cyclic.receive(&frames[1]), Came::Answer);
    assert!(!cyclic.is_whole());
    let lost = cyclic.finish();
    assert!((1..100).contains(&lost));
    for number in 0..100 {
        assert_eq!(cyclic.answered(number).fresh, number >= lost as usize, "{number}");
    }
    assert_eq!(cyclic.receive(&frames[0]), Came::Late);
}
