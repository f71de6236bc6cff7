//! SDO of the application through the running managing node.

use obd::AbortCode;

use super::*;
use crate::sdo::ClientError;

const DEVICE_TYPE: SdoCommand = SdoCommand::Read { index: 0x1000, sub: 0 };

/// Runs until the command to this node has ended.
fn result<'a>(net: &mut Net<'a>, node: usize) -> SdoResult<'a> {
    for _ in 0..8000 {
        net.cycle();
        if let Some(result) = net.mn.sdo_result(node) {
            return result;
        }
    }
    panic!("no result; {:?}", net.mn.diagnosis(node));
}

#[test]
fn objects_of_several_nodes_are_read_and_written_at_once() {
    let configuration = configuration();
    let (mut first, mut second) = ([0; 8], [0x78, 0x56, 0x34, 0x12, 0xAA]);
    let nodes = [node_config(1, &configuration), node_config(2, &configuration)];
    let mut net = Net::new(&nodes);
    net.boot();
    net.mn.sdo_request(0, DEVICE_TYPE, &mut first).unwrap();
    let write = SdoCommand::Write {
        index: 0x607A,
        sub: 0,
        octets: 4,
    };
    net.mn.sdo_request(1, write, &mut second).unwrap();
    let read = result(&mut net, 0);
    assert_eq!((read.command, read.result), (DEVICE_TYPE, Ok(4)));
    assert_eq!(*read.buffer, [0x92, 0x01, 0x02, 0, 0, 0, 0, 0]);
    let written = result(&mut net, 1);
    assert_eq!((written.command, written.result), (write, Ok(0)));
    let drive = &net.drives[&2];
    let target = drive.dictionary().read(0x607A, 0).unwrap();
    assert_eq!(target, [0x78, 0x56, 0x34, 0x12]);
    assert_eq!(net.mn.sdo_result(0), None);
    // The buffer serves for the next command.
    net.mn.sdo_request(0, DEVICE_TYPE, read.buffer).unwrap();
    assert_eq!(result(&mut net, 0).result, Ok(4));
    assert!(net.all_operational());
    assert_eq!(net.mn.statistics(0).pres_lost + net.mn.statistics(1).pres_lost, 0);
    check_order(&net.log, 0);
}

#[test]
fn a_refusal_of_the_node_comes_as_its_abort_code() {
    let (mut first, mut second) = ([0; 8], [1; 8]);
    let nodes = [node_config(1, &[])];
    let mut net = Net::new(&nodes);
    net.boot();
    let absent = SdoCommand::Read { index: 0x5555, sub: 0 };
    net.mn.sdo_request(0, absent, &mut first).unwrap();
    let aborted = |code| Err(SdoError::Client(ClientError::Aborted(code)));
    assert_eq!(result(&mut net, 0).result, aborted(AbortCode::NO_OBJECT));
    let constant = SdoCommand::Write {
        index: 0x1018,
        sub: 1,
        octets: 4,
    };
    net.mn.sdo_request(0, constant, &mut second).unwrap();
    assert_eq!(result(&mut net, 0).result, aborted(AbortCode::WRITE_OF_READ_ONLY));
    assert!(net.all_operational());
}

#[test]
fn what_cannot_be_taken_is_refused_with_the_buffer() {
    let configuration = configuration();
    let (mut first, mut second) = ([0; 2], [0; 3]);
    let nodes = [node_config(1, &configuration)];
    let mut net = Net::new(&nodes);
    let refused = net.mn.sdo_request(0, DEVICE_TYPE, &mut first).unwrap_err();
    let why = Reason::NetworkNotRunning {
        state: NmtState::NotActive,
    };
    assert_eq!(refused.error, SdoError::NotConfigured { why });
    // In the running network a write takes two cycles.
    net.boot();
    net.reset_node(0);
    net.until(1000, |net| {
        matches!(
            net.mn.diagnosis(0).unwrap().stage,
            BootStage::Configuring { written: 3, .. }
        )
    });
    let refused = net.mn.sdo_request(0, DEVICE_TYPE, refused.buffer).unwrap_err();
    let stage = BootStage::Configuring {
        written: 3,
        index: 0x1A00,
        sub: 2,
    };
    let why = Reason::Booting { stage };
    assert_eq!(refused.error, SdoError::NotConfigured { why });
    net.boot();
    let refused = net.mn.sdo_request(1, DEVICE_TYPE, refused.buffer).unwrap_err();
    assert_eq!(refused.error, SdoError::NoNode);
    let long = SdoCommand::Write {
        index: 0x607A,
        sub: 0,
        octets: 4,
    };
    let refused = net.mn.sdo_request(0, long, refused.buffer).unwrap_err();
    assert_eq!(refused.error, SdoError::BufferTooShort { need: 4, got: 2 });
    net.mn.sdo_request(0, DEVICE_TYPE, refused.buffer).unwrap();
    let busy = net.mn.sdo_request(0, DEVICE_TYPE, &mut second).unwrap_err();
    assert_eq!((busy.error, busy.buffer.len()), (SdoError::Busy, 3));
    // Two octets are too few for what comes.
    let too_long = ClientError::TooLong { got: 4, most: 2 };
    assert_eq!(result(&mut net, 0).result, Err(SdoError::Client(too_long)));
}

#[test]
fn a_node_that_is_lost_ends_its_command_and_takes_the_next_when_it_is_back() {
    let configuration = configuration();
    let mut buffer = [0; 4];
    let nodes = [node_config(1, &configuration), node_config(2, &configuration)];
    let mut net = Net::new(&nodes);
    net.boot();
    net.dead = std::vec![2];
    net.mn.sdo_request(1, DEVICE_TYPE, &mut buffer).unwrap();
    let lost = result(&mut net, 1);
    assert_eq!(lost.result, Err(SdoError::NodeReset));
    let refused = net.mn.sdo_request(1, DEVICE_TYPE, lost.buffer).unwrap_err();
    assert!(
        matches!(
            refused.error,
            SdoError::NotConfigured {
                why: Reason::GivenUp {
                    fault: Fault::PresLost { .. },
                    ..
                }
            }
        ),
        "{:?}",
        refused.error
    );
    net.drives.insert(2, drive(2, net.now_ns));
    net.dead.clear();
    net.boot();
    net.mn.sdo_request(1, DEVICE_TYPE, refused.buffer).unwrap();
    assert_eq!(result(&mut net, 1).result, Ok(4));
}
