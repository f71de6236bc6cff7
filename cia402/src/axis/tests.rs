use super::*;
use proptest::prelude::*;

const MS: u64 = 1_000_000;

/// Statuswords with *voltage enabled* and *remote* set, as real drives send them.
const NOT_READY: u16 = 0x0200;
const SWITCH_ON_DISABLED: u16 = 0x0250;
const READY: u16 = 0x0231;
const SWITCHED_ON: u16 = 0x0233;
const ENABLED: u16 = 0x0237;
const FOLLOWS: u16 = 0x1237;
const QUICK_STOP: u16 = 0x0217;
const FAULT_REACTION: u16 = 0x021F;
const FAULT: u16 = 0x0218;

/// An axis with its clock, fed by hand.
struct Rig {
    axis: Axis,
    now_ns: u64,
    feedback: Feedback,
}

impl Rig {
    fn new(config: AxisConfig) -> Rig {
        let feedback = Feedback {
            position: 1000,
            mode_display: config.mode.code(),
            ..Feedback::default()
        };
        Rig {
            axis: Axis::new(config),
            now_ns: 0,
            feedback,
        }
    }

    /// One cycle of 1 ms with this statusword.
    fn cycle(&mut self, statusword: u16, commanded: i64) -> Setpoint {
        self.now_ns += MS;
        self.feedback.statusword = statusword;
        self.axis.cycle(self.now_ns, true, &self.feedback, commanded)
    }

    fn offline(&mut self) -> Setpoint {
        self.now_ns += MS;
        self.axis.cycle(self.now_ns, false, &self.feedback, 0)
    }

    fn word(&mut self, statusword: u16) -> u16 {
        self.cycle(statusword, 0).controlword
    }

    fn enabled(config: AxisConfig) -> Rig {
        let mut rig = Rig::new(config);
        rig.word(SWITCH_ON_DISABLED);
        rig.axis.request(Request::Enable);
        for word in [SWITCH_ON_DISABLED, READY, SWITCHED_ON, ENABLED] {
            rig.word(word);
        }
        assert_eq!(rig.axis.status(), Status::Enabled);
        rig
    }

    fn repeat(&mut self, cycles: u32, statusword: u16, commanded: i64) {
        for _ in 0..cycles {
            self.cycle(statusword, commanded);
        }
    }
}

#[test]
fn enabling_gives_one_command_per_state_seen() {
    let mut rig = Rig::new(AxisConfig::default());
    assert_eq!(rig.axis.status(), Status::Offline);
    assert_eq!(rig.word(NOT_READY), 0x0000);
    assert_eq!(rig.axis.status(), Status::Disabled);
    assert_eq!(
        rig.word(SWITCH_ON_DISABLED),
        0x0000,
        "nothing happens without a request"
    );
    rig.axis.request(Request::Enable);
    let words = [
        NOT_READY,
        SWITCH_ON_DISABLED,
        SWITCH_ON_DISABLED,
        READY,
        SWITCHED_ON,
        ENABLED,
        FOLLOWS,
    ];
    let commands = words.map(|word| rig.word(word));
    assert_eq!(commands, [0x0000, 0x0006, 0x0006, 0x0007, 0x000F, 0x000F, 0x000F]);
    assert_eq!(rig.axis.status(), Status::Enabled);
}

#[test]
fn interpolated_position_mode_sets_bit_4() {
    let mut rig = Rig::enabled(AxisConfig {
        mode: Mode::Ip,
        ..AxisConfig::default()
    });
    let setpoint = rig.cycle(FOLLOWS, 1000);
    assert_eq!((setpoint.controlword, setpoint.mode), (0x001F, 7));
}

/// What goes to a drive in a mode while motion asks for this target, as (6060, 607A or 60C1:1, 60FF, 6071, 60B1, 60B2).
fn sent(mode: Mode, target: Target) -> (i8, i32, i32, i16, i32, i16) {
    let mut rig = Rig::enabled(AxisConfig {
        mode,
        ..AxisConfig::default()
    });
    rig.now_ns += MS;
    rig.feedback.statusword = FOLLOWS;
    let it = rig.axis.cycle(rig.now_ns, true, &rig.feedback, target);
    assert_eq!(it.controlword & 0x000F, 0x000F);
    (
        it.mode,
        it.target_position,
        it.target_velocity,
        it.target_torque,
        it.velocity_offset,
        it.torque_offset,
    )
}

