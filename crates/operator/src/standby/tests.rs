use super::clients::{Checking, Clients};
use crate::console::Operator;
use crate::memory::Memory;
use crate::rehearsal::{Rehearsal, rehearse_with};
use crate::table_writer::Keeper;
use api::orders::{Jogged, Order, OrderClient, Source, order_channel};
use machine::faults::silenced;
use machine::sequence::{Job, Outcome, Step};
use machine::state::State;
use machine::state_file::{Parts, Remembered};
use machine::tables::{Tables, lock};
use rt::timeout;
use serde_json::{Value, json};
use sim::NetConfig;
use std::path::Path;
use std::sync::Mutex;

pub(super) const MILL: &str = include_str!("../../../../configs/mill3-demo.toml");
const PART: &str = "G21 G90 G94 G54\nG0 X5 Y5\nM2\n";

fn run_order() -> Order {
    Order::Run(Source::Text {
        name: "part".into(),
        text: PART.into(),
    })
}

fn endless() -> Source {
    Source::Text {
        name: "endless".into(),
        text: "G21 G90 F100\no1 while [1]\nG1 X1\nX2\no1 endwhile\nM2\n".into(),
    }
}

/// Clients of a machine that stands by, its drives off.
fn while_standing_by(act: impl FnOnce(&mut Rehearsal<'_>, Clients<'_, '_>, &OrderClient)) {
    while_one_stands_by(MILL, PART, act);
}

/// The same of the machine of this file, which has this program.
pub(super) fn while_one_stands_by(
    machine: &str,
    program: &str,
    act: impl FnOnce(&mut Rehearsal<'_>, Clients<'_, '_>, &OrderClient),
) {
    let config = config::parse(machine, Path::new("demo.toml")).unwrap();
    let tables = Mutex::new(Tables::read(&config).unwrap());
    let net = NetConfig::clean(1);
    rehearse_with(&config, program.as_bytes(), net, Operator::standing_by, |run| {
        let up = run.run_until(60_000, |run| run.control.state() == State::Disabled)?;
        assert!(up);
        let (client, inbox) = order_channel();
        std::thread::scope(|scope| act(run, Clients::new(scope, &config, &tables, true, inbox), &client));
        Ok(())
    })
    .unwrap();
}

fn serve_clients(run: &mut Rehearsal<'_>, clients: &mut Clients<'_, '_>) {
    let now_ns = run.now_ns();
    let memory = Memory::new(clients.config, Remembered::default());
    let mut keeper = Keeper::new(clients.scope, clients.tables, memory);
    clients.serve(&mut run.operator, &mut keeper, false, now_ns);
}

#[test]
fn a_silenced_machine_refuses_every_order_with_the_cause_and_ends() {
    let mill = MILL;
    // Its motors have step pulses, and no frames.
    let plotter = include_str!("../../../../configs/plotter2-steps.toml");
    for (machine, said) in [(mill, silenced(true, false)), (plotter, silenced(false, true))] {
        assert_eq!(
            said.text.contains("network") || said.text.contains("frames"),
            machine == mill,
            "{said}"
        );
        while_one_stands_by(machine, PART, |run, mut clients, client| {
            let now_ns = run.now_ns();
            let report = timeout::Report {
                at_ns: now_ns,
                event: timeout::Event::CycleHung {
                    cycle: 3,
                    overdue_ns: 5_050_000,
                },
            };
            run.operator.hear(&report, || "it ran 5.0 ms".into());
            for order in [Order::Acknowledge, Order::On, Order::Stop, run_order()] {
                client.put(1, order).unwrap();
                serve_clients(run, &mut clients);
                let (_, answer) = client.answer().expect("an answer at once");
                assert_eq!(*answer.unwrap_err().message, said);
            }
            // The thread that hung takes no order and shows nothing.
            assert_eq!(run.operator.outcome(), None);
            run.operator.poll(now_ns);
            assert_eq!(run.operator.outcome(), Some(Outcome::Faulted));
            assert!(run.operator.needs_restart());
            let [alarm] = run.operator.alarms() else {
                panic!("{:?}", run.operator.alarms());
            };
            assert_eq!(alarm.cause.text, format!("{said}. It hung for 5.0 ms: it ran 5.0 ms"));
            // Nor does it say so a second time where it comes back.
            run.control.inhibit_soc();
            run.cycle(0).unwrap();
            let now_ns = run.now_ns();
            run.operator.poll(now_ns);
            assert_eq!((run.control.state(), run.operator.alarms().len()), (State::Silenced, 1));
        });
    }
}

#[test]
fn a_program_that_is_stopped_or_forsaken_during_its_check_never_begins() {
    while_standing_by(|run, mut clients, client| {
        client.put(1, run_order()).unwrap();
        client.put(2, Order::Stop).unwrap();
        serve_clients(run, &mut clients);
        let (ticket, answer) = client.answer().expect("an answer");
        assert_eq!(
            (ticket, answer.unwrap_err().message.text.as_str()),
            (1, "stopped before it began")
        );
        assert_eq!(client.answer(), Some((2, Ok(json!({})))));
        while clients.checking.is_some() {
            std::thread::yield_now();
            serve_clients(run, &mut clients);
        }
        assert_eq!((run.operator.step(), client.answer()), (Step::StandBy, None));
        // Nor does one that nobody waits for any more; a ticket that is over changes nothing.
        client.put(4, run_order()).unwrap();
        assert!(client.withdraw(4) && client.withdraw(1));
        serve_clients(run, &mut clients);
        while clients.checking.is_some() {
            std::thread::yield_now();
            serve_clients(run, &mut clients);
        }
        assert_eq!((run.operator.step(), client.answer()), (Step::StandBy, None));
        // The next one does.
        client.put(3, run_order()).unwrap();
        let begun = loop {
            serve_clients(run, &mut clients);
            if let Some(begun) = client.answer() {
                break begun;
            }
            std::thread::yield_now();
        };
        assert_eq!((begun.0, begun.1.is_ok()), (3, true));
        assert_eq!(run.operator.step(), Step::Enable);
    });
}

/// Whoever loads, starts or runs a program is told, and so is the journal; once each.
#[test]
fn doubts_about_a_program_are_in_the_answer_to_whoever_loads_it() {
    while_standing_by(|run, mut clients, client| {
        let answer = |run: &mut Rehearsal<'_>, clients: &mut Clients<'_, '_>, order: Order| {
            client.put(1, order).unwrap();
            loop {
                serve_clients(run, clients);
                if let Some((_, answer)) = client.answer() {
                    return answer.unwrap();
                }
                std::thread::yield_now();
            }
        };
        let load = |text: &str| {
            Order::Load(Source::Text {
                name: "part".into(),
                text: text.into(),
            })
        };
        assert_eq!(answer(run, &mut clients, load(PART))["warning"], Value::Null);
        let loaded = answer(run, &mut clients, load("G21 G90 F600\nS1000\nG1 X5\nG4 P5000\nM2\n"));
        let doubts = [
            "part:2: S without M3 or M4: the spindle stands while the tool cuts in line 3",
            "part:4: waits for 5000 s (83 min): P is seconds here, and milliseconds on some other controls",
        ];
        assert_eq!(loaded["warning"], doubts.join("\n"));
        for doubt in doubts {
            let told = run.operator.journal().iter().filter(|entry| entry.text.contains(doubt));
            assert_eq!(told.count(), 1, "{doubt}");
        }
    });
}

/// Drives go off behind an acknowledge, within some cycles: whoever orders them on at once need not know.
#[test]
fn drives_can_be_switched_on_right_behind_an_acknowledge() {
    while_standing_by(|run, mut clients, client| {
        let switch = |run: &Rehearsal<'_>, closed: bool| run.hal.set("joint.0.pos-lim-sw-in", closed).unwrap();
        let mut answers = Vec::new();
        let mut until = |run: &mut Rehearsal<'_>, state: State| {
            for _ in 0..5000 {
                serve_clients(run, &mut clients);
                answers.extend(client.answer());
                run.cycle(0).unwrap();
                if run.control.state() == state && run.operator.step() == Step::StandBy {
                    return std::mem::take(&mut answers);
                }
            }
            panic!("the machine is {:?}, not {state:?}", run.control.state());
        };
        client.put(1, Order::On).unwrap();
        assert_eq!(until(run, State::Ready), [(1, Ok(json!({})))]);
        switch(run, true);
        until(run, State::Faulted);
        switch(run, false);
        client.put(2, Order::Acknowledge).unwrap();
        client.put(3, Order::On).unwrap();
        assert_eq!(until(run, State::Ready), [(2, Ok(json!({}))), (3, Ok(json!({})))]);
    });
}

