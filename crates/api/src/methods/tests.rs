use super::*;
use crate::orders;
use crate::orders::{Jogged, Source};
use crate::rpc;
use bus::service::{Diagnose, Mailbox, MailboxFull, MailboxReply, NetworkLive, NodeLive};
use bus::{NodeIndex, SDO_VALUE_MAX};
use motion::canon::Axis;
use serde_json::json;
use std::path::Path;

/// A bus that knows of its network and refuses every second request.
#[derive(Default)]
struct HalfDeafBus {
    network: Option<NetworkLive>,
    tickets: Vec<u64>,
    replies: Vec<MailboxReply>,
}

impl Mailbox for HalfDeafBus {
    fn request(&mut self, request: MailboxRequest) -> Result<(), MailboxFull> {
        if self.tickets.len() % 2 == 1 {
            return Err(MailboxFull);
        }
        self.tickets.push(request.ticket);
        Ok(())
    }

    fn reply(&mut self) -> Option<MailboxReply> {
        self.replies.pop()
    }
}

impl Diagnose for HalfDeafBus {
    fn network(&mut self, _now_ns: u64) -> Option<NetworkLive> {
        self.network.clone()
    }

    fn node(&mut self, _node: NodeIndex, _now_ns: u64) -> Option<NodeLive> {
        None
    }
}

fn methods() -> Methods {
    methods_on(HalfDeafBus::default())
}

fn methods_on(bus: HalfDeafBus) -> Methods {
    let machine = include_str!("../../../../configs/mill3-demo.toml");
    let config = config::parse(machine, Path::new("demo.toml")).unwrap();
    let (client, _) = orders::order_channel();
    Methods::new(
        NetworkView::from_config(&config),
        Arc::new(RtStatus::default()),
        Box::new(bus),
        client,
        || 0,
    )
}

fn call(methods: &mut Methods, method: &str, params: Value) -> Option<Result<Value, RpcError>> {
    let line = json!({ "jsonrpc": "2.0", "id": 1, "method": method, "params": params }).to_string();
    methods.call(&mut caller(1), &rpc::parse(line.as_bytes()).unwrap(), 7)
}

fn caller(client: ClientId) -> Caller {
    Caller {
        client,
        process: 0,
        role: Role::SetUp,
        name: None,
        subscription: None,
    }
}

fn refusal(methods: &mut Methods, method: &str, params: Value) -> String {
    call(methods, method, params).unwrap().unwrap_err().message.text
}

#[test]
fn programs_in_structured_text_are_changed_by_whoever_sets_up_and_pins_are_looked_at_by_everybody() {
    let role = |name: &str| {
        METHODS
            .iter()
            .find(|method| method.name == name)
            .map(|method| method.role)
    };
    for name in ["logic.force", "logic.release", "logic.reload"] {
        assert_eq!(role(name), Some(Role::SetUp), "{name}");
    }
    for name in [
        "logic.list",
        "logic.look",
        "hal.list",
        "scope.begin",
        "scope.next",
        "scope.end",
    ] {
        assert_eq!(role(name), Some(Role::Watch), "{name}");
    }
    let mut methods = methods();
    let force =
        json!({ "jsonrpc": "2.0", "id": 1, "method": "logic.force", "params": { "variable": "a", "value": "1" } });
    let request = rpc::parse(force.to_string().as_bytes()).unwrap();
    let mut operator = caller(1);
    operator.role = Role::Operate;
    let refused = methods.call(&mut operator, &request, 1).unwrap().unwrap_err();
    assert_eq!(refused.code, code::NOT_ALLOWED);
    let without_any = methods.call(&mut caller(2), &request, 2).unwrap().unwrap_err();
    assert!(
        without_any
            .message
            .text
            .contains("this machine has no program in Structured Text")
    );
    let listed = call(&mut methods, "logic.list", json!({})).unwrap().unwrap();
    assert_eq!(listed, json!({ "programs": [] }));
}

