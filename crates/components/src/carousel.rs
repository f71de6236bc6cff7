//! Tool carousel: turns until the wanted pocket is where its sensors say.

use crate::component::{Component, Options};
use crate::declare::component;
use crate::edge::Edge;
use crate::logic::bits;
use crate::select::from_gray;

component! {
    /// Turns a tool carousel to a pocket, the only way or the shorter one, with an optional pulse back against a stop.
    ///
    /// Sensors tell the pocket in Gray code, binary, BCD, by one sensor a pocket, or by an index (`sense-0`, at pocket 1) and a
    /// pulse a pocket (`sense-1`), which needs a turn at first.
    ///
    /// A changer that coasts past its pocket is aligned where `align-dc` is not 0: it stops, comes back beyond the edge of the pocket's
    /// signal, and goes slowly forward onto that edge. The signal is `strobe`, the pocket's own sensor, or `sense-1` with an index.
    Carousel = "carousel";
    options {
        pockets: 8, 1..=100, [], "number of pockets";
        encoding: 0, 0..=4, ["gray", "binary", "bcd", "single", "index"], "what the sensors tell";
        num_sense: 4, 1..=32, [], "number of sensors";
        dir: 2, 1..=2, [], "1: turns forward only, 2: the shorter way";
        parity: 0, 0..=1, [], "0: even, 1: odd, where a sensor tells the parity";
    }
    in {
        pocket_number: i32 = 0, "wanted pocket, from 1; beyond the last it goes round, below 1 it is 1; may change while it turns";
        enable: bool = false, "turns as it rises; falling stops at once, but not the search for the index";
        debounce: u32 = 0, "calls that the wanted pocket must last before it stops there: for codes whose bits change a call apart";
        strobe: bool = true, "the sensors may be read";
        parity: bool = false, "parity of the sensors in Gray code, binary and BCD; for `parity-error` alone";
        sense as "sense-#": Vec<bool> = vec![false; 4], "sensor";
        rev_pulse: f64 = 0.0, "pulse back at the pocket, s";
        fwd_dc: f64 = 0.0, "`motor-vel` forward";
        rev_dc: f64 = 0.0, "`motor-vel` backward";
        hold_dc: f64 = 0.0, "`motor-vel` at rest, held against a stop";
        align_dc: f64 = 0.0, "`motor-vel` of the aligning move; 0: none, nor is there one with `rev-pulse`";
        decel_time: f64 = 0.0, "how long it needs to come to rest before the aligning move, s";
        jog_fwd: bool = false, "a pocket forward as it rises, while nothing else is done";
        jog_rev: bool = false, "a pocket back as it rises, with `dir` 2";
        unhome: bool = false, "forgets the pocket as it rises";
    }
    out {
        active: bool = false, "it turns";
        ready: bool = false, "the pocket is there, until `enable` falls";
        motor_fwd: bool = false, "forward";
        motor_rev: bool = false, "backward";
        motor_vel: f64 = 0.0, "speed for a drive";
        parity_error: bool = false, "`parity` does not fit the sensors, at the last `strobe`";
        current_position: i32 = 0, "pocket that the sensors tell, from 1";
        homed: bool = false, "the pocket is known";
    }
    state {
        encoding: Encoding = Encoding::Gray; pockets: i32 = 8; both_ways: bool = true; odd: bool = false; work: Work = Work::Idle; there: u32 = 0;
        unhome_edge: Edge = Edge::default(); enable_edge: Edge = Edge::default(); pulse: Edge = Edge::default(); fwd: Edge = Edge::default(); rev: Edge = Edge::default();
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Encoding {
    Gray,
    Binary,
    Bcd,
    Single,
    Index,
}

/// What is being done. Targets are pockets from 1; a jog has no `ready`.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Work {
    Idle,
    Homing,
    Turning { target: i32, forward: bool, jog: bool },
    PulseBack { left_s: f64, jog: bool },
    Aligning { step: Align, jog: bool },
    There,
}

/// What is done of an aligning move.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Align {
    /// It comes to rest, from turning that way.
    Rest { left_s: f64, forward: bool },
    /// Back onto the pocket's signal that it has left.
    Onto,
    /// Back off it.
    Off,
    /// Forward onto its edge.
    Edge,
}

