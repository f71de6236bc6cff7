//! Sequence layer: two octets that number the frames of a connection in both directions.
//!
//! Octet 0 (receive): number of the last frame received in order, and what the receiver thinks of the connection.
//! Octet 1 (send): number of this frame, and what the sender thinks. Each octet is `number << 2 | con`; octets 2 and 3 are
//! reserved. A frame that repeats the last send number carries no new command: it acknowledges, or it is a duplicate.

/// Octets of the sequence header.
pub const HEADER_LEN: usize = 4;

/// Frames with a command that one side sends without an acknowledge of the other. The other stack keeps as many.
pub const WINDOW: u8 = 5;

/// State of a connection as one side tells it; two bits on the wire.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Con {
    /// No connection; sent to close one.
    None,
    /// The connection is being set up.
    Init,
    /// The connection is open.
    Valid,
    /// In the receive octet: frames are missing, please send them again. In the send octet: please acknowledge.
    Request,
}

impl Con {
    const fn from_bits(octet: u8) -> Con {
        match octet & 3 {
            0 => Con::None,
            1 => Con::Init,
            2 => Con::Valid,
            _ => Con::Request,
        }
    }

    const fn bits(self) -> u8 {
        match self {
            Con::None => 0,
            Con::Init => 1,
            Con::Valid => 2,
            Con::Request => 3,
        }
    }

    /// Whether this side takes the connection as open.
    pub const fn is_open(self) -> bool {
        matches!(self, Con::Valid | Con::Request)
    }
}

/// Number of a frame; counts modulo 64.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct Number(u8);

impl Number {
    /// The number modulo 64.
    pub const fn new(number: u8) -> Number {
        Number(number & 0x3F)
    }

    /// The number after this one.
    #[must_use]
    pub const fn next(self) -> Number {
        Number::new(self.0 + 1)
    }

    /// The number as sent, 0..=63.
    pub const fn get(self) -> u8 {
        self.0
    }

    /// Steps from `earlier` to this number.
    pub const fn since(self, earlier: Number) -> u8 {
        self.0.wrapping_sub(earlier.0) & 0x3F
    }
}

/// What the number of a received frame says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Arrival {
    /// The number of a frame that we have: an acknowledge, or a duplicate.
    Known,
    /// The frame we wait for.
    Next,
    /// A frame before this one is missing.
    Gap,
}

/// Numbers of an open connection as one of its ends keeps them: what came in order, and which frames of our own are on
/// their way. It keeps no frames: whoever sends can make each of them again from its number.
///
/// ```text
/// acknowledged < frames in flight, at most WINDOW <= sent
///                  ^ next: what goes out next; behind `transmitted` while frames are repeated
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Flow {
    received: Number,
    acknowledged: Number,
    sent: Number,
    transmitted: Number,
    next: Number,
}

impl Flow {
    /// A connection that has just been opened; the peer counts from `received`.
    pub const fn new(received: Number) -> Flow {
        Flow {
            received,
            acknowledged: Number::new(0),
            sent: Number::new(0),
            transmitted: Number::new(0),
            next: Number::new(1),
        }
    }

    /// Last frame of the peer that came in order.
    pub const fn received(&self) -> Number {
        self.received
    }

    /// Last frame of ours that has a number.
    pub const fn sent(&self) -> Number {
        self.sent
    }

    /// Our frames that the peer has not acknowledged.
    pub const fn in_flight(&self) -> u8 {
        self.sent.since(self.acknowledged)
    }

    /// Whether another frame of ours may get a number.
    pub const fn has_room(&self) -> bool {
        self.in_flight() < WINDOW
    }

    /// Numbers one more frame, which is then due; the caller has asked [`has_room`](Self::has_room).
    pub fn add(&mut self) -> Number {
        self.sent = self.sent.next();
        self.sent
    }

    /// Frames that have to go out, new ones and repeated ones.
    pub const fn due(&self) -> u8 {
        self.sent.next().since(self.next)
    }

