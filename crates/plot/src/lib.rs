//! Pictures of a run, and the page that shows all of them: the tool path as it was commanded, and how far from it the machine
//! was.
//!
//! In:  samples of the recorder, pictures of others.
//! Out: SVG and HTML that any browser shows; small, for points that cannot be told apart are left out.
//!
//! Everything is drawn on one kind of sheet (`sheet.rs`).

// What is public here is so for the program and its tests, and says more than its name only where there is more to say.
#![allow(missing_docs)]

pub mod chart;
pub mod circle;
pub mod lines;
pub mod sheet;

use lines::{number, round_up, thin_out};
use sheet::{Anchor, Face, Sheet, escaped};

/// Room of the views, pixels; white around them.
const WIDTH: f64 = 1000.0;
const LEFT: f64 = 78.0;
const RIGHT: f64 = 970.0;
/// Of both views together.
const HEIGHT_MAX: f64 = 800.0;
const HEIGHT_MIN: f64 = 60.0;
/// Between two views: numbers and name of an axis.
const BELOW: f64 = 62.0;
const STRIP: f64 = 110.0;
/// Least distance of two lines of the grid, pixels.
const GRID_STEP: f64 = 45.0;
/// Points nearer than this to the line through their neighbours are left out, pixels.
const TOLERANCE: f64 = 0.1;
/// How many cycles a drive may be behind its command, and be on its path all the same.
const BEHIND_CYCLES: usize = 64;

/// Colours that people with any colour vision can tell apart.
pub const INK: &str = "#222222";
pub const GRID: &str = "#e2e2e2";
const FEED: &str = "#0072b2";
pub const RAPID: &str = "#d08000";
const OFF: &str = "#d55e00";
pub const TITLE: Face = Face::new(20.0, INK).bold();
pub const BODY: Face = Face::new(13.0, INK);
pub const SMALL: Face = Face::new(12.0, INK);

/// A cycle of a program; positions in the machine, mm or degrees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathSample {
    /// Commanded X, Y, Z.
    pub command: [f64; 3],
    /// Actual X, Y, Z.
    pub actual: [f64; 3],
    /// Whether the move is a rapid one.
    pub rapid: bool,
    /// Line of the program.
    pub line: u32,
}

impl PathSample {
    /// Square of the distance from the commanded to the actual position.
    pub fn off2(&self) -> f64 {
        let axes = self.command.iter().zip(&self.actual);
        axes.map(|(command, actual)| (command - actual).powi(2)).sum()
    }

    /// The one whose actual position is further off; of equals the first.
    pub fn further_off(self, other: PathSample) -> PathSample {
        if other.off2() > self.off2() { other } else { self }
    }
}

/// The path of the tool from above (XY) and from the front (XZ), both to one scale, as it was commanded; below it, over time,
/// how far the actual position was from the commanded path, which lies on straight lines between samples. `sample_s`: time from
/// one to the next.
pub fn toolpath_svg(title: &str, samples: &[PathSample], sample_s: f64) -> String {
    let finite = |sample: &&PathSample| {
        let mut coordinates = sample.command.iter().chain(&sample.actual);
        coordinates.all(|coordinate| coordinate.is_finite())
    };
    let samples: Vec<PathSample> = samples.iter().filter(finite).copied().collect();
    let mut sheet = Sheet::new(WIDTH);
    sheet.text((24.0, 36.0), TITLE, title);
    let mut x = 24.0;
    for (name, colour, dashes) in [("feed", FEED, ""), ("rapid", RAPID, "5 3")] {
        sheet.line((x, 58.0), (x + 28.0, 58.0), colour, 2.0, dashes);
        sheet.text((x + 34.0, 62.0), BODY, name);
        x += 95.0;
    }
    for (name, filled) in [("start", false), ("end", true)] {
        sheet.dot((x + 6.0, 58.0), 5.0, INK, filled);
        sheet.text((x + 18.0, 62.0), BODY, name);
        x += 70.0;
    }
    sheet.text((x, 62.0), BODY, "both views: positions of the machine, as commanded");

    let [mut across, mut y, mut z] = [0, 1, 2].map(|axis| Span::covering(&samples, axis));
    let pixels_per_mm = ((RIGHT - LEFT) / across.length()).min(HEIGHT_MAX / (y.length() + z.length()));
    // One scale for all three axes; a short axis gets room around it instead of another scale.
    across.grow_to((RIGHT - LEFT) / pixels_per_mm);
    for span in [&mut y, &mut z] {
        span.grow_to(HEIGHT_MIN / pixels_per_mm);
    }
    let mut top = 84.0;
    for (span, axis, name) in [(y, 1, "Y, mm"), (z, 2, "Z, mm")] {
        let view = View {
            across,
            up: span,
            pixels_per_mm,
            top,
        };
        view.draw(&mut sheet, &samples, axis, name);
        top = view.bottom() + BELOW;
    }
    let bottom = strip(&mut sheet, &samples, sample_s, top + 6.0);
    sheet.finish(bottom + 12.0)
}

