//! The tool path, coloured by speed.
//!
//! Flat programs are seen from above, others isometrically; one scale for all axes.

use super::{EDGE, Place, WIDTH};
use crate::judge::Cycle;
use motion::canon::{Axis, Position};
use plot::lines::{number, round_up, thin_out};
use plot::sheet::{Anchor, Sheet};
use plot::{BODY, INK, RAPID, SMALL};

/// Points of the picture at the most; above it, details are left out.
const POINTS_MAX: usize = 9000;
/// Steps of colour.
const COLOURS: usize = 32;
const RAPID_DASHES: &str = "6 4";
/// Room for the colour bar.
const BAR_WIDTH: f64 = 150.0;
const HEIGHT: f64 = 560.0;
/// A program is flat where its Z moves by less than this part of X and Y while it cuts.
const FLAT: f64 = 0.02;
/// Below the path: scale, axes, marks.
const BELOW: f64 = 104.0;
const ARROW: f64 = 44.0;

/// A stretch of one colour, with its points; rapid ones have none.
type Run = (Option<usize>, Vec<(f64, f64)>);

/// What is seen, in pixels.
pub(super) struct View {
    runs: Vec<Run>,
    /// Extents of the drawn path.
    width: f64,
    height: f64,
    pixels_per_mm: f64,
    isometric: bool,
    speed_max: f64,
    /// Where the path begins and ends.
    ends: Option<[(f64, f64); 2]>,
    /// X0 Y0 Z0 of G54, where that is in the picture.
    zero: Option<(f64, f64)>,
    /// Places with a number.
    places: Vec<(f64, f64)>,
}

/// A place of the machine as it is seen, mm to the right and up.
fn project(isometric: bool, x: f64, y: f64, z: f64) -> (f64, f64) {
    if isometric {
        let (sin, cos) = std::f64::consts::FRAC_PI_6.sin_cos();
        // Seen from the front right above: X to the right and down, Y to the right and up.
        ((x + y) * cos, (y - x) * sin + z)
    } else {
        (x, y)
    }
}

impl View {
    /// `moving`: cycles in motion; `isometric`: whether it is seen so, else as fits.
    pub(super) fn new(moving: &[Cycle], origin: Position, isometric: Option<bool>, places: &[Place]) -> View {
        let cuts = || moving.iter().filter(|cycle| !cycle.rapid);
        let extent = |axis: Axis| {
            let ends = |(low, high): (f64, f64), at: f64| (low.min(at), high.max(at));
            let all = cuts()
                .map(|cycle| cycle.position[axis])
                .fold((f64::INFINITY, f64::NEG_INFINITY), ends);
            (all.1 - all.0).max(0.0)
        };
        let isometric = isometric.unwrap_or_else(|| extent(Axis::Z) > FLAT * extent(Axis::X).max(extent(Axis::Y)));
        let project = |at: &Position| project(isometric, at[Axis::X], at[Axis::Y], at[Axis::Z]);
        let speed_max = round_up_finely(cuts().map(|cycle| cycle.speed_mm_s).fold(0.0, f64::max));
        let colour = |speed: f64| ((speed / speed_max * COLOURS as f64) as usize).min(COLOURS - 1);
        let mut runs: Vec<Run> = Vec::new();
        let mut last = None;
        for cycle in moving {
            let at = project(&cycle.position);
            let colour = (!cycle.rapid).then(|| colour(cycle.speed_mm_s));
            match runs.last_mut() {
                Some((of_run, points)) if *of_run == colour => points.push(at),
                // Begins where the one before ends.
                _ => runs.push((colour, last.into_iter().chain([at]).collect())),
            }
            last = Some(at);
        }
        let points = || runs.iter().flat_map(|(_, points)| points);
        let least = |of: fn(&(f64, f64)) -> f64| points().map(of).fold(f64::INFINITY, f64::min);
        let most = |of: fn(&(f64, f64)) -> f64| points().map(of).fold(f64::NEG_INFINITY, f64::max);
        let (left, right, bottom, top) = (least(|p| p.0), most(|p| p.0), least(|p| p.1), most(|p| p.1));
        let room = WIDTH - 2.0 * EDGE - BAR_WIDTH;
        let (across, up) = ((right - left).max(1e-3), (top - bottom).max(1e-3));
        let pixels_per_mm = if left <= right {
            (room / across).min(HEIGHT / up)
        } else {
            1.0
        };
        let pixels = |(x, y): (f64, f64)| ((x - left) * pixels_per_mm, (top - y) * pixels_per_mm);
        for (_, points) in &mut runs {
            points.iter_mut().for_each(|point| *point = pixels(*point));
        }
        let first = runs.first().and_then(|(_, points)| points.first()).copied();
        let ends = first.zip(last.map(pixels)).map(|(first, last)| [first, last]);
        let zero = project(&origin);
        let inside = (left..=right).contains(&zero.0) && (bottom..=top).contains(&zero.1);
        let count = |runs: &[Run]| runs.iter().map(|(_, points)| points.len()).sum::<usize>();
        // Half of the finest step of the picture, then coarser until it is small enough.
        let mut tolerance = 0.06;
        while count(&runs) > POINTS_MAX && tolerance < 2.0 {
            runs = runs
                .into_iter()
                .map(|(colour, points)| (colour, thin_out(&points, tolerance)))
                .collect();
            runs = join_short(runs, tolerance);
            tolerance *= 1.5;
        }
        let drawn = left <= right;
        View {
            runs,
            width: if drawn { across * pixels_per_mm } else { 0.0 },
            height: if drawn { (up * pixels_per_mm).max(40.0) } else { 40.0 },
            pixels_per_mm,
            isometric,
            speed_max,
            ends,
            zero: inside.then(|| pixels(zero)),
            places: (places.iter())
                .map(|place| {
                    let [x, y, z] = place.at_mm;
                    pixels(self::project(isometric, x, y, z))
                })
                .collect(),
        }
    }

