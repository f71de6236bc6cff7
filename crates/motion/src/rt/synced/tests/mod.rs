//! Threads and taps against a simulated spindle, on virtual time.

use super::*;
use crate::canon::Position;
use crate::element::Tap;
use crate::path::Piece;

mod programs;
pub(in crate::rt) mod spindle;
use spindle::{Spindle, Turning};

const CYCLE_S: f64 = 1e-3;
const LIMITS: MotionLimits = MotionLimits {
    velocity: 100.0,
    acceleration: 1000.0,
    jerk: 20_000.0,
};

fn thread(pitch_mm: f64, length_mm: f64) -> Synced {
    Synced {
        piece: Piece::line(Position::ZERO, Position::xyz(0.0, 0.0, -length_mm)).unwrap(),
        pitch_mm,
        limits: LIMITS,
        tap: None,
        turns_s: 10.0,
        line: 3,
    }
}

/// Greatest velocity, acceleration and jerk that differences of places show.
fn peaks(places: &[f64]) -> [f64; 3] {
    let mut peaks = [0.0f64; 3];
    for w in places.windows(4) {
        let d = [
            w[3] - w[2],
            w[3] - 2.0 * w[2] + w[1],
            w[3] - 3.0 * w[2] + 3.0 * w[1] - w[0],
        ];
        for (order, d) in (1..).zip(d) {
            peaks[order as usize - 1] = peaks[order as usize - 1].max(d.abs() / CYCLE_S.powi(order));
        }
    }
    peaks
}

fn keeps(places: &[f64], limits: &MotionLimits) {
    let [v, a, j] = peaks(places);
    assert!(v <= limits.velocity * (1.0 + 1e-9), "velocity {v}");
    assert!(a <= limits.acceleration * (1.0 + 1e-6), "acceleration {a}");
    assert!(j <= limits.jerk * (1.0 + 1e-4), "jerk {j}");
}

/// One pass.
struct Pass {
    /// By cycle, at rest at both ends.
    places: Vec<f64>,
    /// How far it was off the true angle in the cycles that it tracked, from [`SETTLE`] of them on, mm with sign.
    off_mm: Vec<f64>,
    follower: Follower,
}

/// Cycles of tracking after which what the ramp left over is gone.
const SETTLE: usize = 200;

fn run(spindle: &mut Spindle, synced: &Synced) -> Pass {
    let mut follower = Follower::new(CYCLE_S);
    // The spindle is known before.
    for _ in 0..100 {
        let feedback = spindle.step();
        follower.observe(&feedback);
    }
    follower.begin(synced);
    let mut pass = Pass {
        places: vec![0.0; 3],
        off_mm: Vec::new(),
        follower,
    };
    let mut tracked = 0;
    for _ in 0..60_000 {
        spindle.order(pass.follower.reversal());
        let feedback = spindle.step();
        let follower = &mut pass.follower;
        follower.observe(&feedback);
        follower.step(&feedback);
        pass.places.push(follower.place());
        if matches!(follower.phase, Phase::Tracking) {
            tracked += 1;
            if tracked > SETTLE {
                // Turns at which this place would be the beginning of the thread.
                let turns0 = spindle.turns() * follower.sense - follower.place() / synced.pitch_mm;
                pass.off_mm.push((turns0 - turns0.round()) * synced.pitch_mm);
            }
        }
        if follower.is_over() {
            break;
        }
    }
    assert!(pass.follower.is_over());
    pass.places.extend([pass.follower.place(); 3]);
    pass
}

const STEADY: Turning = Turning {
    turns_s: 10.0,
    acceleration: 40.0,
    ripple: 0.0,
    ripples_per_turn: 1.0,
    drop: 0.0,
    counts: 4096.0,
    seed: 1,
};

