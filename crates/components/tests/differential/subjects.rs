//! Components with their options, and what is put on their inputs.

use super::rig::Rig;
use hal_pins::AnyValue;

/// Values of a pin.
#[derive(Clone, Copy)]
pub(crate) enum Of {
    /// Anew every few calls, from here to there.
    From(f64, f64),
    /// One of these, for all of the case.
    Set(&'static [f64]),
    /// Bits: another one with this probability a call.
    Often(f64),
}
use Of::{From, Often, Set};

/// A component with a set of options.
#[derive(Clone, Copy)]
pub(crate) struct Subject {
    pub(crate) kind: &'static str,
    /// Options here.
    pub(crate) options: &'static [(&'static str, i64)],
    /// Words of `loadrt`, and options of the oracle.
    pub(crate) words: &'static [&'static str],
    /// Inputs that are not left to chance: bits, numbers from -10 to 10 in quarters, integers.
    pub(crate) values: &'static [(&'static str, Of)],
    /// Inputs that no net reaches.
    pub(crate) off_net: &'static [&'static str],
    /// Outputs that differ with ordinary inputs as well: `components::DIFFERENCES` says why.
    pub(crate) free: &'static [&'static str],
    /// What the machine answers: its state, our outputs, and the inputs of the next row.
    pub(crate) machine: Option<Machine>,
}

pub(crate) type Machine = fn(&mut f64, &Rig, &mut [AnyValue]);

const fn of(kind: &'static str) -> Subject {
    Subject {
        kind,
        options: &[],
        words: &[],
        values: &[],
        off_net: &[],
        free: &[],
        machine: None,
    }
}

impl Subject {
    const fn with(self, options: &'static [(&'static str, i64)], words: &'static [&'static str]) -> Subject {
        Subject { options, words, ..self }
    }

    const fn values(self, values: &'static [(&'static str, Of)]) -> Subject {
        Subject { values, ..self }
    }

    const fn off_net(self, off_net: &'static [&'static str]) -> Subject {
        Subject { off_net, ..self }
    }

    const fn free(self, free: &'static [&'static str]) -> Subject {
        Subject { free, ..self }
    }

    const fn machine(self, machine: Machine) -> Subject {
        Subject {
            machine: Some(machine),
            ..self
        }
    }
}

/// Times, s.
const TIMES: Of = Set(&[0.0, 0.001, 0.002, 0.005, 0.02]);
const SELDOM: Of = Often(0.03);
const ON: Of = Set(&[1.0]);
const OFF: Of = Set(&[0.0]);
const GAIN: Of = From(0.0, 5.0);
const LIMIT: Of = Set(&[0.0, 0.0, 3.0]);
const CALLS: &[(&str, Of)] = &[("delay", Set(&[0.0, 1.0, 3.0]))];
const CLAMPED: &[(&str, Of)] = &[("clamp", ON)];
const CUT: &[(&str, Of)] = &[("clamp", OFF)];

const PID: &[(&str, Of)] = &[
    ("pgain", GAIN),
    ("igain", GAIN),
    ("dgain", GAIN),
    ("ff0", GAIN),
    ("ff1", GAIN),
    ("ff2", GAIN),
    ("ff3", GAIN),
    ("deadband", From(0.0, 1.0)),
    ("maxerror", LIMIT),
    ("maxerrori", Set(&[0.0, 0.002])),
    ("maxerrord", LIMIT),
    ("maxcmdd", LIMIT),
    ("maxcmddd", LIMIT),
    ("maxcmdddd", LIMIT),
    ("maxoutput", Set(&[0.0, 20.0, 2000.0])),
    ("index-enable", Often(0.2)),
    ("enable", SELDOM),
];

const MUX: &[(&str, Of)] = &[
    ("debounce-us", Set(&[0.0, 1000.0, 2500.0])),
    ("sel-int", From(0.0, 6.0)),
];

const CAROUSEL: &[(&str, Of)] = &[
    ("pocket-number", From(-3.0, 20.0)),
    ("enable", Often(0.01)),
    ("strobe", ON),
    ("jog-fwd", OFF),
    ("jog-rev", OFF),
    ("unhome", OFF),
    ("debounce", OFF),
    ("rev-pulse", OFF),
    ("align-dc", OFF),
    ("decel-time", OFF),
    ("fwd-dc", Set(&[1.5])),
    ("rev-dc", Set(&[-1.5])),
    ("hold-dc", Set(&[-0.25])),
];

