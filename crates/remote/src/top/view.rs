//! The screen: 24 rows of 80 columns, or more.
//!
//! In:  what is known. Out: a picture. Nothing is told by colour alone.

use super::app::{App, SILENT_MS};
use crate::control::forced_words;
use crate::place::places;
use crate::progress;
use protocol::Step;
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Modifier, Style};
use ratatui::text::Line;
use ratatui::widgets::{Block, Borders, Paragraph};

/// Smallest screen that holds it.
const SMALLEST: (u16, u16) = (60, 21);
const KEYS: [&str; 3] = [
    "Esc stop  Space hold  r resume  e ESTOP  E reset  a ack  t tool  ? help  q quit",
    "o/O on/off  H home  S start  m MDI  b single  +/- feed  c/C control/force",
    "arrows PgUp PgDn [ ] jog  x step  < > speed",
];
const KEYS_OF_LINE: &str = "Enter runs the line  Up/Down earlier lines  Esc leaves; STOPS what is under way";
/// What `?` shows.
const ALL_KEYS: [(&str, &str); 20] = [
    ("Esc", "stop: the machine comes to rest, the program is given up"),
    ("Space", "feed hold: the program rests on its path"),
    ("r", "resume; in single block: the next block"),
    ("e / E", "emergency stop / reset it"),
    ("o / O", "drives on / off"),
    ("H", "home all joints"),
    ("S", "start the program that is shown"),
    ("a", "acknowledge the alarm"),
    ("t", "the tool that the program asks for is in the spindle"),
    ("m", "type a line of G-code (MDI); Up and Down bring back earlier ones"),
    ("b", "single block on / off"),
    ("+ / -", "feed override up / down by 10 %"),
    ("arrows", "jog X (left, right) and Y (up, down) while held"),
    ("PgUp PgDn", "jog Z"),
    ("] / [", "jog the fourth axis"),
    ("x", "jog continuously, or by 10, 1, 0.1, 0.01 a press"),
    ("< / >", "jog speed down / up"),
    ("c / C", "take or release control / take it from another client"),
    ("q, Ctrl-C", "leave; the machine goes on"),
    ("?", "this list; any key closes it"),
];

fn strong() -> Style {
    Style::new().add_modifier(Modifier::BOLD)
}

fn alarm() -> Style {
    Style::new().add_modifier(Modifier::BOLD | Modifier::REVERSED)
}

/// Draws everything; `program`: lines of the program around the current one, by their numbers.
pub(super) fn draw(frame: &mut Frame<'_>, app: &App, program: &[(u32, String)], now_ms: u64) {
    let area = frame.area();
    if (area.width, area.height) < SMALLEST || area.height < SMALLEST.1 {
        let told = format!(
            "{} {}: make the window larger",
            app.status().machine,
            app.status().state
        );
        frame.render_widget(Paragraph::new(told), area);
        return;
    }
    if app.shows_keys {
        let [head, keys] = Layout::vertical([Constraint::Length(1), Constraint::Min(0)]).areas(area);
        frame.render_widget(Paragraph::new(heading(app, now_ms)).style(alarm()), head);
        let lines = ALL_KEYS.map(|(key, does)| Line::raw(format!(" {key:<10} {does}")));
        frame.render_widget(Paragraph::new(lines.to_vec()), keys);
        return;
    }
    let axes = app.status().axes.len().max(5) as u16;
    let [head, now, program_area, told, keys] = Layout::vertical([
        Constraint::Length(1),
        Constraint::Length(axes + 2),
        Constraint::Min(3),
        Constraint::Length(6),
        Constraint::Length(4),
    ])
    .areas(area);
    frame.render_widget(Paragraph::new(heading(app, now_ms)).style(alarm()), head);
    let [left, right] = Layout::horizontal([Constraint::Length(47), Constraint::Min(20)]).areas(now);
    boxed(frame, "position", positions(app), left);
    boxed(frame, "now", conditions(app), right);
    let title = match &app.status().program {
        Some(program) => format!("program {}", program.name),
        None => "no program".into(),
    };
    boxed(
        frame,
        &title,
        program_lines(app, program, program_area.height.saturating_sub(2)),
        program_area,
    );
    boxed(
        frame,
        "messages",
        messages(app, now_ms, told.height.saturating_sub(2)),
        told,
    );
    frame.render_widget(Paragraph::new(bottom(app)), keys);
}

fn boxed(frame: &mut Frame<'_>, title: &str, lines: Vec<Line<'_>>, area: Rect) {
    let block = Block::new().borders(Borders::TOP).title(format!(" {title} "));
    frame.render_widget(Paragraph::new(lines).block(block), area);
}

