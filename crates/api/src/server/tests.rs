use super::intake::Talker;
use super::*;
use crate::socket::Socket;
use nix::sys::eventfd::EfdFlags;
use serde_json::json;
use std::io::{BufRead, BufReader};
use std::os::unix::net::UnixStream;
use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::Duration;

/// Echoes parameters; "later" answers when as many requests wait as its parameter says, the last one first; "block" says that it has
/// begun and waits until the other end of the channel has gone.
#[derive(Default)]
struct Echo {
    blocks: Option<(Sender<()>, Receiver<()>)>,
    wake: Option<Arc<EventFd>>,
    waiting: Vec<(Ticket, Value)>,
    wanted: usize,
    forsaken: Vec<Ticket>,
    left: Vec<ClientId>,
    kept: Option<ClientId>,
    looks: u64,
}

impl Serve for Echo {
    fn call(&mut self, caller: &mut Caller, request: &Request, ticket: Ticket) -> Option<Result<Value, RpcError>> {
        let params = Value::Object(request.params.0.clone());
        match request.method.as_str() {
            "echo" => Some(Ok(params)),
            "subscribe" => {
                let state = self.state();
                caller.subscription = Some(Subscription::begin(&state, 20));
                Some(Ok(json!({ "state": state.fields })))
            }
            "keep" => {
                self.kept = Some(caller.client);
                Some(Ok(params))
            }
            "block" => {
                if let Some((begun, end)) = &self.blocks {
                    begun.send(()).unwrap();
                    let _ = end.recv();
                }
                Some(Ok(params))
            }
            "later" => {
                self.wanted = params["of"].as_u64().unwrap_or(1) as usize;
                self.waiting.push((ticket, params));
                None
            }
            other => Some(Err(RpcError::new(code::METHOD_NOT_FOUND, format!("no {other}")))),
        }
    }

    fn later(&mut self) -> Option<(Ticket, Result<Value, RpcError>)> {
        if self.wanted == 0 || self.waiting.len() < self.wanted {
            return None;
        }
        self.wanted = usize::MAX;
        let (ticket, params) = self.waiting.pop()?;
        Some((ticket, Ok(params)))
    }

    fn gone(&mut self, ticket: Ticket) -> bool {
        // Told twice.
        let again = self.forsaken.contains(&ticket);
        self.forsaken.push(ticket);
        again
    }

    fn keeps(&self, client: ClientId) -> bool {
        self.kept == Some(client)
    }

    fn left(&mut self, client: ClientId) {
        self.left.push(client);
    }

    /// Something new at each look.
    fn state(&mut self) -> State {
        self.looks += 1;
        let fields = json!({ "looks": self.looks, "ballast": "b".repeat(1000), "client_left": self.left });
        State {
            monotonic_ns: self.looks,
            unix_s: 0.0,
            fields: fields.as_object().cloned().unwrap(),
        }
    }

    fn wake(&self) -> Option<Arc<EventFd>> {
        self.wake.clone()
    }
}

/// Runs a server beside `clients`.
fn beside<R>(clients: impl FnOnce(&PathBuf) -> R) -> R {
    beside_with(Echo::default(), &|_| {}, clients)
}

/// The same; `at_once`: as of [`Intake::run`].
fn beside_with<R>(echo: Echo, at_once: &(dyn Fn(&Request) + Sync), clients: impl FnOnce(&PathBuf) -> R) -> R {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("isocnc-control.test");
    let socket = Socket::bind(&path).unwrap();
    let stop = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let wake = EventFd::from_flags(EfdFlags::EFD_NONBLOCK).map(Arc::new).unwrap();
        let mut echo = Echo {
            wake: Some(wake),
            ..echo
        };
        let (_door, intake, arrivals) = entrance(echo.wake());
        let (socket, stop) = (&socket, &stop);
        scope.spawn(move || intake.run(Some(socket), at_once, stop));
        scope.spawn(move || serve(&arrivals, &mut echo, stop));
        // The server must end also where a client's assertion fails.
        let result = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| clients(&path)));
        stop.store(true, Ordering::Release);
        result.unwrap_or_else(|panic| std::panic::resume_unwind(panic))
    })
}

