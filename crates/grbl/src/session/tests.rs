use super::jog::JOG_RESTS;
use super::*;
use crate::status::Axis;

/// A control that runs lines when it is told to, and a sender.
struct Bench {
    session: Session,
    status: Status,
    /// All that was ordered, but for questions of the status.
    ordered: Vec<Order>,
    /// Orders that are not answered yet.
    open: Vec<(u32, Order)>,
}

impl Bench {
    fn new() -> Bench {
        let axis = Axis {
            travel_mm: [0.0, 300.0],
            velocity_mm_min: 9000.0,
            acceleration_mm_s2: 1000.0,
        };
        let machine = Machine {
            axes: [Some(axis); 3],
            rpm_max: 24000.0,
            feed_percent: [10, 120],
            spindle_percent: [50, 120],
        };
        let status = Status {
            is_ready: true,
            position_mm: [100.0, 100.0, 100.0],
            ..Status::default()
        };
        let mut bench = Bench {
            session: Session::new(machine),
            status,
            ordered: Vec::new(),
            open: Vec::new(),
        };
        assert_eq!(bench.told(), "\r\nGrbl 1.1h ['$' for help]\r\n");
        bench
    }

    /// Answers what is answered at once, and gives what the sender is told.
    fn told(&mut self) -> String {
        while let Some((number, order)) = self.session.order() {
            match order {
                Order::Status => {
                    let status = Box::new(self.status.clone());
                    self.session.answered(number, Ok(Answer::Status(status)));
                }
                order => {
                    self.ordered.push(order.clone());
                    self.open.push((number, order));
                }
            }
        }
        String::from_utf8(self.session.output()).unwrap()
    }

    fn send(&mut self, text: &str) -> String {
        self.session.take(text.as_bytes());
        self.told()
    }

    fn octet(&mut self, octet: u8) -> String {
        self.session.take(&[octet]);
        self.told()
    }

    /// Lets the control answer the oldest order that is open.
    fn answer(&mut self, answer: Result<Answer, &str>) -> String {
        let (number, _) = self.open.remove(0);
        self.session.answered(number, answer.map_err(str::to_owned));
        self.told()
    }

    fn state(&mut self, status: Status) -> String {
        self.status = status;
        let told = self.send("?");
        let state = told.split('<').nth(1).and_then(|rest| rest.split('|').next());
        state.unwrap_or(&told).to_owned()
    }

    fn ready(&self) -> Status {
        Status {
            alarm: None,
            is_ready: true,
            activity: Activity::Idle,
            waiting: None,
            ..self.status.clone()
        }
    }

    fn alarm(&self, cause: &str) -> Status {
        Status {
            alarm: Some(cause.into()),
            is_ready: false,
            ..self.ready()
        }
    }

    fn doing(&self, activity: Activity) -> Status {
        Status {
            activity,
            ..self.ready()
        }
    }
}

fn lines(text: &str, wait: bool) -> Order {
    let text = text.to_owned();
    Order::Lines { text, wait }
}

const DEFAULT: &str = "G80G21G90G94G17G40G49G91.1G54\n";

#[test]
fn each_line_has_one_answer_in_its_order() {
    let mut bench = Bench::new();
    assert_eq!(
        bench.send("\n%\n(a comment)\nG64\ng1\n$foo\n"),
        "ok\r\nok\r\nok\r\nerror:20\r\nok\r\nerror:3\r\n"
    );
    assert_eq!(bench.send("G0X1\nG0Y1"), "ok\r\n");
    assert_eq!(bench.send("\n"), "ok\r\n");
    let long = ["X".repeat(300), "\n".into()].concat();
    assert_eq!(bench.send(&long), "error:11\r\n");
}

#[test]
fn lines_go_to_the_control_together_behind_the_modes_that_they_count_on() {
    let mut bench = Bench::new();
    bench.send("G1F100X1\nX2\nX3\n");
    assert_eq!(bench.ordered, [lines(&format!("{DEFAULT}G1F100X1\n"), false)]);
    bench.answer(Ok(Answer::Done));
    assert_eq!(bench.ordered[1], lines("G1X2\nG1X3\n", false));
    bench.answer(Ok(Answer::Done));
    // Nothing is left: when has it all been executed?
    assert_eq!(bench.ordered[2], lines("", true));
    assert_eq!(
        bench.state(bench.ready()),
        "Run",
        "also where the control has not begun yet"
    );
    bench.answer(Ok(Answer::Done));
    assert_eq!(bench.state(bench.ready()), "Idle");
    assert_eq!(bench.ordered.len(), 3);
}

