//! A wire on virtual time between a managing node and the simulated machine.
//!
//! In:  frames of the managing node through [`Link`]; a seed; [`Disturbance`]s at given times.
//! Out: frames of the machine through [`Link`]; every frame to a tap (such as a pcap file).
//!
//! Time passes only in [`Link::receive`] and [`VirtualNet::advance`], by leaps from event to event. The same seed, calls
//! and machine make the same run, octet by octet.

use super::SimMachine;
use powerlink::link::simulated::{GAP_NS, Hub, Path, Station, Tap};
use powerlink::link::{Link, LinkError, Received};
use powerlink::wire::FRAME_LEN_MAX;
use std::collections::VecDeque;
use std::fmt;
use std::time::{Duration, Instant};

/// How the wire treats frames. Shares are from 0 to 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NetConfig {
    /// Start of all that is random.
    pub seed: u64,
    /// Least and greatest time from the end of a frame on the wire, with the gap after it, to its reception, ns.
    pub delay_ns: [u64; 2],
    /// Share of frames that get lost.
    pub loss: f64,
    /// Share of frames that arrive twice.
    pub duplicate: f64,
    /// Share of frames that are held back for up to `reorder_ns`, so that later ones may overtake them.
    pub reorder: f64,
    /// Longest time that a frame is held back, ns.
    pub reorder_ns: u64,
    /// Share of frames in which one bit is turned over unnoticed by the CRC.
    pub corrupt: f64,
}

impl NetConfig {
    /// A good wire: 2 to 5 µs of delay and no faults.
    pub fn clean(seed: u64) -> NetConfig {
        NetConfig {
            seed,
            delay_ns: [2_000, 5_000],
            loss: 0.0,
            duplicate: 0.0,
            reorder: 0.0,
            reorder_ns: 300_000,
            corrupt: 0.0,
        }
    }
}

/// What can be done to the machine at a time of choice. Node ids that are not in the machine file change nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Disturbance {
    /// The node's next PRes get lost.
    DropPres { node: u8, count: u32 },
    /// The node is switched off.
    PowerOff { node: u8 },
    /// The node is switched on again.
    PowerOn { node: u8 },
    /// The node's cable is pulled.
    Unplug { node: u8 },
    /// The node's cable is plugged in again.
    Plug { node: u8 },
    /// A fault inside a drive.
    DriveFault {
        node: u8,
        /// 603F.
        error_code: u16,
    },
    /// What is wired to the inputs 6000h/2 of an I/O node.
    Inputs { node: u8, wired: u8 },
}

/// The wire, seen by the managing node as its link.
pub struct VirtualNet {
    machine: SimMachine,
    config: NetConfig,
    hub: Hub,
    managing_node: Station,
    machine_station: Station,
    now_ns: u64,
    inbox: VecDeque<Vec<u8>>,
    /// Latest first.
    disturbances: Vec<(u64, Disturbance)>,
    /// What the calls of the managing node have taken of the PC's time; `None`: nobody asks.
    spent: Option<Duration>,
}

impl fmt::Debug for VirtualNet {
    /// The seed and the time: what a failing test has to show.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("VirtualNet")
            .field("config", &self.config)
            .field("now_ns", &self.now_ns)
            .finish_non_exhaustive()
    }
}

impl VirtualNet {
    /// The wire to a machine, at time 0.
    pub fn new(machine: SimMachine, config: NetConfig) -> VirtualNet {
        let [least_ns, greatest_ns] = config.delay_ns;
        let path = Path {
            delay_ns: 0,
            jitter_ns: greatest_ns.saturating_sub(least_ns),
            loss: config.loss,
            duplicate: config.duplicate,
            reorder: config.reorder,
            reorder_ns: config.reorder_ns,
            corrupt: config.corrupt,
            corrupt_octets: 0..FRAME_LEN_MAX,
        };
        let mut hub = Hub::new(config.seed);
        let managing_node = hub.attach(path.clone());
        // The way is between the hub and the machine, in both directions.
        let machine_station = hub.attach(Path {
            delay_ns: least_ns + GAP_NS,
            ..path
        });
        VirtualNet {
            machine,
            config,
            hub,
            managing_node,
            machine_station,
            now_ns: 0,
            inbox: VecDeque::new(),
            disturbances: Vec::new(),
            spent: None,
        }
    }

    /// The wire to a machine that is switched on at this time.
    pub fn starting_at(mut machine: SimMachine, config: NetConfig, now_ns: u64) -> VirtualNet {
        machine.switch_on(now_ns);
        VirtualNet {
            now_ns,
            ..VirtualNet::new(machine, config)
        }
    }

    /// From now on, what calls of the managing node take of the PC's own time is added up: a real wire takes none of it.
    pub fn time_calls(&mut self) {
        self.spent = Some(Duration::ZERO);
    }

    /// What they have taken since [`VirtualNet::time_calls`].
    pub fn spent(&self) -> Duration {
        self.spent.unwrap_or_default()
    }

