//! `isocnc status` and `power`: how a control is, in words.

use super::{ControlArgs, StatusArgs, call, connect, overrides, print};
use crate::progress;
use host::terminal;
use serde_json::{Value, json};
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
    let status = call(&args.control, "status", json!({}))?;
    print(&args.control, &status, &words(&status));
    Ok(match status["state"] == "silenced" {
        true => ExitCode::FAILURE,
        false => ExitCode::SUCCESS,
    })
}

/// Prints changes until the control ends.
fn follow(args: &ControlArgs) -> anyhow::Result<ExitCode> {
    let mut client = connect(args)?;
    let mut value = client.call("subscribe", json!({}))?;
    loop {
        // Whoever reads them may be gone.
        if writeln!(files::printed::stdout(), "{value}").is_err() {
            return Ok(ExitCode::SUCCESS);
        }
        value = client.notification()?["params"].take();
    }
}

/// Parts made, and wanted; `None`: none of them.
pub fn parts_words(parts: &Value) -> Option<String> {
    match (parts["count"].as_u64()?, parts["target"].as_u64()) {
        (0, None) => None,
        (count, None) => Some(count.to_string()),
        (count, Some(target)) => Some(format!("{count} of {target}")),
    }
}

/// Variables of programs in Structured Text that have values whatever pins and the program make of them.
pub fn forced_words(forced: &Value) -> impl Iterator<Item = String> {
    let all = forced.as_array().into_iter().flatten();
    all.map(|forced| {
        let of = |key: &str| forced[key].as_str().unwrap_or("unknown");
        let (program, variable, value) = (of("program"), of("variable"), of("value"));
        format!("{variable} = {value} in logic {program}: isocnc logic force --program {program} --release {variable}")
    })
}

/// Whether the machine can move, and what is in the way.
fn power_words(status: &Value) -> Vec<String> {
    let mut lines = Vec::new();
    if let Some(power) = status["power"].as_str() {
        lines.push(format!("power     {power}"));
    }
    for end in ["lower", "upper"] {
        let joints = status["limit_switches"][end].as_array().into_iter().flatten();
        lines.extend(joints.map(|joint| format!("limit     the {end} switch of joint {joint} is closed")));
    }
    if let Some(next) = status["next"].as_str() {
        lines.push(format!("next      {next}"));
    }
    lines
}

/// Tells whether the machine can move, and what is in the way.
///
/// # Errors
/// No control answers.
pub fn power(args: &ControlArgs) -> anyhow::Result<ExitCode> {
    let status = call(args, "status", json!({}))?;
    let mut lines = power_words(&status);
    let numbers = |list: &Value| -> Vec<String> {
        let joints = list.as_array().into_iter().flatten();
        joints.map(Value::to_string).collect()
    };
    let homed = numbers(&status["homed"]);
    let last = lines.len().saturating_sub(usize::from(status["next"].is_string()));
    lines.insert(
        last,
        match homed.is_empty() {
            true => "homed     no joint".to_owned(),
            false => format!("homed     joints {}", homed.join(" ")),
        },
    );
    if let Some(alarm) = status["alarm"].as_str() {
        lines.insert(last, terminal::alarm(format!("alarm     {alarm}")).to_string());
    }
    let kept = ["power", "estop_chain_open", "homed", "limit_switches", "alarm", "next"];
    let answer: serde_json::Map<String, Value> = kept
        .iter()
        .map(|key| ((*key).to_owned(), status[*key].clone()))
        .collect();
    print(args, &Value::Object(answer), &lines.join("\n"));
    Ok(ExitCode::SUCCESS)
}

