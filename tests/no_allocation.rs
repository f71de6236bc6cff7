//! Both real-time threads ask nothing of the allocator after start-up, faults included.
//!
//! Allocations are counted for one thread, and only while the code of that
//! thread is real-time code. The wire and the simulated machine behind it stand for the kernel and are left out.

use crate::counting;

use counting::{aside, calls};
use isocnc::bus::ethercat::open::new as new_ethercat;
use isocnc::bus::ethercat::setup;
use isocnc::bus::powerlink::Powerlink;
use isocnc::bus::powerlink::managing_node::{mn_config, node_configs};
use isocnc::bus::powerlink::network;
use isocnc::bus::service::{Mailbox, MailboxRequest};
use isocnc::bus::{self, BusEvent, BusState, CyclicBus, InputImage, OutputImage};
use isocnc::config::{self, Config};
use isocnc::host::histogram::Jitter;
use isocnc::machine::motion_settings::{ring_capacity, stop_ramp};
use isocnc::machine::state::State;
use isocnc::operator::console::Operator;
use isocnc::program::{Feeder, Progress};
use isocnc::rt::assemble::assemble;
use isocnc::rt::cycle_stats::{CycleTimes, recorder};
use isocnc::rt::joint_jog::{JogMotion, JogOrder};
use isocnc::rt::local_drive;
use isocnc::rt::pins::capacity;
use isocnc::rt::shared::Command;
use isocnc::rt::steps::StepDrives;
use isocnc::rt::thread::grid;
use isocnc::rt::timeout::{Event, Limits, REPORTS, Watch, Watchdog};
use isocnc::sim::{Disturbance, NetConfig, SimMachine, VirtualNet};
use motion::ring;
use motion::rt::Interpolator;
use powerlink::link::memory;
use powerlink::link::pnet::PnetLink;
use powerlink::link::raw::{OpenError, RawConfig, RawLink};
use powerlink::link::{Link, LinkError, Received};
use powerlink::wire::NetTime;
use std::collections::VecDeque;
use std::fmt::Write as _;
use std::path::Path;
use std::sync::Arc;

/// A link whose own work is not counted.
struct Aside<L>(L);

impl<L: Link> Link for Aside<L> {
    fn now_ns(&mut self) -> u64 {
        aside(|| self.0.now_ns())
    }

    fn send(&mut self, frame: &[u8]) -> Result<(), LinkError> {
        aside(|| self.0.send(frame))
    }

    fn receive(&mut self, buffer: &mut [u8], deadline_ns: u64) -> Result<Option<Received>, LinkError> {
        aside(|| self.0.receive(buffer, deadline_ns))
    }
}

#[test]
fn the_counter_counts() {
    assert_eq!(calls(|| drop(std::hint::black_box(Box::new(1)))), 2);
    assert_eq!(calls(|| aside(|| drop(std::hint::black_box(vec![0; 9])))), 0);
}

/// Homing of X and Y in the demo machine, by their drives.
const BY_DRIVE: &str =
    "homing = { method = 21, search_mm_s = 40.0, latch_mm_s = 4.0, acceleration_mm_s2 = 500.0, position_mm = 0.0 }";
const BY_CONTROL: &str = "homing = { by = \"control\", towards = \"negative\", switch_mm = -2.0, switch = \"drive\", \
                          search_mm_s = 40.0, latch_mm_s = 4.0 }";

