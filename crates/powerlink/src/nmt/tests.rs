use super::*;

#[test]
fn every_octet_of_state_and_command_survives() {
    for octet in 0..=u8::MAX {
        assert_eq!(u8::from(NmtState::from(octet)), octet);
        assert_eq!(u8::from(NmtCommand::from(octet)), octet);
    }
    let named = (0..=u8::MAX)
        .filter(|octet| !matches!(NmtState::from(*octet), NmtState::Unknown(_)))
        .count();
    assert_eq!(named, NmtState::ALL.len());
}

#[test]
fn octets_as_seen_on_the_wire() {
    // openpowerlink-mn-3cn-10ms.pcap, frames 1 (SoA), 964 (PRes), 12 (NMTCommand ResetNode).
    assert_eq!(NmtState::from(0x1D), NmtState::PreOperational1);
    assert_eq!(NmtState::from(0x5D), NmtState::PreOperational2);
    assert_eq!(NmtCommand::from(0x28), NmtCommand::ResetNode);
}

#[test]
fn extended_commands_carry_their_plain_ones() {
    for octet in 0..=u8::MAX {
        let command = NmtCommand::from(octet);
        match command.plain() {
            Some(plain) => assert_eq!(plain.extended(), Some(command)),
            None => assert!(
                command
                    .extended()
                    .is_none_or(|extended| extended.plain() == Some(command))
            ),
        }
    }
    assert_eq!(NmtCommand::GoToStandby.extended(), None);
    assert_eq!(NmtCommand::StartNodeEx.plain(), Some(NmtCommand::StartNode));
    assert_eq!(NmtCommand::SwResetEx.plain(), Some(NmtCommand::SwReset));
    assert_eq!(NmtCommand::StartNode.plain(), None);
    assert_eq!(NmtCommand::Unknown(0x45).plain(), None);
    let with_event = (0..=u8::MAX)
        .filter(|octet| NmtCommand::from(*octet).cn_event().is_some())
        .count();
    assert_eq!(with_event, 16, "eight plain and eight extended");
}

#[test]
fn node_list_bits() {
    let mut list = NodeList::default();
    list.insert(1);
    list.insert(32);
    list.insert(110);
    assert_eq!((list.0[0], list.0[4], list.0[13]), (0x02, 0x01, 0x40));
    let found = (0..=u8::MAX).filter(|node| list.contains(*node)).count();
    assert_eq!(found, 3);
}

#[test]
fn the_cascade_ends_in_not_active() {
    for (reset, steps) in [
        (Reset::Software, 4),
        (Reset::Node, 3),
        (Reset::Communication, 2),
        (Reset::Configuration, 1),
    ] {
        let mut state = reset.entry();
        for _ in 0..steps {
            state = cascade(state).unwrap();
        }
        assert_eq!(state, NmtState::NotActive);
        assert_eq!(cascade(state), None);
    }
}

/// The table of the standard, written out a second time as data: all pairs not listed change nothing.
#[test]
fn cn_transitions_are_exactly_those_of_the_table() {
    use NmtState::*;
    let mut table = std::vec![
        (NotActive, CnEvent::Soc, PreOperational1),
        (NotActive, CnEvent::Soa, PreOperational1),
        (NotActive, CnEvent::BasicEthernetTimeout, BasicEthernet),
        (BasicEthernet, CnEvent::Soc, PreOperational1),
        (BasicEthernet, CnEvent::Soa, PreOperational1),
        (BasicEthernet, CnEvent::PollFrame, PreOperational1),
        (PreOperational1, CnEvent::Soc, PreOperational2),
        (PreOperational2, CnEvent::ReadyToOperate, ReadyToOperate),
        (ReadyToOperate, CnEvent::StartNode, Operational),
        (PreOperational2, CnEvent::StopNode, Stopped),
        (ReadyToOperate, CnEvent::StopNode, Stopped),
        (Operational, CnEvent::StopNode, Stopped),
        (Operational, CnEvent::EnterPreOperational2, PreOperational2),
        (Stopped, CnEvent::EnterPreOperational2, PreOperational2),
        (PreOperational2, CnEvent::CycleError, PreOperational1),
        (ReadyToOperate, CnEvent::CycleError, PreOperational1),
        (Operational, CnEvent::CycleError, PreOperational1),
        (Stopped, CnEvent::CycleError, PreOperational1),
    ];
    for state in [
        NotActive,
        BasicEthernet,
        PreOperational1,
        PreOperational2,
        ReadyToOperate,
        Operational,
        Stopped,
    ] {
        for reset in Reset::ALL {
            table.push((state, CnEvent::Reset(reset), reset.entry()));
        }
    }
    let states = NmtState::ALL.into_iter().chain([Unknown(0x77)]);
    for state in states {
        for event in CnEvent::ALL {
            let expected = table
                .iter()
                .find(|row| row.0 == state && row.1 == event)
                .map(|row| row.2);
            assert_eq!(cn_next(state, event), expected, "{state:?} on {event:?}");
        }
    }
}

#[test]
fn mn_transitions_are_exactly_those_of_the_table() {
    use NmtState::*;
    let mut table = std::vec![
        (NotActive, MnTrigger::ListenOver, PreOperational1),
        (NotActive, MnTrigger::ListenOverBasicEthernet, BasicEthernet),
        (PreOperational1, MnTrigger::MandatoryIdentified, PreOperational2),
        (PreOperational2, MnTrigger::MandatoryConfigured, ReadyToOperate),
        (ReadyToOperate, MnTrigger::MandatoryReady, Operational),
        (Operational, MnTrigger::MandatoryLost, PreOperational1),
        (PreOperational2, MnTrigger::CycleError, PreOperational1),
        (ReadyToOperate, MnTrigger::CycleError, PreOperational1),
        (Operational, MnTrigger::CycleError, PreOperational1),
    ];
    for state in [
        NotActive,
        BasicEthernet,
        PreOperational1,
        PreOperational2,
        ReadyToOperate,
        Operational,
    ] {
        for reset in Reset::ALL {
            table.push((state, MnTrigger::Reset(reset), reset.entry()));
        }
    }
    for state in NmtState::ALL.into_iter().chain([Unknown(0x77)]) {
        for event in MnTrigger::ALL {
            let expected = table
                .iter()
                .find(|row| row.0 == state && row.1 == event)
                .map(|row| row.2);
            assert_eq!(mn_next(state, event), expected, "{state:?} on {event:?}");
        }
    }
}
