//! Counters, encoders and hand wheels.

use crate::rig::{Rig, T, table};

#[test]
fn counting() {
    table(
        "updown",
        &[],
        T,
        "countup   1 0 1 0 1 0 1 0 0 0\n countdown 0 0 0 0 0 0 0 0 1 0\n max 2\n wrap 1\n reset 0 0 0 0 0 0 0 0 0 1
         > count 0 0 1 1 2 2 0 0 2 0",
    );
    table("updown", &[], T, "countdown 0 1 0 1\n clamp 1 1 1 0\n > count 0 0 0 -1");
    table(
        "counter",
        &[],
        0.5,
        "phase-a 0 1 0 1 0 1 0\n phase-z 0 0 0 1 0 0 0\n index-enable 1 1 1 1 1 0 0\n position-scale 2
         > rawcounts 0 1 1 2 2 3 3\n > counts 0 1 1 0 0 1 1\n > position 0 0.5 0.5 0 0 0.5 0.5\n > indexed 0 0 0 1 1 0 0
         > velocity 0 1 0 1 0 1 0",
    );
    // A reset clears all counts, an index those behind it; it counts from the call behind that which asks for it.
    table(
        "counter",
        &[],
        0.5,
        "phase-a 0 1 0 1 0 1 0\n phase-z 0 0 1 0 0 0 1\n index-enable 0 0 1 1 1 1 1\n reset 0 0 0 0 1 0 0
         > rawcounts 0 1 1 2 0 1 1\n > counts 0 1 1 2 0 1 0\n > indexed 0 0 0 0 0 0 1\n > velocity 0 2 0 2 0 2 0",
    );
    table(
        "encoder",
        &[],
        T,
        "phase-a 0 1 1 0 0 1 0 0\n phase-b 0 0 1 1 0 0 0 1\n > counts 0 1 2 3 4 5 4 3\n > rawcounts 0 1 2 3 4 5 4 3",
    );
    table(
        "encoder",
        &[],
        T,
        "phase-a 0 1 1 0 0\n phase-b 0 0 1 1 0\n x4-mode 0\n > counts 0 1 1 1 1",
    );
    // Whatever phases it finds at the start.
    table(
        "encoder",
        &[],
        T,
        "phase-a 1 0 0 1 1 0\n phase-b 1 1 0 0 0 0\n x4-mode 0\n > counts 0 0 0 1 1 0",
    );
    // Two of six teeth are missing: they count, and the tooth behind them is the index.
    table(
        "encoder",
        &[],
        T,
        "phase-a 0 1 0 1 0 1 0 1 0 0 0 0 0 1 0 1 0 1\n counter-mode 1\n missing-teeth 2\n position-scale 6\n index-enable 1
         > rawcounts 0 1 1 2 2 3 3 4 4 4 4 4 4 7 7 8 8 9\n > counts 0 1 1 2 2 3 3 4 4 4 4 4 4 0 0 1 1 2
         > indexed 0 0 0 0 0 0 0 0 0 0 0 0 0 1 1 1 1 1",
    );
    table("encoder", &[], T, "phase-a 0 1 0 1\n counter-mode 1\n > counts 0 1 1 2");
    table(
        "encoder",
        &[],
        T,
        "phase-a 0 1 1 0 0\n phase-b 0 0 1 1 0\n latch-input 0 0 1 1 0\n latch-falling 0\n reset 0 0 0 0 1\n > counts-latched 0 0 2 2 -2
         position-scale 4\n > position-latched 0 0 0.5 0.5 -0.5\n > velocity 0 0 0 250 0\n > velocity-rpm 0 0 0 15000 0",
    );
    table(
        "knob2float",
        &[],
        T,
        "counts 50 52 60 0 1\n enable 1 1 1 1 0\n scale 0.1\n > out 0 0.2 1 0 0",
    );
    table(
        "hand_wheel",
        &[],
        T,
        "counts 5 6 7 8 9\n enable 1\n axis 1 1 2 2 -1\n step 0 0 0 0 3
         > jog-counts 5 6 7 8 9\n > jog-enable-1 0 1 0 0 0\n > jog-enable-2 0 0 0 1 0\n > jog-scale 0.001 0.001 0.001 0.001 1",
    );
}

#[test]
fn an_encoder_that_stops_is_slow_and_then_at_rest() {
    let mut rig = Rig::new("encoder", &[]);
    rig.set("counter-mode", true);
    for call in 0..40 {
        rig.set("phase-a", call < 20 && call % 4 == 3);
        rig.update(T);
    }
    // The last edge was 20 calls before this one: 1 count in 21 ms at the most, by its end.
    assert!((rig.number("velocity") - 1.0 / 0.021).abs() < 1e-6);
    assert!(rig.number("position-interpolated") <= rig.number("position") + 1.0);
    for _ in 0..1000 {
        rig.update(T);
    }
    assert_eq!(rig.number("velocity"), 0.0);
}

#[test]
fn an_encoder_below_the_least_speed_shows_none_at_all() {
    // A count each 11 calls of 100 ms: 0.91 a second.
    let mut rig = Rig::new("encoder", &[]);
    rig.set("counter-mode", true);
    for call in 0..200 {
        rig.set("phase-a", call % 11 == 0);
        rig.update(0.1);
        assert_eq!(rig.number("velocity"), 0.0, "call {call}");
        assert_eq!(
            rig.number("position-interpolated"),
            rig.number("position"),
            "call {call}"
        );
    }
    assert_eq!(rig.number("counts"), 18.0);
}

#[test]
fn a_simulated_encoder_turns_as_a_counter_of_its_phases_sees() {
    // A quarter of a count a call, from the second call on; three pulses a turn.
    table(
        "sim_encoder",
        &[],
        0.25,
        "speed 5\n ppr 3\n scale 60\n > rawcounts 0 0 0 0 1 1 1 1 2 2\n > phase-a 1 1 1 1 1 1 1 1 0 0
         > phase-b 0 0 0 0 1 1 1 1 1 1\n > phase-z 1 1 1 1 0 0 0 0 0 0",
    );
    // Backward, and no faster than a count a call.
    table(
        "sim_encoder",
        &[],
        1.0,
        "speed -9\n ppr 1\n > rawcounts 0 -1 -2 -3 -4\n > phase-a 1 0 0 1 1\n > phase-b 0 0 1 1 0\n > phase-z 1 0 0 0 1",
    );
}