/// The demo machine with an encoder on its spindle, components, a program in Structured Text, and X homed by the control.
fn machine() -> Config {
    let text = include_str!("../configs/mill3-demo.toml");
    assert_eq!(text.matches(BY_DRIVE).count(), 2);
    let text = text.replacen(BY_DRIVE, BY_CONTROL, 1).replace(
        "name = \"io\"\n",
        "name = \"io\"\noutputs = [\"0x6200:1/8\", \"0x6411:1/16\"]\n\
         inputs = [\"0x6000:1/8\", \"0x6000:2/8\", \"0x3000:1/32\", \"0x3000:2/32\", \"0x6401:1/16\"]\n\
         channel = [ { name = \"lamp\", object = \"0x6200:1\", bit = 6, type = \"relay\" }, \
         { name = \"bar\", object = \"0x6401:1\", scale = 0.1, filter_hz = 5, raw_min = 5 }, \
         { name = \"turns\", object = \"0x3000:1\", type = \"encoder\", latch = \"0x3000:2\" } ]\n",
    ) + "[spindle.drive]\nnode = 10\nspeed = \"0x6411:1\"\n\
         [spindle.encoder]\nsource = \"node\"\nnode = 10\ncounter = \"0x3000:1\"\nindex = \"0x3000:2\"\ncounts_per_turn = 1000\n\
         [[hal.component]]\nname = \"near.0\"\ntype = \"near\"\n\
         [[hal.component]]\nname = \"pid.9\"\ntype = \"pid\"\nplace = \"after-motion\"\n\
         [[hal.net]]\nname = \"x\"\nsource = \"axis.x.pos-cmd\"\ntargets = [\"near.0.in1\", \"pid.9.command\"]\n\
         [[logic]]\nfile = \"configs/cell/plant.st\"\nperiod_ms = 2\n\
         [[hal.net]]\nname = \"moves\"\nsource = \"halui.machine.is-on\"\ntargets = [\"logic.plant.motor\"]\n";
    config::parse(&text, Path::new("m.toml")).unwrap_or_else(|errors| panic!("{errors}"))
}

/// A thread and a tap; then squares of 100 mm with rounded corners, spindle and coolant, some 40 s long.
fn squares() -> String {
    let mut text = String::from(
        "G21 G90 G94 G54 G64 P0.01 T1 M6\nS1000 M3\nG0 X0 Y0 Z5\nG33 Z1 K0.5\nG33.1 Z-1 K0.5\nG96 D900 S10\nG95 F6.6\nG1 X5\nX0\nG97 S1000\nG94\n\
         G1 Z0 F6000\n",
    );
    for _ in 0..8 {
        writeln!(
            text,
            "X100\nG3 X110 Y10 J10\nG1 Y100\nM8\nG2 X100 Y110 I-10 F3000\nG1 X0 F6000\nM9\nY0"
        )
        .expect("a string takes everything");
    }
    text + "G4 P0.1\nM5\nM2\n"
}