/// A pendant moves two axes at once: its orders lie on the inbox together.
#[test]
fn jogs_that_come_in_one_turn_are_all_taken() {
    while_standing_by(|run, mut clients, client| {
        let now_ns = run.now_ns();
        let home = run.operator.homing_order(u64::MAX);
        assert!(run.operator.begin(now_ns, Job::Home(home)));
        let homed = run.run_until(60_000, |run| {
            run.operator.step() == Step::StandBy && run.control.state() == State::Ready
        });
        assert!(homed.unwrap());
        let jog = |joint| {
            Order::Jog(api::orders::Jog {
                what: Some(Jogged::Joint(joint)),
                motion: rt::joint_jog::JogMotion::Run { velocity_mm_s: 10.0 },
            })
        };
        for joint in [0, 1] {
            client.put(joint as u64, jog(joint)).unwrap();
        }
        serve_clients(run, &mut clients);
        for _ in 0..2 {
            let (_, answer) = client.answer().expect("an answer at once");
            assert!(answer.is_ok(), "{answer:?}");
        }
        // Whatever needs rest waits for what becomes of them.
        client.put(9, Order::Home(Vec::new())).unwrap();
        serve_clients(run, &mut clients);
        assert_eq!(client.answer(), None, "the cycle has not taken them yet");
        run.cycle(0).unwrap();
        run.cycle(0).unwrap();
        serve_clients(run, &mut clients);
        let (_, answer) = client.answer().expect("an answer at once");
        assert!(answer.unwrap_err().message.text.contains("something is moved by hand"));
    });
}

