//! What the screen knows, and what its keys do.
//!
//! In:  news of the control, keys, the time. Out: requests.
//!
//! A terminal tells no release of a key. A jog lives for [`HOLDS_MS`] and each repetition of its key renews it, so that it comes to
//! rest by itself once they end, however that happens.

use super::link::News;
use protocol::client::Followed;
use protocol::params::{self, NoParams};
use protocol::{Activity, Method, State, Status, method};
use ratatui::crossterm::event::{KeyCode, KeyEvent, KeyEventKind, KeyModifiers};
use rt::joint_jog::HOLDS_S;
use serde_json::Value;

/// A jog that is not renewed ends after this, ms.
const HOLDS_MS: u64 = (HOLDS_S * 1000.0) as u64;
/// Between two renewals.
const KEEP_MS: u64 = HOLDS_MS / 4;
/// A key that comes again within this is a repetition, which begins no further step. The first one of a key that is held comes later
/// than a hand can press a key again: what may do harm by that takes [`HELD_MS`].
const REPEATED_MS: u64 = 150;
/// Longest until the first repetition of a key that is held.
const HELD_MS: u64 = 700;
/// Steps that a hand may want quickly one after the other, mm or degrees.
const SMALL_STEP: f64 = 0.1;
/// A terminal sends Esc before the rest of a special key; on a slow line that comes a little later, as keys of its own.
const ESCAPE_MS: u64 = 50;
/// A control that has control is renewed so often, ms.
const RENEW_MS: u64 = 10_000;
/// A control that tells nothing for so long hangs, ms: it counts each second.
pub(super) const SILENT_MS: u64 = 3_000;
/// Lines of MDI that are kept.
const HISTORY_MAX: usize = 100;
const SPEEDS: [f64; 10] = [0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0];
/// Steps, mm or degrees; none: for as long as the key is held.
const STEPS: [Option<f64>; 5] = [None, Some(10.0), Some(1.0), Some(0.1), Some(0.01)];

/// What a key leads to.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Act {
    Send(&'static str, Value),
    Quit,
}

/// Asks for something.
fn send<M: Method>(params: &M::Params) -> Act {
    Act::Send(M::NAME, protocol::rpc::given(params))
}

/// Ends the jog of an axis.
fn stop_jog(axis: &str) -> Act {
    send::<method::JogStop>(&jogging(axis))
}

fn jogging(axis: &str) -> params::Jogging {
    params::Jogging {
        axis: Some(axis.to_owned()),
        joint: None,
    }
}

/// Takes control, by force even from another client.
fn take_control(by_force: bool) -> Act {
    send::<method::TakeControl>(&params::TakeControl {
        name: Some("top".into()),
        force: by_force.then_some(true),
    })
}

/// A key that moves.
#[derive(Clone, Debug, PartialEq)]
struct Jog {
    axis: String,
    sign: f64,
    is_step: bool,
    begun_ms: u64,
    /// When its key came last.
    key_ms: u64,
    kept_ms: u64,
}

/// The screen's state.
#[derive(Debug, Default)]
pub(super) struct App {
    /// What the control has told.
    state: Followed,
    /// Why there is no control.
    pub(super) lost: Option<String>,
    pub(super) heard_ms: u64,
    /// What came of the last key.
    pub(super) said: Option<String>,
    /// What the last key did, where that may surprise.
    pub(super) did: Option<&'static str>,
    /// All keys are shown in place of the machine.
    pub(super) shows_keys: bool,
    /// The line that is being typed.
    pub(super) typed: Option<String>,
    history: Vec<String>,
    /// Place in it.
    recalled: usize,
    speed: usize,
    step: usize,
    jog: Option<Jog>,
    renewed_ms: u64,
    /// When Esc came, if what follows may belong to it; and whether it does.
    escaped_ms: Option<u64>,
    in_special: bool,
    /// The key that gave the last order, and when.
    last_command: Option<(KeyCode, u64)>,
}

impl App {
    pub(super) fn new() -> App {
        App {
            speed: 6,
            lost: Some("connecting".into()),
            ..App::default()
        }
    }

    /// How everything is, as far as the control has told.
    pub(super) fn status(&self) -> &Status {
        self.state.status()
    }