#[test]
fn names_are_given_once_and_the_table_tells_them() {
    for (place, method) in METHODS.iter().enumerate() {
        assert!(METHODS[..place].iter().all(|other| other.name != method.name));
    }
    let table = call(&mut methods(), "methods", json!({})).unwrap().unwrap();
    assert_eq!(table.as_array().unwrap().len(), METHODS.len());
    assert_eq!(table[12]["name"], "bus.sdo_read");
    assert_eq!(table[12]["params"], json!(["node", "index", "sub", "request_id"]));
    assert_eq!(table[3]["params"], json!([]), "who only looks needs no id");
}

#[test]
fn refusals_say_what_there_is() {
    let mut methods = methods();
    assert_eq!(
        refusal(&mut methods, "bus.nodes", json!({})),
        "no method \"bus.nodes\"; there are methods, rpc.discover, client.identify, status, subscribe, unsubscribe, control.take, \
         control.release, ping, machine.describe, metrics, bus.network, bus.sdo_read, bus.sdo_write, \
         sim.fault, on, off, estop, estop.reset, home, program.upload.begin, \
         program.upload.append, program.upload.commit, program.load, program.start, program.check, program.run, program.report, \
         program.text, program.path.begin, program.path.next, program.path.end, \
         hal.list, scope.begin, scope.next, scope.end, \
         mdi, mdi.stream, mdi.history, touch_off, offset.list, offset.set, tool.list, tool.set, tool.delete, tool.changed, jog, jog.keep, \
         jog.stop, spindle, coolant, hold, resume, skip, reverse, single_block, optional_stop, block_delete, stop, override, journal.since, parts.set, alarm.acknowledge, \
         logic.list, logic.look, logic.force, logic.release, logic.reload, \
         machine.file, machine.check, machine.write, machine.doctor, hal.values, hal.set, button.press, job.kinds, job.make, cycle.times"
    );
    assert_eq!(
        refusal(&mut methods, "status", json!({ "x": 1 })),
        "unknown parameter \"x\": it takes none"
    );
    assert_eq!(
        refusal(
            &mut methods,
            "bus.sdo_read",
            json!({ "node": 99, "index": 0x1000, "sub": 0 })
        ),
        "no node has the id 99; nodes are 1, 2, 3, 10"
    );
    assert_eq!(
        refusal(
            &mut methods,
            "bus.sdo_read",
            json!({ "node": 1, "index": 0x10000, "sub": 0 })
        ),
        "parameter \"index\": expected a whole number from 0 to 65535, got 65536"
    );
    let long = "00".repeat(SDO_VALUE_MAX + 1);
    let refusal = refusal(
        &mut methods,
        "bus.sdo_write",
        json!({ "node": 1, "index": 1, "sub": 0, "value": long }),
    );
    assert!(refusal.starts_with("parameter \"value\": expected up to 4096 octets"));
}

#[test]
fn a_silenced_control_shows_itself_and_refuses_everything_else_at_once() {
    let mut methods = methods();
    methods.live.show_silenced();
    let status = call(&mut methods, "status", json!({})).unwrap().unwrap();
    assert_eq!(status["state"], "silenced");
    assert!(call(&mut methods, "bus.network", json!({})).unwrap().is_ok());
    for method in METHODS.iter().filter(|method| !method.looks) {
        assert_eq!(
            refusal(&mut methods, method.name, json!({})),
            silenced(false, false).text,
            "{}",
            method.name
        );
    }
}

#[test]
fn before_the_first_record_only_the_machine_file_is_told() {
    let mut methods = methods();
    let network = call(&mut methods, "bus.network", json!({})).unwrap().unwrap();
    let view: NetworkView = serde_json::from_value(network).unwrap();
    assert_eq!(view, methods.network);
    let status = call(&mut methods, "status", json!({})).unwrap().unwrap();
    assert_eq!((&status["state"], &status["cycles"]), (&json!("booting"), &json!(0)));
}

#[test]
fn the_network_is_told_as_the_bus_tells_it() {
    let mut methods = methods_on(HalfDeafBus {
        network: Some(NetworkLive {
            nmt_state: "NOT_ACTIVE".into(),
            ..NetworkLive::default()
        }),
        ..HalfDeafBus::default()
    });
    let view = call(&mut methods, "bus.network", json!({})).unwrap().unwrap();
    assert_eq!(view["live"]["nmt_state"], "NOT_ACTIVE");
    assert_eq!(view["nodes"][0]["live"], Value::Null);
}

