//! Circles by DDA: path variance and speed of each method: `cargo bench --bench dda [-- --svg DIR]`.
//!
//! A quarter circle of 100 steps, from (R, 0) to (0, R), by each method and width of the registers. The variances are exact
//! figures, the same on every PC; steps a second are only as good as the PC is quiet, which is why the load stands beside.
//! With `--svg` the paths are drawn, one picture for each width, so near that single steps are seen.

#[allow(dead_code, reason = "other benches use more of it")]
mod common;

use common::Busyness;
use motion::rt::dda::{ArcDda, Fill, Method, Registers, Rule, Turn, path_variance, sawteeth};
use std::fmt::Write as _;
use std::path::PathBuf;
use std::time::{Duration, Instant};

const RADIUS: i32 = 100;
const WIDTHS: [u32; 4] = [6, 7, 8, 10];
/// Long enough that the clock does not matter, short enough for a bench of a minute.
const TIMED: Duration = Duration::from_millis(300);

/// A method by its name, and what the literature found for it: no width is told there.
struct Row {
    name: &'static str,
    rule: Option<Rule>,
    literature: Option<&'static str>,
}

const ROWS: [Row; 6] = [
    row("traditional", Some(Rule::Traditional), Some("15.6304")),
    row("weighted 0.125", Some(Rule::Weighted), Some("0.4223")),
    row("improved, as printed", Some(Rule::Printed), Some("0.4051")),
    row("improved, signed", Some(Rule::Signed), Some("0.4051")),
    row("improved, pair", Some(Rule::Pair), Some("0.4051")),
    row("least error", None, None),
];

const fn row(name: &'static str, rule: Option<Rule>, literature: Option<&'static str>) -> Row {
    Row { name, rule, literature }
}

impl Row {
    fn method(&self, width_bits: u32) -> Method {
        match self.rule {
            None => Method::LeastError,
            Some(rule) => Method::Registers(Registers {
                rule,
                width_bits,
                fill: Fill::Half,
            }),
        }
    }
}

/// What became of one quarter circle. Forced steps are in none of the figures: they are not the method's.
struct Quarter {
    steps: Vec<[i8; 2]>,
    points: Vec<[i32; 2]>,
    clocks: u64,
    forced: u64,
}

impl Quarter {
    fn new(method: Method) -> anyhow::Result<Quarter> {
        let mut arc = ArcDda::new([RADIUS, 0], [0, RADIUS], Turn::CounterClockwise, method)?;
        let (mut steps, mut points) = (Vec::new(), Vec::new());
        while let Some(step) = arc.next() {
            if arc.forced_steps() == 0 {
                steps.push(step);
                points.push(arc.position());
            }
        }
        Ok(Quarter {
            steps,
            points,
            clocks: arc.clocks(),
            forced: arc.forced_steps(),
        })
    }

    fn variance(&self) -> f64 {
        path_variance(self.points.iter().copied(), f64::from(RADIUS))
    }

    fn sawteeth(&self) -> u32 {
        sawteeth(self.steps.iter().copied())
    }

    fn greatest_deviation(&self) -> f64 {
        let off = |&[x, y]: &[i32; 2]| (f64::from(x).hypot(f64::from(y)) - f64::from(RADIUS)).abs();
        self.points.iter().map(off).fold(0.0, f64::max)
    }
}

fn main() -> anyhow::Result<()> {
    println!("path variance [steps²], R = {RADIUS} steps, first quadrant, accumulators half full");
    print!("{:<22}", "width of registers");
    for width_bits in WIDTHS {
        print!("{:>12}", format!("{width_bits} bits"));
    }
    println!("{:>12}", "literature");
    for row in &ROWS {
        print!("{:<22}", row.name);
        for width_bits in WIDTHS {
            let quarter = Quarter::new(row.method(width_bits))?;
            let mark = if quarter.forced > 0 { "*" } else { " " };
            print!("{:>11.4}{mark}", quarter.variance());
        }
        println!("{:>12}", row.literature.unwrap_or("-"));
    }
    println!(
        "* does not arrive by itself: stepped to the end, those steps are not counted.\n\
         The literature tells neither width nor end rule, so its figures cannot be had exactly. Its order holds at 6 bits, where\n\
         2^6 < R: what is bad there is the register, not the method. From 7 bits on the traditional DDA is below 2.\n"
    );

    println!(
        "{:<22}{:>8}{:>10}{:>10}{:>12}{:>14}",
        "at 8 bits", "steps", "clocks", "sawteeth", "greatest", "million/s"
    );
    let busyness = Busyness::now();
    for row in &ROWS {
        let quarter = Quarter::new(row.method(8))?;
        println!(
            "{:<22}{:>8}{:>10}{:>10}{:>12.3}{:>14.1}",
            row.name,
            quarter.steps.len(),
            quarter.clocks,
            quarter.sawteeth(),
            quarter.greatest_deviation(),
            steps_per_s(row.method(8))? / 1e6
        );
    }
    println!("{}", busyness.line());

    if let Some(folder) = svg_folder() {
        std::fs::create_dir_all(&folder)?;
        for width_bits in WIDTHS {
            let file = folder.join(format!("dda-{width_bits}-bits.svg"));
            std::fs::write(&file, picture(width_bits)?)?;
            println!("{}", file.display());
        }
    }
    Ok(())
}

