//! What is wrong with a command does not leave: jumps, what is no number, steps of speed, frozen and doubled set-points, behind the
//! kinematics and in the ring, in every state, on both buses. Judged are the set-points in the frames.

use super::*;
use ::ethercat::wire::{Command as Datagram, Frame, MAC_PASSED};
use isocnc::rt::joint_jog::{JogMotion, JogOrder};
use motion::element::{Auxiliary, Element, Enables, Span};
use motion::path::Piece;
use std::sync::atomic::{AtomicBool, Ordering};

const ETHERCAT: &str = include_str!("../../configs/mill3-ethercat.toml");
/// Octets of the outputs of a drive, of which the last four are its set-point (607A); POWERLINK has them behind its header.
const OUTPUTS: usize = 11;
const PREQ_PAYLOAD: usize = 24;
/// On EtherCAT a drive has a datagram of its own, with as many octets as the greater of its directions.
const IMAGE: usize = 17;
const COUNTS_PER_MM: f64 = 10_000.0;
/// The joint whose commands are wrong.
const JOINT: usize = 0;

/// What happens to the commands of a joint.
#[derive(Clone, Copy, Debug)]
enum Wrong {
    Jump(f64),
    NotANumber,
    Infinite,
    Frozen,
    Doubled,
    Speed(f64),
    /// To and fro: each other cycle.
    Noise(f64),
}

const ALL: [Wrong; 8] = [
    Wrong::Jump(0.5),
    Wrong::Jump(-90.0),
    Wrong::NotANumber,
    Wrong::Infinite,
    Wrong::Frozen,
    Wrong::Doubled,
    Wrong::Speed(400.0),
    Wrong::Noise(0.3),
];

impl Wrong {
    /// The command in place of `now`, `cycles` after it began; `before`: of the cycle before, and the last one that was right.
    fn command(self, now: f64, cycles: u64, [before, right]: [f64; 2]) -> f64 {
        match self {
            Wrong::Jump(by) => now + by,
            Wrong::NotANumber => f64::NAN,
            Wrong::Infinite => f64::NEG_INFINITY,
            Wrong::Frozen => right,
            Wrong::Doubled => now + (now - before),
            Wrong::Speed(by) => now + by * CYCLE_S * (cycles + 1) as f64,
            Wrong::Noise(by) if cycles.is_multiple_of(2) => now + by,
            Wrong::Noise(by) => now - by,
        }
    }
}

/// Once `begun` says so, commands of the joint are wrong.
fn tamper(run: &mut Rehearsal<'_>, wrong: Wrong, begun: &Arc<AtomicBool>) {
    let begun = Arc::clone(begun);
    let (mut cycles, mut before, mut right) = (0, 0.0, 0.0);
    run.control.tamper_with_commands(Box::new(move |commands| {
        let now = commands[JOINT];
        if begun.load(Ordering::Relaxed) {
            commands[JOINT] = wrong.command(now, cycles, [before, right]);
            cycles += 1;
        } else {
            right = now;
        }
        before = now;
    }));
}

/// Set-points of the drives in frames as they leave, in mm from the first: one row a cycle.
type Sent = Arc<Mutex<Vec<[f64; 3]>>>;

fn listen(run: &mut Rehearsal<'_>, ethercat: bool) -> Sent {
    let sent: Sent = Arc::default();
    let sink = Arc::clone(&sent);
    let mut row = [0.0; 3];
    let target = |octets: &[u8]| {
        let octets: [u8; 4] = octets[OUTPUTS - 4..OUTPUTS].try_into().expect("four octets");
        f64::from(i32::from_le_bytes(octets)) / COUNTS_PER_MM
    };
    run.net().set_tap(Box::new(move |_, octets| {
        let mut sent = sink.lock().expect("one thread");
        if ethercat {
            let Ok(frame) = Frame::parse(octets) else { return };
            let images = frame
                .datagrams()
                .filter(|it| it.command == Datagram::Lrw && it.data.len() == IMAGE);
            let targets: Vec<f64> = images.map(|it| target(it.data)).collect();
            if let (Ok(targets), true) = (targets.try_into(), octets[6] & MAC_PASSED == 0) {
                sent.push(targets);
            }
            return;
        }
        // A PReq to a drive.
        if octets[12..15] == [0x88, 0xAB, 0x03] && (1..=3).contains(&octets[15]) {
            let joint = usize::from(octets[15]) - 1;
            row[joint] = target(&octets[PREQ_PAYLOAD..]);
            if joint == 2 {
                sent.push(row);
            }
        }
    }));
    sent
}