/// Else the thread goes on for as long as the limits of a check allow, and the next program is refused meanwhile.
#[test]
fn the_check_of_a_program_that_nobody_wants_any_more_ends_at_once() {
    let endless = || Order::Run(endless());
    while_standing_by(|run, mut clients, client| {
        let giving_up = [
            |_: &mut Clients<'_, '_>, client: &OrderClient| client.put(2, Order::Stop).unwrap(),
            |_: &mut Clients<'_, '_>, client: &OrderClient| assert!(client.withdraw(1)),
            // As the loop does when a signal comes.
            |clients: &mut Clients<'_, '_>, _: &OrderClient| assert!(clients.give_up_check()),
        ];
        for give_up in giving_up {
            client.put(1, endless()).unwrap();
            serve_clients(run, &mut clients);
            give_up(&mut clients, client);
            while let Ok(Some((ticket, order))) = Ok::<_, ()>(clients.inbox.take()) {
                match order {
                    Order::Withdraw => clients.withdraw(ticket),
                    order => assert_eq!((order, clients.give_up_check()), (Order::Stop, true)),
                }
            }
            let Checking { wanted, thread, .. } = clients.checking.take().expect("it is under way");
            let said = thread.join().unwrap().unwrap_err().message.text;
            assert!(
                wanted.is_none() && said.contains("given up here, before the end"),
                "{said}"
            );
            while client.answer().is_some() {}
        }
    });
}