/// A view of the path.
struct View {
    across: Span,
    up: Span,
    pixels_per_mm: f64,
    top: f64,
}

impl View {
    fn bottom(&self) -> f64 {
        self.top + self.up.length() * self.pixels_per_mm
    }

    fn place(&self, (x, y): (f64, f64)) -> (f64, f64) {
        let right = (x - self.across.from) * self.pixels_per_mm;
        (LEFT + right, self.bottom() - (y - self.up.from) * self.pixels_per_mm)
    }

    fn draw(&self, sheet: &mut Sheet, samples: &[PathSample], axis: usize, name: &str) {
        let (top, bottom) = (self.top, self.bottom());
        // The same step both ways.
        let step_mm = round_up(GRID_STEP / self.pixels_per_mm);
        for x_mm in self.across.multiples(step_mm) {
            let (x, _) = self.place((x_mm, 0.0));
            sheet.line((x, top), (x, bottom), GRID, 1.0, "");
            sheet.text((x, bottom + 17.0), SMALL.at(Anchor::Middle), &number(x_mm));
        }
        for up_mm in self.up.multiples(step_mm) {
            let (_, y) = self.place((0.0, up_mm));
            sheet.line((LEFT, y), (RIGHT, y), GRID, 1.0, "");
            sheet.text((LEFT - 7.0, y + 4.0), SMALL.at(Anchor::End), &number(up_mm));
        }
        sheet.path(&[(LEFT, top), (LEFT, bottom), (RIGHT, bottom)], INK, 1.0, "");
        sheet.text(((LEFT + RIGHT) / 2.0, bottom + 36.0), BODY.at(Anchor::Middle), "X, mm");
        sheet.text((16.0, top + 4.0), BODY, name);
        let at = |sample: &PathSample| self.place((sample.command[0], sample.command[axis]));
        // Feed above rapid, so that a cut is never hidden.
        for (rapid, colour, dashes) in [(true, RAPID, "5 3"), (false, FEED, "")] {
            for run in runs(samples, rapid, at) {
                sheet.path(&thin_out(&run, TOLERANCE), colour, 1.4, dashes);
            }
        }
        for (sample, filled) in [(samples.first(), false), (samples.last(), true)] {
            if let Some(sample) = sample {
                sheet.dot(at(sample), 5.0, INK, filled);
            }
        }
    }
}