    pub(super) fn height(&self) -> f64 {
        self.height.ceil() + BELOW
    }

    pub(super) fn draw(&self, sheet: &mut Sheet, top: f64, places: &[Place]) {
        let room = WIDTH - 2.0 * EDGE - BAR_WIDTH;
        let left = EDGE + (room - self.width) / 2.0;
        let place = |(x, y): &(f64, f64)| (x + left, y + top);
        // Rapid moves lie below, so that no cut is hidden.
        for rapid in [true, false] {
            for (colour, points) in self.runs.iter().filter(|(colour, _)| colour.is_none() == rapid) {
                let points: Vec<(f64, f64)> = points.iter().map(place).collect();
                match colour {
                    None => sheet.path(&points, RAPID, 1.0, RAPID_DASHES),
                    Some(colour) => {
                        let colour = speed_colour((*colour as f64 + 0.5) / COLOURS as f64);
                        sheet.path(&points, &colour, 2.0, "");
                    }
                }
            }
        }
        if let Some(zero) = self.zero {
            draw_zero(sheet, place(&zero));
        }
        for (end, filled) in self
            .ends
            .iter()
            .flat_map(|[first, last]| [(first, false), (last, true)])
        {
            sheet.dot(place(end), 5.0, INK, filled);
        }
        for (at, of) in self.places.iter().zip(places) {
            of.mark(sheet, place(at));
        }
        self.draw_legend(sheet, top + self.height.ceil() + 30.0);
        self.draw_bar(sheet, top);
    }

    /// A bar of a round length, the axes as they are seen, what the marks mean.
    fn draw_legend(&self, sheet: &mut Sheet, top: f64) {
        let length_mm = round_up(60.0 / self.pixels_per_mm);
        let pixels = length_mm * self.pixels_per_mm;
        let y = top + 30.0;
        sheet.line((EDGE, y), (EDGE + pixels, y), INK, 1.2, "");
        for x in [EDGE, EDGE + pixels] {
            sheet.line((x, y - 4.0), (x, y + 4.0), INK, 1.2, "");
        }
        sheet.text(
            (EDGE + pixels + 10.0, y + 4.0),
            BODY,
            &format!("{} mm", number(length_mm)),
        );
        let corner = (EDGE + 300.0, y + 8.0);
        let axes = [("X", (1.0, 0.0, 0.0)), ("Y", (0.0, 1.0, 0.0)), ("Z", (0.0, 0.0, 1.0))];
        for (name, (x, y, z)) in axes.into_iter().take(if self.isometric { 3 } else { 2 }) {
            let (right, up) = project(self.isometric, x, y, z);
            let tip = (corner.0 + ARROW * right, corner.1 - ARROW * up);
            sheet.line(corner, tip, INK, 1.2, "");
            let side = (-up * 3.5, -right * 3.5);
            let back = (tip.0 - 9.0 * right, tip.1 + 9.0 * up);
            let barbs = [(back.0 + side.0, back.1 + side.1), (back.0 - side.0, back.1 - side.1)];
            sheet.area(&[tip, barbs[0], barbs[1]], INK);
            let name_at = (tip.0 + 9.0 * right, tip.1 - 9.0 * up + 4.0);
            sheet.text(name_at, BODY.at(Anchor::Middle), name);
        }
        let mut x = EDGE + 420.0;
        for (name, filled) in [("start", false), ("end", true)] {
            sheet.dot((x, y), 5.0, INK, filled);
            sheet.text((x + 12.0, y + 4.0), BODY, name);
            x += 80.0;
        }
        sheet.line((x - 8.0, y), (x + 20.0, y), RAPID, 1.4, RAPID_DASHES);
        sheet.text((x + 28.0, y + 4.0), BODY, "rapid");
        x += 110.0;
        match self.zero {
            Some(_) => {
                draw_zero(sheet, (x, y));
                sheet.text((x + 14.0, y + 4.0), BODY, "X0 Y0 Z0 of G54");
            }
            None => sheet.text((x, y + 4.0), BODY, "X0 Y0 Z0 of G54 is outside"),
        }
    }

