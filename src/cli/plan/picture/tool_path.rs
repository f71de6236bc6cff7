//! The tool path, coloured by speed.
//!
//! Flat programs are seen from above, others isometrically; one scale for all axes.

use super::{EDGE, WIDTH};
use crate::cli::plan::run_down::Work;
use crate::service::plot::PlotError;
use crate::service::plot::canvas::{Area, FINE, INK, fine, line, number, round_up, stroke, text, thin_out};
use motion::canon::Axis;
use plotters::prelude::*;
use plotters::style::text_anchor::HPos;

/// Points of the picture at the most; above it, details are left out.
const POINTS_MAX: usize = 9000;
/// Steps of colour.
const COLOURS: usize = 32;
const RAPID: RGBColor = RGBColor(0xB8, 0xB8, 0xB8);
/// Room for the colour bar.
const BAR_WIDTH: i32 = 110;
const HEIGHT: f64 = 560.0;
/// A program is flat where its Z moves by less than this part of X and Y while it cuts.
const FLAT: f64 = 0.02;

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
}

impl View {
    pub(super) fn of(work: &Work) -> View {
        let cuts = || work.cycles.iter().filter(|cycle| cycle.moving && !cycle.rapid);
        let extent = |axis: Axis| {
            let ends = |(low, high): (f64, f64), at: f64| (low.min(at), high.max(at));
            let all = cuts()
                .map(|cycle| cycle.position[axis])
                .fold((f64::INFINITY, f64::NEG_INFINITY), ends);
            (all.1 - all.0).max(0.0)
        };
        let isometric = extent(Axis::Z) > FLAT * extent(Axis::X).max(extent(Axis::Y));
        let project = |x: f64, y: f64, z: f64| {
            if isometric {
                let (sin, cos) = std::f64::consts::FRAC_PI_6.sin_cos();
                // Seen from the front right above: X to the right and down, Y to the right and up.
                ((x + y) * cos, (y - x) * sin + z)
            } else {
                (x, y)
            }
        };
        let speed_max = round_up_finely(cuts().map(|cycle| cycle.speed_mm_s).fold(0.0, f64::max));
        let colour = |speed: f64| ((speed / speed_max * COLOURS as f64) as usize).min(COLOURS - 1);
        let mut runs: Vec<Run> = Vec::new();
        let mut last = None;
        for cycle in work.cycles.iter().filter(|cycle| cycle.moving) {
            let position = &cycle.position;
            let at = project(position[Axis::X], position[Axis::Y], position[Axis::Z]);
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
        let room = f64::from(WIDTH) - f64::from(2 * EDGE + BAR_WIDTH);
        let (across, up) = ((right - left).max(1e-3), (top - bottom).max(1e-3));
        let pixels_per_mm = if left <= right {
            (room / across).min(HEIGHT / up)
        } else {
            1.0
        };
        for (_, points) in &mut runs {
            for (x, y) in points {
                (*x, *y) = ((*x - left) * pixels_per_mm, (top - *y) * pixels_per_mm);
            }
        }
        let count = |runs: &[Run]| runs.iter().map(|(_, points)| points.len()).sum::<usize>();
        // Half of the finest step of the picture, then coarser until it is small enough.
        let mut tolerance = 0.5 / f64::from(FINE);
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
        }
    }

    pub(super) fn height(&self) -> i32 {
        self.height.ceil() as i32 + 50
    }

    pub(super) fn draw(&self, root: &Area<'_>, top: i32) -> Result<(), PlotError> {
        let room = f64::from(WIDTH) - f64::from(2 * EDGE + BAR_WIDTH);
        let left = f64::from(EDGE) + (room - self.width) / 2.0;
        let place = |(x, y): &(f64, f64)| {
            let scale = f64::from(FINE);
            (
                ((x + left) * scale).round() as i32,
                ((y + f64::from(top)) * scale).round() as i32,
            )
        };
        // Rapid moves lie below, so that no cut is hidden.
        for rapid in [true, false] {
            for (colour, points) in self.runs.iter().filter(|(colour, _)| colour.is_none() == rapid) {
                let style = match colour {
                    None => stroke(RAPID, 0.8),
                    Some(colour) => stroke(speed_colour((*colour as f64 + 0.5) / COLOURS as f64), 2.0),
                };
                let path = PathElement::new(points.iter().map(place).collect::<Vec<_>>(), style);
                root.draw(&path).map_err(PlotError::new)?;
            }
        }
        self.draw_scale(root, top + self.height.ceil() as i32 + 14)?;
        self.draw_bar(root, top)
    }

    /// A bar of a round length, and how the path is seen.
    fn draw_scale(&self, root: &Area<'_>, top: i32) -> Result<(), PlotError> {
        let length_mm = round_up(60.0 / self.pixels_per_mm);
        let pixels = (length_mm * self.pixels_per_mm).round() as i32;
        line(root, (EDGE, top + 8), (EDGE + pixels, top + 8), stroke(INK, 1.2))?;
        for x in [EDGE, EDGE + pixels] {
            line(root, (x, top + 4), (x, top + 12), stroke(INK, 1.2))?;
        }
        let view = if self.isometric {
            "isometric, X to the right below, Y to the right above"
        } else {
            "XY"
        };
        let words = format!("{} mm; {view}", number(length_mm));
        text(root, (EDGE + pixels + 10, top), &words, 12, INK, HPos::Left)
    }

    fn draw_bar(&self, root: &Area<'_>, top: i32) -> Result<(), PlotError> {
        const STEPS: i32 = 64;
        let height = (self.height as i32).clamp(100, 320);
        let left = WIDTH as i32 - EDGE - BAR_WIDTH + 40;
        text(root, (left - 14, top - 22), "speed, mm/s", 12, INK, HPos::Left)?;
        let at = |step: i32| top + height - height * step / STEPS;
        for step in 0..STEPS {
            let corners = [(fine(left), fine(at(step + 1))), (fine(left + 16), fine(at(step)))];
            let colour = speed_colour((f64::from(step) + 0.5) / f64::from(STEPS));
            root.draw(&Rectangle::new(corners, colour.filled()))
                .map_err(PlotError::new)?;
        }
        for quarter in 0..=4 {
            let y = at(STEPS * quarter / 4);
            line(root, (left + 16, y), (left + 21, y), stroke(INK, 0.8))?;
            let speed = number(self.speed_max * f64::from(quarter) / 4.0);
            text(root, (left + 25, y - 7), &speed, 12, INK, HPos::Left)?;
        }
        let y = top + height + 16;
        line(root, (left - 14, y), (left + 6, y), stroke(RAPID, 1.6))?;
        text(root, (left + 12, y - 7), "rapid", 12, INK, HPos::Left)
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
fn speed_colour(share: f64) -> RGBColor {
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
    RGBColor(mix(from.0, to.0), mix(from.1, to.1), mix(from.2, to.2))
}
