//! Sensors of the simulated machine: what closes where the loads are.
//!
//! In:  positions of the loads. Out: inputs of I/O nodes.

use config::{Config, HomingBy, JOINTS_MAX, SimBody, SimJoint, SimOutline, SimProbe, SimSurface};
use motion::canon::{Axis, Position};
use motion::kinematics::{Kinematics, ToolFrame};

/// First input that something can be wired to: bit 0 of 6000h/2.
const WIRED: u8 = 8;

/// A home switch of a joint, closed from its place on.
#[derive(Clone, Copy, Debug)]
struct HomeSwitch {
    joint: usize,
    /// The axis on which it is mounted where joints are belts, which pull two of them.
    axis: Option<Axis>,
    at_mm: f64,
    /// It is closed above its place, else below.
    above: bool,
    node: usize,
    input: u8,
}

/// All sensors of a machine.
#[derive(Debug)]
pub(super) struct Sensors {
    kinematics: Kinematics,
    probe: Option<SimProbe>,
    home_switches: Box<[HomeSwitch]>,
}

impl Sensors {
    /// `None`: the machine has none.
    pub(super) fn new(config: &Config) -> Option<Sensors> {
        let home_switch = |special: &SimJoint| {
            let (node, input) = special.input?;
            let HomingBy::Control(control) = config.joints[special.joint].homing.by else {
                return None;
            };
            let belts = config.belts().into_iter().flatten().zip([Axis::X, Axis::Y]);
            let mut of_joint = belts.filter(|(belt, _)| *belt == special.joint);
            Some(HomeSwitch {
                joint: special.joint,
                axis: of_joint.next().map(|(_, axis)| axis),
                at_mm: special.switch_mm.unwrap_or(control.switch_mm),
                above: control.towards_positive,
                node,
                input,
            })
        };
        let sensors = Sensors {
            kinematics: config.kinematics(),
            probe: config.sim.probe.clone(),
            home_switches: config.sim.joints.iter().filter_map(home_switch).collect(),
        };
        (sensors.probe.is_some() || !sensors.home_switches.is_empty()).then_some(sensors)
    }

    /// Whether the probe has changed on the way of the loads from one place to another, all of them evenly: after which share of
    /// the way, and whether it is closed then.
    ///
    /// RT: no allocation, no locks.
    pub(super) fn touch(&self, from_mm: &[f64], to_mm: &[f64]) -> Option<(f64, bool)> {
        /// Of halving: far below an increment.
        const STEPS: u32 = 30;
        let probe = self.probe.as_ref()?;
        let is_closed = |share: f64| {
            let mut loads_mm = [0.0; JOINTS_MAX];
            for (load_mm, (from_mm, to_mm)) in loads_mm.iter_mut().zip(from_mm.iter().zip(to_mm)) {
                *load_mm = from_mm + share * (to_mm - from_mm);
            }
            let place = self.kinematics.forward(&ToolFrame::OFF, &loads_mm[..to_mm.len()]);
            place.is_some_and(|place| touches(probe, &place))
        };
        let closed = is_closed(1.0);
        if is_closed(0.0) == closed {
            return None;
        }
        let (mut before, mut after) = (0.0, 1.0);
        for _ in 0..STEPS {
            let middle = (before + after) / 2.0;
            if is_closed(middle) == closed {
                after = middle;
            } else {
                before = middle;
            }
        }
        Some((after, closed))
    }

    /// Tells every sensor to `tell`: index of its node, bit of 6000h/2, whether it is closed.
    ///
    /// RT: no allocation, no locks.
    pub(super) fn update_switches(&self, loads_mm: &[f64], tell: &mut dyn FnMut(usize, u8, bool)) {
        let place = self.kinematics.forward(&ToolFrame::OFF, loads_mm);
        // Switches on one input are wired side by side: it is closed if one of them is.
        let closed = |node: usize, input: u8| {
            let mut switches = self.home_switches.iter();
            switches.any(|switch| {
                let load_mm = match (switch.axis, &place) {
                    (Some(axis), Some(place)) => place[axis],
                    (Some(_) | None, _) => loads_mm.get(switch.joint).copied().unwrap_or_default(),
                };
                (switch.node, switch.input) == (node, input) && is_beyond(load_mm, switch.at_mm, switch.above)
            })
        };
        for switch in &self.home_switches {
            tell(switch.node, switch.input - WIRED, closed(switch.node, switch.input));
        }
        let Some(probe) = &self.probe else { return };
        // Where no tip can be, none touches anything.
        let touches = place.is_some_and(|place| touches(probe, &place));
        tell(
            probe.node,
            probe.input - WIRED,
            touches || closed(probe.node, probe.input),
        );
    }
}