    pub(super) fn speed_mm_s(&self) -> f64 {
        SPEEDS[self.speed]
    }

    pub(super) fn step_mm(&self) -> Option<f64> {
        STEPS[self.step]
    }

    /// Whether this process has taken control.
    pub(super) fn has_control(&self) -> bool {
        let holder = self.status().control.as_ref();
        holder.is_some_and(|holder| holder.taken && holder.process == std::process::id())
    }

    pub(super) fn hear(&mut self, news: News, now_ms: u64) {
        self.heard_ms = now_ms;
        match news {
            News::Is(state) => {
                self.state = *state;
                self.lost = None;
                self.said = None;
            }
            News::Changed(changed) => {
                if let Err(error) = self.state.change(changed) {
                    self.said = Some(error.to_string());
                }
            }
            News::Done => self.said = None,
            News::Refused(why) => {
                self.jog = None;
                self.said = Some(why);
            }
            News::Lost(why) => {
                self.jog = None;
                self.lost = Some(why);
            }
        }
    }

    /// What is due by now.
    pub(super) fn tick(&mut self, now_ms: u64) -> Vec<Act> {
        let mut acts = Vec::new();
        if self.has_control() && now_ms - self.renewed_ms >= RENEW_MS {
            self.renewed_ms = now_ms;
            acts.push(take_control(false));
        }
        let status = self.status();
        let is_jogging = matches!(status.state, State::Jogging | State::Away) && status.velocity_mm_s != 0.0;
        let Some(jog) = &mut self.jog else { return acts };
        let is_over = match jog.is_step {
            // It may take a moment until it is told of.
            true => now_ms - jog.begun_ms > 2 * HOLDS_MS && !is_jogging,
            false => now_ms - jog.key_ms >= HOLDS_MS,
        };
        if is_over {
            acts.push(stop_jog(&jog.axis));
            self.jog = None;
        } else if jog.is_step && now_ms - jog.kept_ms >= KEEP_MS {
            jog.kept_ms = now_ms;
            acts.push(send::<method::JogKeep>(&jogging(&jog.axis)));
        }
        acts
    }

    pub(super) fn key(&mut self, key: KeyEvent, now_ms: u64) -> Vec<Act> {
        if key.kind == KeyEventKind::Release {
            return Vec::new();
        }
        if key.modifiers.contains(KeyModifiers::CONTROL) {
            return match key.code {
                KeyCode::Char('c') => vec![Act::Quit],
                _ => Vec::new(),
            };
        }
        if key.code == KeyCode::Esc {
            return self.escape(now_ms);
        }
        if self.is_rest_of_special(key.code, now_ms) {
            return Vec::new();
        }
        self.did = None;
        if std::mem::take(&mut self.shows_keys) {
            return Vec::new();
        }
        if self.typed.is_some() {
            return self.key_of_line(key.code);
        }
        let (axis, sign) = match key.code {
            KeyCode::Right => (0, 1.0),
            KeyCode::Left => (0, -1.0),
            KeyCode::Up => (1, 1.0),
            KeyCode::Down => (1, -1.0),
            KeyCode::PageUp => (2, 1.0),
            KeyCode::PageDown => (2, -1.0),
            KeyCode::Char(']') => (3, 1.0),
            KeyCode::Char('[') => (3, -1.0),
            code => return self.command(code, now_ms),
        };
        match self.status().axes.get(axis).map(|axis| axis.axis.clone()) {
            Some(axis) => self.jog(axis, sign, now_ms),
            None => Vec::new(),
        }
    }

    /// Stops whatever is being done; only where nothing is, a line that is being typed is left without a stop.
    fn escape(&mut self, now_ms: u64) -> Vec<Act> {
        self.escaped_ms = Some(now_ms);
        self.shows_keys = false;
        let jogged = self.jog.take().is_some();
        let was_typed = self.typed.take().is_some();
        let status = self.status();
        let rests = status.activity == Activity::Idle && status.velocity_mm_s == 0.0 && status.mdi.is_empty();
        if was_typed && rests && !jogged && self.lost.is_none() {
            self.did = Some("line left; nothing was stopped: Esc again stops");
            return Vec::new();
        }
        self.did = Some("Esc: stop");
        vec![send::<method::Stop>(&NoParams {})]
    }

