//! Pictures of a run as SVG text: the tool path, commanded and actual, and the SoC period.
//!
//! In:  samples of the [recorder](super::recorder), the report of the [analyser](super::analyser).
//! Out: SVG that any browser shows; small, for points that cannot be told apart are left out.

pub(crate) mod canvas;

use super::analyser::SocReport;
use super::recorder::PathSample;
use crate::rt::jitter::Bucket;
pub use canvas::PlotError;
use canvas::{FINE, GRID, INK, draw, fine, font, line, number, round_up, stroke, text, thin_out};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

/// Points nearer than this to the line through their neighbours are left out, mm.
const TOLERANCE_MM: f64 = 0.005;
/// White left of the name of a vertical axis, and room for the name below a horizontal one, pixels.
const EDGE: i32 = 14;
const BELOW: u32 = 40;
/// Colours that people with any colour vision can tell apart.
const FEED: RGBColor = RGBColor(0x56, 0xB4, 0xE9);
const RAPID: RGBColor = RGBColor(0xE6, 0x9F, 0x00);
const ACTUAL: RGBColor = RGBColor(0x22, 0x22, 0x22);
const BAR: RGBColor = RGBColor(0x00, 0x72, 0xB2);
const NOMINAL: RGBColor = RGBColor(0xD5, 0x5E, 0x00);

/// The path of the tool from above (XY) and from the front (XZ), both to one scale: commanded moves at feed, rapid moves,
/// and the actual path as a thin line over them.
///
/// # Errors
/// If the picture cannot be drawn; not expected for any samples.
pub fn toolpath_svg(title: &str, samples: &[PathSample]) -> Result<String, PlotError> {
    const WIDTH: f64 = 900.0;
    const HEIGHT_XY: f64 = 640.0;
    const LEFT: u32 = 70;
    const RIGHT: u32 = 20;
    const TOP: u32 = 70;
    const BETWEEN: u32 = 70;
    const SHORTEST: f64 = 60.0;

    let samples: Vec<PathSample> = samples
        .iter()
        .copied()
        .filter(|sample| {
            sample
                .command
                .iter()
                .chain(&sample.actual)
                .all(|coordinate| coordinate.is_finite())
        })
        .collect();
    let [mut x, mut y, mut z] = [0, 1, 2].map(|axis| Span::of(&samples, axis));
    let pixels_per_mm = (WIDTH / x.length()).min(HEIGHT_XY / y.length());
    // One scale for all three axes; a short axis gets room around it instead of another scale.
    for span in [&mut x, &mut y, &mut z] {
        span.grow_to(SHORTEST / pixels_per_mm);
    }
    x.grow_to(360.0 / pixels_per_mm); // room for title and legend
    let pixels = |span: Span| (span.length() * pixels_per_mm).round() as u32;
    let (width, height_xy, height_xz) = (pixels(x), pixels(y), pixels(z));
    let size = (LEFT + width + RIGHT, TOP + height_xy + BETWEEN + height_xz + BELOW + 10);

    draw(size, |root| {
        text(root, (20, 14), title, 17, INK, HPos::Left)?;
        let mut at = 20;
        for (name, colour, thick) in [("feed", FEED, 3.5), ("rapid", RAPID, 2.6), ("actual", ACTUAL, 0.6)] {
            line(root, (at, 49), (at + 26, 49), stroke(colour, thick))?;
            text(root, (at + 32, 42), name, 13, INK, HPos::Left)?;
            at += 95;
        }
        for (top, height, vertical, axis, name) in [
            (TOP, height_xy, y, 1, "Y, mm"),
            (TOP + height_xy + BETWEEN, height_xz, z, 2, "Z, mm"),
        ] {
            let panel = root.clone().shrink(
                (fine(EDGE), fine(top as i32)),
                (fine(size.0 - EDGE as u32), fine(height + BELOW)),
            );
            let mut chart = ChartBuilder::on(&panel)
                .set_label_area_size(LabelAreaPosition::Left, fine(LEFT - EDGE as u32))
                .set_label_area_size(LabelAreaPosition::Bottom, fine(BELOW))
                .margin_right(fine(RIGHT))
                .build_cartesian_2d(x.from..x.to, vertical.from..vertical.to)
                .map_err(PlotError::new)?;
            chart
                .configure_mesh()
                .light_line_style(TRANSPARENT)
                .bold_line_style(stroke(GRID, 0.8))
                .axis_style(stroke(INK, 0.8))
                .x_labels((width / 90).clamp(2, 12) as usize)
                .y_labels((height / 45).clamp(2, 14) as usize)
                .x_label_formatter(&|value| number(*value))
                .y_label_formatter(&|value| number(*value))
                .label_style(font(12))
                .axis_desc_style(font(13))
                .set_all_tick_mark_size(fine(4))
                .x_desc("X, mm")
                .y_desc(name)
                .draw()
                .map_err(PlotError::new)?;
            let tolerance_mm = TOLERANCE_MM.max(0.5 / (pixels_per_mm * f64::from(FINE)));
            let command = |sample: &PathSample| (sample.command[0], sample.command[axis]);
            // Feed above rapid, so that a cut is never hidden.
            for (rapid, style) in [(true, stroke(RAPID, 2.6)), (false, stroke(FEED, 3.5))] {
                for run in runs(&samples, rapid, command) {
                    let thinned = thin_out(&run, tolerance_mm);
                    chart
                        .draw_series(std::iter::once(PathElement::new(thinned, style)))
                        .map_err(PlotError::new)?;
                }
            }
            let actual: Vec<_> = samples
                .iter()
                .map(|sample| (sample.actual[0], sample.actual[axis]))
                .collect();
            let thinned = thin_out(&actual, tolerance_mm);
            chart
                .draw_series(std::iter::once(PathElement::new(thinned, stroke(ACTUAL, 0.6))))
                .map_err(PlotError::new)?;
        }
        Ok(())
    })
}

