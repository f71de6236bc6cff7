//! What the main device computes in a cycle, for each drive: `cargo bench -p isocnc-ethercat --bench cycle`.

use ethercat::main::{CyclicFrames, Member};
use ethercat::wire::{Command, Frame, Mac};
use std::hint::black_box;
use std::time::Instant;

const MAC: Mac = [0x10; 6];
const CYCLES: usize = 20_000;
/// Octets of a drive to it and from it.
const OUTPUTS: u16 = 12;
const INPUTS: u16 = 16;

/// The answer to a frame, as devices in OP would make it.
fn answer(sent: &[u8], came: &mut [u8]) {
    came.copy_from_slice(sent);
    came[6] |= 0x02;
    let frame = Frame::parse(sent).expect("a frame");
    for datagram in frame.datagrams() {
        let end = datagram.data_at() + datagram.data.len();
        came[end] = if datagram.command == Command::Lrw { 3 } else { 1 };
    }
}

fn main() {
    println!("{CYCLES} cycles each; outputs written, frames made ready, answers read, inputs copied; median and 99 %");
    for drives in [1_usize, 8, 32, 100] {
        let members = (0..drives as u32).map(|drive| Member::one(16 * drive, OUTPUTS, INPUTS));
        let mut cyclic = CyclicFrames::<128, 4>::new(MAC, members).expect("it fits");
        cyclic.set_reference(Some(0x1000));
        let mut came: Vec<Vec<u8>> = (0..cyclic.len()).map(|number| cyclic.frame(number).to_vec()).collect();
        let mut times_ns: Vec<f64> = (0..CYCLES)
            .map(|cycle| {
                let start = Instant::now();
                for drive in 0..drives {
                    cyclic.outputs_mut(drive)[4..8].copy_from_slice(&(cycle as u32).to_le_bytes());
                }
                cyclic.make_ready(cycle as u64);
                let made = start.elapsed();
                for (number, came) in came.iter_mut().enumerate() {
                    answer(cyclic.frame(number), came);
                }
                let start = Instant::now();
                for came in &came {
                    black_box(cyclic.receive(came));
                }
                let mut sum = 0_u32;
                for drive in 0..drives {
                    sum += u32::from(cyclic.inputs(drive)[0]) + cyclic.answered(drive).lost_in_row;
                }
                black_box(sum);
                assert_eq!(cyclic.finish(), 0);
                (made + start.elapsed()).as_secs_f64() * 1e9
            })
            .collect();
        times_ns.sort_by(f64::total_cmp);
        let (median, high) = (times_ns[CYCLES / 2], times_ns[CYCLES * 99 / 100]);
        println!(
            "{drives:>4} drives, {} frames {:>6.0} ns  {high:>6.0} ns of 99 %  {:>5.1} ns a drive",
            cyclic.len(),
            median,
            median / drives as f64
        );
    }
}
