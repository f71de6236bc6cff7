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
use protocol::{JogOutlook, Message, State, Status, method, params};
use rt::joint_jog::HOLDS_S;
use serde_json::json;
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
    let order = order(args)?;
    let endless = order.distance_mm.is_none();
    let signal = StopSignal::install().context("signals")?;
    let mut client = connect(&args.control)?;
    let outlook = client.ask::<method::Jog>(&order)?;
    if let Some(cut) = cut(&outlook, args.speed)
        && !args.control.json
    {
        say(&format!("{cut}\n"));
    }
    let jogging = params::Jogging {
        axis: order.axis,
        joint: order.joint,
    };
    // The control does not jog any more where something has stopped it.
    loop {
        std::thread::sleep(RENEWAL);
        let status = client.ask::<method::Status>(&params::NoParams {})?;
        let rests = status.velocity_mm_s == 0.0;
        // A machine that is away from its path is so also when nobody jogs.
        match status.state {
            State::Jogging => {}
            State::Away if !rests || endless && signal.caught().is_none() => {}
            _ => break,
        }
        // A key that is let go; at the end of the way, too, so that what is ordered next need not wait.
        let renewed = match signal.caught().is_some() || rests && !endless {
            true => client.ask::<method::JogStop>(&jogging),
            false => client.ask::<method::JogKeep>(&jogging),
        };
        if renewed.is_err() {
            break;
        }
    }
    let status = end_of(&mut client)?;
    let end = json!({
        "position_mm": status.position_mm,
        "obstruction": status.obstruction,
        "alarm": status.alarm,
        "velocity_mm_s": outlook.velocity_mm_s,
        "soft_limit_mm": outlook.soft_limit_mm,
    });
    print(&args.control, &end, &words(&outlook, &status));
    Ok(match signal.caught() {
        _ if status.alarm.is_some() => ExitCode::FAILURE,
        Some(signal) => ExitCode::from(exit_code(signal)),
        None => ExitCode::SUCCESS,
    })
}

/// How a control is once the jog is over: what stopped the machine is told a little after that it stands, and a renewal is
/// refused before.
fn end_of(client: &mut Client) -> anyhow::Result<Status> {
    let mut status = client.ask::<method::Status>(&params::NoParams {})?;
    for _ in 0..SETTLES {
        if is_settled(&status) {
            break;
        }
        std::thread::sleep(RENEWAL);
        status = client.ask::<method::Status>(&params::NoParams {})?;
    }
    Ok(status)
}

/// Whether nothing is to come of a jog: at rest, and where something has stopped the machine, its cause is there.
fn is_settled(status: &Status) -> bool {
    status.velocity_mm_s == 0.0
        && match status.state {
            State::Jogging | State::Stopping => false,
            State::Faulted | State::Estop => status.alarm.is_some(),
            _ => true,
        }
}

/// That a speed was cut, and to what.
fn cut(outlook: &JogOutlook, wanted: f64) -> Option<String> {
    let most = outlook.velocity_mm_s.filter(|most| *most < wanted)?;
    let (axis, unit) = (outlook.axis.as_ref()?, outlook.unit.as_ref()?);
    Some(format!(
        "speed cut from {wanted} to {most} {unit}/s, the limit of {axis}"
    ))
}

