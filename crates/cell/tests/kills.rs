//! Supervisor and controls are processes that are killed at any moment, lose a fifth of their packets, or have a full disk: no order is
//! lost, none is carried out twice.
//!
//! `ISOCNC_KILLS=100 cargo test -p isocnc-cell --test all kills -- --nocapture` kills as often; the seed is printed.

use cell::ca::Ca;
use cell::core::Ask;
use cell::serve::{self, Settings};
use cell::store::Wish;
use cell_link::carrier::Identity;
use cell_link::message::Remote;
use cell_link::simulated::{Simulated, runs};
use cell_link::{Control, Refused};
use nix::mount::{MsFlags, mount};
use nix::sched::{CloneFlags, unshare};
use nix::sys::resource::{Resource, setrlimit};
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use protocol::{Described, Entry, Journal, Status};
use serde_json::{Value, json};
use std::fs::File;
use std::io::Write;
use std::net::{SocketAddr, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use tracing_subscriber::layer::SubscriberExt;
use tracing_subscriber::util::SubscriberInitExt;

/// What a process of this test is to be: `supervisor` or the name of a machine.
const BE: &str = "ISOCNC_CELL_BE";
const FOLDER: &str = "ISOCNC_CELL_FOLDER";
const ADDRESS: &str = "ISOCNC_CELL_ADDRESS";
/// Where this lies in the folder, the supervisor may open few files: so many.
const FEW_FILES: &str = "few-files";
const FILES: usize = 128;
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
        if folder.join(FEW_FILES).exists() {
            setrlimit(Resource::RLIMIT_NOFILE, FILES as u64, FILES as u64).unwrap();
        }
        // As the program has it: its refusals are a layer of the log.
        tracing_subscriber::registry().with(&serve::REFUSALS).init();
        let settings = Settings {
            state: folder.join("state"),
            ca: folder.join("ca"),
            listen: address,
            names: Vec::new(),
            page: None,
            keep_days: 0,
        };
        if let Err(error) = serve::run(&settings, &stop, || Ok(())) {
            eprintln!("{error:#}");
            std::process::exit(1);
        }
        return;
    }
    let state = folder.join(&name);
    std::fs::create_dir_all(&state).unwrap();
    let settings = cell_link::Settings {
        supervisor: address.to_string(),
        identity: Identity {
            certificate: folder.join(format!("ca/{name}.crt")),
            key: folder.join(format!("ca/{name}.key")),
            ca: folder.join("ca/ca.crt"),
        },
        remote: Remote::Run,
        programs: state.join("programs"),
        state: state.clone(),
        panel: None,
    };
    if name == TALKER {
        cell_link::run(&settings, &|_| Ok(Box::new(Talker::new(&state))), &stop).unwrap();
        return;
    }
    let simulated = Simulated::new(&name, &state).unwrap();
    cell_link::run(&settings, &|_| Ok(simulated.connect()), &stop).unwrap();
}

const TALKER: &str = "talker";
/// Length of its entries, octets.
const ENTRY: usize = 8000;

/// A control of which the journal takes no memory: entries are made as they are asked for, up to the number in a file, which goes on.
struct Talker {
    goal: PathBuf,
    given: PathBuf,
    /// The last entry that there is, and that the link has got.
    last: u64,
    last_given: u64,
    status: Status,
}

impl Talker {
    fn new(folder: &Path) -> Talker {
        Talker {
            goal: folder.join("goal"),
            given: folder.join("given"),
            last: 0,
            last_given: 0,
            status: Status::default(),
        }
    }

    fn last(&mut self) -> u64 {
        let goal = std::fs::read_to_string(&self.goal).unwrap_or_default();
        self.last = goal.trim().parse().unwrap_or(self.last);
        self.last
    }

    fn entry(seq: u64) -> Entry {
        Entry {
            seq,
            unix_s: 1.0,
            text: format!("{seq:0ENTRY$}"),
            ..Entry::default()
        }
    }
}

impl Control for Talker {
    fn call(&mut self, method: &str, params: Value) -> Result<Value, Refused> {
        match method {
            "journal.since" => {
                let (since, last) = (params["seq"].as_u64().unwrap(), self.last());
                let entries: Vec<Entry> = (since + 1..=last.min(since + 500)).map(Talker::entry).collect();
                self.last_given = self.last_given.max(since + entries.len() as u64).min(last);
                Ok(json!(Journal {
                    entries,
                    last,
                    on_disk: u64::MAX,
                    ..Journal::default()
                }))
            }
            _ => Ok(json!(Described::default())),
        }
    }

