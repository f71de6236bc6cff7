//! Oscilloscopes of clients: pins cycle by cycle, thinned, in blocks.
//!
//! In:  what a client wants to see; the ring of the control, into which this looks as another process would.
//! Out: blocks of rows. What a client does not fetch waits in a bounded queue, then in the ring, and then is lost and counted: the
//! cycle never waits for anybody.

use super::rpc::{RpcError, code, to_base64};
use super::server::ClientId;
use hal_pins::Attached;
use hal_pins::scope::{CAPTURES, Channel};
use protocol::limits::SCOPE_RATE_MAX_HZ;
use protocol::{ScopeBegun, ScopePart, ScopeState};
use scope::record::Step;
use scope::stream::{ScopeError, Stream, Wanted};
use scope::thin::{Column, Thinner};
use std::collections::VecDeque;
use std::path::PathBuf;

/// Octets of a block.
const BLOCK_MAX: usize = 24 * 1024;
/// Blocks that wait for their client.
const BLOCKS_MAX: usize = 64;
/// Cycles that are taken in one turn of the service.
const TURN_MAX: usize = 4096;
/// Nobody has taken anything for so long, s.
const IDLE_S: u64 = 60;
/// Where nothing is new, a client is told so often that its oscilloscope lives, ns.
const QUIET_NS: u64 = 1_000_000_000;
/// Oscilloscopes of a client.
const OF_CLIENT_MAX: usize = 2;
/// Oscilloscopes of all clients: one is left to whoever sits at this PC.
const OF_ALL_MAX: usize = CAPTURES - 1;

/// Rows of one record.
#[derive(Debug, Default)]
struct Block {
    record: u64,
    octets: Vec<u8>,
    /// The record has come to its end behind them.
    is_last: bool,
}

struct Scope {
    number: u64,
    client: ClientId,
    stream: Stream,
    thinner: Thinner,
    per_column: u64,
    blocks: VecDeque<Block>,
    /// When its client last took something.
    heard_ns: u64,
    /// Time between two notifications, ns; `None`: its client asks.
    told_every_ns: Option<u64>,
    /// What has gone wrong.
    error: Option<String>,
}

/// All that are open.
#[derive(Default)]
pub struct Scopes {
    /// Folder of the control's pins, and the name of its machine; `None`: nothing can be seen.
    of: Option<(PathBuf, String)>,
    all: Vec<Scope>,
    last: u64,
}

impl Scopes {
    /// Of the control whose pins lie in this folder.
    pub fn new(folder: PathBuf, machine: &str) -> Scopes {
        Scopes {
            of: Some((folder, machine.to_owned())),
            ..Scopes::default()
        }
    }

    /// The pins of the control.
    ///
    /// # Errors
    /// They cannot be had.
    pub fn pins(&self) -> Result<Attached, RpcError> {
        let refused = |what: String| RpcError::new(code::REFUSED, what);
        let (folder, machine) = self.of.as_ref().ok_or_else(|| refused("there are no pins".into()))?;
        Attached::attach_in(std::slice::from_ref(folder), machine).map_err(|error| refused(error.to_string()))
    }

    /// Opens one; a row has so many cycles. With a rate its client is told of new rows by itself.
    ///
    /// # Errors
    /// Unknown pins, lengths that make no sense, too many oscilloscopes.
    pub fn begin(
        &mut self,
        client: ClientId,
        wanted: &Wanted,
        per_column: u64,
        rate_hz: Option<u64>,
        now_ns: u64,
    ) -> Result<ScopeBegun, RpcError> {
        self.forget_idle(now_ns);
        let of_client = self.all.iter().filter(|scope| scope.client == client).count();
        if of_client >= OF_CLIENT_MAX {
            let what = format!("this client has {OF_CLIENT_MAX} scopes: scope.end gives one up");
            return Err(RpcError::new(code::REFUSED, what));
        }
        if self.all.len() >= OF_ALL_MAX {
            let what = format!("clients of this control have {OF_ALL_MAX} scopes, and no more: somebody is to end one");
            return Err(RpcError::new(code::REFUSED, what));
        }
        let stream = Stream::begin(&self.pins()?, wanted).map_err(|error| {
            let kind = match error {
                ScopeError::Hal(hal_pins::HalError::CapturesInUse { .. } | hal_pins::HalError::NoScope) => {
                    code::REFUSED
                }
                ScopeError::Hal(_) | ScopeError::Wanted(_) => code::INVALID_PARAMS,
            };
            RpcError::new(kind, error.to_string())
        })?;
        self.last += 1;
        let channel = |channel: &Channel| protocol::Channel {
            name: channel.name.clone(),
            kind: pin_type(channel.value_type),
            unit: channel.unit.clone(),
        };
        let answer = ScopeBegun {
            scope: self.last,
            period_us: stream.capture().period_ns() as f64 / 1e3,
            channels: stream.channels().iter().map(channel).collect(),
        };
        self.all.push(Scope {
            number: self.last,
            client,
            stream,
            thinner: Thinner::new(per_column),
            per_column,
            blocks: VecDeque::new(),
            heard_ns: now_ns,
            told_every_ns: rate_hz.map(|rate_hz| 1_000_000_000 / rate_hz.clamp(1, SCOPE_RATE_MAX_HZ)),
            error: None,
        });
        Ok(answer)
    }