fn svg_folder() -> Option<PathBuf> {
    let mut arguments = std::env::args_os().skip_while(|argument| argument != "--svg");
    arguments.nth(1).map(PathBuf::from)
}

/// Steps found in a second, full circles one after the other.
fn steps_per_s(method: Method) -> anyhow::Result<f64> {
    let (began, mut steps) = (Instant::now(), 0_u64);
    while began.elapsed() < TIMED {
        for _ in 0..16 {
            let circle = ArcDda::new([RADIUS, 0], [RADIUS, 0], Turn::CounterClockwise, method)?;
            steps += std::hint::black_box(circle).count() as u64;
        }
    }
    Ok(steps as f64 / began.elapsed().as_secs_f64())
}

/// What of the circle is drawn: steps from `LEFT` and `BOTTOM`, between 30 and 45 degrees, where sawteeth are.
const LEFT: f64 = 66.0;
const BOTTOM: f64 = 50.0;
const WIDE: f64 = 24.0;
const HIGH: f64 = 23.0;
const PIXELS: f64 = 14.0;
const MARGIN: f64 = 16.0;
const TITLE: f64 = 44.0;
const COLUMNS: usize = 3;

/// The paths of all methods side by side.
fn picture(width_bits: u32) -> anyhow::Result<String> {
    let (panel_wide, panel_high) = (WIDE * PIXELS + MARGIN, HIGH * PIXELS + TITLE + MARGIN);
    let wide = COLUMNS as f64 * panel_wide + MARGIN;
    let high = ROWS.len().div_ceil(COLUMNS) as f64 * panel_high + MARGIN + 24.0;
    let mut svg = format!(
        "<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 {wide} {high}' width='{wide}' height='{high}' \
         font-family='DejaVu Sans, Arial, sans-serif'>\n<rect width='100%' height='100%' fill='white'/>\n\
         <text x='{MARGIN}' y='26' font-size='17' font-weight='bold'>Circle of {RADIUS} steps by DDA, registers of {width_bits} \
         bits: x {LEFT} to {}, y {BOTTOM} to {}</text>\n",
        LEFT + WIDE,
        BOTTOM + HIGH
    );
    for (index, row) in ROWS.iter().enumerate() {
        let left = MARGIN + (index % COLUMNS) as f64 * panel_wide;
        let top = MARGIN + 24.0 + (index / COLUMNS) as f64 * panel_high;
        panel(&mut svg, [left, top], row, &Quarter::new(row.method(width_bits))?)?;
    }
    svg.push_str("</svg>\n");
    Ok(svg)
}

/// One path, with the grid of steps and the circle.
fn panel(svg: &mut String, [left, top]: [f64; 2], row: &Row, quarter: &Quarter) -> std::fmt::Result {
    writeln!(
        svg,
        "<text x='{left}' y='{}' font-size='14' font-weight='bold'>{}</text>\n<text x='{left}' y='{}' font-size='12' \
         fill='#555'>variance {:.4}, {} sawteeth in the quadrant</text>",
        top + 18.0,
        row.name,
        top + 34.0,
        quarter.variance(),
        quarter.sawteeth()
    )?;
    // A view of its own cuts off what lies outside of it; y grows upwards.
    writeln!(
        svg,
        "<svg x='{left}' y='{}' width='{}' height='{}' viewBox='{LEFT} {} {WIDE} {HIGH}'>\
         <rect x='{LEFT}' y='{}' width='{WIDE}' height='{HIGH}' fill='#fafafa'/>",
        top + TITLE,
        (WIDE - 0.5) * PIXELS,
        HIGH * PIXELS,
        -BOTTOM - HIGH,
        -BOTTOM - HIGH
    )?;
    let grid = |from: f64, count: f64| (0..=count as u32).map(move |k| from + f64::from(k));
    let mut lines = String::new();
    for x in grid(LEFT, WIDE) {
        write!(lines, "M{x} {}v{HIGH}", -BOTTOM - HIGH)?;
    }
    for y in grid(BOTTOM, HIGH) {
        write!(lines, "M{LEFT} {}h{WIDE}", -y)?;
    }
    writeln!(svg, "<path d='{lines}' stroke='#ddd' stroke-width='0.04' fill='none'/>")?;
    writeln!(
        svg,
        "<circle cx='0' cy='0' r='{RADIUS}' stroke='#888' stroke-width='0.12' fill='none'/>"
    )?;
    let mut path = format!("M{RADIUS} 0");
    for [x, y] in &quarter.points {
        write!(path, "L{x} {}", -y)?;
    }
    writeln!(
        svg,
        "<path d='{path}' stroke='#c2410c' stroke-width='0.18' stroke-linejoin='round' fill='none'/>"
    )?;
    for [x, y] in &quarter.points {
        let seen = (LEFT..=LEFT + WIDE).contains(&f64::from(*x)) && (BOTTOM..=BOTTOM + HIGH).contains(&f64::from(*y));
        if seen {
            writeln!(svg, "<circle cx='{x}' cy='{}' r='0.22' fill='#7c2d12'/>", -y)?;
        }
    }
    writeln!(svg, "</svg>")
}
