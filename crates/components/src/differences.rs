//! Where components do something else than LinuxCNC's of the same name.
//!
//! The table in docs/components.md, what `hal import` tells, and what the comparison with LinuxCNC's functions may find are made from it.

/// A difference from LinuxCNC.
#[derive(Debug)]
pub struct Difference {
    /// Names of the kinds.
    pub kinds: &'static [&'static str],
    /// Pins that mean something else here, which an import tells where they are used.
    pub pins: &'static [&'static str],
    /// What it is here.
    pub here: &'static str,
    /// What it is in LinuxCNC.
    pub there: &'static str,
    /// It is a fault there: against its manual, or of no use to anybody.
    pub is_fault: bool,
}

const fn other(
    kinds: &'static [&'static str],
    pins: &'static [&'static str],
    here: &'static str,
    there: &'static str,
) -> Difference {
    Difference {
        kinds,
        pins,
        here,
        there,
        is_fault: false,
    }
}

const fn fault(kinds: &'static [&'static str], here: &'static str, there: &'static str) -> Difference {
    Difference {
        kinds,
        pins: &[],
        here,
        there,
        is_fault: true,
    }
}

/// All of them: what is otherwise by choice, then faults.
pub static DIFFERENCES: [Difference; 44] = [
    other(
        &["biquad"],
        &["d1", "d2", "n0", "n1", "n2"],
        "own coefficients, for type 0 alone",
        "overwritten with those that are worked out for types 1 and 2",
    ),
    other(
        &["carousel"],
        &["current-position"],
        "the last pocket that the sensors told",
        "whatever they tell, 0 or beyond the last pocket as well; of several single sensors the highest",
    ),
    other(
        &["carousel"],
        &["ready"],
        "until `enable` falls, so that no one takes it for that of the next pocket",
        "until the next rise of `enable`, through jogs as well",
    ),
    other(
        &["carousel"],
        &["homed"],
        "the pocket is known, whatever the encoding",
        "for encodings with an index alone",
    ),
    other(
        &["carousel"],
        &["enable"],
        "falling stops at once",
        "falling ends the turn as the pocket does, with pulse back or aligning move",
    ),
    other(
        &["carousel"],
        &["jog-fwd", "jog-rev"],
        "a pocket for each rise, while not enabled",
        "a pocket for as long as it is true, enabled or not",
    ),
    other(
        &["carousel"],
        &["motor-fwd", "motor-rev"],
        "tell the way of the aligning move, too",
        "stay as they were before the aligning move",
    ),
    other(
        &["counter", "encoder", "sim_home_switch", "sim_spindle"],
        &["index-enable"],
        "an input; `indexed` tells that the index was met",
        "an input and an output, which falls as the index is met",
    ),
    other(
        &["pid"],
        &["tune-mode", "tune-start", "tune-type", "tune-cycles", "tune-effort"],
        "there is no tuning",
        "finds gains by itself",
    ),
    other(
        &["lincurve"],
        &[],
        "where two points have one place, the value there is that of the first one",
        "that of the side from which it was come to",
    ),
    other(
        &["limit3"],
        &["smooth-steps"],
        "needs no smoothing",
        "number of calls for the last part of the way",
    ),
    other(
        &["message"],
        &["trigger"],
        "`show` says that a message is due, the text is that of a program: docs/logic.md",
        "shows the text itself",
    ),
    other(&["multiswitch"], &["position"], "an output", "may be set to begin with"),
    other(
        &["mux16"],
        &["selected"],
        "the choice that counts",
        "the choice of the switch, before `debounce-time` is over as well",
    ),
    other(
        &["tristate_bit", "tristate_float"],
        &["out"],
        "a net has one writer: lead several to `mux2`, `mux4` or `mux_generic`",
        "several may write one signal in turn",
    ),
    other(
        &["sim_encoder"],
        &["rawcounts"],
        "an output",
        "an input by its type, though the component writes it",
    ),
    other(
        &["watchdog"],
        &["ok-out"],
        "false while `enable-in` is; changes of inputs count while it is, too",
        "stays as it is while `enable-in` is false",
    ),
    other(
        &["toggle2nist"],
        &["on", "off"],
        "as in LinuxCNC 2.10",
        "before 2.10 any change of the switch toggled the device, without `debounce` and `max-pulse-length`",
    ),
    fault(
        &["abs", "comp", "deadzone", "gearchange", "limit1", "wcomp"],
        "what is no number is neither above nor below, nor inside; it is handed on or changes nothing",
        "counts as below, as equal or as inside, or stays in the output",
    ),
    fault(
        &[
            "biquad",
            "ddt",
            "integ",
            "knob2float",
            "limit2",
            "lowpass",
            "minmax",
            "orient",
            "sim_spindle",
        ],
        "what is no number is left out of what is remembered",
        "an input that was once no number, or infinite, stays in the output, mostly for ever",
    ),
    fault(
        &["abs_s32", "scaled_s32_sums", "updown"],
        "stays within the range of its type",
        "runs over: the absolute value of -2147483648 is negative, a sum beyond the range is -2147483648, a count beyond `max` comes back below",
    ),
    fault(
        &["carousel"],
        "any `pocket-number` names a pocket",
        "-2147483648 runs over",
    ),
    fault(
        &[
            "conv_float_s32",
            "conv_float_u32",
            "conv_s32_bit",
            "conv_s32_u32",
            "conv_u32_bit",
            "conv_u32_s32",
        ],
        "`out-of-range` says whether this value is outside of the range",
        "without `clamp` it never falls again; a fraction counts as outside, a negative number that becomes unsigned does not",
    ),
    fault(
        &["conv_float_s32", "conv_float_u32"],
        "without `clamp` the lower bits of numbers beyond the range; what is no number changes nothing",
        "depends on the processor",
    ),
    fault(
        &["counter"],
        "a `position-scale` that is no number is 1",
        "makes position and speed no number",
    ),
    fault(
        &["demux"],
        "a `sel-u32` from 2147483648 on sets the last output, as all beyond it",
        "sets none",
    ),
    fault(
        &["encoder"],
        "`min-speed-estimate` is in the unit of `velocity`, whatever the scale; a negative scale has a speed, too",
        "is by the square of the scale another one; with a negative scale the speed stays 0",
    ),
    fault(
        &["encoder"],
        "a gap of `missing-teeth` is seen once the time of a tooth is known",
        "the first teeth count as gaps, and as index",
    ),
    fault(
        &["feedcomp"],
        "at `feed` 0 the output is 0",
        "is no number, or infinite",
    ),
    fault(
        &["gantry"],
        "keeps `home` by all switches with any number of joints; offsets have full precision",
        "from three joints on `home` falls as one leaves its switch; offsets have seven digits",
    ),
    fault(
        &["ilowpass"],
        "a `gain` or `scale` that is no number changes nothing; beyond 64 bits the end of the range",
        "0",
    ),
    fault(
        &["invert"],
        "0 within `deadband`, as the manual says, and for 0 itself",
        "`1 / deadband`",
    ),
    fault(
        &["joyhandle"],
        "with `inverse` the same to both sides",
        "with `inverse` the negative side jumps; what is no number gives 0",
    ),
    fault(
        &["limit2", "limit3"],
        "a negative `maxv` is 0",
        "the output of `limit2` runs away",
    ),
    fault(
        &["limit3"],
        "where `maxv` or `maxa` change while it moves, it brakes as they allow, and comes back",
        "runs away beyond `min` and `max`",
    ),
    fault(
        &["mux16"],
        "a choice that is given up begins its `debounce-time` anew; `out-s` stays within its range",
        "the time of one that was given up counts for the next; `out-s` runs over",
    ),
    fault(
        &["mux_generic"],
        "a `sel-int` beyond the last value chooses the last, whatever it is",
        "from 2147483648 on it crashes",
    ),
    fault(
        &["oneshot"],
        "`time-left` is 0 in a reset, and for a negative `width`",
        "keeps what it was in a reset, and is negative",
    ),
    fault(
        &["pid"],
        "what is no number gives an output of 0 and is forgotten; a limit taken away ends `saturated`",
        "stays in integral and output until `enable` falls; without its limit it stays `saturated`, and the integral rests",
    ),
    fault(
        &["siggen"],
        "a negative `frequency` is 0; sine and cosine are exact",
        "sawtooth and triangle run away; pi has eight digits",
    ),
    fault(
        &["sim_encoder"],
        "a speed beyond a count a call gives a count a call",
        "turns the other way; a `ppr` of 0 leaves no index",
    ),
    fault(
        &["sim_home_switch"],
        "an `index-delay-ms` of 0 meets the index at once; a search that was ended is forgotten",
        "never; the delay of a search that was ended runs on, and may end the next one",
    ),
    fault(
        &["spindle_monitor"],
        "sees a spindle that is too slow backward, too",
        "takes every feedback of a negative command that is nearer to 0 for fast enough",
    ),
    fault(
        &["momentary2nist", "toggle2nist"],
        "`max-pulse-length` counts from the beginning of the pulse",
        "counts from the end of the pulse before, and so may cut it short",
    ),
];