    /// The next frame that has to go out: its number, its place among the frames in flight (from 0), and whether it is
    /// repeated.
    pub fn transmit(&mut self) -> Option<Outgoing> {
        if self.due() == 0 {
            return None;
        }
        let number = self.next;
        self.next = number.next();
        let repeated = !self.is_new(number);
        if !repeated {
            self.transmitted = number;
        }
        Some(Outgoing {
            number,
            place: number.since(self.acknowledged) - 1,
            repeated,
        })
    }

    const fn is_new(&self, number: Number) -> bool {
        number.since(self.acknowledged) > self.transmitted.since(self.acknowledged)
    }

    /// The peer says up to which number it has our frames; returns how many have newly arrived. `None`: it cannot have
    /// said that on this connection lately.
    pub fn acknowledge(&mut self, number: Number) -> Option<u8> {
        let arrived = number.since(self.acknowledged);
        if arrived > self.transmitted.since(self.acknowledged) {
            return None;
        }
        // What was to be repeated and has arrived need not be repeated.
        let next = self.next.since(self.acknowledged);
        self.acknowledged = number;
        if next <= arrived {
            self.next = number.next();
        }
        Some(arrived)
    }

    /// Everything the peer lacks goes out again; nothing changes while that is under way.
    pub fn repeat(&mut self) {
        if self.is_new(self.next) {
            self.next = self.acknowledged.next();
        }
    }

    /// The last frame goes out again, to ask what the peer has.
    pub fn repeat_last(&mut self) {
        if self.transmitted != self.acknowledged && self.is_new(self.next) {
            self.next = self.transmitted;
        }
    }

    /// Tells what a received frame is; the caller takes the next one by [`accept`](Self::accept).
    pub const fn arrival(&self, number: Number) -> Arrival {
        match number.since(self.received) {
            0 | 33..=63 => Arrival::Known,
            1 => Arrival::Next,
            _ => Arrival::Gap,
        }
    }

    /// The next frame was taken.
    pub fn accept(&mut self) {
        self.received = self.received.next();
    }
}

/// A frame that goes out now.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Outgoing {
    /// Number of the frame.
    pub number: Number,
    /// 0: the first that is not acknowledged.
    pub place: u8,
    /// It went out before.
    pub repeated: bool,
}

/// The sequence header (DS 301 ch. 6.3.2).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sequence {
    /// Last frame received in order.
    pub received: Number,
    /// State as the receiver tells it.
    pub received_con: Con,
    /// Number of this frame.
    pub sent: Number,
    /// State as the sender tells it.
    pub sent_con: Con,
}

impl Sequence {
    /// Reads service data; `None` when they are shorter than the header. Never panics.
    pub fn parse(service_data: &[u8]) -> Option<Sequence> {
        let header = service_data.get(..HEADER_LEN)?;
        Some(Sequence {
            received: Number::new(header[0] >> 2),
            received_con: Con::from_bits(header[0]),
            sent: Number::new(header[1] >> 2),
            sent_con: Con::from_bits(header[1]),
        })
    }

