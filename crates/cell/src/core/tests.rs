use super::*;
use crate::store::Wish;
use cell_link::message::{Order, Remote, Upload, What};
use cell_link::message::{OrderState, Phase, Stored};
use proptest::prelude::*;
use std::path::Path;
use std::sync::mpsc::{Receiver, sync_channel};

/// A control as the supervisor sees it: it keeps what it has begun over its own end.
#[derive(Default)]
struct Fake {
    journal: Vec<Value>,
    programs: HashMap<String, String>,
    /// Orders in their order, and what became of them.
    orders: Vec<OrderState>,
    boot: u64,
    is_down: bool,
    refuses: bool,
}

impl Fake {
    fn note(&mut self, kind: &str, text: &str) {
        let seq = self.journal.len() as u64 + 1;
        self.journal
            .push(json!({ "seq": seq, "unix_s": 1.0, "kind": kind, "text": text }));
    }

    fn is_running(&self) -> bool {
        self.orders.last().is_some_and(|order| order.phase == Phase::Running)
    }

    fn state(&self) -> State {
        State {
            boot: self.boot,
            is_ready: !self.is_running(),
            remote: Remote::Run,
            state: match self.is_running() {
                true => protocol::State::Running,
                false => protocol::State::Ready,
            },
            journal: self.journal.len() as u64,
            order: self.orders.last().cloned(),
            ..State::default()
        }
    }

    fn end(&mut self, phase: Phase) {
        if let Some(order) = self.orders.last_mut().filter(|order| order.phase == Phase::Running) {
            order.phase = phase;
            self.note("note", "ended");
        }
    }

    fn answer(&mut self, question: &Question) -> Result<Vec<u8>, String> {
        fn body<B: serde::de::DeserializeOwned>(octets: &[u8]) -> B {
            Envelope::from_octets(octets).unwrap().body
        }
        fn say(body: impl serde::Serialize) -> Result<Vec<u8>, String> {
            Ok(Envelope::new(0, body).to_octets())
        }
        match question.topic {
            Topic::Describe => say(json!({
                "machine": { "axes": [{ "axis": "X", "travel": [0.0, 300.0] }] },
                "tools": { "tools": [{ "tool": 4 }] },
            })),
            Topic::Journal => {
                let Since { since } = body(&question.payload);
                let entries = self.journal.iter().skip(since as usize).take(3).cloned().collect();
                say(Journal {
                    since,
                    entries,
                    more: self.journal.len() as u64 > since.saturating_add(3),
                    last: self.journal.len() as u64,
                })
            }
            Topic::Program => {
                let upload: Upload = body(question.attachment.as_ref().unwrap());
                upload.verify(&question.payload).unwrap();
                self.programs.insert(upload.name, upload.sha256.clone());
                say(Stored {
                    sha256: upload.sha256,
                    outlook: Ok(json!({})),
                })
            }
            Topic::Run | Topic::Order => {
                let order: Order = body(&question.payload);
                let state = |phase, note: &str| OrderState {
                    id: order.id.clone(),
                    phase,
                    note: note.into(),
                    took_s: None,
                };
                if let Some(known) = self.orders.iter().find(|known| known.id == order.id) {
                    return say(known);
                }
                match &order.what {
                    What::Run { program, sha256 }
                        if !self.refuses && !self.is_running() && self.programs.get(program) == Some(sha256) =>
                    {
                        self.orders.push(state(Phase::Running, ""));
                        say(self.orders.last())
                    }
                    What::Run { .. } => say(state(Phase::Refused, "not now")),
                    What::Status => say(state(Phase::Unknown, "")),
                    What::Mdi { line } if line == "G0 X0" => say(state(Phase::Completed, "")),
                    What::Mdi { .. } => say(state(Phase::Refused, "line 1: no such code")),
                    What::Hold | What::Stop => say(state(Phase::Completed, "")),
                }
            }
            Topic::Alive | Topic::State | Topic::Heard => unreachable!(),
        }
    }
}

/// A supervisor and its controls, on a time of their own.
struct Shop {
    core: Option<Core>,
    file: std::path::PathBuf,
    fakes: HashMap<String, Fake>,
    now: f64,
    /// Questions of which the answer is lost, and that is told; or not even that.
    loses: bool,
    swallows: bool,
    /// What was said and answered so far: it may come once more, at any time.
    said: Vec<(String, State)>,
    answered: Vec<(u64, Vec<u8>)>,
    supervisors: u64,
    _folder: tempfile::TempDir,
}