/// How often the SoC came after how long: counts on a logarithmic axis around the nominal period, and the figures.
///
/// # Errors
/// If the picture cannot be drawn; not expected for any report.
pub fn soc_period_svg(report: &SocReport) -> Result<String, PlotError> {
    let nominal_us = f64::from(report.cycle_us);
    let bins = Bins::of(&report.histogram);
    let (from_us, to_us) = (nominal_us + bins.from_us, nominal_us + bins.to_us());
    let most = bins.counts.iter().copied().max().unwrap_or(0).max(1) as f64;
    let size = (900, 520);
    draw(size, |root| {
        text(
            root,
            (20, 14),
            &format!("SoC period at {}", report.interface),
            17,
            INK,
            HPos::Left,
        )?;
        let figures = [
            format!("mean {:.3} µs", report.period_mean_us),
            format!("max range {:.3} µs", report.period_range_us),
            format!("std dev {:.3} µs", report.period_std_us),
            format!("n {}", report.n),
        ];
        for (at, figure) in (20..).step_by(180).zip(&figures) {
            text(root, (at, 40), figure, 13, INK, HPos::Left)?;
        }
        let panel = root
            .clone()
            .shrink((fine(EDGE), fine(86)), (fine(size.0 - EDGE as u32), fine(size.1 - 96)));
        let mut chart = ChartBuilder::on(&panel)
            .set_label_area_size(LabelAreaPosition::Left, fine(76))
            .set_label_area_size(LabelAreaPosition::Bottom, fine(BELOW))
            .margin_right(fine(30))
            .build_cartesian_2d(from_us..to_us, (FLOOR..most * 2.0).log_scale())
            .map_err(PlotError::new)?;
        chart
            .configure_mesh()
            .light_line_style(TRANSPARENT)
            .bold_line_style(stroke(GRID, 0.8))
            .axis_style(stroke(INK, 0.8))
            .x_labels(9)
            .y_labels(8)
            .x_label_formatter(&|value| number(*value))
            .y_label_formatter(&|value| {
                if *value < 0.999 {
                    String::new()
                } else {
                    format!("{value:.0}")
                }
            })
            .label_style(font(12))
            .axis_desc_style(font(13))
            .set_all_tick_mark_size(fine(4))
            .x_desc(format!("period, µs (one bar: {} µs)", number(bins.width_us)))
            .y_desc("number of periods")
            .draw()
            .map_err(PlotError::new)?;
        let bar = |(index, count): (usize, &u64)| {
            let left_us = from_us + index as f64 * bins.width_us;
            let corners = [(left_us, FLOOR), (left_us + bins.width_us, *count as f64)];
            (*count > 0).then(|| Rectangle::new(corners, BAR.filled()))
        };
        chart
            .draw_series(bins.counts.iter().enumerate().filter_map(bar))
            .map_err(PlotError::new)?;
        let nominal = PathElement::new(
            vec![(nominal_us, FLOOR), (nominal_us, most * 2.0)],
            stroke(NOMINAL, 1.0),
        );
        chart.draw_series(std::iter::once(nominal)).map_err(PlotError::new)?;
        let (x, y) = chart.backend_coord(&(nominal_us, most * 2.0));
        let label = Text::new(
            format!("nominal {} µs", report.cycle_us),
            (x, y - fine(4)),
            font(12).color(&NOMINAL).pos(Pos::new(HPos::Center, VPos::Bottom)),
        );
        root.draw(&label).map_err(PlotError::new)
    })
}

