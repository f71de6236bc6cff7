//! Booting on good wires.

use super::device::WRITES;
use super::world::{Setup, World};

#[test]
fn a_clean_network_boots_and_runs() {
    let mut world = World::new(&Setup::new(1, 3));
    let cycles = world.run_until_operational(1_000);
    println!("OPERATIONAL after {cycles} cycles");
    world.run(1_000);
    assert!(world.is_operational());
    for index in 0..3 {
        let statistics = world.mn.statistics(index);
        assert_eq!((statistics.pres_lost, statistics.boots, statistics.faults), (0, 1, 0));
        assert_eq!(statistics.objects_written, WRITES);
    }
}
