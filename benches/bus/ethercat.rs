//! EtherCAT over a veth pair, all drives on the core of the main device: within its thread or in one above it.
//!
//! In:  number of drives, cycle, how many cycles, where the drives run. Out: how long an exchange takes, in turns with POWERLINK's; how soon all drives
//! are in OP; which cycles were not over in time.

use super::wire::{
    Bench, Exchange, Nodes, NodesThread, QUIET_NS, SPIN_NS, Side, median_p99_max, powerlink, print_overruns,
};
use anyhow::anyhow;
use ethercat::main::DeviceState;
use ethercat::main::config::{ClockConfig, Config, DeviceConfig, ProcessDataConfig, StartValue, Times};
use ethercat::sub::{IdealMotor, Segment, SubDevice, models};
use ethercat::wire::FRAME_LEN_MAX;
use isocnc::bus::ethercat::Ethercat;
use isocnc::bus::ethercat::open::raw_config;
use isocnc::bus::{CyclicBus, InputImage, OutputImage};
use isocnc::config::BusLink;
use isocnc::rt::timeout::Watch;
use powerlink::link::raw::{RawConfig, RawLink};
use powerlink::link::{Link, LinkError, Received};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Octets of a drive in each direction: its PDOs as they come out of the box.
const OCTETS: u16 = models::AXIS_OCTETS;
/// Cable between two drives, ns.
const CABLE_NS: u64 = 300;
const DEVICES_MAX: usize = 128;
const FRAMES_MAX: usize = 4;

/// The far end of the wire and the drives there.
struct Devices {
    link: RawLink,
    segment: Segment,
    buffer: [u8; FRAME_LEN_MAX],
}

impl Devices {
    /// Answers one frame, or does what is due if none comes by then.
    fn answer(&mut self, until_ns: u64) {
        let received = self
            .link
            .receive(&mut self.buffer, until_ns)
            .expect("the interface is up");
        let now_ns = self.link.now_ns();
        let Some(received) = received else {
            return self.segment.poll(now_ns);
        };
        let frame = &mut self.buffer[..received.length.min(FRAME_LEN_MAX)];
        if frame.get(12..14) == Some(&[0x88, 0xA4]) && self.segment.receive(now_ns, frame).is_some() {
            let _ = self.link.send(frame);
        }
    }

    /// The thread of the drives.
    fn serve(&mut self, stop: &AtomicBool) {
        while !stop.load(Ordering::Relaxed) {
            let now_ns = self.link.now_ns();
            self.answer(self.segment.next_ns(now_ns).min(now_ns + 50_000_000));
        }
    }
}

/// The near end of the wire; whatever is sent is answered at the far end before `send` returns.
struct Near {
    link: RawLink,
    /// Unless they have a thread of their own.
    far: Option<Devices>,
}

impl Link for Near {
    fn now_ns(&mut self) -> u64 {
        self.link.now_ns()
    }

    fn send(&mut self, frame: &[u8]) -> Result<(), LinkError> {
        self.link.send(frame)?;
        if let Some(far) = &mut self.far {
            far.answer(0);
        }
        Ok(())
    }

    fn receive(&mut self, buffer: &mut [u8], deadline_ns: u64) -> Result<Option<Received>, LinkError> {
        self.link.receive(buffer, deadline_ns)
    }
}

struct Drives {
    bus: Box<Ethercat<'static, Near, DEVICES_MAX, FRAMES_MAX>>,
    outputs: OutputImage,
    inputs: InputImage,
    lost: u64,
}

impl Exchange for Drives {
    fn exchange(&mut self, deadline_ns: u64) {
        for node in 0..self.inputs.fresh.len() {
            // The target; drives are not enabled.
            self.outputs.node_mut(node)[4] = self.outputs.node(node)[4].wrapping_add(1);
        }
        let now_ns = self.bus.now_ns();
        self.bus.prepare(now_ns, &self.outputs);
        let report = self.bus.exchange(deadline_ns, &mut self.inputs);
        self.lost += u64::from(report.lost);
    }

    fn serve(&mut self, until_ns: u64) {
        // On the way to OP up to the date: cycles here are shorter than those of a machine file.
        let ahead_ns = if self.is_up() { 0 } else { SPIN_NS + QUIET_NS };
        self.bus.serve(until_ns + ahead_ns);
        while self.bus.pop_event().is_some() {}
        let link = self.bus.link_mut();
        if let Some(far) = &mut link.far {
            let now_ns = link.link.now_ns();
            far.segment.poll(now_ns);
        }
    }

    fn is_up(&self) -> bool {
        let mut nodes = 0..self.inputs.fresh.len();
        nodes.all(|node| self.bus.main().device_state(node) == DeviceState::Operational)
    }