#[test]
fn the_cycle_never_allocates() {
    const NODES: usize = 8;
    const SEED: u64 = 20;
    println!("seed {SEED}");
    let config = machine();
    let tables = isocnc::machine::tables::Tables::read(&config).expect("no files");
    let text = format!("M52 P1\n{}", squares());
    let plans = network::plan(&config);
    let nodes = node_configs(&config.bus, &plans);
    let net = VirtualNet::new(SimMachine::new(&config).expect("simulated"), NetConfig::clean(SEED));
    let bus = Powerlink::<_, NODES>::new(
        mn_config(&config, &nodes, [2, 0, 0, 0, 0, 0xF0]),
        Aside(net),
        Arc::new(Watch::default()),
        NetTime::default,
    )
    .expect("a network");
    let name = format!("no-allocation-{}", std::process::id());
    let mut hal = hal_pins::Hal::create_in(&[std::env::temp_dir()], &name, capacity(&config)).expect("pins");
    let (control, endpoints) = assemble(&config, &plans, bus, &mut hal).expect("a control");
    let mut control = Box::new(control);
    // Watched by an oscilloscope whose reader keeps up, one whose ring is full, and one that begins anew again and again.
    let period_ns = u64::from(config.cycle_us) * 1000;
    control.set_scope(hal_pins::scope::Sampler::new(&hal, period_ns).expect("an oscilloscope"));
    let pins = hal_pins::Attached::attach_in(&[std::env::temp_dir()], &name).expect("the pins");
    let all: Vec<String> = pins
        .list()
        .expect("pins")
        .into_iter()
        .map(|pin| pin.name)
        .take(32)
        .collect();
    let begin = || hal_pins::scope::Capture::begin(&pins, &all).expect("a capture");
    let (mut keeps_up, falls_behind, mut begins_anew) = (begin(), begin(), begin());
    let mut sampled = 0;
    let mut operator = Operator::new(&config, endpoints, 0);

    let grid = grid(&config);
    let (mut deadline_ns, mut skipped) = (grid.first_after(0), 0);
    let (mut recorder, mut windows) = recorder(grid.period_ns);
    let (mut cycles_done, mut windows_taken) = (0, 0);
    let mut allocations = 0;
    // One cycle, as the cycle thread does it.
    let mut cycle = |control: &mut isocnc::rt::cycle::MotionController<Powerlink<'_, Aside<VirtualNet>, NODES>>,
                     late_ns| {
        allocations += calls(|| control.serve(deadline_ns));
        allocations += calls(|| control.prepare(deadline_ns));
        let net = &mut control.bus_mut().link_mut().0;
        let behind_ns = deadline_ns.saturating_sub(net.now_ns());
        net.advance(behind_ns + late_ns);
        let keep = grid.keep(deadline_ns, net.now_ns());
        if keep.skipped > 0 {
            (deadline_ns, skipped) = (keep.deadline_ns, skipped + keep.skipped);
            allocations += calls(|| control.prepare(deadline_ns));
            let net = &mut control.bus_mut().link_mut().0;
            let behind_ns = deadline_ns.saturating_sub(net.now_ns());
            net.advance(behind_ns);
        }
        let late_ns = control.bus_mut().now_ns() - deadline_ns;
        let next_ns = deadline_ns + grid.period_ns;
        if cycles_done % 500 == 0 {
            // An ordinary thread takes the window before this one and begins another.
            windows_taken += u32::from(windows.last().is_some());
            windows.cut();
        }
        cycles_done += 1;
        allocations += calls(|| {
            let report = control.cycle(late_ns, skipped, deadline_ns + grid.period_ns * 9 / 10);
            recorder.record(&CycleTimes {
                deadline_ns,
                woke_ns: deadline_ns + late_ns,
                soc_ns: report.started_ns,
                exchanged_ns: report.done_ns,
                ended_ns: report.done_ns + 4000,
                next_ns,
                skipped,
                pres_lost: report.lost,
                phase_ns: report.time.late_ns(),
            });
            control.show_timing(recorder.timing());
        });
        let next = grid.next(deadline_ns, control.bus_mut().now_ns());
        (deadline_ns, skipped) = (next.deadline_ns, next.skipped);
    };

    // Boot, enabling and homing: counted as well.
    let mut feeder = None;
    for _ in 0..20_000 {
        cycle(&mut control, 0);
        sampled += keeps_up.read(100, |_| ()).expect("records");
        let now_ns = control.bus_mut().now_ns();
        if let Some(position) = operator.poll(now_ns) {
            let (producer, consumer) = ring::channel(ring_capacity(&config));
            let new = Feeder::new(&config, &tables, text.as_bytes(), position, producer);
            feeder = Some(new.following(operator.shared()));
            operator.start(
                Box::new(Interpolator::new(consumer, position, stop_ramp(&config))),
                false,
            );
        }
        if control.state() == State::Running {
            break;
        }
    }
    assert_eq!(control.state(), State::Running, "{:?}", operator.journal());
    let mut feeder = feeder.expect("a program");
    let mut planned = false;

    // The program, with all that can happen to it. Every ring that leads out of real time runs full meanwhile.
    let mut cycles = 0_u32;
    while cycles < 12_000 {
        if !planned {
            planned = feeder.pump().expect("a good program") == Progress::Done && feeder.is_over();
        }
        let now_ns = control.bus_mut().now_ns();
        let net = &mut control.bus_mut().link_mut().0;
        match cycles {
            1_000 => net.at(now_ns, Disturbance::DropPres { node: 1, count: 1 }),
            1_500 => net.at(now_ns, Disturbance::DropPres { node: 10, count: 3 }),
            2_500 => hal.set("motion.adaptive-feed", 0.5).expect("a pin"),
            4_000 => hal.set("motion.adaptive-feed", 1.0).expect("a pin"),
            4_500 => hal.set("halui.feed-override.scale", 0.1).expect("a pin"),
            4_501 => hal.set("halui.feed-override.counts", -3).expect("a pin"),
            5_000 => operator.give(Command::Hold),
            5_400 | 5_500 => {
                let joints = 1 << (cycles / 100 % 2);
                let motion = JogMotion::Run { velocity_mm_s: 20.0 };
                operator.give(Command::Jog(JogOrder {
                    acceleration_share: 1.0,
                    unhomed: false,
                    joints,
                    axis: None,
                    motion,
                }));
            }
            5_600 => {
                assert_eq!(control.state(), State::Away);
                operator.give(Command::Resume);
            }
            6_900 => {
                assert_eq!(control.state(), State::Held);
                operator.give(Command::Resume);
            }
            7_000 => hal.set("motion.feed-hold", true).expect("a pin"),
            7_500 => hal.set("motion.feed-hold", false).expect("a pin"),
            8_000 => operator.give(Command::Reverse(0.5)),
            8_500 => {
                assert!(operator.live().reversing);
                operator.give(Command::SingleBlock(true));
                operator.give(Command::Resume);
            }
            8_600..9_500 if control.state() == State::Held => operator.give(Command::Resume),
            9_500 => {
                operator.give(Command::SingleBlock(false));
                operator.give(Command::Resume);
            }
            _ => {}
        }
        cycle(
            &mut control,
            match cycles {
                2_000 => 600_000,
                2_200 => 5_000_000,
                _ => 0,
            },
        );
        assert!(
            matches!(
                control.state(),
                State::Running | State::Held | State::Away | State::Returning
            ),
            "cycle {cycles}: {:?}",
            control.state()
        );
        cycles += 1;
        sampled += keeps_up.read(100, |_| ()).expect("records");
        if cycles.is_multiple_of(500) {
            // A capture that is dropped gives its ring back.
            let _ = std::mem::replace(&mut begins_anew, begin());
        }
    }
    assert!(sampled >= 12_000 && keeps_up.lost() == 0, "{sampled}");
    assert!(falls_behind.lost() > 1000, "a full ring was part of it");
    let live = operator.live();
    assert!(live.line > 10 && live.cycles_skipped == 6, "{live:?}");
    assert!(control.trace_lost() > 0, "a full ring was part of it");

    // A node dies: alarm, controlled stop, quick stop; then power off and network down.
    let now_ns = control.bus_mut().now_ns();
    control
        .bus_mut()
        .link_mut()
        .0
        .at(now_ns, Disturbance::PowerOff { node: 2 });
    for _ in 0..500 {
        cycle(&mut control, 0);
    }
    assert_eq!(control.state(), State::Faulted);
    operator.give(Command::Acknowledge);
    for _ in 0..100 {
        cycle(&mut control, 0);
    }
    operator.give(Command::ShutDown);
    for _ in 0..500 {
        cycle(&mut control, 0);
    }
    assert_eq!(
        (control.state(), control.bus_mut().state()),
        (State::Down, BusState::Down)
    );
    assert_eq!(allocations, 0, "calls of the allocator in real time");
    assert!(windows_taken > 20, "{windows_taken} windows of the figures were cut");
    // The last value of what was shown is on the pins.
    let compute_max = hal.reader::<i64>("rt.compute-max-ns").expect("a pin");
    assert_eq!(compute_max.get(), 4000);
}