impl Shop {
    fn new(names: &[&str]) -> Shop {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("cell.db");
        let mut shop = Shop {
            core: None,
            file,
            fakes: names.iter().map(|name| ((*name).to_owned(), Fake::default())).collect(),
            now: 1000.0,
            loses: false,
            swallows: false,
            said: Vec::new(),
            answered: Vec::new(),
            supervisors: 0,
            _folder: folder,
        };
        shop.restart();
        shop
    }

    /// Another supervisor over the same store; whatever the earlier one had under way is gone.
    fn restart(&mut self) {
        self.core = None;
        // Its links were others.
        self.answered.clear();
        self.supervisors += 1;
        let (supervisor, mut number) = (self.supervisors, 0);
        let ids = Box::new(move || {
            number += 1;
            format!("s{supervisor}-{number}")
        });
        self.core = Some(Core::new(Store::open(&self.file).unwrap(), ids).unwrap());
        for name in self.names() {
            self.give(vec![Event::Alive(name, true)]);
        }
    }

    fn names(&self) -> Vec<String> {
        let mut names: Vec<String> = self.fakes.keys().cloned().collect();
        names.sort();
        names
    }

    fn give(&mut self, events: Vec<Event>) {
        let mut events = events;
        loop {
            let core = self.core.as_mut().unwrap();
            let questions = core.take(std::mem::take(&mut events), self.now);
            for question in questions {
                let fake = self.fakes.get_mut(&question.machine).unwrap();
                if fake.is_down {
                    events.push(Event::Answer(question.ticket, Err(NO_ANSWER.into())));
                    continue;
                }
                let answer = fake.answer(&question);
                if let Ok(octets) = &answer {
                    self.answered.push((question.ticket, octets.clone()));
                }
                if self.swallows {
                    continue;
                }
                if !self.loses {
                    events.push(Event::Answer(question.ticket, answer));
                } else {
                    events.push(Event::Answer(question.ticket, Err("lost".into())));
                }
            }
            if events.is_empty() {
                return;
            }
        }
    }

    /// A second goes by: controls tell how they are.
    fn second(&mut self) {
        self.now += 1.0;
        let states = self.names().into_iter().filter(|name| !self.fakes[name].is_down);
        let states: Vec<(String, State)> = states.map(|name| (name.clone(), self.fakes[&name].state())).collect();
        self.said.extend(states.clone());
        let event = |(name, state)| Event::State(name, Box::new(state));
        self.give(states.into_iter().map(event).collect());
    }

    fn ask(&mut self, ask: Ask) -> Result<Value, String> {
        let answer = self.begin(ask);
        answer.try_recv().unwrap()
    }

    fn begin(&mut self, ask: Ask) -> Receiver<Result<Value, String>> {
        let (sender, answer) = sync_channel(1);
        self.give(vec![Event::Ask(
            ask,
            Box::new(move |answer| sender.send(answer).unwrap()),
        )]);
        answer
    }

    fn order(&mut self, count: u32, wish: Wish) -> i64 {
        let wish = Wish {
            program: "p.ngc".into(),
            count,
            ..wish
        };
        let ask = Ask::Add {
            wish,
            content: b"G0\n".to_vec(),
        };
        self.ask(ask).unwrap()["order"].as_i64().unwrap()
    }

    fn of_order(&mut self, id: i64) -> Value {
        let queue = self.ask(Ask::Queue).unwrap();
        let orders = queue["orders"].as_array().unwrap();
        orders.iter().find(|order| order["id"] == id).unwrap().clone()
    }

    fn end_all(&mut self, phase: Phase) {
        for fake in self.fakes.values_mut() {
            fake.end(phase);
        }
    }
}

