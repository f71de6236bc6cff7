//! The managing node's SDO server: asked by a diagnostic device, by a node, and by any octets.

use obd::AbortCode;
use proptest::prelude::*;

use super::*;
use crate::sdo::{Client, ClientError, SERVICE_DATA_MAX, Timing};
use crate::wire::{IdentResponse, Requests};

/// Somebody who asks the managing node by SDO.
pub(super) struct Tool {
    id: u8,
    client: Client,
    pub(super) buffer: Vec<u8>,
}

impl Tool {
    pub(super) fn new(id: u8) -> Tool {
        Tool {
            id,
            client: Client::new(Timing::default()),
            buffer: std::vec![0; 2000],
        }
    }

    fn asnd(&self, asnd: &Asnd<'_>) -> Vec<u8> {
        let header = Header {
            destination_node: 240,
            ..Header::multicast(multicast::ASND, [2, 0, 0, 0, 1, self.id], self.id)
        };
        let mut octets = [0; FRAME_LEN_MAX];
        let len = asnd.emit(&header, &mut octets).unwrap();
        octets[..len].to_vec()
    }

    fn next_sdo(&mut self, now_ns: u64) -> Option<Vec<u8>> {
        let mut data = [0; SERVICE_DATA_MAX];
        let len = self.client.poll_transmit(now_ns, &[], &mut data)?;
        Some(self.asnd(&Asnd::Sdo(&data[..len])))
    }

    fn hear_sdo(&mut self, now_ns: u64, sent: &OnWire) {
        if let Frame::Asnd(Asnd::Sdo(data)) = sent.frame()
            && sent.octets[15] == self.id
        {
            self.client.receive(now_ns, data, &mut self.buffer);
        }
    }

    /// A frame of the managing node came; the answer, in the slot.
    pub(super) fn hear(&mut self, now_ns: u64, frame: &[u8]) -> Option<Vec<u8>> {
        match Frame::parse(frame).unwrap() {
            Frame::Asnd(Asnd::Sdo(data)) if frame[15] == self.id => {
                self.client.receive(now_ns, data, &mut self.buffer);
                None
            }
            Frame::Soa(soa) if soa.target == self.id => match soa.service {
                RequestedService::IdentRequest => {
                    let ident = IdentResponse {
                        requests: Requests {
                            priority: 3,
                            count: u8::from(self.client.wants_to_transmit(now_ns)),
                        },
                        ..IdentResponse::default()
                    };
                    Some(self.asnd(&Asnd::IdentResponse(ident)))
                }
                RequestedService::UnspecifiedInvite => self.next_sdo(now_ns),
                _ => panic!("{soa:?}"),
            },
            _ => None,
        }
    }
}

fn with_tool<'a>(nodes: &'a [NodeConfig<'a>]) -> Net<'a> {
    let mut net = Net::with(MnConfig {
        diagnostic_device: true,
        device: DeviceInfo {
            vendor_id: 0x1234_5678,
            ..DeviceInfo::default()
        },
        ..mn_config(nodes)
    });
    net.tool = Some(Tool::new(253));
    net
}

fn ask(net: &mut Net<'_>, index: u16, sub: u8) -> Result<Vec<u8>, ClientError> {
    net.tool.as_mut().unwrap().client.start_read(index, sub).unwrap();
    for _ in 0..3000 {
        net.cycle();
        let tool = net.tool.as_mut().unwrap();
        if let Some(result) = tool.client.result() {
            return result.map(|len| tool.buffer[..len].to_vec());
        }
    }
    panic!("no answer")
}

#[test]
fn a_diagnostic_device_reads_every_object_while_the_network_runs() {
    let configuration = configuration();
    let nodes = [node_config(1, &configuration), node_config(2, &configuration)];
    let mut net = with_tool(&nodes);
    net.boot();
    net.cycles(1000);
    assert_eq!(ask(&mut net, 0x1018, 1), Ok(std::vec![0x78, 0x56, 0x34, 0x12]));
    assert_eq!(ask(&mut net, 0x1F8E, 2), Ok(std::vec![0xFD]));
    assert_eq!(
        ask(&mut net, 0x1F22, 1),
        Ok(configuration.clone()),
        "in one frame or in parts"
    );
    for def in MN_PROFILE {
        let sub = def.sub_first;
        let mut expected = [0; 2000];
        let len = obd::Objects::sdo_read(&mut net.mn.objects(0), def.index, sub, &mut expected).unwrap();
        assert_eq!(
            ask(&mut net, def.index, sub),
            Ok(expected[..len].to_vec()),
            "{:04X}h/{sub}",
            def.index
        );
    }
    let aborted = Err(ClientError::Aborted(AbortCode::NO_OBJECT));
    assert_eq!(ask(&mut net, 0x1002, 0), aborted);
    assert!(net.all_operational());
    assert_eq!(net.mn.statistics(0).pres_lost, 0);
    assert_eq!(net.mn.counters().unknown_node, 0);
    check_order(&net.log, 0);
}

#[test]
fn it_writes_only_what_a_running_network_takes() {
    let nodes = [node_config(1, &[])];
    let mut net = with_tool(&nodes);
    net.boot();
    // The value is empty: too short for any object.
    net.tool.as_mut().unwrap().client.start_write(0x1F81, 1, 0).unwrap();
    let result = net.until(3000, |net| {
        net.tool
            .as_ref()
            .is_some_and(|tool| !tool.client.wants_to_transmit(net.now_ns))
    });
    assert!(result > 0);
    net.cycles(100);
    let result = net.tool.as_mut().unwrap().client.result();
    assert_eq!(result, Some(Err(ClientError::Aborted(AbortCode::TOO_SHORT))));
}

#[test]
fn a_diagnostic_device_that_is_not_there_costs_a_slot_a_second_and_one_that_leaves_is_forgotten() {
    let nodes = [node_config(1, &[])];
    let mut net = with_tool(&nodes);
    net.boot();
    let asked = |net: &Net<'_>| {
        let to_253 = |sent: &&OnWire| matches!(sent.frame(), Frame::Soa(soa) if soa.target == 253);
        net.log.iter().filter(to_253).count()
    };
    net.cycles(1500);
    net.log.clear();
    net.cycles(1000);
    assert_eq!(asked(&net), 50, "every 20 ms while it is there");
    net.tool = None;
    net.cycles(1200);
    net.log.clear();
    let timeouts = net.mn.counters().async_timeouts;
    net.cycles(3000);
    assert_eq!(asked(&net), 3);
    assert_eq!(net.mn.counters().async_timeouts, timeouts, "it need not be there");
    assert!(net.all_operational());
}