#[test]
fn objects_are_read_by_the_bus_as_far_as_it_has_room() {
    let replies = |result| vec![MailboxReply { ticket: 7, result }];
    let read = json!({ "node": 1, "index": 0x1018, "sub": 1 });
    for (result, answer) in [
        (Ok(vec![1, 0xAB]), Ok(json!({ "value": "01ab" }))),
        (
            Err(MailboxError::Aborted(AbortCode::NO_OBJECT)),
            Err(code::NODE_NO_OBJECT),
        ),
        (
            Err(MailboxError::Aborted(AbortCode::NO_SUB_INDEX)),
            Err(code::NODE_ABORT),
        ),
        (Err(MailboxError::Failed("no answer".into())), Err(code::NODE)),
    ] {
        let mut methods = methods_on(HalfDeafBus {
            replies: replies(result),
            ..HalfDeafBus::default()
        });
        assert_eq!(call(&mut methods, "bus.sdo_read", read.clone()), None);
        let full = "as many objects as possible are being read or written already";
        assert_eq!(refusal(&mut methods, "bus.sdo_read", read.clone()), full);
        let (ticket, told) = methods.later().expect("a reply");
        assert_eq!((ticket, told.map_err(|error| error.code)), (7, answer));
        assert!(methods.later().is_none());
    }
}

#[test]
fn programs_come_by_path_or_as_text() {
    let machine = include_str!("../../../../configs/mill3-demo.toml");
    let config = config::parse(machine, Path::new("demo.toml")).unwrap();
    let (client, mut inbox) = orders::order_channel();
    let mut methods = Methods::new(
        NetworkView::from_config(&config),
        Arc::new(RtStatus::default()),
        Box::new(HalfDeafBus::default()),
        client,
        || 0,
    );
    for (params, refused) in [
        (json!({}), "expected \"path\", \"upload\", or \"text\" and \"name\""),
        (
            json!({ "path": "part.ngc" }),
            "parameter \"path\": expected an absolute path, got \"part.ngc\"",
        ),
        (json!({ "path": 5 }), "parameter \"path\": expected a text, got 5"),
        (
            json!({ "path": "/part.ngc", "text": "M2" }),
            "expected \"path\" alone, or \"text\" and \"name\"",
        ),
    ] {
        assert_eq!(refusal(&mut methods, "program.run", params), refused);
    }
    assert_eq!(call(&mut methods, "program.run", json!({ "path": "/part.ngc" })), None);
    assert_eq!(inbox.take(), Some((7, Order::Run(Source::File("/part.ngc".into())))));
    assert_eq!(
        call(&mut methods, "program.run", json!({ "name": "n", "text": "M2" })),
        None
    );
    let text = Source::Text {
        name: "n".into(),
        text: "M2".into(),
    };
    assert_eq!(inbox.take(), Some((7, Order::Run(text))));
    assert_eq!(call(&mut methods, "hold", json!({})), None);
    assert_eq!(inbox.take(), Some((7, Order::Hold)));
    inbox.answer(7, Ok(json!({})));
    assert_eq!(methods.later(), Some((7, Ok(json!({})))));
    for (method, params, order) in [
        ("reverse", json!({}), Order::Reverse(1.0)),
        ("reverse", json!({ "percent": 25 }), Order::Reverse(0.25)),
        ("single_block", json!({ "on": true }), Order::SingleBlock(true)),
        ("optional_stop", json!({ "on": true }), Order::OptionalStop(true)),
        ("block_delete", json!({ "on": false }), Order::BlockDelete(false)),
    ] {
        assert_eq!(call(&mut methods, method, params), None);
        assert_eq!(inbox.take(), Some((7, order)));
    }
    for (method, params, refused) in [
        (
            "reverse",
            json!({ "percent": 0 }),
            "parameter \"percent\": expected a number above 0 and up to 100, got 0",
        ),
        (
            "reverse",
            json!({ "percent": 101.5 }),
            "parameter \"percent\": expected a number above 0 and up to 100, got 101.5",
        ),
        (
            "single_block",
            json!({}),
            "parameter \"on\": expected true or false, it is missing",
        ),
        (
            "single_block",
            json!({ "on": 1 }),
            "parameter \"on\": expected true or false, got 1",
        ),
    ] {
        assert_eq!(refusal(&mut methods, method, params), refused);
    }
    drop(inbox);
    assert_eq!(refusal(&mut methods, "stop", json!({})), "the control is ending");
}