    /// The next rows, as many as there are.
    ///
    /// # Errors
    /// There is no such oscilloscope.
    pub fn next(&mut self, client: ClientId, number: u64, now_ns: u64) -> Result<ScopePart, RpcError> {
        let Some(at) = (self.all.iter()).position(|scope| scope.number == number && scope.client == client) else {
            let what = format!(
                "no scope {number} of this client: it has come to its end, or nothing was taken for {IDLE_S} s"
            );
            return Err(RpcError::new(code::INVALID_PARAMS, what));
        };
        Ok(self.part(at, now_ns))
    }

    /// Rows for a client that is to be told of them, if there are some and it is time.
    pub fn news(&mut self, client: ClientId, now_ns: u64) -> Option<ScopePart> {
        let is_due = |scope: &Scope| {
            let every_ns = scope.told_every_ns?;
            let since_ns = now_ns.saturating_sub(scope.heard_ns);
            let has_some = !scope.blocks.is_empty() || scope.is_over();
            let is_due = scope.blocks.len() > 1 || since_ns >= QUIET_NS || has_some && since_ns >= every_ns;
            is_due.then_some(scope.heard_ns)
        };
        // Whoever has waited longest first, so that none waits for another.
        let of_client = self.all.iter().enumerate().filter(|(_, scope)| scope.client == client);
        let due = of_client.filter_map(|(at, scope)| Some((is_due(scope)?, at)));
        let (_, at) = due.min()?;
        Some(self.part(at, now_ns))
    }

    /// Whether a client is told of rows by itself.
    pub fn tells(&self, client: ClientId) -> bool {
        let mut of_client = self.all.iter().filter(|scope| scope.client == client);
        of_client.any(|scope| scope.told_every_ns.is_some())
    }

    /// The next rows of one; it is gone with its last ones.
    fn part(&mut self, at: usize, now_ns: u64) -> ScopePart {
        let scope = &mut self.all[at];
        scope.heard_ns = now_ns;
        scope.pump();
        let block = scope.blocks.pop_front().unwrap_or_else(|| Block {
            record: scope.stream.recorder().number(),
            ..Block::default()
        });
        let recorder = scope.stream.recorder();
        let ends = scope.blocks.is_empty() && scope.is_over();
        let state = match () {
            () if ends => ScopeState::Done,
            () if recorder.is_recording() || !block.octets.is_empty() => ScopeState::Recording,
            () => ScopeState::Waiting,
        };
        let row_octets = 8 * (1 + 2 * scope.stream.channels().len());
        let answer = ScopePart {
            scope: scope.number,
            record: block.record,
            rows: block.octets.len() / row_octets,
            base64: to_base64(&block.octets),
            record_ends: block.is_last,
            state,
            lost: scope.stream.capture().lost(),
            more: !scope.blocks.is_empty(),
            error: scope.error.clone(),
        };
        if ends {
            self.all.remove(at);
        }
        answer
    }

    /// Nobody wants more of it.
    pub fn end(&mut self, client: ClientId, number: u64) {
        self.all
            .retain(|scope| !(scope.number == number && scope.client == client));
    }

    /// Takes in what has come.
    pub fn pump(&mut self, now_ns: u64) {
        self.forget_idle(now_ns);
        self.all.iter_mut().for_each(Scope::pump);
    }

    /// A client has gone.
    pub fn left(&mut self, client: ClientId) {
        self.all.retain(|scope| scope.client != client);
    }

    fn forget_idle(&mut self, now_ns: u64) {
        self.all
            .retain(|scope| now_ns.saturating_sub(scope.heard_ns) < IDLE_S * 1_000_000_000);
    }
}

