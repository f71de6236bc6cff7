//! The port for senders of Grbl from outside: a control in memory as a process of its own, and senders at its port, two of them foreign.
//!
//! `ISOCNC_GRBL_STREAMER` names a Python that has the package grbl-streamer, `ISOCNC_CNCJS` a folder with `node_modules/cncjs`; both need
//! `socat`. Without them, those tests say so and pass.

use crate::common;

use common::WithPanel;
use std::fmt::Write as _;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command};
use std::time::{Duration, Instant};

/// For what is sure to come.
const WAIT: Duration = Duration::from_secs(120);

/// A control in memory with a port for senders.
struct Control {
    of: WithPanel,
    grbl: String,
    panel: String,
}

impl Control {
    fn start(name: &str) -> Control {
        let tables = "[panel]\naddress = \"127.0.0.1:0\"\n[panel.grbl]\nlisten = \"127.0.0.1:0\"\n";
        let of = WithPanel::start(&format!("grbl-{name}"), tables, &["panel", "grbl"]);
        Control {
            grbl: of.address("grbl").to_owned(),
            panel: of.address("panel").to_owned(),
            of,
        }
    }

    fn get(&self, path: &str) -> String {
        let mut stream = TcpStream::connect(&self.panel).unwrap();
        write!(
            stream,
            "GET {path} HTTP/1.1\r\nHost: {}\r\nConnection: close\r\n\r\n",
            self.panel
        )
        .unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        answer
    }

    fn connect(&self) -> Sender {
        // The control may still bring its network up.
        let stream = TcpStream::connect(&self.grbl).unwrap();
        stream.set_read_timeout(Some(WAIT)).unwrap();
        Sender {
            lines: BufReader::new(stream.try_clone().unwrap()),
            stream,
        }
    }

    /// A sender that is greeted, after another one has gone or is let go.
    fn connect_next(&self) -> Sender {
        let until = Instant::now() + WAIT;
        loop {
            let mut next = self.connect();
            if next.line().is_empty() {
                assert_eq!(next.line(), "Grbl 1.1h ['$' for help]");
                return next;
            }
            assert!(Instant::now() < until, "the one before is never let go");
            std::thread::sleep(Duration::from_millis(200));
        }
    }
}

/// A sender of a few lines.
struct Sender {
    lines: BufReader<TcpStream>,
    stream: TcpStream,
}

impl Sender {
    fn send(&mut self, text: &str) {
        self.stream.write_all(text.as_bytes()).unwrap();
    }

    fn line(&mut self) -> String {
        let mut line = String::new();
        let count = self.lines.read_line(&mut line).expect("the port says nothing");
        assert!(count > 0, "the port has closed");
        line.trim_end().to_owned()
    }

    /// The answer to a line, without what is told before it.
    fn ask(&mut self, line: &str) -> String {
        self.send(&format!("{line}\n"));
        loop {
            let told = self.line();
            if told == "ok" || told.starts_with("error:") {
                return told;
            }
        }
    }

    fn status(&mut self) -> String {
        self.send("?");
        loop {
            let told = self.line();
            if told.starts_with('<') {
                return told;
            }
        }
    }

    fn state(&mut self) -> String {
        let status = self.status();
        status[1..status.find('|').unwrap()].to_owned()
    }

    fn wait_for(&mut self, state: &str) {
        let until = Instant::now() + WAIT;
        while self.state() != state {
            assert!(Instant::now() < until, "never {state}: {}", self.status());
            std::thread::sleep(Duration::from_millis(50));
        }
    }

    fn home(&mut self) {
        let until = Instant::now() + WAIT;
        // Until the network is up nothing can be homed.
        while self.ask("$H") != "ok" {
            assert!(Instant::now() < until, "it is never homed: {}", self.status());
            std::thread::sleep(Duration::from_millis(200));
        }
        self.wait_for("Idle");
    }
}

/// A wave of short straight moves at this feed, mm/min; each of them alone would be a stop.
fn wave(lines: usize, feed: u32) -> String {
    let mut job = format!("G21 G90 G94\nG0 X10 Y{:.3}\nG1 F{feed}\n", wave_at(10.0));
    for k in 1..=lines {
        let x = 10.0 + 0.25 * k as f64;
        writeln!(job, "G1 X{x:.3} Y{:.3}", wave_at(x)).unwrap();
    }
    job
}