fn heading(app: &App, now_ms: u64) -> String {
    if let Some(lost) = &app.lost {
        return format!(" NO CONTROL: {lost}");
    }
    let silent_ms = now_ms.saturating_sub(app.heard_ms);
    if silent_ms > SILENT_MS {
        return format!(" NOTHING HEARD FOR {} s: what is shown is old", silent_ms / 1000);
    }
    let status = app.status();
    let control = match &status.control {
        _ if app.has_control() => "you",
        Some(holder) if holder.taken => &holder.name,
        _ => "free",
    };
    format!(
        " {}  {}  {}  {}  control: {control}",
        status.machine,
        status.power.name().to_uppercase(),
        status.mode.name().to_uppercase(),
        status.activity,
    )
}

fn positions(app: &App) -> Vec<Line<'static>> {
    let mut lines = vec![Line::styled("axis      work   machine     to go  home limit", strong())];
    lines.extend(places(app.status()).map(|place| {
        let limit = match place.limits {
            (false, false) => "",
            (true, false) => "LOWER",
            (false, true) => "UPPER",
            (true, true) => "BOTH",
        };
        Line::raw(format!(
            "{}   {:>10.3}{:>10.3}{:>10}  {:<4} {limit}",
            place.letter,
            place.work,
            place.machine,
            place.to_go.map_or_else(String::new, |to_go| format!("{to_go:.3}")),
            if place.is_homed { "yes" } else { "no" },
        ))
    }));
    lines
}

fn conditions(app: &App) -> Vec<Line<'static>> {
    let status = app.status();
    let spindle = match &status.spindle {
        Some(spindle) => format!("{:.0} rpm", spindle.speed_rpm),
        None => "none".into(),
    };
    let coolant = match (status.coolant.flood, status.coolant.mist) {
        (false, false) => "off",
        (true, false) => "flood",
        (false, true) => "mist",
        (true, true) => "flood, mist",
    };
    let rotation = match status.work_rotation_degrees {
        0.0 => String::new(),
        degrees => format!("rotation {degrees} "),
    };
    let step = app.step_mm().map_or("while held".into(), |step| format!("{step} mm"));
    let single = if status.single_block { "  SINGLE BLOCK" } else { "" };
    vec![
        Line::raw(format!("F {:.0} mm/min{single}", status.velocity_mm_s * 60.0)),
        Line::raw(format!(
            "feed {:.0} % rapid {:.0} % sp {:.0} %",
            status.overrides.feed_percent, status.overrides.rapid_percent, status.overrides.spindle_percent
        )),
        Line::raw(format!("tool T{}  spindle {spindle}", status.tool)),
        Line::raw(format!("coolant {coolant}")),
        Line::raw(format!("jog {step}, {} mm/s", app.speed_mm_s())),
        Line::raw(
            format!("{rotation}{}", status.codes.join(" "))
                .chars()
                .take(120)
                .collect::<String>(),
        ),
    ]
}

fn program_lines(app: &App, program: &[(u32, String)], rows: u16) -> Vec<Line<'static>> {
    let status = app.status();
    let line = status.line;
    let mut lines = vec![Line::raw(match &status.program {
        None => "load one with: isocnc program load FILE".into(),
        Some(of) => match &of.result {
            Some(result) => format!("{result}; {} lines", of.lines),
            None if status.step != Step::Program => format!("loaded, {} lines", of.lines),
            None => format!("line {line} of {}, {}", of.lines, progress::words(status)),
        },
    })];
    let rows = usize::from(rows.saturating_sub(1));
    let at = program.iter().position(|(number, _)| *number == line).unwrap_or(0);
    let first = at.saturating_sub(rows / 2);
    for (number, text) in program.iter().skip(first).take(rows) {
        let is_current = *number == line;
        let mark = if is_current { '>' } else { ' ' };
        let style = if is_current { strong() } else { Style::new() };
        lines.push(Line::styled(format!("{mark}{number:>7}  {text}"), style));
    }
    lines
}

fn messages(app: &App, now_ms: u64, rows: u16) -> Vec<Line<'static>> {
    let mut lines = Vec::new();
    let status = app.status();
    if app.lost.is_none() && now_ms.saturating_sub(app.heard_ms) <= SILENT_MS {
        lines.extend(
            status
                .alarm
                .iter()
                .map(|text| Line::styled(format!("ALARM {text}"), alarm())),
        );
        lines.extend(
            status
                .obstruction
                .iter()
                .map(|text| Line::styled(text.to_string(), strong())),
        );
        let forced = forced_words(&status.forced).map(|forced| Line::styled(format!("FORCED: {forced}"), alarm()));
        lines.extend(forced.take(2));
        if let Some(waiting) = &status.waiting {
            let text = format!("WAITS: {}; {}", waiting.what, waiting.release);
            lines.push(Line::styled(text, strong()));
        }
    }
    let rest = usize::from(rows).saturating_sub(lines.len());
    let shown = status.messages.iter().rev().take(rest).rev();
    lines.extend(shown.map(|entry| Line::raw(entry.text.replace('\n', "; "))));
    lines
}