#[test]
fn a_line_behind_the_last_one_keeps_the_job_under_way() {
    let mut bench = Bench::new();
    bench.send("G0X1\n");
    bench.answer(Ok(Answer::Done));
    assert_eq!(bench.ordered[1], lines("", true));
    bench.send("X2\n");
    assert_eq!(bench.ordered[2], lines("G0X2\n", false));
    bench.answer(Ok(Answer::Done));
    assert_eq!(bench.state(bench.ready()), "Run");
    bench.answer(Ok(Answer::Done));
    assert_eq!(bench.ordered[3], lines("", true));
    bench.answer(Ok(Answer::Done));
    assert_eq!(bench.state(bench.ready()), "Idle");
}

#[test]
fn ok_waits_where_there_is_no_room() {
    let mut bench = Bench::new();
    let mut count = 0;
    let line = "G1X100.125Y100.125F1000\n";
    while bench.send(line) == "ok\r\n" {
        count += 1;
        assert!(count < 1000, "it never fills");
    }
    assert!(count >= WAITING_MAX / line.len(), "{count}");
    assert_eq!(bench.send(line), "", "it waits behind the other one");
    assert!(bench.session.has_room());
    assert_eq!(bench.answer(Ok(Answer::Done)), "ok\r\nok\r\n");
}

#[test]
fn dwells_pauses_and_ends_are_answered_when_the_machine_has_come_to_them() {
    for line in ["G4P0.5", "M0", "M2"] {
        let mut bench = Bench::new();
        assert_eq!(bench.send(&format!("G0X1\nX2\n{line}\nG0X3\n")), "ok\r\nok\r\n");
        let text = format!("G0X2\n{}\n", line);
        assert_eq!(bench.ordered[1], lines(&text, true), "{:?}", bench.ordered);
        assert_eq!(bench.state(bench.doing(Activity::Running)), "Run");
        assert_eq!(bench.answer(Ok(Answer::Done)), "", "the lines before are only read");
        assert_eq!(bench.answer(Ok(Answer::Done)), "ok\r\nok\r\n");
        assert!(matches!(&bench.ordered[2], Order::Lines { text, .. } if text.ends_with("X3\n")));
    }
}

#[test]
fn status_is_told_at_any_time() {
    let mut bench = Bench::new();
    bench.send("G4P9\n");
    assert_eq!(
        bench.send("??"),
        "<Run|MPos:100.000,100.000,100.000|Bf:15,128|FS:0,0|WCO:0.000,0.000,0.000>\r\n\
         <Run|MPos:100.000,100.000,100.000|Bf:15,128|FS:0,0|Ov:100,100,100>\r\n"
    );
    assert!(bench.send("G0X1\n?").contains("|Bf:15,123|"));
}

#[test]
fn states_have_the_words_of_grbl() {
    let mut bench = Bench::new();
    let doing = |activity| bench.doing(activity);
    let states = [
        (doing(Activity::Idle), "Idle"),
        (doing(Activity::Running), "Run"),
        (doing(Activity::Held), "Hold:0"),
        (doing(Activity::Stopping), "Hold:1"),
        (doing(Activity::Jogging), "Jog"),
        (doing(Activity::Homing), "Home"),
        (
            Status {
                is_ready: false,
                ..doing(Activity::Idle)
            },
            "Alarm",
        ),
    ];
    for (status, word) in states {
        assert_eq!(bench.state(status), word);
    }
    assert_eq!(bench.state(bench.ready()), "Idle");
    bench.send("$C\n");
    assert_eq!(bench.state(bench.ready()), "Check");
}

