use crate::Interpreter;
use crate::Settings;
use crate::printed::printed;
use motion::canon::Call;

#[test]
fn synchronised_moves_are_told_as_linuxcnc_tells_them() {
    assert_eq!(
        printed("S100 M3 G0 X1 Z5\nG33 X2 Z-10 K1.5\nG33.1 Z-12 K1.25 I2\nG0 X0\nM2\n"),
        "SET_SPINDLE_SPEED(0, 100.0000)\nSTART_SPINDLE_CLOCKWISE(0)\n\
         STRAIGHT_TRAVERSE(1.0000, 0.0000, 5.0000, 0.0000, 0.0000, 0.0000)\n\
         START_SPEED_FEED_SYNC(1.500000,0)\n\
         STRAIGHT_FEED(2.0000, 0.0000, -10.0000, 0.0000, 0.0000, 0.0000)\nSTOP_SPEED_FEED_SYNCH()\n\
         START_SPEED_FEED_SYNC(1.250000,0)\nRIGID_TAP(2.0000, 0.0000, -12.0000)\nSTOP_SPEED_FEED_SYNCH()\n\
         STRAIGHT_TRAVERSE(0.0000, 0.0000, -10.0000, 0.0000, 0.0000, 0.0000)\n"
    );
}

#[test]
fn a_thread_with_both_tapers_is_told_as_linuxcnc_tells_it() {
    // One cut and the last one, an internal thread upwards.
    let moves = "STRAIGHT_TRAVERSE(9.9000, 0.0000, 5.0529, 0.0000, 0.0000, 0.0000)\nDISABLE_FEED_OVERRIDE()\n\
                 START_SPEED_FEED_SYNC(1.019804,0)\nSTRAIGHT_FEED(10.9000, 0.0000, 5.0529, 0.0000, 0.0000, 0.0000)\n\
                 STRAIGHT_FEED(11.3000, 0.0000, 7.0529, 0.0000, 0.0000, 0.0000)\nSTART_SPEED_FEED_SYNC(1.000000,0)\n\
                 STRAIGHT_FEED(11.3000, 0.0000, 12.9824, 0.0000, 0.0000, 0.0000)\nSTART_SPEED_FEED_SYNC(1.019804,0)\n\
                 STRAIGHT_FEED(10.9000, 0.0000, 14.9824, 0.0000, 0.0000, 0.0000)\nSTOP_SPEED_FEED_SYNCH()\n\
                 STRAIGHT_TRAVERSE(9.9000, 0.0000, 14.9824, 0.0000, 0.0000, 0.0000)\nENABLE_FEED_OVERRIDE()\n\
                 STRAIGHT_TRAVERSE(10.0000, 0.0000, 5.0705, 0.0000, 0.0000, 0.0000)\nDISABLE_FEED_OVERRIDE()\n\
                 START_SPEED_FEED_SYNC(1.019804,0)\nSTRAIGHT_FEED(11.0000, 0.0000, 5.0705, 0.0000, 0.0000, 0.0000)\n\
                 STRAIGHT_FEED(11.4000, 0.0000, 7.0705, 0.0000, 0.0000, 0.0000)\nSTART_SPEED_FEED_SYNC(1.000000,0)\n\
                 STRAIGHT_FEED(11.4000, 0.0000, 13.0000, 0.0000, 0.0000, 0.0000)\nSTART_SPEED_FEED_SYNC(1.019804,0)\n\
                 STRAIGHT_FEED(11.0000, 0.0000, 15.0000, 0.0000, 0.0000, 0.0000)\nSTOP_SPEED_FEED_SYNCH()\n\
                 STRAIGHT_TRAVERSE(10.0000, 0.0000, 15.0000, 0.0000, 0.0000, 0.0000)\nENABLE_FEED_OVERRIDE()\n\
                 STRAIGHT_TRAVERSE(10.0000, 0.0000, 15.0000, 0.0000, 0.0000, 0.0000)\n";
    let all = printed("G18 M3 G0 X10 Z5\nG76 P1 Z15 I1 J0.3 K0.4 Q10 E2 L3\nM2\n");
    assert!(all.ends_with(moves), "{all}");
}