#[test]
fn a_jog_says_what_how_fast_and_how_far() {
    let read = |params: Value| {
        let line = json!({ "jsonrpc": "2.0", "id": 1, "method": "jog", "params": params }).to_string();
        arguments::jog(&rpc::parse(line.as_bytes()).unwrap().params).map_err(|error| error.message.text)
    };
    assert_eq!(
        read(json!({ "axis": "x", "velocity_mm_s": -20 })),
        Ok(Jog {
            what: Some(Jogged::Axis(Axis::X)),
            motion: JogMotion::Run { velocity_mm_s: -20.0 },
        })
    );
    assert_eq!(
        read(json!({ "joint": 2, "velocity_mm_s": 5.5, "distance_mm": -0.1 })),
        Ok(Jog {
            what: Some(Jogged::Joint(2)),
            motion: JogMotion::Advance {
                distance_mm: -0.1,
                velocity_mm_s: 5.5,
            },
        })
    );
    for (params, why) in [
        (json!({ "velocity_mm_s": 1 }), "expected \"axis\" or \"joint\""),
        (
            json!({ "axis": "X", "joint": 1, "velocity_mm_s": 1 }),
            "expected \"axis\" or \"joint\", not both",
        ),
        (
            json!({ "axis": "XY", "velocity_mm_s": 1 }),
            "parameter \"axis\": expected one of X Y Z A B C U V W, got \"XY\"",
        ),
        (
            json!({ "axis": "X" }),
            "parameter \"velocity_mm_s\": expected a number, it is missing",
        ),
        (
            json!({ "axis": "X", "velocity_mm_s": "fast" }),
            "parameter \"velocity_mm_s\": expected a number, got \"fast\"",
        ),
        (
            json!({ "axis": "X", "velocity_mm_s": 0 }),
            "parameter \"velocity_mm_s\": expected a velocity, got 0",
        ),
    ] {
        assert_eq!(read(params), Err(why.to_owned()));
    }
}

#[test]
fn overrides_are_turned_at_once_all_or_none() {
    let mut methods = methods();
    let turned = call(&mut methods, "override", json!({ "feed": 80, "rapid": 25.5 }))
        .unwrap()
        .unwrap();
    let stands = json!({
        "feed_percent": 80.0, "rapid_percent": 25.5, "spindle_percent": 100.0, "feed_acts": true, "spindle_acts": true,
        "adaptive_feed_acts": false, "feed_hold_acts": true,
    });
    assert_eq!(turned, stands);
    for (params, refused) in [
        (
            json!({}),
            "expected \"feed\", \"rapid\" or \"spindle\", in percent of what is programmed",
        ),
        (json!({ "feed": 50, "rapid": 101 }), "rapid 101 %: expected 0 to 100 %"),
        (json!({ "feed": 120.1 }), "feed 120.1 %: expected 0 to 120 %"),
        (json!({ "spindle": 10 }), "spindle 10 %: expected 50 to 120 %"),
        (
            json!({ "feed": "fast" }),
            "parameter \"feed\": expected a number, got \"fast\"",
        ),
        (
            json!({ "speed": 50 }),
            "unknown parameter \"speed\": known are feed, rapid, spindle, request_id",
        ),
    ] {
        assert_eq!(refusal(&mut methods, "override", params), refused);
    }
    let status = call(&mut methods, "status", json!({})).unwrap().unwrap();
    assert_eq!(status["override"], stands, "a refusal changes nothing");
}

