//! Cycles over a veth pair, all nodes on the core of the managing node.
//!
//! In:  number of nodes, cycle, how many cycles, where the nodes run. Out: how long SoC to SoA took, which cycles were not
//! over in time and what kept them.
//!
//! The nodes run in a thread of their own above the managing node, which costs two changes of thread a node (several
//! microseconds in a virtual machine), or within the managing node's thread, which shows what the wire and both stacks
//! cost without them.
//!
//! What ours is held against has a wire and a responder of its own and takes turns with ours: the minimal loop, or EtherCAT.

use super::minimal::{self, Minimal, Short};
use super::network::{Responder, mn_config, node_configs};
use super::socket::Socket;
use anyhow::{anyhow, ensure};
use isocnc::bus::powerlink::{Powerlink, wall_clock};
use isocnc::bus::{BusState, CyclicBus, InputImage, NodeState, OutputImage};
use isocnc::config::{self, BusLink};
use isocnc::host::netns::{add_wire, private_wire};
use isocnc::host::setup::{Process, Role, STACK_SIZE, enter_core, enter_thread, prepare_process};
use isocnc::host::wait::{Grid, monotonic_ns, thread_cpu_ns};
use isocnc::rt::timeout::{self, Limits, TimeoutThread, Watch};
use nix::errno::Errno;
use nix::sys::time::TimeSpec;
use nix::time::{ClockId, ClockNanosleepFlags, clock_gettime, clock_nanosleep};
use powerlink::link::pnet::PnetLink;
use powerlink::link::raw::{RawConfig, RawLink};
use powerlink::link::{Link, LinkError, Received};
use powerlink::wire::message;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicI32, Ordering};
use std::time::Duration;

const MACHINE: &str = include_str!("../../configs/mill3-demo.toml");
const PAYLOAD: usize = super::network::PAYLOAD;
/// As the control does it.
const ANSWER_SPIN_NS: u64 = 20_000;
pub(crate) const SPIN_NS: u64 = 50_000;
pub(crate) const QUIET_NS: u64 = 30_000;
const BOOT_LIMIT_NS: u64 = 10_000_000_000;

/// One cycle as it ran.
#[derive(Clone, Copy, Default)]
pub(crate) struct Cycle {
    /// From the beginning of the exchange to its end.
    pub(crate) exchange_ns: u64,
    /// From the date of the cycle to the end of its exchange.
    pub(crate) done_ns: u64,
    /// The thread was woken so much later than it had asked for, its own work before left out: the timer of the kernel or
    /// the host was late, or the kernel gave the core to others.
    pub(crate) woken_late_ns: u64,
    /// Processor time of this thread for what was left to do before the cycle.
    pub(crate) serving_ns: u64,
    /// Time from the wake-up to the end in which no thread of the cycle ran: the host had the core, or the kernel gave
    /// ordinary threads the share of time that it keeps for them.
    pub(crate) stolen_ns: u64,
    /// Cycles left out after this one.
    pub(crate) skipped: u64,
}

/// Something that exchanges process data once a cycle.
pub(crate) trait Exchange {
    fn exchange(&mut self, deadline_ns: u64);
    /// What is left to do until then.
    fn serve(&mut self, until_ns: u64);
    /// Whether all nodes exchange process data.
    fn is_up(&self) -> bool;
    /// Answers that did not come, since this was asked last; and those that were wrong.
    fn take_lost(&mut self) -> (u64, u64);
}

/// What the nodes of an exchange do in a thread of their own until the flag is set.
pub(crate) type NodesThread<'a> = Box<dyn FnOnce(&AtomicBool) + Send + 'a>;

/// An exchange and the thread of its nodes; `None`: it has them within.
pub(crate) struct Side<'a> {
    pub(crate) exchange: Box<dyn Exchange + Send + 'a>,
    pub(crate) nodes: Option<NodesThread<'a>>,
}

/// Where the nodes run.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Nodes {
    /// In a thread above the managing node.
    Above,
    /// In the thread of the managing node, which calls them after each of its frames.
    Within,
}

/// The near end of the wire; whatever is sent is answered at the far end before `send` returns.
struct Near<L> {
    near: L,
    /// Far end and the nodes there, unless they have a thread of their own.
    far: Option<(RawLink, Responder)>,
    buffer: [u8; 1514],
}

impl<L: Link> Link for Near<L> {
    fn now_ns(&mut self) -> u64 {
        self.near.now_ns()
    }