/// How far from the path, over time; gives the lower end.
fn strip(sheet: &mut Sheet, samples: &[PathSample], sample_s: f64, top: f64) -> f64 {
    let off_um = off_path_um(samples);
    let most = off_um.iter().copied().enumerate().max_by(|a, b| a.1.total_cmp(&b.1));
    let told = match most {
        Some((at, um)) => format!(": {um:.1} um at most, in line {}", samples[at].line),
        None => String::new(),
    };
    sheet.text(
        (24.0, top),
        BODY,
        &format!("Actual position off the commanded path{told}"),
    );
    let (ceiling, base) = (top + 14.0, top + 14.0 + STRIP);
    let most_um = off_um.iter().copied().fold(1.0, f64::max);
    let step_um = round_up(most_um / 4.0);
    let y = |um: f64| base - um / most_um * STRIP;
    for um in (0..=(most_um / step_um) as u32).map(|k| f64::from(k) * step_um) {
        sheet.line((LEFT, y(um)), (RIGHT, y(um)), GRID, 1.0, "");
        sheet.text((LEFT - 7.0, y(um) + 4.0), SMALL.at(Anchor::End), &number(um));
    }
    sheet.text((16.0, (ceiling + base) / 2.0), BODY, "um");
    let end_s = (samples.len().max(2) - 1) as f64 * sample_s;
    let step_s = round_up(end_s / 12.0);
    for time_s in (0..=(end_s / step_s) as u32).map(|k| f64::from(k) * step_s) {
        let x = LEFT + time_s / end_s * (RIGHT - LEFT);
        sheet.line((x, ceiling), (x, base + 4.0), GRID, 1.0, "");
        sheet.text((x, base + 17.0), SMALL.at(Anchor::Middle), &number(time_s));
    }
    let columns = (RIGHT - LEFT) as usize;
    let highest = |column: usize| {
        let range = column * off_um.len() / columns..(column + 1) * off_um.len() / columns;
        off_um[range].iter().copied().reduce(f64::max)
    };
    let points = (0..columns).filter_map(|column| Some((LEFT + column as f64 + 0.5, y(highest(column)?))));
    let points: Vec<(f64, f64)> = points.collect();
    sheet.path(&thin_out(&points, TOLERANCE), OFF, 1.2, "");
    sheet.path(&[(LEFT, ceiling), (LEFT, base), (RIGHT, base)], INK, 1.0, "");
    let middle = (LEFT + RIGHT) / 2.0;
    sheet.text((middle, base + 36.0), BODY.at(Anchor::Middle), "time, s");
    base + 40.0
}

/// Distance of each actual position from the commanded path, which may be ahead by some cycles, um.
fn off_path_um(samples: &[PathSample]) -> Vec<f64> {
    let last = samples.len().saturating_sub(1);
    let off_mm = |at: usize| {
        let actual = samples[at].actual;
        let near = at.saturating_sub(BEHIND_CYCLES)..(at + 1).min(last);
        let to_commands = near.map(|at| to_segment(actual, samples[at].command, samples[at + 1].command));
        to_commands.fold(distance(actual, samples[at].command), f64::min)
    };
    (0..samples.len()).map(|at| off_mm(at) * 1e3).collect()
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|axis| (a[axis] - b[axis]).powi(2)).sum::<f64>().sqrt()
}

/// Distance of a point from the straight line between two ends.
fn to_segment(point: [f64; 3], from: [f64; 3], to: [f64; 3]) -> f64 {
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let less = |a: [f64; 3], b: [f64; 3]| [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    let along = less(to, from);
    let share = dot(less(point, from), along) / dot(along, along);
    // Ends that coincide have no direction.
    let share = if share.is_finite() { share.clamp(0.0, 1.0) } else { 0.0 };
    distance(point, [0, 1, 2].map(|axis| from[axis] + share * along[axis]))
}

/// One page with a text and pictures, which needs no other file.
pub fn html(title: &str, text: &str, pictures: &[String]) -> String {
    let pictures: Vec<String> = pictures.iter().map(|svg| format!("<figure>{svg}</figure>\n")).collect();
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<title>{title}</title>\n\
         <style>body {{ font-family: sans-serif; margin: 2em }} figure {{ margin: 2em 0 }} svg {{ max-width: 100%; height: auto }}\
         </style>\n</head>\n<body>\n<h1>{title}</h1>\n<pre>{}</pre>\n{}</body>\n</html>\n",
        escaped_lines(text),
        pictures.concat(),
        title = escaped(title),
    )
}