    fn draw_bar(&self, sheet: &mut Sheet, top: f64) {
        const STEPS: i32 = 64;
        let height = self.height.clamp(100.0, 320.0);
        let left = WIDTH - EDGE - BAR_WIDTH + 60.0;
        sheet.text((left - 14.0, top - 10.0), SMALL, "speed, mm/s");
        let at = |step: i32| top + height * (1.0 - f64::from(step) / f64::from(STEPS));
        for step in 0..STEPS {
            let colour = speed_colour((f64::from(step) + 0.5) / f64::from(STEPS));
            // A little over the next one: no white between them.
            sheet.rectangle((left, at(step + 1)), (left + 16.0, at(step) + 0.3), &colour);
        }
        for quarter in 0..=4 {
            let y = at(STEPS * quarter / 4);
            sheet.line((left + 16.0, y), (left + 21.0, y), INK, 0.8, "");
            let speed = number(self.speed_max * f64::from(quarter) / 4.0);
            sheet.text((left + 25.0, y + 4.0), SMALL, &speed);
        }
    }
}

/// The mark of a zero: a circle whose quarters are full and empty in turn.
fn draw_zero(sheet: &mut Sheet, (x, y): (f64, f64)) {
    const RADIUS: f64 = 7.0;
    sheet.dot((x, y), RADIUS, INK, false);
    for quarter in [0, 2] {
        let arc = (0..=6).map(|step| (f64::from(quarter) + f64::from(step) / 6.0) * std::f64::consts::FRAC_PI_2);
        let arc = arc.map(|angle| (x + RADIUS * angle.cos(), y - RADIUS * angle.sin()));
        let area: Vec<(f64, f64)> = std::iter::once((x, y)).chain(arc).collect();
        sheet.area(&area, INK);
    }
}

/// Runs shorter than what is left out take the colour of the one before.
fn join_short(runs: Vec<Run>, tolerance: f64) -> Vec<Run> {
    let mut joined: Vec<Run> = Vec::new();
    for (colour, points) in runs {
        let length: f64 = points
            .windows(2)
            .map(|ends| (ends[1].0 - ends[0].0).hypot(ends[1].1 - ends[0].1))
            .sum();
        match joined.last_mut() {
            Some((before, all))
                if *before == colour || (length < 8.0 * tolerance && before.is_some() && colour.is_some()) =>
            {
                all.extend(points.into_iter().skip(1));
            }
            _ => joined.push((colour, points)),
        }
    }
    joined
}

/// Up to two significant digits.
fn round_up_finely(value: f64) -> f64 {
    if value <= 0.0 || !value.is_finite() {
        return 1.0;
    }
    let step = 10f64.powf(value.log10().floor()) / 10.0;
    (value / step * 0.999_999).ceil() * step
}

/// From slow (dark violet) over blue and green to fast (yellow): even steps of lightness, for any colour vision and for
/// print without colour.
fn speed_colour(share: f64) -> String {
    const STOPS: [(u8, u8, u8); 9] = [
        (0x44, 0x01, 0x54),
        (0x48, 0x28, 0x78),
        (0x3E, 0x4A, 0x89),
        (0x31, 0x68, 0x8E),
        (0x26, 0x82, 0x8E),
        (0x1F, 0x9E, 0x89),
        (0x35, 0xB7, 0x79),
        (0x6E, 0xCE, 0x58),
        (0xE0, 0xD0, 0x20),
    ];
    let at = share.clamp(0.0, 1.0) * (STOPS.len() - 1) as f64;
    let index = (at as usize).min(STOPS.len() - 2);
    let part = at - index as f64;
    let mix = |from: u8, to: u8| (f64::from(from) + part * (f64::from(to) - f64::from(from))).round() as u8;
    let (from, to) = (STOPS[index], STOPS[index + 1]);
    format!(
        "#{:02x}{:02x}{:02x}",
        mix(from.0, to.0),
        mix(from.1, to.1),
        mix(from.2, to.2)
    )
}