#[test]
fn each_mode_is_led_by_its_own_object_and_takes_the_rest_as_feed_forward() {
    let target = Target {
        position: 1000,
        velocity: -70_000,
        torque: 250,
    };
    assert_eq!(sent(Mode::Csp, target), (8, 1000, 0, 0, -70_000, 250));
    assert_eq!(sent(Mode::Ip, target), (7, 1000, 0, 0, -70_000, 250));
    assert_eq!(sent(Mode::Csv, target), (9, 1000, -70_000, 0, 0, 250));
    assert_eq!(sent(Mode::Cst, target), (10, 1000, 0, 250, 0, 0));
}

/// Every drive state, in every mode and with every request, while motion goes on asking for speed and torque.
#[test]
fn only_an_enabled_drive_is_told_a_velocity_or_a_torque() {
    let target = Target {
        position: 1000,
        velocity: 5,
        torque: 7,
    };
    let words = [
        NOT_READY,
        SWITCH_ON_DISABLED,
        READY,
        SWITCHED_ON,
        ENABLED,
        QUICK_STOP,
        FAULT_REACTION,
        FAULT,
        0x0001,
    ];
    let requests = [
        None,
        Some(Request::Disable),
        Some(Request::QuickStop),
        Some(Request::CutPower),
        Some(Request::Home),
    ];
    for mode in [Mode::Csp, Mode::Ip, Mode::Csv, Mode::Cst] {
        for word in words {
            for request in requests {
                let mut rig = Rig::enabled(AxisConfig {
                    mode,
                    ..AxisConfig::default()
                });
                // What was told last must not be told again.
                rig.now_ns += MS;
                rig.feedback.statusword = FOLLOWS;
                rig.axis.cycle(rig.now_ns, true, &rig.feedback, target);
                if let Some(request) = request {
                    rig.axis.request(request);
                }
                rig.now_ns += MS;
                rig.feedback.statusword = word;
                let it = rig.axis.cycle(rig.now_ns, true, &rig.feedback, target);
                let told = it.target_velocity != 0 || it.target_torque != 0 || it.velocity_offset != 0;
                let enabled = rig.axis.status() == Status::Enabled;
                assert_eq!(told, enabled, "{mode:?} {word:#06x} {request:?}: {it:?}");
                assert_eq!(
                    enabled,
                    word == ENABLED && request.is_none(),
                    "{mode:?} {word:#06x} {request:?}"
                );
            }
        }
        let mut rig = Rig::enabled(AxisConfig {
            mode,
            ..AxisConfig::default()
        });
        let it = rig.offline();
        assert_eq!((it.target_velocity, it.target_torque, it.velocity_offset), (0, 0, 0));
    }
}

#[test]
fn the_target_copies_the_actual_position_until_the_drive_is_enabled() {
    let mut rig = Rig::new(AxisConfig::default());
    rig.cycle(SWITCH_ON_DISABLED, 0);
    rig.axis.request(Request::Enable);
    for (word, position) in [(SWITCH_ON_DISABLED, -70), (READY, -71), (SWITCHED_ON, -72)] {
        rig.feedback.position = position;
        assert_eq!(rig.cycle(word, 99_999).target_position, position);
    }
    rig.feedback.position = -75;
    assert_eq!(
        rig.cycle(ENABLED, 99_999).target_position,
        -72,
        "the drive holds what it was given"
    );
    assert_eq!((rig.axis.status(), rig.axis.target_position()), (Status::Enabled, -72));
    assert_eq!(rig.cycle(FOLLOWS, -60).target_position, -60);
}

