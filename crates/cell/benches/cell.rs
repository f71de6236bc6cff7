//! Prints what a cell of many controls takes: controls of a simulation in this process, the supervisor in another one.
//!
//! `cargo bench -p isocnc-cell --bench cell`; `ISOCNC_CELL_CONTROLS` (256), `ISOCNC_CELL_SLEEP_S` (10).
//!
//! `cargo bench -p isocnc-cell --bench cell -- strangers`: how long a control takes to be there, and to hear an order, while others open
//! connections that come to nothing; `ISOCNC_CELL_STRANGERS` (50) a second.
//!
//! With a fifth of all packets lost, as root, once it is built:
//!
//! ```sh
//! unshare -n sh -c 'ip link set lo up; iptables -A INPUT -p tcp -m statistic --mode random --probability 0.2 -j DROP
//!     cargo bench -p isocnc-cell --bench cell'
//! ```

use cell::ca::Ca;
use cell::core::Ask;
use cell::serve::{self, Settings};
use cell_link::carrier::Identity;
use cell_link::message::Remote;
use cell_link::simulated::Simulated;
use nix::sys::resource::{Resource, getrlimit, setrlimit};
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use serde_json::Value;
use std::collections::VecDeque;
use std::io::Write;
use std::net::{SocketAddr, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Child, Command};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

const ALARMS: usize = 300;
/// People who send programs at the same time.
const SENDERS: usize = 16;

fn number(name: &str, otherwise: usize) -> usize {
    std::env::var(name).map_or(otherwise, |text| text.parse().expect("a number"))
}

fn supervisor(folder: &Path, address: SocketAddr) -> Child {
    Command::new(std::env::current_exe().expect("this program"))
        .args(["supervisor", &folder.display().to_string(), &address.to_string()])
        .spawn()
        .expect("a process")
}

/// A shop with certificates for these machines, and its supervisor: its folder, the supervisor's folder and address, its process.
fn shop(names: &[String]) -> (tempfile::TempDir, PathBuf, SocketAddr, Child) {
    let folder = tempfile::tempdir().expect("a folder");
    let state = folder.path().join("state");
    let ca = Ca::init(&folder.path().join("ca")).expect("an authority");
    for name in names {
        ca.issue(name).expect("a certificate");
    }
    let address = std::net::TcpListener::bind("127.0.0.1:0")
        .and_then(|listener| listener.local_addr())
        .expect("a port");
    let child = supervisor(folder.path(), address);
    while serve::ask(&state, &Ask::Machines).is_err() {
        std::thread::sleep(Duration::from_millis(50));
    }
    (folder, state, address, child)
}

fn alive(state: &Path) -> usize {
    let Ok(answer) = serve::ask(state, &Ask::Machines) else {
        return 0;
    };
    let machines = answer["machines"].as_array().into_iter().flatten();
    machines.filter(|machine| machine["alive"] == true).count()
}

/// Seconds until all of them are there.
fn until_all(state: &Path, count: usize) -> f64 {
    let begun = Instant::now();
    while alive(state) < count {
        assert!(
            begun.elapsed() < Duration::from_secs(120),
            "{} of {count}",
            alive(state)
        );
        std::thread::sleep(Duration::from_millis(50));
    }
    begun.elapsed().as_secs_f64()
}

fn percentiles(mut all: Vec<f64>) -> String {
    all.sort_by(f64::total_cmp);
    let at = |share: f64| all[((all.len() - 1) as f64 * share).round() as usize] * 1e3;
    format!(
        "median {:.1} ms, p99 {:.1} ms, longest {:.1} ms",
        at(0.5),
        at(0.99),
        at(1.0)
    )
}

fn memory_mb(pid: u32) -> f64 {
    let text = std::fs::read_to_string(format!("/proc/{pid}/status")).unwrap_or_default();
    let line = text.lines().find_map(|line| line.strip_prefix("VmRSS:"));
    line.and_then(|line| line.trim().strip_suffix(" kB")?.trim().parse::<f64>().ok())
        .unwrap_or(0.0)
        / 1e3
}

fn entries(state: &Path, machine: &str, since: u64) -> Vec<Value> {
    let ask = Ask::Journal {
        machine: machine.into(),
        since: Some(since),
    };
    serve::ask(state, &ask)
        .map(|answer| answer["entries"].as_array().cloned().unwrap_or_default())
        .unwrap_or_default()
}

/// A link with a simulated control, in a thread of its own.
fn control(folder: &Path, name: &str, address: SocketAddr, stop: &Arc<AtomicBool>) -> (Simulated, JoinHandle<()>) {
    let home = folder.join(name);
    std::fs::create_dir_all(&home).expect("a folder");
    let simulated = Simulated::new(name, &home).expect("a control");
    let settings = cell_link::Settings {
        supervisor: address.to_string(),
        identity: Identity {
            certificate: folder.join(format!("ca/{name}.crt")),
            key: folder.join(format!("ca/{name}.key")),
            ca: folder.join("ca/ca.crt"),
        },
        remote: Remote::Run,
        programs: home.join("programs"),
        state: home,
        panel: None,
    };
    let (of, stop) = (simulated.clone(), Arc::clone(stop));
    let run = move || cell_link::run(&settings, &|_| Ok(of.connect()), &stop).expect("a link");
    (simulated, std::thread::spawn(run))
}