    fn send(&mut self, frame: &[u8]) -> Result<(), LinkError> {
        self.near.send(frame)?;
        if let Some((far, responder)) = &mut self.far {
            answer(far, responder, &mut self.buffer, 0)?;
        }
        Ok(())
    }

    fn receive(&mut self, buffer: &mut [u8], deadline_ns: u64) -> Result<Option<Received>, LinkError> {
        self.near.receive(buffer, deadline_ns)
    }
}

/// Answers one frame at the far end, or looks at the clock if none comes by the deadline.
fn answer(far: &mut RawLink, responder: &mut Responder, buffer: &mut [u8], deadline_ns: u64) -> Result<(), LinkError> {
    let received = far.receive(buffer, deadline_ns)?;
    let now_ns = far.now_ns();
    match received {
        Some(received) => responder.receive(now_ns, &buffer[..received.length], |answer| {
            let _ = far.send(answer);
        }),
        None => responder.poll(now_ns),
    }
    Ok(())
}

struct Ours<'a, L: Link, const N: usize> {
    bus: Box<Powerlink<'a, Near<L>, N>>,
    outputs: OutputImage,
    inputs: InputImage,
    lost: u64,
}

impl<L: Link, const N: usize> Exchange for Ours<'_, L, N> {
    fn exchange(&mut self, deadline_ns: u64) {
        for node in 0..N {
            self.outputs.node_mut(node)[0] = self.outputs.node(node)[0].wrapping_add(1);
        }
        let now_ns = self.bus.now_ns();
        self.bus.prepare(now_ns, &self.outputs);
        let report = self.bus.exchange(deadline_ns, &mut self.inputs);
        self.lost += u64::from(report.lost);
    }

    fn serve(&mut self, until_ns: u64) {
        self.bus.serve(until_ns);
        while self.bus.pop_event().is_some() {}
    }

    fn is_up(&self) -> bool {
        let bus = &self.bus;
        bus.state() == BusState::Operational && (0..N).all(|node| bus.node_state(node) == NodeState::Operational)
    }

    fn take_lost(&mut self) -> (u64, u64) {
        (std::mem::take(&mut self.lost), 0)
    }
}

struct Least {
    mn: Minimal,
    socket: Socket,
    /// Far end and the answers of the nodes, unless they have a thread of their own.
    far: Option<(Socket, Vec<Short>)>,
    lost: u64,
}

impl Least {
    fn send(&self, frame: &Short) {
        self.socket.send(frame);
        if let Some((far, answers)) = &self.far {
            answer_least(far, answers);
        }
    }
}

fn answer_least(far: &Socket, answers: &[Short]) {
    let mut buffer = [0; 1514];
    if far.recv(&mut buffer).is_some() && buffer[14] == message::PREQ {
        far.send(&answers[usize::from(buffer[15]) - 1]);
    }
}

impl Exchange for Least {
    fn exchange(&mut self, _: u64) {
        let mut buffer = [0; 1514];
        let soc = *self.mn.soc(monotonic_ns(), 1000);
        self.send(&soc);
        for node in 0..self.mn.outputs.len() {
            self.mn.outputs[node] = [self.mn.outputs[node][0].wrapping_add(1); PAYLOAD];
            let preq = *self.mn.preq(node);
            self.send(&preq);
            match self.socket.recv(&mut buffer) {
                Some(length) => self.mn.pres(node, &buffer[..length]),
                None => self.lost += 1,
            }
        }
        self.send(self.mn.soa());
    }

    fn serve(&mut self, _: u64) {}

    fn is_up(&self) -> bool {
        true
    }

    fn take_lost(&mut self) -> (u64, u64) {
        (std::mem::take(&mut self.lost), std::mem::take(&mut self.mn.wrong))
    }
}

/// The threads whose work a cycle is: the managing node's, and those of the nodes where they have some.
#[derive(Clone, Default)]
pub(crate) struct Clocks {
    nodes: Arc<[AtomicI32; 2]>,
}

impl Clocks {
    /// The calling thread is one of the nodes'.
    fn register(&self, place: usize) {
        let mut clock = 0;
        // SAFETY: a thread that lives, itself, and a number that lives through the call.
        unsafe { libc::pthread_getcpuclockid(libc::pthread_self(), &raw mut clock) };
        self.nodes[place].store(clock, Ordering::Release);
    }