struct Peer(BufReader<UnixStream>);

impl Peer {
    fn connect(path: &PathBuf) -> Peer {
        let stream = UnixStream::connect(path).unwrap();
        // Far beyond anything a server may take: a test fails and does not hang.
        stream.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
        stream.set_write_timeout(Some(Duration::from_secs(20))).unwrap();
        Peer(BufReader::new(stream))
    }

    fn send(&mut self, text: impl AsRef<[u8]>) {
        self.0.get_mut().write_all(text.as_ref()).unwrap();
    }

    fn line(&mut self) -> Value {
        let mut line = String::new();
        self.0.read_line(&mut line).unwrap();
        serde_json::from_str(&line).unwrap_or_else(|error| panic!("{line:?}: {error}"))
    }

    fn ask(&mut self, id: u64, method: &str, params: Value) {
        self.send(format!(
            "{}\n",
            json!({"jsonrpc": "2.0", "id": id, "method": method, "params": params})
        ));
    }

    fn ends(&mut self) -> bool {
        self.0.read_line(&mut String::new()).unwrap() == 0
    }
}

#[test]
fn every_line_gets_its_answer_and_nothing_is_lost() {
    beside(|path| {
        let mut peer = Peer::connect(path);
        // In one write: requests, rubbish, an empty line, a notification, a request without its end.
        peer.send("{\"jsonrpc\":\"2.0\",\"id\":1,\"method\":\"echo\"}\nrubbish\n\r\n");
        peer.send(b"{\"jsonrpc\":\"2.0\",\"method\":\"echo\"}\n\xFF\n");
        peer.send("{\"jsonrpc\":\"2.0\",\"id\":\"two\",\"method\":\"nothing\"}\r\n{\"jsonrpc\":\"2.0\",");
        assert_eq!(peer.line(), json!({"jsonrpc": "2.0", "id": 1, "result": {}}));
        assert_eq!(peer.line()["error"]["code"], code::PARSE);
        assert_eq!(peer.line()["error"]["code"], code::PARSE);
        let answer = peer.line();
        assert_eq!(
            (&answer["id"], &answer["error"]["code"]),
            (&json!("two"), &json!(code::METHOD_NOT_FOUND))
        );
        peer.send("\"id\":3,\"method\":\"echo\",\"params\":{\"a\":[1]}}\n");
        assert_eq!(peer.line(), json!({"jsonrpc": "2.0", "id": 3, "result": {"a": [1]}}));
    });
}

#[test]
fn a_last_line_without_its_end_is_served() {
    beside(|path| {
        let mut peer = Peer::connect(path);
        peer.send("{\"jsonrpc\":\"2.0\",\"id\":1,\"method\":\"echo\"}");
        peer.0.get_mut().shutdown(std::net::Shutdown::Write).unwrap();
        assert_eq!(peer.line()["id"], 1);
        assert!(peer.ends());
    });
}

#[test]
fn a_client_that_has_gone_is_told_of_and_one_that_only_says_no_more_is_not() {
    let pair = || {
        let (near, far) = UnixStream::pair().unwrap();
        near.set_nonblocking(true).unwrap();
        let mut client = Client::new(Arc::new(Connection::new(near, None)), 0);
        client.pending = vec![(7, Some(json!(1))), (8, None)];
        (client, far)
    };
    let mut echo = Echo::default();
    let (mut client, far) = pair();
    far.shutdown(std::net::Shutdown::Write).unwrap();
    Talker::new(Arc::clone(&client.connection)).read();
    assert!(client.connection.heard().ended);
    client.tell_gone(&mut echo);
    assert!(echo.forsaken.is_empty(), "it may still read");
    drop(far);
    for told in 1..=3 {
        client.tell_gone(&mut echo);
        assert_eq!(
            echo.forsaken.len(),
            told.min(2),
            "until it is heard, and a notification never"
        );
    }
    assert_eq!((echo.forsaken.as_slice(), client.pending.len()), (&[7, 7][..], 1));
    let (mut client, far) = pair();
    client.tell_gone(&mut echo);
    assert_eq!((echo.forsaken.len(), client.pending.len()), (2, 2), "it is there");
    drop(far);
}

