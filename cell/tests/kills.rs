//! Supervisor and controls are processes that are killed at any moment: no order is lost, none is carried out twice.
//!
//! `ISOCNC_KILLS=100 cargo test -p isocnc-cell --test kills -- --nocapture` kills as often; the seed is printed.

use cell::ca::Ca;
use cell::core::Ask;
use cell::serve::{self, Settings};
use cell::store::Wish;
use cell_link::carrier::Identity;
use cell_link::message::Remote;
use cell_link::simulated::{Simulated, runs};
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

/// What a process of this test is to be: `supervisor` or the name of a machine.
const BE: &str = "ISOCNC_CELL_BE";
const FOLDER: &str = "ISOCNC_CELL_FOLDER";
const ADDRESS: &str = "ISOCNC_CELL_ADDRESS";
const MACHINES: [&str; 3] = ["a", "b", "c"];
/// Longest wait for a shop that is left alone.
const LONG: Duration = Duration::from_secs(240);

/// The other processes begin here.
#[test]
fn be_a_process() {
    let Ok(name) = std::env::var(BE) else { return };
    let folder = PathBuf::from(std::env::var(FOLDER).unwrap());
    let address: SocketAddr = std::env::var(ADDRESS).unwrap().parse().unwrap();
    let stop = Arc::new(AtomicBool::new(false));
    if name == "supervisor" {
        let settings = Settings {
            state: folder.join("state"),
            ca: folder.join("ca"),
            listen: address,
            names: Vec::new(),
            page: None,
        };
        serve::run(&settings, &stop, || Ok(())).unwrap();
        return;
    }
    let state = folder.join(&name);
    std::fs::create_dir_all(&state).unwrap();
    let simulated = Simulated::new(&name, &state).unwrap();
    let settings = cell_link::Settings {
        supervisor: address.to_string(),
        identity: Identity {
            certificate: folder.join(format!("ca/{name}.crt")),
            key: folder.join(format!("ca/{name}.key")),
            ca: folder.join("ca/ca.crt"),
        },
        remote: Remote::Run,
        programs: state.join("programs"),
        state,
        panel: None,
    };
    cell_link::run(&settings, &|_| Ok(simulated.connect()), &stop).unwrap();
}

struct Process(Child);

impl Process {
    fn begin(name: &str, folder: &Path, address: SocketAddr) -> Process {
        let child = Command::new(std::env::current_exe().unwrap())
            .args(["--exact", "be_a_process", "--nocapture"])
            .env(BE, name)
            .env(FOLDER, folder)
            .env(ADDRESS, address.to_string())
            .stdout(Stdio::null())
            .spawn()
            .unwrap();
        Process(child)
    }

    /// As `kill -9`.
    fn kill(&mut self) {
        self.0.kill().unwrap();
        self.0.wait().unwrap();
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// A number from 0 to below `below`.
fn random(seed: &mut u64, below: u64) -> u64 {
    *seed ^= *seed << 13;
    *seed ^= *seed >> 7;
    *seed ^= *seed << 17;
    *seed % below
}

#[test]
fn no_order_is_lost_or_doubled_whoever_is_killed() {
    if std::env::var(BE).is_ok() {
        return;
    }
    let kills: u32 = std::env::var("ISOCNC_KILLS").map_or(8, |text| text.parse().unwrap());
    let mut seed: u64 =
        std::env::var("ISOCNC_SEED").map_or_else(|_| u64::from(std::process::id()) | 1, |text| text.parse().unwrap());
    println!("{kills} kills, seed {seed}");
    let folder = tempfile::tempdir().unwrap();
    let ca = Ca::init(&folder.path().join("ca")).unwrap();
    for name in MACHINES {
        ca.issue(name).unwrap();
    }
    let address = std::net::TcpListener::bind("127.0.0.1:0")
        .unwrap()
        .local_addr()
        .unwrap();
    let names: Vec<&str> = ["supervisor"].into_iter().chain(MACHINES).collect();
    let mut processes: Vec<Process> = names
        .iter()
        .map(|name| Process::begin(name, folder.path(), address))
        .collect();
    let state = folder.path().join("state");
    let count = 3 * kills;
    let order = |ask: &Ask| {
        let begun = Instant::now();
        loop {
            match serve::ask(&state, ask) {
                Ok(answer) => return answer,
                Err(error) => assert!(begun.elapsed() < LONG, "{error:#}"),
            }
            std::thread::sleep(Duration::from_millis(50));
        }
    };
    let wish = Wish {
        program: "part.ngc".into(),
        count,
        ..Wish::default()
    };
    let id = order(&Ask::Add {
        wish,
        content: b"(takes 0.2)\n".to_vec(),
    })["order"]
        .clone();
    let mut killed = [0; 4];
    for _ in 0..kills {
        std::thread::sleep(Duration::from_millis(200 + random(&mut seed, 1500)));
        let at = random(&mut seed, names.len() as u64) as usize;
        processes[at].kill();
        killed[at] += 1;
        processes[at] = Process::begin(names[at], folder.path(), address);
    }
    let begun = Instant::now();
    let done = loop {
        let queue = order(&Ask::Queue);
        let found = queue["orders"][0].clone();
        assert_eq!(found["id"], id);
        if found["state"] == "held" {
            // Somebody has looked.
            order(&Ask::Resume {
                order: id.as_i64().unwrap(),
            });
        }
        if found["state"] == "done" {
            break found;
        }
        assert!(begun.elapsed() < LONG, "{found}");
        std::thread::sleep(Duration::from_millis(200));
    };
    let mut all: Vec<String> = MACHINES
        .iter()
        .flat_map(|name| runs(&folder.path().join(name)).unwrap())
        .collect();
    let begun_runs = all.len();
    all.sort();
    all.dedup();
    assert_eq!(all.len(), begun_runs, "an id ran twice");
    assert_eq!(done["completed"], count);
    // Every run is known: completed, or cut off by a kill.
    let failed = done["failed"].as_u64().unwrap() as usize;
    assert!(
        begun_runs <= count as usize + failed && begun_runs >= count as usize,
        "{begun_runs} runs, {done}"
    );
    println!(
        "killed {killed:?} of {names:?}: {count} parts completed, {failed} cut off, {begun_runs} runs, no id twice"
    );
}