fn wave_at(x: f64) -> f64 {
    50.0 + 10.0 * (x / 15.0).sin()
}

/// Feed of a status, mm/min.
fn feed(status: &str) -> f64 {
    let fields = status.split("|FS:").nth(1).unwrap();
    fields.split(',').next().unwrap().parse().unwrap()
}

#[test]
fn a_job_of_many_lines_runs_without_a_stop_between_them() {
    let control = Control::start("wave");
    let mut sender = control.connect();
    assert_eq!(sender.line(), "");
    assert_eq!(sender.line(), "Grbl 1.1h ['$' for help]");
    assert_eq!(sender.ask("G0 X1"), "error:9", "it is not homed");
    sender.home();
    // Held on its way to the wave, until so much is there that a busy PC sends the rest in time: 5 s of motion.
    const FIRST: usize = 50;
    const AHEAD: usize = 400;
    const LINES: usize = 600;
    const FEED: u32 = 1200;
    let job = format!("G21 G90 G94 G0 X9 Y{:.3}\nG1 X10 F10\n", wave_at(10.0)) + &wave(LINES, FEED);
    let count = job.lines().count();
    let mut rest: Vec<&str> = job.lines().rev().collect();
    // At once: they are one program, however slowly this PC sends.
    let first = rest.split_off(count - FIRST);
    sender.send(&first.iter().rev().map(|line| format!("{line}\n")).collect::<String>());
    let (mut feeds, mut open, mut answered) = (Vec::new(), FIRST, 0);
    // As senders that count: some lines ahead, and a look at the status now and then.
    while answered < count {
        while open < 5
            && let Some(line) = rest.pop()
        {
            sender.send(&format!("{line}\n"));
            open += 1;
        }
        let told = sender.line();
        match told.as_str() {
            "ok" => (answered, open) = (answered + 1, open - 1),
            status if status.starts_with('<') => {
                feeds.push((status.contains("<Run"), feed(status)));
                continue;
            }
            other => panic!("{other}"),
        }
        match answered {
            FIRST => sender.send("!"),
            AHEAD => sender.send("~"),
            _ => {}
        }
        if answered > AHEAD && answered % 10 == 0 {
            sender.send("?");
        }
    }
    while let status = sender.status()
        && !status.starts_with("<Idle")
    {
        feeds.push((status.contains("<Run"), feed(&status)));
        std::thread::sleep(Duration::from_millis(20));
    }
    // From the first feed of the wave to the last one nothing is slow: 150 mm at 20 mm/s.
    let full = f64::from(FEED);
    let is_full = |(_, feed): &(bool, f64)| (0.97 * full..1.03 * full).contains(feed);
    let (first, last) = (
        // The rapid move passes that feed, too.
        feeds.windows(3).position(|three| three.iter().all(is_full)).unwrap(),
        feeds.iter().rposition(is_full).unwrap(),
    );
    let slowest = feeds[first..=last]
        .iter()
        .map(|(_, feed)| *feed)
        .fold(f64::INFINITY, f64::min);
    assert!(last - first > 10, "{feeds:?}");
    assert!(
        slowest > 0.5 * full,
        "it slows down to {slowest} mm/min in between: {feeds:?}"
    );
    assert!(feeds[first..=last].iter().all(|(runs, _)| *runs));
    let status = sender.status();
    assert!(status.contains("|MPos:180.000,"), "{status}");
}