#[test]
fn without_leave_a_diagnostic_device_is_a_stranger() {
    let nodes = [node_config(1, &[])];
    let mut net = Net::new(&nodes);
    net.boot();
    let mut tool = Tool::new(253);
    tool.client.start_read(0x1000, 0).unwrap();
    let frame = tool.next_sdo(net.now_ns).unwrap();
    net.mn.receive(net.now_ns, &frame);
    net.cycles(100);
    assert_eq!(net.mn.counters().unknown_node, 1);
    let answers = net
        .log
        .iter()
        .filter(|sent| sent.source == 240 && sent.octets[15] == 253);
    assert_eq!(answers.count(), 0);
}

/// One node is asked by us while another one asks us.
#[test]
fn a_node_asks_while_another_is_asked() {
    let configuration = configuration();
    let mut buffer = [0; 8];
    let mut nodes = [node_config(1, &configuration), node_config(2, &[])];
    nodes[1].assignment.mandatory = false;
    let mut net = Net::with(MnConfig {
        device: DeviceInfo {
            device_type: 0xCAFE,
            ..DeviceInfo::default()
        },
        ..mn_config(&nodes)
    });
    net.dead = std::vec![2];
    net.until(2000, |net| net.mn.node_state(0) == NodeState::Operational);
    let serial = SdoCommand::Read { index: 0x1018, sub: 4 };
    net.mn.sdo_request(0, serial, &mut buffer).unwrap();
    let mut tool = Tool::new(2);
    tool.client.start_read(0x1000, 0).unwrap();
    let mut answer = None;
    for _ in 0..200 {
        if let Some(frame) = tool.next_sdo(net.now_ns) {
            net.mn.receive(net.now_ns, &frame);
        }
        let heard = net.log.len();
        net.cycle();
        for sent in &net.log[heard..] {
            tool.hear_sdo(net.now_ns, sent);
        }
        answer = answer.or(tool.client.result());
    }
    assert_eq!((answer, &tool.buffer[..4]), (Some(Ok(4)), &[0xFE, 0xCA, 0, 0][..]));
    let result = net.mn.sdo_result(0).unwrap();
    assert_eq!((result.result, &result.buffer[..4]), (Ok(4), &[1, 0, 0, 0][..]));
}

/// As recorded: the handshake and the commands of a client, and what its server answers. What both send is left open.
#[test]
fn frames_of_clients_and_of_servers_are_told_apart() {
    use super::super::server::is_for_server;
    let command = |flags| [0x02, 0x06, 0, 0, 0, 1, flags, 2, 4, 0, 0, 0, 0x18, 0x10, 1, 0];
    for (service_data, expected) in [
        (&[0x00, 0x01, 0, 0][..], Some(true)),
        (&[0x01, 0x01, 0, 0], Some(false)),
        (&[0x01, 0x02, 0, 0], Some(true)),
        (&[0x02, 0x02, 0, 0], None),
        (&[0x06, 0x07, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0], None),
        (&[0x00, 0x00, 0, 0], None),
        (&command(0x00), Some(true)),
        (&command(0x40), Some(true)),
        (&command(0x80), Some(false)),
        (&command(0xC0), Some(false)),
        (&[0x02], None),
        (&[], None),
    ] {
        assert_eq!(is_for_server(service_data), expected, "{service_data:02x?}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Any SDO octets from a node or the diagnostic device, at any time: the network goes on, and nothing is lost.
    #[test]
    fn arbitrary_sdo_octets_disturb_nothing(
        frames in prop::collection::vec((prop::bool::ANY, prop::collection::vec(prop::num::u8::ANY, 0..64)), 1..40),
        openings in prop::collection::vec((0_u8..16, 0_u8..16, prop::num::u8::ANY, 0_u8..0x40, 0_u16..0x40), 0..40),
    ) {
        let nodes = [node_config(1, &[]), node_config(2, &[])];
        let mut net = with_tool(&nodes);
        net.tool = None;
        net.boot();
        let send = |net: &mut Net<'_>, stranger: bool, data: &[u8]| {
            let tool = Tool::new(if stranger { 253 } else { 1 });
            let frame = tool.asnd(&Asnd::Sdo(data));
            net.mn.receive(net.now_ns, &frame);
            net.cycle();
        };
        for (stranger, data) in &frames {
            send(&mut net, *stranger, data);
        }
        // Nearly right ones: sequence header, command header, object.
        for (received, sent, flags, command, object) in openings {
            let [low, high] = (0x1F80 + object).to_le_bytes();
            send(&mut net, false, &[received, sent, 0, 0, 0, 1, flags, command, 8, 0, 0, 0, low, high, 1, 0, 1, 2, 3, 4]);
            send(&mut net, true, &[0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]);
        }
        prop_assert!(net.all_operational());
        prop_assert_eq!(net.mn.statistics(0).pres_lost + net.mn.statistics(1).pres_lost, 0);
    }
}