/// Cycles of the main device of EtherCAT on virtual time: bring-up, process data, a parameter, a lost frame, a pulled cable.
#[test]
fn the_main_device_of_ethercat_never_allocates() {
    const CYCLE_NS: u64 = 1_000_000;
    let text = include_str!("../configs/mill3-ethercat.toml");
    let config = config::parse(text, Path::new("mill3-ethercat.toml")).unwrap_or_else(|errors| panic!("{errors}"));
    let plans = bus::plan(&config);
    let tables = setup::tables(&config, &plans);
    let devices = setup::devices(&config, &plans, &tables);
    let network = setup::network(&config, &devices);
    let net = VirtualNet::new(SimMachine::new(&config).expect("a machine"), NetConfig::clean(1));
    let watch = Arc::new(Watch::default());
    let opened = new_ethercat::<_, 16, 2>(&config, &network, Aside(net), [0x10; 6], watch);
    let mut bus = Box::new(opened.expect("it fits"));
    let mut service = bus.service();
    let outputs = OutputImage::new(plans.iter().map(|plan| plan.outputs.octets));
    let mut inputs = InputImage::new(plans.iter().map(|plan| plan.inputs.octets));
    let (mut allocations, mut date_ns, mut lost, mut came_back) = (0, 2 * CYCLE_NS, 0, 0);
    for cycle in 0..8_000 {
        let net = &mut bus.link_mut().0;
        match cycle {
            2_000 => {
                let request = MailboxRequest {
                    ticket: 1,
                    node: 0,
                    index: 0x1018,
                    sub: 1,
                    value: None,
                };
                service.request(request).expect("room");
            }
            2_200 => assert!(service.reply().expect("an answer").result.is_ok()),
            2_500 => net.at(date_ns, Disturbance::DropPres { node: 1, count: 1 }),
            3_000 => net.at(date_ns, Disturbance::Unplug { node: 2 }),
            3_500 => net.at(date_ns, Disturbance::Plug { node: 2 }),
            _ => {}
        }
        allocations += calls(|| {
            bus.serve(date_ns - CYCLE_NS / 10);
            bus.prepare(date_ns, &outputs);
            aside(|| {
                let net = &mut bus.link_mut().0;
                net.advance(date_ns.saturating_sub(net.time_ns()));
            });
            let report = bus.exchange(date_ns + CYCLE_NS / 2, &mut inputs);
            lost += u32::from(report.lost > 0);
            while let Some(event) = bus.pop_event() {
                came_back += u32::from(cycle > 3_500 && matches!(event, BusEvent::NodeUp(_)));
            }
            bus.publish(cycle);
        });
        date_ns += CYCLE_NS;
    }
    assert_eq!(bus.state(), BusState::Operational);
    assert!(
        lost > 10 && came_back > 0,
        "{lost} cycles with losses, {came_back} came back"
    );
    assert_eq!(allocations, 0, "calls of the allocator in real time");
}