#[test]
fn a_sender_can_hold_go_on_reset_unlock_and_jog() {
    let control = Control::start("hand");
    let mut sender = control.connect();
    sender.home();
    assert!(control.connect().ask_refused().contains("another sender"));
    assert_eq!(sender.ask("G21 G90 G1 X200 F600"), "ok");
    sender.wait_for("Run");
    sender.send("!");
    sender.wait_for("Hold:0");
    sender.send("~");
    sender.wait_for("Run");
    sender.send("\x18");
    let until_greeting = |sender: &mut Sender| {
        let mut told = Vec::new();
        while !told.last().is_some_and(|line: &String| line.starts_with("Grbl")) {
            told.push(sender.line());
        }
        told.join(" ")
    };
    assert!(until_greeting(&mut sender).contains("ALARM:3"));
    assert_eq!(sender.ask("G0 X1"), "error:9");
    let until = Instant::now() + WAIT;
    while sender.ask("$X") != "ok" {
        assert!(Instant::now() < until, "it is never unlocked");
        std::thread::sleep(Duration::from_millis(100));
    }
    sender.wait_for("Idle");
    // Zero where it stands, then back there by a jog.
    assert_eq!(sender.ask("G10 L20 P1 X0 Y0 Z0"), "ok");
    assert_eq!(sender.ask("G4 P0.1"), "ok");
    assert_eq!(sender.ask("$J=G91 X5 F1200"), "ok");
    sender.wait_for("Idle");
    let told = sender.status();
    assert_eq!(sender.ask("$J=G90 X0 F1200"), "ok");
    sender.wait_for("Idle");
    assert_ne!(sender.status().split('|').nth(1), told.split('|').nth(1));
    assert_eq!(sender.ask("$J=G91 X9000 F100"), "error:15");
    // Beyond the travel: an alarm at the line, as with Grbl.
    assert_eq!(sender.ask("G53 G0 X9000"), "ok");
    let mut told = sender.line();
    while !told.starts_with("ALARM") {
        told = sender.line();
    }
    assert_eq!(told, "ALARM:2");
}

impl Sender {
    /// What one that is refused is told.
    fn ask_refused(mut self) -> String {
        let mut told = String::new();
        let _ = self.lines.read_to_string(&mut told);
        told
    }
}

/// It has to be answered line by line, however late it reads.
#[test]
fn a_sender_that_floods_without_reading_gets_all_its_answers() {
    flood("flood", 3000, ["\n", "$G\n", "G90\n", "?(x)\n"]);
}

#[test]
fn a_sender_that_floods_with_holds_gets_all_its_answers() {
    flood("held-flood", 400, ["\n", "$G\n", "!~G90\n", "?(x)\n"]);
}

/// The dwell keeps those behind it waiting. `?` are answered, too, as many as can be told. Holds come only where there is room for all
/// lines before them: what waits in the socket is not heard.
fn flood(name: &str, lines: usize, others: [&str; 4]) {
    let control = Control::start(name);
    let mut sender = control.connect();
    sender.home();
    let mut flood = "G4 P0.01\n".to_owned();
    for line in 1..lines {
        flood += others[line % 4];
    }
    let mut stream = sender.stream.try_clone().unwrap();
    let sends = std::thread::spawn(move || stream.write_all(flood.as_bytes()).unwrap());
    let mut answers = 0;
    while answers < lines {
        let told = sender.line();
        answers += usize::from(told == "ok" || told.starts_with("error:"));
    }
    sends.join().unwrap();
    assert_eq!(sender.ask("$I"), "ok");
    sender.wait_for("Idle");
}

#[test]
fn a_sender_that_never_reads_is_let_go_and_the_next_one_comes() {
    let control = Control::start("unread");
    let mut sender = control.connect();
    sender.home();
    let mut stream = sender.stream.try_clone().unwrap();
    // Until what it is told fills all that is between, and the port is closed.
    let sends = std::thread::spawn(move || while stream.write_all(b"$$\n$#\n????").is_ok() {});
    let mut next = control.connect_next();
    assert_eq!(next.ask("G21 G90 G0 X1"), "ok");
    next.wait_for("Idle");
    drop(sender);
    sends.join().unwrap();
}

#[test]
fn the_first_line_of_a_sender_finds_the_machine_as_it_is() {
    let control = Control::start("first");
    control.connect().home();
    for _ in 0..10 {
        let mut sender = control.connect_next();
        assert_eq!(sender.ask("G90"), "ok", "{}", sender.status());
    }
}

#[test]
fn binary_octets_harm_nobody() {
    let control = Control::start("binary");
    let mut sender = control.connect();
    sender.home();
    let mut seed = u64::from(std::process::id()) | 1;
    println!("seed {seed}");
    let octets: Vec<u8> = std::iter::repeat_with(|| {
        seed ^= seed << 13;
        seed ^= seed >> 7;
        seed ^= seed << 17;
        seed as u8
    })
    .take(100_000)
    .collect();
    let mut stream = sender.stream.try_clone().unwrap();
    let sends = std::thread::spawn(move || {
        stream.write_all(&octets).unwrap();
        // Whatever it has begun is over then.
        stream.write_all(b"\n\x18").unwrap();
        stream.shutdown(std::net::Shutdown::Write).unwrap();
    });
    // All that it is told is text of Grbl.
    let mut told = String::new();
    sender.lines.read_to_string(&mut told).unwrap();
    sends.join().unwrap();
    assert!(told.is_ascii() && told.contains("Grbl 1.1h"), "{told}");
    let mut next = control.connect();
    assert_eq!(next.line(), "");
    assert_eq!(next.ask("$I"), "ok");
    next.home();
}