#[test]
fn operation_is_enabled_only_in_the_mode_asked_for() {
    let mut rig = Rig::new(AxisConfig::default());
    rig.word(SWITCH_ON_DISABLED);
    rig.axis.request(Request::Enable);
    rig.feedback.mode_display = 1;
    assert_eq!(
        rig.cycle(SWITCHED_ON, 0),
        Setpoint {
            controlword: 0x0007,
            target_position: 1000,
            mode: 8,
            ..Setpoint::default()
        }
    );
    rig.feedback.mode_display = 8;
    assert_eq!(rig.word(SWITCHED_ON), 0x000F);
    rig.feedback.mode_display = 1;
    rig.axis.request(Request::Disable);
    rig.word(SWITCH_ON_DISABLED);
    rig.axis.request(Request::Enable);
    rig.repeat(1002, SWITCHED_ON, 0);
    assert_eq!(rig.axis.fault(), Some(AxisFault::StepTimeout { step: Step::Mode }));
}

#[test]
fn every_step_has_its_time_limit() {
    for (word, step) in [
        (NOT_READY, Step::SelfTest),
        (SWITCH_ON_DISABLED, Step::Shutdown),
        (READY, Step::SwitchOn),
        (SWITCHED_ON, Step::EnableOperation),
        (QUICK_STOP, Step::LeaveQuickStop),
    ] {
        let mut rig = Rig::new(AxisConfig {
            step_timeout_ns: 10 * MS,
            ..AxisConfig::default()
        });
        rig.word(SWITCH_ON_DISABLED);
        rig.axis.request(Request::Enable);
        rig.repeat(11, word, 0);
        assert_eq!(rig.axis.status(), Status::Enabling, "{step}");
        rig.word(word);
        assert_eq!(rig.axis.fault(), Some(AxisFault::StepTimeout { step }));
    }
}

#[test]
fn a_drive_that_steps_to_and_fro_is_given_up() {
    let mut rig = Rig::new(AxisConfig {
        step_timeout_ns: 10 * MS,
        ..AxisConfig::default()
    });
    rig.word(SWITCH_ON_DISABLED);
    rig.axis.request(Request::Enable);
    for _ in 0..41 {
        rig.word(SWITCH_ON_DISABLED);
        rig.word(READY);
    }
    // 80 ms have passed in the 82nd cycle, where the drive shows READY TO SWITCH ON.
    assert_eq!(rig.axis.fault(), Some(AxisFault::StepTimeout { step: Step::SwitchOn }));
}

#[test]
fn local_control_is_named() {
    let mut rig = Rig::new(AxisConfig::default());
    rig.word(0x0050);
    rig.axis.request(Request::Enable);
    rig.repeat(1002, 0x0050, 0);
    assert_eq!(rig.axis.fault(), Some(AxisFault::LocalControl { step: Step::Shutdown }));
}

#[test]
fn disabling_goes_down_step_by_step_and_holds_the_target() {
    let mut rig = Rig::enabled(AxisConfig::default());
    rig.cycle(FOLLOWS, 1100);
    rig.axis.request(Request::Disable);
    rig.feedback.position = 1090;
    assert_eq!(
        rig.cycle(FOLLOWS, 5000),
        Setpoint {
            controlword: 0x0007,
            target_position: 1100,
            mode: 8,
            ..Setpoint::default()
        }
    );
    assert_eq!(rig.axis.status(), Status::Disabling);
    assert_eq!(
        [SWITCHED_ON, READY, SWITCH_ON_DISABLED].map(|word| rig.word(word)),
        [0x0006, 0x0000, 0x0000]
    );
    assert_eq!(rig.axis.status(), Status::Disabled);
    rig.repeat(3000, SWITCH_ON_DISABLED, 0);
    assert_eq!(rig.axis.status(), Status::Disabled);
}

#[test]
fn quick_stop_ends_disabled_also_where_the_drive_holds() {
    let mut rig = Rig::enabled(AxisConfig {
        step_timeout_ns: 5 * MS,
        ..AxisConfig::default()
    });
    rig.axis.request(Request::QuickStop);
    assert_eq!(rig.word(FOLLOWS), 0x0002);
    for _ in 0..6 {
        assert_eq!(rig.word(QUICK_STOP), 0x0002);
    }
    assert_eq!(
        rig.word(QUICK_STOP),
        0x0000,
        "605A = 5: the drive stays until it is told to go"
    );
    assert_eq!(rig.axis.status(), Status::QuickStopping);
    rig.word(SWITCH_ON_DISABLED);
    assert_eq!(rig.axis.status(), Status::Disabled);
}