/// A method that takes long, of the same client or of another one, or clients that come while it does.
#[test]
fn what_brings_the_machine_to_rest_waits_for_no_method() {
    let (begun, begins) = channel();
    let (goes_on, end) = channel::<()>();
    let echo = Echo {
        blocks: Some((begun, end)),
        ..Echo::default()
    };
    let (acted, acts) = channel();
    let acted = Mutex::new(acted);
    let at_once = |request: &Request| {
        let id = request.params.0.get("request_id").cloned();
        acted.lock().unwrap().send((request.method.clone(), id)).unwrap();
    };
    beside_with(echo, &at_once, |path| {
        let mut there = Peer::connect(path);
        there.ask(1, "echo", json!({}));
        assert_eq!(there.line()["id"], 1);
        let mut blocking = Peer::connect(path);
        blocking.ask(1, "block", json!({}));
        begins.recv_timeout(Duration::from_secs(20)).unwrap();
        let next = || acts.recv_timeout(Duration::from_secs(20)).unwrap();
        let told = |method: &str, id: Option<&str>| (method.to_owned(), id.map(|id| json!(id)));
        // Behind what is not served yet, in parts, without an end of its line, and of a client that nobody serves yet.
        blocking.ask(2, "stop", json!({}));
        assert_eq!(next(), told("stop", None));
        there.send("{\"jsonrpc\":\"2.0\",\"id\":1,\"method\":\"echo\"}\n".repeat(100));
        there.ask(3, "hold", json!({ "request_id": "a" }));
        assert_eq!(next(), told("hold", Some("a")));
        let mut late = Peer::connect(path);
        late.send("{\"jsonrpc\":\"2.0\",\"method\":\"est");
        there.ask(4, "hold", json!({ "request_id": "a" }));
        there.ask(5, "jog.stop", json!({ "request_id": "b" }));
        assert_eq!(
            next(),
            told("jog.stop", Some("b")),
            "the second of an id is passed over"
        );
        late.send("op\"}");
        late.0.get_mut().shutdown(std::net::Shutdown::Write).unwrap();
        assert_eq!(next(), told("estop", None));
        // None of them is served meanwhile, and all of them are in the end.
        drop(goes_on);
        assert_eq!(
            (blocking.line()["id"].clone(), blocking.line()["id"].clone()),
            (json!(1), json!(2))
        );
        let mut ids = (0..103).map(|_| there.line()["id"].clone());
        assert!(ids.by_ref().take(100).all(|id| id == 1));
        assert_eq!(ids.collect::<Vec<_>>(), [json!(3), json!(4), json!(5)]);
        assert!(late.ends());
    });
    assert!(acts.try_recv().is_err());
}

#[test]
fn a_line_that_is_too_long_is_refused_and_passed_over() {
    beside(|path| {
        let mut peer = Peer::connect(path);
        peer.send(vec![b'x'; 3 * LINE_MAX]);
        peer.send("\n{\"jsonrpc\":\"2.0\",\"id\":2,\"method\":\"echo\"}\n");
        let expected = format!("the line is longer than {LINE_MAX} octets");
        assert_eq!(peer.line()["error"]["message"], expected);
        assert_eq!(peer.line()["id"], 2);
    });
}

