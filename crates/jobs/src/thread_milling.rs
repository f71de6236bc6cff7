//! Threads, milled with a tool of one tooth row.
//!
//! In:  diameter, pitch, side and hand of the thread, tool. Out: a helix of whole turns for each pass, one turn per pitch, with an entry and an
//! exit that touch the thread tangentially and rise with it.
//!
//! A right-hand thread turns counter-clockwise while it rises. Climb milling goes counter-clockwise inside and clockwise outside; so an
//! inner right-hand thread is cut upwards, and an outer one downwards.
//!
//! Inside, the tool comes from the axis on a half circle whose diameter is the radius of the helix. On it the polar angle about the axis
//! grows evenly, by a quarter of a turn in all, and Z by a quarter of the pitch: the tool is on the helix of the thread at any moment.

use crate::fields::{Coolant, Wrong, job, steps};
use crate::writer::{Writer, number};
use protocol::message;
use serde::{Deserialize, Serialize};

/// Depth of a metric thread in pitches: of a nut 5/8, of a bolt 17/24 of the height of its triangle.
const INSIDE_DEPTH: f64 = 0.541_266;
const OUTSIDE_DEPTH: f64 = 0.613_435;
/// Way of the tool outside a bolt before it touches, mm.
const AIR_MM: f64 = 1.0;

/// Where the thread is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Side {
    /// In a hole.
    #[default]
    Inside,
    /// On a boss.
    Outside,
}

impl Side {
    pub(crate) const WORDS: &'static [&'static str] = &["inside", "outside"];
}

/// How the thread turns.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Hand {
    /// Right-hand.
    #[default]
    Right,
    /// Left-hand.
    Left,
}

impl Hand {
    pub(crate) const WORDS: &'static [&'static str] = &["right", "left"];
}

/// How the tool cuts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Cut {
    /// Climb milling.
    #[default]
    Climb,
    /// Conventional milling.
    Conventional,
}

impl Cut {
    pub(crate) const WORDS: &'static [&'static str] = &["climb", "conventional"];
}

job! {
    "Thread milling, inside or outside, with a tool of one tooth row"
    ThreadMilling {
        #[doc = " X of the axis of the thread."]
        x = number("mm", 0.0, -10_000.0, 10_000.0);
        #[doc = " Y of its axis."]
        y = number("mm", 0.0, -10_000.0, 10_000.0);
        #[doc = " Inside: in a hole. Outside: on a boss."]
        side = choice(Side);
        #[doc = " Right-hand or left-hand thread."]
        hand = choice(Hand);
        #[doc = " Nominal diameter: 10 of M10."]
        diameter = number("mm", 10.0, 0.5, 1000.0);
        #[doc = " Pitch."]
        pitch = number("mm", 1.5, 0.05, 50.0);
        #[doc = " Depth of the profile. 0: metric, by the pitch."]
        profile_depth = number("mm", 0.0, 0.0, 50.0);
        #[doc = " Length of the thread below the surface."]
        depth = number("mm", 12.0, 0.001, 1000.0);
        #[doc = " Diameter of the tool over its teeth."]
        tool_diameter = number("mm", 6.0, 0.01, 1000.0);
        #[doc = " Passes, of equal depth in the profile."]
        passes = whole(1, 1, 20);
        #[doc = " Climb or conventional milling."]
        cut = choice(Cut);
        #[doc = " Feed downwards, outside of the material."]
        plunge_feed = number("mm/min", 400.0, 1.0, 100_000.0);
    }
}