    /// Whether it is what a slow line has left of a key such as an arrow: `[` or `O` behind Esc, and what follows up to a letter.
    fn is_rest_of_special(&mut self, code: KeyCode, now_ms: u64) -> bool {
        let Some(escaped_ms) = self.escaped_ms else {
            return false;
        };
        let KeyCode::Char(letter) = code else {
            self.escaped_ms = None;
            return false;
        };
        let begins = matches!(letter, '[' | 'O') && !self.in_special;
        if now_ms - escaped_ms > ESCAPE_MS || !(begins || self.in_special) {
            (self.escaped_ms, self.in_special) = (None, false);
            return false;
        }
        let ends = self.in_special && (letter.is_ascii_alphabetic() || letter == '~');
        self.in_special = !ends;
        self.escaped_ms = (!ends).then_some(now_ms);
        true
    }

    fn command(&mut self, code: KeyCode, now_ms: u64) -> Vec<Act> {
        // A key that is held gives no order twice: in single block, each resume would be another block.
        let last = self.last_command.replace((code, now_ms));
        let is_held = last.is_some_and(|(last, last_ms)| last == code && now_ms - last_ms < HELD_MS);
        if is_held && matches!(code, KeyCode::Char('r' | 'S' | 'H' | 'b' | 'E' | 'o' | 'O' | 't')) {
            return Vec::new();
        }
        let none = NoParams {};
        let feed = |by: f64| {
            let percent = self.status().overrides.feed_percent + by;
            vec![send::<method::Override>(&params::Override {
                feed: Some(percent.clamp(0.0, 120.0)),
                ..Default::default()
            })]
        };
        match code {
            KeyCode::Char('q') => vec![Act::Quit],
            KeyCode::Char('?') => {
                self.shows_keys = true;
                self.end_jog()
            }
            KeyCode::Char(' ') => vec![send::<method::Hold>(&none)],
            KeyCode::Char('r') => vec![send::<method::Resume>(&none)],
            KeyCode::Char('e') => vec![send::<method::Estop>(&none)],
            KeyCode::Char('E') => vec![send::<method::EstopReset>(&none)],
            KeyCode::Char('o') => vec![send::<method::On>(&none)],
            KeyCode::Char('O') => vec![send::<method::Off>(&none)],
            KeyCode::Char('H') => vec![send::<method::Home>(&params::Home::default())],
            // The one that is on the screen.
            KeyCode::Char('S') => vec![send::<method::ProgramStart>(&params::ProgramStart {
                revision: self.status().program.as_ref().map(|program| program.revision),
                ..Default::default()
            })],
            KeyCode::Char('a') => vec![send::<method::Acknowledge>(&none)],
            KeyCode::Char('t') => vec![send::<method::ToolChanged>(&none)],
            KeyCode::Char('b') => {
                let on = !self.status().single_block;
                vec![send::<method::SingleBlock>(&params::Switch { on })]
            }
            KeyCode::Char('c') if self.has_control() => vec![send::<method::ReleaseControl>(&none)],
            KeyCode::Char('c') => vec![take_control(false)],
            KeyCode::Char('C') => vec![take_control(true)],
            KeyCode::Char('+') => feed(10.0),
            KeyCode::Char('-') => feed(-10.0),
            KeyCode::Char('>') => {
                self.speed = (self.speed + 1).min(SPEEDS.len() - 1);
                Vec::new()
            }
            KeyCode::Char('<') => {
                self.speed = self.speed.saturating_sub(1);
                Vec::new()
            }
            KeyCode::Char('x') => {
                // A key that is held goes on with what it began.
                self.step = (self.step + 1) % STEPS.len();
                self.end_jog()
            }
            KeyCode::Char('m') | KeyCode::Enter => {
                self.typed = Some(String::new());
                self.recalled = self.history.len();
                self.end_jog()
            }
            _ => Vec::new(),
        }
    }

    fn end_jog(&mut self) -> Vec<Act> {
        let jog = self.jog.take();
        jog.map(|jog| stop_jog(&jog.axis)).into_iter().collect()
    }