/// Whether the ball of the probe touches anything, with the axes at `place`.
fn touches(probe: &SimProbe, place: &Position) -> bool {
    let radius_mm = probe.diameter_mm / 2.0;
    let mut ball = *place;
    ball[Axis::Z] += radius_mm - probe.length_mm;
    let mut surfaces = probe.surfaces.iter();
    let mut bodies = probe.bodies.iter();
    surfaces.any(|surface| meets(surface, &ball, radius_mm)) || bodies.any(|body| distance(body, &ball) <= radius_mm)
}

/// Whether a ball with its middle at `ball` touches a plane.
fn meets(surface: &SimSurface, ball: &Position, radius_mm: f64) -> bool {
    let radius_mm = if surface.axis.is_rotary() { 0.0 } else { radius_mm };
    let reach_mm = if surface.above { radius_mm } else { -radius_mm };
    is_beyond(ball[surface.axis] + reach_mm, surface.at_mm, surface.above)
}

/// How far a point is from a body, mm; 0 within it.
fn distance(body: &SimBody, point: &Position) -> f64 {
    let [x, y] = [Axis::X, Axis::Y].map(|axis| point[axis] - body.middle_mm[axis as usize]);
    // How far it is outside of each side of the outline, less than 0 inside.
    let beyond = match body.outline {
        SimOutline::Rectangle { half_mm, angle_degrees } => {
            let (sin, cos) = angle_degrees.to_radians().sin_cos();
            let turned = [x * cos + y * sin, y * cos - x * sin];
            [0, 1].map(|side: usize| turned[side].abs() - half_mm[side])
        }
        SimOutline::Circle { radius_mm } => [x.hypot(y) - radius_mm, f64::NEG_INFINITY],
    };
    let aside = match body.hole {
        true => -beyond[0].max(beyond[1]).min(0.0),
        false => beyond[0].max(0.0).hypot(beyond[1].max(0.0)),
    };
    let [low, high] = body.z_mm;
    let above = (point[Axis::Z] - high).max(low - point[Axis::Z]).max(0.0);
    aside.hypot(above)
}