/// The whole control of a machine without joints, in virtual time: it comes up, moves its inputs to its outputs, and refuses
/// whatever would move something.
#[test]
fn a_machine_of_inputs_and_outputs_stands_by_and_refuses_to_move() {
    let machine = include_str!("../../../../configs/io-only.toml");
    let config = config::parse(machine, Path::new("io-only.toml")).unwrap();
    let tables = Mutex::new(Tables::read(&config).unwrap());
    let net = NetConfig::clean(1);
    rehearse_with(&config, b"", net, Operator::standing_by, |run| {
        assert!(run.run_until(60_000, |run| run.control.state() == State::Disabled)?);
        let (client, inbox) = order_channel();
        std::thread::scope(|scope| {
            let mut clients = Clients::new(scope, &config, &tables, true, inbox);
            let jog = api::orders::Jog {
                what: Some(api::orders::Jogged::Joint(0)),
                motion: rt::joint_jog::JogMotion::Release,
            };
            for (ticket, order) in [run_order(), Order::On, Order::Home(Vec::new()), Order::Jog(jog)]
                .into_iter()
                .enumerate()
            {
                client.put(ticket as u64, order).unwrap();
                serve_clients(run, &mut clients);
                let (_, answer) = client.answer().expect("an answer at once");
                let told = answer.unwrap_err().message.text;
                assert_eq!(told, config.without_joints(), "{ticket}");
            }
        });
        assert_eq!(run.control.state(), State::Disabled);
        Ok(())
    })
    .unwrap();
}

#[test]
fn an_order_right_behind_another_waits_for_the_cycle_instead_of_being_refused() {
    while_standing_by(|run, mut clients, client| {
        let load = |name: &str| {
            Order::Load(Source::Text {
                name: name.into(),
                text: PART.into(),
            })
        };
        client.put(1, Order::OptionalStop(true)).unwrap();
        client.put(2, Order::BlockDelete(true)).unwrap();
        client.put(3, Order::BlockDelete(false)).unwrap();
        client.put(4, load("forsaken")).unwrap();
        serve_clients(run, &mut clients);
        assert_eq!(client.answer(), Some((1, Ok(json!({})))));
        serve_clients(run, &mut clients);
        assert_eq!(client.answer(), None, "the cycle has not run yet");
        assert!(client.withdraw(4));
        // A stop waits for nothing, and what waits does not begin behind it.
        client.put(5, Order::Stop).unwrap();
        serve_clients(run, &mut clients);
        for ticket in [2, 3] {
            let (answered, answer) = client.answer().expect("an answer");
            assert_eq!(
                (answered, answer.unwrap_err().message.text.as_str()),
                (ticket, "stopped before it began")
            );
        }
        assert_eq!(client.answer(), Some((5, Ok(json!({})))));
        run.run_until(500, |_| false).unwrap();
        assert!(run.operator.live().optional_stop && !lock(clients.tables).block_delete);

        client.put(6, Order::OptionalStop(false)).unwrap();
        client.put(7, Order::BlockDelete(true)).unwrap();
        serve_clients(run, &mut clients);
        assert_eq!(client.answer(), Some((6, Ok(json!({})))));
        run.cycle(0).unwrap();
        run.cycle(0).unwrap();
        serve_clients(run, &mut clients);
        assert_eq!(client.answer(), Some((7, Ok(json!({})))));
        assert!(!run.operator.live().optional_stop && lock(clients.tables).block_delete);
    });
}

#[test]
fn pins_switch_block_delete_while_nothing_runs_and_count_parts_from_0() {
    while_standing_by(|run, mut clients, _client| {
        let memory = Memory::new(clients.config, Remembered::default());
        let mut keeper = Keeper::new(clients.scope, clients.tables, memory);
        keeper.memory.set_parts(Parts {
            count: 7,
            target: Some(9),
        });
        let [is_on, count, target] = [
            "halui.program.block-delete.is-on",
            "halui.parts.count",
            "halui.parts.target",
        ];
        let mut turn = |run: &mut Rehearsal<'_>, pin: &str| {
            run.hal.set(pin, true).unwrap();
            run.cycle(0).unwrap();
            run.hal.set(pin, false).unwrap();
            let now_ns = run.now_ns();
            clients.serve(&mut run.operator, &mut keeper, false, now_ns);
            run.cycle(0).unwrap();
            let shown = run.hal.reader::<bool>(is_on).unwrap().get();
            assert_eq!(shown, lock(clients.tables).block_delete);
            let number = |pin| run.hal.reader::<u64>(pin).unwrap().get();
            (shown, [number(count), number(target)])
        };
        assert_eq!(turn(run, "halui.program.block-delete.on"), (true, [7, 9]));
        assert_eq!(turn(run, "halui.program.optional-stop.on"), (true, [7, 9]));
        assert!(run.operator.live().optional_stop);
        assert_eq!(turn(run, "halui.program.block-delete.off"), (false, [7, 9]));
        assert_eq!(turn(run, "halui.parts.reset"), (false, [0, 9]));
        // A program that homes first has been checked with all its lines.
        let now_ns = run.now_ns();
        let home = run.operator.homing_order(u64::MAX);
        assert!(run.operator.begin(now_ns, Job::Home(home)));
        run.run_until(500, |_| false).unwrap();
        assert_eq!(turn(run, "halui.program.block-delete.on"), (false, [0, 9]));
        let journal = run.operator.journal().iter();
        let refused = journal.filter(|entry| {
            entry
                .text
                .starts_with("pin: block-delete refused: joints are being homed")
        });
        assert_eq!(refused.count(), 1);
    });
}