/// How many cuts a thread takes.
fn cuts(words: &str) -> usize {
    let program = format!("G18 M3 S1 G0 X10 Z5\nG76 P1 Z-10 I-1 {words}\nM2\n");
    let events = Interpreter::new(Settings::default()).run(program.as_bytes());
    let stops = events.filter(|event| event.as_ref().unwrap().call == Call::StopSpindleSync);
    stops.count()
}

#[test]
fn the_number_of_cuts_is_that_of_linuxcnc() {
    // All counted with LinuxCNC; rounding errors decide on the last three.
    let counted = [
        ("J.1 K.7", 7),
        ("J.1 K.70001", 8),
        ("J.2 K.6 R2", 9),
        ("J.2 K.60001 R2", 10),
        ("J.1 K.9 R0", 9),
        ("J.1 K.9 R1.5", 27),
        ("J.2 K.6 H2", 5),
        ("J.3 K.9", 3),
        ("J.6 K1.8", 3),
        ("J.7 K2.1", 4),
    ];
    for (words, count) in counted {
        assert_eq!(cuts(words), count, "{words}");
    }
}

#[test]
fn refusals_tell_the_rule() {
    let refused = |line: &str, message: &str| {
        let text = printed(&format!("F100 M3 G18 G0 X10 Z5\n{line}\nM2\n"));
        assert_eq!(text.lines().last(), Some(format!("2:{message}").as_str()), "{line}");
    };
    refused("G33 K1", "1: G33 needs at least one axis word");
    refused("G33 Z1", "1: G33 needs K, the way per turn of the spindle");
    refused(
        "G33 Z1 K0",
        "8: G33 needs a pitch other than 0: K is the way per turn, and it is 0",
    );
    refused(
        "G33.1 Z1 K1 F5",
        "13: G33.1 goes as fast as the spindle turns, so F has no use on its line",
    );
    refused(
        "M5 G33.1 Z1 K1",
        "4: G33.1 needs spindle 0 to turn: write M3 or M4 and S first",
    );
    refused(
        "M3 G33 Z1 K1 $-1",
        "14: $-1 is no spindle that G33 can go with: one of 0 to 0",
    );
    refused("G76 Z1 P1 I-1 J1", "1: G76 needs K, the full depth of the thread");
    refused(
        "G76 Z1 P1 I-1 J1 K2 A3",
        "21: A cannot turn during G76: move it on a line before",
    );
    refused(
        "G76 Z1 P0 I-1 J1 K2",
        "8: G76 needs a pitch above 0: P is the way per turn, and it is 0",
    );
    refused(
        "G76 Z1 P1 I0 J1 K2",
        "11: I of G76 is the way from the start to the crest of the thread, below 0 for an external one: not 0",
    );
    refused(
        "G76 Z1 P1 I-1 J0 K2",
        "15: J of G76 is the depth of the first cut: above 0, and it is 0",
    );
    refused(
        "G76 Z1 P1 I-1 J2 K2",
        "18: K of G76 is the full depth of the thread: above J 2, the depth of the first cut, and it is 2",
    );
    refused(
        "G76 Z1 P1 I-1 J1 K2 L4",
        "21: L4 of G76 is no taper: 0 none, 1 at the entry, 2 at the exit, 3 at both",
    );
    refused(
        "G76 Z1 P1 I-1 J1 K2 Q90",
        "21: Q90 of G76 is the angle of the compound slide: between -90 and 90 degrees, usually 29, 29.5 or 30",
    );
    refused("G76 Z1 P1 I-1 J1 K2 H-1", "21: H-1 is negative: it must be 0 or more");
    refused(
        "G76 Z1 P1 I-1 J1 K2 R30",
        "1: G76 would go into the work 1073741824 times on this line: at most 20000 are allowed: are J, R and H right?",
    );
}