#[test]
fn answers_that_come_later_find_their_request() {
    beside(|path| {
        let (mut first, mut second) = (Peer::connect(path), Peer::connect(path));
        first.ask(1, "later", json!({"who": "first", "of": 99}));
        first.ask(2, "echo", json!({}));
        // What waits holds nobody up.
        assert_eq!(first.line()["id"], 2);
        second.ask(1, "later", json!({"who": "second", "of": 2}));
        assert_eq!(second.line()["result"]["who"], "second");
        second.ask(5, "later", json!({"who": "again", "of": 2}));
        assert_eq!(second.line()["result"]["who"], "again");
        second.ask(6, "later", json!({"who": "third", "of": 1}));
        assert_eq!(second.line()["id"], 6);
    });
}

#[test]
fn a_client_that_does_not_read_holds_nobody_up() {
    beside(|path| {
        let mut deaf = Peer::connect(path);
        deaf.0
            .get_mut()
            .set_write_timeout(Some(Duration::from_millis(300)))
            .unwrap();
        let text = "t".repeat(LINE_MAX / 2);
        let line = format!(
            "{}\n",
            json!({"jsonrpc": "2.0", "id": 1, "method": "echo", "params": {"text": text}})
        );
        // Until the server reads no more: its memory for one client is bounded, far below what is sent.
        let mut sent = 0;
        while sent < 1000 && deaf.0.get_mut().write_all(line.as_bytes()).is_ok() {
            sent += 1;
        }
        assert!(sent < 1000, "{sent} lines were taken from a client that reads nothing");
        let mut other = Peer::connect(path);
        for id in 0..50 {
            other.ask(id, "echo", json!({}));
            assert_eq!(other.line()["id"], id);
        }
        // Once it reads, it gets everything that was sent whole.
        for _ in 0..sent {
            assert_eq!(deaf.line()["result"]["text"].as_str().map(str::len), Some(text.len()));
        }
    });
}

#[test]
fn idle_clients_keep_nobody_out_and_the_longest_silent_one_is_told_why_it_goes() {
    beside(|path| {
        let mut peers: Vec<Peer> = (0..CLIENTS_MAX).map(|_| Peer::connect(path)).collect();
        for id in [1, 2] {
            for peer in &mut peers {
                peer.ask(id, "echo", json!({}));
                assert_eq!(peer.line()["id"], id);
            }
        }
        // The first one says something; the second one waits for an answer.
        peers[0].ask(3, "echo", json!({}));
        assert_eq!(peers[0].line()["id"], 3);
        peers[1].ask(4, "later", json!({"of": 2}));
        let mut one_more = Peer::connect(path);
        one_more.ask(5, "echo", json!({}));
        assert_eq!(one_more.line()["id"], 5);
        let expected = "16 others are connected, and this one was silent for the longest time";
        assert_eq!(peers[2].line()["error"]["message"], expected);
        assert!(peers[2].ends());
        // However many come, each is served, and the one that waits stays.
        let mut many: Vec<Peer> = (0..100).map(|_| Peer::connect(path)).collect();
        let last = many.last_mut().unwrap();
        last.ask(6, "later", json!({"of": 2}));
        assert_eq!(last.line()["id"], 6);
        peers[1].ask(7, "echo", json!({}));
        assert_eq!(peers[1].line()["id"], 7);
    });
}

#[test]
fn where_all_wait_for_an_answer_the_longest_silent_one_goes_and_is_forsaken() {
    let mut echo = Echo::default();
    let mut ticket = 100;
    let mut clients = Vec::new();
    let far: Vec<UnixStream> = (0..CLIENTS_MAX as u64)
        .map(|heard| {
            let (near, far) = UnixStream::pair().unwrap();
            clients.push(Client::new(Arc::new(Connection::new(near, None)), heard));
            clients.last_mut().unwrap().pending.push((heard, Some(json!(1))));
            far
        })
        .collect();
    let (near, _far) = UnixStream::pair().unwrap();
    let (arrive, inside) = channel();
    let connection = Arc::new(Connection::new(near, None));
    arrive
        .send(Ok(Arrival {
            connection,
            guest: None,
        }))
        .unwrap();
    let_in(&Arrivals(inside), &mut clients, &mut echo, &mut ticket);
    assert_eq!((clients.len(), echo.forsaken.as_slice()), (CLIENTS_MAX, &[0][..]));
    assert_eq!(clients.iter().filter(|client| client.heard == 101).count(), 1);
    drop(far);
}