/// A carousel of eight pockets that goes a fifth of a pocket a call: its sensors, four at least.
fn carousel(place: &mut f64, rig: &Rig, inputs: &mut [AnyValue], code: fn(u32) -> u32) {
    *place += 0.2 * (f64::from(u8::from(rig.bit("motor-fwd"))) - f64::from(u8::from(rig.bit("motor-rev"))));
    let pocket = (place.floor() as i64).rem_euclid(8) as u32 + 1;
    for bit in 0..8 {
        let name = format!("sense-{bit}");
        if let Some(at) = rig.inputs().iter().position(|pin| pin.name == name) {
            inputs[at] = AnyValue::Bit(code(pocket) >> bit & 1 != 0);
        }
    }
}

fn gray(place: &mut f64, rig: &Rig, inputs: &mut [AnyValue]) {
    carousel(place, rig, inputs, |pocket| pocket ^ pocket >> 1);
}

fn binary(place: &mut f64, rig: &Rig, inputs: &mut [AnyValue]) {
    carousel(place, rig, inputs, |pocket| pocket);
}

fn single(place: &mut f64, rig: &Rig, inputs: &mut [AnyValue]) {
    carousel(place, rig, inputs, |pocket| 1 << (pocket - 1));
}

/// Enables a watchdog behind the first call, for good: what it makes of changes while it was off differs.
fn watched(calls: &mut f64, rig: &Rig, inputs: &mut [AnyValue]) {
    if let Some(at) = rig.inputs().iter().position(|pin| pin.name == "enable-in") {
        inputs[at] = AnyValue::Bit(*calls > 0.0);
    }
    *calls += 1.0;
}

/// Asks for an index until it has been met.
fn sought(_: &mut f64, rig: &Rig, inputs: &mut [AnyValue]) {
    let is_sought = rig.bit("index-enable") && !rig.bit("indexed");
    if let Some(at) = rig.inputs().iter().position(|pin| pin.name == "index-enable") {
        inputs[at] = AnyValue::Bit(is_sought || inputs[at] == AnyValue::Bit(true));
    }
}