fn is_beyond(position_mm: f64, at_mm: f64, above: bool) -> bool {
    if above {
        position_mm >= at_mm
    } else {
        position_mm <= at_mm
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::path::Path;

    #[test]
    fn home_switches_close_where_the_loads_are_and_two_on_one_input_side_by_side() {
        let machine = include_str!("../../../configs/gantry-demo.toml");
        let looked = |machine: &str, loads_mm: [f64; 4]| {
            let config = config::parse(machine, Path::new("m.toml")).unwrap_or_else(|errors| panic!("{errors}"));
            let sensors = Sensors::new(&config).expect("home switches");
            let mut told = Vec::new();
            sensors.update_switches(&loads_mm, &mut |node, bit, closed| told.push((node, bit, closed)));
            told
        };
        let told = looked(machine, [9.0, -3.9, -3.3, 0.0]);
        assert_eq!(told, [(4, 1, false), (4, 2, true)], "places in the file, -4.0 and -3.2");
        let told = looked(machine, [9.0, -4.0, 0.0, 0.0]);
        assert_eq!(told, [(4, 1, true), (4, 2, false)]);
        let shared = machine.replace("input = 10\n", "input = 9\n");
        let told = looked(&shared, [9.0, -4.0, 0.0, 0.0]);
        assert_eq!(told, [(4, 1, true), (4, 1, true)]);
    }

    #[test]
    fn the_ball_of_the_probe_touches_bodies_from_all_sides() {
        const SQRT_HALF: f64 = std::f64::consts::FRAC_1_SQRT_2;
        let rectangle = |angle_degrees, hole| SimBody {
            outline: SimOutline::Rectangle {
                half_mm: [20.0, 10.0],
                angle_degrees,
            },
            middle_mm: [100.0, 50.0],
            z_mm: [-80.0, -60.0],
            hole,
        };
        let circle = |hole| SimBody {
            outline: SimOutline::Circle { radius_mm: 15.0 },
            ..rectangle(0.0, hole)
        };
        // Place of the axes in contact with a ball of 4 mm that is 30 mm below, and the way that leads away from the body.
        for (body, [x, y, z], [dx, dy, dz]) in [
            (rectangle(0.0, false), [78.0, 55.0, -42.0], [-1.0, 0.0, 0.0]),
            (rectangle(0.0, false), [110.0, 62.0, -42.0], [0.0, 1.0, 0.0]),
            (rectangle(0.0, false), [110.0, 50.0, -30.0], [0.0, 0.0, 1.0]),
            // Its corner, by the ball's side.
            (
                rectangle(0.0, false),
                [120.0 + 2.0 * SQRT_HALF, 60.0 + 2.0 * SQRT_HALF, -42.0],
                [1.0, 1.0, 0.0],
            ),
            (rectangle(90.0, false), [112.0, 55.0, -42.0], [1.0, 0.0, 0.0]),
            (
                rectangle(45.0, false),
                [100.0 + 22.0 * SQRT_HALF, 50.0 + 22.0 * SQRT_HALF, -42.0],
                [1.0, 1.0, 0.0],
            ),
            (rectangle(0.0, true), [118.0, 50.0, -42.0], [-1.0, 0.0, 0.0]),
            (rectangle(0.0, true), [100.0, 42.0, -42.0], [0.0, 1.0, 0.0]),
            (rectangle(0.0, true), [140.0, 42.0, -30.0], [0.0, 0.0, 1.0]),
            (circle(false), [100.0, 67.0, -42.0], [0.0, 1.0, 0.0]),
            (
                circle(false),
                [100.0 - 17.0 * SQRT_HALF, 50.0 - 17.0 * SQRT_HALF, -42.0],
                [-1.0, -1.0, 0.0],
            ),
            (circle(true), [113.0, 50.0, -42.0], [-1.0, 0.0, 0.0]),
            (circle(true), [100.0, 50.0 - 13.0, -42.0], [0.0, 1.0, 0.0]),
        ] {
            let probe = SimProbe {
                node: 0,
                input: WIRED,
                diameter_mm: 4.0,
                length_mm: 30.0,
                surfaces: Vec::new(),
                bodies: vec![body],
            };
            let at = |way: f64| Position::xyz(x + way * dx, y + way * dy, z + way * dz);
            assert!(touches(&probe, &at(-1e-6)), "{body:?}: {x} {y} {z}");
            assert!(!touches(&probe, &at(1e-6)), "{body:?}: {x} {y} {z}");
        }
    }

    /// Numbers as a machine file may have them, round ones often.
    fn number() -> impl Strategy<Value = f64> {
        prop_oneof![-1e6..1e6_f64, (-200i32..200).prop_map(f64::from)]
    }

    proptest! {
        #[test]
        fn whatever_bodies_the_file_has_the_way_to_them_is_as_long_as_it_looks(
            ends in prop::array::uniform8(number()),
            hole: bool,
            round: bool,
            from in prop::array::uniform3(number()),
            way in prop::array::uniform3(-10.0..10.0_f64),
        ) {
            let [x, y, right, back, low, high, angle, _] = ends;
            let shape = match round {
                true => format!("cylinder]]\nx_mm = {x:?}\ny_mm = {y:?}\ndiameter_mm = {right:?}\n"),
                false => format!(
                    "box]]\nx_mm = [{x:?}, {right:?}]\ny_mm = [{y:?}, {back:?}]\nangle_degrees = {angle:?}\n"
                ),
            };
            let machine = include_str!("../../../configs/mill3-demo.toml");
            let text = format!("{machine}[[sim.probe.{shape}z_mm = [{low:?}, {high:?}]\nhole = {hole}\n");
            let read = config::parse(&text, Path::new("m.toml"));
            let good = low < high && if round { right > 0.0 } else { x < right && y < back && angle.abs() <= 360.0 };
            prop_assert_eq!(read.is_ok(), good);
            let bodies = read.ok().and_then(|config| config.sim.probe).map_or(Vec::new(), |probe| probe.bodies);
            for body in bodies {
                let at = |share: f64| {
                    let [x, y, z] = [0, 1, 2].map(|axis: usize| from[axis] + share * way[axis]);
                    distance(&body, &Position::xyz(x, y, z))
                };
                let length = way[0].hypot(way[1]).hypot(way[2]);
                prop_assert!(at(0.0) >= 0.0);
                prop_assert!((at(1.0) - at(0.0)).abs() <= length + 1e-6, "{} {} {length}", at(0.0), at(1.0));
            }
        }
    }
}