impl ThreadMilling {
    /// The program.
    ///
    /// # Errors
    /// Which number is wrong, and what to do about it.
    pub fn program(&self) -> Result<String, Wrong> {
        let inside = self.side == Side::Inside;
        let profile = match self.profile_depth {
            0.0 if inside => INSIDE_DEPTH * self.pitch,
            0.0 => OUTSIDE_DEPTH * self.pitch,
            depth => depth,
        };
        // Of the hole, or of the root of the bolt.
        let core = self.diameter - 2.0 * profile;
        if core <= 0.0 {
            return Wrong::at(
                "pitch",
                message!(
                    "job.pitch",
                    "a thread of {diameter} mm has no room for a profile {profile:.3} mm deep: take a smaller pitch",
                    diameter = self.diameter,
                    profile = profile
                ),
            );
        }
        if inside && self.tool_diameter >= core {
            return Wrong::at(
                "tool_diameter",
                message!(
                    "job.tool_in_thread",
                    "a tool of {diameter} mm does not fit into the hole of {core:.3} mm of this thread: take a smaller one",
                    diameter = self.tool_diameter,
                    core = core
                ),
            );
        }
        // An entry and an exit never take more than a quarter of a turn each.
        let quarter = self.pitch / 4.0;
        if self.depth <= quarter {
            return Wrong::at(
                "depth",
                message!(
                    "job.thread_depth",
                    "a thread {depth} mm long is shorter than the entry of the tool: more than {least} mm",
                    depth = self.depth,
                    least = quarter
                ),
            );
        }
        let end = self.top + self.pitch + quarter;
        if end > self.safe_height {
            return Wrong::at(
                "safe_height",
                message!(
                    "job.thread_safe_height",
                    "the tool leaves the thread at up to {end:.3} mm, above the safe height of {safe} mm: raise it",
                    end = end,
                    safe = self.safe_height
                ),
            );
        }
        let mut writer = Writer::new(
            &format!(
                "{} {} thread {} x {}, {} mm deep",
                if inside { "Inner" } else { "Outer" },
                match self.hand {
                    Hand::Right => "right-hand",
                    Hand::Left => "left-hand",
                },
                number(self.diameter),
                number(self.pitch),
                number(self.depth)
            ),
            &[
                format!("Axis at X{} Y{}", number(self.x), number(self.y)),
                match inside {
                    true => format!("In a hole of {} mm", number(core)),
                    false => format!("On a boss of {} mm, root {} mm", number(self.diameter), number(core)),
                },
            ],
            &format!("thread mill of {} mm, one tooth row", number(self.tool_diameter)),
            &self.common(),
        )?;
        for pass in 1..=self.passes {
            let depth = profile * f64::from(pass) / f64::from(self.passes);
            let radius = match inside {
                true => (core - self.tool_diameter) / 2.0 + depth,
                false => (self.diameter + self.tool_diameter) / 2.0 - depth,
            };
            writer.comment(&format!("Pass {pass}: profile {} mm deep", number(depth)))?;
            self.pass(&mut writer, radius)?;
        }
        writer.end()
    }

    /// A helix of this radius, of whole turns; entry and exit lie within the depth.
    fn pass(&self, writer: &mut Writer, radius: f64) -> Result<(), Wrong> {
        let inside = self.side == Side::Inside;
        let counter_clockwise = inside == (self.cut == Cut::Climb);
        let up = counter_clockwise == (self.hand == Hand::Right);
        let axis = [self.x, self.y];
        let start = [self.x + radius, self.y];
        // Along Y at the start of the helix.
        let ahead = if counter_clockwise { 1.0 } else { -1.0 };
        // Where the tool comes from and leaves to, the centre of both arcs, what Z takes on each.
        let (from, to, centre, rise) = match self.side {
            Side::Inside => (axis, axis, [self.x + radius / 2.0, self.y], self.pitch / 4.0),
            Side::Outside => {
                let clear = (self.diameter + self.tool_diameter) / 2.0 - radius + AIR_MM;
                let lead = clear.max(self.tool_diameter / 2.0);
                let centre = [start[0] + lead, self.y];
                // On a quarter of a circle, as steep as the helix.
                let rise = (self.pitch * lead / (4.0 * radius)).min(self.pitch / 4.0);
                let place = |along: f64| [centre[0], self.y + along * lead];
                (place(-ahead), place(ahead), centre, rise)
            }
        };
        let turns = steps(self.depth - rise, self.pitch);
        let low = self.top - self.depth + rise;
        let high = low + f64::from(turns) * self.pitch;
        let (begin, end, rise) = if up { (low, high, rise) } else { (high, low, -rise) };
        let turning = counter_clockwise == inside;
        writer.approach(from)?;
        writer.plunge(begin - rise, self.plunge_feed)?;
        writer.arc(turning, start, Some(begin), centre, self.feed)?;
        for turn in 1..=turns {
            let z = begin + (end - begin) * f64::from(turn) / f64::from(turns);
            writer.arc(counter_clockwise, start, Some(z), axis, self.feed)?;
        }
        writer.arc(turning, to, Some(end + rise), centre, self.feed)?;
        writer.retract()
    }
}