impl Scope {
    /// Whether no more rows will come.
    fn is_over(&self) -> bool {
        self.stream.recorder().is_done() || self.error.is_some()
    }

    fn pump(&mut self) {
        // A block more than its limit at the most: that of a record that ends.
        if self.blocks.len() >= BLOCKS_MAX || self.is_over() {
            return;
        }
        let Scope {
            stream,
            thinner,
            per_column,
            blocks,
            ..
        } = self;
        let mut record = stream.recorder().number();
        // Bounded also where one trigger comes behind the other: a record has a cycle at least.
        let room = (BLOCKS_MAX - blocks.len()) * BLOCK_MAX / (8 * (1 + 2 * stream.channels().len()));
        let result = stream.read(TURN_MAX.min(room), |channels, step| match step {
            Step::Begins { number, .. } => {
                record = number;
                *thinner = Thinner::new(*per_column);
            }
            Step::Sample { time_ns, words } => {
                let values = channels
                    .iter()
                    .zip(words)
                    .map(|(channel, word)| channel.value(*word).to_f64());
                if let Some(column) = thinner.push(time_ns, values) {
                    push_row(blocks, record, &column);
                }
            }
            Step::Ends { number } => {
                if let Some(column) = thinner.finish() {
                    push_row(blocks, number, &column);
                }
                match blocks.back_mut().filter(|block| block.record == number) {
                    Some(block) => block.is_last = true,
                    None => blocks.push_back(Block {
                        record: number,
                        octets: Vec::new(),
                        is_last: true,
                    }),
                }
            }
        });
        if let Err(error) = result {
            self.error = Some(error.to_string());
        }
    }
}

/// Type of the value of a pin.
pub(super) fn pin_type(of: hal_pins::Type) -> protocol::PinType {
    match of {
        hal_pins::Type::Bit => protocol::PinType::Bit,
        hal_pins::Type::S32 => protocol::PinType::S32,
        hal_pins::Type::U32 => protocol::PinType::U32,
        hal_pins::Type::S64 => protocol::PinType::S64,
        hal_pins::Type::U64 => protocol::PinType::U64,
        hal_pins::Type::Float => protocol::PinType::Float,
    }
}

/// A row: time in s, then the least and the greatest value of each channel.
fn push_row(blocks: &mut VecDeque<Block>, record: u64, column: &Column) {
    let length = 8 * (1 + 2 * column.ranges.len());
    let fits = |block: &&mut Block| block.record == record && block.octets.len() + length <= BLOCK_MAX;
    let block = match blocks.back_mut().filter(fits) {
        Some(block) => block,
        None => {
            blocks.push_back(Block {
                record,
                ..Block::default()
            });
            match blocks.back_mut() {
                Some(block) => block,
                None => return,
            }
        }
    };
    let numbers = std::iter::once(column.time_ns as f64 * 1e-9).chain(column.ranges.iter().copied().flatten());
    block.octets.extend(numbers.flat_map(f64::to_le_bytes));
}

#[cfg(test)]
mod tests {
    use super::*;
    use hal_pins::scope::Sampler;
    use hal_pins::{Hal, Output};
    use scope::trigger::Trigger;

    struct Rig {
        scopes: Scopes,
        sampler: Sampler,
        count: Output<u32>,
        cycles: u32,
        _hal: Hal,
        _folder: tempfile::TempDir,
    }

    fn rig() -> Rig {
        let folder = tempfile::tempdir().unwrap();
        let mut hal = Hal::create_in(&[folder.path().to_owned()], "m", 8).unwrap();
        let count = hal.output::<u32>("a.count").unwrap();
        hal.input("a.on", true).unwrap();
        Rig {
            scopes: Scopes::new(folder.path().to_owned(), "m"),
            sampler: Sampler::new(&hal, 1_000_000).unwrap(),
            count,
            cycles: 0,
            _hal: hal,
            _folder: folder,
        }
    }

    impl Rig {
        fn cycles(&mut self, count: u32) {
            for _ in 0..count {
                self.count.set(self.cycles);
                self.sampler.sample(u64::from(self.cycles) * 1_000_000);
                self.cycles += 1;
            }
        }
    }

    fn wanted(pins: &[&str], trigger: Option<&str>) -> Wanted {
        Wanted {
            pins: pins.iter().map(|pin| (*pin).to_owned()).collect(),
            trigger: trigger.map(|text| Trigger::parse(text).unwrap()),
            ..Wanted::default()
        }
    }

