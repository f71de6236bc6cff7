//! Look-ahead in overlapping buffers on two threads against one pass over everything: `cargo bench --bench lookahead`.
//!
//! Prints, with the load and what the host of a virtual machine stole:
//! - elements per second of one core, backward and forward pass. Target 10 million;
//! - time over the number of elements, serial and on two threads, for buffers of 300 elements with overlaps of 5 to 50 and
//!   for larger ones, and the number from which on two threads win. Target: 1.6 times as fast from 100,000 elements on;
//! - the overlap that the certificate asked for, and how many buffers were done again because theirs was too small.
//!
//! All figures are medians of rounds in which every variant has its turn; every result is compared with the serial one.
//! Options behind `--`: `--rounds N` (21), `--svg FILE` for a picture of time over elements.

mod common;

use anyhow::{Context, ensure};
use common::Busyness;
use motion::plan::classic::pass::{Buffers, Element, serial};
use motion::plan::workers::Workers;
use plotters::prelude::*;
use powerlink::link::simulated::SplitMix64;
use std::hint::black_box;
use std::sync::Arc;
use std::time::Instant;

/// Numbers of elements for which time is taken.
const COUNTS: [usize; 9] = [100, 300, 1000, 3000, 10_000, 30_000, 100_000, 300_000, 1_000_000];
/// Buffers and overlaps that have their turn on two threads. Those of 300 elements are the published ones.
const BUFFERS: [(usize, usize); 6] = [(300, 5), (300, 20), (300, 50), (3000, 50), (3000, 300), (20_000, 300)];
/// A measurement repeats what is shorter than so many elements.
const AT_LEAST: usize = 30_000;

/// A milled surface: blocks of 0.1 to 0.6 mm at 6 m/min and 1000 mm/s², most borders taken at somewhat less than the feed,
/// one in forty a true corner.
fn surface(count: usize) -> Arc<[Element]> {
    let mut random = SplitMix64::new(1);
    let element = |_| Element {
        length: random.within(0.1, 0.6),
        acceleration: 1000.0,
        feed: 100.0,
        corner: match random.next() % 40 {
            0 => random.within(1.0, 20.0),
            1..8 => random.within(40.0, 100.0),
            _ => 200.0,
        },
    };
    (0..count).map(element).collect()
}

/// Short blocks at high speed: 0.067 mm at 40 m/min and 3000 mm/s², so that braking takes 74 mm; a corner every 3000 blocks.
fn fast(count: usize) -> Arc<[Element]> {
    let mut random = SplitMix64::new(2);
    let element = |_| Element {
        length: 0.067,
        acceleration: 3000.0,
        feed: 40e3 / 60.0,
        corner: match random.next() % 3000 {
            0 => random.within(1.0, 200.0),
            _ => 1000.0,
        },
    };
    (0..count).map(element).collect()
}

fn median(figures: &mut [f64]) -> f64 {
    figures.sort_by(f64::total_cmp);
    figures[figures.len() / 2]
}

/// Seconds of one call of `work`, the mean of some.
fn timed<T>(count: usize, mut work: impl FnMut() -> T) -> f64 {
    let calls = AT_LEAST.div_ceil(count);
    let began = Instant::now();
    for _ in 0..calls {
        black_box(work());
    }
    began.elapsed().as_secs_f64() / calls as f64
}

/// Median times for one number of elements, s.
struct Row {
    count: usize,
    serial: f64,
    parallel: Vec<f64>,
}

fn measure(elements: &Arc<[Element]>, workers: &Workers, rounds: usize) -> anyhow::Result<Row> {
    let mut expected = Vec::new();
    serial(elements, &mut expected);
    let mut variants = BUFFERS.map(|(chunk, overlap)| Buffers::new(chunk, overlap, workers));
    for variant in &mut variants {
        variant.run(elements)?;
        let same = variant.b().map(f64::to_bits).eq(expected.iter().map(|b| b.to_bits()));
        ensure!(same, "buffers differ from the serial result");
    }
    let mut times = vec![Vec::new(); BUFFERS.len() + 1];
    for _ in 0..rounds {
        times[0].push(timed(elements.len(), || serial(elements, &mut expected)));
        for (times, variant) in times[1..].iter_mut().zip(&mut variants) {
            times.push(timed(elements.len(), || variant.run(elements)));
        }
    }
    Ok(Row {
        count: elements.len(),
        serial: median(&mut times[0]),
        parallel: times[1..].iter_mut().map(|times| median(times)).collect(),
    })
}

