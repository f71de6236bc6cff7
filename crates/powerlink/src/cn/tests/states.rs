//! Every state and everything that can happen in it, against a table written down by hand.
//!
//! The events come as frames and commands, as on the wire; the table is that of the profile, not of the code.

use super::*;
use NmtState::{
    BasicEthernet as Ba, NotActive as Na, Operational as Op, PreOperational1 as P1, PreOperational2 as P2,
    ReadyToOperate as Ro, Stopped as St,
};

/// What happens to a node.
#[derive(Clone, Copy, Debug)]
enum Input {
    Soc,
    Soa,
    Preq,
    PresOfAnother,
    Silence,
    Command(NmtCommand),
    SocLost,
}

const INPUTS: [Input; 14] = [
    Input::Soc,
    Input::Soa,
    Input::Preq,
    Input::PresOfAnother,
    Input::Silence,
    Input::Command(NmtCommand::EnableReadyToOperate),
    Input::Command(NmtCommand::StartNode),
    Input::Command(NmtCommand::StopNode),
    Input::Command(NmtCommand::EnterPreOperational2),
    Input::Command(NmtCommand::ResetConfiguration),
    Input::Command(NmtCommand::ResetCommunication),
    Input::Command(NmtCommand::ResetNode),
    Input::Command(NmtCommand::SwReset),
    Input::SocLost,
];

/// State; the state after each of the inputs, in their order; whether a PReq is answered.
#[rustfmt::skip]
const TABLE: [(NmtState, [NmtState; 14], bool); 7] = [
    //    SoC SoA PReq PRes Sil Enable Start Stop PreOp2 RCfg RCom RNod SwRe  SoC lost
    (Na, [P1, P1, Na,  Na,  Ba, Na,    Na,   Na,  Na,    Na,  Na,  Na,  Na,   Na], false),
    (Ba, [P1, P1, P1,  P1,  Ba, Ba,    Ba,   Ba,  Ba,    Na,  Na,  Na,  Na,   Ba], false),
    (P1, [P2, P1, P1,  P1,  P1, P1,    P1,   P1,  P1,    Na,  Na,  Na,  Na,   P1], false),
    (P2, [P2, P2, P2,  P2,  P2, Ro,    P2,   St,  P2,    Na,  Na,  Na,  Na,   P1], true),
    (Ro, [Ro, Ro, Ro,  Ro,  Ro, Ro,    Op,   St,  Ro,    Na,  Na,  Na,  Na,   P1], true),
    (Op, [Op, Op, Op,  Op,  Op, Op,    Op,   St,  P2,    Na,  Na,  Na,  Na,   P1], true),
    (St, [St, St, St,  St,  St, St,    St,   St,  P2,    Na,  Na,  Na,  Na,   P1], false),
];

/// A configured node in `state`; the watch over the SoC runs where there is a cycle.
fn node_in(state: NmtState) -> Bench {
    let mut bench = Bench::new();
    let cycle = bench.node.dictionary.find(0x1006, 0).unwrap();
    bench
        .node
        .dictionary
        .set_default(cycle, &1000_u32.to_le_bytes())
        .unwrap();
    bench.plain(NmtCommand::ResetConfiguration);
    match state {
        Na => {}
        Ba => {
            bench.now_ns = 5_000_000 * US;
            bench.node.poll(bench.now_ns);
        }
        P1 => {
            bench.soa(RequestedService::NoService, 0);
        }
        P2 | Ro | Op | St => {
            bench.wake();
            bench.soc();
            let commands: &[NmtCommand] = match state {
                Ro => &[NmtCommand::EnableReadyToOperate],
                Op => &[NmtCommand::EnableReadyToOperate, NmtCommand::StartNode],
                St => &[NmtCommand::StopNode],
                _ => &[],
            };
            for command in commands {
                bench.plain(*command);
            }
        }
        other => panic!("{other:?} does not last"),
    }
    assert_eq!(bench.node.nmt_state(), state);
    bench
}

fn apply(bench: &mut Bench, input: Input) {
    match input {
        Input::Soc => drop(bench.soc()),
        Input::Soa => drop(bench.soa(RequestedService::NoService, 0)),
        Input::Preq => drop(bench.poll_with(&[])),
        Input::PresOfAnother => drop(bench.pres_from(NODE + 1, &[], true)),
        // Not by the clock, where a lost SoC would come first.
        Input::Silence => bench.node.event(
            crate::nmt::CnEvent::BasicEthernetTimeout,
            bench.now_ns,
            &mut Events::default(),
        ),
        Input::Command(command) => drop(bench.plain(command)),
        // The threshold is two losses; NOT_ACTIVE is not silent for that long.
        Input::SocLost => {
            bench.now_ns += 3 * 1000 * US;
            bench.node.poll(bench.now_ns);
        }
    }
}

#[test]
fn every_state_and_everything_that_can_happen() {
    for (state, after, _) in TABLE {
        for (input, expected) in INPUTS.into_iter().zip(after) {
            let mut bench = node_in(state);
            apply(&mut bench, input);
            assert_eq!(bench.node.nmt_state(), expected, "{state:?}, {input:?}");
            assert_eq!(bench.node.dictionary().read(0x1F8C, 0).unwrap(), [u8::from(expected)]);
        }
    }
}

#[test]
fn every_state_sends_what_it_may() {
    for (state, after, answers_preq) in TABLE {
        assert_eq!(node_in(state).poll_with(&[]).is_some(), answers_preq, "{state:?}: PReq");
        // The SoA itself wakes a node, so every state answers an invitation; the answer tells the state after it.
        let ident = node_in(state).soa(RequestedService::IdentRequest, NODE).unwrap();
        assert_eq!(ident[20], u8::from(after[1]), "{state:?}");
        for service in [
            RequestedService::NoService,
            RequestedService::NmtRequestInvite,
            RequestedService::UnspecifiedInvite,
        ] {
            assert_eq!(node_in(state).soa(service, NODE), None, "{state:?}: nothing waits");
        }
    }
}

#[test]
fn commands_that_are_for_the_managing_node_or_unknown_change_nothing() {
    for octet in 0..=u8::MAX {
        let command = NmtCommand::from(octet);
        if command.cn_event().is_some() {
            continue;
        }
        for state in [Na, P1, P2, Ro, Op, St] {
            let mut bench = node_in(state);
            bench.plain(command);
            assert_eq!(bench.node.nmt_state(), state, "{command:?}");
        }
    }
}

#[test]
fn every_extended_command_acts_as_its_plain_one_on_listed_nodes_only() {
    for octet in 0x21..=0x2B {
        let (plain, extended) = (NmtCommand::from(octet), NmtCommand::from(octet + 0x20));
        if extended.plain().is_none() {
            continue;
        }
        for state in [P2, Ro, Op, St] {
            let mut expected = node_in(state);
            expected.plain(plain);
            for (listed, destination) in [(true, node::BROADCAST), (true, NODE), (false, node::BROADCAST)] {
                let mut nodes = NodeList::default();
                nodes.insert(if listed { NODE } else { NODE + 8 });
                let mut bench = node_in(state);
                bench.command(destination, NmtCommandFrame::extended(extended, nodes));
                let after = if listed { expected.node.nmt_state() } else { state };
                assert_eq!(bench.node.nmt_state(), after, "{extended:?} in {state:?}");
            }
        }
    }
}