#[test]
fn parts_are_made_on_all_machines_that_fit_and_no_more_than_were_ordered() {
    let mut shop = Shop::new(&["a", "b", "c"]);
    shop.second();
    shop.ask(Ask::SetClass {
        machine: "c".into(),
        class: "lathe".into(),
    })
    .unwrap();
    let id = shop.order(
        5,
        Wish {
            axes: "X".into(),
            travel: vec![('X', 300.0)],
            tools: vec![4],
            ..Wish::default()
        },
    );
    let other = shop.order(
        1,
        Wish {
            class: "lathe".into(),
            tools: vec![9],
            ..Wish::default()
        },
    );
    for _ in 0..5 {
        shop.second();
        shop.end_all(Phase::Completed);
    }
    shop.second();
    let order = shop.of_order(id);
    assert_eq!((&order["state"], &order["completed"]), (&json!("done"), &json!(5)));
    let runs: usize = shop.fakes.values().map(|fake| fake.orders.len()).sum();
    assert_eq!(runs, 5);
    assert!(
        shop.fakes.values().all(|fake| !fake.orders.is_empty()),
        "all three have worked"
    );
    let order = shop.of_order(other);
    assert_eq!(order["state"], "open");
    let why = |machine: &str| {
        let unfit = order["unfit"].as_array().unwrap();
        unfit.iter().find(|one| one["machine"] == machine).unwrap()["why"].clone()
    };
    assert_eq!(
        (why("a"), why("c")),
        (json!("is of class \"\""), json!("has no tool 9"))
    );
}

#[test]
fn what_was_too_old_to_be_kept_does_not_come_again() {
    let mut shop = Shop::new(&["a"]);
    shop.second();
    let done = shop.order(2, Wish::default());
    for _ in 0..3 {
        shop.end_all(Phase::Completed);
        shop.second();
    }
    assert_eq!(shop.of_order(done)["state"], "done");
    let open = shop.order(
        1,
        Wish {
            tools: vec![9],
            ..Wish::default()
        },
    );
    let journal = Ask::Journal {
        machine: "a".into(),
        since: Some(0),
    };
    let entries = |shop: &mut Shop| shop.ask(journal.clone()).unwrap()["entries"].as_array().unwrap().len();
    assert_eq!(entries(&mut shop), 2);
    shop.core.as_mut().unwrap().keep_days(1);
    shop.now += 3.0 * 86_400.0;
    for _ in 0..5 {
        shop.second();
    }
    let orders = |shop: &mut Shop| -> Vec<i64> {
        let queue = shop.ask(Ask::Queue).unwrap();
        assert_eq!(queue["attempts"], json!([]));
        let orders = queue["orders"].as_array().unwrap();
        orders.iter().map(|order| order["id"].as_i64().unwrap()).collect()
    };
    assert_eq!((entries(&mut shop), orders(&mut shop)), (0, vec![open]));

    // Another supervisor, which keeps everything: it asks for journals, and hears old states and answers once more.
    shop.restart();
    for _ in 0..3 {
        shop.second();
    }
    let said = shop.said.clone();
    shop.give(
        said.into_iter()
            .map(|(name, state)| Event::State(name, Box::new(state)))
            .collect(),
    );
    shop.second();
    assert_eq!((entries(&mut shop), orders(&mut shop)), (0, vec![open]));
    assert_eq!(shop.fakes["a"].orders.len(), 2, "each part was made once");
    shop.fakes.get_mut("a").unwrap().note("note", "new");
    shop.second();
    assert_eq!(entries(&mut shop), 1);
}

#[test]
fn an_order_that_is_not_answered_is_asked_for_with_the_same_id() {
    let mut shop = Shop::new(&["a"]);
    shop.second();
    let id = shop.order(1, Wish::default());
    // The program is there; the answer to the run gets lost, and so does the supervisor.
    assert_eq!(shop.fakes["a"].orders.len(), 1);
    shop.fakes.get_mut("a").unwrap().orders.clear();
    shop.restart();
    shop.loses = true;
    for _ in 0..20 {
        shop.second();
    }
    assert_eq!(shop.fakes["a"].orders.len(), 1);
    assert_eq!(shop.fakes["a"].orders[0].id, "s1-1");
    shop.loses = false;
    shop.end_all(Phase::Completed);
    shop.second();
    assert_eq!(shop.of_order(id)["state"], "done");
    assert_eq!(shop.fakes["a"].orders.len(), 1);
}

