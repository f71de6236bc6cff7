//! Spindle, coolant and buttons of a desk: by orders of clients and by pins, also while a program rests.

use super::clients::Clients;
use super::tests::{MILL, while_one_stands_by};
use crate::memory::Memory;
use crate::rehearsal::Rehearsal;
use crate::table_writer::Keeper;
use api::orders::{Order, OrderClient};
use hal_pins::Value;
use machine::sequence::{Job, Step};
use machine::state::State;
use machine::state_file::Remembered;
use rt::waiting::Waiting;

/// Cycles until something that was ordered has been done.
const SOON: u64 = 60_000;

/// A machine that stands by, its clients and its memory.
struct Desk<'a, 'r, 'scope, 'env> {
    run: &'a mut Rehearsal<'r>,
    clients: Clients<'scope, 'env>,
    client: &'a OrderClient,
    keeper: Keeper<'scope, 'env>,
    ticket: u64,
}

impl Desk<'_, '_, '_, '_> {
    fn new<'a, 'r, 'scope, 'env>(
        run: &'a mut Rehearsal<'r>,
        clients: Clients<'scope, 'env>,
        client: &'a OrderClient,
    ) -> Desk<'a, 'r, 'scope, 'env> {
        let memory = Memory::new(clients.config, Remembered::default());
        let keeper = Keeper::new(clients.scope, clients.tables, memory);
        Desk {
            run,
            clients,
            client,
            keeper,
            ticket: 0,
        }
    }