#[test]
fn a_powered_drive_that_nobody_enabled_is_brought_down() {
    let mut rig = Rig::new(AxisConfig::default());
    assert_eq!(
        [FOLLOWS, SWITCHED_ON, READY].map(|word| rig.word(word)),
        [0x0007, 0x0006, 0x0000]
    );
    assert_eq!(rig.axis.status(), Status::Disabling);
    rig.word(SWITCH_ON_DISABLED);
    assert_eq!(rig.axis.status(), Status::Disabled);
}

#[test]
fn a_drive_fault_stays_until_it_is_reset_and_enables_nothing() {
    let mut rig = Rig::enabled(AxisConfig::default());
    rig.word(FOLLOWS);
    assert_eq!(rig.word(FAULT_REACTION), 0x0000);
    assert_eq!(rig.axis.fault(), Some(AxisFault::Drive { error_code: 0 }));
    rig.feedback.error_code = 0x8611;
    rig.word(FAULT);
    assert_eq!(
        rig.axis.fault(),
        Some(AxisFault::Drive { error_code: 0x8611 }),
        "the code came a cycle later"
    );
    rig.axis.request(Request::Enable);
    assert_eq!(rig.word(FAULT), 0x0000);
    rig.axis.request(Request::ResetFault);
    let words: [u16; 7] = core::array::from_fn(|_| rig.word(FAULT));
    assert_eq!(words, [0, 0, 0, 0, 0x80, 0x80, 0x80], "bit 7 is shown low, then high");
    assert_eq!(rig.word(SWITCH_ON_DISABLED), 0x0000);
    assert_eq!(rig.axis.status(), Status::Disabled);
    rig.repeat(100, SWITCH_ON_DISABLED, 0);
    assert_eq!(rig.axis.status(), Status::Disabled);
}

#[test]
fn a_reset_that_does_not_help_shows_the_drives_fault_again() {
    let mut rig = Rig::new(AxisConfig {
        step_timeout_ns: 10 * MS,
        ..AxisConfig::default()
    });
    rig.feedback.error_code = 0x3210;
    rig.word(FAULT);
    rig.axis.request(Request::ResetFault);
    rig.repeat(4, FAULT, 0);
    for _ in 0..11 {
        assert_eq!(rig.word(FAULT), 0x0080);
    }
    assert_eq!(rig.word(FAULT), 0x0000, "bit 7 is released for the next try");
    assert_eq!(rig.axis.fault(), Some(AxisFault::Drive { error_code: 0x3210 }));
}

#[test]
fn a_lost_drive_counts_as_not_enabled_at_once_and_needs_a_reset() {
    let mut rig = Rig::enabled(AxisConfig::default());
    assert_eq!(
        rig.offline().controlword,
        0x0002,
        "if it hears us, it stops by its ramp"
    );
    assert_eq!(rig.axis.status(), Status::Faulted(AxisFault::Lost));
    assert_eq!(
        rig.word(FOLLOWS),
        0x0002,
        "back and still enabled: stopped, not resumed"
    );
    rig.word(SWITCH_ON_DISABLED);
    assert_eq!(rig.axis.status(), Status::Faulted(AxisFault::Lost));
    rig.axis.request(Request::ResetFault);
    rig.word(SWITCH_ON_DISABLED);
    assert_eq!(rig.axis.status(), Status::Disabled);
}

#[test]
fn a_disabled_drive_may_come_and_go() {
    let mut rig = Rig::new(AxisConfig::default());
    rig.word(SWITCH_ON_DISABLED);
    assert_eq!(rig.offline().controlword, 0x0000);
    assert_eq!(rig.axis.status(), Status::Offline);
    rig.axis.request(Request::Enable);
    rig.word(SWITCH_ON_DISABLED);
    assert_eq!(
        rig.axis.status(),
        Status::Disabled,
        "a request made while it was away is not kept"
    );
}

#[test]
fn a_fault_can_be_acknowledged_while_the_drive_is_away() {
    let mut rig = Rig::enabled(AxisConfig::default());
    rig.offline();
    rig.axis.request(Request::ResetFault);
    assert_eq!(rig.axis.status(), Status::Offline);
    rig.word(SWITCH_ON_DISABLED);
    assert_eq!(rig.axis.status(), Status::Disabled);
}

