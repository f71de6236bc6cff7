//! A managing node boots a controlled node over a simulated wire that loses one frame in a hundred: `cargo run -p
//! isocnc-powerlink --example two_nodes`. No device and no rights are needed; the time is virtual.

use std::error::Error;

use obd::Dictionary;
use powerlink::cn::objects::{COMMUNICATION_BYTES, COMMUNICATION_ENTRIES, COMMUNICATION_PROFILE};
use powerlink::cn::{Cn, CnConfig};
use powerlink::link::simulated::{Hub, Path};
use powerlink::mn::{Mn, MnConfig, NodeConfig, Step};
use powerlink::nmt::NmtState;
use powerlink::wire::{FRAME_LEN_MAX, NetTime};

/// Ten seconds of 1 ms.
const CYCLES: u64 = 10_000;

fn main() -> Result<(), Box<dyn Error>> {
    let nodes = [NodeConfig {
        id: 1,
        ..NodeConfig::default()
    }];
    let config = MnConfig {
        cycle_ns: 1_000_000,
        nodes: &nodes,
        mac: [2, 0, 0, 0, 0, 240],
        ..MnConfig::default()
    };
    let mut mn = Mn::<1>::new(config)?;
    let device = CnConfig {
        node_id: 1,
        mac: [2, 0, 0, 0, 0, 1],
        device_type: 0,
        vendor_id: 0,
        product_code: 0,
        revision: 0,
        serial: 1,
        device_name: "example",
        host_name: "example",
        pres_max_latency_ns: 20_000,
    };
    let dictionary = Dictionary::new(&[COMMUNICATION_PROFILE])?;
    let mut cn = Cn::<COMMUNICATION_ENTRIES, COMMUNICATION_BYTES>::new(&device, dictionary, 0)?;

    let mut hub = Hub::new(1);
    let lossy = Path {
        loss: 0.01,
        ..Path::default()
    };
    let (mn_station, cn_station) = (hub.attach(lossy.clone()), hub.attach(lossy));
    let (mut frame, mut answer) = ([0; FRAME_LEN_MAX], [0; FRAME_LEN_MAX]);

    for cycle in 0..CYCLES {
        let mut now_ns = cycle * u64::from(config.cycle_ns);
        let end_ns = now_ns + u64::from(config.cycle_ns);
        mn.start_cycle(now_ns, NetTime::default());
        while now_ns < end_ns {
            let until_ns = match mn.poll(now_ns) {
                Step::Send(frame) => {
                    now_ns = hub.send(mn_station, now_ns, frame)?;
                    continue;
                }
                Step::WaitUntil(until_ns) => until_ns.min(end_ns),
                Step::IsochronousDone => continue,
                Step::Idle => end_ns,
            };
            match hub.receive(until_ns, &mut frame) {
                None => now_ns = now_ns.max(until_ns),
                Some(arrival) => {
                    now_ns = now_ns.max(arrival.at_ns);
                    if arrival.to == mn_station {
                        mn.receive(arrival.at_ns, &frame[..arrival.length]);
                    } else if let Some(len) = cn
                        .receive(arrival.at_ns, &frame[..arrival.length], &mut answer)
                        .transmit
                    {
                        hub.send(cn_station, arrival.at_ns + 5_000, &answer[..len])?;
                    }
                }
            }
        }
        cn.poll(end_ns);
        while let Some(event) = mn.pop_event() {
            println!("{cycle:5} ms  {event}");
        }
    }
    println!(
        "{} SoCs, {} PRes, {} of them lost; {} frames did not arrive",
        mn.counters().cycles,
        mn.statistics(0).pres_received,
        mn.statistics(0).pres_lost,
        hub.lost()
    );
    assert_eq!(mn.nmt_state(), NmtState::Operational);
    Ok(())
}
