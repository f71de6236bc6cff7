//! One lost asynchronous frame, whichever it is, makes no boot long.

use powerlink::mn::BootTimes;
use powerlink::wire::{ServiceId, message};

use super::world::{BOOT, Setup, Vanish, World};

/// Most that one lost frame may cost, in ns of virtual time.
const COST_MAX_NS: u64 = 500_000_000;
/// A boot with one loss takes fewer cycles.
const CYCLES_MAX: u64 = 3_000;

/// How the SDO servers of the nodes deal with a client that says again that it takes the connection as open.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Server {
    /// They say again that it is.
    Answers,
    /// They do not, once they have said so, as openPOWERLINK's.
    IsSilent,
}

/// Lets the ASnd of this number (from 0, of the managing node and of all nodes together) get lost.
fn lose(number: u64, server: Server) -> Vanish {
    let mut count = 0;
    // Of each node: it has said that the connection is open.
    let mut open = [false; 256];
    Box::new(move |sender, octets| {
        if octets[14] != message::ASND {
            return false;
        }
        let is_sdo = octets[17] == u8::from(ServiceId::Sdo) && sender != 240;
        // Sequence layer: how sender and receiver take the connection, and the number of this frame.
        let (received, sent) = (octets[18], octets[19]);
        if is_sdo && (received & 3, sent & 3) == (1, 1) {
            open[usize::from(sender)] = false;
        }
        let says_open = is_sdo && (received & 3, sent) == (2, 2);
        let again = says_open && core::mem::replace(&mut open[usize::from(sender)], true);
        if again && server == Server::IsSilent {
            return true;
        }
        count += 1;
        count == number + 1
    })
}

/// Virtual time of a boot, and how many ASnds it took.
fn boot(setup: &Setup, number: u64, server: Server) -> (u64, u64) {
    let mut world = World::new(setup);
    world.vanish = lose(number, server);
    world.run_until_operational(CYCLES_MAX);
    let nodes = 0..world.devices.len();
    let slots = nodes.map(|index| world.mn.statistics(index).slots_granted).sum::<u64>();
    (world.now_ns, world.mn.counters().asnd_sent + slots)
}

fn each_lost_once(name: &str, setup: &Setup) {
    for server in [Server::Answers, Server::IsSilent] {
        let (clean_ns, asnds) = boot(setup, u64::MAX - 1, server);
        let (mut worst_ns, mut worst) = (0, 0);
        for number in 0..asnds {
            let (taken_ns, _) = boot(setup, number, server);
            if taken_ns > worst_ns {
                (worst_ns, worst) = (taken_ns, number);
            }
        }
        let cost_ns = worst_ns.saturating_sub(clean_ns);
        println!(
            "{name}, server {server:?}: {asnds} ASnds, clean {} ms, worst {} ms, without number {worst}",
            clean_ns / 1_000_000,
            worst_ns / 1_000_000
        );
        assert!(asnds > 100, "{asnds} ASnds");
        assert!(
            cost_ns <= COST_MAX_NS,
            "{name}, server {server:?}: ASnd {worst} lost costs {} ms",
            cost_ns / 1_000_000
        );
    }
}

#[test]
fn any_one_lost_asnd_costs_less_than_half_a_second_where_nodes_are_configured_before_the_cycle() {
    each_lost_once("before the cycle", &Setup::new(1, 3));
}

#[test]
fn any_one_lost_asnd_costs_less_than_half_a_second_where_nodes_are_configured_in_the_cycle() {
    for cycle_ns in [1_000_000, 10_000_000] {
        let mut setup = Setup::new(1, 3);
        setup.cycle_ns = cycle_ns;
        setup.boot = BootTimes {
            wait_pre_op_1_us: 0,
            timeout_pre_op_1_us: 0,
            timeout_pre_op_2_us: 5_000_000,
            timeout_ready_to_operate_us: 2_000_000,
            ..BOOT
        };
        each_lost_once(&format!("in cycles of {} ms", cycle_ns / 1_000_000), &setup);
    }
}