    fn jog(&mut self, axis: String, sign: f64, now_ms: u64) -> Vec<Act> {
        let mut acts = Vec::new();
        let step_mm = self.step_mm();
        match &mut self.jog {
            Some(jog) if jog.axis == axis && jog.sign == sign => {
                let since_key_ms = now_ms - std::mem::replace(&mut jog.key_ms, now_ms);
                let repeated_ms = match step_mm {
                    Some(step_mm) if step_mm > SMALL_STEP => HELD_MS,
                    _ => REPEATED_MS,
                };
                if jog.is_step && since_key_ms < repeated_ms {
                    return acts;
                }
                if !jog.is_step {
                    if now_ms - jog.kept_ms >= KEEP_MS {
                        jog.kept_ms = now_ms;
                        acts.push(send::<method::JogKeep>(&jogging(&axis)));
                    }
                    return acts;
                }
            }
            Some(_) => acts = self.end_jog(),
            None => {}
        }
        let speed_mm_s = self.speed_mm_s();
        acts.push(send::<method::Jog>(&params::Jog {
            axis: Some(axis.clone()),
            joint: None,
            velocity_mm_s: if step_mm.is_some() {
                speed_mm_s
            } else {
                sign * speed_mm_s
            },
            distance_mm: step_mm.map(|step_mm| sign * step_mm),
        }));
        self.jog = Some(Jog {
            axis,
            sign,
            is_step: step_mm.is_some(),
            begun_ms: now_ms,
            key_ms: now_ms,
            kept_ms: now_ms,
        });
        acts
    }