#[test]
fn hold_and_resume_are_taken_at_once() {
    let mut bench = Bench::new();
    bench.send("G1F100X1\n");
    bench.state(bench.doing(Activity::Running));
    assert_eq!(bench.send("!"), "");
    assert_eq!(bench.ordered.last(), Some(&Order::Hold));
    assert_eq!(bench.state(bench.doing(Activity::Running)), "Hold:1");
    assert_eq!(bench.state(bench.doing(Activity::Held)), "Hold:0");
    bench.send("~");
    assert_eq!(bench.ordered.last(), Some(&Order::Resume));
    assert_eq!(bench.state(bench.doing(Activity::Running)), "Run");
    bench.octet(0x84);
    assert_eq!(bench.ordered.last(), Some(&Order::Hold));
    assert_eq!(bench.state(bench.doing(Activity::Running)), "Door:2");
    assert_eq!(bench.state(bench.doing(Activity::Held)), "Door:0");
    bench.send("~");
    assert_eq!(bench.state(bench.doing(Activity::Running)), "Run");
}

/// Else a machine would set out that was told to hold a moment before.
#[test]
fn a_hold_before_the_first_line_has_begun_holds_it_when_it_begins() {
    let mut bench = Bench::new();
    bench.send("G1F100X1\n");
    bench.send("?");
    bench.send("!");
    let at = bench.open.iter().position(|(_, order)| *order == Order::Hold).unwrap();
    let (number, _) = bench.open.remove(at);
    bench.session.answered(number, Err("nothing runs".into()));
    assert_eq!(bench.told(), "");
    let holds = |bench: &Bench| bench.ordered.iter().filter(|order| **order == Order::Hold).count();
    bench.state(bench.ready());
    assert_eq!(holds(&bench), 1, "there is nothing to hold");
    assert_eq!(bench.state(bench.doing(Activity::Running)), "Hold:1");
    assert_eq!(holds(&bench), 2);
    bench.state(bench.doing(Activity::Running));
    assert_eq!(holds(&bench), 2, "the second one is not answered yet");
    assert_eq!(bench.state(bench.doing(Activity::Held)), "Hold:0");
    bench.send("~");
    assert_eq!(bench.state(bench.doing(Activity::Running)), "Run");
}

#[test]
fn what_the_machine_waits_for_is_told_once_and_released_by_resume() {
    let mut bench = Bench::new();
    bench.send("M0\n");
    let waiting = Status {
        waiting: Some("the program waits: M0".into()),
        ..bench.doing(Activity::Held)
    };
    bench.status = waiting;
    assert!(bench.send("?").starts_with("[MSG:the program waits: M0]\r\n<Hold:0|"));
    assert!(bench.send("?").starts_with("<Hold:0|"));
    bench.send("~");
    assert_eq!(bench.ordered.last(), Some(&Order::Resume));
}

#[test]
fn overrides_stay_within_what_the_machine_can() {
    let mut bench = Bench::new();
    bench.status.overrides.feed = 95;
    bench.send("?");
    for (octet, order) in [
        (0x91, Order::Feed(105)),
        (0x91, Order::Feed(105)),
        (0x92, Order::Feed(85)),
        (0x93, Order::Feed(96)),
        (0x94, Order::Feed(94)),
        (0x90, Order::Feed(100)),
        (0x96, Order::Rapid(50)),
        (0x97, Order::Rapid(25)),
        (0x95, Order::Rapid(100)),
        (0x9A, Order::Spindle(110)),
        (0x9B, Order::Spindle(90)),
        (0x9C, Order::Spindle(101)),
        (0x9D, Order::Spindle(99)),
        (0x99, Order::Spindle(100)),
    ] {
        bench.send("?");
        bench.octet(octet);
        assert_eq!(bench.ordered.last(), Some(&order));
    }
    for percent in [10, 120] {
        bench.status.overrides.feed = percent;
        bench.send("?");
        bench.octet(if percent == 10 { 0x92 } else { 0x91 });
        assert_eq!(bench.ordered.last(), Some(&Order::Feed(percent)));
    }
    assert!(bench.octet(0x9E).starts_with("[MSG:"));
}