    fn take_lost(&mut self) -> (u64, u64) {
        (std::mem::take(&mut self.lost), 0)
    }
}

/// So many drives and our main device.
fn drives(count: usize, cycle_us: u32, place: Nodes, watch: &Arc<Watch>) -> anyhow::Result<Side<'static>> {
    let far_config = RawConfig {
        every_ether_type: true,
        promiscuous: true,
        ..RawConfig::default()
    };
    let mut far = Devices {
        link: RawLink::open("raw1", far_config)?,
        segment: Segment::new(),
        buffer: [0; FRAME_LEN_MAX],
    };
    let start_ns = far.link.now_ns();
    for _ in 0..count {
        let drive = models::DriveModel::default().build(vec![Box::new(IdealMotor::default())]);
        let drive = drive.map_err(|code| anyhow!("a drive: {}", code.text()))?;
        far.segment.push(SubDevice::new(drive, start_ns), CABLE_NS);
    }
    let (within, nodes): (_, Option<NodesThread<'static>>) = match place {
        Nodes::Within => (Some(far), None),
        Nodes::Above => (None, Some(Box::new(move |stop: &AtomicBool| far.serve(stop)))),
    };
    let data = ProcessDataConfig {
        octets: OCTETS,
        pdos: &[],
    };
    let device = |position| DeviceConfig {
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
            shift_ns: (cycle_us * 500) as i32,
            sync1_ns: 0,
        }),
        ..DeviceConfig::at(position)
    };
    // Kept as long as the process lives, once for each run.
    let devices = (0..count as u16).map(device).collect::<Vec<_>>().leak();
    let network = Box::leak(Box::new(Config {
        cycle_ns: cycle_us * 1000,
        devices,
        lost_max: 1000,
        times: Times::default(),
    }));
    let link = RawLink::open("raw0", raw_config())?;
    let mac = link.mac();
    let link = Near { link, far: within };
    let mandatory = std::iter::repeat_n(true, count);
    let bus = Ethercat::new(network, mac, link, Arc::clone(watch), true, mandatory)?;
    let lengths = vec![usize::from(OCTETS); count];
    let exchange = Box::new(Drives {
        bus: Box::new(bus),
        outputs: OutputImage::new(lengths.iter().copied()),
        inputs: InputImage::new(lengths),
        lost: 0,
    });
    Ok(Side { exchange, nodes })
}

/// The exchange of all process data on a relaxed cycle, with POWERLINK's in turns.
pub(crate) fn exchange<const N: usize>(bench: &Bench, cycles: usize, goal: &str) {
    for (place, name) in [(Nodes::Within, "in this thread"), (Nodes::Above, "in a thread above")] {
        let measure = || {
            let watch = Arc::new(Watch::default());
            let sides = vec![
                powerlink::<N>(BusLink::Raw, 1000, 5_000, place, &watch)?,
                drives(N, 1000, place, &watch)?,
            ];
            bench.in_turns(sides, &watch, 1000, cycles, 1, false)
        };
        match measure() {
            Ok((ran, up_s)) => {
                let (theirs, ours) = (median_p99_max(&ran[0]), median_p99_max(&ran[1]));
                println!(
                    "EtherCAT           {N:3} drives {name:17} median {:6.1} us, p99 {:6.1}, max {:7.1}; POWERLINK {:6.1}, {:6.1}, \
                     {:7.1}; ratio {:.2}{goal}; all in OP after {:.2} s",
                    ours[0],
                    ours[1],
                    ours[2],
                    theirs[0],
                    theirs[1],
                    theirs[2],
                    ours[0] / theirs[0],
                    up_s[1]
                );
            }
            Err(why) => println!("EtherCAT           {N:3} drives {name}: {why:#}"),
        }
    }
}

/// How many cycles are not over in time, and why.
pub(crate) fn shortest(bench: &Bench, count: usize, cycle_us: u32, cycles: usize) {
    for (place, name) in [(Nodes::Within, "in this thread"), (Nodes::Above, "in a thread above")] {
        let measure = || {
            let watch = Arc::new(Watch::default());
            let sides = vec![drives(count, cycle_us, place, &watch)?];
            bench.in_turns(sides, &watch, cycle_us, cycles, 1, false)
        };
        match measure() {
            Ok((ran, up_s)) => {
                let name = format!("{count:3} drives on EtherCAT {name}, in OP after {:.2} s", up_s[0]);
                print_overruns(&name, cycle_us, &ran[0]);
            }
            Err(why) => println!("cycle of {cycle_us:4} us   {count:3} drives on EtherCAT {name}: {why:#}"),
        }
    }
}