    /// Time on the wire, ns.
    pub fn time_ns(&self) -> u64 {
        self.now_ns
    }

    /// The machine at the far end.
    pub fn machine(&self) -> &SimMachine {
        &self.machine
    }

    /// The machine at the far end, to do something to it now.
    pub fn machine_mut(&mut self) -> &mut SimMachine {
        &mut self.machine
    }

    /// Has something happen at a time; at once if the time is past.
    pub fn at(&mut self, at_ns: u64, disturbance: Disturbance) {
        let place = self.disturbances.partition_point(|(other_ns, _)| *other_ns > at_ns);
        self.disturbances.insert(place, (at_ns, disturbance));
    }

    /// Lets time pass while the managing node does not listen, as when its thread is late.
    pub fn advance(&mut self, duration_ns: u64) {
        let end_ns = self.now_ns + duration_ns;
        while self.next_event(end_ns) {}
        self.now_ns = end_ns;
    }

    /// Shows every frame on the wire to `tap`.
    pub fn set_tap(&mut self, tap: Tap) {
        self.hub.set_tap(tap);
    }

    /// Frames that got lost by chance so far.
    pub fn lost(&self) -> u64 {
        self.hub.lost()
    }

    /// Puts a frame of another station on the wire, to the managing node; one that no station could send is left out.
    pub fn inject(&mut self, frame: &[u8]) {
        let _ = self.hub.send(self.machine_station, self.now_ns, frame);
    }

    /// Runs the next event that is due by `limit_ns`; false if there is none.
    fn next_event(&mut self, limit_ns: u64) -> bool {
        let disturbance_ns = self.disturbances.last().map(|(at_ns, _)| *at_ns);
        let flight_ns = self.hub.next_ns();
        let poll_ns = self.machine.next_poll_ns();
        let next_ns = [disturbance_ns, flight_ns]
            .into_iter()
            .flatten()
            .fold(poll_ns, u64::min);
        if next_ns > limit_ns {
            return false;
        }
        self.now_ns = self.now_ns.max(next_ns);
        let now_ns = self.now_ns;
        let mut answers = Vec::new();
        let mut send = |frame: &[u8]| answers.push(frame.to_vec());
        if disturbance_ns == Some(next_ns) {
            if let Some((_, disturbance)) = self.disturbances.pop() {
                self.disturb(disturbance);
            }
        } else if flight_ns == Some(next_ns) {
            let mut buffer = [0; FRAME_LEN_MAX];
            if let Some(arrival) = self.hub.receive(next_ns, &mut buffer) {
                let frame = &buffer[..arrival.length];
                if arrival.to == self.managing_node {
                    self.inbox.push_back(frame.to_vec());
                } else {
                    self.machine.receive(now_ns, frame, &mut send);
                }
            }
        } else {
            self.machine.poll(now_ns, &mut send);
        }
        for answer in answers {
            self.inject(&answer);
        }
        true
    }

    fn timed<T>(&mut self, act: impl FnOnce(&mut VirtualNet) -> T) -> T {
        let began = self.spent.map(|_| Instant::now());
        let done = act(self);
        if let (Some(began), Some(spent)) = (began, &mut self.spent) {
            *spent += began.elapsed();
        }
        done
    }

    fn next_frame(&mut self, buffer: &mut [u8], deadline_ns: u64) -> Result<Option<Received>, LinkError> {
        let limit_ns = deadline_ns.max(self.now_ns);
        loop {
            if let Some(frame) = self.inbox.pop_front() {
                let length = frame.len().min(buffer.len());
                buffer[..length].copy_from_slice(&frame[..length]);
                return Ok(Some(Received {
                    length,
                    stamp_ns: Some(self.now_ns),
                }));
            }
            if !self.next_event(limit_ns) {
                self.now_ns = limit_ns;
                return Ok(None);
            }
        }
    }

    fn disturb(&mut self, disturbance: Disturbance) {
        let machine = &mut self.machine;
        match disturbance {
            Disturbance::DropPres { node, count } => machine.drop_pres(node, count),
            Disturbance::PowerOff { node } => machine.power_off(node),
            Disturbance::PowerOn { node } => machine.power_on(node),
            Disturbance::Unplug { node } => machine.plug(node, false),
            Disturbance::Plug { node } => machine.plug(node, true),
            Disturbance::DriveFault { node, error_code } => machine.raise_drive_fault(node, error_code),
            Disturbance::Inputs { node, wired } => machine.set_inputs(node, wired),
        };
    }
}

impl Link for VirtualNet {
    fn now_ns(&mut self) -> u64 {
        self.now_ns
    }

    fn send(&mut self, frame: &[u8]) -> Result<(), LinkError> {
        self.timed(|net| net.hub.send(net.managing_node, net.now_ns, frame).map(drop))
    }

    fn receive(&mut self, buffer: &mut [u8], deadline_ns: u64) -> Result<Option<Received>, LinkError> {
        self.timed(|net| net.next_frame(buffer, deadline_ns))
    }
}