/// Limits of stops hold in every set-point from the row `from` on; what they round to is an increment.
fn judge(name: &str, sent: &Sent, from: usize, config: &Config) {
    let sent = sent.lock().expect("one thread");
    assert!(sent.len() > from + 2, "{name}: {} rows", sent.len());
    let increment = 1.0 / COUNTS_PER_MM;
    for (joint, limits) in config.joints.iter().enumerate() {
        for (row, window) in sent[from - 3..].windows(3).enumerate() {
            let [a, b, c] = [0, 1, 2].map(|k: usize| window[k][joint]);
            let v = ((c - b).abs() - increment) / CYCLE_S;
            let acceleration = ((c - 2.0 * b + a).abs() - 2.0 * increment) / CYCLE_S.powi(2);
            assert!(
                v <= 1.01 * limits.limits.velocity_mm_s,
                "{name}: joint {joint}, row {row}: {v} mm/s, {window:?}"
            );
            assert!(
                acceleration <= 1.01 * limits.stop.acceleration_mm_s2,
                "{name}: joint {joint}, row {row}: {acceleration} mm/s², {window:?}"
            );
            let [low, high] = limits.travel_mm;
            // The frames count from the home point.
            let span = high - low;
            assert!(
                (c - sent[from - 3][joint]).abs() <= span,
                "{name}: joint {joint}, row {row}: beyond the travel"
            );
        }
    }
}

/// What the machine is at.
#[derive(Clone, Copy, Debug, PartialEq)]
enum At {
    Ready,
    Jogging,
    Running,
    Held,
    Stopping,
}

fn bring(run: &mut Rehearsal<'_>, at: At) {
    match at {
        At::Running => reach_midst(run),
        At::Held => {
            reach_midst(run);
            run.operator.give(Command::Hold);
            reach_state(run, State::Held);
        }
        At::Stopping => {
            reach_midst(run);
            run.operator.give(Command::Stop);
            reach_state(run, State::Stopping);
        }
        At::Ready | At::Jogging => {
            reach_midst(run);
            run.operator.give(Command::Stop);
            reach_state(run, State::Ready);
            if at == At::Jogging {
                run.operator.give(Command::Jog(JogOrder {
                    acceleration_share: 1.0,
                    unhomed: false,
                    joints: 1 << JOINT,
                    axis: None,
                    motion: JogMotion::Run { velocity_mm_s: 60.0 },
                }));
                reach(run, "jogging at speed", |run| run.operator.live().velocity_mm_s > 55.0);
            }
        }
    }
}

/// A wrong command in this state: no frame shows it, and the alarm names the joint.
fn holds(ethercat: bool, at: At, wrong: Wrong) {
    let name = format!("{} {at:?} {wrong:?}", if ethercat { "EtherCAT" } else { "POWERLINK" });
    let text = if ethercat { ETHERCAT } else { MACHINE };
    let mut config = config::parse(text, Path::new("machine.toml")).expect("a good machine file");
    config.bus.pres_lost_max = 3;
    rehearse_on(&config, NetConfig::clean(77), PART, |run| {
        let begun = Arc::new(AtomicBool::new(false));
        let sent = listen(run, ethercat);
        tamper(run, wrong, &begun);
        bring(run, at);
        let row = sent.lock().expect("one thread").len();
        begun.store(true, Ordering::Relaxed);
        let faulted = |run: &mut Rehearsal<'_>| run.control.state() == State::Faulted;
        let faulted = run.run_until(400, faulted).expect("no end of it");
        let _ = run.run_until(5, |_| false);
        let alarms = run.operator.alarms();
        // What does not move is not moved by these.
        let is_none = matches!(wrong, Wrong::Frozen | Wrong::Doubled) && matches!(at, At::Ready | At::Held);
        if is_none {
            assert_eq!(alarms, [], "{name}");
        } else {
            assert!(faulted, "{name}: {:?}\n{}", run.control.state(), journal(run));
            assert!(
                alarms[0].cause.text.starts_with("axis X (joint 0): command"),
                "{name}: {alarms:?}"
            );
        }
        judge(&name, &sent, row, &config);
    });
}

