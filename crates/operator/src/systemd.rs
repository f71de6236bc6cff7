//! What systemd is told when the control is a service: ready, status, alive, stopping.
//!
//! In:  what the operator's loop sees in each turn: state, cycles, alarms; the environment that systemd gives a service.
//! Out: datagrams to `$NOTIFY_SOCKET`; none where there is no such socket.
//!
//! READY=1 goes out once the network is OPERATIONAL, or with the first alarm: then an operator is needed, and what he sees
//! and acknowledges it with may be ordered after this unit. Until then the start-up time is extended for as long as cycles
//! run, for drives may be switched on later than the PC.
//!
//! WATCHDOG=1 goes out from the operator's loop, and only if the cycle thread has made progress since the last one. So
//! systemd ends a control in which either of the two hangs. The drives have stopped by themselves before that, for want of
//! SoC.

use machine::state::State;
use sd_notify::NotifyState;
use std::time::Duration;

/// Start-up is extended by this much beyond now, µs, and how often, ns.
const EXTENSION_US: u32 = 15_000_000;
const EXTENSION_EVERY_NS: u64 = 3_000_000_000;
/// Signs of life within the time after which systemd gives up; it asks for two at least.
const SIGNS_OF_LIFE: u32 = 4;

/// What the operator's loop sees in one turn.
#[derive(Clone, Copy, Debug)]
pub struct ServiceStatus<'a> {
    /// What the machine is doing.
    pub state: State,
    /// Cycles so far.
    pub cycles: u64,
    /// Why the machine stopped by itself.
    pub alarm: Option<&'a str>,
    /// Name of the program that runs.
    pub program: Option<&'a str>,
    /// No program is under way; the next one is waited for.
    pub stands_by: bool,
}

/// A message to systemd.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Message {
    /// READY=1
    Ready,
    /// STATUS=
    Status(String),
    /// WATCHDOG=1
    Alive,
    /// EXTEND_TIMEOUT_USEC=
    Extend,
    /// STOPPING=1
    Stopping,
}

/// Decides what is told, on time that comes from outside.
#[derive(Debug)]
pub struct Notifier {
    alive_every_ns: Option<u64>,
    ready: bool,
    stopping: bool,
    status: String,
    alive: Sign,
    extended: Sign,
}

/// A message that is repeated while cycles run.
#[derive(Debug, Default)]
struct Sign {
    /// When it was sent, and at which cycle.
    last: Option<(u64, u64)>,
}

impl Sign {
    /// Whether it is due and deserved.
    fn is_due(&mut self, now_ns: u64, cycles: u64, every_ns: u64) -> bool {
        let due = self
            .last
            .is_none_or(|(sent_ns, sent_at)| now_ns.saturating_sub(sent_ns) >= every_ns && cycles > sent_at);
        // Before the first cycle nothing is alive yet.
        let take = due && cycles > 0;
        if take {
            self.last = Some((now_ns, cycles));
        }
        take
    }
}

impl Notifier {
    /// `watchdog`: the time without a sign of life after which systemd gives up, if it watches.
    pub fn new(watchdog: Option<Duration>) -> Notifier {
        Notifier {
            alive_every_ns: watchdog.map(|limit| (limit / SIGNS_OF_LIFE).as_nanos() as u64),
            ready: false,
            stopping: false,
            status: String::new(),
            alive: Sign::default(),
            extended: Sign::default(),
        }
    }

    /// What is to be told now.
    pub fn messages(&mut self, now_ns: u64, sight: &ServiceStatus<'_>) -> Vec<Message> {
        let mut messages = Vec::new();
        if !self.ready && (is_up(sight.state) || sight.alarm.is_some()) {
            self.ready = true;
            messages.push(Message::Ready);
        }
        let status = status(sight);
        if status != self.status {
            self.status.clone_from(&status);
            messages.push(Message::Status(status));
        }
        if self
            .alive_every_ns
            .is_some_and(|every_ns| self.alive.is_due(now_ns, sight.cycles, every_ns))
        {
            messages.push(Message::Alive);
        }
        if !self.ready && self.extended.is_due(now_ns, sight.cycles, EXTENSION_EVERY_NS) {
            messages.push(Message::Extend);
        }
        messages
    }

    /// The end begins; told once.
    pub fn stopping(&mut self) -> Option<Message> {
        (!std::mem::replace(&mut self.stopping, true)).then_some(Message::Stopping)
    }
}

/// Whether the network is OPERATIONAL, or was and a fault has ended that.
fn is_up(state: State) -> bool {
    match state {
        State::Disabled
        | State::Enabling
        | State::Ready
        | State::Homing
        | State::Jogging
        | State::Running
        | State::Held
        | State::Away
        | State::Returning
        | State::Stopping
        | State::Disabling
        | State::Faulted
        | State::Estop => true,
        State::Booting | State::ShuttingDown | State::Down | State::Silenced => false,
    }
}

/// One line for `systemctl status`.
fn status(sight: &ServiceStatus<'_>) -> String {
    let program = sight.program.map(|name| format!(", {name}")).unwrap_or_default();
    let alarm = sight.alarm.map(|cause| format!("; alarm: {cause}")).unwrap_or_default();
    let state = match (sight.stands_by, sight.state) {
        (true, State::Disabled) => "standing by, drives off",
        (_, state) => state.name(),
    };
    let line = format!("{state}{program}{alarm}");
    // A line of its own would be another message.
    line.replace(['\n', '\r'], " ")
}

