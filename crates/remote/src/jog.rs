//! `isocnc jog`: moves an axis or a joint of a running control by hand.
//!
//! In:  what to move, how far or in which direction, how fast.
//! Out: jog orders, renewed while the command runs; one line when it is over. Killed in the midst, the joint comes to rest.

use super::control::{ControlArgs, connect, print};
use anyhow::{Context, bail};
use api::client::Client;
use clap::Args;
use host::signals::{StopSignal, exit_code};
use host::terminal::{alarm as alarm_text, say};
use motion::canon::Axis;
use rt::joint_jog::HOLDS_S;
use serde_json::{Value, json};
use std::process::ExitCode;
use std::time::Duration;

/// Pause between two renewals: four within the time that an order holds.
const RENEWAL: Duration = Duration::from_millis((HOLDS_S * 1000.0 / 4.0) as u64);

/// Looks at a machine that comes to rest and tells why, [`RENEWAL`] apart: 3 s.
const SETTLES: usize = 60;

/// A joint that comes to rest at its soft limit is as near as this, mm.
const SAME_MM: f64 = 1e-3;

/// Arguments of `jog`.
#[derive(Clone, Debug, Args)]
pub struct JogArgs {
    #[command(flatten)]
    control: ControlArgs,
    /// Axis letter, or the number of a joint
    what: String,
    /// Distance in mm (degrees), or + or - to run until Ctrl-C or the soft limit
    #[arg(allow_hyphen_values = true)]
    how_far: String,
    /// Greatest speed, mm/s (degrees/s)
    #[arg(long, default_value_t = 10.0)]
    speed: f64,
}

/// Moves by hand.
///
/// # Errors
/// The arguments make no sense; no control answers, or it refuses.
pub fn jog(args: &JogArgs) -> anyhow::Result<ExitCode> {
    let (mut params, endless) = params(args)?;
    let signal = StopSignal::install().context("signals")?;
    let mut client = connect(&args.control)?;
    let outlook = client.call("jog", params.clone())?;
    if let Some(cut) = cut(&outlook, args.speed)
        && !args.control.json
    {
        say(&format!("{cut}\n"));
    }
    let order = params.as_object_mut().context("an object")?;
    order.remove("velocity_mm_s");
    order.remove("distance_mm");
    // The control does not jog any more where something has stopped it.
    loop {
        std::thread::sleep(RENEWAL);
        let status = client.call("status", json!({}))?;
        let rests = status["velocity_mm_s"].as_f64() == Some(0.0);
        // A machine that is away from its path is so also when nobody jogs.
        match status["state"].as_str() {
            Some("jogging") => {}
            Some("away") if !rests || endless && signal.caught().is_none() => {}
            _ => break,
        }
        // A key that is let go; at the end of the way, too, so that what is ordered next need not wait.
        let method = if signal.caught().is_some() || rests && !endless {
            "jog.stop"
        } else {
            "jog.keep"
        };
        if client.call(method, params.clone()).is_err() {
            break;
        }
    }
    let status = end_of(&mut client)?;
    let end = json!({
        "position_mm": status["position_mm"],
        "obstruction": status["obstruction"],
        "alarm": status["alarm"],
        "velocity_mm_s": outlook["velocity_mm_s"],
        "soft_limit_mm": outlook["soft_limit_mm"],
    });
    print(&args.control, &end, &words(&outlook, &status));
    Ok(match signal.caught() {
        _ if status["alarm"].is_string() => ExitCode::FAILURE,
        Some(signal) => ExitCode::from(exit_code(signal)),
        None => ExitCode::SUCCESS,
    })
}

/// How a control is once the jog is over: what stopped the machine is told a little after that it stands, and a renewal is
/// refused before.
fn end_of(client: &mut Client) -> anyhow::Result<Value> {
    let mut status = client.call("status", json!({}))?;
    for _ in 0..SETTLES {
        if is_settled(&status) {
            break;
        }
        std::thread::sleep(RENEWAL);
        status = client.call("status", json!({}))?;
    }
    Ok(status)
}

/// Whether nothing is to come of a jog: at rest, and where something has stopped the machine, its cause is there.
fn is_settled(status: &Value) -> bool {
    let rests = status["velocity_mm_s"].as_f64() == Some(0.0);
    rests
        && match status["state"].as_str() {
            Some("jogging" | "stopping") => false,
            Some("faulted" | "estop") => status["alarm"].is_string(),
            _ => true,
        }
}

/// That a speed was cut, and to what.
fn cut(outlook: &Value, wanted: f64) -> Option<String> {
    let most = outlook["velocity_mm_s"].as_f64().filter(|most| *most < wanted)?;
    let (axis, unit) = (outlook["axis"].as_str()?, outlook["unit"].as_str()?);
    Some(format!(
        "speed cut from {wanted} to {most} {unit}/s, the limit of {axis}"
    ))
}