    /// A key while a line is being typed.
    fn key_of_line(&mut self, code: KeyCode) -> Vec<Act> {
        let Some(line) = &mut self.typed else { return Vec::new() };
        match code {
            KeyCode::Char(letter) => line.push(letter),
            KeyCode::Backspace => drop(line.pop()),
            KeyCode::Up | KeyCode::Down => {
                self.recalled = match code {
                    KeyCode::Up => self.recalled.saturating_sub(1),
                    _ => (self.recalled + 1).min(self.history.len()),
                };
                *line = self.history.get(self.recalled).cloned().unwrap_or_default();
            }
            KeyCode::Enter if line.trim().is_empty() => self.typed = None,
            KeyCode::Enter => {
                let line = std::mem::take(line);
                if self.history.last() != Some(&line) {
                    self.history.push(line.clone());
                }
                if self.history.len() > HISTORY_MAX {
                    self.history.remove(0);
                }
                self.recalled = self.history.len();
                return vec![send::<method::Mdi>(&params::Mdi { line })];
            }
            _ => {}
        }
        Vec::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use protocol::{Control, Overrides, StatusAxis, StatusProgram};
    use serde_json::json;

    fn app() -> App {
        let mut app = App::new();
        let axis = |letter: &str| StatusAxis {
            axis: letter.into(),
            ..StatusAxis::default()
        };
        let status = Status {
            axes: ["X", "Y", "Z"].map(axis).to_vec(),
            state: State::Ready,
            overrides: Overrides {
                feed_percent: 100.0,
                ..Overrides::default()
            },
            ..Status::default()
        };
        app.hear(News::Is(Box::new(Followed::new(status))), 0);
        app
    }

    fn press(app: &mut App, code: KeyCode, ms: u64) -> Vec<Act> {
        app.key(KeyEvent::new(code, KeyModifiers::NONE), ms)
    }

    fn send(method: &'static str, params: Value) -> Vec<Act> {
        vec![Act::Send(method, params)]
    }

    #[test]
    fn a_jog_is_renewed_by_repetitions_of_its_key_and_ends_without_them() {
        let mut app = app();
        let begun = send("jog", json!({ "axis": "Y", "velocity_mm_s": -10.0 }));
        assert_eq!(press(&mut app, KeyCode::Down, 1000), begun);
        assert_eq!(press(&mut app, KeyCode::Down, 1030), []);
        assert_eq!(
            press(&mut app, KeyCode::Down, 1060),
            send("jog.keep", json!({ "axis": "Y" }))
        );
        assert_eq!(app.tick(1259), []);
        assert_eq!(app.tick(1260), send("jog.stop", json!({ "axis": "Y" })));
        assert_eq!(app.tick(1400), []);
        // The other way, and another axis: the first one ends.
        press(&mut app, KeyCode::Down, 2000);
        let acts = press(&mut app, KeyCode::Up, 2010);
        assert_eq!(acts[0], Act::Send("jog.stop", json!({ "axis": "Y" })));
        assert_eq!(acts[1], Act::Send("jog", json!({ "axis": "Y", "velocity_mm_s": 10.0 })));
        assert_eq!(press(&mut app, KeyCode::PageUp, 2020).len(), 2);
        // Refused: nothing is renewed.
        app.hear(News::Refused("not now".into()), 2030);
        assert_eq!((app.tick(2500), app.said.as_deref()), (vec![], Some("not now")));
        assert_eq!(press(&mut app, KeyCode::Char(']'), 3000), [], "there is no fourth axis");
    }

    #[test]
    fn a_step_is_taken_once_a_press_and_kept_until_it_is_over() {
        let mut app = app();
        press(&mut app, KeyCode::Char('x'), 0);
        press(&mut app, KeyCode::Char('>'), 0);
        let step = send(
            "jog",
            json!({ "axis": "X", "velocity_mm_s": 20.0, "distance_mm": -10.0 }),
        );
        assert_eq!(press(&mut app, KeyCode::Left, 1000), step);
        assert_eq!(press(&mut app, KeyCode::Left, 1100), [], "repeated");
        app.hear(
            News::Changed(
                json!({ "state": "jogging", "velocity_mm_s": 20.0 })
                    .as_object()
                    .cloned()
                    .unwrap(),
            ),
            1100,
        );
        assert_eq!(app.tick(1101), send("jog.keep", json!({ "axis": "X" })));
        assert_eq!(
            press(&mut app, KeyCode::Left, 1700),
            [],
            "the first repetition of a key that is held"
        );
        assert_eq!(press(&mut app, KeyCode::Left, 2500), step, "another one");
        app.tick(2600);
        app.hear(
            News::Changed(json!({ "velocity_mm_s": 0.0 }).as_object().cloned().unwrap()),
            2950,
        );
        assert_eq!(app.tick(2951), send("jog.stop", json!({ "axis": "X" })));
        // Small ones as quickly as a hand wants them.
        for _ in 0..2 {
            press(&mut app, KeyCode::Char('x'), 3000);
        }
        for ms in [4000, 4200, 4400] {
            assert_eq!(press(&mut app, KeyCode::Left, ms).len(), 1, "{ms}");
        }
    }

    #[test]
    fn a_key_that_is_held_gives_its_order_once() {
        let mut app = app();
        assert_eq!(press(&mut app, KeyCode::Char('r'), 1000), send("resume", json!({})));
        for ms in [1500, 1530, 1560, 2100] {
            assert_eq!(press(&mut app, KeyCode::Char('r'), ms), [], "{ms}");
        }
        assert_eq!(press(&mut app, KeyCode::Char('r'), 2900), send("resume", json!({})));
        // A stop and a hold are never too many.
        for ms in [3000, 3030] {
            assert_eq!(press(&mut app, KeyCode::Char(' '), ms), send("hold", json!({})));
        }
    }

    #[test]
    fn an_arrow_that_comes_in_pieces_is_a_stop_and_nothing_else() {
        let mut app = app();
        for rest in ["[C", "OA", "[5~"] {
            assert_eq!(press(&mut app, KeyCode::Esc, 1000), send("stop", json!({})));
            for (place, letter) in rest.chars().enumerate() {
                assert_eq!(
                    press(&mut app, KeyCode::Char(letter), 1010 + place as u64),
                    [],
                    "{rest}"
                );
            }
            assert_eq!(
                press(&mut app, KeyCode::Char('o'), 1030),
                send("on", json!({})),
                "{rest}"
            );
            app.last_command = None;
        }
        // What a hand presses behind it counts.
        press(&mut app, KeyCode::Esc, 2000);
        assert_eq!(press(&mut app, KeyCode::Char('O'), 2200), send("off", json!({})));
    }

    #[test]
    fn escape_stops_whatever_is_being_done_and_letters_are_no_orders_in_a_line() {
        let mut app = app();
        press(&mut app, KeyCode::Char('m'), 0);
        for letter in "G0 X1 e".chars() {
            assert_eq!(press(&mut app, KeyCode::Char(letter), 0), []);
        }
        press(&mut app, KeyCode::Backspace, 0);
        assert_eq!(
            press(&mut app, KeyCode::Enter, 0),
            send("mdi", json!({ "line": "G0 X1 " }))
        );
        press(&mut app, KeyCode::Char('M'), 0);
        for (code, line) in [(KeyCode::Up, "G0 X1 "), (KeyCode::Up, "G0 X1 "), (KeyCode::Down, "")] {
            press(&mut app, code, 0);
            assert_eq!(app.typed.as_deref(), Some(line));
        }
        // A line is left without a stop only where nothing is under way.
        assert_eq!(press(&mut app, KeyCode::Esc, 0), []);
        assert_eq!((app.typed.take(), app.did.is_some()), (None, true));
        assert_eq!(press(&mut app, KeyCode::Esc, 0), send("stop", json!({})));
        for under_way in [
            json!({ "activity": "running" }),
            json!({ "activity": "idle", "mdi": ["G0 X1"] }),
            json!({ "activity": "idle", "mdi": [], "velocity_mm_s": 0.1 }),
        ] {
            press(&mut app, KeyCode::Char('m'), 5000);
            app.hear(News::Changed(under_way.as_object().cloned().unwrap()), 5000);
            assert_eq!(
                press(&mut app, KeyCode::Esc, 5000),
                send("stop", json!({})),
                "{under_way}"
            );
            assert_eq!((app.typed.take(), app.did), (None, Some("Esc: stop")));
        }
        assert_eq!(press(&mut app, KeyCode::Char('e'), 6000), send("estop", json!({})));
        assert_eq!(app.did, None, "it stood until the next key");
        assert_eq!(
            press(&mut app, KeyCode::Char('-'), 7000),
            send("override", json!({ "feed": 90.0 }))
        );
        let ctrl_c = KeyEvent::new(KeyCode::Char('c'), KeyModifiers::CONTROL);
        assert_eq!(app.key(ctrl_c, 0), [Act::Quit]);
    }

    #[test]
    fn the_list_of_keys_is_left_by_any_key_which_does_nothing_else_but_stop() {
        let mut app = app();
        for leaves in [KeyCode::Char('o'), KeyCode::Right, KeyCode::Enter, KeyCode::Char('?')] {
            assert_eq!((press(&mut app, KeyCode::Char('?'), 0), app.shows_keys), (vec![], true));
            assert_eq!((press(&mut app, leaves, 0), app.shows_keys), (vec![], false));
        }
        press(&mut app, KeyCode::Char('?'), 0);
        assert_eq!(press(&mut app, KeyCode::Esc, 0), send("stop", json!({})));
        assert!(!app.shows_keys);
        // In a line it is a letter.
        press(&mut app, KeyCode::Char('m'), 9000);
        press(&mut app, KeyCode::Char('?'), 9000);
        assert_eq!((app.typed.as_deref(), app.shows_keys), (Some("?"), false));
    }

    #[test]
    fn a_start_names_the_program_that_is_on_the_screen() {
        let mut app = app();
        assert_eq!(press(&mut app, KeyCode::Char('S'), 0), send("program.start", json!({})));
        let program = StatusProgram {
            name: "part.ngc".into(),
            revision: 7,
            ..StatusProgram::default()
        };
        let shown = json!({ "program": program });
        app.hear(News::Changed(shown.as_object().cloned().unwrap()), 2000);
        assert_eq!(
            press(&mut app, KeyCode::Char('S'), 2000),
            send("program.start", json!({ "revision": 7 }))
        );
    }

    #[test]
    fn control_that_was_taken_is_renewed() {
        let mut app = app();
        assert_eq!(app.tick(20_000), []);
        let control = Control {
            taken: true,
            process: std::process::id(),
            ..Control::default()
        };
        let mine = json!({ "control": control });
        app.hear(News::Changed(mine.as_object().cloned().unwrap()), 20_000);
        assert_eq!(app.tick(20_000), send("control.take", json!({ "name": "top" })));
        assert_eq!(app.tick(29_999), []);
        assert_eq!(
            press(&mut app, KeyCode::Char('c'), 30_000),
            send("control.release", json!({}))
        );
    }
}
