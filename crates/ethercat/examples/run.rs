//! The main device on a network interface: `cargo run --release -p isocnc-ethercat --example run -- IF [DRIVES] [CYCLE_US] [SECONDS]`.
//!
//! Brings a line of servo drives, such as those of the example `simulate`, to OP, and says how long exchanges take.

use ethercat::main::config::{ClockConfig, Config, DeviceConfig, ProcessDataConfig, StartValue, Times};
use ethercat::main::{MainDevice, PhaseConfig, PhaseLoop};
use ethercat::wire::FRAME_LEN_MAX;
use powerlink::link::Link;
use powerlink::link::raw::{RawConfig, RawLink};
use std::error::Error;

/// The bit that devices set is clear in it.
const MAC: [u8; 6] = [0x10; 6];
/// Between the end of services and the next date.
const QUIET_NS: u64 = 60_000;
const SPIN_NS: u64 = 20_000;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let interface = arguments.next().ok_or("an interface is needed")?;
    let mut number = |default: u64| arguments.next().map_or(Ok(default), |text| text.parse());
    let (drives, cycle_us, seconds) = (number(2)?, number(1000)?, number(10)?);
    let cycle_ns = 1000 * cycle_us;
    let data = ProcessDataConfig { octets: 8, pdos: &[] };
    let parts: Vec<DeviceConfig<'_>> = (0..drives as u16)
        .map(|position| DeviceConfig {
            outputs: data,
            inputs: data,
            start: &[StartValue {
                index: 0x6060,
                sub: 0,
                complete: false,
                optional: false,
                value: &[8],
            }],
            clock: Some(ClockConfig {
                activate: 0x0300,
                shift_ns: (cycle_ns / 2) as i32,
                sync1_ns: 0,
            }),
            ..DeviceConfig::at(position)
        })
        .collect();
    let config = Config {
        cycle_ns: cycle_ns as u32,
        devices: &parts,
        lost_max: 3,
        times: Times::default(),
    };
    let mut main = Box::new(MainDevice::<128, 4>::new(MAC, &config)?);
    println!("{}", main.budget());
    let raw = RawConfig {
        every_ether_type: true,
        promiscuous: true,
        spin_ns: SPIN_NS,
        ..RawConfig::default()
    };
    let mut link = RawLink::open(&interface, raw)?;
    let mut phase = PhaseLoop::new(PhaseConfig::of_cycle(cycle_ns as u32));
    let mut buffer = [0; FRAME_LEN_MAX];
    let start_ns = link.now_ns();
    let mut date_ns = start_ns + cycle_ns;
    let (mut exchanges_ns, mut lost, mut op_ns) = (Vec::new(), 0_u64, None);
    while link.now_ns() < start_ns + 1_000_000_000 * seconds {
        let frames = main.prepare();
        while link.now_ns() < date_ns {
            std::hint::spin_loop();
        }
        let begun_ns = link.now_ns();
        for number in 0..frames {
            link.send(main.frame(number))?;
        }
        let ends_ns = date_ns + cycle_ns / 2;
        while frames > 0 && !main.cycle_is_whole() {
            let Some(received) = link.receive(&mut buffer, ends_ns)? else {
                break;
            };
            main.receive(link.now_ns(), &buffer[..received.length.min(FRAME_LEN_MAX)]);
        }
        let done_ns = link.now_ns();
        let moved_ns = match main.late_ns() {
            Some(late_ns) => phase.correct(late_ns),
            None => phase.hold(),
        };
        let missing = main.finish_cycle(done_ns);
        if main.is_operational() {
            op_ns.get_or_insert(done_ns - start_ns);
            exchanges_ns.push(done_ns - begun_ns);
            lost += u64::from(missing);
        }
        while let Some(event) = main.pop_event() {
            println!("{:.3} s: {event}", (link.now_ns() - start_ns) as f64 / 1e9);
        }
        date_ns = (date_ns + cycle_ns).wrapping_add_signed(moved_ns);
        let serve_ns = date_ns.saturating_sub(QUIET_NS);
        while link.now_ns() < serve_ns {
            let now_ns = link.now_ns();
            if let Some(frame) = main.service_frame(now_ns) {
                buffer[..frame.len()].copy_from_slice(frame);
                let length = frame.len();
                link.send(&buffer[..length])?;
            }
            if let Some(received) = link.receive(&mut buffer, serve_ns.min(now_ns + 200_000))? {
                main.receive(link.now_ns(), &buffer[..received.length.min(FRAME_LEN_MAX)]);
            }
        }
    }
    let shut = main.shut_down_frame().len();
    buffer[..shut].copy_from_slice(main.shut_down_frame());
    link.send(&buffer[..shut])?;
    exchanges_ns.sort_unstable();
    let at = |share: usize| {
        exchanges_ns
            .get(exchanges_ns.len() * share / 1000)
            .map_or(0.0, |ns| *ns as f64 / 1000.0)
    };
    match op_ns {
        Some(op_ns) => println!("all in OP after {} ms", op_ns / 1_000_000),
        None => println!("not all came to OP"),
    }
    println!(
        "{} exchanges: median {:.1} us, 99 % within {:.1} us, longest {:.1} us; {lost} answers were lost",
        exchanges_ns.len(),
        at(500),
        at(990),
        at(999)
    );
    if let Some(punctuality) = main.punctuality(0) {
        println!("{punctuality}");
    }
    Ok(())
}