#[test]
fn coolant_is_switched_by_lines_while_nothing_runs() {
    let mut bench = Bench::new();
    bench.send("?");
    bench.octet(0xA0);
    assert_eq!(bench.ordered, [lines(&format!("{DEFAULT}M8\n"), false)]);
    assert!(bench.octet(0xA1).starts_with("[MSG:"));
    let mut bench = Bench::new();
    (bench.status.flood, bench.status.mist) = (true, true);
    bench.send("?");
    bench.octet(0xA1);
    assert_eq!(bench.ordered, [lines(&format!("{DEFAULT}M9M8\n"), false)]);
}

#[test]
fn a_reset_in_motion_stops_and_locks_and_one_at_rest_only_greets() {
    let mut bench = Bench::new();
    let greeting = "\r\nGrbl 1.1h ['$' for help]\r\n";
    assert_eq!(bench.octet(0x18), greeting);
    bench.send("G1F100X1\nG4P5\n");
    bench.state(bench.doing(Activity::Running));
    assert_eq!(
        bench.octet(0x18),
        format!("ALARM:3\r\n{greeting}[MSG:'$H'|'$X' to unlock]\r\n")
    );
    assert_eq!(bench.ordered.last(), Some(&Order::Stop));
    assert_eq!(bench.state(bench.ready()), "Alarm");
    assert_eq!(bench.send("G0X1\n"), "error:9\r\n");
    // Answers to what was ordered before belong to nobody any more.
    bench.open.retain(|(_, order)| matches!(order, Order::Stop));
    bench.answer(Ok(Answer::Done));
    bench.send("$X\n");
    assert_eq!(bench.ordered.last(), Some(&Order::Unlock));
    assert_eq!(bench.answer(Ok(Answer::Done)), "[MSG:Caution: Unlocked]\r\nok\r\n");
    assert_eq!(bench.state(bench.ready()), "Idle");
    assert_eq!(bench.send("G0X1\n"), "ok\r\n");
}

#[test]
fn a_reset_while_homing_has_an_alarm_of_its_own() {
    let mut bench = Bench::new();
    assert_eq!(bench.send("$H\n"), "");
    assert_eq!(bench.ordered, [Order::Home]);
    assert_eq!(bench.state(bench.doing(Activity::Homing)), "Home");
    assert!(bench.octet(0x18).starts_with("ALARM:6\r\n"));
}

#[test]
fn homing_is_answered_when_it_is_over() {
    let mut bench = Bench::new();
    bench.status.is_ready = false;
    bench.send("?");
    assert_eq!(bench.send("G0X1\n"), "error:9\r\n");
    assert_eq!(bench.send("$H\n"), "");
    bench.status.is_ready = true;
    assert_eq!(bench.answer(Ok(Answer::Done)), "ok\r\n");
    bench.send("?");
    assert_eq!(bench.send("G0X1\n"), "ok\r\n");
    let mut bench = Bench::new();
    bench.send("$H\n");
    assert_eq!(bench.answer(Err("no [switch]")), "[MSG:no  switch ]\r\nerror:9\r\n");
}

#[test]
fn an_alarm_of_the_control_is_told_and_locks_until_it_is_acknowledged() {
    let mut bench = Bench::new();
    bench.send("G1F100X1\nX2\n");
    bench.status = bench.alarm("x-drive: limit switch at its upper end");
    bench.session.tick();
    assert_eq!(
        bench.told(),
        "ALARM:1\r\n[MSG:x-drive: limit switch at its upper end]\r\n"
    );
    bench.session.tick();
    assert_eq!(bench.told(), "");
    assert_eq!(bench.send("X3\n$J=G91X1F100\n"), "error:9\r\nerror:8\r\n");
    assert_eq!(bench.state(bench.status.clone()), "Alarm");
    assert_eq!(bench.answer(Err("given up")), "[MSG:given up]\r\n");
    // What was waiting here is not run later.
    assert_eq!(bench.ordered.len(), 2, "{:?}", bench.ordered);
    assert_eq!(bench.ordered[1], lines("", true));
    bench.answer(Ok(Answer::Done));
    assert_eq!(bench.send("$J=G91X1F100\n"), "error:9\r\n");
    bench.send("$X\n");
    bench.status = bench.ready();
    bench.answer(Ok(Answer::Done));
    assert_eq!(bench.state(bench.ready()), "Idle");
}