    fn rows(answer: &ScopePart) -> Vec<Vec<f64>> {
        const DIGITS: &[u8] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
        let bits = answer.base64.bytes().filter(|digit| *digit != b'=');
        let bits: Vec<usize> = bits
            .map(|digit| DIGITS.iter().position(|known| *known == digit).unwrap())
            .collect();
        let octets: Vec<u8> = (0..bits.len() * 6 / 8)
            .map(|at| {
                (0..8).fold(0, |octet, bit| {
                    octet << 1 | (bits[(8 * at + bit) / 6] >> (5 - (8 * at + bit) % 6) & 1) as u8
                })
            })
            .collect();
        let numbers: Vec<f64> = octets
            .chunks(8)
            .map(|eight| f64::from_le_bytes(eight.try_into().unwrap()))
            .collect();
        match answer.rows {
            0 => Vec::new(),
            rows => numbers.chunks(numbers.len() / rows).map(<[f64]>::to_vec).collect(),
        }
    }

    #[test]
    fn rows_are_thinned_and_come_in_their_order() {
        let mut rig = rig();
        let begun = rig
            .scopes
            .begin(1, &wanted(&["a.count", "a.on"], None), 4, None, 0)
            .unwrap();
        assert_eq!(begun.period_us, 1000.0);
        assert_eq!(
            serde_json::to_value(&begun.channels[0]).unwrap(),
            serde_json::json!({ "name": "a.count", "type": "u32", "unit": "" })
        );
        let number = begun.scope;
        let waiting = rig.scopes.next(1, number, 0).unwrap();
        assert_eq!((waiting.state, waiting.rows), (ScopeState::Waiting, 0));
        rig.cycles(10);
        let some = rig.scopes.next(1, number, 0).unwrap();
        assert_eq!(rows(&some), [[0.0, 0.0, 3.0, 1.0, 1.0], [0.004, 4.0, 7.0, 1.0, 1.0]]);
        assert_eq!((some.state, some.record, some.lost), (ScopeState::Recording, 1, 0));
        assert!(rig.scopes.next(2, number, 0).is_err(), "another's");
        rig.scopes.end(2, number);
        rig.cycles(2);
        assert_eq!(
            rows(&rig.scopes.next(1, number, 0).unwrap()),
            [[0.008, 8.0, 11.0, 1.0, 1.0]]
        );
        rig.scopes.end(1, number);
        assert!(rig.scopes.next(1, number, 0).is_err());
    }

    #[test]
    fn a_record_around_a_trigger_comes_to_its_end() {
        let mut rig = rig();
        let wanted = Wanted {
            seconds: Some(0.01),
            before_percent: 20.0,
            ..wanted(&["a.on"], Some("a.count>50"))
        };
        let number = rig.scopes.begin(1, &wanted, 1, None, 0).unwrap().scope;
        rig.cycles(50);
        assert_eq!(rig.scopes.next(1, number, 0).unwrap().state, ScopeState::Waiting);
        rig.cycles(20);
        let whole = rig.scopes.next(1, number, 0).unwrap();
        let times: Vec<f64> = rows(&whole).iter().map(|row| (row[0] * 1e3).round()).collect();
        assert_eq!(times, [-2.0, -1.0, 0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]);
        assert_eq!((whole.state, whole.record_ends), (ScopeState::Done, true));
        assert!(rig.scopes.next(1, number, 0).is_err());
    }

    #[test]
    fn whoever_does_not_fetch_loses_with_a_count_and_in_bounded_memory() {
        let mut rig = rig();
        let number = rig
            .scopes
            .begin(1, &wanted(&["a.count"; 31], None), 1, None, 0)
            .unwrap()
            .scope;
        for _ in 0..30 {
            rig.cycles(1000);
            rig.scopes.pump(0);
            let scope = &rig.scopes.all[0];
            assert!(scope.blocks.len() <= BLOCKS_MAX + 1);
            assert!(scope.blocks.iter().all(|block| block.octets.len() <= BLOCK_MAX));
        }
        let (mut next, mut lost, mut gaps) = (0, 0, 0);
        loop {
            let block = rig.scopes.next(1, number, 0).unwrap();
            lost = block.lost.max(lost);
            for row in rows(&block) {
                gaps += row[1] as u64 - next;
                next = row[1] as u64 + 1;
            }
            if block.rows == 0 {
                break;
            }
        }
        assert!(lost > 1000, "{lost}");
        assert_eq!(next + lost - gaps, 30_000, "what is not there is counted");
        rig.scopes.pump(IDLE_S * 1_000_000_000);
        assert!(rig.scopes.all.is_empty(), "nobody asks");
    }