/// How far off the pitch tracking may be, mm: two counts of the encoder, and what is left of the spindle's own changes of speed.
///
/// Of jerk w, the observer (memory m) lags by `d2 w T` in acceleration, `d1 w T²` in speed, `d0 w T³` in place, and the law, with
/// n cycles as its time constant, follows these `n³ + 3 n² d2 + 3 n d1 + d0` cycles³ late. Of a step of acceleration it is
/// what that covers in both time constants.
fn allowed_mm(pitch_mm: f64, turning: &Turning) -> f64 {
    let speed = pitch_mm * turning.turns_s.abs();
    let wave = std::f64::consts::TAU * turning.ripples_per_turn * turning.turns_s.abs();
    let jerk = speed * turning.ripple * wave * wave;
    let step = speed * turning.drop / spindle::DROP_S;
    let (n, m) = (law::TAU_CYCLES, observer::MEMORY);
    let forget = 1.0 - m;
    let d2 = 1.5 * (1.0 + m) / forget;
    let d1 = (1.0 - m.powi(3)) / forget.powi(3) - d2 / 2.0;
    let d0 = (m / forget).powi(3);
    let lag = n.powi(3) + 3.0 * n * n * d2 + 3.0 * n * d1 + d0;
    2.0 * pitch_mm / turning.counts + jerk * lag * CYCLE_S.powi(3) + covered_mm(step)
}

/// What a step of acceleration covers, mm/s² to mm, before it is followed.
fn covered_mm(step: f64) -> f64 {
    let cycles = law::TAU_CYCLES + 1.0 / (1.0 - observer::MEMORY);
    step * (cycles * CYCLE_S).powi(2) / 2.0
}

fn worst(off_mm: &[f64]) -> f64 {
    off_mm.iter().fold(0.0, |worst, off| worst.max(off.abs()))
}

#[test]
fn threads_keep_their_pitch_and_every_limit() {
    let mut share = 0.0f64;
    for pitch in [0.5, 1.5, 3.0] {
        for (rpm, ripple, drop) in [
            (60.0, 0.0, 0.0),
            (300.0, 0.005, 0.02),
            (-1000.0, 0.0, 0.0),
            (1000.0, 0.005, 0.0),
            (1000.0, 0.003, 0.02),
            (1800.0, 0.001, 0.01),
        ] {
            let turns_s = rpm / 60.0f64;
            let turning = Turning {
                turns_s,
                ripple,
                drop,
                seed: rpm as u64 + 1,
                ..STEADY
            };
            let length = 1.5 * pitch * turns_s.abs() + 1.0;
            let pass = run(&mut Spindle::new(turning, CYCLE_S), &thread(pitch, length));
            keeps(&pass.places, &LIMITS);
            assert_eq!(
                (pass.follower.fault(), pass.follower.place()),
                (None, length),
                "{turning:?}"
            );
            assert!(pass.off_mm.len() > 300);
            let (off, allowed) = (worst(&pass.off_mm), allowed_mm(pitch, &turning));
            println!(
                "pitch {pitch}, {rpm} 1/min, ripple {ripple}, drop {drop}: off {off:.6} mm, allowed {allowed:.6} mm"
            );
            assert!(off <= allowed, "pitch {pitch}, {turning:?}: {off} > {allowed}");
            share = share.max(off / allowed);
        }
    }
    // The figure says something: at least once a good part of it is used.
    assert!(share > 0.3, "{share}");
}

#[test]
fn twenty_passes_are_in_phase_whatever_the_speed_and_the_limits() {
    for seed in 0..20u32 {
        let turns_s = 5.0 + 0.5 * f64::from(seed);
        let turning = Turning {
            turns_s,
            ripple: 0.002,
            drop: 0.02,
            seed: u64::from(seed) + 7,
            ..STEADY
        };
        let mut synced = thread(1.25, 25.0);
        synced.limits.acceleration = 300.0 + 100.0 * f64::from(seed);
        let pass = run(&mut Spindle::new(turning, CYCLE_S), &synced);
        keeps(&pass.places, &synced.limits);
        // `off_mm` is counted from a whole turn, so that this is the phase of the thread.
        let (off, allowed) = (worst(&pass.off_mm), allowed_mm(1.25, &turning));
        assert!(off <= allowed, "seed {seed}: {off} > {allowed}");
    }
}

