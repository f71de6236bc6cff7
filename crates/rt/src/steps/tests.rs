use super::*;
use crate::local_drive::plans;
use bus::plan::NodePlan;
use cia402::State;
use cia402::profile::state;
use host::step_port::StepPort;
use std::path::Path;
use std::sync::Mutex;

const PLOTTER: &str = include_str!("../../../../configs/plotter2-steps.toml");

/// The lines of the first joint, as a driver of a motor sees them.
#[derive(Default)]
struct Seen {
    before: u32,
    position: i64,
    pulses: u64,
    /// When its step line rose last, and the shortest time between two of them.
    rose_ns: u64,
    shortest_ns: Option<u64>,
    off_the_grid: u64,
    refuses: bool,
}

impl Seen {
    fn see(&mut self, now_ns: u64, levels: u32) {
        let rises = levels & !self.before & 1 == 1;
        self.before = levels;
        if !rises {
            return;
        }
        self.position += if levels >> 1 & 1 == 1 { 1 } else { -1 };
        self.pulses += 1;
        self.off_the_grid += u64::from(!now_ns.is_multiple_of(50_000));
        let distance_ns = now_ns - self.rose_ns;
        if self.rose_ns != 0 {
            self.shortest_ns = Some(
                self.shortest_ns
                    .map_or(distance_ns, |shortest| shortest.min(distance_ns)),
            );
        }
        self.rose_ns = now_ns;
    }
}

struct Recorder(Arc<Mutex<Seen>>);

impl StepPort for Recorder {
    fn write(&mut self, now_ns: u64, levels: u32) -> bool {
        let mut seen = self.0.lock().unwrap();
        seen.see(now_ns, levels);
        !seen.refuses
    }

    fn pulse(&mut self, now_ns: u64, levels: u32, pulses: u32, _pulse_ns: u64) -> bool {
        self.write(now_ns, levels ^ pulses) && self.write(now_ns, levels)
    }
}

/// The first joint of the plotter, told by hand what to do.
struct Rig {
    drives: StepDrives,
    seen: Arc<Mutex<Seen>>,
    inputs: InputImage,
    outputs: OutputImage,
    now_ns: u64,
    position: i32,
}

impl Rig {
    fn new(text: &str) -> Rig {
        let config = config::parse(text, Path::new("plotter2-steps.toml")).unwrap();
        let mut drives = StepDrives::new(&config);
        let seen = Arc::new(Mutex::new(Seen::default()));
        drives.set_port(Box::new(Recorder(Arc::clone(&seen))));
        let plans: Vec<NodePlan> = plans(&config).collect();
        Rig {
            drives,
            seen,
            inputs: InputImage::new(plans.iter().map(|plan| plan.inputs.octets)),
            outputs: OutputImage::new(plans.iter().map(|plan| plan.outputs.octets)),
            now_ns: 1_000_000,
            position: 0,
        }
    }

    /// One cycle; gives the statusword.
    fn cycle(&mut self, controlword: u16, mode: i8, target: i32) -> u16 {
        let mut payload = [0; 7];
        payload[..2].copy_from_slice(&controlword.to_le_bytes());
        payload[2] = mode as u8;
        payload[3..].copy_from_slice(&target.to_le_bytes());
        self.outputs.node_mut(0).copy_from_slice(&payload);
        self.drives.read(self.now_ns, &mut self.inputs);
        self.drives.write(&self.outputs);
        self.now_ns += 1_000_000;
        let payload = self.inputs.payload.node(0);
        self.position = i32::from_le_bytes(payload[3..7].try_into().unwrap());
        u16::from_le_bytes([payload[0], payload[1]])
    }

    fn enable(&mut self) {
        for word in [0x0006, 0x0007, 0x000F, 0x000F] {
            self.cycle(word, 8, self.position);
        }
        assert_eq!(
            state(self.cycle(0x000F, 8, self.position)),
            Some(State::OperationEnabled)
        );
    }

    fn seen(&self) -> std::sync::MutexGuard<'_, Seen> {
        self.seen.lock().unwrap()
    }
}

/// Pulses that end within their tick come at 20 kHz, others at 10.
fn brief() -> String {
    let text = PLOTTER.replace("length_ticks = 1", "length_ticks = 0");
    assert_ne!(text, PLOTTER);
    text.replace("velocity_mm_s = 100.0", "velocity_mm_s = 250.0")
}

#[test]
fn no_step_of_ten_million_is_lost() {
    const PULSES: u64 = 10_000_000;
    for (text, per_cycle, shortest_ns) in [(PLOTTER.to_owned(), 10, 100_000), (brief(), 20, 50_000)] {
        let mut rig = Rig::new(&text);
        rig.enable();
        // Up and down through 32 bits, at any rate up to the greatest, by a generator of its own.
        let (mut place, mut random) = (0_i64, 0x9E37_79B9_7F4A_7C15_u64);
        let mut up = true;
        while rig.seen().pulses < PULSES / 2 {
            for _ in 0..10_000 {
                random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                let parts = (random >> 33) as i64 % (per_cycle * i64::from(SUBSTEPS) + 1);
                place += if up { parts } else { -parts };
                if place.abs() > 1 << 30 {
                    up = !up;
                }
                rig.cycle(0x000F, 8, place as i32);
            }
        }
        for _ in 0..10 {
            rig.cycle(0x000F, 8, place as i32);
        }
        // A step is made as its middle is passed.
        let wanted = (place + i64::from(SUBSTEPS) / 2).div_euclid(i64::from(SUBSTEPS));
        let seen = rig.seen();
        assert_eq!((seen.position, seen.off_the_grid), (wanted, 0));
        assert_eq!(seen.shortest_ns, Some(shortest_ns));
        drop(seen);
        assert_eq!(rig.position, (wanted * i64::from(SUBSTEPS)) as i32);
    }
}

