//! Touch probes: probe 1 of the rig is closed from 100 to 199.

use super::*;

/// Moves to each place within a cycle; what 60B9, 60BA and 60BB show then.
fn shown(rig: &mut Rig, function: u16, places: &[i64]) -> (u16, i32, i32) {
    rig.write(0x60B8, 0, function);
    for place in places {
        rig.turn(*place);
        rig.device.cycle(&mut rig.objects, &rig.sensors, true);
    }
    (rig.read(0x60B9, 0), rig.read(0x60BA, 0), rig.read(0x60BB, 0))
}

#[test]
fn an_edge_is_latched_where_it_was_as_60b8_asks() {
    let there_and_back = [90, 150, 210, 150, 90];
    // (60B8, 60B9, rising, falling)
    for (function, expected) in [
        (0x0000, (0x0000, 0, 0)),
        (0x0001, (0x0001, 0, 0)),
        (0x0011, (0x0003, 100, 0)),
        (0x0021, (0x0005, 0, 199)),
        (0x0031, (0x0007, 100, 199)),
        // The last ones, on the way back.
        (0x0033, (0x0007, 199, 100)),
        (0x3100, (0x0100, 0, 0)),
    ] {
        let mut rig = Rig::new(0, (-1000, 1000));
        assert_eq!(shown(&mut rig, function, &there_and_back), expected, "{function:#06x}");
    }
}

#[test]
fn a_probe_is_armed_again_by_its_bit() {
    let mut rig = Rig::new(0, (-1000, 1000));
    assert_eq!(shown(&mut rig, 0x0011, &[150, 210]), (0x0003, 100, 0));
    assert_eq!(shown(&mut rig, 0x0011, &[150]), (0x0003, 100, 0), "the first one only");
    assert_eq!(shown(&mut rig, 0x0010, &[210]).0, 0x0000);
    assert_eq!(shown(&mut rig, 0x0011, &[210]).0, 0x0001);
    assert_eq!(shown(&mut rig, 0x0011, &[150]), (0x0003, 199, 0));
}

#[test]
fn the_zero_mark_is_latched_in_place_of_the_input() {
    let mut rig = Rig::new(0, (-1000, 1000));
    let mark = MARK as i32;
    assert_eq!(shown(&mut rig, 0x0015, &[120]), (0x0001, 0, 0));
    assert_eq!(shown(&mut rig, 0x0015, &[MARK + 10]), (0x0003, mark, 0));
}