#[test]
fn failures_hold_an_order_until_somebody_has_looked() {
    let mut shop = Shop::new(&["a"]);
    shop.second();
    let id = shop.order(1, Wish::default());
    for _ in 0..5 {
        shop.end_all(Phase::Failed);
        shop.second();
    }
    let order = shop.of_order(id);
    assert_eq!((&order["state"], &order["failed"]), (&json!("held"), &json!(3)));
    assert_eq!(shop.fakes["a"].orders.len(), 3);
    shop.ask(Ask::Resume { order: id }).unwrap();
    assert_eq!(shop.fakes["a"].orders.len(), 4);
    assert!(shop.ask(Ask::Resume { order: id }).is_err());
    shop.ask(Ask::Cancel { order: id }).unwrap();
    shop.end_all(Phase::Failed);
    shop.second();
    assert_eq!(shop.fakes["a"].orders.len(), 4);
    assert!(shop.ask(Ask::Cancel { order: 99 }).unwrap_err().contains("no order 99"));
}

#[test]
fn a_machine_that_refuses_is_left_alone_for_a_while() {
    let mut shop = Shop::new(&["a"]);
    shop.fakes.get_mut("a").unwrap().refuses = true;
    shop.second();
    let id = shop.order(1, Wish::default());
    for _ in 0..35 {
        shop.second();
    }
    let attempts = shop.ask(Ask::Queue).unwrap()["attempts"].as_array().unwrap().len();
    assert!((2..=5).contains(&attempts), "{attempts}");
    shop.fakes.get_mut("a").unwrap().refuses = false;
    for _ in 0..25 {
        shop.second();
        shop.end_all(Phase::Completed);
    }
    assert_eq!(shop.of_order(id)["state"], "done");
}

#[test]
fn a_journal_comes_whole_whatever_is_lost_on_the_way() {
    let mut shop = Shop::new(&["a"]);
    for number in 0..10 {
        shop.fakes.get_mut("a").unwrap().note("note", &number.to_string());
    }
    shop.second();
    // Entry 11 is lost, 12 is published, and once more.
    for kind in ["alarm", "note"] {
        shop.fakes.get_mut("a").unwrap().note(kind, "x");
    }
    let last = shop.fakes["a"].journal[11].clone();
    for _ in 0..2 {
        let published = Journal {
            since: 11,
            last: 12,
            entries: vec![last.clone()],
            more: false,
        };
        shop.give(vec![Event::Journal("a".into(), published)]);
    }
    let told = shop.ask(Ask::Journal {
        machine: "a".into(),
        since: Some(0),
    });
    assert_eq!(told.unwrap()["entries"], json!(shop.fakes["a"].journal));
    let overview = shop.ask(Ask::Overview).unwrap();
    assert_eq!(overview["alarms"].as_array().unwrap().len(), 1);
}

#[test]
fn a_journal_that_begins_anew_is_told_from_its_beginning() {
    let mut shop = Shop::new(&["a"]);
    for number in 0..10 {
        shop.fakes.get_mut("a").unwrap().note("alarm", &number.to_string());
    }
    shop.second();
    // Another state folder: what happens now has the numbers of other things.
    let fake = shop.fakes.get_mut("a").unwrap();
    fake.journal.clear();
    fake.boot += 1;
    fake.note("alarm", "anew");
    shop.give(vec![Event::Alive("a".into(), true)]);
    shop.second();
    shop.fakes.get_mut("a").unwrap().note("note", "and on");
    shop.second();
    let told = |shop: &mut Shop, since| {
        let machine = "a".into();
        shop.ask(Ask::Journal { machine, since }).unwrap()["entries"].clone()
    };
    let journal = json!(shop.fakes["a"].journal);
    assert_eq!(
        (told(&mut shop, Some(0)), told(&mut shop, None)),
        (journal.clone(), journal)
    );
    let overview = shop.ask(Ask::Overview).unwrap();
    assert_eq!(overview["alarms"][0]["text"], "anew");
    assert_eq!(overview["alarms"].as_array().unwrap().len(), 1);
}

