//! Gantries, compensation, joysticks and tool carousels.

use super::{Random, about, model, pins};
use crate::rig::{Rig, T};

#[test]
fn machine() {
    // Joints go with the axis, but for those that wait at their switch; an offset changes only then.
    model::<(Option<f64>, Vec<f64>, bool)>(
        "gantry",
        &[("personality", 3)],
        &[("search-vel", -1.0, -1.0)],
        |(before, offsets, home), r| {
            offsets.resize(3, 0.0);
            let switches = pins(r, 3, |n| format!("joint.{n:02}.home"));
            *home = if *home {
                switches.contains(&1.0)
            } else {
                !switches.contains(&0.0)
            };
            let moved = r.number("position-cmd") - before.unwrap_or(r.number("position-cmd"));
            for (offset, switch) in offsets.iter_mut().zip(&switches) {
                if moved < 0.0 && !*home && *switch > 0.0 {
                    *offset += moved;
                }
            }
            *before = Some(r.number("position-cmd"));
            for (n, offset) in offsets.iter().enumerate() {
                about(r.number(&format!("joint.{n:02}.offset")), *offset);
                about(
                    r.number(&format!("joint.{n:02}.pos-cmd")),
                    r.number("position-cmd") - offset,
                );
            }
            assert_eq!((r.bit("home"), r.bit("limit")), (*home, switches.contains(&1.0)));
            let shown = (0..3).any(|n| {
                (r.number("position-fb") - r.number(&format!("joint.{n:02}.pos-fb")) - offsets[n]).abs() < 1e-9
            });
            assert!(shown);
        },
    );
    model::<f64>(
        "thermal_compensation",
        &[],
        &[
            ("temperature", 15.0, 40.0),
            ("reference", 20.0, 20.0),
            ("coefficient", 1e-5, 1e-5),
            ("position", 0.0, 900.0),
            ("maxv", 2.0, 2.0),
        ],
        |offset, r| {
            let length = r.number("position") - r.number("fixed-point");
            let wanted = if r.bit("enable") {
                1e-5 * (20.0 - r.number("temperature")) * length
            } else {
                0.0
            };
            let most = r.number("max").max(0.0);
            let target = wanted.clamp(-most, most);
            about(
                (target - r.number("offset")).abs(),
                ((target - *offset).abs() - 0.002).max(0.0),
            );
            assert_eq!(r.bit("limited"), wanted.abs() > most);
            *offset = r.number("offset");
        },
    );
    let stick = [
        ("in", -1.2, 1.2),
        ("power", 1.0, 4.0),
        ("deadband", 0.0, 0.5),
        ("scale", 1.0, 5.0),
        ("offset", 0.0, 1.0),
    ];
    model::<Vec<[f64; 6]>>("joyhandle", &[], &stick, |seen, r| {
        let (x, out) = (r.number("in"), r.number("out"));
        let full = r.number("scale") + r.number("offset");
        assert!(out.abs() <= full + 1e-9);
        match x.abs() {
            x if x <= r.number("deadband") => assert_eq!(out, 0.0),
            x if x >= 1.0 => about(out.abs(), full),
            _ => assert!(out * x >= 0.0),
        }
        // Farther out is more.
        let settings = ["power", "deadband", "scale", "offset"].map(|pin| r.number(pin));
        if !r.bit("inverse") {
            for [x0, out0, a, b, c, d] in seen.iter() {
                assert!([*a, *b, *c, *d] != settings || (x - x0) * (out - out0) >= -1e-9);
            }
            let [a, b, c, d] = settings;
            seen.push([x, out, a, b, c, d]);
        }
    });
    model::<f64>(
        "conv_float_s32",
        &[],
        &[("in", -5e9, 5e9), ("clamp", 1.0, 1.0)],
        |_, r| {
            assert_eq!(
                r.number("out"),
                r.number("in").trunc().clamp(-2_147_483_648.0, 2_147_483_647.0)
            );
            assert_eq!(r.bit("out-of-range"), r.number("in").trunc() != r.number("out"));
        },
    );
}

/// The carousel turns as it is told, a pocket every five calls, and its sensors say where it is.
#[test]
fn a_carousel_finds_every_pocket_by_the_shorter_way() {
    for (encoding, sensors) in [(0, 4), (1, 4), (2, 8), (3, 12), (4, 2)] {
        let mut random = Random(encoding as u64 + 7);
        let mut rig = Rig::new(
            "carousel",
            &[("pockets", 12), ("encoding", encoding), ("num_sense", sensors)],
        );
        // The first call makes no edge.
        rig.update(T);
        // In fifths of a pocket; 0 is pocket 1.
        let mut place = 20i64;
        for _ in 0..60 {
            let wanted = (random.next() % 12) as i64 + 1;
            let start = place;
            let homed = rig.bit("homed");
            rig.set("pocket-number", wanted as i32);
            rig.set("enable", true);
            let mut travelled = 0;
            for call in 0.. {
                assert!(call < 200, "{encoding}: pocket {wanted} is never found");
                let at_pocket = place.rem_euclid(5) == 0;
                let pocket = (place + 2).div_euclid(5).rem_euclid(12) + 1;
                let bcd = pocket / 10 * 16 + pocket % 10;
                let code = match encoding {
                    0 => pocket ^ pocket >> 1,
                    1 => pocket,
                    2 => bcd,
                    3 => i64::from(at_pocket) << (pocket - 1),
                    _ => i64::from(pocket == 1 && at_pocket) | i64::from(at_pocket) << 1,
                };
                for sensor in 0..sensors {
                    rig.set(&format!("sense-{sensor}"), code >> sensor & 1 != 0);
                }
                // Sensors of numbers are read at the pocket.
                rig.set("strobe", encoding >= 3 || at_pocket);
                rig.update(T);
                assert!(!(rig.bit("motor-fwd") && rig.bit("motor-rev")));
                let step = i64::from(rig.bit("motor-fwd")) - i64::from(rig.bit("motor-rev"));
                if rig.bit("ready") {
                    assert_eq!((pocket, at_pocket), (wanted, true), "{encoding}");
                    break;
                }
                place += step;
                travelled += step.abs();
            }
            if homed {
                let ahead = (5 * (wanted - 1) - start).rem_euclid(60);
                assert_eq!(travelled, ahead.min(60 - ahead), "{encoding}: from {start} to {wanted}");
            }
            rig.set("enable", false);
            rig.update(T);
            assert!(!rig.bit("ready") && !rig.bit("active"));
        }
    }
}