#[test]
fn a_wrong_command_leaves_in_no_state_on_powerlink() {
    for at in [At::Ready, At::Jogging, At::Running, At::Held, At::Stopping] {
        for wrong in ALL {
            holds(false, at, wrong);
        }
    }
}

#[test]
fn a_wrong_command_leaves_in_no_state_on_ethercat() {
    for at in [At::Running, At::Jogging] {
        for wrong in ALL {
            holds(true, at, wrong);
        }
    }
}

/// Elements that lead from a place along X, with something wrong in their midst.
fn elements(start: Position, wrong: usize) -> Vec<Element> {
    let at = |mm: f64| {
        let mut place = start;
        place[Axis::X] += mm;
        place
    };
    let span = |piece: Piece, s0: f64, v0: f64, a0: f64, jerk: f64, duration_s: f64, line: u32| {
        Element::Span(Span {
            piece,
            s0,
            v0,
            a0,
            jerk,
            gradient: 0.0,
            duration_s,
            line,
            rapid: false,
            enables: Enables::INITIAL,
            auxiliary: Auxiliary::INITIAL,
            modes: 0,
        })
    };
    let line = |from: f64, to: f64| Piece::line(at(from), at(to)).expect("a line");
    let way = line(0.0, 40.0);
    // To 20 mm/s in 40 ms, and on.
    let mut plan = vec![
        span(way, 0.0, 0.0, 0.0, 25_000.0, 0.02, 1),
        span(way, 0.1 / 3.0, 5.0, 500.0, 0.0, 0.02, 1),
        span(way, 0.7 / 3.0, 15.0, 500.0, -25_000.0, 0.02, 1),
    ];
    let here = 0.6;
    plan.push(span(way, here, 20.0, 0.0, 0.0, 0.1, 2));
    match wrong {
        // The next piece begins elsewhere.
        0 => plan.push(span(line(5.0, 45.0), 0.0, 20.0, 0.0, 0.0, 0.5, 3)),
        // Its speed is another one.
        1 => plan.push(span(way, here + 2.0, 120.0, 0.0, 0.0, 0.2, 3)),
        // It stands at once.
        2 => plan.push(Element::Dwell { seconds: 0.5, line: 3 }),
        // It goes back.
        3 => plan.push(span(line(here + 2.0, 0.0), 0.0, 20.0, 0.0, 0.0, 0.1, 3)),
        // It is no number.
        4 => plan.push(span(way, here + 2.0, f64::NAN, 0.0, 0.0, 0.2, 3)),
        // It runs into the end of the travel.
        _ => plan.push(span(line(here + 2.0, 900.0), 0.0, 20.0, 0.0, 0.0, 40.0, 3)),
    }
    plan.push(Element::Dwell { seconds: 0.1, line: 4 });
    plan
}

#[test]
fn a_wrong_plan_leaves_no_wrong_set_point() {
    for wrong in 0..6 {
        let config = machine();
        rehearse_part(NetConfig::clean(78), PART, |run| {
            let sent = listen(run, false);
            bring(run, At::Ready);
            let row = sent.lock().expect("one thread").len();
            let (mut producer, consumer) = motion::ring::channel(64);
            let start = run.operator.live().position;
            motion::ring::Sink::publish(&mut producer, &elements(start, wrong), &[]);
            let program = Interpolator::new(consumer, start, stop_ramp(&config));
            run.operator.give(Command::Start {
                program: Box::new(program),
                mdi: false,
            });
            let faulted = run
                .run_until(60_000, |run| run.control.state() == State::Faulted)
                .expect("no end");
            assert!(faulted, "wrong {wrong}: {:?}\n{}", run.control.state(), journal(run));
            let cause = run.operator.alarms()[0].cause.text.clone();
            assert!(
                cause.starts_with("axis X (joint 0): command") && cause.ends_with(": line 3"),
                "{wrong}: {cause}"
            );
            judge(&format!("ring {wrong}"), &sent, row, &config);
            let sent = sent.lock().expect("one thread");
            let [.., before, last] = &sent[..] else {
                panic!("no frames")
            };
            assert_eq!(before, last, "wrong {wrong}: at rest");
        });
    }
}