    /// Processor time of the calling thread and the nodes' threads.
    fn now_ns(&self) -> u64 {
        let nodes = self.nodes.iter().map(|clock| clock.load(Ordering::Acquire));
        let time_ns = |clock| {
            let time = clock_gettime(ClockId::from_raw(clock)).expect("the thread lives");
            time.tv_sec() as u64 * 1_000_000_000 + time.tv_nsec() as u64
        };
        thread_cpu_ns() + nodes.filter(|clock| *clock != 0).map(time_ns).sum::<u64>()
    }
}

/// Runs one cycle at its date.
fn run_cycle(exchange: &mut dyn Exchange, clocks: &Clocks, deadline_ns: u64, limit_ns: u64) -> Cycle {
    let cpu_ns = thread_cpu_ns();
    exchange.serve(deadline_ns.saturating_sub(SPIN_NS + QUIET_NS));
    let serving_ns = thread_cpu_ns() - cpu_ns;
    let asked_ns = deadline_ns - SPIN_NS;
    let wake = TimeSpec::from_duration(Duration::from_nanos(asked_ns));
    while clock_nanosleep(ClockId::CLOCK_MONOTONIC, ClockNanosleepFlags::TIMER_ABSTIME, &wake) == Err(Errno::EINTR) {}
    let (woken_ns, woken_cpu_ns) = (monotonic_ns(), clocks.now_ns());
    let began_ns = loop {
        let now_ns = monotonic_ns();
        if now_ns >= deadline_ns {
            break now_ns;
        }
        std::hint::spin_loop();
    };
    exchange.exchange(limit_ns);
    let ended_ns = monotonic_ns();
    let ran_ns = clocks.now_ns() - woken_cpu_ns;
    Cycle {
        exchange_ns: ended_ns - began_ns,
        done_ns: ended_ns - deadline_ns,
        // What this thread did itself in the time before is no one else's fault.
        woken_late_ns: woken_ns.saturating_sub(asked_ns + serving_ns),
        serving_ns,
        stolen_ns: (ended_ns - woken_ns).saturating_sub(ran_ns),
        skipped: 0,
    }
}