    /// Writes the header.
    pub fn emit(self, header: &mut [u8; HEADER_LEN]) {
        let octet = |number: Number, con: Con| number.0 << 2 | con.bits();
        *header = [
            octet(self.received, self.received_con),
            octet(self.sent, self.sent_con),
            0,
            0,
        ];
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    #[test]
    fn headers_of_a_captured_connection() {
        // openpowerlink-mn-3cn-10ms.pcap, frames 955, 999, 1029, 1126, 6400, 2791: octets 18 and 19.
        let parse = |receive, send| {
            let sequence = Sequence::parse(&[receive, send, 0, 0]).unwrap();
            (
                sequence.received.get(),
                sequence.received_con,
                sequence.sent.get(),
                sequence.sent_con,
            )
        };
        assert_eq!(parse(0x00, 0x01), (0, Con::None, 0, Con::Init));
        assert_eq!(parse(0x01, 0x01), (0, Con::Init, 0, Con::Init));
        assert_eq!(parse(0x01, 0x02), (0, Con::Init, 0, Con::Valid));
        assert_eq!(parse(0x02, 0x06), (0, Con::Valid, 1, Con::Valid));
        assert_eq!(parse(0x46, 0x47), (17, Con::Valid, 17, Con::Request));
        assert_eq!(parse(0x44, 0x44), (17, Con::None, 17, Con::None));
    }

    #[test]
    fn every_pair_of_octets_leads_there_and_back() {
        for receive in 0..=u8::MAX {
            for send in 0..=u8::MAX {
                let mut header = [0xA5; HEADER_LEN];
                Sequence::parse(&[receive, send, 7, 7]).unwrap().emit(&mut header);
                assert_eq!(header, [receive, send, 0, 0]);
            }
        }
        assert_eq!(Sequence::parse(&[0; 3]), None);
    }

    #[test]
    fn numbers_wrap_after_63() {
        assert_eq!(Number::new(63).next(), Number::new(0));
        assert_eq!(Number::new(62).next().get(), 63);
    }

    fn out(flow: &mut Flow) -> Vec<(u8, u8, bool)> {
        core::iter::from_fn(|| flow.transmit())
            .map(|outgoing| (outgoing.number.get(), outgoing.place, outgoing.repeated))
            .collect()
    }

    /// A flow whose frames up to `number` have all arrived.
    fn at(number: u8) -> Flow {
        let mut flow = Flow::new(Number::new(0));
        while flow.sent() != Number::new(number) {
            let sent = flow.add();
            assert!(flow.transmit().is_some());
            assert_eq!(flow.acknowledge(sent), Some(1));
        }
        flow
    }

    #[test]
    fn exactly_what_the_peer_lacks_goes_out_again_wherever_the_numbers_wrap() {
        for start in 0..64 {
            let mut flow = at(start);
            let number = |step| Number::new(start.wrapping_add(step));
            while flow.has_room() {
                flow.add();
            }
            let first: Vec<_> = (1..=5).map(|step| (number(step).get(), step - 1, false)).collect();
            assert_eq!(out(&mut flow), first);
            assert_eq!(flow.acknowledge(number(2)), Some(2));
            assert_eq!(flow.due(), 0);
            flow.repeat();
            flow.repeat(); // asked twice
            let again: Vec<_> = (3..=5).map(|step| (number(step).get(), step - 3, true)).collect();
            assert_eq!(out(&mut flow), again);
            // While they go out again, two arrive: they are left out.
            flow.repeat();
            assert_eq!(flow.transmit().map(|outgoing| outgoing.number), Some(number(3)));
            assert_eq!(flow.acknowledge(number(4)), Some(2));
            flow.add();
            assert_eq!(
                out(&mut flow),
                [(number(5).get(), 0, true), (number(6).get(), 1, false)]
            );
            flow.repeat_last();
            assert_eq!(out(&mut flow), [(number(6).get(), 1, true)]);
            assert_eq!(flow.acknowledge(number(6)), Some(2));
            flow.repeat_last();
            assert_eq!((flow.in_flight(), out(&mut flow)), (0, Vec::new()));
        }
    }

    #[test]
    fn an_acknowledge_of_what_was_not_sent_is_none() {
        for start in 0..64 {
            let mut flow = at(start);
            flow.add();
            flow.add();
            flow.transmit();
            for step in 0..64 {
                let mut flow = flow;
                let expected = if step <= 1 { Some(step) } else { None };
                assert_eq!(flow.acknowledge(Number::new(start.wrapping_add(step))), expected);
            }
        }
    }

    #[test]
    fn half_the_numbers_are_new_and_half_are_known() {
        for received in 0..64 {
            let flow = Flow::new(Number::new(received));
            let count = |arrival| {
                let numbers = (0..64).map(Number::new);
                numbers.filter(|number| flow.arrival(*number) == arrival).count()
            };
            assert_eq!(flow.arrival(Number::new(received + 1)), Arrival::Next);
            assert_eq!((count(Arrival::Known), count(Arrival::Gap)), (32, 31));
        }
    }
}