/// Where the motion has ended, and why there.
fn words(outlook: &JogOutlook, status: &Status) -> String {
    let mut lines = Vec::new();
    if let Some(alarm) = &status.alarm {
        lines.push(alarm_text(format!("alarm: {alarm}")).to_string());
    }
    lines.extend(status.obstruction.as_ref().map(Message::to_string));
    let letter = outlook.axis.as_deref().unwrap_or_default();
    let axis = letter.chars().next().and_then(Axis::from_letter);
    let at = axis.and_then(|axis| status.position_mm.get(axis as usize));
    lines.push(match (at, &outlook.unit) {
        (Some(at), Some(unit)) => {
            let limit = outlook.soft_limit_mm.flatten();
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

/// Parameters of the method; without a distance the jog has no end of its own.
fn order(args: &JogArgs) -> anyhow::Result<params::Jog> {
    let (axis, joint) = match args.what.parse::<u16>() {
        Ok(joint) => (None, Some(u64::from(joint))),
        Err(_) => (Some(args.what.clone()), None),
    };
    if !(args.speed > 0.0 && args.speed.is_finite()) {
        bail!("--speed {}: must be above 0", args.speed);
    }
    let (velocity_mm_s, distance_mm) = match args.how_far.as_str() {
        "+" => (args.speed, None),
        "-" => (-args.speed, None),
        distance => {
            let wrong = || format!("{distance}: must be a distance, + or -");
            let distance_mm: f64 = distance.parse().with_context(wrong)?;
            if !distance_mm.is_finite() {
                bail!(wrong());
            }
            (args.speed, Some(distance_mm))
        }
    };
    Ok(params::Jog {
        axis,
        joint,
        velocity_mm_s,
        distance_mm,
    })
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

    fn read(words: &[&str]) -> Result<params::Jog, String> {
        let line = Line::try_parse_from([&["jog"], words].concat()).map_err(|error| error.to_string())?;
        order(&line.jog).map_err(|error| format!("{error:#}"))
    }

    #[test]
    fn distances_and_directions_become_parameters() {
        let given = |words: &[&str]| read(words).map(|order| protocol::rpc::given(&order));
        let expected = json!({ "axis": "X", "velocity_mm_s": 10.0, "distance_mm": -2.5 });
        assert_eq!(given(&["X", "-2.5"]), Ok(expected));
        let expected = json!({ "joint": 1, "velocity_mm_s": -30.0 });
        assert_eq!(given(&["1", "-", "--speed", "30"]), Ok(expected));
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
        let status = |state: State, velocity_mm_s: f64, alarm: Option<&str>| Status {
            state,
            velocity_mm_s,
            alarm: alarm.map(Message::from),
            ..Status::default()
        };
        for state in [State::Ready, State::Away, State::Disabled, State::Held] {
            assert!(is_settled(&status(state, 0.0, None)), "{state}");
            assert!(!is_settled(&status(state, 0.1, None)), "{state}");
        }
        assert!(!is_settled(&status(State::Jogging, 0.0, None)));
        assert!(!is_settled(&status(State::Stopping, 0.0, Some("upper limit switch"))));
        for state in [State::Faulted, State::Estop] {
            assert!(!is_settled(&status(state, 0.0, None)), "{state}");
            assert!(is_settled(&status(state, 0.0, Some("upper limit switch"))), "{state}");
        }
    }

    #[test]
    fn a_speed_that_was_cut_and_a_soft_limit_are_told() {
        let outlook = JogOutlook {
            axis: Some("Y".into()),
            unit: Some("mm".into()),
            velocity_mm_s: Some(150.0),
            soft_limit_mm: Some(Some(205.0)),
        };
        assert_eq!(
            cut(&outlook, 400.0),
            Some("speed cut from 400 to 150 mm/s, the limit of Y".into())
        );
        assert_eq!(cut(&outlook, 150.0), None);
        assert_eq!(cut(&JogOutlook::default(), 400.0), None);
        let mut status = Status {
            position_mm: vec![1.0, 205.0, 0.0],
            state: State::Ready,
            ..Status::default()
        };
        assert_eq!(words(&outlook, &status), "Y at rest at 205.000 mm, its soft limit");
        status.position_mm[1] = 12.5;
        assert_eq!(words(&outlook, &status), "Y at rest at 12.500 mm");
        status.velocity_mm_s = 3.0;
        assert_eq!(words(&outlook, &status), "Y still moves, at 12.500 mm");
        status.velocity_mm_s = 0.0;
        status.obstruction = Some("jog ended: axis Y (joint 1): is at the end of its travel".into());
        assert!(
            words(&outlook, &status).starts_with("jog ended: axis Y (joint 1): is at the end of its travel\nY at rest")
        );
        assert_eq!(words(&JogOutlook::default(), &Status::default()), "at rest");
    }
}