fn escaped_lines(text: &str) -> String {
    text.lines().map(|line| escaped(line) + "\n").collect()
}

/// Range of an axis with some room around, mm.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Span {
    from: f64,
    to: f64,
}

impl Span {
    fn covering(samples: &[PathSample], axis: usize) -> Span {
        let all = samples.iter().map(|sample| sample.command[axis]);
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

    /// Whole multiples of a step.
    fn multiples(self, step: f64) -> impl Iterator<Item = f64> {
        let (first, last) = ((self.from / step).ceil() as i64, (self.to / step).floor() as i64);
        (first..=last).map(move |k| k as f64 * step)
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

    fn texts(svg: &str) -> Vec<String> {
        let document = roxmltree::Document::parse(svg).unwrap_or_else(|error| panic!("{error}\n{svg}"));
        let texts = document.descendants().filter(|node| node.has_tag_name("text"));
        texts.map(|node| node.text().unwrap_or_default().to_owned()).collect()
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
    fn a_drive_that_is_late_on_its_path_is_behind_and_not_off() {
        let mut samples: Vec<PathSample> = (0..100).map(|x| sample(f64::from(x), 0.0, 0.0, false)).collect();
        for (at, sample) in samples.iter_mut().enumerate() {
            // Ten cycles behind, and from the middle on 2 um beside it.
            sample.actual = [(at as f64 - 10.0).max(0.0), if at < 50 { 0.0 } else { 0.002 }, 0.0];
        }
        let off_um = off_path_um(&samples);
        assert!(off_um[..50].iter().all(|um| *um < 1e-9), "{off_um:?}");
        assert!(off_um[50..].iter().all(|um| (um - 2.0).abs() < 1e-9), "{off_um:?}");
        let svg = toolpath_svg("t", &samples, 0.001);
        let told = "Actual position off the commanded path: 2.0 um at most, in line 1";
        assert!(texts(&svg).iter().any(|text| text == told));
    }

    #[test]
    fn the_grid_is_square_and_the_picture_complete_and_small() {
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
        let svg = toolpath_svg("bracket <1> & \"2\".ngc", &samples, 0.001);
        let texts = texts(&svg);
        for word in ["bracket <1> & \"2\".ngc", "feed", "rapid", "start", "end"] {
            assert!(texts.iter().any(|text| text == word), "{word}");
        }
        for name in ["X, mm", "Y, mm", "Z, mm", "time, s"] {
            assert!(texts.iter().any(|text| text == name), "{name}");
        }
        // The numbers of the grid of X, and of Y: one step.
        let numbers: Vec<f64> = texts.iter().filter_map(|text| text.parse().ok()).collect();
        assert_eq!(numbers[1] - numbers[0], 10.0, "{numbers:?}");
        let y = numbers
            .windows(2)
            .position(|pair| pair[1] < pair[0])
            .expect("Y begins again")
            + 1;
        assert_eq!(numbers[y + 1] - numbers[y], 10.0, "{numbers:?}");
        assert!(svg.len() < 200_000, "{} octets", svg.len());
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
            let svg = toolpath_svg("strange", &samples, 0.001);
            assert!(svg.len() < 100_000 && !svg.contains("NaN"));
            texts(&svg);
        }
    }

    #[test]
    fn a_page_holds_text_and_pictures_and_is_no_way_in() {
        let picture = toolpath_svg("p", &[], 0.001);
        let page = html("a <b>", "result: 1 < 2\nline two", &[picture.clone(), picture]);
        assert_eq!(page.matches("<svg ").count(), 2);
        assert!(page.contains("<h1>a &lt;b&gt;</h1>") && page.contains("<pre>result: 1 &lt; 2\nline two\n</pre>"));
    }
}
