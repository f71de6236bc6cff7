//! What reading a program costs: `cargo bench --bench interpreter`.
//!
//! Prints, with the load and what the host of a virtual machine stole, lines of text per second of processor time:
//! - lexing alone: words with their numbers and places. Target 15 million lines a second;
//! - text to canonical events, 3-axis G1. Target 5 million;
//! - the same for arcs, expressions, parameters, loops and calls; counted are the lines of the text, of which many run
//!   several times. Target 1.5 million.
//!
//! The same programs go through LinuxCNC's stand-alone interpreter in turns with ours, if `$ISOCNC_RS274` or the PATH names
//! one (`scripts/rs274-oracle.sh` makes one); all figures are medians. Then: how long the first event of a large file
//! takes (target 5 ms), and how much memory files of three sizes take.
//!
//! Options behind `--`: `--large MIB` for the size of the large file (1024), `--rounds N` (7).

mod common;

use anyhow::{Context, ensure};
use common::Busyness;
use gcode::{Interpreter, Lexer, Settings};
use nix::sys::resource::{UsageWho, getrusage};
use nix::time::{ClockId, clock_gettime};
use powerlink::link::simulated::SplitMix64;
use std::fmt::Write as _;
use std::fs::{self, File};
use std::hint::black_box;
use std::io::{BufWriter, Cursor, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// Lines of the program of straight moves.
const STRAIGHT_LINES: usize = 200_000;
/// Blocks of about 25 lines of the program of everything.
const MIXED_BLOCKS: usize = 2000;

/// Straight moves in three axes along a closed figure.
fn straight(lines: usize) -> String {
    let mut random = SplitMix64::new(1);
    let mut text = String::from("G21 G90 G17 G94\nG0 X0 Y0 Z5\nF3000\nG1 Z0\n");
    for index in 0..lines {
        let angle = index as f64 * 0.01;
        let x = 40.0 * angle.cos() + 8.0 * (7.3 * angle).cos();
        let y = 40.0 * angle.sin() - 8.0 * (5.1 * angle).sin();
        let z = -1.0 + 0.5 * (0.37 * angle).sin() + random.within(-0.01, 0.01);
        let _ = writeln!(text, "G1 X{x:.4} Y{y:.4} Z{z:.4}");
    }
    text.push_str("M2\n");
    text
}

/// Arcs in both forms, expressions, parameters, conditions, loops and calls of a subroutine with a loop.
fn mixed(blocks: usize) -> String {
    let mut random = SplitMix64::new(2);
    let mut text = String::from(
        "(arcs, expressions, O-words)\nG21 G90 G17 G94\n\
         o100 sub\n#<d> = #1\n#<n> = #2\no101 while [#<n> GT 0]\n\
         G1 X[#<d> * COS[#<n> * 30]] Y[#<d> * SIN[#<n> * 30]]\n\
         #<n> = [#<n> - 1]\no101 endwhile\no100 endsub\n\
         #<_depth> = -1.5\nG0 X0 Y0 Z5\nF1800\n",
    );
    for block in 0..blocks {
        let (x, y) = (random.within(-50.0, 50.0), random.within(-50.0, 50.0));
        let radius = random.within(2.0, 12.0);
        let (name, loop_name) = (1000 + 3 * block, 1001 + 3 * block);
        let _ = write!(
            text,
            "N{n} G0 X{x:.4} Y{y:.4} Z2\n\
             G1 Z[#<_depth> + {rise:.3}] F600\n\
             G2 X{end:.4} Y{y:.4} I{radius:.4} J0 F1800\n\
             G3 X{x:.4} Y{y:.4} R{wider:.4}\n\
             #10 = [{a:.3} + SQRT[{b:.3}] * 2 ** 2 / 3]\n\
             #11 = [ATAN[#10]/[{c:.3}] MOD 90 + ABS[-#10]]\n\
             G1 X[#10 + #11] Y[#10 - #11 * 0.5]\n\
             #<k> = {k:.0}\n\
             o{name} if [#<k> EQ 1 AND #10 GT 0]\n\
             G1 X[ROUND[#10]] (short)\n\
             o{name} elseif [#<k> EQ 2]\n\
             G1 Y[FIX[#11]]\n\
             o{name} else\n\
             G1 X[FUP[#10]] Y[FUP[#11]]\n\
             o{name} endif\n\
             o{loop_name} repeat [2]\n\
             G91 G1 X0.5 Y-0.25\n\
             G90 G1 Z[#<_depth>]\n\
             o{loop_name} endrepeat\n\
             o100 call [{size:.2}] [4]\n\
             G0 Z5\n",
            n = block % 99999,
            rise = random.within(0.0, 1.0),
            end = x + 2.0 * radius,
            wider = radius + 0.5,
            a = random.within(1.0, 5.0),
            b = random.within(1.0, 9.0),
            c = random.within(1.0, 5.0),
            k = random.within(0.5, 3.5),
            size = random.within(5.0, 20.0),
        );
    }
    text.push_str("M2\n");
    text
}

/// Processor time that this thread has used.
fn thread_time() -> Duration {
    clock_gettime(ClockId::CLOCK_THREAD_CPUTIME_ID).map_or(Duration::ZERO, Duration::from)
}

/// Processor time that ended processes of this one have used.
fn children_time() -> Duration {
    let usage = getrusage(UsageWho::RUSAGE_CHILDREN);
    let time = |time: nix::sys::time::TimeVal| {
        Duration::from_secs(time.tv_sec() as u64) + Duration::from_micros(time.tv_usec() as u64)
    };
    usage.map_or(Duration::ZERO, |usage| {
        time(usage.user_time()) + time(usage.system_time())
    })
}

/// Words with numbers and places; returns how many.
fn lex(text: &str) -> anyhow::Result<u64> {
    let mut lexer = Lexer::new(Cursor::new(text.as_bytes()));
    let mut words = 0;
    while let Some(line) = lexer.next_line()? {
        for word in line {
            black_box(word.map_err(|(place, kind)| anyhow::anyhow!("{place:?}: {kind}"))?);
            words += 1;
        }
    }
    Ok(words)
}

/// Canonical events; returns how many.
fn interpret(text: &str) -> anyhow::Result<u64> {
    let mut events = 0;
    for event in Interpreter::new(Settings::default()).run(text.as_bytes()) {
        black_box(event?);
        events += 1;
    }
    Ok(events)
}

/// LinuxCNC's interpreter, with what it wants.
struct Rs274 {
    command: PathBuf,
    folder: tempfile::TempDir,
}

impl Rs274 {
    /// `None`, with a line that says so, where there is none.
    fn find() -> anyhow::Result<Option<Rs274>> {
        let named = std::env::var_os("ISOCNC_RS274").filter(|value| !value.is_empty());
        let folders = std::env::var_os("PATH").unwrap_or_default();
        let found = named.map(PathBuf::from).or_else(|| {
            let mut places = std::env::split_paths(&folders).map(|folder| folder.join("rs274"));
            places.find(|place| place.is_file())
        });
        let Some(command) = found else {
            println!("rs274                    not compared: neither ISOCNC_RS274 nor the PATH names one");
            return Ok(None);
        };
        let folder = tempfile::tempdir()?;
        fs::write(folder.path().join("tool.tbl"), "T1 P1 D3 Z10\n")?;
        fs::write(folder.path().join("start.var"), "5161\t0\n")?;
        Ok(Some(Rs274 { command, folder }))
    }

    /// Processor time of one run over a text.
    fn time(&self, text: &str) -> anyhow::Result<Duration> {
        let place = |name: &str| self.folder.path().join(name);
        fs::write(place("program.ngc"), text)?;
        fs::copy(place("start.var"), place("parameters.var"))?;
        let before = children_time();
        let status = Command::new(&self.command)
            .current_dir(self.folder.path())
            .args([
                "-t",
                "tool.tbl",
                "-v",
                "parameters.var",
                "-g",
                "program.ngc",
                "/dev/null",
            ])
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .status()
            .with_context(|| format!("{}", self.command.display()))?;
        ensure!(status.success(), "{} ended with {status}", self.command.display());
        Ok(children_time() - before)
    }
}

fn median(mut figures: Vec<f64>) -> f64 {
    figures.sort_by(f64::total_cmp);
    figures[figures.len() / 2]
}

/// Lines per second of the work and of rs274, in turns.
fn compare(
    what: &str,
    target: f64,
    text: &str,
    rounds: usize,
    rs274: Option<&Rs274>,
    work: impl Fn(&str) -> anyhow::Result<u64>,
) -> anyhow::Result<()> {
    let lines = text.lines().count() as f64;
    let busyness = Busyness::now();
    let (mut ours, mut theirs) = (Vec::new(), Vec::new());
    let mut results = work(text)?;
    for _ in 0..rounds {
        let before = thread_time();
        results = black_box(work(text)?);
        ours.push(lines / (thread_time() - before).as_secs_f64());
        if let Some(rs274) = rs274 {
            theirs.push(lines / rs274.time(text)?.as_secs_f64());
        }
    }
    let ours = median(ours) / 1e6;
    let verdict = if ours >= target { "kept" } else { "MISSED" };
    println!("{what:<24} {ours:8.2} million lines/s, target {target} {verdict}; {lines} lines, {results} results");
    if rs274.is_some() {
        let theirs = median(theirs) / 1e6;
        println!(
            "  rs274 in turns         {theirs:8.3} million lines/s; ours is {:.1} times that",
            ours / theirs
        );
    }
    println!("  {}", busyness.line());
    Ok(())
}

/// Greatest memory of this process so far, KiB.
fn memory_peak_kib() -> u64 {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    let figure = line.and_then(|line| line.trim().strip_suffix(" kB"));
    figure.and_then(|figure| figure.trim().parse().ok()).unwrap_or(0)
}

/// A file of at least `size` octets with straight moves.
fn write_program(path: &Path, size: u64) -> anyhow::Result<()> {
    let body = straight(100_000);
    let body = body.strip_suffix("M2\n").unwrap_or(&body);
    let mut file = BufWriter::with_capacity(1 << 20, File::create(path)?);
    for _ in 0..size.div_ceil(body.len() as u64) {
        file.write_all(body.as_bytes())?;
    }
    file.write_all(b"M2\n")?;
    file.flush()?;
    Ok(())
}

/// How long it takes from opening a file to its first move, and how much memory whole files take.
fn large_files(large_mib: u64) -> anyhow::Result<()> {
    let folder = tempfile::tempdir()?;
    for mib in [large_mib / 64, large_mib / 8, large_mib] {
        let path = folder.path().join("large.ngc");
        write_program(&path, mib << 20)?;
        let mut first_ms = Vec::new();
        for _ in 0..21 {
            let began = Instant::now();
            let mut run = Interpreter::new(Settings::default()).run_reader(File::open(&path)?);
            let event = run.find(|event| event.as_ref().map_or(true, |event| event.source.line > 0));
            event.context("no event")??;
            first_ms.push(began.elapsed().as_secs_f64() * 1e3);
        }
        let before_kib = memory_peak_kib();
        let began = thread_time();
        let mut events = 0_u64;
        for event in Interpreter::new(Settings::default()).run_reader(File::open(&path)?) {
            black_box(event?);
            events += 1;
        }
        println!(
            "file of {mib:5} MiB        first event after {:.3} ms, target 5; whole in {:.2} s, {events} events, \
             memory peak {} KiB, {} more than before",
            median(first_ms),
            (thread_time() - began).as_secs_f64(),
            memory_peak_kib(),
            memory_peak_kib() - before_kib,
        );
    }
    Ok(())
}

/// The number behind an option, or its usual value.
fn option(name: &str, usual: u64) -> anyhow::Result<u64> {
    let mut arguments = std::env::args().skip_while(|argument| argument != name);
    match (arguments.next(), arguments.next()) {
        (None, _) => Ok(usual),
        (Some(_), value) => {
            let value = value.with_context(|| format!("{name} needs a number"))?;
            value.parse().with_context(|| format!("{name} {value}"))
        }
    }
}

fn main() -> anyhow::Result<()> {
    let rounds = option("--rounds", 7)?.max(1) as usize;
    let large_mib = option("--large", 1024)?;
    let rs274 = Rs274::find()?;
    let (straight, mixed) = (straight(STRAIGHT_LINES), mixed(MIXED_BLOCKS));
    compare("lexing, 3-axis G1", 15.0, &straight, rounds, None, lex)?;
    compare("events, 3-axis G1", 5.0, &straight, rounds, rs274.as_ref(), interpret)?;
    compare("events, mixed", 1.5, &mixed, rounds, rs274.as_ref(), interpret)?;
    large_files(large_mib)
}