fn tap(pitch_mm: f64, depth_mm: f64, run_down_mm: f64) -> Synced {
    Synced {
        tap: Some(Tap {
            depth_mm,
            return_scale: 1.5,
        }),
        ..thread(pitch_mm, depth_mm + run_down_mm)
    }
}

#[test]
fn a_tap_follows_the_spindle_through_its_reversal_and_comes_back_to_its_start() {
    for (seed, turns_s, pitch, acceleration) in [(3, 5.0, 1.0, 20.0), (4, 10.0, 1.25, 60.0), (5, -15.0, 0.7, 100.0)] {
        let turning = Turning {
            turns_s,
            acceleration,
            ripple: 0.002,
            drop: 0.01,
            seed,
            ..STEADY
        };
        let run_down = turns_s * turns_s / (2.0 * acceleration) * pitch;
        let synced = tap(pitch, 15.0, run_down + 1.0);
        let pass = run(&mut Spindle::new(turning, CYCLE_S), &synced);
        keeps(&pass.places, &LIMITS);
        assert_eq!(
            (pass.follower.fault(), pass.follower.place()),
            (None, 0.0),
            "{turning:?}"
        );
        assert_eq!(pass.follower.reversal(), None);
        let deepest = pass.places.iter().copied().fold(0.0, f64::max);
        let over_run = pass.follower.report().over_run_mm.unwrap();
        assert!((over_run - (deepest - 15.0)).abs() < 1e-9, "{over_run} {deepest}");
        assert!((deepest - 15.0 - run_down).abs() < 0.1 * pitch, "{deepest} {run_down}");
        // On the way back all is one and a half times as fast; begin and end of the reversal are steps of acceleration.
        let back = Turning {
            turns_s: 1.5 * turns_s,
            ..turning
        };
        let (off, allowed) = (
            worst(&pass.off_mm),
            allowed_mm(pitch, &back) + covered_mm(pitch * acceleration),
        );
        println!("tap {turns_s} 1/s, pitch {pitch}: off {off:.6} mm, allowed {allowed:.6} mm, deepest {deepest:.3} mm");
        assert!(off <= allowed, "{turning:?}: {off} > {allowed}");
    }
}

#[test]
fn a_thread_begins_only_once_the_spindle_is_slow_enough_to_be_followed() {
    // 75 mm/s where 70 can be.
    let mut synced = thread(3.0, 60.0);
    synced.limits.velocity = 70.0;
    let too_fast = |until: u32, slow: f64| {
        let mut turns = 0.0;
        move |cycle: u32, _: &mut Follower| {
            turns += if cycle < until { 25.0 } else { slow } * CYCLE_S;
            at(turns)
        }
    };
    let (follower, places) = against(&synced, too_fast(u32::MAX, 0.0));
    assert_eq!((follower.fault(), follower.place()), (Some(SyncFault::TooFast), 0.0));
    assert!((5000..5060).contains(&places.len()), "{}", places.len());
    let (follower, places) = against(&synced, too_fast(1000, 23.0));
    assert!(places[..1003].iter().all(|place| *place == 0.0));
    assert_eq!((follower.fault(), follower.place()), (None, 60.0));
    let report = follower.report();
    assert!(report.cycles_off == 0 && report.in_step_from_mm.is_some(), "{report:?}");
}

#[test]
fn a_spindle_too_fast_for_the_machine_breaks_the_pitch_and_no_limit() {
    let mut synced = thread(3.0, 60.0);
    synced.limits.velocity = 70.0;
    // From 63 mm/s to 75 in the work, 3 mm/s in each tenth of a second.
    let mut turns = 0.0;
    let (follower, _) = against(&synced, |cycle, _| {
        turns += (21.0 + 10.0 * (f64::from(cycle.min(700)) * CYCLE_S - 0.3).max(0.0)) * CYCLE_S;
        at(turns)
    });
    assert_eq!((follower.fault(), follower.place()), (None, 60.0));
    let report = follower.report();
    assert!(report.cycles_off > 300 && report.deviation_mm > 1.0, "{report:?}");
    // Ripple that would take more jerk than there is, at a speed that the machine has.
    let turning = Turning {
        turns_s: 25.0,
        ripple: 0.05,
        ripples_per_turn: 2.0,
        ..STEADY
    };
    let pass = run(&mut Spindle::new(turning, CYCLE_S), &thread(3.0, 60.0));
    keeps(&pass.places, &LIMITS);
    assert!(pass.follower.report().cycles_off > 10 || pass.follower.report().in_step_from_mm.is_none());
}