#[test]
fn an_alarm_that_somebody_else_acknowledges_is_over() {
    let mut bench = Bench::new();
    bench.state(bench.alarm("emergency stop"));
    assert_eq!(bench.state(bench.ready()), "Idle");
}

#[test]
fn lines_that_the_control_refuses_are_told() {
    let mut bench = Bench::new();
    bench.send("G0X1\n");
    assert_eq!(
        bench.answer(Err("another client has control")),
        "[MSG:another client has control]\r\n"
    );
    bench.send("M0\n");
    let last = bench.open.len() - 1;
    let (number, _) = bench.open.remove(last);
    bench.session.answered(number, Err("no".into()));
    assert_eq!(bench.told(), "[MSG:no]\r\nerror:9\r\n");
}

#[test]
fn dollar_lines_answer_and_refuse_as_in_the_sheet() {
    let mut bench = Bench::new();
    bench.send("?");
    assert!(bench.send("$\n").starts_with("[HLP:"));
    let settings = bench.send("$$\n");
    assert!(
        settings.contains("$30=24000\r\n") && settings.ends_with("$132=300.000\r\nok\r\n"),
        "{settings}"
    );
    assert_eq!(
        bench.send("$G\n"),
        "[GC:G0 G54 G17 G21 G90 G94 M5 M9 T0 F0 S0]\r\nok\r\n"
    );
    assert!(bench.send("$I\n").starts_with("[VER:1.1h."));
    assert_eq!(bench.send("$N\n"), "$N0=\r\n$N1=\r\nok\r\n");
    for refused in ["$100=5\n", "$RST=$\n", "$N0=G20\n", "$Z\n"] {
        assert_eq!(bench.send(refused), "error:3\r\n", "{refused}");
    }
    assert_eq!(bench.send("$X\n"), "ok\r\n", "nothing is locked");
    assert_eq!(bench.send("$#\n"), "");
    let told = bench.answer(Ok(Answer::Offsets(Box::default())));
    assert!(
        told.starts_with("[G54:0.000,0.000,0.000]\r\n") && told.ends_with(":0]\r\nok\r\n"),
        "{told}"
    );
    assert_eq!(bench.send("$SLP\n"), "[MSG:Sleeping]\r\n");
    assert_eq!(bench.ordered.last(), Some(&Order::Off));
    assert_eq!(bench.answer(Ok(Answer::Done)), "ok\r\n");
    assert_eq!(bench.state(bench.ready()), "Sleep");
    assert_eq!(bench.send("$H\nG0X1\n"), "error:8\r\nerror:9\r\n");
    bench.octet(0x18);
    assert_eq!(bench.state(bench.ready()), "Idle");
    bench.send("G1F100X1\n");
    assert_eq!(bench.send("$H\n$C\n$SLP\n$X\n"), "error:8\r\n".repeat(4));
}

#[test]
fn modes_are_told_from_here_and_not_asked_for() {
    let mut bench = Bench::new();
    bench.send("G20G91G1F10M3S500T2\n");
    assert_eq!(
        bench.send("$G\n"),
        "[GC:G1 G54 G17 G20 G91 G94 M3 M9 T2 F10 S500]\r\nok\r\n"
    );
    assert!(bench.ordered.iter().all(|order| matches!(order, Order::Lines { .. })));
}

#[test]
fn check_mode_runs_nothing_and_ends_with_a_reset() {
    let mut bench = Bench::new();
    bench.send("?");
    assert_eq!(bench.send("$C\n"), "[MSG:Enabled]\r\nok\r\n");
    assert_eq!(bench.send("G1F100X1\nG4P1\nG64\n"), "ok\r\nok\r\nerror:20\r\n");
    assert_eq!(bench.ordered, []);
    assert_eq!(
        bench.send("$C\n"),
        "[MSG:Disabled]\r\nok\r\n\r\nGrbl 1.1h ['$' for help]\r\n"
    );
    assert_eq!(
        bench.send("$G\n"),
        "[GC:G0 G54 G17 G21 G90 G94 M5 M9 T0 F0 S0]\r\nok\r\n"
    );
}