/// The simulated machine at the end of a cable without a length; what it asks of the allocator while all its nodes run.
struct Machine {
    machine: SimMachine,
    now_ns: u64,
    answers: VecDeque<Vec<u8>>,
    runs: bool,
    allocations: u64,
}

impl Machine {
    fn work(&mut self, work: impl FnOnce(&mut SimMachine, &mut dyn FnMut(&[u8]))) {
        let answers = &mut self.answers;
        let asked = calls(|| {
            work(&mut self.machine, &mut |frame| {
                aside(|| answers.push_back(frame.to_vec()))
            })
        });
        self.allocations += if self.runs { asked } else { 0 };
    }
}

impl Link for Machine {
    fn now_ns(&mut self) -> u64 {
        self.now_ns
    }

    fn send(&mut self, frame: &[u8]) -> Result<(), LinkError> {
        // Who asks one question after the other sees time pass.
        self.now_ns += 5_000;
        let now_ns = self.now_ns;
        self.work(|machine, send| machine.receive(now_ns, frame, send));
        Ok(())
    }

    fn receive(&mut self, buffer: &mut [u8], deadline_ns: u64) -> Result<Option<Received>, LinkError> {
        loop {
            if let Some(frame) = self.answers.pop_front() {
                buffer[..frame.len()].copy_from_slice(&frame);
                let length = frame.len();
                return Ok(Some(Received { length, stamp_ns: None }));
            }
            if self.now_ns >= deadline_ns {
                return Ok(None);
            }
            self.now_ns = self
                .machine
                .next_poll_ns()
                .clamp(deadline_ns.min(self.now_ns + 1000), deadline_ns);
            let now_ns = self.now_ns;
            self.work(|machine, send| machine.poll(now_ns, send));
        }
    }
}

/// Calls of the allocator in a simulated machine of this file, in cycles in which all its nodes run.
fn of_machine<'a, B: CyclicBus>(
    text: &str,
    open: impl FnOnce(&'static Config, Machine) -> B,
    link: impl Fn(&mut B) -> &mut Machine + 'a,
) -> u64 {
    const CYCLE_NS: u64 = 1_000_000;
    const CYCLES: usize = 500;
    let config = config::parse(text, Path::new("m.toml")).unwrap_or_else(|errors| panic!("{errors}"));
    let config: &'static Config = Box::leak(Box::new(config));
    let machine = Machine {
        machine: SimMachine::new(config).expect("a machine"),
        now_ns: 0,
        answers: VecDeque::new(),
        runs: false,
        allocations: 0,
    };
    let plans = bus::plan(config);
    let mut bus = open(config, machine);
    let mut outputs = OutputImage::new(plans.iter().map(|plan| plan.outputs.octets));
    let mut inputs = InputImage::new(plans.iter().map(|plan| plan.inputs.octets));
    let (mut date_ns, mut ran) = (2 * CYCLE_NS, 0);
    for cycle in 0..20_000_u32 {
        bus.serve(date_ns - CYCLE_NS / 10);
        // Control words and targets that change; what they ask for is all the same here.
        for node in 0..plans.len() {
            outputs.node_mut(node).fill(cycle as u8 & 1);
        }
        bus.prepare(date_ns, &outputs);
        let own = link(&mut bus);
        while own.now_ns < date_ns {
            let mut none = [0; 1514];
            let _ = own.receive(&mut none, date_ns);
        }
        bus.exchange(date_ns + CYCLE_NS / 2, &mut inputs);
        while bus.pop_event().is_some() {}
        date_ns += CYCLE_NS;
        if bus.state() == BusState::Operational {
            // What the last steps have touched off is over behind a few cycles.
            ran += 1;
            link(&mut bus).runs = ran > 100;
        }
        if ran == CYCLES {
            return link(&mut bus).allocations;
        }
    }
    panic!("{:?} after 20000 cycles", bus.state());
}

