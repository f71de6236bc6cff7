//! The picture of the oscilloscope: 24 rows of 80 columns, or more.
//!
//! In:  what is known. Out: lanes of braille dots, two columns of them a character. Each shows the least and the greatest value of its
//! cycles; nothing is told by colour alone.

use super::screen::App;
use hal_pins::Type;
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Modifier, Style};
use ratatui::symbols::Marker;
use ratatui::text::Line;
use ratatui::widgets::Paragraph;
use ratatui::widgets::canvas::{Canvas, Context, Line as Stroke};
use scope::record::Mode;

/// Smallest screen that holds it.
const SMALLEST: (u16, u16) = (50, 12);
/// Columns of names and values.
const NAMES: u16 = 26;
const KEYS: [&str; 2] = [
    "Space freeze  t trigger  m mode  s single  +/- time  Left/Right before trigger",
    "Up/Down pin  o overlay/lanes  w write CSV and SVG  q quit",
];
const KEYS_OF_LINE: &str = "Enter sets the trigger, empty: none  Esc leaves; PIN>1 falling PIN<2 PIN=1..2 alarm";

fn strong() -> Style {
    Style::new().add_modifier(Modifier::BOLD)
}

fn reversed() -> Style {
    Style::new().add_modifier(Modifier::BOLD | Modifier::REVERSED)
}

/// Draws everything.
pub(super) fn draw(frame: &mut Frame<'_>, app: &App) {
    let area = frame.area();
    if area.width < SMALLEST.0 || area.height < SMALLEST.1 {
        frame.render_widget(Paragraph::new("make the window larger"), area);
        return;
    }
    let [head, lanes, times, keys] = Layout::vertical([
        Constraint::Length(1),
        Constraint::Min(4),
        Constraint::Length(1),
        Constraint::Length(3),
    ])
    .areas(area);
    frame.render_widget(Paragraph::new(heading(app)).style(reversed()), head);
    frame.render_widget(Paragraph::new(bottom(app)), keys);
    let [_, axis] = Layout::horizontal([Constraint::Length(NAMES), Constraint::Min(10)]).areas(times);
    frame.render_widget(Paragraph::new(time_axis(app, axis.width)), axis);
    match app.is_overlaid {
        true => overlay(frame, app, lanes),
        false => all_lanes(frame, app, lanes),
    }
}

fn heading(app: &App) -> String {
    let state = match &app.ended {
        Some(why) => why.to_uppercase(),
        None if app.is_frozen => "FROZEN".into(),
        None if app.is_done => "DONE: s or m for another record".into(),
        None if app.is_waiting => match app.mode() {
            Mode::Roll => "waiting for a cycle".into(),
            Mode::Auto | Mode::Normal | Mode::Single => "WAITING for the trigger".into(),
        },
        None if app.is_forced => "running, no trigger".into(),
        None => "running".into(),
    };
    let name = Mode::ALL
        .iter()
        .find(|(mode, _)| *mode == app.mode())
        .map_or("", |(_, name)| name);
    let lost = match app.lost {
        0 => String::new(),
        lost => format!("  {lost} LOST"),
    };
    let record = match app.mode() {
        Mode::Roll => String::new(),
        Mode::Auto | Mode::Normal | Mode::Single => format!(" {}", app.record),
    };
    let shown = format!(" {}  {name}{record}  {} s  {state}{lost}", app.machine, app.length_s());
    match (&app.wanted.trigger, app.mode()) {
        (None, _) | (_, Mode::Roll) => shown,
        (Some(trigger), _) => format!("{shown}  trigger {trigger}"),
    }
}

fn bottom(app: &App) -> Vec<Line<'static>> {
    let first = match (&app.typed, &app.said) {
        (Some(typed), said) => {
            let said = said.as_deref().map_or_else(String::new, |said| format!("   {said}"));
            Line::styled(format!("trigger> {typed}_{said}"), strong())
        }
        (None, Some(said)) => Line::styled(said.replace('\n', "; "), reversed()),
        (None, None) => Line::raw(""),
    };
    match app.typed {
        Some(_) => vec![first, Line::raw(KEYS_OF_LINE), Line::raw("")],
        None => vec![first, Line::raw(KEYS[0]), Line::raw(KEYS[1])],
    }
}