impl Carousel {
    /// A pocket from 1, whatever number is asked for. RT.
    fn pocket(&self, number: i32) -> i32 {
        (number.wrapping_sub(1)).rem_euclid(self.pockets) + 1
    }

    /// Reads the sensors. RT.
    fn sense(&mut self) {
        let set = self.sense.iter().filter(|bit| **bit).count();
        if self.strobe {
            // Sensors that are no code have no parity.
            let is_code = !matches!(self.encoding, Encoding::Single | Encoding::Index);
            let is_odd = is_code && set % 2 == 1;
            self.parity_error = (is_odd != self.parity) != self.odd;
        }
        let code = bits(&self.sense);
        let told = match self.encoding {
            Encoding::Gray => match from_gray(code) {
                // All sensors off is the last pocket.
                0 => self.pockets,
                number => i32::try_from(number).unwrap_or(0),
            },
            Encoding::Binary => i32::try_from(code).unwrap_or(0),
            Encoding::Bcd => (0..8).rev().fold(0i32, |number, digit| {
                number
                    .saturating_mul(10)
                    .saturating_add((code >> (4 * digit) & 15) as i32)
            }),
            Encoding::Single => match set {
                1 => code.trailing_zeros() as i32 + 1,
                _ => return,
            },
            Encoding::Index => {
                let rises = self.pulse.rises(code & 2 != 0);
                match (code & 3, rises) {
                    (3, _) => 1,
                    (_, true) if self.homed && !matches!(self.work, Work::Aligning { .. }) => {
                        let step = if self.motor_rev { -1 } else { 1 };
                        self.pocket(self.current_position + step)
                    }
                    _ => return,
                }
            }
        };
        let valid = self.strobe && (1..=self.pockets).contains(&told);
        if valid {
            (self.current_position, self.homed) = (told, true);
        }
    }

    /// Whether the carousel stands on the signal of its pocket. RT.
    fn is_at_signal(&self) -> bool {
        let sensor = match self.encoding {
            Encoding::Gray | Encoding::Binary | Encoding::Bcd => return self.strobe,
            Encoding::Single => self.current_position - 1,
            Encoding::Index => 1,
        };
        usize::try_from(sensor).is_ok_and(|sensor| self.sense.get(sensor) == Some(&true))
    }

    /// The next step of an aligning move; `None`: it is over. RT.
    fn align(&self, step: Align, period_s: f64) -> Option<Align> {
        Some(match (step, self.is_at_signal()) {
            (Align::Rest { left_s, forward }, _) if left_s - period_s > period_s / 2.0 => Align::Rest {
                left_s: left_s - period_s,
                forward,
            },
            (Align::Rest { forward: true, .. } | Align::Onto, false) => Align::Onto,
            (Align::Rest { .. } | Align::Onto | Align::Off, true) | (Align::Rest { .. }, false) => Align::Off,
            (Align::Off | Align::Edge, false) => Align::Edge,
            (Align::Edge, true) => return None,
        })
    }

    /// Whether it has been at the pocket for long enough. RT.
    fn is_there(&mut self, target: i32) -> bool {
        let is_at = self.current_position == target;
        self.there = if is_at { self.there.saturating_add(1) } else { 0 };
        self.there > self.debounce
    }

    fn turn_to(&self, target: i32, jog: bool) -> Work {
        let ahead = (target - self.current_position).rem_euclid(self.pockets);
        // Half a turn away, toward the number.
        let is_nearer = 2 * ahead < self.pockets || 2 * ahead == self.pockets && target > self.current_position;
        let forward = !self.both_ways || is_nearer;
        Work::Turning { target, forward, jog }
    }
}