/// It runs in the cycle thread where the machine file has a bus through memory.
#[test]
fn the_simulated_machine_never_allocates_while_its_nodes_run() {
    let powerlink = |config: &'static Config, machine| {
        let plans = Box::leak(Box::new(network::plan(config)));
        let nodes = node_configs(&config.bus, plans).leak();
        let watch = Arc::new(Watch::default());
        let mac = [2, 0, 0, 0, 0, 0xF0];
        Box::new(
            Powerlink::<_, 8>::new(mn_config(config, nodes, mac), machine, watch, NetTime::default).expect("a network"),
        )
    };
    let text = include_str!("../configs/mill3-demo.toml");
    assert_eq!(of_machine(text, powerlink, |bus| bus.link_mut()), 0, "POWERLINK");
    let ethercat = |config: &'static Config, machine| {
        let plans = bus::plan(config).leak();
        let tables = Box::leak(Box::new(setup::tables(config, plans)));
        let devices = Box::leak(Box::new(setup::devices(config, plans, tables)));
        let network = Box::leak(Box::new(setup::network(config, devices)));
        let opened = new_ethercat::<_, 16, 2>(config, network, machine, [0x10; 6], Arc::new(Watch::default()));
        Box::new(opened.expect("it fits"))
    };
    let text = include_str!("../configs/mill3-ethercat.toml");
    assert_eq!(of_machine(text, ethercat, |bus| bus.link_mut()), 0, "EtherCAT");
}

#[test]
fn the_time_out_thread_never_allocates() {
    const TICK_NS: u64 = 50_000;
    const CYCLE_NS: u64 = 1_000_000;
    let watch = Arc::new(Watch::default());
    let mut watchdog = Watchdog::new(Arc::clone(&watch), Limits::new(CYCLE_NS, TICK_NS, 3));
    let (mut reports, mut seen) = rtrb::RingBuffer::new(REPORTS);
    let mut full = 0;
    let allocations = calls(|| {
        for tick in 0..20_000_u64 {
            let now_ns = (tick + 20) * TICK_NS;
            let cycle = now_ns / CYCLE_NS;
            // The cycle thread hangs through the last tenth; some of its polls and slots stay unanswered before.
            if tick.is_multiple_of(20) && tick < 18_000 {
                watch.begin_cycle(cycle, now_ns);
                watch.begin_poll(1, now_ns + 120_000);
                watch.begin_async(2, now_ns + 300_000);
                if cycle.is_multiple_of(3) {
                    watch.end_poll();
                    watch.end_async();
                }
                watch.end_cycle(cycle, true);
            }
            watchdog.tick(now_ns, |report| full += u64::from(reports.push(report).is_err()));
        }
    });
    assert_eq!(allocations, 0, "calls of the allocator in real time");
    let counters = watch.counters();
    assert_eq!(
        (counters.ticks, counters.polls_lost, counters.async_lost),
        (20_000, 600, 600)
    );
    assert!(full > 0, "a full ring was part of it");
    assert!(!watch.soc_allowed(), "a hung cycle thread was part of it");
    let first = seen.pop().expect("a report");
    assert!(matches!(first.event, Event::PresTimeout { node: 1 }), "{first:?}");
}

#[test]
fn step_pulses_never_allocate() {
    let text = include_str!("../configs/plotter2-steps.toml");
    let config = config::parse(text, Path::new("plotter2-steps.toml")).expect("a good machine file");
    let mut drives = StepDrives::new(&config);
    let plans: Vec<_> = local_drive::plans(&config).collect();
    let mut inputs = InputImage::new(plans.iter().map(|plan| plan.inputs.octets));
    let mut outputs = OutputImage::new(plans.iter().map(|plan| plan.outputs.octets));
    let mut ticker = drives.take_ticker().expect("nobody has it");
    let mut counts = 0;
    let allocations = calls(|| {
        for cycle in 0..2000_u64 {
            let word: u16 = [0x0006, 0x0007, 0x000F][cycle.min(2) as usize];
            let payload = outputs.node_mut(0);
            payload[..2].copy_from_slice(&word.to_le_bytes());
            payload[2] = 8;
            payload[3..7].copy_from_slice(&(cycle as i32 * 500).to_le_bytes());
            drives.read(cycle * 1_000_000, &mut inputs);
            drives.write(&outputs);
            ticker.begin_cycle();
            for tick in 0..20 {
                ticker.tick(cycle * 1_000_000 + tick * 50_000);
            }
            counts = drives.views().map(|view| view.counts).max().unwrap_or(0);
        }
    });
    assert_eq!(allocations, 0, "calls of the allocator in real time");
    assert!(counts > 3000, "{counts} pulses");
}