#[test]
fn a_stop_ends_what_moves_beside_the_check_of_a_program() {
    let endless = || Order::Load(endless());
    while_standing_by(|run, mut clients, client| {
        for by_pin in [false, true] {
            let now_ns = run.now_ns();
            let home = run.operator.homing_order(u64::MAX);
            assert!(run.operator.begin(now_ns, Job::Home(home)));
            assert!(
                run.run_until(60_000, |run| run.control.state() == State::Homing)
                    .unwrap()
            );
            client.put(1, endless()).unwrap();
            serve_clients(run, &mut clients);
            assert!(clients.checking.is_some());
            // Another one would leave the first without an end.
            client.put(3, endless()).unwrap();
            serve_clients(run, &mut clients);
            let (ticket, answer) = client.answer().expect("an answer at once");
            assert!(
                ticket == 3
                    && answer
                        .unwrap_err()
                        .message
                        .text
                        .contains("another program is being checked")
            );
            if by_pin {
                run.hal.set("halui.program.stop", true).unwrap();
                run.cycle(0).unwrap();
            } else {
                client.put(2, Order::Stop).unwrap();
            }
            let stopped = run.run_until(200, |run| {
                serve_clients(run, &mut clients);
                run.control.state() != State::Homing
            });
            assert!(stopped.unwrap(), "by the pin: {by_pin}");
            assert!(
                run.run_until(60_000, |run| run.operator.step() == Step::StandBy)
                    .unwrap()
            );
            assert_eq!(run.operator.not_homed(), 7);
            while clients.checking.is_some() {
                std::thread::yield_now();
                serve_clients(run, &mut clients);
            }
            while client.answer().is_some() {}
        }
    });
}

/// Nothing moves yet, but the program would behind the check.
#[test]
fn the_stop_of_the_panel_ends_the_check_of_a_program() {
    while_standing_by(|run, mut clients, client| {
        client.put(1, Order::Run(endless())).unwrap();
        serve_clients(run, &mut clients);
        run.hal.set("halui.program.stop", true).unwrap();
        for _ in 0..3 {
            run.cycle(0).unwrap();
            let now_ns = run.now_ns();
            run.operator.poll(now_ns);
            serve_clients(run, &mut clients);
        }
        let (ticket, answer) = client.answer().expect("an answer");
        assert_eq!(
            (ticket, answer.unwrap_err().message.text.as_str()),
            (1, "stopped before it began")
        );
        assert_eq!(run.operator.step(), Step::StandBy);
    });
}

#[test]
fn what_was_ordered_before_control_was_taken_by_force_does_not_begin() {
    while_standing_by(|run, mut clients, client| {
        client.put(1, Order::Run(endless())).unwrap();
        serve_clients(run, &mut clients);
        client
            .put(0, Order::TakenOver("control: two has taken it from one".into()))
            .unwrap();
        serve_clients(run, &mut clients);
        let (ticket, answer) = client.answer().expect("an answer");
        assert_eq!(
            (ticket, answer.unwrap_err().message.text.as_str()),
            (1, "stopped before it began")
        );
        let journal = run.operator.journal();
        assert!(journal.iter().any(|entry| entry.text.contains("has taken it from")));
    });
}
