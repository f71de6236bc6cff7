use super::screen::{Act, App, begin_anew};
use super::*;
use clap::Parser;
use hal_pins::scope::Sampler;
use hal_pins::{Hal, Output};
use ratatui::Terminal;
use ratatui::backend::TestBackend;
use ratatui::crossterm::event::{KeyCode, KeyEvent, KeyModifiers};

#[derive(Parser)]
struct Cli {
    #[command(flatten)]
    args: ScopeArgs,
}

struct Rig {
    sampler: Option<Sampler>,
    count: Output<i32>,
    wave: Output<f64>,
    on: Output<bool>,
    pins: Attached,
    cycles: u64,
    _hal: Hal,
    folder: tempfile::TempDir,
}

fn rig() -> Rig {
    let folder = tempfile::tempdir().unwrap();
    let dirs = [folder.path().to_owned()];
    let mut hal = Hal::create_in(&dirs, "m", 64).unwrap();
    let count = hal.output("a.count").unwrap();
    let wave = hal.output("a.wave").unwrap();
    let on = hal.output("a.on").unwrap();
    hal.set_unit("a.wave", "mm").unwrap();
    for number in 0..40 {
        hal.input(&format!("many.{number}"), 0.0).unwrap();
    }
    Rig {
        sampler: Some(Sampler::new(&hal, 1_000_000).unwrap()),
        count,
        wave,
        on,
        pins: Attached::attach_in(&dirs, "m").unwrap(),
        cycles: 0,
        _hal: hal,
        folder,
    }
}

impl Rig {
    fn cycles(&mut self, count: u64) {
        for _ in 0..count {
            self.count.set(self.cycles as i32 - 5);
            self.wave.set((self.cycles as f64 * 0.05).sin());
            self.on.set(self.cycles / 100 % 2 == 1);
            if let Some(sampler) = &mut self.sampler {
                sampler.sample(9_000_000_000 + self.cycles * 1_000_000);
            }
            self.cycles += 1;
        }
    }

