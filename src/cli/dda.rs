//! `isocnc dda`: how well digital differential analysers follow a circle.
//!
//! In:  radius in steps, widths of the registers.
//! Out: path variance, steps, clocks and sawteeth of a quarter circle, from (R, 0) to (0, R), for each method; as a table, as JSON,
//!      drawn, and as one page for a browser.
//!
//! The figures are exact, the same on every PC.

use ::dda::{ArcDda, Fill, Method, Registers, Rule, Turn, path_variance, sawteeth};
use anyhow::Context;
use clap::Args;
use host::terminal;
use plot::sheet::escaped;
use serde_json::{Value as Json, json};
use std::fmt::Write as _;
use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;

/// Radius of the circle in the literature, steps.
const RADIUS_OF_LITERATURE: u32 = 100;

/// Arguments of `dda`.
#[derive(Clone, Debug, Args)]
pub struct DdaArgs {
    /// Radius of the circle, steps
    #[arg(long, value_name = "STEPS", default_value_t = RADIUS_OF_LITERATURE, value_parser = clap::value_parser!(u32).range(2..=10_000))]
    radius: u32,
    /// Widths of the registers, bits
    #[arg(long, value_name = "BITS", value_delimiter = ',', default_value = "6,7,8,10", value_parser = clap::value_parser!(u32).range(1..=20))]
    width: Vec<u32>,
    /// Shift the coordinates left until the radius fills its register: as many times fewer clocks
    #[arg(long)]
    normalise: bool,
    /// Print JSON
    #[arg(long)]
    json: bool,
    /// Draw the paths of all methods, at the first width, near 38 degrees
    #[arg(long, value_name = "FILE")]
    svg: Option<PathBuf>,
    /// Write the figures and the picture as one page for a browser
    #[arg(long, value_name = "FILE.html")]
    html: Option<PathBuf>,
}

/// A method by its name, and what the literature found for it: no width is told there.
struct Row {
    name: &'static str,
    rule: Option<Rule>,
    literature: Option<f64>,
}

const ROWS: [Row; 6] = [
    row("traditional", Some(Rule::Traditional), Some(15.6304)),
    row("weighted 0.125", Some(Rule::Weighted), Some(0.4223)),
    row("improved, as printed", Some(Rule::Printed), Some(0.4051)),
    row("improved, signed", Some(Rule::Signed), Some(0.4051)),
    row("improved, pair", Some(Rule::Pair), Some(0.4051)),
    row("least error", None, None),
];

const fn row(name: &'static str, rule: Option<Rule>, literature: Option<f64>) -> Row {
    Row { name, rule, literature }
}

/// Places by which a coordinate of this size can be shifted left in a register of this width.
fn normalising_shift(radius: u32, width_bits: u32) -> u32 {
    (0..width_bits)
        .take_while(|shift| u64::from(radius) << shift <= 1 << width_bits)
        .last()
        .unwrap_or(0)
}

/// What became of one quarter circle. Forced steps are in none of the figures: they are not the method's.
struct Quarter {
    width_bits: u32,
    shift: u32,
    steps: Vec<[i8; 2]>,
    points: Vec<[i32; 2]>,
    clocks: u64,
    forced: u64,
    radius: f64,
}

impl Quarter {
    fn new(row: &Row, args: &DdaArgs, width_bits: u32) -> anyhow::Result<Quarter> {
        let shift = match args.normalise {
            true => normalising_shift(args.radius, width_bits),
            false => 0,
        };
        let method = match row.rule {
            None => Method::LeastError,
            // Coordinates 2^k times as great in the same accumulator overflow as they do in one that is k bits narrower.
            Some(rule) => Method::Registers(Registers {
                rule,
                width_bits: width_bits - shift,
                fill: Fill::Half,
            }),
        };
        // At most 10,000.
        let radius = args.radius as i32;
        let mut arc = ArcDda::new([radius, 0], [0, radius], Turn::CounterClockwise, method)?;
        let (mut steps, mut points) = (Vec::new(), Vec::new());
        while let Some(step) = arc.next() {
            if arc.forced_steps() == 0 {
                steps.push(step);
                points.push(arc.position());
            }
        }
        Ok(Quarter {
            width_bits,
            shift,
            steps,
            points,
            clocks: arc.clocks(),
            forced: arc.forced_steps(),
            radius: f64::from(args.radius),
        })
    }