fn bottom(app: &App) -> Vec<Line<'static>> {
    let first = match (&app.typed, &app.said) {
        (Some(typed), said) => {
            let said = said
                .as_deref()
                .map_or_else(String::new, |said| format!("   {}", said.replace('\n', "; ")));
            Line::styled(format!("MDI> {typed}_{said}"), strong())
        }
        (None, Some(said)) => Line::styled(said.replace('\n', "; "), alarm()),
        (None, None) => match (app.did, app.status().mdi.first()) {
            (Some(did), _) => Line::styled(did, strong()),
            (None, Some(line)) => Line::raw(format!("MDI: {line}")),
            (None, None) => Line::raw(""),
        },
    };
    let mut lines = vec![first];
    match app.typed {
        Some(_) => lines.push(Line::raw(KEYS_OF_LINE)),
        None => lines.extend(KEYS.map(Line::raw)),
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::super::link::News;
    use super::*;
    use protocol::client::Followed;
    use protocol::{
        Activity, Control, Coolant, Entry, LimitSwitches, Mode, Overrides, Power, Spindle, State, Status, StatusAxis,
        StatusProgram,
    };
    use ratatui::Terminal;
    use ratatui::backend::TestBackend;
    use serde_json::{Value, json};

    fn screen(app: &App, program: &[(u32, String)], now_ms: u64, (width, height): (u16, u16)) -> Vec<String> {
        let mut terminal = Terminal::new(TestBackend::new(width, height)).unwrap();
        terminal.draw(|frame| draw(frame, app, program, now_ms)).unwrap();
        let buffer = terminal.backend().buffer().clone();
        let row = |y| {
            (0..width)
                .map(|x| buffer[(x, y)].symbol())
                .collect::<String>()
                .trim_end()
                .to_owned()
        };
        (0..height).map(row).collect()
    }

    fn running() -> App {
        let mut app = App::new();
        let axis = |letter: &str, joints: &[usize]| StatusAxis {
            axis: letter.into(),
            joints: joints.to_vec(),
            unit: "mm".into(),
        };
        let status = Status {
            machine: "mill3".into(),
            power: Power::On,
            mode: Mode::Auto,
            activity: Activity::Running,
            state: State::Running,
            step: Step::Program,
            axes: vec![axis("X", &[0]), axis("Y", &[1, 2]), axis("Z", &[3])],
            position_mm: vec![10.5, -2.25, 3.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
            work_offset_mm: vec![10.0, 0.0, -7.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
            homed: vec![0, 1, 3],
            limit_switches: LimitSwitches {
                lower: Vec::new(),
                upper: vec![3],
            },
            velocity_mm_s: 25.0,
            overrides: Overrides {
                feed_percent: 80.0,
                rapid_percent: 100.0,
                spindle_percent: 100.0,
                ..Overrides::default()
            },
            tool: 5,
            spindle: Some(Spindle {
                on: true,
                speed_rpm: 1200.0,
            }),
            coolant: Coolant {
                flood: true,
                mist: false,
            },
            program: Some(StatusProgram {
                name: "/p/part.ngc".into(),
                lines: 90,
                planned_time_s: 60.0,
                ..StatusProgram::default()
            }),
            line: 7,
            elapsed_s: 12.0,
            remaining_s: Some(3.2),
            done_percent: Some(78.9),
            codes: ["G1", "G17", "G54"].map(str::to_owned).to_vec(),
            single_block: true,
            messages: vec![Entry {
                text: "order: start".into(),
                ..Entry::default()
            }],
            ..Status::default()
        };
        app.hear(News::Is(Box::new(Followed::new(status))), 0);
        app
    }

    fn told(app: &mut App, changed: Value) {
        app.hear(News::Changed(changed.as_object().cloned().unwrap()), 0);
    }

    fn assert_shows(screen: &[String], wanted: &[&str]) {
        for line in wanted {
            assert!(
                screen.iter().any(|row| row.contains(line)),
                "{line:?} is not in\n{}",
                screen.join("\n")
            );
        }
    }

    #[test]
    fn work_coordinates_follow_the_rotation_of_their_system() {
        let mut app = running();
        told(&mut app, json!({ "work_rotation_degrees": 90.0 }));
        let shown = screen(&app, &[], 0, (80, 24));
        // X 0.5 and Y -2.25 of the machine from the origin, seen by a system that is turned by a quarter.
        assert_shows(
            &shown,
            &["X       -2.250    10.500", "Y       -0.500    -2.250", "Z       10.000"],
        );
        assert_shows(&shown, &["rotation 90"]);
    }

    #[test]
    fn a_program_that_runs_fits_into_24_rows_of_80_columns() {
        let program: Vec<(u32, String)> = (1..=90).map(|line| (line, format!("G1 X{line}"))).collect();
        let shown = screen(&running(), &program, 0, (80, 24));
        assert_eq!(shown[0], " mill3  ON  AUTO  running  control: free");
        assert_shows(
            &shown,
            &[
                "axis      work   machine     to go  home limit",
                "X        0.500    10.500            yes",
                "Y       -2.250    -2.250            no",
                "Z       10.000     3.000            yes  UPPER",
                "F 1500 mm/min  SINGLE BLOCK",
                "feed 80 % rapid 100 % sp 100 %",
                "tool T5  spindle 1200 rpm",
                "coolant flood",
                "jog while held, 10 mm/s",
                "G1 G17 G54",
                " program /p/part.ngc ",
                "line 7 of 90, 12 s, 3 s to go, 78 % done",
                ">      7  G1 X7",
                "order: start",
            ],
        );
        for keys in KEYS {
            assert!(keys.len() <= 80, "{keys}");
            assert_shows(&shown, &[keys]);
        }
        assert!(KEYS_OF_LINE.len() <= 80);
        // The larger, the more of the program.
        let large = screen(&running(), &program, 0, (120, 50));
        let lines = |screen: &[String]| screen.iter().filter(|row| row.contains("  G1 X")).count();
        assert!(lines(&large) > lines(&shown) + 20, "{}", large.join("\n"));
        assert_shows(
            &screen(&running(), &program, 0, (40, 10)),
            &["mill3 running: make the window larger"],
        );
    }

    #[test]
    fn alarms_waits_refusals_and_who_has_control_are_shown_in_words() {
        let mut app = running();
        told(
            &mut app,
            json!({ "alarm": { "code": "text", "text": "x-drive lost" }, "activity": "idle", "power": "alarm" }),
        );
        assert_shows(
            &screen(&app, &[], 0, (80, 24)),
            &["ALARM x-drive lost", " mill3  ALARM  AUTO  idle"],
        );
        told(
            &mut app,
            json!({ "activity": "away", "held_at_mm": [12.5, -2.25, 1.0, 0, 0, 0, 0, 0, 0] }),
        );
        let shown = screen(&app, &[], 0, (80, 24));
        assert_shows(
            &shown,
            &[
                "X        0.500    10.500     2.000  yes",
                "Z       10.000     3.000    -2.000  yes",
            ],
        );
        let panel = Control {
            name: "panel".into(),
            taken: true,
            process: 1,
            ..Control::default()
        };
        let waits = json!({
            "for": "tool_change",
            "what": { "code": "text", "text": "put in tool 7" },
            "release": { "code": "text", "text": "isocnc tool-changed" },
        });
        told(&mut app, json!({ "alarm": null, "waiting": waits, "control": panel }));
        let shown = screen(&app, &[], 0, (80, 24));
        assert_shows(&shown, &["WAITS: put in tool 7; isocnc tool-changed", "control: panel"]);
        app.hear(News::Refused("drives are off:\nisocnc on".into()), 0);
        assert_shows(&screen(&app, &[], 0, (80, 24)), &["drives are off:; isocnc on"]);
        app.typed = Some("G0 X".into());
        assert_shows(&screen(&app, &[], 0, (80, 24)), &["MDI> G0 X_", KEYS_OF_LINE]);
        (app.typed, app.said, app.did) = (None, None, Some("Esc: stop"));
        assert_shows(&screen(&app, &[], 0, (80, 24)), &["Esc: stop"]);
    }

    #[test]
    fn the_list_of_keys_fits_on_the_smallest_screen_with_the_state_above_it() {
        let mut app = running();
        app.shows_keys = true;
        for size in [(80, 24), (80, SMALLEST.1)] {
            let shown = screen(&app, &[], 0, size);
            assert_eq!(shown[0], " mill3  ON  AUTO  running  control: free");
            for (key, does) in ALL_KEYS {
                assert_shows(&shown, &[format!(" {key:<10} {does}").trim_end()]);
            }
        }
    }

    /// What is old must not look as if it were so.
    #[test]
    fn a_control_that_is_not_there_or_says_nothing_is_told_of() {
        let mut app = running();
        assert_shows(
            &screen(&app, &[], SILENT_MS + 1500, (80, 24)),
            &[" NOTHING HEARD FOR 4 s: what is shown is old"],
        );
        app.hear(News::Lost("the control has closed the connection".into()), 0);
        let shown = screen(&app, &[], 0, (80, 24));
        assert_eq!(shown[0], " NO CONTROL: the control has closed the connection");
        let new = screen(&App::new(), &[], 0, (80, 24));
        assert_eq!(new[0], " NO CONTROL: connecting");
    }
}