/// Time over elements, and who wins from where on.
fn compare(path: fn(usize) -> Arc<[Element]>, workers: &Workers, rounds: usize) -> anyhow::Result<Vec<Row>> {
    let busyness = Busyness::now();
    print!("{:>9} {:>10} {:>9}", "elements", "serial us", "million/s");
    for (chunk, overlap) in BUFFERS {
        print!(" {:>10}", format!("{chunk}/{overlap}"));
    }
    println!("   (times as fast as serial)");
    let mut rows = Vec::new();
    for count in COUNTS {
        let row = measure(&path(count), workers, rounds)?;
        print!(
            "{count:>9} {:>10.1} {:>9.1}",
            row.serial * 1e6,
            count as f64 / row.serial / 1e6
        );
        for time in &row.parallel {
            print!(" {:>10.2}", row.serial / time);
        }
        println!();
        rows.push(row);
    }
    print!("{:>30}", "ideal, 2c/(c+2o)");
    for (chunk, overlap) in BUFFERS {
        print!(" {:>10.2}", 2.0 * chunk as f64 / (chunk + 2 * overlap) as f64);
    }
    print!("\n{:>30}", "two threads win from");
    for place in 0..BUFFERS.len() {
        let losses = rows.iter().rposition(|row| row.parallel[place] >= row.serial);
        let first = losses.map_or(0, |last| last + 1);
        let first = rows
            .get(first)
            .map_or("nowhere".to_owned(), |row| row.count.to_string());
        print!(" {first:>10}");
    }
    println!("\n  {}", busyness.line());
    Ok(rows)
}

/// What the certificates asked for.
fn overlaps(path: fn(usize) -> Arc<[Element]>, workers: &Workers) -> anyhow::Result<()> {
    let elements = path(300_000);
    println!(
        "buffer/overlap      nodes up to the certificate: half of them, 90 %, 99 %, most     done again   handed back"
    );
    for (chunk, overlap) in [(300, 5), (300, 10), (300, 20), (300, 50), (3000, 50), (3000, 1200)] {
        let mut buffers = Buffers::new(chunk, overlap, workers);
        buffers.run(&elements)?;
        let chunks = buffers.chunks();
        let done = chunks.iter().filter(|chunk| !chunk.handed_back);
        let mut needed: Vec<usize> = done.map(|chunk| chunk.left.max(chunk.right)).collect();
        needed.sort_unstable();
        let at = |part: f64| {
            let place = (part * needed.len() as f64) as usize;
            needed
                .get(place.min(needed.len().saturating_sub(1)))
                .map_or("-".to_owned(), usize::to_string)
        };
        let part = |count: usize| 100.0 * count as f64 / chunks.len() as f64;
        println!(
            "{:<36} {:>21} {:>6} {:>6} {:>6} {:>12.1} % {:>11.1} %",
            format!("{chunk}/{overlap}"),
            at(0.5),
            at(0.9),
            at(0.99),
            at(1.0),
            part(chunks.iter().filter(|chunk| chunk.redone > 0).count()),
            part(chunks.iter().filter(|chunk| chunk.handed_back).count()),
        );
    }
    Ok(())
}

