//! Days at the machine on virtual time: orders at random in any order, faults of drives, nodes and wire, power cuts, the emergency
//! stop chain, late cycles. Each day prints its seed; more of them: `ISOCNC_SEEDS=1000 cargo test -p isocnc --lib days`.
//!
//! Whatever happens: nothing moves unless drives are on and it was ordered; no limit is passed on any seam; every order is answered,
//! and every refusal says why; each alarm has a cause; a stop ends within its time; and afterwards the same part comes out, to the bit.

use super::clients::Clients;
use crate::console::Operator;
use crate::memory::Memory;
use crate::rehearsal::{Rehearsal, rehearse_with};
use crate::table_writer::Keeper;
use api::orders::{Jog, Jogged, Order, OrderClient, Source, order_channel};
use config::{self, Config};
use machine::sequence::{Outcome, Step};
use machine::state::State;
use machine::state_file::Remembered;
use machine::tables::{Tables, lock};
use motion::canon::{AXES, Axis, Position};
use program::text::Reader;
use rt::joint_jog::JogMotion;
use rt::overrides::Overridden;
use rt::shared::AtOnce;
use sim::{Disturbance, NetConfig};
use std::collections::BTreeMap;
use std::io::Read;
use std::path::Path;
use std::sync::Mutex;

/// Everything that a part of the demo machine can have; the first rapid move leads to its begin from anywhere.
const PART: &str = "G21 G90 G94 G54 G17 G64 P0.01 S1000\nG0 Z-5\nG0 X40 Y40\nG61\nM3\nG1 Z-8 F1200\nG64 P0.01\nG1 X60 F3000\nG3 X70 Y50 J10\n\
                    G1 Y60\nG1 X40\nG4 P0.05\nG1 Y40\nG1 Z-5\nM5\nM2\n";
/// The line from which on the part is the same wherever the machine came from.
const FROM_LINE: u32 = 6;
const LINES: [&str; 11] = [
    "G0 X10",
    "G91 G0 Y3",
    "G90 G1 X30 Y30 F900",
    "M3 S500",
    "G4 P0.2",
    "M0",
    "T2 M6",
    "G10 L20 P2 X1",
    "G1 X5000",
    "G38.3 Z-30 F600",
    "o1 call [",
];
/// Cycles of a day, less what follows it.
const CYCLES: u64 = 9_000;
/// Places of the same rest differ by this at the most, mm.
const ROUNDING_MM: f64 = 1e-12;
/// Cycles within which whatever moves comes to rest, and whatever is switched off is off.
const STOP_CYCLES: u64 = 5_000;
const TURN: u64 = 10;

/// Lines and places, bit by bit.
type Path3 = Vec<(u32, [u64; 3])>;