/// Foot of the bars: a bar of one period must be seen.
const FLOOR: f64 = 0.7;

/// Range of an axis with some room around, mm.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Span {
    from: f64,
    to: f64,
}

impl Span {
    fn of(samples: &[PathSample], axis: usize) -> Span {
        let all = samples
            .iter()
            .flat_map(|sample| [sample.command[axis], sample.actual[axis]]);
        let (from, to) = all.fold((f64::INFINITY, f64::NEG_INFINITY), |(from, to), at| {
            (from.min(at), to.max(at))
        });
        if from > to {
            return Span { from: -5.0, to: 5.0 };
        }
        let mut span = Span { from, to };
        span.grow_to((to - from) * 1.06);
        span.grow_to(0.1);
        span
    }

    fn length(self) -> f64 {
        self.to - self.from
    }

    fn grow_to(&mut self, length: f64) {
        let missing = (length - self.length()).max(0.0);
        self.from -= missing / 2.0;
        self.to += missing / 2.0;
    }
}

/// The stretches of a path that are rapid, or that are not; each begins where the one before ends.
fn runs(samples: &[PathSample], rapid: bool, at: impl Fn(&PathSample) -> (f64, f64)) -> Vec<Vec<(f64, f64)>> {
    let mut runs: Vec<Vec<(f64, f64)>> = Vec::new();
    let mut before: Option<&PathSample> = None;
    for sample in samples {
        if sample.rapid == rapid {
            match (runs.last_mut(), before) {
                (Some(run), Some(before)) if before.rapid == rapid => run.push(at(sample)),
                (_, before) => runs.push(before.into_iter().chain([sample]).map(&at).collect()),
            }
        }
        before = Some(sample);
    }
    runs
}

/// Counts in bars of one width, µs from nominal.
#[derive(Clone, Debug, PartialEq)]
struct Bins {
    from_us: f64,
    width_us: f64,
    counts: Vec<u64>,
}

impl Bins {
    fn of(histogram: &[Bucket]) -> Bins {
        let us = |ns: i64| ns as f64 / 1000.0;
        // The last bucket of all is open; the analyser never fills it, for it leaves out gaps.
        let first_us = histogram.first().map_or(-1.0, |bucket| us(bucket.from_ns)).min(-1.0);
        let last_us = histogram.last().map_or(1.0, |bucket| us(bucket.to_ns)).clamp(1.0, 1e9);
        let widest_us = histogram
            .iter()
            .map(|bucket| us(bucket.to_ns.saturating_sub(bucket.from_ns)))
            .fold(0.0, f64::max);
        // Not much narrower than a bucket: empty bars between full ones would show nothing but the rounding.
        let width_us = round_up(((last_us - first_us) / 120.0).max(widest_us.min(1e7) / 1.5));
        // One bar has nominal in its middle.
        let from_us = ((first_us / width_us).floor() - 0.5) * width_us;
        let bars = ((last_us - from_us) / width_us).ceil() as usize + 1;
        let mut counts = vec![0; bars];
        for bucket in histogram {
            let middle_us = (us(bucket.from_ns) + us(bucket.to_ns)) / 2.0;
            let bar = ((middle_us - from_us) / width_us).clamp(0.0, (bars - 1) as f64) as usize;
            counts[bar] += bucket.count;
        }
        Bins {
            from_us,
            width_us,
            counts,
        }
    }