#[test]
fn a_full_disk_refuses_and_loses_nothing() {
    let mut shop = Shop::new(&["a"]);
    shop.second();
    let store = &shop.core.as_ref().unwrap().store;
    store.limit(store.pages());
    let wish = Wish {
        program: "p.ngc".into(),
        count: 1,
        ..Wish::default()
    };
    let ask = Ask::Add {
        wish,
        content: vec![b'x'; 100_000],
    };
    let error = shop.ask(ask.clone()).unwrap_err();
    assert!(error.contains("full"), "{error}");
    for number in 0..200 {
        shop.fakes
            .get_mut("a")
            .unwrap()
            .note("note", &format!("{number} {}", "x".repeat(200)));
    }
    for _ in 0..3 {
        shop.second();
    }
    assert_eq!(shop.fakes["a"].orders.len(), 0);
    // Room again: all of it comes.
    shop.core.as_ref().unwrap().store.limit(100_000);
    shop.ask(ask).unwrap();
    for _ in 0..3 {
        shop.second();
    }
    assert_eq!(shop.fakes["a"].orders.len(), 1);
    assert_eq!(shop.core.as_ref().unwrap().machines["a"].journal, 200);
}

#[test]
fn a_machine_that_came_with_a_batch_that_was_undone_comes_again() {
    let mut shop = Shop::new(&["a"]);
    shop.second();
    let mut new = Fake::default();
    new.note("alarm", "hot");
    shop.fakes.insert("b".into(), new);
    let store = &shop.core.as_ref().unwrap().store;
    store.limit(store.pages());
    let (sender, answer) = sync_channel(1);
    let wish = Wish {
        program: "p.ngc".into(),
        count: 1,
        ..Wish::default()
    };
    let add = Ask::Add {
        wish,
        content: vec![b'x'; 100_000],
    };
    let reply: Reply = Box::new(move |answer| sender.send(answer).unwrap());
    shop.give(vec![Event::Alive("b".into(), true), Event::Ask(add, reply)]);
    assert!(answer.recv().unwrap().unwrap_err().contains("full"));
    shop.core.as_ref().unwrap().store.limit(100_000);
    shop.second();
    let overview = shop.ask(Ask::Overview).unwrap();
    assert_eq!(overview["alarms"][0]["text"], "hot", "{overview}");
    shop.restart();
    assert_eq!(shop.core.as_ref().unwrap().machines["b"].journal, 1);
}

#[test]
fn a_control_gets_orders_once_no_other_one_has_spoken_with_its_certificate_for_a_while() {
    let mut shop = Shop::new(&["a"]);
    shop.fakes.get_mut("a").unwrap().boot = 7;
    let id = shop.order(1, Wish::default());
    shop.second();
    let stored = shop.core.as_ref().unwrap().store.set_stored("a", "p.ngc", Some("0"));
    stored.unwrap();
    let run = || Ask::RunProgram {
        machine: "a".into(),
        program: "p.ngc".into(),
    };
    let refused = shop.ask(run()).unwrap_err();
    assert!(refused.contains("just come"), "{refused}");
    let overview = shop.ask(Ask::Overview).unwrap();
    let why = overview["machines"][0]["state"]["why_not"].as_str().unwrap();
    assert!(why.contains("just come"), "{why}");
    // Its copy was on another network until now: both are ready.
    for _ in 0..3 {
        let copy = State {
            boot: 9,
            is_ready: true,
            remote: Remote::Run,
            ..State::default()
        };
        shop.give(vec![Event::State("a".into(), Box::new(copy))]);
        shop.second();
    }
    assert_eq!(shop.fakes["a"].orders.len(), 0);
    // Each second it is another run: as one whose control is begun again and again.
    for boot in 10..20 {
        shop.fakes.get_mut("a").unwrap().boot = boot;
        shop.second();
    }
    assert_eq!(shop.fakes["a"].orders.len(), 0);
    for _ in 0..4 {
        shop.second();
    }
    assert_eq!(shop.fakes["a"].orders.len(), 1);
    shop.end_all(Phase::Completed);
    shop.second();
    assert_eq!(shop.of_order(id)["state"], "done");
}