impl Component for Carousel {
    fn shape(&mut self, options: &Options<'_>) {
        self.sense = vec![false; options.count("num_sense")];
        self.pockets = options.get("pockets").clamp(1, 100) as i32;
        self.both_ways = options.get("dir") == 2;
        self.odd = options.get("parity") == 1;
        self.encoding = match options.get("encoding") {
            1 => Encoding::Binary,
            2 => Encoding::Bcd,
            3 => Encoding::Single,
            4 => Encoding::Index,
            _ => Encoding::Gray,
        };
    }

    fn update(&mut self, period_s: f64) {
        if self.unhome_edge.rises(self.unhome) {
            self.homed = false;
        }
        self.sense();
        let begins = self.enable_edge.rises(self.enable);
        let jogs = [self.fwd.rises(self.jog_fwd), self.rev.rises(self.jog_rev)];
        let wanted = self.pocket(self.pocket_number.max(1));
        self.work = match self.work {
            Work::Idle if begins && !self.homed => Work::Homing,
            Work::Idle if (jogs[0] || jogs[1] && self.both_ways) && !self.homed => Work::Homing,
            Work::Idle if begins => self.turn_to(wanted, false),
            Work::Idle if self.homed && !self.enable && jogs[0] => Work::Turning {
                target: self.pocket(self.current_position + 1),
                forward: true,
                jog: true,
            },
            Work::Idle if self.homed && !self.enable && jogs[1] && self.both_ways => Work::Turning {
                target: self.pocket(self.current_position - 1),
                forward: false,
                jog: true,
            },
            Work::Homing if self.homed && self.enable => self.turn_to(wanted, false),
            Work::Homing if self.homed => Work::Idle,
            Work::Turning { jog, .. } | Work::PulseBack { jog, .. } | Work::Aligning { jog, .. }
                if !jog && !self.enable =>
            {
                Work::Idle
            }
            Work::Aligning { step, jog } => match self.align(step, period_s) {
                Some(step) => Work::Aligning { step, jog },
                None if jog => Work::Idle,
                None => Work::There,
            },
            Work::PulseBack { left_s, jog } => Work::PulseBack {
                left_s: left_s - period_s,
                jog,
            },
            Work::There if !self.enable => Work::Idle,
            as_before => as_before,
        };
        // It stops at the pocket that is wanted then.
        if let Work::Turning { target, jog: false, .. } = &mut self.work {
            *target = wanted;
        }
        // What is over leads on in the same call.
        if let Work::Turning { target, forward, jog } = self.work
            && self.is_there(target)
        {
            let left_s = self.rev_pulse.max(0.0);
            let aligns = left_s == 0.0 && self.align_dc != 0.0 && !self.align_dc.is_nan();
            self.work = match aligns {
                true => Work::Aligning {
                    step: Align::Rest {
                        left_s: self.decel_time.max(0.0),
                        forward,
                    },
                    jog,
                },
                false => Work::PulseBack { left_s, jog },
            };
        }
        if let Work::PulseBack { left_s, jog } = self.work
            && left_s <= period_s / 2.0
        {
            self.work = if jog { Work::Idle } else { Work::There };
        }
        (self.motor_fwd, self.motor_rev) = match self.work {
            Work::Idle | Work::There => (false, false),
            Work::Homing => (true, false),
            Work::Turning { forward, .. } => (forward, !forward),
            Work::PulseBack { .. } => (false, true),
            Work::Aligning { step, .. } => (step == Align::Edge, matches!(step, Align::Onto | Align::Off)),
        };
        self.ready = self.work == Work::There;
        let aligns = matches!(self.work, Work::Aligning { .. });
        self.active = self.motor_fwd || self.motor_rev || aligns;
        self.motor_vel = match (self.motor_fwd, self.motor_rev) {
            (true, _) if aligns => self.align_dc,
            (false, true) if aligns => -self.align_dc,
            (true, _) => self.fwd_dc,
            (false, true) => self.rev_dc,
            (false, false) if aligns => 0.0,
            (false, false) => self.hold_dc,
        };
        if self.motor_vel.is_nan() {
            self.motor_vel = 0.0;
        }
    }
}
