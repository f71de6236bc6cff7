//! Many seeds, many cycles, all kinds of trouble; after each spell of it everything has to run again by itself.
//!
//! The ordinary test takes a few seeds. All of them, about as long as a coffee break:
//! `ISOCNC_SEEDS=200 ISOCNC_CYCLES=100000 cargo test -p isocnc-powerlink --release --test all endurance`
//! A seed that fails is printed with the command that repeats it.

use std::env;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread;

use powerlink::link::simulated::SplitMix64;

use super::weather::Weather;
use super::world::{Setup, World};

/// Longest time until everything runs again once the trouble is over, in cycles: a node that was refused (because a damaged
/// IdentResponse showed a wrong identity) is looked at again after 5 s.
const RECOVERY_CYCLES: u64 = 8_000;

fn number(name: &str, default: u64) -> u64 {
    env::var(name).map_or(default, |text| {
        text.parse()
            .unwrap_or_else(|_| panic!("{name}={text}: expected a number"))
    })
}

/// A network and its trouble, all of it from the seed.
fn endure(seed: u64, cycles: u64) -> World {
    let mut random = SplitMix64::new(seed);
    let mut setup = Setup::new(seed, 1 + random.below(4) as u8);
    setup.optional = (0..random.below(2)).map(|index| 110 + index as u8).collect();
    setup.pres_threshold = [0, 15, 40][random.below(3) as usize];
    let mut world = World::new(&setup);
    // Trouble begins before the boot, or after it.
    if random.below(2) == 0 {
        world.run_until_operational(RECOVERY_CYCLES);
    }
    while world.cycle < cycles {
        let weather = Weather::ALL[random.below(Weather::ALL.len() as u64) as usize];
        weather.begin(&mut world, &mut random);
        for _ in 0..100 + random.below(900) {
            weather.cycle(&mut world, &mut random);
            world.cycle();
        }
        Weather::end(&mut world);
        // A node that was just switched on again is still thought to run.
        world.run(20);
        world.run_until_operational(RECOVERY_CYCLES);
        world.check_data();
        world.run(random.below(200));
        world.events.clear();
    }
    world
}

#[test]
fn nothing_breaks_the_rules_and_nothing_stays_broken() {
    let first = number("ISOCNC_SEED", 1);
    let seeds = number("ISOCNC_SEEDS", 8);
    let cycles = number("ISOCNC_CYCLES", 5_000);
    let next = AtomicU64::new(first);
    let seen = Mutex::new([0; 6]);
    thread::scope(|scope| {
        for _ in 0..thread::available_parallelism().map_or(1, usize::from).min(4) {
            scope.spawn(|| {
                loop {
                    let seed = next.fetch_add(1, Ordering::Relaxed);
                    if seed >= first + seeds {
                        return;
                    }
                    match catch_unwind(AssertUnwindSafe(|| endure(seed, cycles))) {
                        Ok(world) => {
                            let mut seen = seen.lock().unwrap();
                            for (sum, figure) in seen.iter_mut().zip(figures(&world)) {
                                *sum += figure;
                            }
                        }
                        Err(panic) => {
                            eprintln!(
                                "seed {seed}: ISOCNC_SEED={seed} ISOCNC_SEEDS=1 ISOCNC_CYCLES={cycles} cargo test -p \
                                 isocnc-powerlink --test all endurance"
                            );
                            resume_unwind(panic)
                        }
                    };
                }
            });
        }
    });
    let seen = seen.into_inner().unwrap();
    println!("cycles, lost PRes, faults of nodes, boots, unreadable frames, cycles left out: {seen:?}");
    assert!(seen[0] >= seeds * cycles);
    if seeds >= 8 && cycles >= 5_000 {
        assert!(
            seen.iter().all(|figure| *figure > 0),
            "a kind of trouble that never came"
        );
    }
}

/// Cycles, lost PRes, faults of nodes, boots, unreadable frames, cycles left out.
fn figures(world: &World) -> [u64; 6] {
    let mut figures = [
        world.cycle,
        0,
        0,
        0,
        world.mn.counters().malformed.total(),
        world.mn.counters().cycles_skipped,
    ];
    for index in 0..world.devices.len() {
        let statistics = world.mn.statistics(index);
        figures[1] += statistics.pres_lost;
        figures[2] += statistics.faults;
        figures[3] += statistics.boots;
    }
    figures
}

#[test]
fn a_seed_makes_one_run() {
    let figures = |world: World| {
        (
            world.now_ns,
            figures(&world),
            *world.mn.counters(),
            *world.mn.statistics(0),
        )
    };
    assert_eq!(figures(endure(5, 2_000)), figures(endure(5, 2_000)));
}