/// Every method, asked for by whoever has control and by another client.
#[test]
fn orders_of_others_are_refused_and_what_slows_down_or_looks_is_for_everyone() {
    let params = |method: &table::Method| match method.name {
        "override" => json!({ "spindle": 110 }),
        _ => json!({}),
    };
    let for_everyone = ["estop", "hold", "stop", "jog.stop", "bus.sdo_read"];
    for method in METHODS.iter() {
        let mut methods = methods();
        let mut ask = |client, name: &str, params: Value| {
            let line = json!({ "jsonrpc": "2.0", "id": 1, "method": name, "params": params }).to_string();
            let answer = methods.call(&mut caller(client), &rpc::parse(line.as_bytes()).unwrap(), client);
            answer.and_then(Result::err)
        };
        assert_eq!(ask(1, "control.take", json!({ "name": "the panel" })), None);
        let mut is_free = |client| {
            let refusal = ask(client, method.name, params(method));
            refusal.is_none_or(|error| error.code != code::NO_CONTROL)
        };
        assert!(is_free(1), "{}", method.name);
        let others = is_free(2);
        match method.name {
            // Of one that has been taken.
            "control.take" => assert!(!others),
            // It was let go by its holder.
            "control.release" => assert!(others),
            name => assert_eq!(
                others,
                method.looks
                    || for_everyone.contains(&name)
                    || name.starts_with("program.upload")
                    || name == "program.check",
                "{name}"
            ),
        }
    }
    let mut methods = methods();
    let mut ask = |client, name: &str, params: Value| {
        let line = json!({ "jsonrpc": "2.0", "id": 1, "method": name, "params": params }).to_string();
        let request = rpc::parse(line.as_bytes()).unwrap();
        methods
            .call(&mut caller(client), &request, client)
            .unwrap()
            .map_err(|error| error.code)
    };
    ask(1, "control.take", json!({})).unwrap();
    assert!(ask(2, "override", json!({ "feed": 60, "rapid": 0 })).is_ok());
    for faster in [
        json!({ "feed": 61 }),
        json!({ "feed": 10, "rapid": 1 }),
        json!({ "spindle": 50 }),
    ] {
        assert_eq!(ask(2, "override", faster), Err(code::NO_CONTROL));
    }
    assert_eq!(ask(1, "status", json!({})).unwrap()["override"]["feed_percent"], 60.0);
    assert!(ask(1, "override", json!({ "feed": 100, "spindle": 50 })).is_ok());
}

#[test]
fn control_taken_by_force_is_written_down_and_that_of_a_client_that_goes_is_free() {
    let machine = include_str!("../../../../configs/mill3-demo.toml");
    let config = config::parse(machine, Path::new("demo.toml")).unwrap();
    let (client, mut inbox) = orders::order_channel();
    let mut methods = Methods::new(
        NetworkView::from_config(&config),
        Arc::new(RtStatus::default()),
        Box::new(HalfDeafBus::default()),
        client,
        || 0,
    );
    let take = |methods: &mut Methods, client, params: Value| {
        let line = json!({ "jsonrpc": "2.0", "id": 1, "method": "control.take", "params": params }).to_string();
        methods
            .call(&mut caller(client), &rpc::parse(line.as_bytes()).unwrap(), client)
            .unwrap()
    };
    let taken = take(&mut methods, 1, json!({ "name": "one" })).unwrap();
    assert_eq!(
        taken,
        json!({ "client": 1, "process": 0, "name": "one", "taken": true })
    );
    assert_eq!(json!(methods.status().control), taken);
    assert_eq!(inbox.take(), None);
    take(&mut methods, 2, json!({ "name": "two", "force": true })).unwrap();
    let note = "control: two (process 0) has taken it from one (process 0)";
    assert_eq!(inbox.take(), Some((0, Order::TakenOver(note.into()))));
    methods.left(1);
    assert_eq!(methods.status().control.unwrap().name, "two");
    methods.left(2);
    assert_eq!(methods.status().control, None);
    for name in ["", "a\nb", &"n".repeat(65)] {
        let refused = take(&mut methods, 1, json!({ "name": name })).unwrap_err();
        assert_eq!(refused.code, code::INVALID_PARAMS);
    }
}

/// Else the document says what the methods do not do.
#[test]
fn parameters_that_are_required_are_refused_where_they_are_missing() {
    for method in METHODS
        .iter()
        .filter(|method| method.params.iter().any(|param| param.required))
    {
        let refused = call(&mut methods(), method.name, json!({})).unwrap().unwrap_err();
        assert_eq!(refused.code, code::INVALID_PARAMS, "{}", method.name);
    }
}