    /// `None`: of less than two points there is none.
    fn variance(&self) -> Option<f64> {
        let variance = path_variance(self.points.iter().copied(), self.radius);
        variance.is_finite().then_some(variance)
    }

    fn sawteeth(&self) -> u32 {
        sawteeth(self.steps.iter().copied())
    }

    /// `None`: it makes no step by itself.
    fn greatest_deviation(&self) -> Option<f64> {
        let off = |&[x, y]: &[i32; 2]| (f64::from(x).hypot(f64::from(y)) - self.radius).abs();
        self.points.iter().map(off).reduce(f64::max)
    }

    fn json(&self) -> Json {
        json!({
            "width_bits": self.width_bits,
            "shift": self.shift,
            "variance": self.variance(),
            "steps": self.steps.len(),
            "clocks": self.clocks,
            "sawteeth": self.sawteeth(),
            "greatest_deviation": self.greatest_deviation(),
            "forced_steps": self.forced,
        })
    }
}

/// A figure that there may be none of.
fn figure(value: Option<f64>, digits: usize) -> String {
    value.map_or("-".to_owned(), |value| format!("{value:.digits$}"))
}

/// Runs the command.
///
/// # Errors
/// The file of the picture cannot be written.
pub fn dda(args: &DdaArgs) -> anyhow::Result<ExitCode> {
    // Beside the figures, so that a file that cannot be written costs nothing else.
    let text = report(args)?;
    files::printed::stdout().write_all(text.as_bytes())?;
    if let Some(file) = &args.svg {
        files::write(file, picture(args)?).with_context(|| format!("{}: cannot be written", file.display()))?;
    }
    if let Some(file) = &args.html {
        files::write(file, page(args)?).with_context(|| format!("{}: cannot be written", file.display()))?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Picture and figures as HTML that needs no other file, no script and no network.
fn page(args: &DdaArgs) -> anyhow::Result<String> {
    let in_words = DdaArgs {
        json: false,
        ..args.clone()
    };
    Ok(format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>{title}</title>\n\
         <style>\nbody {{ font: 15px/1.45 sans-serif; margin: 1.2em auto; max-width: 1240px; padding: 0 1em }}\n\
         figure {{ margin: .6em 0; overflow-x: auto }} svg {{ max-width: 100%; height: auto }} pre {{ overflow-x: auto }}\n\
         </style>\n</head>\n<body>\n<h1>{title}</h1>\n<figure>\n{picture}</figure>\n<pre>{figures}</pre>\n</body>\n</html>\n",
        title = format_args!("A circle of {} steps by digital differential analysers", args.radius),
        picture = picture(args)?,
        figures = figures_of(&report(&in_words)?),
    ))
}

/// Lines of a text as HTML.
fn figures_of(text: &str) -> String {
    let lines = text.lines().map(escaped);
    lines.collect::<Vec<_>>().join("\n")
}

fn report(args: &DdaArgs) -> anyhow::Result<String> {
    let mut rows = Vec::new();
    for row in &ROWS {
        let quarters = args.width.iter().map(|width| Quarter::new(row, args, *width));
        rows.push((row, quarters.collect::<anyhow::Result<Vec<Quarter>>>()?));
    }
    let of_literature = args.radius == RADIUS_OF_LITERATURE;
    if args.json {
        let methods = rows.iter().map(|(row, quarters)| {
            json!({
                "method": row.name,
                "literature": row.literature.filter(|_| of_literature),
                "quarters": quarters.iter().map(Quarter::json).collect::<Vec<_>>(),
            })
        });
        let methods = methods.collect::<Vec<_>>();
        return Ok(format!("{:#}\n", json!({ "radius": args.radius, "methods": methods })));
    }
    let widths = || rows.first().map_or(&[][..], |(_, quarters)| quarters).iter();
    let bits = |quarter: &Quarter| match quarter.shift {
        0 => format!(">{} bits", quarter.width_bits),
        shift => format!(">{} bits << {shift}", quarter.width_bits),
    };
    let table = |value: &dyn Fn(&Quarter) -> String, last: Option<&dyn Fn(&Row) -> String>| {
        let mut heads = vec!["method".to_owned()];
        heads.extend(widths().map(bits));
        heads.extend(last.map(|_| ">literature".to_owned()));
        let heads: Vec<&str> = heads.iter().map(String::as_str).collect();
        let lines = rows.iter().map(|(row, quarters)| {
            let mut cells = vec![row.name.to_owned()];
            cells.extend(quarters.iter().map(value));
            cells.extend(last.map(|last| last(row)));
            cells
        });
        terminal::table(&heads, lines)
    };
    let mark = |quarter: &Quarter| if quarter.forced > 0 { "*" } else { " " };
    let literature = |row: &Row| row.literature.map_or("-".to_owned(), |figure| format!("{figure:.4}"));
    let literature: &dyn Fn(&Row) -> String = &literature;
    let mut text = format!(
        "Quarter circle of {} steps radius, accumulators half full\n\nPath variance, steps²\n{}",
        args.radius,
        table(
            &|quarter| format!("{}{}", figure(quarter.variance(), 4), mark(quarter)),
            of_literature.then_some(literature)
        )
    );
    write!(
        text,
        "\nGreatest deviation, steps\n{}",
        table(&|quarter| figure(quarter.greatest_deviation(), 3), None)
    )?;
    write!(
        text,
        "\nSteps; clocks; sawteeth\n{}",
        table(
            &|quarter| format!("{}; {}; {}", quarter.steps.len(), quarter.clocks, quarter.sawteeth()),
            None
        )
    )?;
    if rows
        .iter()
        .any(|(_, quarters)| quarters.iter().any(|quarter| quarter.forced > 0))
    {
        text.push_str("\n* does not arrive by itself: stepped to the end, those steps are not counted.\n");
    }
    if of_literature {
        text.push_str(
            "\nThe literature tells neither width nor end rule, so its figures cannot be had exactly. Its order holds at 6 bits, where\n\
             2^6 < R: what is bad there is the register, not the method. From 7 bits on the traditional DDA is below 2.\n",
        );
    }
    Ok(text)
}

/// Steps that are drawn each way, pixels of one.
const WIDE: i32 = 24;
const HIGH: i32 = 23;
const PIXELS: f64 = 14.0;
const MARGIN: f64 = 16.0;
const TITLE: f64 = 44.0;
const COLUMNS: usize = 3;

/// The lower left corner of what is drawn: around 38 degrees, where sawteeth are.
fn corner(radius: u32) -> [i32; 2] {
    let at = |share: f64, size: i32| (share * f64::from(radius)).round() as i32 - size / 2;
    [at(0.788, WIDE), at(0.616, HIGH)]
}

/// The paths of all methods side by side.
fn picture(args: &DdaArgs) -> anyhow::Result<String> {
    let width_bits = args.width.first().copied().unwrap_or_default();
    let [left, bottom] = corner(args.radius);
    let panel_wide = f64::from(WIDE) * PIXELS + MARGIN;
    let panel_high = f64::from(HIGH) * PIXELS + TITLE + MARGIN;
    let wide = COLUMNS as f64 * panel_wide + MARGIN;
    let high = ROWS.len().div_ceil(COLUMNS) as f64 * panel_high + MARGIN + 24.0;
    let mut svg = format!(
        "<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 {wide} {high}' width='{wide}' height='{high}' \
         font-family='DejaVu Sans, Arial, sans-serif'>\n<rect width='100%' height='100%' fill='white'/>\n\
         <text x='{MARGIN}' y='26' font-size='17' font-weight='bold'>Circle of {} steps by DDA, registers of {width_bits} \
         bits: x {left} to {}, y {bottom} to {}</text>\n",
        args.radius,
        left + WIDE,
        bottom + HIGH
    );
    for (index, row) in ROWS.iter().enumerate() {
        let x = MARGIN + (index % COLUMNS) as f64 * panel_wide;
        let y = MARGIN + 24.0 + (index / COLUMNS) as f64 * panel_high;
        panel(
            &mut svg,
            [x, y],
            row,
            &Quarter::new(row, args, width_bits)?,
            [left, bottom],
        )?;
    }
    svg.push_str("</svg>\n");
    Ok(svg)
}

/// One path, with the grid of steps and the circle.
fn panel(svg: &mut String, [x, y]: [f64; 2], row: &Row, quarter: &Quarter, corner: [i32; 2]) -> std::fmt::Result {
    let [left, bottom] = corner;
    let top = -bottom - HIGH;
    writeln!(
        svg,
        "<text x='{x}' y='{}' font-size='14' font-weight='bold'>{}</text>\n<text x='{x}' y='{}' font-size='12' \
         fill='#555'>variance {}, {} sawteeth in the quadrant</text>",
        y + 18.0,
        row.name,
        y + 34.0,
        figure(quarter.variance(), 4),
        quarter.sawteeth()
    )?;
    // A view of its own cuts off what lies outside of it; y grows upwards.
    writeln!(
        svg,
        "<svg x='{x}' y='{}' width='{}' height='{}' viewBox='{left} {top} {WIDE} {HIGH}'>\
         <rect x='{left}' y='{top}' width='{WIDE}' height='{HIGH}' fill='#fafafa'/>",
        y + TITLE,
        (f64::from(WIDE) - 0.5) * PIXELS,
        f64::from(HIGH) * PIXELS,
    )?;
    let mut lines = String::new();
    for column in left..=left + WIDE {
        write!(lines, "M{column} {top}v{HIGH}")?;
    }
    for line in bottom..=bottom + HIGH {
        write!(lines, "M{left} {}h{WIDE}", -line)?;
    }
    writeln!(svg, "<path d='{lines}' stroke='#ddd' stroke-width='0.04' fill='none'/>")?;
    writeln!(
        svg,
        "<circle cx='0' cy='0' r='{}' stroke='#888' stroke-width='0.12' fill='none'/>",
        quarter.radius
    )?;
    let near = |[x, y]: &&[i32; 2]| {
        // One more on each side, so that lines run on to the border.
        (left - 1..=left + WIDE + 1).contains(x) && (bottom - 1..=bottom + HIGH + 1).contains(y)
    };
    let mut path = String::new();
    for [x, y] in quarter.points.iter().filter(near) {
        write!(path, "{}{x} {}", if path.is_empty() { "M" } else { "L" }, -y)?;
    }
    writeln!(
        svg,
        "<path d='{path}' stroke='#c2410c' stroke-width='0.18' stroke-linejoin='round' fill='none'/>"
    )?;
    for [x, y] in quarter.points.iter().filter(near) {
        writeln!(svg, "<circle cx='{x}' cy='{}' r='0.22' fill='#7c2d12'/>", -y)?;
    }
    writeln!(svg, "</svg>")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn args(options: &[&str]) -> DdaArgs {
        #[derive(clap::Parser)]
        struct Only {
            #[command(flatten)]
            args: DdaArgs,
        }
        let words = ["dda"].iter().chain(options);
        <Only as clap::Parser>::parse_from(words).args
    }

    /// Figures of an independent reference, R = 100, accumulators half full; the least error is the same at any width.
    #[test]
    fn the_table_has_the_figures_of_the_reference() {
        let expected = [
            ("traditional", ["10.1270 ", "0.6630*", "1.8892 ", "0.7637 "]),
            ("weighted 0.125", ["1.3648 ", "0.7637 ", "0.1343 ", "0.3449 "]),
            ("improved, as printed", ["0.5534 ", "0.6676 ", "0.3796 ", "1.0014*"]),
            ("improved, signed", ["0.1284 ", "0.1318 ", "0.1369 ", "0.1383 "]),
            ("improved, pair", ["0.0939 ", "0.1097 ", "0.1238 ", "0.1337 "]),
            ("least error", ["0.0644 ", "0.0644 ", "0.0644 ", "0.0644 "]),
        ];
        let text = report(&args(&[])).unwrap();
        let lines: Vec<&str> = text.lines().skip(4).take(6).collect();
        for ((name, figures), line) in expected.iter().zip(lines) {
            assert!(line.starts_with(name), "{line}");
            let mut rest = &line[name.len()..];
            for figure in figures {
                let number = figure.trim_end_matches(['*', ' ']);
                let at = rest.find(number).unwrap_or_else(|| panic!("{figure} in {line}"));
                rest = &rest[at + number.len()..];
                assert_eq!(rest.starts_with('*'), figure.ends_with('*'), "{line}");
            }
        }
    }

    #[test]
    fn normalising_gives_the_path_of_the_narrowest_register_in_the_fewest_clocks() {
        assert_eq!([6, 7, 8, 10].map(|bits| normalising_shift(100, bits)), [0, 0, 1, 3]);
        assert_eq!(normalising_shift(64, 6), 0);
        let quarters = |options: &[&str]| -> Vec<Json> {
            let text = report(&args(options)).unwrap();
            let json: Json = serde_json::from_str(&text).unwrap();
            let methods = json["methods"].as_array().unwrap();
            methods.iter().map(|method| method["quarters"][0].clone()).collect()
        };
        let plain = quarters(&["--json", "--width", "7"]);
        let wide = quarters(&["--json", "--width", "10"]);
        let shifted = quarters(&["--json", "--width", "10", "--normalise"]);
        for ((plain, wide), shifted) in plain.iter().zip(&wide).zip(&shifted) {
            assert_eq!(shifted["shift"], 3);
            for figure in ["variance", "steps", "clocks", "sawteeth"] {
                assert_eq!(shifted[figure], plain[figure], "{figure}");
            }
            assert!(shifted["clocks"].as_u64() <= wide["clocks"].as_u64());
        }
        // Of the weighted one exactly: it is never forced.
        let clocks = |quarters: &[Json]| quarters[1]["clocks"].as_f64().unwrap();
        let ratio = clocks(&wide) / clocks(&shifted);
        assert!((7.5..8.5).contains(&ratio), "{ratio}");
    }

    #[test]
    fn another_radius_has_no_figures_of_the_literature() {
        let text = report(&args(&["--radius", "40", "--width", "8"])).unwrap();
        assert!(text.starts_with("Quarter circle of 40 steps radius"), "{text}");
        assert!(!text.contains("literature"), "{text}");
    }

    #[test]
    fn the_page_has_the_picture_and_the_figures_and_needs_nothing_else() {
        let page = page(&args(&["--json", "--width", "6,8"])).unwrap();
        assert_eq!(
            (page.matches("<svg xmlns").count(), page.matches("</html>").count()),
            (1, 1)
        );
        for text in ["<h1>A circle of 100 steps", "improved, signed", "15.6304", "2^6 &lt; R"] {
            assert!(page.contains(text), "{text}");
        }
        let addresses = page.replace("http://www.w3.org/2000/svg", "");
        assert!(!addresses.contains("http:") && !addresses.contains("<script"));
    }

    #[test]
    fn the_picture_has_a_panel_for_each_method() {
        for options in [&["--width", "6"][..], &["--radius", "5", "--normalise"]] {
            let svg = picture(&args(options)).unwrap();
            assert_eq!(svg.matches("sawteeth in the quadrant").count(), ROWS.len());
            assert_eq!(svg.matches("<svg").count(), svg.matches("</svg>").count());
            assert!(!svg.contains("NaN"), "{options:?}");
        }
    }
}