#[test]
fn two_controls_that_speak_as_one_machine_get_no_orders_until_one_is_gone() {
    let mut shop = Shop::new(&["a"]);
    shop.fakes.get_mut("a").unwrap().boot = 7;
    shop.second();
    let copy = State {
        boot: 9,
        journal: 0,
        is_ready: true,
        remote: Remote::Run,
        ..State::default()
    };
    for _ in 0..3 {
        shop.give(vec![Event::State("a".into(), Box::new(copy.clone()))]);
        shop.second();
    }
    let id = shop.order(1, Wish::default());
    let machine = "a".to_owned();
    let stored = shop.core.as_ref().unwrap().store.set_stored("a", "p.ngc", Some("0"));
    stored.unwrap();
    let program = "p.ngc".into();
    let refused = shop.ask(Ask::RunProgram { machine, program }).unwrap_err();
    assert!(refused.contains("two controls speak"), "{refused}");
    for _ in 0..20 {
        shop.give(vec![Event::State("a".into(), Box::new(copy.clone()))]);
        // Its journal is another one's.
        let journal = Journal {
            since: 0,
            entries: Vec::new(),
            more: false,
            last: 0,
        };
        shop.give(vec![Event::Journal("a".into(), journal)]);
        shop.second();
    }
    assert_eq!(shop.fakes["a"].orders.len(), 0);
    let overview = shop.ask(Ask::Overview).unwrap();
    let refusals = overview["refusals"].as_array().unwrap();
    assert_eq!(refusals.len(), 1, "it is told once: {refusals:?}");
    assert!(
        overview["machines"][0]["state"]["why_not"]
            .as_str()
            .unwrap()
            .contains("two controls")
    );
    // The copy is switched off.
    for _ in 0..20 {
        shop.second();
        shop.end_all(Phase::Completed);
    }
    assert_eq!(
        (shop.of_order(id)["state"].as_str(), shop.fakes["a"].orders.len()),
        (Some("done"), 1)
    );
}

#[test]
fn a_machine_that_is_gone_is_taken_off_the_list_and_its_part_is_made_elsewhere() {
    let mut shop = Shop::new(&["a", "b"]);
    shop.fakes.get_mut("a").unwrap().note("alarm", "hot");
    shop.fakes.get_mut("b").unwrap().is_down = true;
    shop.second();
    let id = shop.order(1, Wish::default());
    assert_eq!(shop.fakes["a"].orders.len(), 1);
    let forget = |shop: &mut Shop| shop.ask(Ask::Forget { machine: "a".into() });
    let refused = forget(&mut shop).unwrap_err();
    assert!(
        refused.contains("a is reached") && refused.contains("ca revoke a"),
        "{refused}"
    );
    shop.fakes.get_mut("a").unwrap().is_down = true;
    shop.fakes.get_mut("b").unwrap().is_down = false;
    for _ in 0..10 {
        shop.second();
    }
    assert_eq!(shop.fakes["b"].orders.len(), 0, "a may have made it");
    assert_eq!(forget(&mut shop), Ok(json!({ "machine": "a" })));
    shop.second();
    shop.end_all(Phase::Completed);
    shop.second();
    let order = shop.of_order(id);
    assert_eq!(
        (&order["state"], &order["completed"], &order["failed"]),
        (&json!("done"), &json!(1), &json!(1))
    );
    assert_eq!(shop.fakes["b"].orders.len(), 1);
    let gone = |overview: &Value| {
        let parts = ["machines", "alarms", "times"].map(|part| overview[part].as_array().unwrap());
        let of = |one: &Value| one["name"] == "a" || one["machine"] == "a";
        !parts.iter().any(|part| part.iter().any(of))
    };
    shop.give(vec![Event::Alive("a".into(), false)]);
    let overview = shop.ask(Ask::Overview).unwrap();
    assert!(gone(&overview), "{overview}");
    assert!(forget(&mut shop).unwrap_err().contains("no machine"));
    shop.restart();
    shop.give(vec![Event::Alive("a".into(), false)]);
    // It speaks again: as a new one, of which all is told; what it made meanwhile counts no more.
    shop.fakes.get_mut("a").unwrap().is_down = false;
    shop.give(vec![Event::Alive("a".into(), true)]);
    shop.second();
    let told = shop.ask(Ask::Journal {
        machine: "a".into(),
        since: Some(0),
    });
    assert_eq!(told.unwrap()["entries"], json!(shop.fakes["a"].journal));
    assert_eq!(shop.of_order(id)["completed"], 1);
}