/// The service that systemd has started; without effect where it has not.
#[derive(Debug)]
pub struct Service {
    notifier: Notifier,
    /// A refusal is told once.
    refused: bool,
}

impl Service {
    /// Takes `$WATCHDOG_USEC` from the environment.
    pub fn from_environment() -> Service {
        Service {
            notifier: Notifier::new(sd_notify::watchdog_enabled()),
            refused: false,
        }
    }

    /// One turn of the operator's loop.
    pub fn notify(&mut self, now_ns: u64, sight: &ServiceStatus<'_>) {
        let messages = self.notifier.messages(now_ns, sight);
        self.send(&messages);
    }

    /// The end begins.
    pub fn stopping(&mut self) {
        let message = self.notifier.stopping();
        self.send(message.as_slice());
    }

    fn send(&mut self, messages: &[Message]) {
        if messages.is_empty() {
            return;
        }
        let states: Vec<NotifyState<'_>> = messages.iter().map(Message::state).collect();
        if let Err(cause) = sd_notify::notify(&states)
            && !std::mem::replace(&mut self.refused, true)
        {
            tracing::warn!("systemd cannot be told anything: $NOTIFY_SOCKET: {cause}");
        }
    }
}

impl Message {
    fn state(&self) -> NotifyState<'_> {
        match self {
            Message::Ready => NotifyState::Ready,
            Message::Status(text) => NotifyState::Status(text),
            Message::Alive => NotifyState::Watchdog,
            Message::Extend => NotifyState::ExtendTimeoutUsec(EXTENSION_US),
            Message::Stopping => NotifyState::Stopping,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: u64 = 1_000_000_000;

    fn sight(state: State, cycles: u64) -> ServiceStatus<'static> {
        ServiceStatus {
            state,
            cycles,
            alarm: None,
            program: None,
            stands_by: false,
        }
    }

    fn status_of(text: &str) -> Message {
        Message::Status(text.into())
    }

    #[test]
    fn ready_is_the_network_that_is_operational_and_is_told_once() {
        let mut notifier = Notifier::new(None);
        assert_eq!(
            notifier.messages(0, &sight(State::Booting, 1)),
            [status_of("booting"), Message::Extend]
        );
        assert_eq!(notifier.messages(SECOND, &sight(State::Booting, 1000)), []);
        assert_eq!(
            notifier.messages(2 * SECOND, &sight(State::Disabled, 2000)),
            [Message::Ready, status_of("disabled")]
        );
        assert_eq!(
            notifier.messages(3 * SECOND, &sight(State::Booting, 3000)),
            [status_of("booting")]
        );
        assert_eq!(
            notifier.messages(9 * SECOND, &sight(State::Disabled, 9000)),
            [status_of("disabled")]
        );
    }

    #[test]
    fn an_alarm_before_that_is_told_in_words_on_one_line() {
        let mut notifier = Notifier::new(None);
        let alarm = ServiceStatus {
            alarm: Some("x-drive lost\nREADY=1"),
            program: Some("part.ngc"),
            ..sight(State::Booting, 1)
        };
        assert_eq!(
            notifier.messages(0, &alarm),
            [
                Message::Ready,
                status_of("booting, part.ngc; alarm: x-drive lost READY=1")
            ]
        );
    }

    #[test]
    fn standing_by_is_told_in_words() {
        let mut notifier = Notifier::new(None);
        let waiting = ServiceStatus {
            stands_by: true,
            ..sight(State::Disabled, 1)
        };
        assert_eq!(
            notifier.messages(0, &waiting),
            [Message::Ready, status_of("standing by, drives off")]
        );
    }

    #[test]
    fn start_up_is_extended_only_while_cycles_run() {
        let mut notifier = Notifier::new(None);
        let mut extensions = 0;
        for second in 0..30 {
            // The cycle thread stands still from the 16th second on.
            let cycles = 1 + 1000 * second.min(15);
            let messages = notifier.messages(second * SECOND, &sight(State::Booting, cycles));
            extensions += messages.iter().filter(|message| **message == Message::Extend).count();
        }
        assert_eq!(extensions, 6, "at 0, 3, 6, 9, 12 and 15 s");
    }

    #[test]
    fn no_sign_of_life_while_cycles_stand_still() {
        let mut notifier = Notifier::new(Some(Duration::from_secs(4)));
        let mut alive = |now_ns, cycles| {
            let messages = notifier.messages(now_ns, &sight(State::Ready, cycles));
            messages.contains(&Message::Alive)
        };
        assert!(!alive(0, 0), "not before the first cycle");
        assert!(alive(1, 1));
        assert!(!alive(SECOND / 2, 500), "not more often than needed");
        assert!(alive(SECOND + 1, 1000));
        for tenths in 20..100 {
            assert!(!alive(tenths * SECOND / 10, 1000), "hung");
        }
        assert!(alive(10 * SECOND, 1001), "as soon as it goes on");
    }

    #[test]
    fn the_end_is_told_once() {
        let mut notifier = Notifier::new(None);
        assert_eq!(notifier.stopping(), Some(Message::Stopping));
        assert_eq!(notifier.stopping(), None);
    }
}