/// Cycles of all sides, in turns of `turn` cycles.
fn run_turns(
    sides: &mut [Box<dyn Exchange + Send + '_>],
    clocks: &Clocks,
    grid: Grid,
    cycles: usize,
    turn: usize,
) -> Vec<Vec<Cycle>> {
    let mut ran: Vec<Vec<Cycle>> = sides.iter().map(|_| Vec::with_capacity(cycles + turn)).collect();
    let mut deadline_ns = grid.first_after(monotonic_ns() + grid.period_ns);
    while ran[0].len() < cycles {
        for (exchange, ran) in sides.iter_mut().zip(&mut ran) {
            for _ in 0..turn {
                let mut cycle = run_cycle(
                    &mut **exchange,
                    clocks,
                    deadline_ns,
                    deadline_ns + grid.period_ns - SPIN_NS,
                );
                let next = grid.next(deadline_ns, monotonic_ns());
                (deadline_ns, cycle.skipped) = (next.deadline_ns, next.skipped);
                ran.push(cycle);
            }
        }
    }
    ran
}

/// The core, the threads and both wires, once for all.
pub(crate) struct Bench {
    process: Arc<Process>,
    tick_ns: u64,
}

impl Bench {
    /// Makes the namespace: before any thread is started.
    pub(crate) fn prepare() -> anyhow::Result<Bench> {
        private_wire("plk0", "plk1")?;
        add_wire("raw0", "raw1")?;
        let config = config::parse(MACHINE, Path::new("mill3-demo.toml"))?;
        let process = prepare_process(&config.rt)?;
        for finding in &process.findings {
            println!("warning            {finding}");
        }
        println!("core               {}, priority {}", process.cpu, process.priority);
        let probe = RawLink::open("plk0", RawConfig::default())?;
        println!("link               {}", probe.reception());
        Ok(Bench {
            process: Arc::new(process),
            tick_ns: u64::from(config.rt.timeout_us) * 1000,
        })
    }

    /// Boots `N` nodes and runs `cycles` cycles of ours and of the minimal loop, in turns. With `timeouts` the time-out
    /// thread of the control runs as well.
    #[expect(clippy::too_many_arguments, reason = "each is a knob of a bench")]
    pub(crate) fn run<const N: usize>(
        &self,
        link: BusLink,
        cycle_us: u32,
        pres_timeout_ns: u32,
        cycles: usize,
        turn: usize,
        place: Nodes,
        timeouts: bool,
    ) -> anyhow::Result<[Vec<Cycle>; 2]> {
        let watch = Arc::new(Watch::default());
        let ours = powerlink::<N>(link, cycle_us, pres_timeout_ns, place, &watch)?;
        let sides = vec![ours, minimal::<N>(place)?];
        let (ran, _) = self.in_turns(sides, &watch, cycle_us, cycles, turn, timeouts)?;
        ran.try_into().map_err(|_| anyhow!("two sides"))
    }

    /// Boots all sides and runs `cycles` cycles of each, in turns; and how long each took to come up, s.
    pub(crate) fn in_turns(
        &self,
        sides: Vec<Side<'_>>,
        watch: &Arc<Watch>,
        cycle_us: u32,
        cycles: usize,
        turn: usize,
        timeouts: bool,
    ) -> anyhow::Result<(Vec<Vec<Cycle>>, Vec<f64>)> {
        let period_ns = u64::from(cycle_us) * 1000;
        let (reports, _reports) = rtrb::RingBuffer::new(timeout::REPORTS);
        let stop = AtomicBool::new(false);
        let clocks = Clocks::default();
        let thread = |name: &str| std::thread::Builder::new().name(name.into()).stack_size(STACK_SIZE);
        let (mut exchanges, nodes): (Vec<_>, Vec<_>) =
            sides.into_iter().map(|side| (side.exchange, side.nodes)).unzip();
        std::thread::scope(|scope| {
            for (place, nodes) in nodes.into_iter().enumerate() {
                let Some(nodes) = nodes else { continue };
                let (stop, clocks) = (&stop, &clocks);
                thread("nodes").spawn_scoped(scope, move || {
                    drop(enter_thread(Role::Machine, &self.process));
                    clocks.register(place);
                    nodes(stop);
                })?;
            }
            let limits = Limits::new(period_ns, self.tick_ns, u32::MAX);
            let timeouts = timeouts
                .then(|| TimeoutThread::spawn(Arc::clone(&self.process), Arc::clone(watch), limits, reports, None))
                .transpose()?;
            let managing = thread("managing").spawn_scoped(scope, || {
                // Not as a thread of the control, which gives up the right to lock memory because it asks for none: nodes within it
                // and records do, and what could not be locked would not be had.
                drop(enter_core(self.process.cpu, self.process.priority));
                let grid = Grid {
                    period_ns,
                    phase_ns: 37_000,
                    late_max_ns: period_ns / 4,
                };
                let mut up_s = Vec::new();
                for exchange in &mut exchanges {
                    up_s.push(boot(&mut **exchange, &clocks, grid)?);
                }
                for exchange in &mut exchanges {
                    exchange.take_lost();
                }
                let ran = run_turns(&mut exchanges, &clocks, grid, cycles, turn);
                let lost: Vec<_> = exchanges.iter_mut().map(|exchange| exchange.take_lost()).collect();
                anyhow::Ok((ran, up_s, lost))
            })?;
            let ran = managing.join();
            stop.store(true, Ordering::Relaxed);
            drop(timeouts);
            let (ran, up_s, lost) = ran.map_err(|_| anyhow!("the thread of the cycle panicked"))??;
            if lost.iter().any(|(lost, _)| *lost > 0) {
                let lost: Vec<u64> = lost.iter().map(|(lost, _)| *lost).collect();
                println!("                   answers lost of each side, ours first: {lost:?}");
            }
            ensure!(lost.iter().all(|(_, wrong)| *wrong == 0), "wrong answers: {lost:?}");
            Ok((ran, up_s))
        })
    }
}

/// Our managing node with `N` nodes.
pub(crate) fn powerlink<const N: usize>(
    link: BusLink,
    cycle_us: u32,
    pres_timeout_ns: u32,
    place: Nodes,
    watch: &Arc<Watch>,
) -> anyhow::Result<Side<'static>> {
    let far = (RawLink::open("plk1", RawConfig::default())?, Responder::new(N));
    let (within, nodes): (_, Option<NodesThread<'static>>) = match place {
        Nodes::Within => (Some(far), None),
        Nodes::Above => (None, Some(Box::new(|stop: &AtomicBool| serve(far, stop)))),
    };
    let exchange: Box<dyn Exchange + Send> = match link {
        BusLink::Raw => {
            let config = RawConfig {
                spin_ns: ANSWER_SPIN_NS,
                ..RawConfig::default()
            };
            let link = RawLink::open("plk0", config)?;
            let mac = link.mac();
            ours::<_, N>(link, mac, within, cycle_us, pres_timeout_ns, watch)?
        }
        BusLink::Pnet => {
            let link = PnetLink::open("plk0", ANSWER_SPIN_NS)?;
            let mac = link.mac();
            ours::<_, N>(link, mac, within, cycle_us, pres_timeout_ns, watch)?
        }
    };
    Ok(Side { exchange, nodes })
}