    fn wait(&mut self, longest: Duration) -> Result<&Status, Refused> {
        std::thread::sleep(longest.min(Duration::from_millis(20)));
        // At the end of the test, the folder goes first.
        let _ = std::fs::write(&self.given, self.last_given.to_string());
        let last = self.last();
        self.status.messages = vec![Talker::entry(last)];
        Ok(&self.status)
    }
}

struct Process(Child);

impl Process {
    fn begin(name: &str, folder: &Path, address: SocketAddr) -> Process {
        let child = Command::new(std::env::current_exe().unwrap())
            .args(["--exact", "kills::be_a_process", "--nocapture"])
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
        testing::end(&mut self.0);
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

/// An order of parts that take 0.2 s, by a program with this behind it.
fn add(count: u32, more: &str) -> Ask {
    let wish = Wish {
        program: "part.ngc".into(),
        count,
        ..Wish::default()
    };
    let content = format!("(takes 0.2)\n{more}").into_bytes();
    Ask::Add { wish, content }
}

/// A shop of such processes.
struct Shop {
    folder: tempfile::TempDir,
    address: SocketAddr,
    names: Vec<&'static str>,
    processes: Vec<Process>,
}

impl Shop {
    /// `prepare` gets the state folder of the supervisor before that begins.
    fn begin(prepare: impl FnOnce(&Path)) -> Shop {
        Shop::of(&MACHINES, prepare)
    }

    fn of(machines: &[&'static str], prepare: impl FnOnce(&Path)) -> Shop {
        let folder = tempfile::tempdir().unwrap();
        prepare(&folder.path().join("state"));
        let ca = Ca::init(&folder.path().join("ca")).unwrap();
        for name in machines {
            ca.issue(name).unwrap();
        }
        let address = std::net::TcpListener::bind("127.0.0.1:0")
            .unwrap()
            .local_addr()
            .unwrap();
        let names: Vec<&str> = ["supervisor"].iter().chain(machines).copied().collect();
        let begin = |name: &&str| Process::begin(name, folder.path(), address);
        Shop {
            processes: names.iter().map(begin).collect(),
            folder,
            address,
            names,
        }
    }

    /// Asks until there is an answer.
    fn ask(&self, ask: &Ask) -> Value {
        let begun = Instant::now();
        loop {
            match serve::ask(&self.state(), ask) {
                Ok(answer) => return answer,
                Err(error) => assert!(begun.elapsed() < LONG, "{error:#}"),
            }
            std::thread::sleep(Duration::from_millis(50));
        }
    }

    fn state(&self) -> PathBuf {
        self.folder.path().join("state")
    }

    /// Begins one of the processes again.
    fn begin_again(&mut self, at: usize) {
        self.processes[at] = Process::begin(self.names[at], self.folder.path(), self.address);
    }

    fn order(&self, count: u32) -> i64 {
        self.ask(&add(count, ""))["order"].as_i64().unwrap()
    }

    fn order_is(&self, id: i64) -> Value {
        let queue = self.ask(&Ask::Queue);
        let mut orders = queue["orders"].as_array().unwrap().iter();
        orders.find(|order| order["id"] == id).unwrap().clone()
    }

    /// The order once all its parts are made.
    fn done(&self, id: i64) -> Value {
        let begun = Instant::now();
        loop {
            let found = self.order_is(id);
            if found["state"] == "held" {
                // Somebody has looked.
                self.ask(&Ask::Resume { order: id });
            }
            if found["state"] == "done" {
                return found;
            }
            assert!(begun.elapsed() < LONG, "{found}");
            std::thread::sleep(Duration::from_millis(200));
        }
    }

    /// How often a program was run; no id twice.
    fn runs(&self) -> usize {
        let all = MACHINES
            .iter()
            .map(|name| runs(&self.folder.path().join(name)).unwrap());
        let mut all: Vec<String> = all.flatten().collect();
        let count = all.len();
        all.sort();
        all.dedup();
        assert_eq!(all.len(), count, "an id ran twice");
        count
    }
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
    let mut shop = Shop::begin(|_| ());
    let count = 3 * kills;
    let id = shop.order(count);
    let mut killed = [0; 4];
    for _ in 0..kills {
        std::thread::sleep(Duration::from_millis(200 + random(&mut seed, 1500)));
        let at = random(&mut seed, shop.names.len() as u64) as usize;
        shop.processes[at].kill();
        killed[at] += 1;
        shop.begin_again(at);
    }
    let done = shop.done(id);
    let begun_runs = shop.runs();
    assert_eq!(done["completed"], count);
    // Every run is known: completed, or cut off by a kill.
    let failed = done["failed"].as_u64().unwrap() as usize;
    assert!(
        begun_runs <= count as usize + failed && begun_runs >= count as usize,
        "{begun_runs} runs, {done}"
    );
    println!(
        "killed {killed:?} of {:?}: {count} parts completed, {failed} cut off, {begun_runs} runs, no id twice",
        shop.names
    );
}

#[test]
fn a_supervisor_that_sleeps_disturbs_nobody() {
    if std::env::var(BE).is_ok() {
        return;
    }
    let shop = Shop::begin(|_| ());
    let id = shop.order(9);
    let begun = Instant::now();
    while shop.order_is(id)["completed"] == 0 {
        assert!(begun.elapsed() < LONG);
        std::thread::sleep(Duration::from_millis(20));
    }
    let supervisor = Pid::from_raw(shop.processes[0].0.id() as i32);
    kill(supervisor, Signal::SIGSTOP).unwrap();
    // All links are over by then.
    std::thread::sleep(Duration::from_secs(6));
    kill(supervisor, Signal::SIGCONT).unwrap();
    let done = shop.done(id);
    assert_eq!(
        (&done["completed"], &done["failed"], shop.runs()),
        (&Value::from(9), &Value::from(0), 9)
    );
}

/// Strangers that say nothing have a file of the supervisor each, until their handshake is given up: it must not have none for ever.
#[test]
fn a_control_that_hangs_holds_up_no_other_one() {
    if std::env::var(BE).is_ok() {
        return;
    }
    let shop = Shop::begin(|_| ());
    let id = shop.order(3);
    shop.done(id);
    let hangs = Pid::from_raw(shop.processes[1].0.id() as i32);
    kill(hangs, Signal::SIGSTOP).unwrap();
    let is_over = AtomicBool::new(false);
    let heard = std::thread::scope(|scope| {
        scope.spawn(|| {
            let sent = serve::ask(
                &shop.state(),
                &Ask::Upload {
                    machine: "a".into(),
                    name: "long.ngc".into(),
                    content: vec![b'\n'; 32 << 20],
                },
            );
            is_over.store(true, Ordering::Relaxed);
            let why = sent.unwrap_err().to_string();
            assert!(why.starts_with("a has not answered"), "{why}");
        });
        let mut heard = 0;
        while !is_over.load(Ordering::Relaxed) {
            let machine = "b".into();
            serve::ask(&shop.state(), &Ask::Stop { machine }).unwrap();
            heard += 1;
            std::thread::sleep(Duration::from_millis(20));
        }
        heard
    });
    kill(hangs, Signal::SIGCONT).unwrap();
    // What the link of one takes seconds to refuse; held up by it, the others would have heard one in that time.
    assert!(heard >= 3, "another machine heard {heard} orders meanwhile");
    let id = shop.order(6);
    assert_eq!(shop.done(id)["completed"], 6);
}

#[test]
fn strangers_that_take_all_files_keep_nobody_out_for_long() {
    if std::env::var(BE).is_ok() {
        return;
    }
    let mut shop = Shop::of(&["a"], |_| ());
    for process in &mut shop.processes {
        process.kill();
    }
    std::fs::write(shop.folder.path().join(FEW_FILES), "").unwrap();
    shop.begin_again(0);
    shop.ask(&Ask::Machines);
    let strangers: Vec<TcpStream> = (0..300).map(|_| TcpStream::connect(shop.address).unwrap()).collect();
    let supervisor = PathBuf::from(format!("/proc/{}/fd", shop.processes[0].0.id()));
    let begun = Instant::now();
    while std::fs::read_dir(&supervisor).unwrap().count() < FILES - 8 {
        assert!(begun.elapsed() < LONG, "it never has all of them");
        std::thread::sleep(Duration::from_millis(20));
    }
    // They have gone; what it has of them, it has to notice.
    drop(strangers);
    shop.begin_again(1);
    let begun = Instant::now();
    while shop.ask(&Ask::Machines)["machines"][0]["alive"] != true {
        assert!(begun.elapsed() < LONG);
        std::thread::sleep(Duration::from_millis(100));
    }
}

/// What a process has of the memory, MB.
fn memory_mb(process: &Process) -> f64 {
    let text = std::fs::read_to_string(format!("/proc/{}/status", process.0.id())).unwrap();
    let line = text.lines().find_map(|line| line.strip_prefix("VmRSS:")).unwrap();
    line.trim().strip_suffix(" kB").unwrap().trim().parse::<f64>().unwrap() / 1e3
}

#[test]
fn a_control_whose_supervisor_sleeps_keeps_little_and_loses_nothing() {
    if std::env::var(BE).is_ok() {
        return;
    }
    // Entries that are told while it is awake, and while it sleeps.
    const AWAKE: u64 = 2000;
    const ASLEEP: u64 = 10_000;
    let shop = Shop::of(&[TALKER], |_| ());
    let (goal, given) = (
        shop.folder.path().join(TALKER).join("goal"),
        shop.folder.path().join(TALKER).join("given"),
    );
    let last_here = || {
        let told = shop.ask(&Ask::Machines);
        told["machines"][0]["journal"].as_u64().unwrap_or(0)
    };
    let until = |what: &str, is: &mut dyn FnMut() -> bool| {
        let begun = Instant::now();
        while !is() {
            assert!(begun.elapsed() < LONG, "{what}");
            std::thread::sleep(Duration::from_millis(50));
        }
    };
    until("the link", &mut || {
        shop.ask(&Ask::Machines)["machines"][0]["alive"] == true
    });
    files::write(&goal, AWAKE.to_string()).unwrap();
    until("all of it", &mut || last_here() == AWAKE);
    let before = memory_mb(&shop.processes[1]);

    let supervisor = Pid::from_raw(shop.processes[0].0.id() as i32);
    kill(supervisor, Signal::SIGSTOP).unwrap();
    files::write(&goal, (AWAKE + ASLEEP).to_string()).unwrap();
    let mut most = before;
    let begun = Instant::now();
    // All links are over by then.
    until("all of it in the link", &mut || {
        most = most.max(memory_mb(&shop.processes[1]));
        let given: u64 = std::fs::read_to_string(&given).unwrap_or_default().parse().unwrap_or(0);
        given == AWAKE + ASLEEP && begun.elapsed() > Duration::from_secs(6)
    });
    kill(supervisor, Signal::SIGCONT).unwrap();
    let told_mb = (ASLEEP as usize * ENTRY) as f64 / 1e6;
    println!(
        "{told_mb:.0} MB of entries while the supervisor slept; the control has grown by {:.0} MB",
        most - before
    );
    assert!(most - before < told_mb / 2.0, "{before} MB before, {most} MB");

    until("what was dropped", &mut || last_here() == AWAKE + ASLEEP);
    let mut next = 1;
    while next <= AWAKE + ASLEEP {
        let told = shop.ask(&Ask::Journal {
            machine: TALKER.into(),
            since: Some(next - 1),
        });
        for entry in told["entries"].as_array().unwrap() {
            assert_eq!(*entry, json!(Talker::entry(next)));
            next += 1;
        }
    }
}

fn system(command: &str) -> Result<String, String> {
    let mut words = command.split(' ');
    let output = Command::new(words.next().unwrap()).args(words).output();
    let output = output.map_err(|cause| format!("{command}: {cause}"))?;
    match output.status.success() {
        true => Ok(String::from_utf8_lossy(&output.stdout).into_owned()),
        false => Err(format!("{command}: {}", String::from_utf8_lossy(&output.stderr))),
    }
}

/// This thread and the processes that it begins are in a network of their own, which loses a fifth of the packets of TCP.
fn enter_network_that_loses() -> Result<(), String> {
    unshare(CloneFlags::CLONE_NEWNET).map_err(|errno| format!("a network of its own: {errno}"))?;
    system("ip link set lo up")?;
    system("iptables -A INPUT -p tcp -m statistic --mode random --probability 0.2 -j DROP")?;
    system("iptables -A INPUT -p tcp -j ACCEPT").map(drop)
}

#[test]
fn packets_that_are_lost_disturb_nobody() {
    if std::env::var(BE).is_ok() {
        return;
    }
    if let Err(why) = enter_network_that_loses() {
        println!("SKIPPED: {why}");
        return;
    }
    let begun = Instant::now();
    let shop = Shop::begin(|_| ());
    let done = shop.done(shop.order(12));
    assert_eq!(
        (&done["completed"], &done["failed"], shop.runs()),
        (&Value::from(12), &Value::from(0), 12)
    );
    let took = begun.elapsed();
    for name in MACHINES {
        let file = shop.folder.path().join(name).join("sim-journal.jsonl");
        let journal = std::fs::read_to_string(file).unwrap();
        let journal: Vec<Value> = journal
            .lines()
            .map(|line| serde_json::from_str(line).unwrap())
            .collect();
        let begun = Instant::now();
        loop {
            let since = Some(0);
            let told = shop.ask(&Ask::Journal {
                machine: name.into(),
                since,
            });
            if told["entries"] == Value::from(journal.clone()) {
                break;
            }
            assert!(begun.elapsed() < LONG, "{told}");
            std::thread::sleep(Duration::from_millis(200));
        }
    }
    let counters = system("iptables -nvxL INPUT").unwrap();
    let rules = counters.lines().skip(2);
    let packets = rules.map(|rule| rule.split_whitespace().next().unwrap().parse().unwrap());
    let [lost, passed] = packets.collect::<Vec<u64>>()[..] else {
        panic!("{counters}")
    };
    assert!(lost > 0, "{counters}");
    println!(
        "12 parts in {:.1} s, {lost} packets lost, {passed} passed",
        took.as_secs_f64()
    );
}

/// Leaves no room; the file that takes it.
fn fill(disk: &Path) -> PathBuf {
    let filler = disk.join("filler");
    let mut file = File::create(&filler).unwrap();
    while file.write_all(&[0; 4096]).is_ok() {}
    filler
}

#[test]
fn a_full_disk_is_told_and_nothing_that_was_answered_is_lost() {
    if std::env::var(BE).is_ok() {
        return;
    }
    if !nix::unistd::geteuid().is_root() {
        println!("SKIPPED: only root can make a small disk");
        return;
    }
    unshare(CloneFlags::CLONE_NEWNS).unwrap();
    let none = None::<&str>;
    mount(none, "/", none, MsFlags::MS_REC | MsFlags::MS_PRIVATE, none).unwrap();
    let mut shop = Shop::begin(|state| {
        std::fs::create_dir(state).unwrap();
        mount(none, state, Some("tmpfs"), MsFlags::empty(), Some("size=32m,mode=700")).unwrap();
    });
    let first = shop.order(9);
    let begun = Instant::now();
    while shop.order_is(first)["completed"] == 0 {
        assert!(begun.elapsed() < LONG);
        std::thread::sleep(Duration::from_millis(20));
    }
    let filler = fill(&shop.state());
    // More than the journal of the database has room for already.
    let large = add(3, &"(x)\n".repeat(5 << 18));
    let refused = serve::ask(&shop.state(), &large).unwrap_err().to_string();
    assert!(
        refused.contains("the store has not taken it") && refused.contains("full"),
        "{refused}"
    );
    // Parts are ended meanwhile.
    std::thread::sleep(Duration::from_secs(2));
    shop.processes[0].kill();
    shop.begin_again(0);
    let begun = Instant::now();
    loop {
        if let Some(status) = shop.processes[0].0.try_wait().unwrap() {
            assert!(!status.success());
            break;
        }
        if serve::ask(&shop.state(), &Ask::Machines).is_ok() {
            shop.processes[0].kill();
            break;
        }
        assert!(begun.elapsed() < LONG, "it neither runs nor ends");
        std::thread::sleep(Duration::from_millis(50));
    }
    std::fs::remove_file(filler).unwrap();
    shop.begin_again(0);
    let second = shop.ask(&large)["order"].as_i64().unwrap();
    for (id, count) in [(first, 9), (second, 3)] {
        let done = shop.done(id);
        assert_eq!(
            (&done["completed"], &done["failed"]),
            (&Value::from(count), &Value::from(0))
        );
    }
    assert_eq!(shop.runs(), 12);
}
