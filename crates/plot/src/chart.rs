//! Lines over one common quantity, such as time or frequency, in panels one below the other.
//!
//! In:  series of points. Out: SVG.

use super::lines::{number, round_up, thin_out};
use super::sheet::{Anchor, Sheet};
use super::{BODY, GRID, INK, SMALL, TITLE, TOLERANCE};

const WIDTH: f64 = 1000.0;
const LEFT: f64 = 84.0;
const RIGHT: f64 = 970.0;
const PANEL: f64 = 170.0;
const BETWEEN: f64 = 44.0;
/// Colours that people with any colour vision can tell apart.
const COLOURS: [&str; 4] = ["#0072b2", "#d55e00", "#009e73", "#7b4fa0"];
const MARK: &str = "#999999";

/// A line.
pub struct Series {
    pub name: String,
    pub points: Vec<(f64, f64)>,
}

impl Series {
    pub fn new(name: impl Into<String>, points: impl IntoIterator<Item = (f64, f64)>) -> Series {
        Series {
            name: name.into(),
            points: points.into_iter().collect(),
        }
    }
}

/// Lines of one quantity.
pub struct Panel {
    /// Name and unit.
    pub name: &'static str,
    pub series: Vec<Series>,
    /// Values at which a dashed line is drawn.
    pub marks: Vec<f64>,
}

/// What all panels go over.
#[derive(Clone, Copy, Debug)]
pub struct Across {
    /// Name and unit.
    pub name: &'static str,
    pub logarithmic: bool,
}

/// Least and greatest of some values; `None`: there is none.
fn range(values: impl Iterator<Item = f64>) -> Option<[f64; 2]> {
    let finite = values.filter(|value| value.is_finite());
    finite.fold(None, |range, value| {
        let [low, high] = range.unwrap_or([value; 2]);
        Some([low.min(value), high.max(value)])
    })
}

/// Places of the lines of a grid.
fn grid([low, high]: [f64; 2], logarithmic: bool) -> Vec<f64> {
    if logarithmic {
        let decades = low.log10().floor() as i32..=high.log10().ceil() as i32;
        let places = decades.flat_map(|decade| [1.0, 2.0, 5.0].map(|step| step * 10f64.powi(decade)));
        return places.filter(|place| (low..=high).contains(place)).collect();
    }
    let step = round_up((high - low).max(1e-9) / 6.0);
    let first = (low / step).ceil() as i64;
    let places = (first..).map(|at| at as f64 * step);
    places
        .take(20)
        .take_while(|place| *place <= high + 1e-9 * step)
        .collect()
}

/// All panels over the same range.
pub fn chart_svg(title: &str, across: Across, panels: &[Panel]) -> String {
    let mut sheet = Sheet::new(WIDTH);
    sheet.text((24.0, 36.0), TITLE, title);
    let place = |value: f64| if across.logarithmic { value.log10() } else { value };
    let points = panels
        .iter()
        .flat_map(|panel| &panel.series)
        .flat_map(|series| &series.points);
    let legal = points.map(|(x, _)| *x).filter(|x| !across.logarithmic || *x > 0.0);
    let ends = range(legal).unwrap_or([1.0, 10.0]);
    let [low, high] = ends.map(place);
    let x_of = |value: f64| LEFT + (place(value) - low) / (high - low).max(1e-9) * (RIGHT - LEFT);
    let mut top = 72.0;
    for panel in panels {
        let bottom = top + PANEL;
        let mut x = LEFT;
        sheet.text((x, top - 10.0), BODY.bold(), panel.name);
        x += BODY.bold().width(panel.name) + 24.0;
        for (series, colour) in panel.series.iter().zip(COLOURS.iter().cycle()) {
            if panel.series.len() > 1 {
                sheet.line((x, top - 14.0), (x + 24.0, top - 14.0), colour, 2.0, "");
                sheet.text((x + 30.0, top - 10.0), BODY, &series.name);
                x += 30.0 + BODY.width(&series.name) + 24.0;
            }
        }
        let values = panel.series.iter().flat_map(|series| &series.points).map(|(_, y)| *y);
        let [least, most] = range(values.chain(panel.marks.iter().copied())).unwrap_or([0.0, 1.0]);
        let room = ((most - least) * 0.06).max(1e-6);
        let (least, most) = (least - room, most + room);
        let y_of = |value: f64| bottom - (value - least) / (most - least) * PANEL;
        for value in grid([least, most], false) {
            sheet.line((LEFT, y_of(value)), (RIGHT, y_of(value)), GRID, 1.0, "");
            sheet.text((LEFT - 7.0, y_of(value) + 4.0), SMALL.at(Anchor::End), &number(value));
        }
        for value in grid(ends, across.logarithmic) {
            sheet.line((x_of(value), top), (x_of(value), bottom), GRID, 1.0, "");
            sheet.text((x_of(value), bottom + 16.0), SMALL.at(Anchor::Middle), &number(value));
        }
        sheet.path(&[(LEFT, top), (LEFT, bottom), (RIGHT, bottom)], INK, 1.0, "");
        for mark in &panel.marks {
            sheet.line((LEFT, y_of(*mark)), (RIGHT, y_of(*mark)), MARK, 1.0, "5 4");
        }
        for (series, colour) in panel.series.iter().zip(COLOURS.iter().cycle()) {
            let places = series.points.iter().map(|(x, y)| (x_of(*x), y_of(*y)));
            let places: Vec<(f64, f64)> = places.filter(|(x, y)| x.is_finite() && y.is_finite()).collect();
            sheet.path(&thin_out(&places, TOLERANCE), colour, 1.5, "");
        }
        top = bottom + BETWEEN;
    }
    sheet.text(((LEFT + RIGHT) / 2.0, top - 8.0), BODY.at(Anchor::Middle), across.name);
    sheet.finish(top + 8.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn panels_have_their_names_lines_and_grid() {
        let panel = |name| Panel {
            name,
            series: vec![
                Series::new("one", [(1.0, -3.0), (10.0, 2.0), (100.0, 0.0)]),
                Series::new("other", [(1.0, f64::NAN), (0.0, 1.0), (50.0, f64::INFINITY)]),
            ],
            marks: vec![-3.0],
        };
        for logarithmic in [false, true] {
            let across = Across {
                name: "frequency, Hz",
                logarithmic,
            };
            let svg = chart_svg("a <title>", across, &[panel("magnitude, dB"), panel("phase")]);
            for text in [
                "a &lt;title&gt;",
                ">magnitude, dB<",
                ">other<",
                ">frequency, Hz<",
                ">20<",
            ] {
                assert!(svg.contains(text), "{text}");
            }
            assert!(!svg.contains("NaN") && !svg.contains("inf"), "{svg}");
            assert!(roxmltree::Document::parse(&svg).is_ok());
        }
        assert!(
            roxmltree::Document::parse(&chart_svg(
                "",
                Across {
                    name: "",
                    logarithmic: true
                },
                &[panel("")]
            ))
            .is_ok()
        );
    }

    #[test]
    fn a_grid_of_frequencies_has_1_2_and_5() {
        assert_eq!(grid([1.5, 60.0], true), [2.0, 5.0, 10.0, 20.0, 50.0]);
        assert_eq!(grid([-1.0, 5.0], false), [-1.0, 0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
    }
}
