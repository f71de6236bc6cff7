//! The program of a measurement where none is given: a pocket of a hundred thousand short lines and arcs.
//!
//! In:  the travel of the machine, a number of blocks.
//! Out: program text, the same for the same machine; it begins and ends where the machine stands after homing.

use config::Config;
use motion::canon::Axis;
use program::home;
use std::f64::consts::TAU;
use std::fmt::Write;

/// Its name in reports.
pub const NAME: &str = "generated pocket";
/// Blocks of the usual one: some minutes of motion at the feed of a fast machine.
pub const BLOCKS: usize = 100_000;

/// Share of the travel that is used.
const REACH: f64 = 0.7;
/// Share of the slowest axis' velocity that is the feed: the rest is for corners and for the sum of axes.
const FEED: f64 = 0.4;
/// Lines of one rose.
const ROSE: usize = 3000;
/// Petals of the rose: k of r = cos(k·φ); even, so that it has 2k of them.
const PETALS: f64 = 8.0;
/// Arcs of one row of loops.
const LOOPS: usize = 500;

/// The machine lacks what the program needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the machine has no axes X, Y and Z for the generated program; give one with --program")]
pub struct NoAxes;

/// What of an axis is used, mm in G54, and its velocity.
struct Room {
    middle: f64,
    half: f64,
    home: f64,
    velocity_mm_s: f64,
}

fn room(config: &Config, axis: Axis) -> Option<Room> {
    let map = config.axes.iter().find(|map| map.axis == axis)?;
    let joint = &config.joints[*map.joints.first()?];
    let [low, high] = joint.travel_mm;
    let offset = config.work_offsets[0][axis];
    Some(Room {
        middle: (low + high) / 2.0 - offset,
        half: REACH * (high - low) / 2.0,
        home: home(config)[axis] - offset,
        velocity_mm_s: joint.limits.velocity_mm_s,
    })
}

/// A program of about this many blocks for a machine: roses of short lines that rise and fall, and rows of loops of half
/// arcs between them.
///
/// # Errors
/// [`NoAxes`]
pub fn pocket(config: &Config, blocks: usize) -> Result<String, NoAxes> {
    let axis = |axis| room(config, axis).ok_or(NoAxes);
    let (x, y, z) = (axis(Axis::X)?, axis(Axis::Y)?, axis(Axis::Z)?);
    let radius = x.half.min(y.half);
    let feed_mm_min = 60.0
        * FEED
        * [&x, &y, &z]
            .into_iter()
            .fold(f64::INFINITY, |least, axis| least.min(axis.velocity_mm_s));
    let mut text = String::with_capacity(32 * blocks + 400);
    // Writing to a string does not fail.
    let mut put = |line: std::fmt::Arguments<'_>| {
        let _ = text.write_fmt(line);
        text.push('\n');
    };
    put(format_args!(
        "(a pocket of short lines and arcs: a load for measurements)"
    ));
    put(format_args!("G21 G90 G91.1 G17 G94 G54 G64 P0.01"));
    put(format_args!("G0 X{:.3} Y{:.3}", x.middle + radius, y.middle));
    put(format_args!("G0 Z{:.3}", z.middle));
    put(format_args!("F{feed_mm_min:.0}"));
    let mut left = blocks;
    while left > 0 {
        let lines = left.min(ROSE);
        for line in 1..=lines {
            let phi = TAU * line as f64 / ROSE as f64;
            let r = radius * (PETALS * phi).cos();
            put(format_args!(
                "G1 X{:.4} Y{:.4} Z{:.4}",
                x.middle + r * phi.cos(),
                y.middle + r * phi.sin(),
                z.middle + 0.05 * z.half * (3.0 * phi).sin()
            ));
        }
        left -= lines;
        if left == 0 {
            break;
        }
        // A row of loops across the pocket and back: each loop is two half circles, the second one a little wider.
        let arcs = left.min(LOOPS);
        let (wide, step) = (0.1 * radius, 1.6 * radius / LOOPS as f64);
        put(format_args!(
            "G1 X{:.4} Y{:.4} Z{:.4}",
            x.middle - 0.8 * radius,
            y.middle,
            z.middle
        ));
        let mut at = x.middle - 0.8 * radius;
        for arc in 0..arcs {
            let there = arc % 2 == 0;
            let to = if there { at + wide } else { at - wide + 2.0 * step };
            put(format_args!("G3 X{to:.4} Y{:.4} I{:.4} J0", y.middle, (to - at) / 2.0));
            at = to;
        }
        left -= arcs;
        put(format_args!("G1 X{:.4} Y{:.4}", x.middle + radius, y.middle));
    }
    put(format_args!("G0 Z{:.3}", z.home));
    put(format_args!("G0 X{:.3} Y{:.3}", x.home, y.home));
    put(format_args!("M2"));
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::*;
    use machine::tables::Tables;
    use motion::cancel::Cancel;
    use program::check;
    use std::path::Path;

    fn tables(config: &Config) -> Tables {
        Tables::read(config).unwrap()
    }

    const MACHINE: &str = include_str!("../../../configs/mill3-demo.toml");

    fn machine() -> Config {
        config::parse(MACHINE, Path::new("mill3-demo.toml")).unwrap()
    }

    #[test]
    fn it_fits_the_machine_and_comes_home() {
        let config = machine();
        let text = pocket(&config, 8_000).unwrap();
        assert_eq!(text, pocket(&config, 8_000).unwrap());
        let lines: Vec<&str> = text.lines().collect();
        let moves = |word: &str| lines.iter().filter(|line| line.starts_with(word)).count();
        assert!((7_990..8_030).contains(&(moves("G1") + moves("G3"))), "{}", lines.len());
        assert_eq!(moves("G3"), 2 * LOOPS);
        let overview = check(
            &config,
            &tables(&config),
            NAME,
            text.as_bytes(),
            &program::Begin::at_home(&config),
            &Cancel::default(),
        )
        .unwrap();
        assert_eq!(overview.lines as usize, lines.len());
        assert!(overview.time_s > 30.0, "{overview:?}");
        // Home is X0 Y0 Z0 of the machine, so minus the offset in G54.
        assert_eq!(lines[lines.len() - 3..], ["G0 Z60.000", "G0 X-20.000 Y-20.000", "M2"]);
    }

    #[test]
    fn any_number_of_blocks_is_a_program() {
        let config = machine();
        for blocks in [0, 1, ROSE, ROSE + 1, ROSE + LOOPS, ROSE + LOOPS + 1] {
            let text = pocket(&config, blocks).unwrap();
            check(
                &config,
                &tables(&config),
                NAME,
                text.as_bytes(),
                &program::Begin::at_home(&config),
                &Cancel::default(),
            )
            .unwrap_or_else(|errors| panic!("{blocks} blocks: {errors}"));
        }
    }

    #[test]
    fn a_machine_without_the_axes_is_told_so() {
        let mut config = machine();
        config.axes.retain(|map| map.axis != Axis::Z);
        assert_eq!(pocket(&config, 10), Err(NoAxes));
    }
}
