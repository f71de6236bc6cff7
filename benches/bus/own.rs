//! Computing alone, without a wire: frames are handed over in memory.

use super::minimal::{self, Minimal, Short};
use super::network::{PAYLOAD, Responder, mn_config, node_configs};
use super::{Figures, median};
use powerlink::mn::{Mn, NodeState, Step};
use powerlink::nmt::NmtState;
use powerlink::wire::{FRAME_LEN_MAX, Frame, Header, NetTime, Preq, Pres, Requests, message, multicast, node};
use std::hint::black_box;
use std::time::Instant;

const MAC: [u8; 6] = [2, 0, 0, 0, 0, 0xF0];
const BATCHES: usize = 201;

/// Median of the time of one call over batches of `calls`, ns.
fn median_ns(calls: usize, mut act: impl FnMut()) -> f64 {
    let mut batches = Vec::with_capacity(BATCHES);
    for _ in 0..BATCHES {
        let began = Instant::now();
        (0..calls).for_each(|_| act());
        batches.push(began.elapsed().as_nanos() as f64 / calls as f64);
    }
    median(&mut batches)
}

/// PReq and PRes, both written and both read, as managing node and controlled node together do.
pub(crate) fn parse_and_emit() {
    let preq = Preq {
        multiplexed: false,
        exception_acknowledge: false,
        ready: true,
        pdo_version: 0x10,
        payload: &[1, 2, 3, 4, 5, 6],
    };
    let pres = Pres {
        nmt_state: NmtState::Operational,
        multiplexed: false,
        exception_new: false,
        ready: true,
        requests: Requests::default(),
        pdo_version: 0x10,
        payload: &[1, 2, 3, 4, 5, 6],
    };
    let down = Header {
        destination: [2, 0, 0, 0x45, 0x50, 1],
        source: MAC,
        destination_node: 1,
        source_node: node::MN,
    };
    let up = Header::multicast(multicast::PRES, down.destination, 1);
    let mut buffer = [0; FRAME_LEN_MAX];
    let parse = |frame: &[u8]| {
        let frame = black_box(frame);
        let _ = black_box((Header::parse(frame), Frame::parse(frame)));
    };
    let emit_ns = median_ns(1000, || {
        black_box(preq.emit(black_box(&down), 36, &mut buffer)).expect("room");
        black_box(pres.emit(black_box(&up), 36, &mut buffer)).expect("room");
    });
    let parse_ns = {
        let (mut preq_frame, mut pres_frame) = ([0; FRAME_LEN_MAX], [0; FRAME_LEN_MAX]);
        let preq_len = preq.emit(&down, 36, &mut preq_frame).expect("room");
        let pres_len = pres.emit(&up, 36, &mut pres_frame).expect("room");
        median_ns(1000, || {
            parse(&preq_frame[..preq_len]);
            parse(&pres_frame[..pres_len]);
        })
    };
    println!(
        "PReq and PRes      emit {emit_ns:5.1} ns, parse {parse_ns:5.1} ns, together {:5.1} ns (goal < 100)",
        emit_ns + parse_ns
    );
}

/// What a PReq costs the controlled node that answers it, ns.
fn controlled_node_ns(responder: &mut Responder, now_ns: u64) -> f64 {
    let mut preq = [0; FRAME_LEN_MAX];
    let header = Header {
        destination: [2, 0, 0, 0x45, 0x50, 1],
        source: MAC,
        destination_node: 1,
        source_node: node::MN,
    };
    let poll = Preq {
        multiplexed: false,
        exception_acknowledge: false,
        ready: true,
        pdo_version: 0,
        payload: &[1; PAYLOAD],
    };
    let length = poll.emit(&header, 36, &mut preq).expect("room");
    let mut answers = 0;
    let ns = median_ns(1000, || {
        responder.receive(now_ns, black_box(&preq[..length]), |answer| {
            answers += usize::from(black_box(answer)[17] == u8::from(NmtState::Operational));
        });
    });
    assert_eq!(answers, 1000 * BATCHES, "node 1 is operational and answers");
    ns
}

/// Answers that were recorded once: a PRes and a StatusResponse for each node.
struct Canned {
    pres: Vec<Vec<u8>>,
    status: Vec<Vec<u8>>,
}

impl Canned {
    fn answer(&self, frame: &[u8]) -> Option<&[u8]> {
        let of = |answers: &'_ [Vec<u8>], id: u8| usize::from(id).checked_sub(1).filter(|at| *at < answers.len());
        match frame[14] {
            message::PREQ => of(&self.pres, frame[15]).map(|at| &self.pres[at][..]),
            message::SOA if frame[20] == 2 => of(&self.status, frame[21]).map(|at| &self.status[at][..]),
            _ => None,
        }
    }
}