/// Runs a move against any feedback; the cycles it took.
fn against(synced: &Synced, mut feedback: impl FnMut(u32, &mut Follower) -> SpindleFeedback) -> (Follower, Vec<f64>) {
    let mut follower = Follower::new(CYCLE_S);
    follower.begin(synced);
    let mut places = vec![0.0; 3];
    for cycle in 0..20_000 {
        let feedback = feedback(cycle, &mut follower);
        follower.observe(&feedback);
        follower.step(&feedback);
        places.push(follower.place());
        if follower.is_over() {
            places.extend([follower.place(); 3]);
            keeps(&places, &synced.limits);
            return (follower, places);
        }
    }
    panic!("no end: {follower:?}");
}

fn at(turns: f64) -> SpindleFeedback {
    SpindleFeedback { turns, indexed: true }
}

#[test]
fn what_a_spindle_does_not_do_is_a_fault_by_name_and_ends_at_rest() {
    let move_ = thread(1.0, 30.0);
    let (follower, places) = against(&move_, |cycle, _| SpindleFeedback {
        turns: 0.01 * f64::from(cycle),
        indexed: false,
    });
    assert_eq!((follower.fault(), follower.place()), (Some(SyncFault::NoIndex), 0.0));
    assert!((5000..5010).contains(&places.len()));
    let (follower, _) = against(&move_, |_, _| at(0.3));
    assert_eq!(
        (follower.fault(), follower.place()),
        (Some(SyncFault::SpindleStands), 0.0)
    );
    // Stops in the middle of the thread.
    let (follower, _) = against(&move_, |cycle, _| at(0.01 * f64::from(cycle.min(1500))));
    assert_eq!(follower.fault(), Some(SyncFault::SpindleStands));
    assert!(follower.place() > 10.0 && follower.place() < 15.0);
    // NaN.
    let (follower, _) = against(&move_, |cycle, _| {
        at(if cycle < 1000 {
            0.01 * f64::from(cycle)
        } else {
            f64::NAN
        })
    });
    assert_eq!(follower.fault(), Some(SyncFault::NoNumber));
    assert!(follower.place() > 5.0 && follower.place() < 10.0);
    // Goes on turning where a tap is to come back.
    let (follower, _) = against(&tap(1.0, 5.0, 2.0), |cycle, _| at(0.01 * f64::from(cycle)));
    assert_eq!(
        (follower.fault(), follower.place()),
        (Some(SyncFault::NotReversed), 7.0)
    );
}

#[test]
fn given_up_a_thread_rests_where_it_can_and_a_tap_comes_out_of_the_work() {
    let (follower, _) = against(&thread(1.0, 30.0), |cycle, follower| {
        if cycle == 1000 {
            follower.give_up();
        }
        at(0.01 * f64::from(cycle))
    });
    assert_eq!(follower.fault(), Some(SyncFault::Aborted));
    assert!(follower.place() > 5.0 && follower.place() < 10.0);
    let mut turns = 0.0;
    let (follower, places) = against(&tap(1.0, 20.0, 5.0), |cycle, follower| {
        if cycle == 1000 {
            follower.give_up();
        }
        turns += follower.reversal().map_or(0.005, |scale| -0.005 * scale);
        at(turns)
    });
    assert_eq!((follower.fault(), follower.place()), (Some(SyncFault::Aborted), 0.0));
    assert!(places.iter().copied().fold(0.0, f64::max) < 10.0);
}