/// Opens connections until `stop`; `says` is all that each of them says.
fn be_strangers(address: SocketAddr, a_second: usize, says: &[u8], stop: &AtomicBool) -> usize {
    let begun = Instant::now();
    let mut open: VecDeque<TcpStream> = VecDeque::new();
    let mut count = 0;
    while !stop.load(Ordering::Relaxed) {
        let due = begun + Duration::from_secs_f64(count as f64 / a_second as f64);
        std::thread::sleep(due.saturating_duration_since(Instant::now()));
        count += 1;
        let Ok(mut stream) = TcpStream::connect(address) else {
            continue;
        };
        // One that was refused already takes nothing.
        let _ = stream.write_all(says);
        open.push_back(stream);
        if open.len() > 1000 {
            open.pop_front();
        }
    }
    count
}

fn strangers() {
    let a_second = number("ISOCNC_CELL_STRANGERS", 50);
    for (kind, says) in [
        ("none", None),
        ("say what is no TLS", Some(&b"GET / HTTP/1.1\r\n\r\n"[..])),
        ("say nothing", Some(&b""[..])),
    ] {
        let (folder, state, address, mut child) = shop(&["there".into(), "comes".into()]);
        let (stop, no_more) = (Arc::new(AtomicBool::new(false)), AtomicBool::new(false));
        let (_, there) = control(folder.path(), "there", address, &stop);
        until_all(&state, 1);
        std::thread::scope(|scope| {
            let no_more = &no_more;
            let work = says.map(|says| scope.spawn(move || be_strangers(address, a_second, says, no_more)));
            // Longer than a handshake may take: those who say nothing are refused by then.
            std::thread::sleep(Duration::from_secs(12));
            let hears = |machine: &str| {
                let begun = Instant::now();
                let stop = Ask::Stop {
                    machine: machine.into(),
                };
                let how = serve::ask(&state, &stop).map(|_| ());
                (begun.elapsed().as_secs_f64() * 1e3, how)
            };
            let (heard_ms, how) = hears("there");
            println!(
                "strangers, {a_second} a second, {kind}: one that is there hears an order after {heard_ms:.0} ms {how:?}"
            );
            let begun = Instant::now();
            let (_, comes) = control(folder.path(), "comes", address, &stop);
            while alive(&state) < 2 && begun.elapsed() < Duration::from_secs(30) {
                std::thread::sleep(Duration::from_millis(20));
            }
            let alive_s = begun.elapsed().as_secs_f64();
            let (heard_ms, how) = hears("comes");
            println!(
                "    one that comes is there after {alive_s:.2} s (30: never), and hears an order {heard_ms:.0} ms later {how:?}"
            );
            no_more.store(true, Ordering::Relaxed);
            let count = work.map_or(0, |work| work.join().expect("strangers"));
            let begun = Instant::now();
            while alive(&state) < 2 && begun.elapsed() < Duration::from_secs(120) {
                std::thread::sleep(Duration::from_millis(20));
            }
            println!(
                "    {count} connections; it is there {:.2} s after the last one",
                begun.elapsed().as_secs_f64()
            );
            stop.store(true, Ordering::Relaxed);
            for thread in [there, comes] {
                thread.join().expect("a control");
            }
        });
        child.kill().expect("a kill");
        child.wait().expect("an end");
    }
}

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    if arguments.get(1).map(String::as_str) == Some("supervisor") {
        let folder = PathBuf::from(&arguments[2]);
        let settings = Settings {
            state: folder.join("state"),
            ca: folder.join("ca"),
            listen: arguments[3].parse().expect("an address"),
            names: Vec::new(),
            page: None,
            keep_days: 0,
        };
        serve::run(&settings, &Arc::new(AtomicBool::new(false)), || Ok(())).expect("a supervisor");
        return;
    }
    if arguments.iter().any(|argument| argument == "strangers") {
        strangers();
        return;
    }
    let (_, hard) = getrlimit(Resource::RLIMIT_NOFILE).expect("limits");
    setrlimit(Resource::RLIMIT_NOFILE, hard.min(16_384), hard).expect("more files");
    let count = number("ISOCNC_CELL_CONTROLS", 256);
    let names: Vec<String> = (0..count).map(|number| format!("m-{number}")).collect();
    let (folder, state, address, mut child) = shop(&names);

    let stop = Arc::new(AtomicBool::new(false));
    let begun = Instant::now();
    let controls: Vec<(Simulated, JoinHandle<()>)> = (names.iter())
        .map(|name| control(folder.path(), name, address, &stop))
        .collect();
    until_all(&state, count);
    println!(
        "{count} controls: all alive {:.1} s after the first start",
        begun.elapsed().as_secs_f64()
    );
    println!(
        "memory: supervisor {:.0} MB, all controls {:.0} MB",
        memory_mb(child.id()),
        memory_mb(std::process::id())
    );

    let program = "G1 X1.234 Y5.678 F1000\n".repeat(1_000_000 / 23 + 1);
    let (next, again, begun) = (AtomicUsize::new(0), AtomicUsize::new(0), Instant::now());
    let took: Vec<f64> = std::thread::scope(|scope| {
        let senders: Vec<_> = (0..SENDERS)
            .map(|_| {
                scope.spawn(|| {
                    let mut took = Vec::new();
                    while let Some(machine) = names.get(next.fetch_add(1, Ordering::Relaxed)) {
                        let begun = Instant::now();
                        let ask = Ask::Upload {
                            machine: machine.clone(),
                            name: "part.ngc".into(),
                            content: program.clone().into_bytes(),
                        };
                        // Over a network that loses packets, a link may end meanwhile.
                        while let Err(why) = serve::ask(&state, &ask) {
                            assert!(begun.elapsed() < Duration::from_secs(120), "{machine}: {why:#}");
                            again.fetch_add(1, Ordering::Relaxed);
                            std::thread::sleep(Duration::from_millis(500));
                        }
                        took.push(begun.elapsed().as_secs_f64());
                    }
                    took
                })
            })
            .collect();
        senders
            .into_iter()
            .flat_map(|sender| sender.join().expect("a sender"))
            .collect()
    });
    println!(
        "1 MB to each, stored and checked, {SENDERS} at a time: {}; all in {:.2} s, {} sent again",
        percentiles(took),
        begun.elapsed().as_secs_f64(),
        again.load(Ordering::Relaxed)
    );

    let mut took = Vec::new();
    for number in 0..ALARMS {
        let at = number * 97 % count;
        let begun = Instant::now();
        let seq = controls[at].0.alarm("a figure");
        while entries(&state, &names[at], seq - 1).is_empty() {
            assert!(begun.elapsed() < Duration::from_secs(60));
        }
        took.push(begun.elapsed().as_secs_f64());
    }
    println!(
        "an alarm, from the control until the supervisor has it on the disk: {}",
        percentiles(took)
    );

    child.kill().expect("a kill");
    child.wait().expect("an end");
    let begun = Instant::now();
    child = supervisor(folder.path(), address);
    until_all(&state, count);
    println!(
        "supervisor killed and begun again: all alive after {:.1} s",
        begun.elapsed().as_secs_f64()
    );

    let sleep_s = number("ISOCNC_CELL_SLEEP_S", 10);
    let pid = Pid::from_raw(child.id() as i32);
    // Each control tells 10 notes a second: how long a link was busy at the most, ms, and by how much memory grows, MB. The simulation
    // keeps its journal there.
    let told = || {
        let before = memory_mb(std::process::id());
        for (control, _) in &controls {
            control.longest_gap();
        }
        for _ in 0..10 * sleep_s {
            for (control, _) in &controls {
                control.notes(1);
            }
            std::thread::sleep(Duration::from_millis(100));
        }
        let gaps = controls.iter().map(|(control, _)| control.longest_gap());
        let gap = gaps.max().unwrap_or_default().as_secs_f64() * 1e3;
        (gap, memory_mb(std::process::id()) - before)
    };
    let (awake, awake_mb) = told();
    kill(pid, Signal::SIGSTOP).expect("a stop");
    let (asleep, asleep_mb) = told();
    kill(pid, Signal::SIGCONT).expect("to go on");
    println!(
        "{} notes in {sleep_s} s: supervisor awake, a link was busy for {awake:.0} ms at the most, all controls grew by {awake_mb:.0} MB",
        10 * sleep_s * count
    );
    println!("the same while it sleeps: {asleep:.0} ms, {asleep_mb:.0} MB");
    let begun = Instant::now();
    let lasts: Vec<u64> = controls.iter().map(|(control, _)| control.alarm("last")).collect();
    for (name, last) in names.iter().zip(&lasts) {
        while entries(&state, name, last - 1).is_empty() {
            assert!(begun.elapsed() < Duration::from_secs(120), "{name}");
            std::thread::sleep(Duration::from_millis(20));
        }
    }
    println!(
        "awake again: all {} entries are here after {:.1} s",
        lasts.iter().sum::<u64>(),
        begun.elapsed().as_secs_f64()
    );

    stop.store(true, Ordering::Relaxed);
    for (_, thread) in controls {
        thread.join().expect("a control");
    }
    child.kill().expect("a kill");
    child.wait().expect("an end");
}