#[test]
fn leaving_operation_enabled_is_a_fault() {
    for (word, state) in [
        (SWITCH_ON_DISABLED, State::SwitchOnDisabled),
        (READY, State::ReadyToSwitchOn),
        (SWITCHED_ON, State::SwitchedOn),
        (QUICK_STOP, State::QuickStopActive),
        (NOT_READY, State::NotReadyToSwitchOn),
    ] {
        let mut rig = Rig::enabled(AxisConfig::default());
        rig.word(word);
        assert_eq!(rig.axis.fault(), Some(AxisFault::UnexpectedDisable { state }));
    }
}

#[test]
fn a_pattern_that_is_no_state_is_a_fault() {
    let mut rig = Rig::enabled(AxisConfig::default());
    assert_eq!(rig.word(0x0222), 0x0002);
    assert_eq!(rig.axis.fault(), Some(AxisFault::UnknownState { statusword: 0x0222 }));
}

#[test]
fn a_drive_that_ignores_its_target_faults_after_the_grace_time() {
    let mut rig = Rig::enabled(AxisConfig {
        follow_grace_ns: 5 * MS,
        ..AxisConfig::default()
    });
    rig.repeat(5, ENABLED, 1000);
    rig.word(FOLLOWS);
    rig.repeat(5, ENABLED, 1000);
    assert_eq!(
        rig.axis.status(),
        Status::Enabled,
        "each time it follows starts the grace anew"
    );
    assert_eq!(rig.word(ENABLED), 0x0002);
    assert_eq!(rig.axis.fault(), Some(AxisFault::CommandIgnored { mode_display: 8 }));
}

#[test]
fn homing_makes_the_edge_and_comes_back_at_the_new_position() {
    let mut rig = Rig::enabled(AxisConfig::default());
    rig.cycle(FOLLOWS, 1000);
    rig.axis.request(Request::Home);
    let setpoint = rig.cycle(FOLLOWS, 1000);
    assert_eq!((setpoint.controlword, setpoint.mode), (0x000F, 6));
    assert_eq!(rig.axis.homing(), HomingState::Running);
    rig.feedback.mode_display = 6;
    assert_eq!(
        rig.cycle(0x0637, 0).controlword,
        0x001F,
        "edge of bit 4 once 6061 shows the mode"
    );
    rig.feedback.position = 400;
    assert_eq!(
        rig.cycle(0x0237, 0),
        Setpoint {
            controlword: 0x001F,
            target_position: 400,
            mode: 6,
            ..Setpoint::default()
        }
    );
    assert_eq!(rig.cycle(0x1237, 0).controlword, 0x001F, "attained, still moving");
    rig.feedback.position = -3;
    assert_eq!(
        rig.cycle(0x1637, 0),
        Setpoint {
            controlword: 0x000F,
            target_position: -3,
            mode: 8,
            ..Setpoint::default()
        }
    );
    assert_eq!(rig.axis.status(), Status::Homing, "the mode counts when 6061 shows it");
    rig.feedback.mode_display = 8;
    assert_eq!(rig.cycle(ENABLED, 777).target_position, -3);
    assert_eq!(
        (rig.axis.status(), rig.axis.homing()),
        (Status::Enabled, HomingState::Homed)
    );
    assert_eq!((rig.axis.actual_position(), rig.axis.target_position()), (-3, -3));
    assert_eq!(
        rig.cycle(FOLLOWS, 5),
        Setpoint {
            controlword: 0x000F,
            target_position: 5,
            mode: 8,
            ..Setpoint::default()
        }
    );
    rig.axis.request(Request::QuickStop);
    rig.word(SWITCH_ON_DISABLED);
    assert_eq!(
        rig.axis.homing(),
        HomingState::Homed,
        "a stop does not lose the position"
    );
    rig.offline();
    assert_eq!(rig.axis.homing(), HomingState::NotHomed);
}