    fn to_us(&self) -> f64 {
        self.from_us + self.width_us * self.counts.len() as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(x: f64, y: f64, z: f64, rapid: bool) -> PathSample {
        PathSample {
            command: [x, y, z],
            actual: [x + 0.001, y, z],
            rapid,
            line: 1,
        }
    }

    #[test]
    fn runs_join_where_the_kind_of_move_changes() {
        let samples = [(0.0, true), (1.0, true), (2.0, false), (3.0, false), (4.0, true)]
            .map(|(x, rapid)| sample(x, 0.0, 0.0, rapid));
        let x = |rapid| -> Vec<Vec<f64>> {
            let runs = runs(&samples, rapid, |sample| (sample.command[0], sample.command[1]));
            runs.iter()
                .map(|run| run.iter().map(|point| point.0).collect())
                .collect()
        };
        assert_eq!(x(true), [vec![0.0, 1.0], vec![3.0, 4.0]]);
        assert_eq!(x(false), [[1.0, 2.0, 3.0]]);
    }

    #[test]
    fn bars_are_of_a_round_width_and_hold_all_periods() {
        let bucket = |from_ns, to_ns, count| Bucket { from_ns, to_ns, count };
        let bins = Bins::of(&[
            bucket(-9_000, -8_900, 1),
            bucket(0, 0, 500),
            bucket(90, 90, 7),
            bucket(6_000, 6_100, 2),
        ]);
        assert_eq!(bins.width_us, 0.2);
        assert_eq!(bins.counts.iter().sum::<u64>(), 510);
        assert_eq!(*bins.counts.iter().max().unwrap(), 507);
        let empty = Bins::of(&[]);
        assert_eq!(empty.counts.iter().sum::<u64>(), 0);
        assert!(empty.from_us <= -1.0 && empty.to_us() >= 1.0);
        assert_eq!([0.012, 0.02, 3.0, 70.0].map(round_up), [0.02, 0.02, 5.0, 100.0]);
    }

    /// The parts of an SVG that say where the picture shows a path.
    fn polylines(svg: &str) -> usize {
        svg.matches("<polyline").count()
    }

    #[test]
    fn the_picture_is_complete_and_small() {
        let mut samples = Vec::new();
        for i in 0..60_000 {
            let angle = f64::from(i) * 0.001;
            samples.push(sample(
                50.0 * angle.cos(),
                30.0 * angle.sin(),
                -0.0001 * f64::from(i),
                i % 20_000 < 500,
            ));
        }
        let svg = toolpath_svg("bracket <1> & \"2\".ngc", &samples).unwrap();
        assert!(
            svg.contains("bracket &lt;1&gt; &amp; &quot;2&quot;.ngc"),
            "{}",
            &svg[..600]
        );
        for word in ["feed", "rapid", "actual", "X, mm", "Y, mm", "Z, mm"] {
            assert!(svg.contains(word), "{word}");
        }
        assert!(svg.len() < 200_000, "{} octets", svg.len());
        // Two views of three rapid runs, three feed runs and the actual path, and three lines in the legend at least.
        assert!(polylines(&svg) >= 17, "{}", polylines(&svg));
        assert!(svg.starts_with("<svg width=\"") && svg.trim_end().ends_with("</svg>"));
    }

    #[test]
    fn strange_paths_are_drawn_too() {
        for samples in [
            vec![],
            vec![sample(1.0, 2.0, 3.0, false)],
            vec![sample(f64::NAN, 0.0, 0.0, false), sample(0.0, 0.0, 0.0, true)],
            vec![sample(-1e6, 0.0, 0.0, false), sample(1e6, 1e-9, 0.0, false)],
            vec![sample(0.0, -1e6, 0.0, false), sample(0.0, 1e6, 1e6, false)],
        ] {
            let svg = toolpath_svg("strange", &samples).unwrap();
            assert!(svg.len() < 100_000);
        }
    }
}
