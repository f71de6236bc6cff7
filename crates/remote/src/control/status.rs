//! `isocnc status` and `power`: how a control is, in words.

use super::{ControlArgs, StatusArgs, ask, connect, overrides, print};
use crate::place::places;
use crate::progress;
use api::client::Client;
use host::terminal;
use protocol::{Direction, Forced, LastResult, Message, Parts, State, Status, Step, method, params};
use serde_json::json;
use std::io::Write;
use std::process::ExitCode;

/// Shows how a control is.
///
/// Exit code 1: it is silenced, and ends.
///
/// # Errors
/// No control answers.
pub fn status(args: &StatusArgs) -> anyhow::Result<ExitCode> {
    if args.follow {
        return follow(&args.control);
    }
    let mut client = connect(&args.control)?;
    let status = client.ask::<method::Status>(&params::NoParams {})?;
    let line = line_under_way(&mut client, &status);
    print(&args.control, &status, &words(&status, line.as_deref()));
    Ok(match status.state == State::Silenced {
        true => ExitCode::FAILURE,
        false => ExitCode::SUCCESS,
    })
}

/// Prints changes until the control ends.
fn follow(args: &ControlArgs) -> anyhow::Result<ExitCode> {
    let mut client = connect(args)?;
    let mut value = json!(client.ask::<method::Subscribe>(&params::Subscribe::default())?);
    loop {
        // Whoever reads them may be gone.
        if writeln!(files::printed::stdout(), "{value}").is_err() {
            return Ok(ExitCode::SUCCESS);
        }
        value = client.notification()?.params;
    }
}

/// Parts made, and wanted; `None`: none of them.
pub fn parts_words(parts: &Parts) -> Option<String> {
    match (parts.count, parts.target) {
        (0, None) => None,
        (count, None) => Some(count.to_string()),
        (count, Some(target)) => Some(format!("{count} of {target}")),
    }
}

/// Variables of programs in Structured Text that have values whatever pins and the program make of them.
pub fn forced_words(forced: &[Forced]) -> impl Iterator<Item = String> {
    forced.iter().map(|forced| {
        let Forced {
            program,
            variable,
            value,
        } = forced;
        format!("{variable} = {value} in logic {program}: isocnc logic force --program {program} --release {variable}")
    })
}

/// Whether the machine can move, and what is in the way.
fn power_words(status: &Status) -> Vec<String> {
    let mut lines = vec![format!("power     {}", status.power)];
    for (end, joints) in [
        ("lower", &status.limit_switches.lower),
        ("upper", &status.limit_switches.upper),
    ] {
        lines.extend((joints.iter()).map(|joint| format!("limit     the {end} switch of joint {joint} is closed")));
    }
    if let Some(next) = &status.next {
        lines.push(format!("next      {next}"));
    }
    lines
}

/// Tells whether the machine can move, and what is in the way.
///
/// # Errors
/// No control answers.
pub fn power(args: &ControlArgs) -> anyhow::Result<ExitCode> {
    let status = ask::<method::Status>(args, &params::NoParams {})?;
    let mut lines = power_words(&status);
    let homed: Vec<String> = status.homed.iter().map(usize::to_string).collect();
    let last = lines.len().saturating_sub(usize::from(status.next.is_some()));
    lines.insert(
        last,
        match homed.is_empty() {
            true => "homed     no joint".to_owned(),
            false => format!("homed     joints {}", homed.join(" ")),
        },
    );
    if let Some(alarm) = &status.alarm {
        lines.insert(last, terminal::alarm(format!("alarm     {alarm}")).to_string());
    }
    let answer = json!({
        "power": status.power,
        "estop_chain_open": status.estop_chain_open,
        "homed": status.homed,
        "limit_switches": status.limit_switches,
        "alarm": status.alarm,
        "next": status.next,
    });
    print(args, &answer, &lines.join("\n"));
    Ok(ExitCode::SUCCESS)
}

/// The line of the program that is executed; none where none is, or the program is another one by now.
fn line_under_way(client: &mut Client, status: &Status) -> Option<String> {
    let program = status.program.as_ref().filter(|program| program.result.is_none())?;
    if status.step != Step::Program || status.line == 0 {
        return None;
    }
    let wanted = params::ProgramText {
        from_line: Some(status.line),
        lines: Some(1),
    };
    let text = client.ask::<method::ProgramText>(&wanted).ok()?;
    text.lines
        .into_iter()
        .next()
        .filter(|_| text.revision == program.revision)
}

