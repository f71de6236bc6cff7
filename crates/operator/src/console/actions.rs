//! What a program does beside moving, for the journal.
//!
//! In:  an action. Out: its message; the sentence is that of [`motion`].

use motion::canon::{SpindleDirection, WaitMode};
use motion::element::Action;
use protocol::{Message, Param, message};
use rt::waiting::input_message;

/// An action that was carried out.
pub fn done(action: Action) -> Message {
    message!("program.action", "program: {action}", action = told(action))
}

fn told(action: Action) -> Message {
    let plain = |code: &str| Message::new(code, action, []);
    let with = |code: &str, name: &str, value: Param| Message::new(code, action, [(name, value)]);
    let switched = |on: bool, codes: [&str; 2]| plain(codes[usize::from(on)]);
    match action {
        Action::SpindleOn {
            rpm,
            direction,
            surface,
        } => {
            let clockwise = direction == SpindleDirection::Clockwise;
            match (surface, clockwise) {
                (None, true) => with("action.spindle_clockwise", "rpm", rpm.into()),
                (None, false) => with("action.spindle_counterclockwise", "rpm", rpm.into()),
                (Some(surface), clockwise) => {
                    let code = match clockwise {
                        true => "action.surface_clockwise",
                        false => "action.surface_counterclockwise",
                    };
                    let speed = surface.m_per_minute.into();
                    Message::new(code, action, [("speed", speed), ("rpm", rpm.into())])
                }
            }
        }
        Action::SpindleOff => plain("action.spindle_off"),
        Action::OrientSpindle { degrees, .. } => with("action.orient", "angle", degrees.into()),
        Action::AwaitOriented { .. } => plain("action.await_oriented"),
        Action::UserCode { number, p, q } => {
            let values = [("number", number.into()), ("p", p.into()), ("q", q.into())];
            Message::new("action.user_code", action, values)
        }
        Action::TurnSpindle {
            spindle,
            rpm: Some(rpm),
        } => {
            let values = [("spindle", spindle.into()), ("rpm", rpm.into())];
            Message::new("action.other_spindle_on", action, values)
        }
        Action::TurnSpindle { spindle, rpm: None } => with("action.other_spindle_off", "spindle", spindle.into()),
        Action::AwaitSpindle => plain("action.await_spindle"),
        Action::Mist(on) => switched(on, ["action.mist_off", "action.mist_on"]),
        Action::Flood(on) => switched(on, ["action.flood_off", "action.flood_on"]),
        Action::SelectTool { tool } => with("action.select_tool", "tool", tool.into()),
        Action::ChangeTool { tool } => with("action.change_tool", "tool", tool.into()),
        Action::SetTool { tool } => with("action.set_tool", "tool", tool.into()),
        Action::Message { number } => with("action.message", "number", number.into()),
        Action::SetDigital { index, on } => {
            let code = if on { "action.digital_on" } else { "action.digital_off" };
            with(code, "index", index.into())
        }
        Action::SetAnalog { index, value } => {
            let values = [("index", index.into()), ("value", value.into())];
            Message::new("action.analog", action, values)
        }
        Action::AwaitInput { input, mode, timeout_s } => {
            let code = match mode {
                WaitMode::Immediate => return with("action.read_input", "input", input_message(input).into()),
                WaitMode::Rise => "action.await_rise",
                WaitMode::Fall => "action.await_fall",
                WaitMode::High => "action.await_on",
                WaitMode::Low => "action.await_off",
            };
            let values = [("input", input_message(input).into()), ("timeout", timeout_s.into())];
            Message::new(code, action, values)
        }
        Action::ProgramStop => plain("action.stop"),
        Action::OptionalStop => plain("action.optional_stop"),
        Action::ProgramEnd => plain("action.end"),
        Action::TextEnd => plain("action.ended"),
        Action::Modes { number } => with("action.modes", "number", number.into()),
    }
}