#[test]
fn time_is_counted_by_what_it_is_spent_on() {
    let mut shop = Shop::new(&["a"]);
    shop.second();
    for _ in 0..30 {
        shop.second();
    }
    shop.order(1, Wish::default());
    for _ in 0..30 {
        shop.second();
    }
    shop.fakes.get_mut("a").unwrap().is_down = true;
    for _ in 0..40 {
        shop.second();
    }
    let overview = shop.ask(Ask::Overview).unwrap();
    let seconds = |what: &str| {
        let times = overview["times"].as_array().unwrap();
        times
            .iter()
            .find(|time| time["what"] == what)
            .map_or(0.0, |time| time["seconds"].as_f64().unwrap())
    };
    assert!((29.0..=32.0).contains(&seconds("idle")), "{overview}");
    assert!((29.0..=32.0).contains(&seconds("running")), "{overview}");
    assert!((30.0..=41.0).contains(&seconds("unknown")), "{overview}");
    assert_eq!(overview["machines"][0]["alive"], false);
    let refused = shop.ask(Ask::Hold { machine: "a".into() }).unwrap_err();
    assert_eq!(refused, "a is not reached; it works on alone");
    let line = "G0 X0".into();
    assert!(
        shop.ask(Ask::Mdi {
            machine: "a".into(),
            line
        })
        .is_err()
    );
}

#[derive(Clone, Debug)]
enum Mishap {
    Second,
    Complete,
    Fail,
    KillSupervisor,
    KillControl(usize),
    Lose(bool),
    Swallow(bool),
    /// Something that was said or answered comes once more.
    Late(usize),
}