/// Times below the lanes: at both ends, and of the trigger.
fn time_axis(app: &App, width: u16) -> String {
    let (from_ns, to_ns) = app.shown_ns();
    let label = |ns: i64| format!("{:.3} s", ns as f64 / 1e9);
    let (left, right) = (label(from_ns), label(to_ns));
    let middle = usize::from(width).saturating_sub(left.len() + right.len());
    let mut row = format!("{left}{}{right}", " ".repeat(middle));
    let is_inside = from_ns < 0 && to_ns > 0;
    let place = |share: f64| (share * f64::from(width)) as usize;
    if is_inside {
        let at = place(-from_ns as f64 / (to_ns - from_ns) as f64);
        if row.get(at..=at).is_some_and(|there| there == " ") {
            row.replace_range(at..=at, "^");
        }
    }
    row
}

/// As many lanes as fit, those around the selected one.
fn all_lanes(frame: &mut Frame<'_>, app: &App, area: Rect) {
    let count = app.channels.len().max(1);
    let fit = usize::from(area.height / 2).clamp(1, count);
    let first = app.selected.saturating_sub(fit / 2).min(count - fit);
    let rows = Layout::vertical(vec![Constraint::Fill(1); fit]).split(area);
    for (row, channel) in rows.iter().zip(first..count.min(first + fit)) {
        let [names, lane] = Layout::horizontal([Constraint::Length(NAMES), Constraint::Min(10)]).areas(*row);
        let (bins, joined) = (bins(app, channel, lane.width), joined(app, lane.width));
        let range = range(&bins);
        frame.render_widget(Paragraph::new(name_lines(app, channel, range, names.height)), names);
        paint(frame, lane, app, range, |context| strokes(context, &bins, joined));
    }
}

/// All pins over each other, to one scale.
fn overlay(frame: &mut Frame<'_>, app: &App, area: Rect) {
    let [names, lane] = Layout::horizontal([Constraint::Length(NAMES), Constraint::Min(10)]).areas(area);
    let all: Vec<_> = (0..app.channels.len())
        .map(|channel| bins(app, channel, lane.width))
        .collect();
    let every: Vec<Option<[f64; 2]>> = all.iter().flatten().copied().collect();
    let (range, joined) = (range(&every), joined(app, lane.width));
    let mut lines = vec![Line::raw(told_range(range))];
    for (number, channel) in app.channels.iter().enumerate() {
        lines.push(name_line(app, number, &channel.name));
    }
    frame.render_widget(Paragraph::new(lines), names);
    paint(frame, lane, app, range, |context| {
        all.iter().for_each(|bins| strokes(context, bins, joined))
    });
}

fn name_line(app: &App, channel: usize, name: &str) -> Line<'static> {
    let mark = if channel == app.selected { '>' } else { ' ' };
    // The end of a name tells more than its beginning.
    let room = usize::from(NAMES) - 2;
    let name = match name.len() > room {
        true => format!("..{}", &name[name.len() - room + 2..]),
        false => name.to_owned(),
    };
    let style = if channel == app.selected {
        strong()
    } else {
        Style::new()
    };
    Line::styled(format!("{mark}{name}"), style)
}

fn name_lines(app: &App, channel: usize, range: Option<[f64; 2]>, height: u16) -> Vec<Line<'static>> {
    let of = &app.channels[channel];
    let mut lines = vec![name_line(app, channel, &of.name)];
    let last = app.trace.of(channel).last().map(|(_, word)| of.value(word));
    let now = match last.map(|value| (value, value.to_f64())) {
        None => String::new(),
        Some((value, number)) => match of.value_type {
            Type::Float => format!("{} {}", short(number), of.unit),
            Type::Bit | Type::S32 | Type::U32 | Type::S64 | Type::U64 => format!("{value} {}", of.unit),
        },
    };
    lines.push(Line::raw(format!("  {}", now.trim_end())));
    if height > 2 && of.value_type != Type::Bit {
        lines.push(Line::raw(told_range(range)));
    }
    lines
}

fn told_range(range: Option<[f64; 2]>) -> String {
    match range {
        Some([low, high]) => format!("  {}..{}", short(low), short(high)),
        None => String::new(),
    }
}