/// Where each axis is, what is in the spindle, how fast it goes.
fn now_words(status: &Status) -> Vec<String> {
    let mut lines = vec!["axis            work     machine".to_owned()];
    lines.extend(places(status).map(|place| {
        let homed = if place.is_homed { "" } else { "   not homed" };
        format!("{:<8}{:>12.3}{:>12.3}{homed}", place.letter, place.work, place.machine)
    }));
    let mut tool = match status.tool {
        0 => "none".to_owned(),
        tool => format!("T{tool}"),
    };
    if let Some(spindle) = &status.spindle {
        tool.push_str(&match spindle.on {
            true => format!(", spindle {:.0} rpm", spindle.speed_rpm),
            false => ", spindle off".into(),
        });
    }
    let coolant = [(status.coolant.flood, ", flood"), (status.coolant.mist, ", mist")];
    tool.extend(coolant.iter().filter(|(on, _)| *on).map(|(_, name)| *name));
    lines.push(format!("tool      {tool}"));
    lines.push(format!("feed      {:.0} mm/min now", status.velocity_mm_s * 60.0));
    if !status.codes.is_empty() {
        lines.push(format!("codes     {}", status.codes.join(" ")));
    }
    lines
}

/// A status in words; `text`: the line of the program that is executed.
fn words(status: &Status, text: Option<&str>) -> String {
    let mut lines = vec![
        format!("machine   {} ({})", status.machine, status.file),
        format!("state     {}, {}", status.state, status.step),
    ];
    lines.extend(power_words(status));
    lines.extend(now_words(status));
    if let Some(holder) = status.control.as_ref().filter(|holder| holder.taken) {
        lines.push(format!("control   {} (process {})", holder.name, holder.process));
    }
    for external in &status.external {
        let how = match external.alive {
            true => "its process writes its outputs",
            false => "no process writes its outputs: they have their safe values",
        };
        lines.push(format!("external  {}: {how}", external.name));
    }
    if let Some(waiting) = &status.waiting {
        lines.push(format!("waits     {}; {}", waiting.what, waiting.release));
    }
    if !status.mdi.is_empty() {
        lines.push(format!("mdi       {}", status.mdi.join(" | ")));
    }
    if let Some(program) = &status.program {
        let progress = match program.result {
            Some(result) => result.to_string(),
            None if status.step != Step::Program => "loaded".to_owned(),
            None => {
                let how_far = progress::words(status);
                let more = match status.runs_left {
                    0 => String::new(),
                    left => format!(", {left} times more"),
                };
                let dry = if program.dry_run { "dry run, " } else { "" };
                format!("{dry}line {} of {}, {how_far}{more}", status.line, program.lines)
            }
        };
        let way = match status.direction {
            Direction::Reverse => ", backward",
            Direction::Forward => "",
        };
        lines.push(format!("program   {}: {progress}{way}", program.name));
        lines.extend(text.map(|text| format!("line      {text}")));
    }
    if status.single_block {
        lines.push("single    each block ends at rest".into());
    }
    let turned = &status.overrides;
    if [turned.feed_percent, turned.rapid_percent, turned.spindle_percent] != [100.0; 3] {
        lines.push(format!("override  {}", overrides(turned)));
    }
    if status.work_rotation_degrees != 0.0 {
        lines.push(format!(
            "rotation  the work system in force is turned by {} degrees",
            status.work_rotation_degrees
        ));
    }
    if let Some(last) = status.last_program.as_ref().filter(|_| status.program.is_none()) {
        let name = &last.name;
        lines.push(match last.result {
            Some(result @ (LastResult::Loaded | LastResult::Completed)) => format!("last      {name}: {result}"),
            Some(LastResult::Interrupted) => format!(
                "last      {name}: interrupted, as the control ended in its midst; line {} was reached",
                last.line
            ),
            result => {
                let result = result.map_or("unknown", LastResult::name);
                format!("last      {name}: {result}, line {} was reached", last.line)
            }
        });
    }
    if let Some(parts) = parts_words(&status.parts) {
        lines.push(format!("parts     {parts}"));
    }
    lines.extend(status.obstruction.as_ref().map(Message::to_string));
    lines.extend(forced_words(&status.forced).map(|forced| terminal::alarm(format!("FORCED    {forced}")).to_string()));
    if let Some(alarm) = &status.alarm {
        lines.push(terminal::alarm(format!("alarm     {alarm}")).to_string());
    }
    lines.push(format!(
        "cycles    {}, {} left out, {:.1} us late at most",
        status.cycles, status.cycles_skipped, status.late_max_us
    ));
    lines.join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;
    use protocol::{Coolant, Next, Outcome, Overrides, Power, Spindle, StatusAxis, StatusProgram};

    #[test]
    fn a_status_reads_as_sentences() {
        let mut status = Status {
            machine: "mill3".into(),
            file: "mill3.toml".into(),
            state: State::Disabled,
            step: Step::StandingBy,
            power: Power::Off,
            overrides: Overrides {
                feed_percent: 100.0,
                rapid_percent: 100.0,
                spindle_percent: 100.0,
                ..Overrides::default()
            },
            cycles: 1000,
            late_max_us: 12.34,
            line: 7,
            elapsed_s: 12.0,
            remaining_s: Some(30.2),
            done_percent: Some(28.4),
            ..Status::default()
        };
        let waiting = "machine   mill3 (mill3.toml)\nstate     disabled, standing by\npower     off\n\
                       axis            work     machine\ntool      none\nfeed      0 mm/min now\n\
                       cycles    1000, 0 left out, 12.3 us late at most";
        assert_eq!(words(&status, None), waiting);
        status.program = Some(StatusProgram {
            name: "/p.ngc".into(),
            lines: 90,
            planned_time_s: 1.0,
            ..StatusProgram::default()
        });
        assert!(words(&status, None).contains("\nprogram   /p.ngc: loaded\n"));
        status.next = Some(Next::PowerOn);
        assert!(words(&status, None).contains("\npower     off\nnext      isocnc on\n"));
        status.step = Step::Program;
        status.alarm = Some("x-drive lost".into());
        let said = words(&status, None);
        assert!(
            said.contains("\nprogram   /p.ngc: line 7 of 90, 12 s, 30 s to go, 28 % done\nalarm     x-drive lost\n"),
            "{said}"
        );
        status.direction = Direction::Reverse;
        status.single_block = true;
        let said = words(&status, None);
        assert!(
            said.contains("28 % done, backward\nsingle    each block ends at rest\n"),
            "{said}"
        );
        status.direction = Direction::Forward;
        assert!(!words(&status, None).contains("override"));
        status.overrides.feed_percent = 62.5;
        assert!(words(&status, None).contains("\noverride  feed 62.5 %, rapid 100.0 %, spindle 100.0 %\n"));
        status.forced = vec![Forced {
            program: "cell".into(),
            variable: "door_closed".into(),
            value: "1".into(),
        }];
        let forced =
            "\nFORCED    door_closed = 1 in logic cell: isocnc logic force --program cell --release door_closed\n";
        assert!(words(&status, None).contains(forced));
        if let Some(program) = &mut status.program {
            program.result = Some(Outcome::Stopped);
        }
        assert!(words(&status, None).contains("/p.ngc: stopped\n"));
    }
    #[test]
    fn a_status_tells_where_the_machine_is_with_what_and_in_which_line() {
        let axis = |letter: &str, joints: &[usize]| StatusAxis {
            axis: letter.into(),
            joints: joints.to_vec(),
            unit: "mm".into(),
        };
        let status = Status {
            axes: vec![axis("X", &[0]), axis("Y", &[1, 2])],
            position_mm: vec![12.5, -3.0],
            work_offset_mm: vec![10.0, 0.0],
            homed: vec![0, 1],
            tool: 7,
            spindle: Some(Spindle {
                on: true,
                speed_rpm: -1200.0,
            }),
            coolant: Coolant {
                flood: true,
                mist: true,
            },
            velocity_mm_s: 25.0,
            codes: ["G1", "G54"].map(str::to_owned).to_vec(),
            step: Step::Program,
            program: Some(StatusProgram {
                name: "part.ngc".into(),
                lines: 90,
                ..StatusProgram::default()
            }),
            line: 7,
            ..Status::default()
        };
        let said = words(&status, Some("G1 X2.5"));
        for wanted in [
            "\nX              2.500      12.500\n",
            "\nY             -3.000      -3.000   not homed\n",
            "\ntool      T7, spindle -1200 rpm, flood, mist\nfeed      1500 mm/min now\ncodes     G1 G54\n",
            "\nprogram   part.ngc: line 7 of 90, 0 s\nline      G1 X2.5\n",
        ] {
            assert!(said.contains(wanted), "{wanted:?} is not in\n{said}");
        }
    }
}