#[test]
fn it_goes_through_the_states_of_the_profile() {
    let mut rig = Rig::new(PLOTTER);
    let states = |rig: &mut Rig, word: u16| {
        rig.cycle(word, 8, rig.position);
        state(rig.cycle(word, 8, rig.position)).unwrap()
    };
    for (word, expected) in [
        (0x0000, State::SwitchOnDisabled),
        (0x0007, State::SwitchOnDisabled),
        (0x0006, State::ReadyToSwitchOn),
        (0x000F, State::SwitchedOn),
        (0x0007, State::SwitchedOn),
        (0x000F, State::OperationEnabled),
        (0x0007, State::SwitchedOn),
        (0x0006, State::ReadyToSwitchOn),
        (0x0002, State::SwitchOnDisabled),
    ] {
        assert_eq!(states(&mut rig, word), expected, "{word:#06X}");
    }
}

#[test]
fn a_quick_stop_comes_to_rest_by_the_ramp_of_stops_and_is_off() {
    let mut rig = Rig::new(PLOTTER);
    rig.enable();
    // 100 mm/s; stops with 2000 mm/s²: 2 mm/s a cycle, 50 cycles, 2.5 mm.
    let per_cycle = 8 * SUBSTEPS as i32;
    for cycle in 1..=100 {
        rig.cycle(0x000F, 8, cycle * per_cycle);
    }
    let begun = rig.position;
    let mut cycles = 0;
    while state(rig.cycle(0x0002, 8, 0)) != Some(State::SwitchOnDisabled) {
        cycles += 1;
        assert!(cycles < 100);
    }
    assert!((49..=52).contains(&cycles), "{cycles}");
    let way_mm = f64::from(rig.position - begun) / f64::from(80 * SUBSTEPS);
    assert!((2.4..=2.8).contains(&way_mm), "{way_mm}");
    let rests = rig.position;
    for _ in 0..10 {
        rig.cycle(0x0000, 8, 0);
    }
    assert_eq!(rig.position, rests);
}

#[test]
fn power_cut_ends_pulses_at_once() {
    let mut rig = Rig::new(PLOTTER);
    rig.enable();
    for cycle in 1..=100 {
        rig.cycle(0x000F, 8, cycle * 8 * SUBSTEPS as i32);
    }
    rig.cycle(0x0000, 8, 0);
    rig.cycle(0x0000, 8, 0);
    let pulses = rig.seen().pulses;
    for _ in 0..10 {
        rig.cycle(0x0000, 8, 0);
    }
    assert_eq!(rig.seen().pulses, pulses);
}

#[test]
fn it_is_homed_where_it_stands() {
    let mut rig = Rig::new(PLOTTER);
    rig.enable();
    for cycle in 1..=20 {
        rig.cycle(0x000F, 8, cycle * 1000);
    }
    rig.cycle(0x000F, 8, 20_000);
    let place = rig.position;
    assert_ne!(place, 0);
    rig.cycle(0x000F, 6, place);
    assert_eq!(rig.cycle(0x000F, 6, place) & 0x1000, 0);
    rig.cycle(0x001F, 6, place);
    assert_eq!(rig.cycle(0x001F, 6, place) & 0x1400, 0x1400);
    assert_eq!(rig.position, 0);
    let pulses = rig.seen().pulses;
    rig.cycle(0x000F, 8, 0);
    rig.cycle(0x000F, 8, 0);
    assert_eq!((rig.seen().pulses, rig.position), (pulses, 0));
}

#[test]
fn a_port_that_takes_no_levels_is_a_fault_and_no_pulse_follows() {
    let mut rig = Rig::new(PLOTTER);
    rig.enable();
    for cycle in 1..=20 {
        rig.cycle(0x000F, 8, cycle * 8 * SUBSTEPS as i32);
    }
    rig.seen().refuses = true;
    rig.cycle(0x000F, 8, 21 * 8 * SUBSTEPS as i32);
    assert_eq!(state(rig.cycle(0x000F, 8, 0)), Some(State::Fault));
    let payload = rig.inputs.payload.node(0);
    assert_eq!(u16::from_le_bytes([payload[7], payload[8]]), drive::ERROR_PORT);
    rig.cycle(0x000F, 8, 0);
    let pulses = rig.seen().pulses;
    // Not even a reset helps: how many pulses are missing nobody knows.
    for word in [0x0000, 0x0080, 0x0006, 0x0007, 0x000F] {
        assert_eq!(state(rig.cycle(word, 8, 0)), Some(State::Fault));
    }
    assert_eq!(rig.seen().pulses, pulses);
}

#[test]
fn a_cycle_without_a_target_is_a_pause_and_counted() {
    let mut rig = Rig::new(PLOTTER);
    rig.enable();
    for cycle in 1..=20 {
        rig.cycle(0x000F, 8, cycle * 8 * SUBSTEPS as i32);
    }
    assert_eq!(rig.drives.pauses(), 0);
    // Behind them, cycles in which nobody writes.
    for _ in 0..3 {
        rig.drives.read(rig.now_ns, &mut rig.inputs);
        rig.now_ns += 1_000_000;
    }
    assert_eq!(rig.drives.pauses(), 1, "it rests from then on");
    for cycle in 21..=30 {
        rig.cycle(0x000F, 8, cycle * 8 * SUBSTEPS as i32);
    }
    rig.cycle(0x000F, 8, 30 * 8 * SUBSTEPS as i32);
    assert_eq!(rig.seen().position, 240);
}