/// Six digits at the most.
fn short(value: f64) -> String {
    match value.abs() {
        size if size != 0.0 && !(1e-3..1e6).contains(&size) => format!("{value:.2e}"),
        size if size >= 1e3 => format!("{value:.1}"),
        _ => format!("{value:.4}"),
    }
}

/// Least and greatest value of each column of dots; none where there is no cycle.
fn bins(app: &App, channel: usize, width: u16) -> Vec<Option<[f64; 2]>> {
    let (from_ns, to_ns) = app.shown_ns();
    let mut bins: Vec<Option<[f64; 2]>> = vec![None; 2 * usize::from(width).max(1)];
    let count = bins.len() as i128;
    for (time_ns, word) in app.trace.of(channel) {
        if !(from_ns..to_ns).contains(&time_ns) {
            continue;
        }
        let value = app.channels[channel].value(word).to_f64();
        let at = i128::from(time_ns - from_ns) * count / i128::from(to_ns - from_ns).max(1);
        if let (true, Some(bin)) = (value.is_finite(), bins.get_mut(at as usize)) {
            let [low, high] = bin.unwrap_or([value; 2]);
            *bin = Some([low.min(value), high.max(value)]);
        }
    }
    bins
}

fn range(bins: &[Option<[f64; 2]>]) -> Option<[f64; 2]> {
    bins.iter()
        .flatten()
        .fold(None, |all: Option<[f64; 2]>, [least, greatest]| {
            let [low, high] = all.unwrap_or([*least, *greatest]);
            Some([low.min(*least), high.max(*greatest)])
        })
}

fn paint(frame: &mut Frame<'_>, area: Rect, app: &App, range: Option<[f64; 2]>, strokes: impl Fn(&mut Context<'_>)) {
    let [low, high] = range.unwrap_or([0.0, 1.0]);
    let room = match high - low {
        0.0 => low.abs().max(1.0) * 0.5,
        range => range * 0.03,
    };
    let columns = 2.0 * f64::from(area.width);
    let (from_ns, to_ns) = app.shown_ns();
    let trigger = match app.mode() {
        Mode::Roll => None,
        Mode::Auto | Mode::Normal | Mode::Single => Some(-from_ns as f64 / (to_ns - from_ns) as f64 * columns),
    };
    let canvas = Canvas::default()
        .marker(Marker::Braille)
        .x_bounds([0.0, columns - 1.0])
        .y_bounds([low - room, high + room])
        .paint(|context| {
            if let Some(at) = trigger.filter(|at| *at > 0.0 && app.wanted.trigger.is_some()) {
                // Dotted.
                for dot in 0..8 {
                    let y = low - room + (high - low + 2.0 * room) * f64::from(dot) / 7.0;
                    context.draw(&stroke((at, y), (at, y)));
                }
            }
            strokes(context);
        });
    frame.render_widget(canvas, area);
}

/// Columns of dots from one cycle to the next at the most: what is farther apart is not joined, as cycles are missing.
fn joined(app: &App, width: u16) -> f64 {
    let (from_ns, to_ns) = app.shown_ns();
    let column_ns = (to_ns - from_ns) as f64 / (2.0 * f64::from(width.max(1)));
    (app.period_ns as f64 / column_ns).ceil() + 1.0
}

fn strokes(context: &mut Context<'_>, bins: &[Option<[f64; 2]>], joined: f64) {
    let mut before: Option<(f64, [f64; 2])> = None;
    for (column, bin) in bins.iter().enumerate() {
        let x = column as f64;
        let Some([low, high]) = *bin else {
            continue;
        };
        context.draw(&stroke((x, low), (x, high)));
        // Few cycles a screen leave columns without one.
        if let Some((before_x, [before_low, before_high])) = before.filter(|(before_x, _)| x - before_x <= joined) {
            let from = if low > before_high {
                before_high
            } else {
                before_low.max(low.min(before_high))
            };
            let to = if high < before_low {
                high
            } else {
                low.max(from.min(high))
            };
            context.draw(&stroke((before_x, from), (x, to)));
        }
        before = Some((x, [low, high]));
    }
}

fn stroke((x1, y1): (f64, f64), (x2, y2): (f64, f64)) -> Stroke {
    Stroke {
        x1,
        y1,
        x2,
        y2,
        color: ratatui::style::Color::Reset,
    }
}