#[test]
fn statistics_of_jitter_never_allocate() {
    let mut jitter = Jitter::new(1_000_000);
    let allocations = calls(|| {
        for exponent in 0..64 {
            for _ in 0..200 {
                jitter.record(1 << exponent);
            }
        }
    });
    assert_eq!(allocations, 0, "calls of the allocator in real time");
}

/// Calls of the allocator for 10,000 frames from `near` to `far` and as many answers.
fn frames(near: &mut impl Link, far: &mut impl Link) -> u64 {
    const WAIT_NS: u64 = 5_000_000_000;
    let mut frame = [0x5A; 300];
    frame[..6].copy_from_slice(&[0x01, 0x11, 0x1E, 0, 0, 1]);
    frame[6..12].copy_from_slice(&[0x02, 0, 0, 0, 0, 0xF0]);
    frame[12..14].copy_from_slice(&[0x88, 0xAB]);
    let mut buffer = [0; 1514];
    let mut received = 0;
    let allocations = calls(|| {
        for number in 0..10_000_u32 {
            frame[20..24].copy_from_slice(&number.to_le_bytes());
            for far_to_near in [false, true] {
                let now_ns = far.now_ns();
                let got = if far_to_near {
                    far.send(&frame)
                        .and_then(|()| near.receive(&mut buffer, now_ns + WAIT_NS))
                } else {
                    near.send(&frame)
                        .and_then(|()| far.receive(&mut buffer, now_ns + WAIT_NS))
                };
                received +=
                    u32::from(matches!(got, Ok(Some(Received { length: 300, .. })) if buffer[20..24] == frame[20..24]));
            }
            // Nothing there: the receiver looks in vain.
            let now_ns = near.now_ns();
            received += u32::from(matches!(near.receive(&mut buffer, now_ns), Ok(Some(_))));
        }
    });
    assert_eq!(received, 20_000);
    allocations
}

#[test]
fn the_wire_in_memory_never_allocates() {
    let (mut near, mut far) = memory::pair(1000);
    assert_eq!(frames(&mut near, &mut far), 0, "calls of the allocator in real time");
}

#[test]
fn a_link_to_an_interface_never_allocates() {
    for ring_frames in [0, 64] {
        let config = RawConfig {
            ring_frames,
            receive_stamps: true,
            ..RawConfig::default()
        };
        loopback(RawLink::open("lo", config));
    }
    loopback(PnetLink::open("lo", 20_000));
}

/// Its own frames come back on the loopback interface; other traffic there is not POWERLINK.
fn loopback(opened: Result<impl Link, OpenError>) {
    let mut link = match opened {
        Ok(link) => link,
        Err(error) => {
            println!("SKIPPED: {error}");
            return;
        }
    };
    let mut frame = [0x5A; 300];
    frame[..6].copy_from_slice(&[0x01, 0x11, 0x1E, 0, 0, 1]);
    frame[12..14].copy_from_slice(&[0x88, 0xAB]);
    let mut buffer = [0; 1514];
    let (mut sent, mut received) = (0, 0);
    let allocations = calls(|| {
        for _ in 0..10_000 {
            sent += u32::from(link.send(&frame).is_ok());
            let now_ns = link.now_ns();
            received += u32::from(matches!(link.receive(&mut buffer, now_ns + 1_000_000_000), Ok(Some(_))));
            // Nothing there: the receiver looks in vain, and waits in vain.
            let now_ns = link.now_ns();
            received += u32::from(matches!(link.receive(&mut buffer, now_ns), Ok(Some(_))));
        }
        let now_ns = link.now_ns();
        received += u32::from(matches!(link.receive(&mut buffer, now_ns + 1_000_000), Ok(Some(_))));
    });
    assert_eq!(allocations, 0, "calls of the allocator in real time");
    assert_eq!((sent, received), (10_000, 10_000));
}