/// One cycle on virtual time; answers come at once.
fn cycle<const N: usize>(
    mn: &mut Mn<'_, N>,
    now_ns: &mut u64,
    answer: &mut impl FnMut(u64, &[u8], &mut [u8]) -> usize,
) {
    let mut buffer = [0; FRAME_LEN_MAX];
    mn.start_cycle(*now_ns, NetTime::default());
    loop {
        let length = match mn.poll(*now_ns) {
            Step::Send(frame) => answer(*now_ns, frame, &mut buffer),
            Step::WaitUntil(time_ns) => {
                *now_ns = time_ns;
                continue;
            }
            Step::IsochronousDone => continue,
            Step::Idle => return,
        };
        if length > 0 {
            // The caller of a link polls before it receives.
            let _ = mn.poll(*now_ns);
            mn.receive(*now_ns, &buffer[..length]);
        }
    }
}

/// What a cycle with `N` nodes costs the managing node; prints it a node, and against the least that it could cost.
pub(crate) fn cycle_of<const N: usize>() -> Figures {
    const CYCLE_NS: u64 = 10_000_000;
    let nodes = node_configs(N, 5_000);
    let mut mn = Box::new(Mn::<N>::new(mn_config(&nodes, (CYCLE_NS / 1000) as u32, MAC)).expect("a network"));
    mn.set_outputs_valid(true);
    let mut responder = Responder::new(N);
    let mut canned = Canned {
        pres: vec![Vec::new(); N],
        status: vec![Vec::new(); N],
    };
    let mut start_ns = CYCLE_NS;
    let up = |mn: &Mn<'_, N>| (0..N).all(|at| mn.node_state(at) == NodeState::Operational);
    // Recorded until every node has been asked for both since it is operational.
    let mut since_up = 0;
    while since_up < 20 * N + 2000 {
        since_up += usize::from(up(&mn));
        start_ns += CYCLE_NS;
        let mut now_ns = start_ns;
        cycle(&mut mn, &mut now_ns, &mut |now_ns, frame, buffer| {
            let mut length = 0;
            responder.receive(now_ns, frame, |answer| {
                buffer[..answer.len()].copy_from_slice(answer);
                length = answer.len();
                let at = usize::from(answer[16]) - 1;
                match (answer[14], answer[17]) {
                    (message::PRES, _) => canned.pres[at] = answer.to_vec(),
                    (message::ASND, 2) => canned.status[at] = answer.to_vec(),
                    _ => {}
                }
            });
            length
        });
    }
    let node_ns = controlled_node_ns(&mut responder, start_ns);
    let mut input = [0; PAYLOAD];
    let mut outputs = 0_u8;
    let mut own = || {
        start_ns += CYCLE_NS;
        let mut now_ns = start_ns;
        outputs = outputs.wrapping_add(1);
        for at in 0..N {
            mn.output_mut(at).fill(outputs);
        }
        cycle(&mut mn, &mut now_ns, &mut |_, frame, buffer| {
            let Some(answer) = canned.answer(black_box(frame)) else {
                return 0;
            };
            buffer[..answer.len()].copy_from_slice(answer);
            answer.len()
        });
        for at in 0..N {
            input.copy_from_slice(mn.input(at).data);
            black_box(&input);
        }
    };
    let mut least = Minimal::new(N);
    let answers: Vec<Short> = (1..=N as u8).map(minimal::pres).collect();
    let mut buffer: Short = [0; minimal::LEN];
    let mut value = 0_u8;
    let mut least = || {
        value = value.wrapping_add(1);
        black_box(least.soc(u64::from(value), 10_000));
        for (at, answer) in answers.iter().enumerate() {
            least.outputs[at] = [value; PAYLOAD];
            black_box(least.preq(at));
            buffer.copy_from_slice(black_box(answer));
            least.pres(at, &buffer);
            black_box(&least.inputs[at]);
        }
        black_box(least.soa());
    };
    let (mut own_ns, mut least_ns) = (Vec::new(), Vec::new());
    let calls = (2000 / N).max(4);
    for _ in 0..BATCHES {
        for (times, act) in [(&mut own_ns, &mut own as &mut dyn FnMut()), (&mut least_ns, &mut least)] {
            let began = Instant::now();
            (0..calls).for_each(|_| act());
            times.push(began.elapsed().as_nanos() as f64 / calls as f64);
        }
    }
    let figures = Figures {
        own: median(&mut own_ns) / N as f64,
        least: median(&mut least_ns) / N as f64,
    };
    let lost: u64 = (0..N).map(|at| mn.statistics(at).pres_lost).sum();
    assert!(up(&mn) && lost == 0, "the network did not stay up: {lost} polls lost");
    println!(
        "own computing      {N:3} nodes {:6.0} ns a node (goal < 300), minimal {:5.1} ns, ratio {:.1}; the controlled node itself {node_ns:.0} ns",
        figures.own,
        figures.least,
        figures.own / figures.least
    );
    figures
}