#[test]
fn a_client_that_has_gone_while_its_request_waits_ends_no_wait() {
    let (_door, intake, _arrivals) = entrance(None);
    let (here, there) = UnixStream::pair().unwrap();
    here.set_nonblocking(true).unwrap();
    let mut client = Client::new(Arc::new(Connection::new(here, None)), 0);
    let mut talkers = [Talker::new(Arc::clone(&client.connection))];
    drop(there);
    assert_eq!(intake.ready(None, &talkers), [0], "that it has gone");
    talkers[0].read();
    client.pending.push((1, None));
    assert!(client.connection.heard().ended && !client.is_over());
    assert_eq!(intake.ready(None, &talkers), [0_usize; 0]);
    client.answer_later(1, &Ok(Value::Null));
    assert!(client.is_over());
}

/// It is told again when it reads: then of how everything is, not of all that was.
#[test]
fn a_subscriber_that_does_not_read_costs_a_bounded_memory_and_hears_the_latest() {
    let (here, there) = UnixStream::pair().unwrap();
    here.set_nonblocking(true).unwrap();
    let mut client = Client::new(Arc::new(Connection::new(here, None)), 1);
    let mut echo = Echo::default();
    (client.connection.heard().octets).extend_from_slice(b"{\"jsonrpc\":\"2.0\",\"id\":1,\"method\":\"subscribe\"}\n");
    client.serve_lines(&mut echo, &mut 1);
    client.write();
    let mut told = 0;
    for _ in 0..10_000 {
        let state = echo.state();
        if client.is_listening() {
            client.tell(&state);
            told += 1;
        }
    }
    // A state is about 60 octets here, without what does not change.
    assert!((2..1000).contains(&told), "{told}");
    assert!(client.output.len() < 2000, "{}", client.output.len());
    assert!(!client.is_listening());
    let mut peer = Peer(BufReader::new(there));
    assert_eq!(peer.line()["result"]["state"]["looks"], 1);
    for looks in 2..=told {
        assert_eq!(peer.line()["params"]["changed"], json!({ "looks": looks }));
        client.write();
    }
    // The last one lay here.
    client.write();
    assert_eq!(peer.line()["params"]["changed"], json!({ "looks": told + 1 }));
    assert!(client.is_listening());
    client.tell(&echo.state());
    assert_eq!(peer.line()["params"]["changed"], json!({ "looks": 10_002 }));
}

#[test]
fn whoever_reads_what_it_has_subscribed_to_or_has_control_is_not_the_silent_one_that_goes() {
    beside(|path| {
        let (mut subscriber, mut kept) = (Peer::connect(path), Peer::connect(path));
        kept.ask(1, "keep", json!({}));
        assert_eq!(kept.line()["id"], 1);
        subscriber.ask(1, "subscribe", json!({}));
        assert_eq!(subscriber.line()["id"], 1);
        let mut many: Vec<Peer> = (0..100).map(|_| Peer::connect(path)).collect();
        let last = many.last_mut().unwrap();
        last.ask(6, "echo", json!({}));
        assert_eq!(last.line()["id"], 6);
        // It has heard of each that went.
        let gone = loop {
            let message = subscriber.line();
            if let Some(left) = message["params"]["changed"]["client_left"].as_array()
                && left.len() == 100 + 2 - CLIENTS_MAX
            {
                break left.clone();
            }
        };
        assert!(!gone.contains(&json!(1)) && !gone.contains(&json!(2)), "{gone:?}");
        kept.ask(2, "echo", json!({}));
        assert_eq!(kept.line()["id"], 2);
    });
}