/// Numbers that are the same everywhere (SplitMix64).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut bits = self.0;
        bits = (bits ^ (bits >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        bits = (bits ^ (bits >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        bits ^ (bits >> 31)
    }

    fn below(&mut self, count: u64) -> u64 {
        self.next() % count
    }

    fn once_in(&mut self, times: u64) -> bool {
        self.below(times) == 0
    }

    fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }
}

struct Day<'r, 'a, 'scope, 'env> {
    run: &'r mut Rehearsal<'a>,
    clients: Clients<'scope, 'env>,
    keeper: Keeper<'scope, 'env>,
    tables: &'env Mutex<Tables>,
    client: &'env OrderClient,
    random: Random,
    story: Vec<String>,
    tickets: u64,
    /// Orders that have no answer yet.
    open: BTreeMap<u64, String>,
    state: State,
    place: Position,
    loads: [f64; 3],
    /// Cycles since the state was entered.
    since: u64,
    seen: BTreeMap<String, usize>,
    /// Places in the part, once it is its own.
    path: Path3,
}

impl Day<'_, '_, '_, '_> {
    fn note(&mut self, text: String) {
        let cycle = self.run.operator.live().cycles;
        self.story.push(format!("{cycle}: {text}"));
    }

    fn fails(&self, what: &str) -> ! {
        let story = self.story[self.story.len().saturating_sub(60)..].join("\n");
        let journal = self.run.operator.journal();
        let journal = &journal[journal.len().saturating_sub(25)..];
        let journal: Vec<String> = journal
            .iter()
            .map(|entry| format!("{:.3} {}", entry.time_s, entry.text))
            .collect();
        panic!("{what}\n{story}\n{}", journal.join("\n"));
    }

    fn put(&mut self, order: Order) -> u64 {
        self.tickets += 1;
        let word = format!("{order:?}");
        let word: String = word.chars().take(60).collect();
        self.note(format!("order {} {word}", self.tickets));
        if order != Order::Withdraw {
            self.open.insert(self.tickets, word);
        }
        let at_once = match order {
            Order::Hold => Some(AtOnce::Hold),
            Order::Stop => Some(AtOnce::Stop),
            Order::Estop => Some(AtOnce::Estop),
            _ => None,
        };
        let ticket = self.tickets;
        if let Some(what) = at_once {
            self.at_once(what);
        }
        self.client.put(ticket, order).expect("room for it");
        ticket
    }

    /// What the socket thread does; the service may take long to put the order behind it.
    fn at_once(&mut self, what: AtOnce) {
        self.note(format!("at once: {what:?}"));
        self.run.operator.shared().order(what);
        if self.random.once_in(3) {
            let held_up = self.random.below(300);
            self.rest(held_up);
        }
    }

    /// One turn of the operator's loop: the machine stands still while a text is checked, so that each run is the same.
    fn serve(&mut self) {
        loop {
            let now_ns = self.run.now_ns();
            let is_planning = self.run.is_planning();
            self.clients
                .serve(&mut self.run.operator, &mut self.keeper, is_planning, now_ns);
            if self.clients.checking.is_none() {
                break;
            }
            std::thread::yield_now();
        }
        if matches!(self.run.operator.step(), Step::Enable | Step::Home | Step::Program)
            && let Some(part) = self.clients.part()
        {
            let mut text = Vec::new();
            Reader::from(&*part.text).read_to_end(&mut text).expect("a text");
            // The run lends it to its planner: a few lines, some thousand times.
            let text: &'static [u8] = Box::leak(text.into_boxed_slice());
            let (begin, mdi) = (part.begin.clone(), part.is_mdi());
            self.run.set_program(text, lock(self.tables).clone(), begin, mdi);
        }
        if let Some((left, modes)) = self.run.take_left() {
            let completed = self.run.operator.program_outcome() == Some(Outcome::Completed);
            self.clients.adopt_modes(Some(modes).filter(|_| completed));
            lock(self.tables).adopt(left);
        }
        while let Some((ticket, answer)) = self.client.answer() {
            let word = self.open.remove(&ticket).unwrap_or_default();
            let word = word.split([' ', '(', '{']).next().unwrap_or_default().to_owned();
            match answer {
                Ok(_) => *self.seen.entry(format!("{word} done")).or_default() += 1,
                Err(error) => {
                    self.note(format!("{ticket} refused: {}", error.message));
                    if error.message.text.len() < 10 {
                        self.fails("a refusal without a reason");
                    }
                    *self.seen.entry(format!("{word} refused")).or_default() += 1;
                }
            }
        }
    }

    fn cycle(&mut self, late_ns: u64) {
        if self.run.operator.live().cycles.is_multiple_of(TURN) {
            self.serve();
        }
        self.run.cycle(late_ns).expect("no error of the rehearsal");
        let live = self.run.operator.live();
        if live.state != self.state {
            self.note(format!("{} -> {}", self.state.name(), live.state.name()));
            *self.seen.entry(live.state.name().to_owned()).or_default() += 1;
            self.since = 0;
        } else {
            self.since += 1;
        }
        let loads = [0, 1, 2].map(|joint| self.run.net().machine().joint_position_mm(joint).expect("a joint"));
        let moved = (0..3).any(|joint| (loads[joint] - self.loads[joint]).abs() > 1e-6);
        let is_off = matches!(
            live.state,
            State::Booting | State::Disabled | State::Faulted | State::Estop
        );
        if is_off && self.state == live.state && self.since > 1_000 && moved {
            self.fails(&format!("loads move with drives off: {:?} {loads:?}", self.loads));
        }
        self.loads = loads;
        let rests = matches!(live.state, State::Ready | State::Held);
        // Back on the path, its place is computed from the path again, and no longer from the joints.
        let off = |axis: usize| (live.position.0[axis] - self.place.0[axis]).abs() > ROUNDING_MM;
        if rests && self.state == live.state && self.since > 1 && (0..AXES).any(off) {
            self.fails(&format!(
                "{} moves from {:?} to {:?}",
                live.state.name(),
                self.place,
                live.position
            ));
        }
        if matches!(live.state, State::Stopping | State::Disabling) && self.since > STOP_CYCLES {
            self.fails(&format!("{} without an end", live.state.name()));
        }
        if matches!(live.state, State::Faulted | State::Estop)
            && self.since > 2 * TURN
            && self.run.operator.alarm().is_none()
        {
            self.fails("stopped without a cause");
        }
        (self.state, self.place) = (live.state, live.position);
    }

    fn rest(&mut self, cycles: u64) {
        for _ in 0..cycles {
            self.cycle(0);
        }
    }

    fn until(&mut self, what: &str, done: impl Fn(&mut Self) -> bool) {
        for _ in 0..40_000 {
            if done(self) {
                return;
            }
            self.cycle(0);
        }
        self.fails(&format!("never {what}"));
    }

    /// What somebody does who looks at the machine.
    fn fitting_order(&mut self) -> Order {
        let homed = self.run.operator.not_homed() == 0;
        match self.state {
            State::Estop => Order::EstopReset,
            State::Faulted => Order::Acknowledge,
            State::Disabled if self.random.once_in(2) => Order::On,
            State::Disabled => Order::Home(Vec::new()),
            State::Ready if !homed => Order::Home(Vec::new()),
            State::Ready => match self.random.below(5) {
                0 => self.jog(),
                1 => Order::Mdi(LINES[self.random.below(LINES.len() as u64) as usize].into()),
                2 => self.lines(),
                3 => Order::Run(part()),
                _ => Order::Start {
                    from_line: self.random.once_in(2).then(|| 5 + self.random.below(9) as u32),
                    yes: true,
                    runs: 1,
                    dry_feed_min: self.random.once_in(4).then_some(2000.0),
                    revision: None,
                },
            },
            State::Running => match self.random.below(7) {
                0..=2 => Order::Hold,
                3 => Order::ToolChanged,
                4 => Order::Skip,
                5 => Order::SingleBlock(self.random.once_in(3)),
                _ => Order::Resume,
            },
            State::Held => match self.random.below(5) {
                0 | 1 => self.jog(),
                2 => Order::Reverse(self.random.within(0.1, 1.0)),
                _ => Order::Resume,
            },
            State::Away => match self.random.below(3) {
                0 => self.jog(),
                _ => Order::Resume,
            },
            State::Jogging => self.jog(),
            State::Returning if self.random.once_in(3) => Order::Hold,
            _ => self.any_order(),
        }
    }

    /// Some lines that come one after the other, and now and then none but a wait.
    fn lines(&mut self) -> Order {
        let count = self.random.below(4);
        let lines = (0..count).map(|_| LINES[self.random.below(LINES.len() as u64) as usize].to_owned() + "\n");
        Order::Lines {
            text: lines.collect(),
            wait: self.random.once_in(2),
        }
    }

    fn jog(&mut self) -> Order {
        let velocity_mm_s = self.random.within(-150.0, 150.0);
        Order::Jog(Jog {
            what: match self.random.below(8) {
                0 => None,
                1 => Some(Jogged::Joint(self.random.below(4) as usize)),
                axis => Some(Jogged::Axis([Axis::X, Axis::Y, Axis::Z, Axis::A][axis as usize % 4])),
            },
            motion: match self.random.below(5) {
                0 => JogMotion::Release,
                1 => JogMotion::Keep,
                2 => JogMotion::Advance {
                    distance_mm: self.random.within(-20.0, 20.0),
                    velocity_mm_s,
                },
                _ => JogMotion::Run { velocity_mm_s },
            },
        })
    }

    fn any_order(&mut self) -> Order {
        match self.random.below(35) {
            0..=2 => Order::On,
            3 => Order::Off,
            4 => Order::Estop,
            5 | 6 => Order::EstopReset,
            7 | 8 => Order::Acknowledge,
            9 | 10 => Order::Home(match self.random.below(4) {
                0 => vec![self.random.below(4) as usize],
                _ => Vec::new(),
            }),
            11 => Order::Load(part()),
            12 => Order::Start {
                from_line: None,
                yes: false,
                runs: 1,
                dry_feed_min: None,
                revision: None,
            },
            13 => Order::Start {
                from_line: Some(1 + self.random.below(17) as u32),
                yes: self.random.once_in(2),
                runs: 1,
                dry_feed_min: None,
                revision: None,
            },
            14 | 15 => Order::Run(part()),
            18 => self.lines(),
            16..=17 => Order::Mdi(LINES[self.random.below(LINES.len() as u64) as usize].into()),
            19..=22 => self.jog(),
            23 | 24 => Order::Hold,
            25..=27 => Order::Resume,
            28 => Order::Reverse(self.random.within(0.1, 1.0)),
            29 => Order::SingleBlock(self.random.once_in(4)),
            30 => Order::ToolChanged,
            31 => Order::Skip,
            32 => Order::OptionalStop(self.random.once_in(2)),
            33 => Order::Start {
                from_line: None,
                yes: true,
                runs: 2,
                dry_feed_min: Some(self.random.within(1.0, 5000.0)),
                revision: None,
            },
            _ => Order::Stop,
        }
    }

    fn act(&mut self) {
        let order = match self.random.once_in(4) {
            true => self.any_order(),
            false => self.fitting_order(),
        };
        let ticket = self.put(order);
        if self.random.once_in(40) {
            self.note(format!("forsaken {ticket}"));
            assert!(self.client.withdraw(ticket));
            // Whether it has begun by then or not.
            self.open.remove(&ticket);
        }
    }

    fn disturb(&mut self) {
        let now_ns = self.run.now_ns();
        let node = [1, 2, 3, 10][self.random.below(4) as usize];
        let disturbance = match self.random.below(11) {
            0..=2 => Disturbance::DropPres {
                node,
                count: 1 + self.random.below(6) as u32,
            },
            3 => {
                let back_ns = now_ns + 1_000_000 * (50 + self.random.below(1500));
                self.run.net().at(back_ns, Disturbance::PowerOn { node });
                Disturbance::PowerOff { node }
            }
            4 => {
                let back_ns = now_ns + 1_000_000 * (1 + self.random.below(1500));
                self.run.net().at(back_ns, Disturbance::Plug { node });
                Disturbance::Unplug { node }
            }
            5 => Disturbance::DriveFault {
                node: 1 + self.random.below(3) as u8,
                error_code: 0x7305,
            },
            6 => {
                let closed = !self.random.once_in(3);
                return self.pin("iocontrol.0.emc-enable-in", closed);
            }
            7 => {
                let pin = ["joint.0.neg-lim-sw-in", "joint.2.pos-lim-sw-in"][self.random.below(2) as usize];
                let closed = self.random.once_in(3);
                return self.pin(pin, closed);
            }
            8 => {
                let on = self.random.once_in(3);
                return self.pin("motion.feed-hold", on);
            }
            9 => {
                let what = [Overridden::Feed, Overridden::Rapid][self.random.below(2) as usize];
                let percent = [0.0, 30.0, 100.0, 100.0][self.random.below(4) as usize];
                self.note(format!("{what:?} {percent}"));
                return self.run.operator.shared().overrides.set_percent(what, percent);
            }
            _ => {
                let late_ns = [200_000, 700_000, 1_500_000, 5_000_000][self.random.below(4) as usize];
                self.note(format!("{late_ns} ns late"));
                return self.cycle(late_ns);
            }
        };
        self.note(format!("{disturbance:?}"));
        self.run.net().at(now_ns, disturbance);
    }

    fn pin(&mut self, pin: &str, value: bool) {
        self.note(format!("{pin} {value}"));
        self.run.hal.set(pin, value).expect("a pin");
    }

    /// An order that has to be carried out.
    fn must(&mut self, order: Order) {
        let ticket = self.put(order);
        self.until("answered", |day| !day.open.contains_key(&ticket));
    }

    /// Whatever happened: what a person would do to get on, and the part.
    fn recover(&mut self) {
        self.note("recover".into());
        for pin in ["joint.0.neg-lim-sw-in", "joint.2.pos-lim-sw-in", "motion.feed-hold"] {
            self.pin(pin, false);
        }
        self.pin("iocontrol.0.emc-enable-in", true);
        for what in [Overridden::Feed, Overridden::Rapid] {
            self.run.operator.shared().overrides.set_percent(what, 100.0);
        }
        self.put(Order::SingleBlock(false));
        // Nodes that were cut come back by themselves.
        self.rest(4_000);
        self.must(Order::Stop);
        self.until("at rest", |day| {
            matches!(
                day.run.operator.live().state,
                State::Ready | State::Disabled | State::Faulted | State::Estop
            )
        });
        self.rest(50);
        // A drive that failed while it was off says so when it is switched on: at most twice round.
        for _ in 0..3 {
            match self.state {
                State::Estop => self.must(Order::EstopReset),
                State::Faulted => self.must(Order::Acknowledge),
                _ => self.must(Order::Home(Vec::new())),
            }
            self.rest(5 * TURN);
            self.until("standing by", |day| {
                let steady = matches!(
                    day.run.operator.live().state,
                    State::Ready | State::Disabled | State::Faulted | State::Estop
                );
                steady && day.run.operator.step() == Step::StandBy
            });
        }
        if self.run.operator.not_homed() != 0 || self.state != State::Ready {
            self.fails("not ready and homed");
        }
        self.part();
    }

    /// The part as a program of its own, place by place.
    fn part(&mut self) {
        let programs = self.run.operator.programs();
        self.rest(2 * TURN);
        self.must(Order::Run(part()));
        self.until("under way", |day| day.run.operator.programs() > programs);
        self.path.clear();
        for _ in 0..40_000 {
            self.cycle(0);
            let live = self.run.operator.live();
            if live.state == State::Running && live.line >= FROM_LINE {
                self.path
                    .push((live.line, [0, 1, 2].map(|axis| live.position.0[axis].to_bits())));
            }
            if live.state == State::Ready && self.run.operator.step() == Step::StandBy {
                break;
            }
        }
        // How long it waits for the spindle depends on what that did before.
        self.path.dedup();
        // The end of the rapid move is off by the rounding of its way.
        self.path.remove(0);
        if self.run.operator.program_outcome() != Some(Outcome::Completed) {
            self.fails("the part does not come to its end");
        }
    }
}

fn part() -> Source {
    Source::Text {
        name: "part".into(),
        text: PART.into(),
    }
}

fn machine() -> Config {
    let text = include_str!("../../../../configs/mill3-demo.toml");
    // Somebody confirms each tool.
    let net = text.find("[[hal.net]]\nname = \"tool-change-loop\"").expect("the net");
    let end = net + 2 + text[net + 2..].find("[[").expect("another one");
    let text = format!("{}{}", &text[..net], &text[end..]);
    let mut config = config::parse(&text, Path::new("demo.toml")).expect("a good machine file");
    config.bus.pres_lost_max = 3;
    config
}

/// A control that stands by, not up yet.
fn stand_by(config: &Config, seed: u64, act: impl FnOnce(&mut Day<'_, '_, '_, '_>)) {
    let tables = Mutex::new(Tables::read(config).expect("tables"));
    let (client, inbox) = order_channel();
    rehearse_with(config, b"", NetConfig::clean(seed), Operator::standing_by, |run| {
        std::thread::scope(|scope| {
            act(&mut Day {
                run,
                clients: Clients::new(scope, config, &tables, true, inbox),
                keeper: Keeper::new(scope, &tables, Memory::new(config, Remembered::default())),
                tables: &tables,
                client: &client,
                random: Random(seed),
                story: vec![format!("seed {seed}")],
                tickets: 0,
                open: BTreeMap::new(),
                state: State::Booting,
                place: Position::ZERO,
                loads: [f64::NAN; 3],
                since: 0,
                seen: BTreeMap::new(),
                path: Vec::new(),
            });
        });
        Ok(())
    })
    .expect("a rehearsal");
}

/// Lives a day; gives the part that comes out at its end, and what was seen.
fn live(config: &Config, seed: u64, disturbed: bool) -> (Path3, BTreeMap<String, usize>) {
    let mut lived = None;
    stand_by(config, seed, |day| {
        if disturbed {
            if !day.random.once_in(4) {
                // A day as it should begin.
                day.rest(1_500);
                day.must(Order::Home(Vec::new()));
                let until = day.random.below(6_000);
                day.rest(until);
            }
            let end = day.run.operator.live().cycles + CYCLES;
            while day.run.operator.live().cycles < end {
                match day.random.below(24) {
                    0 => day.disturb(),
                    1 => {
                        let cycles = day.random.below(1_500);
                        day.rest(cycles);
                    }
                    _ => day.act(),
                }
                let pause = day.random.below(120);
                day.rest(pause);
            }
        }
        day.recover();
        for (joint, peaks) in day.run.control.peaks().iter().enumerate() {
            if peaks.over != [0; 3] {
                day.fails(&format!("joint {joint} beyond its limits: {peaks:?}"));
            }
        }
        if !day.open.is_empty() {
            day.fails(&format!("no answer to {:?}", day.open));
        }
        lived = Some((std::mem::take(&mut day.path), std::mem::take(&mut day.seen)));
    });
    lived.expect("a day")
}

/// The service is held up behind the socket: the order itself comes a second later.
#[test]
fn a_stop_that_comes_before_its_order_ends_what_is_under_way_and_what_waits() {
    let config = machine();
    let home = |day: &mut Day<'_, '_, '_, '_>| {
        day.rest(1_500);
        day.must(Order::Home(Vec::new()));
        day.until("homed", |day| {
            day.run.operator.not_homed() == 0 && day.state == State::Ready
        });
    };
    stand_by(&config, 7, |day| {
        home(day);
        day.must(Order::Mdi("G1 X200 F1000".into()));
        let waiting = day.put(Order::Mdi("G1 Y100".into()));
        day.until("under way", |day| day.state == State::Running && day.place.0[0] > 2.0);
        let y = day.place.0[1];
        day.run.operator.shared().order(AtOnce::Stop);
        day.cycle(0);
        day.cycle(0);
        assert_ne!(day.state, State::Running);
        day.rest(1_000);
        assert_eq!((day.state, day.run.operator.step()), (State::Ready, Step::StandBy));
        assert!((day.place.0[1] - y).abs() < ROUNDING_MM && !day.open.contains_key(&waiting));
        // What is given behind the order is not taken for what was under way.
        day.put(Order::Stop);
        day.must(Order::Mdi("G0 Y5".into()));
        day.until("run", |day| day.state == State::Running);
        day.until("at rest", |day| day.state == State::Ready);
        assert!((day.place.0[1] - y).abs() > 1.0, "{:?} from {y}", day.place);
    });
    // A program that is to be run twice is neither counted nor begun again.
    stand_by(&config, 8, |day| {
        home(day);
        day.must(Order::Load(part()));
        let programs = day.run.operator.programs();
        day.must(Order::Start {
            revision: None,
            from_line: None,
            yes: false,
            runs: 2,
            dry_feed_min: None,
        });
        day.until("under way", |day| day.state == State::Running);
        // Held, it is at its end at once.
        day.run.operator.shared().order(AtOnce::Hold);
        day.until("held", |day| day.state == State::Held);
        day.run.operator.shared().order(AtOnce::Stop);
        day.rest(1_000);
        assert_eq!(day.run.operator.program_outcome(), Some(Outcome::Stopped));
        assert_eq!((day.state, day.run.operator.programs()), (State::Ready, programs + 1));
    });
}

#[test]
fn days_of_random_orders_faults_and_power_cuts_end_with_the_same_part() {
    let config = machine();
    let (part, _) = live(&config, 0, false);
    assert!(part.len() > 1_000, "{}", part.len());
    let seeds: u64 = std::env::var("ISOCNC_SEEDS")
        .ok()
        .and_then(|seeds| seeds.parse().ok())
        .unwrap_or(60);
    let first: u64 = std::env::var("ISOCNC_SEED")
        .ok()
        .and_then(|seed| seed.parse().ok())
        .unwrap_or(1);
    let next = Mutex::new(first..first + seeds);
    let seen = Mutex::new(BTreeMap::<String, usize>::new());
    std::thread::scope(|scope| {
        for _ in 0..2 {
            scope.spawn(|| {
                while let Some(seed) = next.lock().ok().and_then(|mut next| next.next()) {
                    println!("seed {seed}");
                    let (found, of_day) = live(&config, seed, true);
                    let differs = found.iter().zip(&part).position(|(found, part)| found != part);
                    assert!(
                        found.len() == part.len() && differs.is_none(),
                        "seed {seed}: another part: {} instead of {}, first {differs:?} {:?}",
                        found.len(),
                        part.len(),
                        differs.map(|at| (found[at], part[at]))
                    );
                    let mut seen = seen.lock().expect("the other thread goes on");
                    of_day
                        .into_iter()
                        .for_each(|(what, count)| *seen.entry(what).or_default() += count);
                }
            });
        }
    });
    let seen = seen.into_inner().expect("whole");
    println!("{seen:#?}");
    if seeds >= 50 {
        let words = "ready jogging homing running held away returning stopping estop faulted disabled booting";
        for state in words.split(' ') {
            assert!(seen.get(state).is_some_and(|count| *count > 5), "{state}");
        }
    }
}