#[test]
fn power_is_cut_without_a_ramp_also_in_the_middle_of_one() {
    for first in [None, Some(Request::Disable), Some(Request::QuickStop)] {
        let mut rig = Rig::enabled(AxisConfig::default());
        if let Some(first) = first {
            rig.axis.request(first);
            assert_ne!(rig.word(FOLLOWS), 0x0000);
        }
        rig.axis.request(Request::CutPower);
        assert_eq!(rig.word(FOLLOWS), 0x0000);
        rig.axis.request(Request::QuickStop);
        assert_eq!(rig.word(QUICK_STOP), 0x0000, "nothing softer comes behind it");
        assert_eq!(rig.axis.status(), Status::Disabling);
        rig.word(SWITCH_ON_DISABLED);
        assert_eq!(rig.axis.status(), Status::Disabled);
    }
}

#[test]
fn homing_ends_at_the_drives_own_value_also_after_a_wrap() {
    let mut rig = started(0x0637);
    for position in [i32::MAX, i32::MIN, -4, -3] {
        rig.feedback.position = position;
        rig.word(0x0237);
    }
    assert_eq!(rig.axis.actual_position(), (1 << 32) - 3);
    rig.word(0x1637);
    assert_eq!((rig.axis.actual_position(), rig.axis.target_position()), (-3, -3));
}

/// An enabled axis that has just made the start edge, with what the drive showed before it.
fn started(before: u16) -> Rig {
    let mut rig = Rig::enabled(AxisConfig {
        homing_timeout_ns: 1000 * MS,
        ..AxisConfig::default()
    });
    rig.axis.request(Request::Home);
    rig.feedback.mode_display = 6;
    assert_eq!(rig.word(before), 0x001F);
    rig
}

#[test]
fn an_old_homing_result_is_not_taken_for_the_new_one() {
    let mut rig = started(0x1637);
    rig.repeat(3, 0x1637, 0);
    assert_eq!(rig.axis.status(), Status::Homing);
    assert_eq!(rig.word(0x0237), 0x001F);
    assert_eq!(rig.word(0x1637), 0x000F);
    let mut rig = started(0x1637);
    rig.repeat(100, 0x1637, 0);
    assert_eq!(rig.word(0x1637), 0x000F, "method 37 may never show anything else");
}

#[test]
fn homing_errors_are_named() {
    let mut rig = started(0x0637);
    assert_eq!(rig.word(0x2237), 0x0002);
    assert_eq!(rig.axis.fault(), Some(AxisFault::Homing(HomingFault::Drive)));
    assert_eq!(rig.axis.homing(), HomingState::Failed);

    let mut rig = started(0x0637);
    rig.word(0x0237);
    rig.repeat(21, 0x0637, 0);
    assert_eq!(rig.axis.status(), Status::Homing);
    rig.word(0x0637);
    assert_eq!(rig.axis.fault(), Some(AxisFault::Homing(HomingFault::Stopped)));

    let mut rig = started(0x0637);
    rig.repeat(1001, 0x0237, 0);
    assert_eq!(rig.axis.fault(), Some(AxisFault::Homing(HomingFault::Timeout)));

    let mut rig = started(0x0637);
    rig.word(QUICK_STOP);
    assert_eq!(
        rig.axis.fault(),
        Some(AxisFault::UnexpectedDisable {
            state: State::QuickStopActive
        })
    );
}

#[test]
fn positions_go_on_across_the_wrap_of_32_bits() {
    let mut rig = Rig::new(AxisConfig::default());
    rig.feedback.position = i32::MAX - 1;
    rig.word(SWITCH_ON_DISABLED);
    rig.feedback.position = i32::MIN + 3;
    rig.word(SWITCH_ON_DISABLED);
    assert_eq!(rig.axis.actual_position(), 2_147_483_651);
    let mut rig = Rig::enabled(AxisConfig::default());
    assert_eq!(rig.cycle(FOLLOWS, 2_147_483_651).target_position, i32::MIN + 3);
}

#[test]
fn requests_that_do_not_fit_change_nothing() {
    let mut rig = Rig::new(AxisConfig::default());
    rig.word(SWITCH_ON_DISABLED);
    for request in [
        Request::Disable,
        Request::QuickStop,
        Request::CutPower,
        Request::ResetFault,
        Request::Home,
    ] {
        assert!(!rig.axis.accepts(request));
        rig.axis.request(request);
        assert_eq!(rig.axis.status(), Status::Disabled);
    }
}