/// A status in words.
fn words(status: &Value) -> String {
    let text = |value: &Value| value.as_str().unwrap_or("unknown").to_owned();
    let mut lines = vec![
        format!("machine   {} ({})", text(&status["machine"]), text(&status["file"])),
        format!("state     {}, {}", text(&status["state"]), text(&status["step"])),
    ];
    lines.extend(power_words(status));
    if status["control"]["taken"] == true {
        let (name, process) = (text(&status["control"]["name"]), &status["control"]["process"]);
        lines.push(format!("control   {name} (process {process})"));
    }
    for external in status["external"].as_array().into_iter().flatten() {
        let how = match external["alive"] == true {
            true => "its process writes its outputs",
            false => "no process writes its outputs: they have their safe values",
        };
        lines.push(format!("external  {}: {how}", text(&external["name"])));
    }
    if let Some(waiting) = status["waiting"].as_object() {
        let (what, release) = (text(&waiting["text"]), text(&waiting["release"]));
        lines.push(format!("waits     {what}; {release}"));
    }
    if let Some(mdi) = status["mdi"].as_array().filter(|mdi| !mdi.is_empty()) {
        let mdi: Vec<&str> = mdi.iter().filter_map(Value::as_str).collect();
        lines.push(format!("mdi       {}", mdi.join(" | ")));
    }
    if let Some(program) = status["program"].as_object() {
        let progress = match program["result"].as_str() {
            Some(result) => result.to_owned(),
            None if status["step"] != "program" => "loaded".to_owned(),
            None => {
                let how_far = progress::words(|name| &status[name]);
                let more = match status["runs_left"].as_u64() {
                    Some(left @ 1..) => format!(", {left} times more"),
                    _ => String::new(),
                };
                let dry = if program.get("dry_run") == Some(&Value::Bool(true)) {
                    "dry run, "
                } else {
                    ""
                };
                format!("{dry}line {} of {}, {how_far}{more}", status["line"], program["lines"])
            }
        };
        let way = if status["direction"] == "reverse" {
            ", backward"
        } else {
            ""
        };
        lines.push(format!("program   {}: {progress}{way}", text(&program["name"])));
    }
    if status["single_block"] == true {
        lines.push("single    each block ends at rest".into());
    }
    let turned = ["feed_percent", "rapid_percent", "spindle_percent"].map(|what| status["override"][what] != 100.0);
    if status["override"].is_object() && turned.contains(&true) {
        lines.push(format!("override  {}", overrides(&status["override"])));
    }
    if let Some(degrees) = status["work_rotation_degrees"]
        .as_f64()
        .filter(|degrees| *degrees != 0.0)
    {
        lines.push(format!(
            "rotation  the work system in force is turned by {degrees} degrees"
        ));
    }
    if let Some(last) = status["last_program"]
        .as_object()
        .filter(|_| status["program"].is_null())
    {
        let (name, result) = (text(&last["name"]), text(&last["result"]));
        lines.push(match result.as_str() {
            "loaded" | "completed" => format!("last      {name}: {result}"),
            "interrupted" => format!(
                "last      {name}: interrupted, as the control ended in its midst; line {} was reached",
                last["line"]
            ),
            _ => format!("last      {name}: {result}, line {} was reached", last["line"]),
        });
    }
    if let Some(parts) = parts_words(&status["parts"]) {
        lines.push(format!("parts     {parts}"));
    }
    if let Some(obstruction) = status["obstruction"].as_str() {
        lines.push(obstruction.to_owned());
    }
    lines.extend(
        forced_words(&status["forced"]).map(|forced| terminal::alarm(format!("FORCED    {forced}")).to_string()),
    );
    if let Some(alarm) = status["alarm"].as_str() {
        lines.push(terminal::alarm(format!("alarm     {alarm}")).to_string());
    }
    lines.push(format!(
        "cycles    {}, {} left out, {:.1} us late at most",
        status["cycles"],
        status["cycles_skipped"],
        status["late_max_us"].as_f64().unwrap_or(0.0)
    ));
    lines.join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_status_reads_as_sentences() {
        let mut status = json!({
            "machine": "mill3", "file": "mill3.toml", "state": "disabled", "step": "standing by", "program": null,
            "alarm": null, "cycles": 1000, "cycles_skipped": 0, "late_max_us": 12.34, "line": 7,
            "elapsed_s": 12.0, "remaining_s": 30.2, "done_percent": 28.4,
        });
        let waiting = "machine   mill3 (mill3.toml)\nstate     disabled, standing by\n\
                       cycles    1000, 0 left out, 12.3 us late at most";
        assert_eq!(words(&status), waiting);
        status["program"] = json!({ "name": "/p.ngc", "lines": 90, "planned_time_s": 1.0, "result": null });
        assert!(words(&status).contains("\nprogram   /p.ngc: loaded\n"));
        status["power"] = json!("off");
        status["next"] = json!("isocnc on");
        assert!(words(&status).contains("\npower     off\nnext      isocnc on\n"));
        status["step"] = json!("program");
        status["alarm"] = json!("x-drive lost");
        let said = words(&status);
        assert!(
            said.contains("\nprogram   /p.ngc: line 7 of 90, 12 s, 30 s to go, 28 % done\nalarm     x-drive lost\n"),
            "{said}"
        );
        status["direction"] = json!("reverse");
        status["single_block"] = json!(true);
        let said = words(&status);
        assert!(
            said.contains("28 % done, backward\nsingle    each block ends at rest\n"),
            "{said}"
        );
        status["direction"] = json!("forward");
        status["override"] = json!({ "feed_percent": 100.0, "rapid_percent": 100.0, "spindle_percent": 100.0 });
        assert!(!words(&status).contains("override"));
        status["override"]["feed_percent"] = json!(62.5);
        assert!(words(&status).contains("\noverride  feed 62.5 %, rapid 100.0 %, spindle 100.0 %\n"));
        status["forced"] = json!([{ "program": "cell", "variable": "door_closed", "value": "1" }]);
        let forced =
            "\nFORCED    door_closed = 1 in logic cell: isocnc logic force --program cell --release door_closed\n";
        assert!(words(&status).contains(forced));
        status["program"]["result"] = json!("stopped");
        assert!(words(&status).contains("/p.ngc: stopped\n"));
    }
}