#[test]
fn mtconnect_answers_beside_it() {
    let control = Control::start("mtconnect");
    let probe = control.get("/mtconnect/probe");
    assert!(
        probe.starts_with("HTTP/1.1 200") && probe.contains("<MTConnectDevices") && probe.contains("name=\"X\""),
        "{probe}"
    );
    assert!(control.get("/probe").starts_with("HTTP/1.1 404"), "only when asked for");
    let mut sender = control.connect();
    sender.home();
    assert_eq!(sender.ask("G21 G90 G53 G1 X50 F3000"), "ok");
    assert_eq!(sender.ask("G4 P0.1"), "ok");
    let until = Instant::now() + WAIT;
    while !control
        .get("/mtconnect/current?path=//DataItem[@id='x_com']")
        .contains(">50<")
    {
        assert!(Instant::now() < until, "{}", control.get("/mtconnect/current"));
        std::thread::sleep(Duration::from_millis(200));
    }
    let sample = control.get("/mtconnect/sample?count=1000");
    assert!(
        sample.contains(">ACTIVE<") && sample.contains(">MANUAL_DATA_INPUT<"),
        "{sample}"
    );
    assert!(control.get("/mtconnect/sample?from=99999999").contains("<OutOfRange>"));
}

/// A serial port at this end of the port of Grbl.
struct Serial(Child, PathBuf);

impl Drop for Serial {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

impl Serial {
    fn of(control: &Control) -> Option<Serial> {
        let link = control.of.folder.path().join("serial");
        let pty = format!("PTY,link={},raw,echo=0", link.display());
        let socat = Command::new("socat")
            .arg(pty)
            .arg(format!("TCP:{}", control.grbl))
            .spawn()
            .ok()?;
        let serial = Serial(socat, link);
        let until = Instant::now() + WAIT;
        while !serial.1.exists() && Instant::now() < until {
            std::thread::sleep(Duration::from_millis(20));
        }
        Some(serial)
    }
}

/// Runs a whole job by a foreign sender; nothing where it, or socat, is missing.
fn by_foreign_sender(name: &str, variable: &str, command: impl Fn(&str, &Path, &Path) -> Command) {
    let Ok(where_it_is) = std::env::var(variable) else {
        println!("skipped: {variable} names no sender");
        return;
    };
    let control = Control::start(name);
    control.connect().home();
    let Some(serial) = Serial::of(&control) else {
        println!("skipped: there is no socat");
        return;
    };
    let job = control.of.folder.path().join("job.nc");
    std::fs::write(&job, wave(300, 3000) + "M3 S1000\nG4 P0.2\nM5\nG0 X10 Y10\nM2\n").unwrap();
    let ran = command(&where_it_is, &serial.1, &job).output().unwrap();
    let told = [
        String::from_utf8_lossy(&ran.stdout),
        String::from_utf8_lossy(&ran.stderr),
    ]
    .concat();
    assert!(ran.status.success(), "{told}");
    println!("{told}");
    let current = control.get("/mtconnect/current?path=//Linear");
    // G54 of this machine begins at X 20, Y 20.
    assert!(current.contains(">30<"), "it is not where the job ends: {current}");
}

#[test]
fn grbl_streamer_sends_a_whole_job() {
    by_foreign_sender("streamer", "ISOCNC_GRBL_STREAMER", |python, serial, job| {
        let mut command = Command::new(python);
        command.arg("tests/senders/grbl_streamer_job.py").arg(serial).arg(job);
        command
    });
}

#[test]
fn cncjs_sends_a_whole_job() {
    by_foreign_sender("cncjs", "ISOCNC_CNCJS", |folder, serial, job| {
        let mut command = Command::new("node");
        command
            .arg("tests/senders/cncjs_job.cjs")
            .arg(folder)
            .arg(serial)
            .arg(job);
        command
    });
}