fn ours<L: Link + Send + 'static, const N: usize>(
    near: L,
    mac: [u8; 6],
    far: Option<(RawLink, Responder)>,
    cycle_us: u32,
    pres_timeout_ns: u32,
    watch: &Arc<Watch>,
) -> anyhow::Result<Box<dyn Exchange + Send>> {
    let link = Near {
        near,
        far,
        buffer: [0; 1514],
    };
    // Kept as long as the process lives, once for each run.
    let nodes = node_configs(N, pres_timeout_ns).leak();
    let bus = Powerlink::<_, N>::new(mn_config(nodes, cycle_us, mac), link, Arc::clone(watch), wall_clock)?;
    let lengths = [PAYLOAD; N];
    Ok(Box::new(Ours {
        bus: Box::new(bus),
        outputs: OutputImage::new(lengths),
        inputs: InputImage::new(lengths),
        lost: 0,
    }))
}

/// The thread of the nodes.
fn serve((mut far, mut responder): (RawLink, Responder), stop: &AtomicBool) {
    let mut buffer = [0; 1514];
    while !stop.load(Ordering::Relaxed) {
        let deadline_ns = far.now_ns() + 50_000_000;
        answer(&mut far, &mut responder, &mut buffer, deadline_ns).expect("the interface is up");
    }
}

/// The minimal loop with `N` nodes.
fn minimal<const N: usize>(place: Nodes) -> anyhow::Result<Side<'static>> {
    let (far, answers): (_, Vec<Short>) = (Socket::open("raw1")?, (1..=N as u8).map(minimal::pres).collect());
    let (far, nodes): (_, Option<NodesThread<'static>>) = match place {
        Nodes::Within => (Some((far, answers)), None),
        Nodes::Above => {
            let nodes = move |stop: &AtomicBool| {
                while !stop.load(Ordering::Relaxed) {
                    answer_least(&far, &answers);
                }
            };
            (None, Some(Box::new(nodes)))
        }
    };
    let exchange = Box::new(Least {
        mn: Minimal::new(N),
        socket: Socket::open("raw0")?,
        far,
        lost: 0,
    });
    Ok(Side { exchange, nodes })
}

/// Until all nodes are operational; how long that took, s.
fn boot(exchange: &mut dyn Exchange, clocks: &Clocks, grid: Grid) -> anyhow::Result<f64> {
    let began_ns = monotonic_ns();
    let mut deadline_ns = grid.first_after(began_ns);
    while !exchange.is_up() {
        run_cycle(exchange, clocks, deadline_ns, deadline_ns + grid.period_ns - SPIN_NS);
        deadline_ns = grid.next(deadline_ns, monotonic_ns()).deadline_ns;
        ensure!(deadline_ns - began_ns < BOOT_LIMIT_NS, "not operational after 10 s");
    }
    Ok((monotonic_ns() - began_ns) as f64 / 1e9)
}

fn percentile(sorted: &[u64], share: f64) -> f64 {
    let at = ((sorted.len() - 1) as f64 * share) as usize;
    sorted[at] as f64 / 1000.0
}

pub(crate) fn median_p99_max(ran: &[Cycle]) -> [f64; 3] {
    let mut times: Vec<u64> = ran.iter().map(|cycle| cycle.exchange_ns).collect();
    times.sort_unstable();
    [0.5, 0.99, 1.0].map(|share| percentile(&times, share))
}

