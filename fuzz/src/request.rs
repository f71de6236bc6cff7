//! Any line as a request to the control socket: every method with any parameters answers, or an order goes out, and nothing else.

use isocnc::api::methods::Methods;
use isocnc::api::network_view::NetworkView;
use isocnc::api::orders::order_channel;
use isocnc::api::rpc;
use isocnc::api::server::{Caller, Serve};
use isocnc::bus::NodeIndex;
use isocnc::bus::service::{Diagnose, Mailbox, MailboxFull, MailboxReply, MailboxRequest, NetworkLive, NodeLive};
use isocnc::config::{self, Config};
use isocnc::protocol::Role;
use isocnc::rt::shared::RtStatus;
use std::path::Path;
use std::sync::{Arc, OnceLock};

/// A bus that takes no request.
struct Deaf;

impl Mailbox for Deaf {
    fn request(&mut self, _: MailboxRequest) -> Result<(), MailboxFull> {
        Err(MailboxFull)
    }

    fn reply(&mut self) -> Option<MailboxReply> {
        None
    }
}

impl Diagnose for Deaf {
    fn network(&mut self, _: u64) -> Option<NetworkLive> {
        None
    }

    fn node(&mut self, _: NodeIndex, _: u64) -> Option<NodeLive> {
        None
    }
}

fn machine() -> &'static Config {
    static MACHINE: OnceLock<Config> = OnceLock::new();
    MACHINE.get_or_init(|| {
        let text = include_str!("../../configs/mill3-demo.toml");
        config::parse(text, Path::new("mill3-demo.toml")).expect("a machine that ships")
    })
}

/// One run of the fuzzer: a line of octets a request, each of them of one client or of another.
pub fn run(octets: &[u8]) {
    let (client, mut inbox) = order_channel();
    let network = NetworkView::from_config(machine());
    let mut methods = Methods::new(network, Arc::new(RtStatus::default()), Box::new(Deaf), client, || 0);
    let mut callers = [1, 2].map(|client| Caller {
        client,
        process: 0,
        role: Role::SetUp,
        name: None,
        subscription: None,
    });
    for (number, line) in octets.split(|octet| *octet == b'\n').enumerate() {
        let ticket = number as u64;
        match rpc::parse(line) {
            Err(error) => assert!(!error.1.message.text.is_empty()),
            Ok(request) => {
                let answer = methods.call(&mut callers[number % 2], &request, ticket);
                if let Some(Err(error)) = &answer {
                    assert!(!error.message.text.is_empty() && error.code < 0, "{error:?}");
                }
            }
        }
        while methods.later().is_some() {}
        methods.gone(ticket);
        while let Some((of, _)) = inbox.take() {
            // Notes have none.
            assert!(of == ticket || of == 0, "{of} {ticket}");
        }
    }
    callers.iter().for_each(|caller| methods.left(caller.client));
}