    /// Runs until this holds.
    fn until(&mut self, what: &str, mut holds: impl FnMut(&mut Rehearsal<'_>) -> bool) {
        for _ in 0..SOON {
            self.turn();
            if holds(self.run) {
                return;
            }
            std::thread::yield_now();
        }
        panic!("never: {what}; it is {:?}", self.run.control.state());
    }

    fn until_state(&mut self, state: State) {
        self.until(&format!("{state:?}"), |run| run.control.state() == state);
    }

    /// One cycle and one turn of the operator's loop.
    fn turn(&mut self) {
        self.run.cycle(0).unwrap();
        let now_ns = self.run.now_ns();
        self.clients
            .serve(&mut self.run.operator, &mut self.keeper, false, now_ns);
    }

    fn turns(&mut self, count: usize) {
        for _ in 0..count {
            self.turn();
        }
    }

    /// The text of the refusal, if it is refused.
    fn order(&mut self, order: Order) -> Result<(), String> {
        self.ticket += 1;
        self.client.put(self.ticket, order).unwrap();
        for _ in 0..SOON {
            self.turn();
            match self.client.answer() {
                Some((ticket, answer)) if ticket == self.ticket => {
                    self.turns(2);
                    return answer.map(drop).map_err(|why| why.message.text.clone());
                }
                _ => std::thread::yield_now(),
            }
        }
        panic!("no answer");
    }

    /// The program of the machine, homed before.
    fn begin(&mut self) {
        let now_ns = self.run.now_ns();
        let home = self.run.operator.homing_order(self.run.operator.not_homed());
        assert!(self.run.operator.begin(now_ns, Job::Program { home, runs: 1 }));
    }

    fn pin<T: Value>(&self, name: &str) -> T {
        self.run.hal.reader::<T>(name).unwrap().get()
    }

    /// Spindle on, its speed, flood, mist.
    fn spindle_and_coolant(&self) -> (bool, f64, bool, bool) {
        (
            self.pin("spindle.0.on"),
            self.pin("spindle.0.speed-out"),
            self.pin("iocontrol.0.coolant-flood"),
            self.pin("iocontrol.0.coolant-mist"),
        )
    }

    fn press(&mut self, pin: &str) {
        self.run.hal.set(pin, true).unwrap();
        self.turn();
        self.run.hal.set(pin, false).unwrap();
        self.turns(3);
    }

    fn journal_has(&self, text: &str) -> bool {
        self.run
            .operator
            .journal()
            .iter()
            .any(|entry| entry.text.contains(text))
    }
}

#[test]
fn a_program_that_goes_on_has_its_own_spindle_and_coolant_again() {
    while_one_stands_by(
        MILL,
        "G21 G90 F600\nM3 S1000 M8\nG1 X20\nM2\n",
        |run, clients, client| {
            let mut desk = Desk::new(run, clients, client);
            desk.begin();
            desk.until("it moves", |run| run.operator.live().velocity_mm_s > 9.0);
            // While it cuts, neither is for a hand.
            let said = desk.order(Order::Spindle(0.0)).unwrap_err();
            assert!(said.contains("a program runs: isocnc hold first"), "{said}");
            assert_eq!(desk.spindle_and_coolant(), (true, 1000.0, true, false));
            desk.order(Order::Hold).unwrap();
            desk.until_state(State::Held);
            desk.order(Order::Spindle(-200.0)).unwrap();
            let coolant = Order::Coolant {
                flood: Some(false),
                mist: Some(true),
            };
            desk.order(coolant).unwrap();
            assert_eq!(desk.spindle_and_coolant(), (true, -200.0, false, true));
            desk.order(Order::Spindle(0.0)).unwrap();
            assert_eq!(desk.spindle_and_coolant(), (false, 0.0, false, true));
            // It does not move before the spindle is at speed.
            let held_at = desk.run.operator.live().position;
            desk.run.hal.set("spindle.0.at-speed", false).unwrap();
            desk.order(Order::Resume).unwrap();
            desk.turns(200);
            assert_eq!(desk.spindle_and_coolant(), (true, 1000.0, true, false));
            assert_eq!(
                (desk.run.control.state(), desk.run.operator.live().position),
                (State::Held, held_at)
            );
            // A hold takes the resume back.
            desk.order(Order::Hold).unwrap();
            desk.run.hal.set("spindle.0.at-speed", true).unwrap();
            desk.turns(200);
            assert_eq!(desk.run.control.state(), State::Held);
            desk.order(Order::Resume).unwrap();
            desk.until_state(State::Running);
            desk.until_state(State::Ready);
            assert_eq!(desk.spindle_and_coolant(), (false, 0.0, false, false));
            let gone_mm = desk.run.operator.live().position.0[0] - held_at.0[0];
            assert!(gone_mm > 15.0, "{gone_mm}");
        },
    );
}

#[test]
fn a_spindle_that_does_not_come_to_speed_again_is_a_fault_and_nothing_moves() {
    while_one_stands_by(MILL, "G21 G90 F600\nM3 S1000\nG1 X20\nM2\n", |run, clients, client| {
        let mut desk = Desk::new(run, clients, client);
        desk.begin();
        desk.until("it moves", |run| run.operator.live().velocity_mm_s > 9.0);
        desk.order(Order::Hold).unwrap();
        desk.until_state(State::Held);
        desk.order(Order::Spindle(0.0)).unwrap();
        let held_at = desk.run.operator.live().position;
        desk.run.hal.set("spindle.0.at-speed", false).unwrap();
        desk.order(Order::Resume).unwrap();
        desk.until_state(State::Faulted);
        assert_eq!(desk.run.operator.live().position, held_at);
        assert!(desk.journal_has("spindle"), "{:?}", desk.run.operator.journal());
    });
}

#[test]
fn at_a_pause_of_the_program_a_hand_has_the_spindle_too() {
    while_one_stands_by(
        MILL,
        "G21 G90 F600\nM4 S500\nM0\nG1 X5\nM2\n",
        |run, clients, client| {
            let mut desk = Desk::new(run, clients, client);
            desk.begin();
            desk.until("M0", |run| run.operator.live().waiting == Some(Waiting::Operator));
            assert!(desk.pin::<bool>("halui.program.is-paused"));
            desk.order(Order::Spindle(0.0)).unwrap();
            assert_eq!(desk.spindle_and_coolant().1, 0.0);
            desk.order(Order::Resume).unwrap();
            desk.until("it moves", |run| run.operator.live().velocity_mm_s > 9.0);
            assert_eq!(desk.spindle_and_coolant(), (true, -500.0, false, false));
            desk.until_state(State::Ready);
            // Of a machine at rest it stays until somebody stops it.
            desk.order(Order::Spindle(300.0)).unwrap();
            desk.turns(100);
            assert_eq!(desk.spindle_and_coolant().1, 300.0);
            desk.order(Order::Stop).unwrap();
            assert_eq!(desk.spindle_and_coolant().1, 0.0);
        },
    );
}

#[test]
fn buttons_of_a_desk_do_what_orders_do_and_lamps_show_it() {
    while_one_stands_by(MILL, "G21 G90 F600\nG1 X20\nM2\n", |run, clients, client| {
        let mut desk = Desk::new(run, clients, client);
        let lamps = |desk: &Desk<'_, '_, '_, '_>| {
            ["is-idle", "is-running", "is-paused"].map(|lamp| desk.pin::<bool>(&format!("halui.program.{lamp}")))
        };
        // Drives are off: nothing turns.
        desk.press("halui.spindle.0.forward");
        assert!(!desk.pin::<bool>("spindle.0.on"));
        desk.press("halui.machine.on");
        desk.until("on", |run| {
            run.control.state() == State::Ready && run.operator.step() == Step::StandBy
        });
        let refused = |desk: &mut Desk<'_, '_, '_, '_>, why: &str| {
            desk.press("halui.program.run");
            assert!(
                desk.journal_has(&format!("pin: refused: {why}")),
                "{:?}",
                desk.run.operator.journal()
            );
        };
        refused(&mut desk, "not all joints are homed");
        desk.order(Order::Home(Vec::new())).unwrap();
        desk.until("homed", |run| {
            run.operator.not_homed() == 0 && run.operator.step() == Step::StandBy
        });
        refused(&mut desk, "no program is loaded");
        assert_eq!(lamps(&desk), [true, false, false]);
        desk.run.hal.set("halui.spindle.0.speed", 1200.0).unwrap();
        desk.press("halui.spindle.0.reverse");
        desk.press("halui.flood.on");
        assert_eq!(desk.spindle_and_coolant(), (true, -1200.0, true, false));
        assert!(desk.pin::<bool>("halui.flood.is-on") && !desk.pin::<bool>("halui.mist.is-on"));
        assert!(desk.pin::<bool>("motion.in-position"));
        desk.begin();
        desk.until("it moves", |run| run.operator.live().velocity_mm_s > 9.0);
        assert_eq!(lamps(&desk), [false, true, false]);
        assert!(desk.pin::<bool>("halui.mode.is-auto") && !desk.pin::<bool>("halui.mode.is-manual"));
        assert!(!desk.pin::<bool>("motion.in-position"));
        // What cuts keeps its spindle.
        desk.press("halui.spindle.0.stop");
        assert_eq!(desk.spindle_and_coolant().1, -1200.0);
        desk.press("halui.program.pause");
        desk.until_state(State::Held);
        assert_eq!(lamps(&desk), [false, false, true]);
        desk.press("halui.spindle.0.stop");
        desk.press("halui.flood.off");
        assert_eq!(desk.spindle_and_coolant(), (false, 0.0, false, false));
        desk.press("halui.program.resume");
        desk.until_state(State::Ready);
        // The last value of a speed that is none is 0.
        desk.run.hal.set("halui.spindle.0.speed", f64::NAN).unwrap();
        desk.press("halui.spindle.0.forward");
        assert_eq!(desk.spindle_and_coolant().1, 0.0);
        desk.press("halui.machine.off");
        desk.until_state(State::Disabled);
    });
}

/// A sender that gives more orders in one turn than the cycle has room for.
#[test]
fn no_order_of_a_flood_is_lost_and_the_last_one_counts() {
    while_one_stands_by(MILL, "G21 G90 F60\nG1 X20\nM2\n", |run, clients, client| {
        let mut desk = Desk::new(run, clients, client);
        desk.begin();
        desk.until("it moves", |run| run.operator.live().velocity_mm_s > 0.9);
        for (last, state) in [(Order::Hold, State::Held), (Order::Resume, State::Running)] {
            let first = desk.ticket + 1;
            let taken = desk.run.operator.live().orders_taken;
            for _ in 0..60 {
                let other = if matches!(last, Order::Hold) {
                    Order::Resume
                } else {
                    Order::Hold
                };
                for order in [other, last.clone()] {
                    desk.ticket += 1;
                    desk.client.put(desk.ticket, order).unwrap();
                    // As many as the inbox takes at once.
                    if desk.ticket.is_multiple_of(50) {
                        desk.turn();
                    }
                }
            }
            let mut answered = 0;
            desk.turns(200);
            while let Some((ticket, answer)) = desk.client.answer() {
                assert!(ticket >= first && answer.is_ok(), "{ticket}: {answer:?}");
                answered += 1;
            }
            assert_eq!((answered, desk.run.control.state()), (120, state));
            assert_eq!(desk.run.operator.live().orders_taken - taken, 120, "taken by the cycle");
        }
    });
}