    fn file(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn args(&self, line: &str) -> ScopeArgs {
        let line = line.replace("DIR", &self.folder.path().display().to_string());
        Cli::try_parse_from(std::iter::once("scope").chain(line.split(' ')))
            .unwrap()
            .args
    }

    /// Runs a recording over so many cycles, a few at a time; what it says at its end, and what it printed.
    fn record(&mut self, line: &str, as_json: bool, cycles: u64) -> anyhow::Result<(Outcome, String)> {
        let (args, mut out) = (self.args(line), Vec::new());
        let wanted = args.wanted(&self.pins)?;
        let pins = Attached::attach_in(&[self.folder.path().to_owned()], "m")?;
        let mut recording = Recording::begin(&args, "m", &pins, &wanted, as_json, &mut out)?;
        for _ in 0..cycles / 10 {
            self.cycles(10);
            if !recording.look()? {
                break;
            }
        }
        let told = recording.finish()?;
        Ok((told, String::from_utf8(out).unwrap()))
    }
}

#[test]
fn a_recording_is_a_table_and_a_picture() {
    let mut rig = rig();
    let (told, _) = rig
        .record(
            "a.count a.wave a.on --seconds 0.25 --csv DIR/a.csv --svg DIR/a.svg",
            false,
            1000,
        )
        .unwrap();
    assert!(
        told.is_whole && told.text.starts_with("250 cycles of 3 pins, 0.250 s, 0 lost: "),
        "{}",
        told.text
    );
    let csv = std::fs::read_to_string(rig.file("a.csv")).unwrap();
    let lines: Vec<&str> = csv.lines().collect();
    assert_eq!(
        lines[..3],
        [
            "t_s,a.count,a.wave,a.on",
            "0.000000,-5,0,0",
            "0.001000,-4,0.04997916927067833,0"
        ]
    );
    assert_eq!((lines.len(), lines[250].split(',').next()), (251, Some("0.249000")));
    let svg = std::fs::read_to_string(rig.file("a.svg")).unwrap();
    assert!(roxmltree::Document::parse(&svg).is_ok() && svg.contains(">a.wave<"));
}

#[test]
fn a_record_lies_around_its_trigger_and_normal_goes_on() {
    let mut rig = rig();
    let line = "a.wave --trigger a.on --seconds 0.02 --before 25 --csv DIR/a.csv";
    let (told, _) = rig.record(line, false, 1000).unwrap();
    assert!(
        told.is_whole && told.text.starts_with("20 cycles of 1 pin, 0.020 s, 0 lost"),
        "{}",
        told.text
    );
    let csv = std::fs::read_to_string(rig.file("a.csv")).unwrap();
    let times: Vec<&str> = csv
        .lines()
        .skip(1)
        .map(|line| line.split(',').next().unwrap())
        .collect();
    assert_eq!((times[0], times[5], times[19]), ("-0.005000", "0.000000", "0.014000"));
    let (told, _) = rig.record(&format!("{line} --mode normal"), false, 1000).unwrap();
    assert!(told.text.starts_with("100 cycles"), "five times on: {}", told.text);
    let csv = std::fs::read_to_string(rig.file("a.csv")).unwrap();
    let times: Vec<f64> = csv
        .lines()
        .skip(1)
        .map(|line| line.split(',').next().unwrap().parse().unwrap())
        .collect();
    assert!(times.is_sorted(), "one time for all records: {times:?}");
    assert!(times.contains(&0.2), "the second one begins a period later");
}

#[test]
fn what_never_comes_leaves_files_as_they_were() {
    let mut rig = rig();
    std::fs::write(rig.file("old.csv"), "precious").unwrap();
    let line = |file: &str| format!("a.wave --trigger a.wave>5 --csv DIR/{file}");
    let (told, _) = rig.record(&line("old.csv"), false, 100).unwrap();
    assert_eq!(
        (told.text.as_str(), told.is_whole),
        ("nothing was recorded: no trigger came", false)
    );
    assert_eq!(std::fs::read_to_string(rig.file("old.csv")).unwrap(), "precious");
    rig.record(&line("new.csv"), false, 100).unwrap();
    assert!(!rig.file("new.csv").exists());
    let refused = rig.record(&line("none/new.csv"), false, 100).err().unwrap();
    assert!(
        format!("{refused:#}").contains("none/new.csv: No such file"),
        "{refused:#}"
    );
}

#[test]
fn losses_and_a_control_that_ends_are_told() {
    let mut rig = rig();
    let (args, mut out) = (rig.args("a.count --csv DIR/a.csv --seconds 100000"), Vec::new());
    let wanted = args.wanted(&rig.pins).unwrap();
    let pins = Attached::attach_in(&[rig.folder.path().to_owned()], "m").unwrap();
    let mut recording = Recording::begin(&args, "m", &pins, &wanted, false, &mut out).unwrap();
    rig.cycles(50_000);
    rig.sampler = None;
    while recording.look().unwrap() {}
    let told = recording.finish().unwrap();
    let depth = (1 << 17) / 3;
    let lost = 50_000 - depth;
    let expected = format!(
        "{depth} cycles of 1 pin, {:.3} s, {lost} lost: ",
        f64::from(depth) / 1000.0
    );
    assert!(told.text.starts_with(&expected), "{}", told.text);
    assert!(told.text.contains("did not read them in time") && told.text.ends_with("the control has ended"));
    assert!(!told.is_whole);
    let csv = std::fs::read_to_string(rig.file("a.csv")).unwrap();
    assert_eq!(csv.lines().count(), 1 + depth as usize, "what was recorded is kept");
}

#[test]
fn follow_prints_lines_as_they_come() {
    let mut rig = rig();
    let (_, out) = rig.record("a.count a.on --follow --seconds 0.003", false, 100).unwrap();
    assert_eq!(out, "t_s,a.count,a.on\n0.000000,-5,0\n0.001000,-4,0\n0.002000,-3,0\n");
    let (_, out) = rig.record("a.count --follow --seconds 0.002", true, 100).unwrap();
    assert_eq!(out.lines().count(), 2);
    let line: serde_json::Value = serde_json::from_str(out.lines().nth(1).unwrap()).unwrap();
    assert_eq!(line["t_s"], 0.001);
}

#[test]
fn refusals_say_what_is_wrong() {
    let mut rig = rig();
    let mut refused = |line: &str| format!("{:#}", rig.record(line, false, 10).err().unwrap());
    assert_eq!(
        refused("a.wvae --follow"),
        "no pin or net 'a.wvae'; did you mean 'a.wave'?"
    );
    assert_eq!(
        refused("many.* --follow"),
        "40 pins fit, 32 are shown at the most: name fewer"
    );
    assert!(refused("a.on --follow --seconds -1").contains("expected a length above 0"));
    assert!(refused("a.on --follow --mode normal").contains("expected a trigger"));
    assert!(refused("a.on --follow --before 101").contains("expected 0 to 100 %"));
    let wrong = Cli::try_parse_from(["scope", "a.on", "--trigger", "a.on>>1"])
        .err()
        .unwrap()
        .to_string();
    assert!(wrong.contains("trigger, column 6: expected a number"), "{wrong}");
}

fn screen_of(app: &App, (width, height): (u16, u16)) -> Vec<String> {
    let mut terminal = Terminal::new(TestBackend::new(width, height)).unwrap();
    terminal.draw(|frame| view::draw(frame, app)).unwrap();
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

fn key(app: &mut App, code: KeyCode) -> Act {
    app.key(KeyEvent::new(code, KeyModifiers::NONE))
}

fn app(rig: &Rig, line: &str) -> (App, Stream) {
    let args = rig.args(line);
    let mut app = App::new("m", args.wanted(&rig.pins).unwrap(), rig.folder.path());
    let stream = Stream::begin(&rig.pins, &app.wanted).unwrap();
    app.begin(&stream);
    (app, stream)
}

#[test]
fn a_screen_of_80_by_24_shows_lanes_values_and_keys() {
    let mut rig = rig();
    let (mut app, mut stream) = app(&rig, "a.wave a.on a.count");
    let waiting = screen_of(&app, (80, 24));
    assert!(
        waiting[0].contains("m  roll  5 s  waiting for a cycle"),
        "{}",
        waiting[0]
    );
    rig.cycles(4000);
    stream.read(9999, |_, step| app.take(step)).unwrap();
    let shown = screen_of(&app, (80, 24));
    println!("{}", shown.join("\n"));
    assert!(shown[0].contains("m  roll  5 s  running"), "{}", shown[0]);
    for text in [
        ">a.wave",
        " a.on",
        " a.count",
        "3994",
        "-1.0000..1.0000",
        "0.000 s",
        "5.000 s",
        "q quit",
        "t trigger",
    ] {
        assert!(shown.iter().any(|row| row.contains(text)), "{text}: {shown:#?}");
    }
    let is_braille = |letter: char| ('\u{2801}'..='\u{28FF}').contains(&letter);
    let dots = |rows: &[String]| {
        rows.iter()
            .flat_map(|row| row.chars())
            .filter(|letter| is_braille(*letter))
            .count()
    };
    assert!(dots(&shown) > 100);
    // All over each other, and a window that is too small.
    key(&mut app, KeyCode::Char('o'));
    assert!(dots(&screen_of(&app, (80, 24))) > 50);
    assert_eq!(screen_of(&app, (30, 8))[0], "make the window larger");
    // Nothing that is not shown: 32 lanes do not fit, those around the selected one do.
    let (mut many, _stream) = {
        drop(stream);
        self::app(&rig, "many.1* many.2* many.3?")
    };
    assert_eq!(many.channels.len(), 32);
    for _ in 0..40 {
        key(&mut many, KeyCode::Down);
    }
    assert!(screen_of(&many, (80, 24)).iter().any(|row| row.contains(">many.3")));
}

#[test]
fn keys_set_trigger_mode_and_time() {
    let mut rig = rig();
    let (mut app, stream) = app(&rig, "a.wave a.on");
    assert_eq!(key(&mut app, KeyCode::Char('m')), Act::Nothing);
    assert!(app.said.as_deref().unwrap().contains("t types one"));
    key(&mut app, KeyCode::Char('t'));
    assert_eq!(app.typed.as_deref(), Some("a.wave>"));
    key(&mut app, KeyCode::Char('x'));
    assert_eq!(key(&mut app, KeyCode::Enter), Act::Nothing);
    assert!(app.said.as_deref().unwrap().contains("expected a number"));
    assert!(
        screen_of(&app, (80, 24))
            .iter()
            .any(|row| row.starts_with("trigger> a.wave>x_"))
    );
    key(&mut app, KeyCode::Backspace);
    "0.5"
        .chars()
        .for_each(|letter| _ = key(&mut app, KeyCode::Char(letter)));
    assert_eq!(key(&mut app, KeyCode::Enter), Act::Begin);
    assert_eq!((app.mode(), app.length_s()), (Mode::Normal, 5.0));
    for _ in 0..6 {
        key(&mut app, KeyCode::Char('-'));
    }
    assert_eq!(app.length_s(), 0.05);
    assert_eq!(key(&mut app, KeyCode::Right), Act::Begin);
    assert_eq!(app.wanted.before_percent, 50.0);
    drop(stream);
    let mut stream = Stream::begin(&rig.pins, &app.wanted).unwrap();
    app.begin(&stream);
    rig.cycles(100);
    stream.read(9999, |_, step| app.take(step)).unwrap();
    let shown = screen_of(&app, (80, 24));
    assert!(shown[0].contains("normal 1  0.05 s"), "{}", shown[0]);
    assert!(shown[0].contains("trigger a.wave>0.5"), "{}", shown[0]);
    assert!(shown.iter().any(|row| row.contains("-0.025 s")), "{shown:#?}");
    // What is frozen stays, whatever comes.
    key(&mut app, KeyCode::Char(' '));
    rig.cycles(400);
    stream.read(9999, |_, step| app.take(step)).unwrap();
    assert_eq!(screen_of(&app, (80, 24))[3..20], shown[3..20]);
    key(&mut app, KeyCode::Char('w'));
    assert_eq!(app.said.as_deref(), Some("written: scope-1.csv, scope-1.svg"));
    key(&mut app, KeyCode::Char('w'));
    let csv = std::fs::read_to_string(rig.file("scope-2.csv")).unwrap();
    assert!(csv.starts_with("t_s,a.wave,a.on\n-0."), "{csv}");
    assert!(
        std::fs::read_to_string(rig.file("scope-1.svg"))
            .unwrap()
            .contains("0 is the trigger: a.wave&gt;0.5")
    );
    assert_eq!(key(&mut app, KeyCode::Char('s')), Act::Begin);
    assert_eq!(app.mode(), Mode::Single);
    key(&mut app, KeyCode::Char('t'));
    (0..40).for_each(|_| _ = key(&mut app, KeyCode::Backspace));
    assert_eq!(key(&mut app, KeyCode::Enter), Act::Begin);
    assert_eq!((app.mode(), app.wanted.trigger.is_none()), (Mode::Roll, true));
    assert_eq!(key(&mut app, KeyCode::Char('q')), Act::Quit);
}

#[test]
fn hours_on_the_screen_take_no_more_than_a_minute() {
    let mut rig = rig();
    let (mut app, mut stream) = app(&rig, "a.wave");
    for _ in 0..10 {
        rig.cycles(40_000);
        stream.read(usize::MAX, |_, step| app.take(step)).unwrap();
    }
    assert_eq!(app.trace.of(0).count(), 60_001);
    assert_eq!(app.trace.last_ns(), Some(399_999_000_000));
}

#[test]
fn a_trigger_that_cannot_be_leaves_what_was_there() {
    let rig = rig();
    let wanted = Wanted {
        pins: vec!["a.wave".into()],
        trigger: Some(Trigger::parse("a.wave>0.5").unwrap()),
        ..Wanted::default()
    };
    let mut app = App::new("m", wanted, rig.folder.path());
    let mut good = app.wanted.clone();
    assert!(begin_anew(&mut app, &rig.pins, &mut good).is_some());
    app.wanted.trigger = Some(Trigger::parse("a.wvae>0.5").unwrap());
    let stream = begin_anew(&mut app, &rig.pins, &mut good);
    assert!(stream.is_some() && app.ended.is_none());
    assert_eq!(app.wanted.trigger.unwrap().to_string(), "a.wave>0.5");
    assert!(app.said.unwrap().contains("did you mean 'a.wave'?"));
}