/// Where the motion has ended, and why there.
fn words(outlook: &Value, status: &Value) -> String {
    let mut lines = Vec::new();
    if let Some(alarm) = status["alarm"].as_str() {
        lines.push(alarm_text(format!("alarm: {alarm}")).to_string());
    }
    if let Some(obstruction) = status["obstruction"].as_str() {
        lines.push(obstruction.to_owned());
    }
    let letter = outlook["axis"].as_str().unwrap_or_default();
    let axis = letter.chars().next().and_then(Axis::from_letter);
    let at = axis.and_then(|axis| status["position_mm"][axis as usize].as_f64());
    lines.push(match (at, outlook["unit"].as_str()) {
        (Some(at), Some(unit)) => {
            let limit = outlook["soft_limit_mm"].as_f64();
            let ended = limit.is_some_and(|limit| (at - limit).abs() < SAME_MM);
            let why = if ended { ", its soft limit" } else { "" };
            match is_settled(status) {
                true => format!("{letter} at rest at {at:.3} {unit}{why}"),
                false => format!("{letter} still moves, at {at:.3} {unit}"),
            }
        }
        _ => "at rest".into(),
    });
    lines.join("\n")
}

/// Parameters of the method; whether the jog has no end of its own.
fn params(args: &JogArgs) -> anyhow::Result<(Value, bool)> {
    let what = match args.what.parse::<u16>() {
        Ok(joint) => ("joint", json!(joint)),
        Err(_) => ("axis", json!(args.what)),
    };
    if !(args.speed > 0.0 && args.speed.is_finite()) {
        bail!("--speed {}: must be above 0", args.speed);
    }
    let mut params = json!({ what.0: what.1, "velocity_mm_s": args.speed });
    let endless = match args.how_far.as_str() {
        "+" => true,
        "-" => {
            params["velocity_mm_s"] = json!(-args.speed);
            true
        }
        distance => {
            let wrong = || format!("{distance}: must be a distance, + or -");
            let distance_mm: f64 = distance.parse().with_context(wrong)?;
            if !distance_mm.is_finite() {
                bail!(wrong());
            }
            params["distance_mm"] = json!(distance_mm);
            false
        }
    };
    Ok((params, endless))
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    #[derive(Debug, Parser)]
    struct Line {
        #[command(flatten)]
        jog: JogArgs,
    }

    fn read(words: &[&str]) -> Result<(Value, bool), String> {
        let line = Line::try_parse_from([&["jog"], words].concat()).map_err(|error| error.to_string())?;
        params(&line.jog).map_err(|error| format!("{error:#}"))
    }

    #[test]
    fn distances_and_directions_become_parameters() {
        let expected = json!({ "axis": "X", "velocity_mm_s": 10.0, "distance_mm": -2.5 });
        assert_eq!(read(&["X", "-2.5"]), Ok((expected, false)));
        let expected = json!({ "joint": 1, "velocity_mm_s": -30.0 });
        assert_eq!(read(&["1", "-", "--speed", "30"]), Ok((expected, true)));
    }

    #[test]
    fn what_makes_no_sense_is_refused() {
        assert!(read(&["X", "far"]).unwrap_err().starts_with("far: must be a distance"));
        assert_eq!(
            read(&["X", "+", "--speed", "0"]),
            Err("--speed 0: must be above 0".into())
        );
        assert!(read(&["X"]).is_err());
    }

    #[test]
    fn a_jog_is_over_at_rest_and_where_the_cause_of_a_stop_is_told() {
        let status = |state: &str, velocity_mm_s: f64, alarm: Option<&str>| json!({ "state": state, "velocity_mm_s": velocity_mm_s, "alarm": alarm });
        for state in ["ready", "away", "disabled", "held"] {
            assert!(is_settled(&status(state, 0.0, None)), "{state}");
            assert!(!is_settled(&status(state, 0.1, None)), "{state}");
        }
        assert!(!is_settled(&status("jogging", 0.0, None)));
        assert!(!is_settled(&status("stopping", 0.0, Some("upper limit switch"))));
        for state in ["faulted", "estop"] {
            assert!(!is_settled(&status(state, 0.0, None)), "{state}");
            assert!(is_settled(&status(state, 0.0, Some("upper limit switch"))), "{state}");
        }
    }

    #[test]
    fn a_speed_that_was_cut_and_a_soft_limit_are_told() {
        let outlook = json!({ "axis": "Y", "unit": "mm", "velocity_mm_s": 150.0, "soft_limit_mm": 205.0 });
        assert_eq!(
            cut(&outlook, 400.0),
            Some("speed cut from 400 to 150 mm/s, the limit of Y".into())
        );
        assert_eq!(cut(&outlook, 150.0), None);
        assert_eq!(cut(&json!({}), 400.0), None);
        let mut status = json!({
            "position_mm": [1.0, 205.0, 0.0], "obstruction": null, "alarm": null, "state": "ready", "velocity_mm_s": 0.0,
        });
        assert_eq!(words(&outlook, &status), "Y at rest at 205.000 mm, its soft limit");
        status["position_mm"][1] = json!(12.5);
        assert_eq!(words(&outlook, &status), "Y at rest at 12.500 mm");
        status["velocity_mm_s"] = json!(3.0);
        assert_eq!(words(&outlook, &status), "Y still moves, at 12.500 mm");
        status["velocity_mm_s"] = json!(0.0);
        status["obstruction"] = json!("jog ended: axis Y (joint 1): is at the end of its travel");
        assert!(
            words(&outlook, &status).starts_with("jog ended: axis Y (joint 1): is at the end of its travel\nY at rest")
        );
        assert_eq!(words(&json!({}), &json!({})), "at rest");
    }
}
