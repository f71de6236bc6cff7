//! Any frames at any time: the managing node never panics, never loops, and sends only frames that can be read.
//!
//! Input: a list of (gap in units of 10 µs, length, octets of a frame from octet 14 on).
#![no_main]

use libfuzzer_sys::fuzz_target;
use powerlink::mn::{Assignment, BootTimes, Identity, Mn, MnConfig, NodeConfig, Step};
use powerlink::wire::{Frame, NetTime};

const CYCLE_NS: u64 = 1_000_000;
/// One write: 0x1006 = 1000.
const CONFIGURATION: &[u8] = &[1, 0, 0, 0, 0x06, 0x10, 0, 4, 0, 0, 0, 0xE8, 0x03, 0, 0];

fuzz_target!(|input: &[u8]| {
    let nodes = [1, 2].map(|id| NodeConfig {
        id,
        assignment: Assignment { mandatory: id == 1, ..Assignment::default() },
        pres_timeout_ns: 100_000,
        identity: Identity::default(),
        preq_bytes: 4,
        pres_bytes: 4,
        configuration: CONFIGURATION,
        ..NodeConfig::default()
    });
    let boot = BootTimes { wait_not_active_us: 0, wait_pre_op_1_us: 0, reset_pause_us: 0, ..BootTimes::default() };
    let config = MnConfig {
        cycle_ns: CYCLE_NS as u32,
        async_slot_timeout_ns: 100_000,
        boot,
        pres_lost_max: 3,
        nodes: &nodes,
        mac: [2, 0, 0, 0, 0, 0xF0],
        ..MnConfig::default()
    };
    let mut mn = Mn::<2>::new(config).expect("a valid configuration");
    let (mut now_ns, mut start_ns, mut rest) = (0, 0, input);
    while let [gap, length, tail @ ..] = rest {
        let (body, tail) = tail.split_at(usize::from(*length).min(tail.len()));
        rest = tail;
        let mut frame = [1, 0x11, 0x1E, 0, 0, 4, 2, 0, 0, 0, 0, 1, 0x88, 0xAB].to_vec();
        frame.extend(body);
        now_ns += u64::from(*gap) * 10_000;
        while start_ns <= now_ns {
            mn.start_cycle(start_ns, NetTime::default());
            start_ns += CYCLE_NS;
        }
        mn.receive(now_ns, &frame);
        for step in 0.. {
            assert!(step < 1000, "endless");
            match mn.poll(now_ns) {
                Step::Send(sent) => assert!(Frame::parse(sent).is_ok()),
                Step::WaitUntil(until_ns) if until_ns < start_ns => {
                    mn.receive(now_ns, &frame);
                    now_ns = now_ns.max(until_ns);
                }
                Step::IsochronousDone => {}
                Step::WaitUntil(_) | Step::Idle => break,
            }
        }
        while mn.pop_event().is_some() {}
    }
});