#[test]
fn faults_say_what_to_look_at() {
    extern crate std;
    use std::string::ToString;
    assert_eq!(
        AxisFault::Drive { error_code: 0x8611 }.to_string(),
        "drive fault 8611h: following error"
    );
    assert_eq!(
        AxisFault::StepTimeout { step: Step::SwitchOn }.to_string(),
        "the drive did not answer in time: command switch on; is its safety circuit (STO) closed?"
    );
}

/// Whether a drive that hears this controlword takes it for *enable operation*.
fn enables(controlword: u16) -> bool {
    Command::from_controlword(controlword) == Command::EnableOperation
}

#[test]
fn no_statusword_at_all_makes_an_axis_enable_by_itself() {
    for statusword in 0..=u16::MAX {
        let mut rig = Rig::new(AxisConfig::default());
        for word in [SWITCH_ON_DISABLED, statusword, SWITCHED_ON, statusword] {
            assert!(!enables(rig.word(word)), "{statusword:#06x}");
        }
        // And with a request, only where the drive shows one of the two states that the command is for.
        let mut rig = Rig::new(AxisConfig::default());
        rig.word(SWITCH_ON_DISABLED);
        rig.axis.request(Request::Enable);
        let expected = matches!(state(statusword), Some(State::SwitchedOn | State::OperationEnabled));
        assert_eq!(enables(rig.word(statusword)), expected, "{statusword:#06x}");
    }
}

#[derive(Clone, Debug)]
enum Event {
    Word(u16),
    Offline,
    Request(Request),
    Wait,
}

fn event() -> impl Strategy<Value = Event> {
    let usual = prop::sample::select(
        &[
            NOT_READY,
            SWITCH_ON_DISABLED,
            READY,
            SWITCHED_ON,
            ENABLED,
            FOLLOWS,
            QUICK_STOP,
            FAULT_REACTION,
            FAULT,
            0x1637,
        ][..],
    );
    let request = prop::sample::select(
        &[
            Request::Enable,
            Request::Enable,
            Request::Disable,
            Request::QuickStop,
            Request::CutPower,
            Request::ResetFault,
            Request::Home,
        ][..],
    );
    prop_oneof![
        8 => usual.prop_map(Event::Word),
        1 => any::<u16>().prop_map(Event::Word),
        1 => Just(Event::Offline),
        3 => request.prop_map(Event::Request),
        1 => Just(Event::Wait),
    ]
}

proptest! {
    /// Whatever the drive shows: no *enable operation* without a request that came after the last fault, absence or stop.
    #[test]
    fn enable_operation_is_never_commanded_unasked(events in prop::collection::vec(event(), 0..200)) {
        let mut rig = Rig::new(AxisConfig::default());
        let mut asked = false;
        for event in events {
            match event {
                Event::Word(word) => {
                    rig.feedback.mode_display = if rig.axis.homing() == HomingState::Running { 6 } else { 8 };
                    let command = rig.word(word);
                    asked &= !matches!(state(word), None | Some(State::Fault | State::FaultReactionActive));
                    prop_assert!(asked || !enables(command), "{word:#06x} -> {command:#06x}");
                }
                Event::Offline => {
                    asked = false;
                    prop_assert!(!enables(rig.offline().controlword));
                }
                Event::Request(request) => {
                    match request {
                        Request::Enable => asked |= rig.axis.status() == Status::Disabled,
                        Request::Disable | Request::QuickStop | Request::CutPower => asked = false,
                        Request::ResetFault | Request::Home => {}
                    }
                    rig.axis.request(request);
                }
                Event::Wait => rig.now_ns += 1500 * MS,
            }
        }
    }

    /// The target never leaves the actual position before the drive has shown OPERATION ENABLED.
    #[test]
    fn enabling_never_makes_the_target_jump(positions in prop::collection::vec(any::<i32>(), 4..20)) {
        let mut rig = Rig::new(AxisConfig::default());
        rig.word(SWITCH_ON_DISABLED);
        rig.axis.request(Request::Enable);
        for (index, position) in positions.iter().enumerate() {
            rig.feedback.position = *position;
            let word = [SWITCH_ON_DISABLED, READY, SWITCHED_ON, SWITCHED_ON][index.min(3)];
            prop_assert_eq!(rig.cycle(word, 123_456).target_position, *position);
        }
    }
}