pub(crate) const SUBJECTS: &[Subject] = &[
    of("abs"),
    of("abs_s32"),
    of("and2"),
    of("bin2gray"),
    of("biquad").values(&[
        ("type", Set(&[0.0, 1.0, 2.0])),
        ("f0", Set(&[20.0, 250.0])),
        ("q", Set(&[0.5, 0.7, 1.9])),
        ("enable", SELDOM),
        ("d1", Set(&[0.1])),
        ("d2", Set(&[-0.2])),
        ("n0", Set(&[0.5])),
        ("n1", Set(&[0.3])),
        ("n2", Set(&[0.1])),
    ]),
    of("bitslice").with(&[("personality", 7)], &["personality=7"]),
    of("bitwise"),
    of("blend").values(&[("select", From(-0.5, 1.5))]),
    of("carousel")
        .with(&[("pockets", 8)], &["pockets=8"])
        .values(CAROUSEL)
        .free(&["ready", "homed"])
        .machine(gray),
    of("carousel")
        .with(
            &[("pockets", 8), ("encoding", 1), ("dir", 1), ("parity", 1)],
            &["pockets=8", "encoding=binary", "dir=1", "parity=1"],
        )
        .values(CAROUSEL)
        .free(&["ready", "homed"])
        .machine(binary),
    of("carousel")
        .with(
            &[("pockets", 8), ("encoding", 3), ("num_sense", 8)],
            &["pockets=8", "encoding=single", "num_sense=8"],
        )
        .values(CAROUSEL)
        .free(&["ready", "homed"])
        .machine(single),
    of("charge_pump"),
    of("comp").values(&[("hyst", From(0.0, 4.0))]),
    of("constant"),
    of("conv_bit_float"),
    of("conv_bit_s32"),
    of("conv_bit_u32"),
    of("conv_float_s32").values(CLAMPED),
    of("conv_float_s32").values(CUT).free(&["out-of-range"]),
    of("conv_float_u32").values(CLAMPED),
    of("conv_float_u32")
        .values(&[("clamp", OFF), ("in", From(0.0, 1e6))])
        .free(&["out-of-range"]),
    of("conv_s32_bit").values(CLAMPED),
    of("conv_s32_bit").values(CUT).free(&["out-of-range"]),
    of("conv_s32_float"),
    of("conv_s32_u32").values(CLAMPED),
    of("conv_s32_u32").values(CUT).free(&["out-of-range"]),
    of("conv_u32_bit").values(CLAMPED),
    of("conv_u32_bit").values(CUT).free(&["out-of-range"]),
    of("conv_u32_float"),
    of("conv_u32_s32").values(CLAMPED),
    of("conv_u32_s32").values(CUT).free(&["out-of-range"]),
    of("counter").with(&[], &["num_chan=1"]),
    of("dbounce").values(CALLS),
    of("ddt"),
    of("deadzone").values(&[("threshold", From(0.0, 6.0))]),
    of("debounce").with(&[("cfg", 3)], &["cfg=3"]).values(CALLS),
    of("demux").with(&[("personality", 9)], &["personality=9"]),
    of("div2").values(&[("deadband", Set(&[0.0, 0.5]))]),
    of("edge").values(&[("out-width-ns", Set(&[0.0, 1e6, 5e6, 5.5e6]))]),
    of("encoder").with(&[], &["num_chan=1"]).values(&[
        ("position-scale", ON),
        ("x4-mode", Set(&[0.0, 1.0])),
        ("counter-mode", Set(&[0.0, 0.0, 1.0])),
        ("missing-teeth", OFF),
        ("min-speed-estimate", Set(&[0.0, 1.0, 200.0])),
        ("reset", SELDOM),
        ("index-enable", SELDOM),
    ]),
    of("encoder")
        .with(&[], &["num_chan=1"])
        .values(&[
            ("position-scale", Set(&[-7.0, 0.01, 4000.0])),
            ("x4-mode", Set(&[0.0, 1.0])),
            ("counter-mode", OFF),
            ("missing-teeth", OFF),
            ("reset", SELDOM),
            ("index-enable", SELDOM),
        ])
        .free(&["velocity", "velocity-rpm", "position-interpolated"]),
    of("estop_latch"),
    of("feedcomp").values(&[("feed", From(1.0, 10.0))]),
    of("flipflop"),
    of("gantry")
        .with(&[("personality", 2)], &["personality=2"])
        .values(&[("search-vel", Set(&[-3.0, 3.0]))]),
    of("gearchange").values(&[
        ("min1", From(0.0, 2.0)),
        ("min2", From(0.0, 2.0)),
        ("max1", From(2.0, 9.0)),
        ("max2", From(2.0, 9.0)),
        ("scale2", From(1.0, 3.0)),
    ]),
    of("gray2bin"),
    of("hypot"),
    of("ilowpass").values(&[("gain", From(0.0, 1.0)), ("scale", Set(&[1024.0, 1e9]))]),
    of("integ").values(&[("min", From(-0.1, 0.0)), ("max", From(0.0, 0.1)), ("reset", SELDOM)]),
    of("invert").values(&[("in", From(1.0, 10.0)), ("deadband", Set(&[0.0, 0.5]))]),
    of("joyhandle").values(&[
        ("in", From(-1.2, 1.2)),
        ("power", Set(&[1.0, 2.0, 3.5])),
        ("deadband", From(0.0, 0.5)),
        ("inverse", OFF),
    ]),
    of("joyhandle").values(&[
        ("in", From(0.0, 1.2)),
        ("power", Set(&[2.0, 3.5])),
        ("deadband", From(0.0, 0.5)),
        ("inverse", ON),
    ]),
    of("knob2float").values(&[("min-out", Set(&[-20.0])), ("max-out", Set(&[50.0]))]),
    of("limit1").values(&[("min", From(-9.0, 0.0)), ("max", From(0.0, 9.0))]),
    of("limit2").values(&[
        ("maxv", From(0.0, 100.0)),
        ("min", From(-9.0, 0.0)),
        ("max", From(0.0, 9.0)),
    ]),
    of("limit3").free(&["out"]),
    of("lincurve").with(&[("personality", 5)], &["personality=5"]).values(&[
        ("x-val-00", Set(&[-8.0])),
        ("x-val-01", Set(&[-3.0])),
        ("x-val-02", Set(&[0.0])),
        ("x-val-03", Set(&[4.0])),
        ("x-val-04", Set(&[9.0])),
    ]),
    of("logic").with(&[("personality", 5)], &["personality=0x705"]),
    of("lowpass"),
    of("lut5"),
    of("maj3"),
    of("match8"),
    of("minmax").values(&[("reset", SELDOM)]),
    of("mult2"),
    of("multiclick").values(&[
        ("max-hold-ns", Set(&[3e6, 5e6, 2.5e6])),
        ("max-space-ns", Set(&[3e6, 6e6])),
        ("output-hold-ns", Set(&[1e6, 4e6])),
        ("invert-input", Set(&[0.0, 1.0])),
    ]),
    of("multiswitch")
        .with(&[("personality", 5)], &["cfg=5"])
        .values(&[("top-position", Set(&[4.0, 2.0]))]),
    of("mux16").values(&[("debounce-time", OFF)]),
    of("mux2"),
    of("mux4"),
    of("mux8"),
    of("mux_generic")
        .with(&[("size", 4), ("input", 1), ("output", 2)], &["config=fs4"])
        .values(MUX),
    of("mux_generic")
        .with(&[("size", 6), ("input", 2), ("output", 3)], &["config=su6"])
        .values(MUX),
    of("mux_generic")
        .with(&[("size", 3), ("input", 0), ("output", 1)], &["config=bf3"])
        .values(MUX),
    of("mux_generic")
        .with(&[("size", 2), ("input", 3), ("output", 0)], &["config=ub2"])
        .values(MUX),
    of("mux_generic")
        .with(&[("size", 5), ("input", 1), ("output", 0)], &["config=fb5"])
        .values(MUX),
    of("near"),
    of("not"),
    of("offset"),
    of("oneshot")
        .values(&[("width", TIMES), ("reset", SELDOM)])
        .free(&["time-left"]),
    of("or2"),
    of("orient").values(&[
        ("mode", From(0.0, 3.0)),
        ("angle", From(0.0, 360.0)),
        ("tolerance", From(0.0, 900.0)),
        ("enable", SELDOM),
    ]),
    of("pid")
        .with(&[], &["num_chan=1"])
        .values(PID)
        .off_net(&["command-deriv", "feedback-deriv"]),
    of("pid")
        .with(&[], &["num_chan=1", "--link", "pid.0.command-deriv"])
        .values(PID)
        .off_net(&["feedback-deriv"]),
    of("pid")
        .with(&[], &["num_chan=1", "--link", "pid.0.feedback-deriv"])
        .values(PID)
        .off_net(&["command-deriv"]),
    of("sample_hold"),
    of("scale"),
    of("scaled_s32_sums"),
    of("select8"),
    of("siggen").values(&[("frequency", From(0.0, 600.0))]),
    of("sim_encoder").with(&[], &["num_chan=1"]).values(&[
        ("ppr", Set(&[3.0])),
        ("scale", Set(&[1.0, 60.0])),
        ("speed", From(-80.0, 80.0)),
    ]),
    of("sim_home_switch")
        .values(&[
            ("home-pos", Set(&[3.0, -3.0])),
            ("index-enable", SELDOM),
            ("index-delay-ms", Set(&[1.0, 3.0, 10.0])),
        ])
        .machine(sought),
    of("sim_spindle").values(&[
        ("velocity-cmd", From(-4000.0, 4000.0)),
        ("scale", Set(&[1.0, 0.016_666_667])),
    ]),
    of("spindle_monitor").values(&[
        ("spindle-command", From(0.0, 10.0)),
        ("threshold", From(0.0, 9.0)),
        ("spindle-is-on", Often(0.1)),
    ]),
    of("sum2"),
    of("time"),
    of("timedelay").values(&[("on-delay", TIMES), ("off-delay", TIMES)]),
    of("tof").values(&[("pt", TIMES)]),
    of("toggle"),
    of("ton").values(&[("pt", TIMES)]),
    of("tristate_bit"),
    of("tristate_float"),
    of("updown").values(&[("max", Set(&[2.0, 9.0]))]),
    of("watchdog")
        .with(
            &[("num_inputs", 2)],
            &["num_inputs=2", "--first", "watchdog.set-timeouts"],
        )
        .values(&[
            ("timeout-0", Set(&[0.002, 0.005])),
            ("timeout-1", Set(&[0.003])),
            ("enable-in", OFF),
            ("input-0", Often(0.45)),
            ("input-1", Often(0.45)),
        ])
        .machine(watched),
    of("wcomp"),
    of("weighted_sum").with(&[("personality", 3)], &["wsum_sizes=3"]),
    of("xor2"),
];