/// Time over elements, both on logarithmic scales.
fn draw(rows: &[Row], file: &str) -> anyhow::Result<()> {
    let slowest = rows.iter().flat_map(|row| row.parallel.iter().chain([&row.serial]));
    let (mut least, mut most) = (f64::INFINITY, 0.0_f64);
    for seconds in slowest {
        (least, most) = (least.min(*seconds * 1e6), most.max(*seconds * 1e6));
    }
    let area = SVGBackend::new(file, (900, 600)).into_drawing_area();
    area.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(&area)
        .caption(
            "Look-ahead: one pass, and buffers with overlap on two threads",
            ("sans-serif", 20),
        )
        .margin(15)
        .margin_right(40)
        .x_label_area_size(45)
        .y_label_area_size(70)
        .build_cartesian_2d((100.0..1e6).log_scale(), (least * 0.7..most * 1.5).log_scale())?;
    chart
        .configure_mesh()
        .x_desc("elements")
        .y_desc("time, µs")
        .x_label_formatter(&|x| format!("{x:.0}"))
        .y_label_formatter(&|y| format!("{y:.0}"))
        .light_line_style(TRANSPARENT)
        .bold_line_style(RGBColor(0xE4, 0xE4, 0xE4))
        .draw()?;
    let series = |place: Option<usize>| {
        let seconds = move |row: &Row| place.map_or(row.serial, |place| row.parallel[place]);
        rows.iter().map(move |row| (row.count as f64, seconds(row) * 1e6))
    };
    // Colours that people with any colour vision can tell apart.
    let colours = [0x56B4E9, 0x0072B2, 0x009E73, 0xE69F00, 0xD55E00, 0xCC79A7];
    let colour = |place: usize| {
        let [_, red, green, blue] = u32::to_be_bytes(colours[place % colours.len()]);
        RGBColor(red, green, blue)
    };
    let legend = |colour: RGBColor| move |(x, y)| PathElement::new(vec![(x, y), (x + 24, y)], colour.stroke_width(3));
    chart
        .draw_series(LineSeries::new(series(None), BLACK.stroke_width(3)))?
        .label("serial")
        .legend(legend(BLACK));
    for (place, (chunk, overlap)) in BUFFERS.into_iter().enumerate() {
        chart
            .draw_series(LineSeries::new(series(Some(place)), colour(place).stroke_width(2)))?
            .label(format!("buffers of {chunk}, overlap {overlap}"))
            .legend(legend(colour(place)));
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperLeft)
        .legend_area_size(30)
        .border_style(RGBColor(0xBB, 0xBB, 0xBB))
        .background_style(WHITE)
        .label_font(("sans-serif", 14))
        .draw()?;
    area.present()?;
    println!("picture: {file}");
    Ok(())
}

/// What stands behind an option.
fn option(name: &str) -> anyhow::Result<Option<String>> {
    let mut arguments = std::env::args().skip_while(|argument| argument != name);
    match arguments.next() {
        None => Ok(None),
        Some(_) => Ok(Some(arguments.next().with_context(|| format!("{name} needs a value"))?)),
    }
}

fn main() -> anyhow::Result<()> {
    let rounds = option("--rounds")?.map_or(Ok(21), |rounds| rounds.parse())?.max(1);
    // The caller works, too.
    let workers = Workers::new(1, || ());
    println!("a surface: blocks of 0.1 to 0.6 mm, 6 m/min, 1000 mm/s2");
    let rows = compare(surface, &workers, rounds)?;
    overlaps(surface, &workers)?;
    println!("short blocks at high speed: 0.067 mm, 40 m/min, 3000 mm/s2; braking takes 1106 of them");
    compare(fast, &workers, rounds)?;
    overlaps(fast, &workers)?;
    for (row, count) in rows
        .iter()
        .filter(|row| row.count >= 100_000)
        .map(|row| (row, row.count as f64))
    {
        let rate = count / row.serial / 1e6;
        let gain = row.parallel.iter().map(|time| row.serial / time).fold(0.0, f64::max);
        println!(
            "{count:>9} elements: {rate:.1} million/s a core, target 10 {}; two threads {gain:.2} times as fast, target 1.6 {}",
            if rate >= 10.0 { "kept" } else { "MISSED" },
            if gain >= 1.6 { "kept" } else { "MISSED" },
        );
    }
    match option("--svg")? {
        Some(file) => draw(&rows, &file),
        None => Ok(()),
    }
}