fn mishap() -> impl Strategy<Value = Mishap> {
    prop_oneof![
        6 => Just(Mishap::Second),
        3 => Just(Mishap::Complete),
        1 => Just(Mishap::Fail),
        2 => Just(Mishap::KillSupervisor),
        2 => (0usize..3).prop_map(Mishap::KillControl),
        1 => any::<bool>().prop_map(Mishap::Lose),
        1 => any::<bool>().prop_map(Mishap::Swallow),
        3 => any::<usize>().prop_map(Mishap::Late),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// Whatever is killed or lost in whatever order, in the end as many parts were completed as were ordered, and no id ran twice.
    #[test]
    fn no_order_is_lost_or_doubled(mishaps in proptest::collection::vec(mishap(), 0..60), count in 1u32..8) {
        let mut shop = Shop::new(&["a", "b", "c"]);
        shop.second();
        let id = shop.order(count, Wish::default());
        for mishap in mishaps {
            match mishap {
                Mishap::Second => shop.second(),
                Mishap::Complete => shop.end_all(Phase::Completed),
                Mishap::Fail => shop.end_all(Phase::Failed),
                Mishap::KillSupervisor => shop.restart(),
                Mishap::KillControl(at) => {
                    let name = shop.names()[at].clone();
                    let fake = shop.fakes.get_mut(&name).unwrap();
                    fake.end(Phase::Interrupted);
                    fake.boot += 1;
                    shop.give(vec![Event::Alive(name.clone(), false), Event::Alive(name, true)]);
                }
                Mishap::Lose(loses) => shop.loses = loses,
                Mishap::Swallow(swallows) => shop.swallows = swallows,
                Mishap::Late(at) => {
                    let (name, state) = shop.said[at % shop.said.len()].clone();
                    let mut late = vec![Event::State(name, Box::new(state))];
                    if let Some((ticket, octets)) = shop.answered.get(at % shop.answered.len().max(1)) {
                        late.push(Event::Answer(*ticket, Ok(octets.clone())));
                    }
                    shop.give(late);
                }
            }
        }
        (shop.loses, shop.swallows) = (false, false);
        // A question of which nothing is heard is asked again after a minute.
        for _ in 0..130 {
            shop.second();
            shop.end_all(Phase::Completed);
            if shop.of_order(id)["state"] == "held" {
                shop.ask(Ask::Resume { order: id }).unwrap();
            }
        }
        let order = shop.of_order(id);
        prop_assert_eq!(&order["state"], &json!("done"), "{}", order);
        let all = shop.fakes.values().flat_map(|fake| &fake.orders);
        let mut ids: Vec<&String> = all.clone().map(|order| &order.id).collect();
        let runs = ids.len();
        ids.sort();
        ids.dedup();
        prop_assert_eq!(ids.len(), runs);
        let completed = all.filter(|order| order.phase == Phase::Completed).count();
        prop_assert_eq!(completed as u32, count);
        for (name, fake) in &shop.fakes {
            let stored = shop.core.as_ref().unwrap().store.journal(name, 0, 1000).unwrap();
            prop_assert_eq!(&stored, &fake.journal, "{}", name);
        }
    }
}

/// What comes from a machine.
#[derive(Clone, Debug)]
enum Said {
    State(String, Box<State>),
    Journal(String, Journal),
    Answer(u64, Vec<u8>),
    Alive(String, bool),
}

impl Said {
    fn event(self) -> Event {
        match self {
            Said::State(name, state) => Event::State(name, state),
            Said::Journal(name, journal) => Event::Journal(name, journal),
            Said::Answer(ticket, octets) => Event::Answer(ticket, Ok(octets)),
            Said::Alive(name, is_alive) => Event::Alive(name, is_alive),
        }
    }
}

fn forged() -> impl Strategy<Value = Said> {
    let number = || prop_oneof![0u64..4, any::<u64>(), Just(u64::MAX), Just(1 << 63)];
    let name = || prop_oneof![Just("a".to_owned()), Just("never-seen".to_owned())];
    let phase = prop_oneof![
        Just(Phase::Unknown),
        Just(Phase::Refused),
        Just(Phase::Running),
        Just(Phase::Completed),
        Just(Phase::Failed)
    ];
    let order = |(id, phase)| OrderState {
        id,
        phase,
        note: "\u{1b}[2J".into(),
        took_s: Some(-1e300),
    };
    let order = (prop_oneof![Just("s1-1".to_owned()), ".{0,9}"], phase).prop_map(order);
    let state = (name(), number(), number(), proptest::option::of(order)).prop_map(|(name, boot, journal, order)| {
        let state = State {
            boot,
            journal,
            order,
            is_ready: true,
            remote: Remote::Run,
            ..State::default()
        };
        Said::State(name, Box::new(state))
    });
    let entry = (number(), any::<f64>(), ".{0,9}").prop_map(
        |(seq, at, text)| json!({ "seq": seq, "unix_s": at, "kind": "alarm", "text": text, "acknowledges": [[seq], {}] }),
    );
    let entry = prop_oneof![entry, Just(Value::Null), Just(json!([[]]))];
    let entries = proptest::collection::vec(entry, 0..4);
    let journal = (name(), number(), entries, any::<bool>(), number());
    prop_oneof![
        state,
        journal.prop_map(|(name, since, entries, more, last)| {
            let journal = Journal {
                since,
                entries,
                more,
                last,
            };
            Said::Journal(name, journal)
        }),
        (0u64..40, proptest::collection::vec(any::<u8>(), 0..20))
            .prop_map(|(ticket, octets)| Said::Answer(ticket, octets)),
        (name(), any::<bool>()).prop_map(|(name, is_alive)| Said::Alive(name, is_alive)),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// A machine that lies harms itself alone: the store takes it, people are answered, the others make their parts.
    #[test]
    fn what_a_machine_forges_is_its_own_affair(events in proptest::collection::vec(forged(), 0..60)) {
        let mut shop = Shop::new(&["b", "c"]);
        shop.fakes.insert("a".into(), Fake { refuses: true, ..Fake::default() });
        shop.fakes.insert("never-seen".into(), Fake { is_down: true, ..Fake::default() });
        for name in ["b", "c"] {
            shop.fakes.get_mut(name).unwrap().note("alarm", "true");
        }
        shop.second();
        let id = shop.order(4, Wish::default());
        for event in events {
            shop.give(vec![event.event()]);
            shop.ask(Ask::Overview).unwrap();
            shop.ask(Ask::Machines).unwrap();
        }
        for _ in 0..130 {
            shop.second();
            shop.end_all(Phase::Completed);
        }
        let order = shop.of_order(id);
        prop_assert_eq!(&order["state"], &json!("done"), "{}", order);
        for name in ["b", "c"] {
            let stored = shop.core.as_ref().unwrap().store.journal(name, 0, 1000).unwrap();
            prop_assert_eq!(&stored, &shop.fakes[name].journal, "{}", name);
        }
        // It is known again from its own store.
        shop.restart();
        shop.ask(Ask::Overview).unwrap();
    }
}

#[test]
fn a_store_of_memory_is_enough_to_begin_with() {
    let core = Core::new(Store::open(Path::new(":memory:")).unwrap(), Box::new(|| "x".into())).unwrap();
    assert!(core.machines.is_empty());
}