    #[test]
    fn refusals_say_why() {
        let mut rig = rig();
        let mut refusal = |wanted: &Wanted| rig.scopes.begin(1, wanted, 1, None, 0).unwrap_err();
        let unknown = refusal(&wanted(&["a.cuont"], None));
        assert_eq!(unknown.message.text, "no pin or net 'a.cuont'; did you mean 'a.count'?");
        assert!(
            refusal(&wanted(&["a.on"], Some("b>1")))
                .message
                .text
                .contains("no pin or net 'b'")
        );
        let too_long = Wanted {
            seconds: Some(1e6),
            before_percent: 50.0,
            ..wanted(&["a.on"], Some("a.count>1"))
        };
        assert!(refusal(&too_long).message.text.contains("values would have to be kept"));
        let no_length = Wanted {
            seconds: Some(f64::NAN),
            ..wanted(&["a.on"], None)
        };
        assert!(refusal(&no_length).message.text.contains("expected a length"));
        assert!(
            refusal(&wanted(&["a.on"; 32], Some("a.count>1")))
                .message
                .text
                .contains("32 in all")
        );
        assert!(
            Scopes::default()
                .begin(1, &wanted(&["a.on"], None), 1, None, 0)
                .is_err()
        );
    }

    #[test]
    fn no_client_takes_all_and_all_of_them_leave_one() {
        let mut rig = rig();
        let on = wanted(&["a.on"], None);
        for client in [1, 1, 2] {
            rig.scopes.begin(client, &on, 1, None, 0).unwrap();
        }
        let refusal = |scopes: &mut Scopes, client| {
            let error = scopes.begin(client, &on, 1, None, 0).unwrap_err();
            assert_eq!(error.code, code::REFUSED);
            error.message.text
        };
        assert!(refusal(&mut rig.scopes, 1).contains("this client has 2 scopes"));
        assert!(refusal(&mut rig.scopes, 2).contains("clients of this control have 3 scopes"));
        let pins = rig.scopes.pins().unwrap();
        let _of_another_process = Stream::begin(&pins, &on).unwrap();
        rig.scopes.left(1);
        let _and_another = Stream::begin(&pins, &on).unwrap();
        rig.scopes.begin(2, &on, 1, None, 0).unwrap();
        assert!(refusal(&mut rig.scopes, 3).contains("are in use"));
    }

    #[test]
    fn a_client_is_told_of_rows_as_they_come() {
        const MS: u64 = 1_000_000;
        let mut rig = rig();
        let begun = rig
            .scopes
            .begin(1, &wanted(&["a.count"], None), 1, Some(20), 0)
            .unwrap();
        assert!(rig.scopes.tells(1) && !rig.scopes.tells(2));
        rig.cycles(3);
        rig.scopes.pump(10 * MS);
        assert_eq!(rig.scopes.news(1, 10 * MS), None, "20 times a second");
        assert_eq!(rig.scopes.news(2, 50 * MS), None, "another's");
        let told = rig.scopes.news(1, 50 * MS).unwrap();
        assert_eq!((told.scope, told.rows), (begun.scope, 3));
        assert_eq!(rig.scopes.news(1, 100 * MS), None, "nothing is new");
        let quiet = rig.scopes.news(1, 1050 * MS).unwrap();
        assert_eq!((quiet.rows, quiet.state), (0, ScopeState::Recording));
        // What has gathered comes without a wait.
        rig.cycles(4000);
        rig.scopes.pump(1060 * MS);
        let rows: usize = std::iter::from_fn(|| rig.scopes.news(1, 1060 * MS))
            .map(|told| told.rows)
            .sum();
        assert!((2000..4000).contains(&rows), "{rows}");
        // It reads no more: nothing is taken for a minute.
        rig.scopes.pump((1060 + 1000 * IDLE_S) * MS);
        assert!(!rig.scopes.tells(1));
    }

    #[test]
    fn a_record_that_ends_is_told_as_the_last() {
        let mut rig = rig();
        let single = Wanted {
            seconds: Some(0.01),
            ..wanted(&["a.on"], Some("a.count>2"))
        };
        rig.scopes.begin(1, &single, 1, Some(50), 0).unwrap();
        rig.cycles(30);
        rig.scopes.pump(1);
        let told = rig.scopes.news(1, 20_000_000).unwrap();
        assert_eq!((told.state, told.record_ends), (ScopeState::Done, true));
        assert!(!rig.scopes.tells(1));
    }
}
