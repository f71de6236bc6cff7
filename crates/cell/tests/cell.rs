//! A supervisor and controls without machines, over the real link: certificates, TLS, journals, programs, orders.

use cell::ca::Ca;
use cell::core::Ask;
use cell::serve::{Desk, Settings, Supervisor};
use cell::store::Wish;
use cell_link::carrier::Identity;
use cell_link::message::Remote;
use cell_link::simulated::{Simulated, runs};
use serde_json::{Value, json};
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Longest wait for something that comes at once on a PC with nothing else to do.
const LONG: Duration = Duration::from_secs(60);

/// A port that nobody has.
fn free() -> SocketAddr {
    std::net::TcpListener::bind("127.0.0.1:0")
        .unwrap()
        .local_addr()
        .unwrap()
}

struct Running<T> {
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
    of: T,
}

impl<T> Drop for Running<T> {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            thread.join().unwrap();
        }
    }
}

struct Shop {
    folder: tempfile::TempDir,
    ca: Ca,
    address: SocketAddr,
}

impl Shop {
    fn new() -> Shop {
        let folder = tempfile::tempdir().unwrap();
        Shop {
            ca: Ca::init(&folder.path().join("ca")).unwrap(),
            address: free(),
            folder,
        }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn supervisor(&self) -> Running<Desk> {
        let settings = Settings {
            state: self.path("state"),
            ca: self.path("ca"),
            listen: self.address,
            names: Vec::new(),
            page: None,
            keep_days: 0,
        };
        let (supervisor, desk) = Supervisor::begin(&settings).unwrap();
        let stop = Arc::new(AtomicBool::new(false));
        let stopped = Arc::clone(&stop);
        Running {
            stop,
            thread: Some(std::thread::spawn(move || supervisor.run(&stopped))),
            of: desk,
        }
    }

    fn identity(&self, name: &str) -> Identity {
        Identity {
            certificate: self.path(&format!("ca/{name}.crt")),
            key: self.path(&format!("ca/{name}.key")),
            ca: self.path("ca/ca.crt"),
        }
    }

    fn control(&self, name: &str, remote: Remote) -> Running<Simulated> {
        self.ca.issue(name).unwrap();
        self.control_as(name, self.identity(name), remote)
    }

    fn control_as(&self, name: &str, identity: Identity, remote: Remote) -> Running<Simulated> {
        let folder = self.path(name);
        std::fs::create_dir_all(&folder).unwrap();
        let simulated = Simulated::new(name, &folder).unwrap();
        let settings = cell_link::Settings {
            supervisor: self.address.to_string(),
            identity,
            remote,
            programs: folder.join("programs"),
            state: folder,
            panel: None,
        };
        let stop = Arc::new(AtomicBool::new(false));
        let (stopped, of) = (Arc::clone(&stop), simulated.clone());
        let run = move || cell_link::run(&settings, &|_| Ok(of.connect()), &stopped).unwrap();
        Running {
            stop,
            thread: Some(std::thread::spawn(run)),
            of: simulated,
        }
    }
}

fn until<T>(what: &str, mut look: impl FnMut() -> Option<T>) -> T {
    let begun = Instant::now();
    loop {
        if let Some(found) = look() {
            return found;
        }
        assert!(begun.elapsed() < LONG, "{what} does not come");
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// A machine that is there, and known to be the only one of its name.
fn machine(desk: &Desk, name: &str) -> Option<Value> {
    let answer = desk.ask(Ask::Machines).unwrap();
    let mut machines = answer["machines"].as_array().unwrap().iter();
    let just_came = |machine: &Value| {
        let why_not = machine["state"]["why_not"].as_str();
        why_not.is_some_and(|why| why.contains("just come"))
    };
    machines
        .find(|machine| machine["name"] == name && machine["alive"] == true && !just_came(machine))
        .cloned()
}

/// All of it; an answer has so many octets at the most.
fn journal(desk: &Desk, name: &str) -> Vec<Value> {
    let mut all: Vec<Value> = Vec::new();
    loop {
        let ask = Ask::Journal {
            machine: name.into(),
            since: Some(all.last().map_or(0, |entry| entry["seq"].as_u64().unwrap())),
        };
        match desk.ask(ask) {
            Ok(told) if told["entries"] != json!([]) => all.extend(told["entries"].as_array().unwrap().clone()),
            _ => return all,
        }
    }
}

fn upload(desk: &Desk, machine: &str, content: &str) -> Result<Value, String> {
    desk.ask(Ask::Upload {
        machine: machine.into(),
        name: "p.ngc".into(),
        content: content.into(),
    })
}

fn run_program(desk: &Desk, machine: &str) -> Result<Value, String> {
    desk.ask(Ask::RunProgram {
        machine: machine.into(),
        program: "p.ngc".into(),
    })
}

#[test]
fn programs_go_down_ends_and_alarms_come_up_and_nothing_runs_by_itself() {
    let shop = Shop::new();
    let mill = shop.control("mill", Remote::Run);
    let looked_at = shop.control("lathe", Remote::Off);
    let given = shop.control("saw", Remote::Upload);
    // The controls were there first: they try on until there is a supervisor.
    let supervisor = shop.supervisor();
    let desk = &supervisor.of;
    for name in ["mill", "lathe", "saw"] {
        until(name, || machine(desk, name));
    }

    // Of the pins only those that the machine file names; of all machines, by their names.
    let ports = until("ports", || {
        let ports = desk.ask(Ask::Ports { machine: None }).unwrap()["ports"].clone();
        (ports.as_array()?.len() == 3).then_some(ports)
    });
    let named = |port: &Value| {
        [&port["machine"], &port["name"], &port["channel"]].map(|text| text.as_str().unwrap().to_owned())
    };
    let named: Vec<_> = ports.as_array().unwrap().iter().map(named).collect();
    assert_eq!(
        named,
        ["lathe", "mill", "saw"].map(|machine| [machine, "door", "io.20.in-00"].map(str::to_owned))
    );
    let of_one = |machine: &str| {
        desk.ask(Ask::Ports {
            machine: Some(machine.into()),
        })
    };
    assert_eq!(of_one("saw").unwrap()["ports"], json!([ports[2]]));
    assert!(of_one("nobody").unwrap_err().contains("there is no machine"));

    let error = upload(desk, "mill", "G0 X1\n(wrong)\n").unwrap_err();
    assert_eq!(error, "p.ngc:2: this is wrong");
    assert!(run_program(desk, "mill").unwrap_err().contains("has no p.ngc"));
    upload(desk, "mill", "(takes 0.1)\n").unwrap();
    upload(desk, "saw", "G0\n").unwrap();
    assert!(
        upload(desk, "lathe", "G0\n")
            .unwrap_err()
            .contains("remote = \"upload\"")
    );
    assert!(run_program(desk, "saw").unwrap_err().contains("remote = \"run\""));
    assert_eq!(runs(&shop.path("mill")).unwrap(), Vec::<String>::new());

    until("readiness", || {
        (machine(desk, "mill")?["state"]["is_ready"] == true).then_some(())
    });
    let line = |machine: &str, line: &str| {
        let (machine, line) = (machine.into(), line.into());
        desk.ask(Ask::Mdi { machine, line })
    };
    assert_eq!(line("mill", "G0 X0"), Ok(json!({})));
    assert!(line("saw", "G0 X0").unwrap_err().contains("remote = \"run\""));
    assert_eq!(
        (mill.of.lines(), given.of.lines()),
        (vec!["G0 X0".to_owned()], Vec::new())
    );
    // It is no hand at the machine: the supervisor goes on.
    let order = run_program(desk, "mill").unwrap();
    let ended = until("the end", || {
        let queue = desk.ask(Ask::Queue).unwrap();
        let attempt = queue["attempts"]
            .as_array()
            .unwrap()
            .iter()
            .find(|one| one["id"] == order["id"])
            .cloned()?;
        (attempt["phase"] != "running" && attempt["phase"] != "unknown").then_some(attempt)
    });
    assert_eq!(
        (&ended["phase"], &ended["machine"]),
        (&json!("completed"), &json!("mill"))
    );
    assert!(ended["took_s"].as_f64().unwrap() >= 0.1);
    assert_eq!(runs(&shop.path("mill")).unwrap().len(), 1);

    mill.of.type_line("G0 X1");
    until("hands", || {
        machine(desk, "mill")?["state"]["why_not"]
            .as_str()?
            .contains("by hand")
            .then_some(())
    });
    assert!(run_program(desk, "mill").unwrap_err().contains("by hand"));

    let alarm = mill.of.alarm("coolant is low");
    let alarms = until("the alarm", || {
        let overview = desk.ask(Ask::Overview).unwrap();
        let alarms = overview["alarms"].as_array().unwrap().clone();
        (!alarms.is_empty()).then_some(alarms)
    });
    assert_eq!(
        (&alarms[0]["machine"], &alarms[0]["seq"]),
        (&json!("mill"), &json!(alarm))
    );
    mill.of.acknowledge();
    until("the acknowledge", || {
        let overview = desk.ask(Ask::Overview).unwrap();
        overview["alarms"].as_array().unwrap().is_empty().then_some(())
    });

    // Held and stopped whatever the machine file says.
    assert_eq!(
        desk.ask(Ask::Stop {
            machine: "lathe".into()
        }),
        Ok(json!({}))
    );
    assert!(
        desk.ask(Ask::Hold {
            machine: "lathe".into()
        })
        .is_err(),
        "nothing runs there"
    );
    drop((looked_at, given));
}

#[test]
fn no_link_is_read_and_written_by_two_threads_at_the_same_time() {
    let shop = Shop::new();
    let _mill = shop.control("mill", Remote::Run);
    let supervisor = shop.supervisor();
    until("the mill", || machine(&supervisor.of, "mill"));
    let tasks = std::fs::read_dir("/proc/self/task").unwrap();
    let names = tasks.filter_map(|task| std::fs::read_to_string(task.unwrap().path().join("comm")).ok());
    let names: Vec<String> = names.map(|name| name.trim().to_owned()).collect();
    let has = |what: &str| names.iter().any(|name| name.starts_with(what));
    assert!(has("rx-"), "Zenoh calls its threads otherwise: {names:?}");
    assert!(!has("tx-") && !has("acc-"), "{names:?}");
}

#[test]
fn what_happened_without_a_supervisor_is_told_to_the_next_one() {
    let shop = Shop::new();
    let mill = shop.control("mill", Remote::Run);
    {
        let supervisor = shop.supervisor();
        until("the link", || machine(&supervisor.of, "mill"));
        mill.of.notes(3);
        until("notes", || (journal(&supervisor.of, "mill").len() == 4).then_some(()));
    }
    mill.of.notes(1200);
    let supervisor = shop.supervisor();
    let told = until("all of it", || {
        let ask = Ask::Journal {
            machine: "mill".into(),
            since: Some(900),
        };
        let told = supervisor.of.ask(ask).ok()?["entries"].as_array()?.clone();
        (told.len() == 304).then_some(told)
    });
    for (at, entry) in told.iter().enumerate() {
        assert_eq!(entry["seq"], 901 + at);
    }
}

#[test]
fn a_journal_that_is_too_long_for_a_message_comes_in_several() {
    let shop = Shop::new();
    let mill = shop.control("mill", Remote::Run);
    let text = "x".repeat(100_000);
    for _ in 0..60 {
        mill.of.alarm(&text);
    }
    let supervisor = shop.supervisor();
    until("all of it", || {
        machine(&supervisor.of, "mill")?;
        (journal(&supervisor.of, "mill").len() == 61).then_some(())
    });
}

#[test]
fn an_order_of_parts_is_made_by_several_machines() {
    let shop = Shop::new();
    let supervisor = shop.supervisor();
    let controls: Vec<Running<Simulated>> = ["a", "b", "c"].map(|name| shop.control(name, Remote::Run)).into();
    let wish = Wish {
        program: "part.ngc".into(),
        count: 7,
        ..Wish::default()
    };
    let ask = Ask::Add {
        wish,
        content: b"(takes 0.3)\n".to_vec(),
    };
    supervisor.of.ask(ask).unwrap();
    let order = until("the parts", || {
        let order = supervisor.of.ask(Ask::Queue).unwrap()["orders"][0].clone();
        (order["state"] == "done").then_some(order)
    });
    assert_eq!((&order["completed"], &order["failed"]), (&json!(7), &json!(0)));
    let mut all: Vec<String> = ["a", "b", "c"]
        .iter()
        .flat_map(|name| runs(&shop.path(name)).unwrap())
        .collect();
    all.sort();
    all.dedup();
    assert_eq!(all.len(), 7);
    drop(controls);
}

/// Nothing of this machine is heard, and it is told why.
fn is_refused(desk: &Desk, name: &str, why: &str) {
    let told = until(why, || {
        let overview = desk.ask(Ask::Overview).unwrap();
        let refusals = overview["refusals"].as_array().unwrap();
        refusals
            .iter()
            .find(|one| one["text"].as_str().unwrap().contains(why))
            .cloned()
    });
    assert!(told["text"].as_str().unwrap().contains("127.0.0.1"), "{told}");
    until("silence", || machine(desk, name).is_none().then_some(()));
}

#[test]
fn who_has_no_certificate_of_this_cell_or_a_revoked_one_is_refused() {
    let shop = Shop::new();
    let good = shop.control("good", Remote::Run);
    let lost = shop.control("lost", Remote::Run);
    let supervisor = shop.supervisor();
    let desk = &supervisor.of;
    for name in ["good", "lost"] {
        until(name, || machine(desk, name));
    }
    shop.ca.revoke("lost").unwrap();
    is_refused(desk, "lost", "lost.2 is revoked");
    // The others are back.
    until("good", || machine(desk, "good"));
    drop(lost);

    // Another authority's, with a name that is known here.
    let other = Ca::init(&shop.path("other")).unwrap();
    other.issue("good").unwrap();
    let foreign = Identity {
        certificate: shop.path("other/good.crt"),
        key: shop.path("other/good.key"),
        ca: shop.path("ca/ca.crt"),
    };
    let error = cell_link::carrier::connect(&shop.address.to_string(), &foreign);
    assert!(error.is_err() || !speaks(&error.unwrap(), desk));
    // Nobody serves in the supervisor's place with a machine's certificate.
    let address = free();
    assert!(serves_as_machine(&shop, address).is_err());
    drop(good);
}

/// Whether a session can speak for the machine "stranger".
fn speaks(session: &cell_link::zenoh::Session, desk: &Desk) -> bool {
    use cell_link::message::{Envelope, State, Topic};
    use cell_link::zenoh::Wait;
    let said = Envelope::new(1, State::default()).to_octets();
    for _ in 0..20 {
        let _ = session.put(Topic::State.key("stranger"), said.clone()).wait();
        std::thread::sleep(Duration::from_millis(50));
    }
    machine(desk, "stranger").is_some()
}

#[test]
fn a_machine_speaks_for_itself_alone() {
    let shop = Shop::new();
    let good = shop.control("good", Remote::Run);
    let supervisor = shop.supervisor();
    until("good", || machine(&supervisor.of, "good"));
    shop.ca.issue("liar").unwrap();
    // The list has changed: all connect anew.
    std::thread::sleep(Duration::from_secs(2));
    until("good", || machine(&supervisor.of, "good"));
    let liar = cell_link::carrier::connect(&shop.address.to_string(), &shop.identity("liar")).unwrap();
    assert!(!speaks(&liar, &supervisor.of));
    drop(good);
}

/// All that a certificate of this cell cannot do to another machine: hear it, answer for it, order it about, end it.
#[test]
fn a_machine_neither_hears_nor_orders_another_one() {
    use cell_link::message::{Envelope, Order, Topic, What, sum};
    use cell_link::zenoh::Wait;
    let shop = Shop::new();
    shop.ca.issue("liar").unwrap();
    let good = shop.control("good", Remote::Run);
    let supervisor = shop.supervisor();
    let desk = &supervisor.of;
    until("good", || {
        (machine(desk, "good")?["state"]["is_ready"] == true).then_some(())
    });
    // Two sessions, for one hears what it says itself.
    let session = || cell_link::carrier::connect(&shop.address.to_string(), &shop.identity("liar")).unwrap();
    let (hears, liar) = (session(), session());
    let heard = Arc::new(Mutex::new(Vec::new()));
    for keys in ["**", "cell/**", "cell/*/state", "cell/good/**", "cell/good/run", "@/**"] {
        let (said, asked) = (Arc::clone(&heard), Arc::clone(&heard));
        let subscribed = hears.declare_subscriber(keys).callback(move |sample| {
            said.lock().unwrap().push(sample.key_expr().to_string());
        });
        subscribed.background().wait().unwrap();
        let answers = hears.declare_queryable(keys).callback(move |query| {
            asked.lock().unwrap().push(query.key_expr().to_string());
        });
        answers.background().wait().unwrap();
    }
    let _alive = liar
        .liveliness()
        .declare_token(Topic::Alive.key("good"))
        .wait()
        .unwrap();
    let order = |what| {
        let id = "forged".into();
        Envelope::new(1, Order { id, what, boot: None }).to_octets()
    };
    let content = "(takes 3600)\n";
    upload(desk, "good", content).unwrap();
    let run = What::Run {
        program: "p.ngc".into(),
        sha256: sum(content.as_bytes()),
    };
    for (key, said) in [
        ("cell/good/run", order(run.clone())),
        ("cell/*/run", order(run)),
        ("cell/good/order", order(What::Stop)),
        ("cell/**", order(What::Stop)),
        ("cell/good/journal", Envelope::new(1, json!({ "since": 0 })).to_octets()),
        ("cell/good/describe", Vec::new()),
        ("cell/good/heard", Vec::new()),
    ] {
        let asked = liar
            .get(key)
            .payload(said.clone())
            .timeout(Duration::from_secs(5))
            .wait()
            .unwrap();
        let answers = asked.into_iter().filter(|reply| reply.result().is_ok()).count();
        assert_eq!(answers, 0, "{key}");
        // What is put under a key of many is heard by nobody, either.
        let _ = liar.put(key, said).wait();
    }
    // The supervisor's own questions and orders have gone to the one that is meant.
    let started = run_program(desk, "good").unwrap();
    assert_eq!(runs(&shop.path("good")).unwrap(), [started["id"].as_str().unwrap()]);
    liar.close().wait().unwrap();
    assert!(machine(desk, "good").is_some() && machine(desk, "liar").is_none());
    assert_eq!(*heard.lock().unwrap(), Vec::<String>::new());
    drop(good);
}

/// What a supervisor could say wrong to a control, or somebody in its place.
#[test]
fn an_id_runs_once_and_orders_of_others_are_not_answered() {
    use cell_link::message::{Envelope, Order, OrderState, Phase, Topic, Upload, What, sum};
    use cell_link::zenoh::Wait;
    let shop = Shop::new();
    shop.ca.issue("mill").unwrap();
    let (certificate, key) = shop.ca.issue_server(shop.folder.path(), &["127.0.0.1".into()]).unwrap();
    let identity = Identity {
        certificate,
        key,
        ca: shop.path("ca/ca.crt"),
    };
    let session = cell_link::carrier::listen(shop.address, &identity, &shop.ca.valid().unwrap().0).unwrap();
    let mill = shop.control_as("mill", shop.identity("mill"), Remote::Run);
    let ask = |topic: Topic, payload: Vec<u8>, attachment: Vec<u8>| {
        let get = session.get(topic.key("mill")).payload(payload).attachment(attachment);
        let reply = get.timeout(Duration::from_secs(60)).wait().unwrap().recv().ok()?;
        Some(match reply.result() {
            Ok(sample) => Ok(sample.payload().to_bytes().into_owned()),
            Err(error) => Err(String::from_utf8_lossy(&error.payload().to_bytes()).into_owned()),
        })
    };
    let content = b"(takes 0)\n".to_vec();
    let said = Envelope::new(1, Upload::of("p.ngc", &content)).to_octets();
    until("the link", || ask(Topic::Program, content.clone(), said.clone())?.ok());
    let run = |id: &str, boot: Option<u64>| Order {
        id: id.into(),
        what: What::Run {
            program: "p.ngc".into(),
            sha256: sum(&content),
        },
        boot,
    };
    let order = |order: &Order| ask(Topic::Run, Envelope::new(1, order).to_octets(), Vec::new());
    let state = |order_: &Order| {
        let octets = order(order_)?.ok()?;
        Some(Envelope::<OrderState>::from_octets(&octets).unwrap().body)
    };
    assert_eq!(order(&run("a", Some(1))), None, "it is for another one");
    until("a run", || {
        state(&run("a", None)).filter(|state| state.phase != Phase::Refused)
    });
    until("its end", || {
        state(&run("a", None)).filter(|state| state.phase == Phase::Completed)
    });
    // The same id with another program.
    let mut other = run("a", None);
    other.what = What::Run {
        program: "q.ngc".into(),
        sha256: String::new(),
    };
    assert_eq!(state(&other).unwrap().phase, Phase::Completed);
    assert_eq!(runs(&shop.path("mill")).unwrap(), ["a"]);

    let mut later = Envelope::new(1, run("b", None));
    later.v = 2;
    let refused = ask(Topic::Run, later.to_octets(), Vec::new()).unwrap().unwrap_err();
    assert!(refused.contains("version 2"), "{refused}");
    for (topic, payload) in [
        (Topic::Run, b"{}".to_vec()),
        (Topic::Run, vec![0xff; 100]),
        (Topic::Run, vec![b' '; 70_000]),
        (Topic::Order, vec![b'['; 60_000]),
        (Topic::Journal, Vec::new()),
        (Topic::Program, content.clone()),
    ] {
        assert!(ask(topic, payload, Vec::new()).unwrap().is_err(), "{topic:?}");
    }
    for id in ["", "../x", &"x".repeat(65)] {
        assert_eq!(state(&run(id, None)).unwrap().phase, Phase::Refused, "{id}");
    }
    assert_eq!(runs(&shop.path("mill")).unwrap(), ["a"]);
    drop(mill);
}

/// As where the folder of a machine was copied to a second one.
#[test]
fn two_controls_with_one_certificate_are_told_and_share_no_order() {
    let shop = Shop::new();
    let supervisor = shop.supervisor();
    let desk = &supervisor.of;
    let mill = shop.control("mill", Remote::Run);
    until("mill", || machine(desk, "mill"));
    let copy = shop.control_as("copy", shop.identity("mill"), Remote::Run);
    until("two of them", || {
        let overview = desk.ask(Ask::Overview).unwrap();
        let refusals = overview["refusals"].as_array().unwrap();
        let is_told = |one: &Value| one["text"].as_str().unwrap().starts_with("mill: two controls speak");
        refusals.iter().any(is_told).then_some(())
    });
    let wish = Wish {
        program: "part.ngc".into(),
        count: 3,
        ..Wish::default()
    };
    let content = b"(takes 0.1)\n".to_vec();
    desk.ask(Ask::Add { wish, content }).unwrap();
    drop(copy);
    until("the parts", || {
        (desk.ask(Ask::Queue).unwrap()["orders"][0]["state"] == "done").then_some(())
    });
    let mut all = [runs(&shop.path("mill")).unwrap(), runs(&shop.path("copy")).unwrap()].concat();
    all.sort();
    all.dedup();
    assert_eq!(all.len(), 3);
    drop(mill);
}

/// A control of another version, or one that lies about itself.
#[test]
fn what_is_no_message_is_told_once_and_changes_nothing() {
    use cell_link::message::{Envelope, Journal, State, Topic};
    use cell_link::zenoh::Wait;
    let shop = Shop::new();
    shop.ca.issue("odd").unwrap();
    let supervisor = shop.supervisor();
    let desk = &supervisor.of;
    let odd = cell_link::carrier::connect(&shop.address.to_string(), &shop.identity("odd")).unwrap();
    let mut later = Envelope::new(1, State::default());
    later.v = 2;
    let refusals = || {
        let overview = desk.ask(Ask::Overview).unwrap();
        overview["refusals"].as_array().unwrap().clone()
    };
    until("the version", || {
        odd.put(Topic::State.key("odd"), later.to_octets()).wait().unwrap();
        let is_told = |one: &Value| {
            one["text"]
                .as_str()
                .unwrap()
                .contains("odd: not a message of a cell: version 2")
        };
        refusals().iter().any(is_told).then_some(())
    });
    // All of it is dropped; the last one is right, and counts.
    let huge = "x".repeat(3 << 20);
    let journal = |seq: u64| Journal {
        since: seq - 1,
        entries: vec![json!({ "seq": seq, "unix_s": 1.0, "kind": "alarm", "text": huge })],
        more: false,
        last: seq,
    };
    for seq in 1..=20 {
        let said = Envelope::new(seq, journal(seq)).to_octets();
        until("room", || {
            odd.put(Topic::Journal.key("odd"), said.clone()).wait().unwrap();
            let told = desk.ask(Ask::Machines).unwrap();
            (told["machines"][0]["journal"] == seq).then_some(())
        });
    }
    assert_eq!(refusals().len(), 1);
    // Answers to people stay short, whatever it has told.
    let overview = desk.ask(Ask::Overview).unwrap();
    assert_eq!(overview["alarms"].as_array().unwrap().len(), 20);
    assert!(overview.to_string().len() < 100_000);
    let told = journal_octets(desk, "odd", None);
    assert!(told < 8 << 20, "{told}");
    let told = journal_octets(desk, "odd", Some(3));
    assert!(told < 8 << 20 && told > 3 << 20, "{told}");
}

fn journal_octets(desk: &Desk, name: &str, since: Option<u64>) -> usize {
    let machine = name.into();
    desk.ask(Ask::Journal { machine, since }).unwrap().to_string().len()
}

#[test]
fn a_message_without_end_is_not_heard_and_disturbs_nobody() {
    use cell_link::message::{MESSAGE_MAX, Topic};
    use cell_link::zenoh::Wait;
    use cell_link::zenoh::qos::CongestionControl;
    let shop = Shop::new();
    shop.ca.issue("endless").unwrap();
    let good = shop.control("good", Remote::Run);
    let supervisor = shop.supervisor();
    let desk = &supervisor.of;
    until("good", || machine(desk, "good"));
    let endless = cell_link::carrier::connect(&shop.address.to_string(), &shop.identity("endless")).unwrap();
    for _ in 0..4 {
        let put = endless.put(Topic::State.key("endless"), vec![b' '; 8 * MESSAGE_MAX]);
        // The link may have been closed by then.
        let _ = put.congestion_control(CongestionControl::Block).wait();
    }
    // What goes down may be longer than what comes up.
    until("a program", || {
        upload(desk, "good", &"(x)\n".repeat(MESSAGE_MAX / 2)).ok()
    });
    assert!(machine(desk, "endless").is_none());
    drop(good);
}

/// A client that trusts only a supervisor's certificate, against a machine that serves.
fn serves_as_machine(shop: &Shop, address: SocketAddr) -> Result<(), String> {
    let identity = shop.identity("good");
    let _liar =
        cell_link::carrier::listen(address, &identity, &["good.1".into()]).map_err(|error| error.to_string())?;
    let session = cell_link::carrier::connect(&address.to_string(), &identity);
    session.map(drop).map_err(|error| error.to_string())
}

/// What the link says by itself, and the tries of its carrier: where each line comes from, and what it says.
static LOG: Mutex<Vec<(&str, String)>> = Mutex::new(Vec::new());

struct Keeper;

impl<S: tracing::Subscriber> tracing_subscriber::Layer<S> for Keeper {
    fn on_event(&self, event: &tracing::Event<'_>, _: tracing_subscriber::layer::Context<'_, S>) {
        let mut line = String::new();
        event.record(&mut |field: &tracing::field::Field, value: &dyn std::fmt::Debug| {
            if field.name() == "message" {
                line = format!("{value:?}");
            }
        });
        LOG.lock().unwrap().push((event.metadata().target(), line));
    }
}

#[test]
fn a_supervisor_that_is_away_is_told_once_and_so_is_each_change() {
    use tracing::Level;
    use tracing_subscriber::layer::SubscriberExt;
    let wanted = tracing_subscriber::filter::Targets::new()
        .with_target("cell_link", Level::INFO)
        .with_target("zenoh::net::runtime::orchestrator", Level::DEBUG);
    tracing::subscriber::set_global_default(tracing_subscriber::registry().with(wanted).with(Keeper)).unwrap();
    let shop = Shop::new();
    let address = shop.address.to_string();
    // Other tests of this process have addresses of their own.
    let said = |by: &str| -> Vec<String> {
        let log = LOG.lock().unwrap();
        let of_it = log
            .iter()
            .filter(|(target, line)| target.starts_with(by) && line.contains(&address));
        of_it.map(|(_, line)| line.clone()).collect()
    };
    let by_link = || said("cell_link");
    let tried_again = |times: usize| {
        let before = said("zenoh").len();
        until("another try", || (said("zenoh").len() >= before + times).then_some(()));
    };
    let _mill = shop.control("mill", Remote::Off);
    let mut wanted = vec![format!(
        "cell: no supervisor at {address}; trying again: nobody answers there"
    )];
    until("the first words", || (by_link() == wanted).then_some(()));
    tried_again(3);
    for _ in 0..2 {
        let supervisor = shop.supervisor();
        wanted.push(format!("cell: connected to the supervisor at {address}"));
        until("a supervisor", || (by_link() == wanted).then_some(()));
        drop(supervisor);
        wanted.push(format!("cell: the supervisor at {address} is lost; trying again"));
        until("its loss", || (by_link() == wanted).then_some(()));
        tried_again(2);
    }
    assert_eq!(by_link(), wanted);
}

/// As a link that is lost between the two sessions of a supervisor that makes its own anew.
#[test]
fn a_link_at_which_nobody_hears_is_made_anew() {
    use cell_link::message::Topic;
    use cell_link::zenoh::Wait;
    let shop = Shop::new();
    shop.ca.issue("mill").unwrap();
    shop.ca.issue("asks").unwrap();
    let (certificate, key) = shop.ca.issue_server(shop.folder.path(), &["127.0.0.1".into()]).unwrap();
    let identity = Identity {
        certificate,
        key,
        ca: shop.path("ca/ca.crt"),
    };
    let deaf = cell_link::carrier::listen(shop.address, &identity, &shop.ca.valid().unwrap().0).unwrap();
    let sessions = Arc::new(std::sync::Mutex::new(std::collections::HashSet::new()));
    let linked = Arc::clone(&sessions);
    deaf.info()
        .link_events_listener()
        .callback(move |event| _ = linked.lock().unwrap().insert(event.link().zid().to_string()))
        .background()
        .wait()
        .unwrap();
    let _mill = shop.control_as("mill", shop.identity("mill"), Remote::Upload);
    until("a second session", || {
        (sessions.lock().unwrap().len() > 1).then_some(())
    });

    deaf.close().wait().unwrap();
    let supervisor = shop.supervisor();
    until("a supervisor that hears", || machine(&supervisor.of, "mill"));
    // It says so to whoever is of this cell, else each link would be made anew for ever.
    let asks = cell_link::carrier::connect(&shop.address.to_string(), &shop.identity("asks")).unwrap();
    let asked = |machine: &str| {
        asks.get(Topic::Heard.key(machine))
            .timeout(Duration::from_secs(5))
            .wait()
            .unwrap()
    };
    until("an answer", || {
        asked("asks").recv().ok().filter(|reply| reply.result().is_ok())
    });
    assert!(asked("mill").recv().is_err(), "each asks for itself alone");
}

#[test]
fn a_control_that_was_killed_says_what_became_of_its_order() {
    let shop = Shop::new();
    let supervisor = shop.supervisor();
    let desk = &supervisor.of;
    let order = {
        let mill = shop.control("mill", Remote::Run);
        until("the link", || {
            (machine(desk, "mill")?["state"]["is_ready"] == true).then_some(())
        });
        upload(desk, "mill", "(takes 3600)\n").unwrap();
        let order = run_program(desk, "mill").unwrap();
        let again = run_program(desk, "mill").unwrap_err();
        assert!(again.contains("has an order already"), "{again}");
        drop(mill);
        order
    };
    let mill = shop.control_as("mill", shop.identity("mill"), Remote::Run);
    let ended = until("the end", || {
        let queue = desk.ask(Ask::Queue).unwrap();
        queue["attempts"]
            .as_array()
            .unwrap()
            .iter()
            .find(|one| one["phase"] == "interrupted")
            .cloned()
    });
    assert_eq!(ended["id"], order["id"]);
    assert_eq!(runs(&shop.path("mill")).unwrap().len(), 1);
    drop(mill);
}

#[test]
fn two_supervisors_do_not_share_a_folder() {
    let shop = Shop::new();
    let _first = shop.supervisor();
    let settings = Settings {
        state: shop.path("state"),
        ca: shop.path("ca"),
        listen: free(),
        names: Vec::new(),
        page: None,
        keep_days: 0,
    };
    let error = Supervisor::begin(&settings).err().unwrap().to_string();
    assert!(error.contains("another supervisor runs here"), "{error}");
    assert!(Path::new(&shop.path("state/cell.db")).exists());
}
