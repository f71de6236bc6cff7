//! `isocnc jog`: moves an axis or a joint of a running control by hand.
//!
//! In:  what to move, how far or in which direction, how fast.
//! Out: jog orders, renewed while the command runs; one line when it is over. Killed in the midst, the joint comes to rest.

use super::control::{ControlArgs, print};
use crate::rt::hand::HOLDS_S;
use crate::service::control::client::Client;
use anyhow::{Context, bail};
use clap::Args;
use serde_json::{Value, json};
use std::process::ExitCode;
use std::time::Duration;

/// Pause between two renewals: four within the time that an order holds.
const RENEWAL: Duration = Duration::from_millis((HOLDS_S * 1000.0 / 4.0) as u64);

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
    let mut client = Client::connect(args.control.machine.as_deref())?;
    client.call("jog", params.clone())?;
    let order = params.as_object_mut().context("an object")?;
    order.remove("velocity_mm_s");
    order.remove("distance_mm");
    // The control does not jog any more where something has stopped it.
    let (position, obstruction) = loop {
        std::thread::sleep(RENEWAL);
        let status = client.call("status", json!({}))?;
        let rests = status["velocity_mm_s"].as_f64() == Some(0.0);
        if status["state"] != "jogging" || rests && !endless {
            break (status["position_mm"].clone(), status["obstruction"].clone());
        }
        if client.call("jog.keep", params.clone()).is_err() {
            break (status["position_mm"].clone(), status["obstruction"].clone());
        }
    };
    let why = obstruction.as_str().map(|why| format!("{why}\n")).unwrap_or_default();
    let stopped = json!({ "position_mm": position, "obstruction": obstruction });
    print(&args.control, &stopped, &format!("{why}at rest; axes at {position}"));
    Ok(ExitCode::SUCCESS)
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
}