/// SoC to SoA on a relaxed cycle.
pub(crate) fn exchange<const N: usize>(bench: &Bench, cycle_us: u32, cycles: usize, goal: &str) {
    let arrangements = [
        (Nodes::Within, false, "in this thread"),
        (Nodes::Above, false, "in a thread above"),
        (Nodes::Above, true, "above, and time-outs"),
    ];
    for (place, timeouts, name) in arrangements {
        if timeouts && N > 32 {
            // In a virtual machine the ticks alone can take more than the cycle.
            continue;
        }
        let [ours, least] = match bench.run::<N>(BusLink::Raw, cycle_us, 5_000, cycles, 1, place, timeouts) {
            Ok(ran) => ran,
            Err(why) => {
                println!("SoC to SoA         {N:3} nodes {name}: {why:#}");
                continue;
            }
        };
        let (ours, least) = (median_p99_max(&ours), median_p99_max(&least));
        println!(
            "SoC to SoA         {N:3} nodes {name:20} median {:6.1} us, p99 {:6.1}, max {:7.1}; minimal {:6.1}, {:6.1}, \
             {:7.1}; ratio {:.2}{goal}",
            ours[0],
            ours[1],
            ours[2],
            least[0],
            least[1],
            least[2],
            ours[0] / least[0]
        );
    }
}

/// SoC to SoA over each link that a machine file can choose, in turns: the median of the rounds' medians.
pub(crate) fn links<const N: usize>(bench: &Bench, cycles: usize) {
    const ROUNDS: usize = 7;
    let mut medians_us = [[0.0; ROUNDS]; 2];
    for round in 0..ROUNDS {
        for (link, medians_us) in [BusLink::Raw, BusLink::Pnet].into_iter().zip(&mut medians_us) {
            match bench.run::<N>(link, 1000, 25_000, cycles, 1, Nodes::Within, false) {
                Ok([ours, _]) => medians_us[round] = median_p99_max(&ours)[0],
                Err(why) => return println!("link {link:?}          {N:3} nodes: {why:#}"),
            }
        }
    }
    let [raw_us, pnet_us] = medians_us.map(|mut medians_us| super::median(&mut medians_us));
    println!(
        "links              {N:3} nodes, {ROUNDS} rounds in turns: raw ring {raw_us:.1} us, pnet {pnet_us:.1} us, ratio {:.2}, {:.2} us \
         more a node",
        pnet_us / raw_us,
        (pnet_us - raw_us) / N as f64
    );
}

/// How many cycles are not over in time, and why.
pub(crate) fn shortest<const N: usize>(bench: &Bench, cycle_us: u32, pres_timeout_ns: u32, cycles: usize) {
    for (place, where_) in [(Nodes::Within, "in this thread"), (Nodes::Above, "in a thread above")] {
        let ran = bench.run::<N>(BusLink::Raw, cycle_us, pres_timeout_ns, cycles, 500, place, false);
        let ran = match ran {
            Ok(ran) => ran,
            Err(why) => {
                println!("cycle of {cycle_us:4} us   {N:3} nodes {where_}: {why:#}");
                continue;
            }
        };
        for (name, ran) in ["ours", "minimal"].into_iter().zip(&ran) {
            print_overruns(&format!("{N:3} nodes {where_:17} {name:7}"), cycle_us, ran);
        }
    }
}

pub(crate) fn print_overruns(name: &str, cycle_us: u32, ran: &[Cycle]) {
    let period_ns = u64::from(cycle_us) * 1000;
    let (mut own, mut woken, mut stolen, mut all) = (0, 0, 0, 0);
    for cycle in ran {
        let overruns = cycle.skipped + u64::from(cycle.skipped == 0 && cycle.done_ns > period_ns);
        all += 1 + cycle.skipped;
        // Would it have been in time without what others took?
        if cycle.done_ns.saturating_sub(cycle.woken_late_ns + cycle.stolen_ns) > period_ns {
            own += overruns;
            if overruns > 0 {
                println!(
                    "                   {overruns} overruns: over after {} us, of it {} us exchange; before {} us of serving, woken {} us \
                     late, others {} us",
                    cycle.done_ns / 1000,
                    cycle.exchange_ns / 1000,
                    cycle.serving_ns / 1000,
                    cycle.woken_late_ns / 1000,
                    cycle.stolen_ns / 1000
                );
            }
        } else if cycle.woken_late_ns > cycle.stolen_ns {
            woken += overruns;
        } else {
            stolen += overruns;
        }
    }
    let share = |count: u64| 100.0 * count as f64 / all as f64;
    let [median, p99, max] = median_p99_max(ran);
    println!(
        "cycle of {cycle_us:4} us   {name} {all} cycles: {:.3} % overrun by themselves (goal <= 0.1), {:.3} % woken late, \
         {:.3} % while others had the core; SoC to SoA median {median:.1} us, p99 {p99:.1}, max {max:.1}",
        share(own),
        share(woken),
        share(stolen),
    );
}