#[test]
fn jogs_add_up_and_end_within_the_travel() {
    let mut bench = Bench::new();
    bench.send("?");
    assert_eq!(bench.send("$J=G91X30Y40F600\n"), "ok\r\n");
    let jog = |distance_mm, velocity_mm_s| Order::Jog {
        distance_mm,
        velocity_mm_s,
    };
    assert_eq!(bench.ordered, [jog([30.0, 40.0, 0.0], [6.0, 8.0, 0.0])]);
    assert!(bench.session.is_jogging());
    // From where the one before ends: 130, 140.
    assert_eq!(bench.send("$J=G90G53X135F60\n"), "ok\r\n");
    assert_eq!(bench.ordered[1], jog([5.0, 0.0, 0.0], [1.0, 0.0, 0.0]));
    assert_eq!(bench.send("$J=G91X166F60\n"), "error:15\r\n");
    assert_eq!(bench.state(bench.doing(Activity::Jogging)), "Jog");
    bench.octet(0x85);
    assert_eq!(bench.ordered.last(), Some(&Order::StopJog));
    bench.state(bench.ready());
    assert!(!bench.session.is_jogging());
    // One that has come to its end is kept no longer: the control waits for that.
    bench.send("$J=G91X1F60\n");
    let rests = Status {
        feed_mm_min: 0.0,
        ..bench.doing(Activity::Jogging)
    };
    for _ in 1..JOG_RESTS {
        bench.state(rests.clone());
        assert!(bench.session.is_jogging());
    }
    assert_eq!(bench.state(rests), "Jog");
    assert!(!bench.session.is_jogging());
    bench.status.work_offset_mm = [10.0, 0.0, 0.0];
    bench.send("?");
    bench.send("$J=G20X1F100\n");
    assert!(
        matches!(bench.ordered.last(), Some(Order::Jog { distance_mm, .. }) if (distance_mm[0] + 64.6).abs() < 1e-9)
    );
    bench.send("!");
    assert_eq!(bench.ordered.last(), Some(&Order::StopJog));
}

#[test]
fn jogs_are_refused_while_lines_run() {
    let mut bench = Bench::new();
    bench.send("?G0X1\n");
    assert_eq!(bench.send("$J=G91X1F100\n"), "error:8\r\n");
    assert_eq!(bench.send("$J=G91X1\n"), "error:8\r\n");
    let mut bench = Bench::new();
    bench.send("?");
    assert_eq!(bench.send("$J=G91X1\n$J=M3\n"), "error:22\r\nerror:16\r\n");
}

#[test]
fn a_probing_move_tells_where_it_touched_before_its_ok() {
    let mut bench = Bench::new();
    assert_eq!(bench.send("G38.2Z-10F50\n"), "");
    assert!(matches!(&bench.ordered[0], Order::Probe { text } if text.ends_with("G38.2Z-10F50\n")));
    let touched = Answer::Probed {
        place_mm: [1.0, 2.0, -3.0],
        touched: true,
    };
    assert_eq!(bench.answer(Ok(touched)), "[PRB:1.000,2.000,-3.000:1]\r\nok\r\n");
    bench.answer(Ok(Answer::Done));
    bench.send("$#\n");
    assert!(
        bench
            .answer(Ok(Answer::Offsets(Box::default())))
            .contains("[PRB:1.000,2.000,-3.000:1]")
    );
}

#[test]
fn behind_an_end_the_modes_are_those_of_the_beginning() {
    let mut bench = Bench::new();
    bench.send("G91G0X1F10\nM30\n");
    bench.answer(Ok(Answer::Done));
    bench.answer(Ok(Answer::Done));
    bench.send("X1\n");
    assert_eq!(bench.ordered[2], lines(&format!("{DEFAULT}G1X1\n"), false).clone());
}

#[test]
fn a_sender_that_says_nothing_for_days_is_served_as_before() {
    let mut bench = Bench::new();
    // Ten times a second, two days.
    for _ in 0..2 * 86_400 * 10 {
        bench.session.tick();
        assert_eq!(bench.told(), "");
    }
    assert_eq!(
        (bench.session.asked.len(), bench.session.orders.len(), bench.open.len()),
        (0, 0, 0)
    );
    assert!(bench.send("?").starts_with("<Idle|"));
    assert_eq!(bench.send("$G\n").lines().last(), Some("ok"));
}
