//! A plan as one page for a browser: figures, the path, strips over time, slow places, times, and the lines that they name.
//!
//! In:  a program that was run down, its report and its text.
//! Out: HTML that needs no other file, no script and no network, of limited size whatever the program is.

use super::lines::each_line;
use super::picture::{self, Place};
use super::report::Report;
use super::run_down::Work;
use config::Config;
use plot::sheet::escaped;
use program::Doubt;
use program::text::Reader;
use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::io;
use std::ops::ControlFlow;

/// A program of so many lines is shown whole.
const WHOLE_LINES: usize = 1000;
/// Of a longer one, so many lines around each place, and around each heading of an operation.
const AROUND_PLACE: usize = 6;
const AROUND_HEADING: usize = 2;
/// Characters of a line.
const WIDTH_MAX: usize = 120;

const STYLE: &str = "\
:root { color-scheme: light dark; --ink: #222; --paper: #fff; --faint: #666; --line: #ddd; --named: #fff4c2 }
@media (prefers-color-scheme: dark) {
  :root { --ink: #e6e6e6; --paper: #161616; --faint: #a0a0a0; --line: #3a3a3a; --named: #4a4010 }
  .strips svg { filter: invert(.92) hue-rotate(180deg) }
  .path svg { filter: brightness(.85) }
}
body { font: 15px/1.45 sans-serif; color: var(--ink); background: var(--paper); margin: 1.2em auto; max-width: 1240px; padding: 0 1em }
h1 { font-size: 1.4em; margin: 0 0 .3em } h2 { font-size: 1.15em; margin: 1.6em 0 .4em }
nav a { margin-right: 1em } a { color: inherit }
figure { margin: .6em 0; overflow-x: auto } svg { width: 100%; min-width: 1000px; height: auto }
.scroll { overflow-x: auto } table { border-collapse: collapse; font-variant-numeric: tabular-nums }
th, td { padding: .15em .7em .15em 0; text-align: right; border-bottom: 1px solid var(--line); white-space: nowrap }
th.t, td.t { text-align: left } td.t { white-space: normal }
.wrong { font-weight: bold; border-left: 4px solid #d55e00; padding-left: .6em }
.code { font: 13px/1.4 monospace; overflow-x: auto } .code div { white-space: pre }
.code div a { display: inline-block; width: 5.5em; color: var(--faint); text-decoration: none }
.code .n { background: var(--named) } .code div:target { outline: 2px solid #d55e00 } .gap { color: var(--faint) }
pre { overflow-x: auto }
@media print { body { margin: 0; max-width: none } svg { min-width: 0 } nav { display: none } figure, tr { break-inside: avoid } }
";

/// What a page is made of.
pub(super) struct Page<'a> {
    pub(super) name: &'a str,
    pub(super) text: Reader<'a>,
    pub(super) config: &'a Config,
    pub(super) work: &'a Work,
    pub(super) report: &'a Report,
    pub(super) doubts: &'a [Doubt],
}

impl Page<'_> {
    /// Makes it; `None`: nothing was recorded.
    ///
    /// # Errors
    /// The text cannot be read any more.
    pub(super) fn html(&self) -> io::Result<Option<String>> {
        let Some(recording) = self.work.judged.recording.as_ref() else {
            return Ok(None);
        };
        let places = self.places();
        let [above, isometric, strips] = picture::pictures(self.config, recording, &self.work.judged, &places);
        let title = format!("{} on {}", self.name, self.config.name);
        let mut html = String::with_capacity(1 << 20);
        let _ = write!(
            html,
            "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
             <meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'\">\n\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>{title}</title>\n\
             <style>\n{STYLE}</style>\n</head>\n<body>\n<h1>{title}</h1>\n<p>{}</p>\n\
             <nav><a href=\"#path\">path</a><a href=\"#joints\">joints</a><a href=\"#slow\">slow places</a><a href=\"#times\">times</a>\
             <a href=\"#all\">all figures</a><a href=\"#program\">program</a></nav>\n",
            escaped(&self.report.in_short()),
            title = escaped(&title),
        );
        let wrong = self.report.wrong();
        let warning = self.report.planning.real_time_factor.warning();
        for (line, what) in wrong.iter().chain(&warning) {
            let _ = writeln!(html, "<p class=\"wrong\">{}: {}</p>", link(*line), escaped(what));
        }
        for doubt in self.doubts {
            let _ = writeln!(html, "<p class=\"wrong\">{}</p>", escaped(&doubt.to_string()));
        }
        let _ = write!(
            html,
            "<h2 id=\"path\">Path, coloured by speed</h2>\n<figure class=\"path\">{above}</figure>\n<figure class=\"path\">{isometric}</figure>\n\
             <h2 id=\"joints\">Velocity, acceleration and jerk of the joints</h2>\n<figure class=\"strips\">{strips}</figure>\n"
        );
        self.write_places(&mut html, &places);
        self.write_times(&mut html);
        let _ = write!(
            html,
            "<h2 id=\"all\">All figures</h2>\n<pre>{}</pre>\n",
            lines(&self.report.to_string())
        );
        self.write_program(&mut html, &wrong)?;
        html.push_str("</body>\n</html>\n");
        Ok(Some(html))
    }

    /// Slow places, then stops, numbered.
    fn places(&self) -> Vec<Place> {
        let feed = &self.work.judged.feed;
        let all = feed.slow_places.iter().chain(&feed.stop_places);
        let numbered = all.zip(1..).map(|(place, number)| Place {
            number,
            line: place.line,
            time_s: place.time_s,
            at_mm: place.at_mm,
            what: place.in_words(),
        });
        numbered.collect()
    }

    fn write_places(&self, html: &mut String, places: &[Place]) {
        html.push_str(
            "<h2 id=\"slow\">Slowest places, and the first stops</h2>\n<div class=\"scroll\"><table>\n\
             <tr><th>no.</th><th>line</th><th>after s</th><th class=\"t\">what, and why</th></tr>\n",
        );
        for place in places {
            let _ = writeln!(
                html,
                "<tr><td>{}</td><td>{}</td><td>{:.3}</td><td class=\"t\">{}</td></tr>",
                place.number,
                link(place.line),
                place.time_s,
                escaped(&place.what)
            );
        }
        html.push_str("</table></div>\n");
    }

    fn write_times(&self, html: &mut String) {
        let head = |first: &str| {
            format!(
                "<div class=\"scroll\"><table>\n<tr>{first}<th>time s</th><th>cutting s</th><th>rapid s</th><th>dwell s</th>\
                 <th>waiting s</th><th>cutting m</th><th>rapid m</th><th>changes</th><th class=\"t\">name</th></tr>\n"
            )
        };
        let table = &self.work.judged.times;
        let _ = write!(
            html,
            "<h2 id=\"times\">Times by tool and operation</h2>\n{}",
            head("<th>tool</th>")
        );
        for own in table.tools.iter().filter(|own| own.times.counts()) {
            let name = own.name.as_deref().unwrap_or_default();
            let _ = writeln!(
                html,
                "<tr><td>T{}</td>{}<td class=\"t\">{}</td></tr>",
                own.tool,
                own.times.cells(),
                escaped(name)
            );
        }
        let _ = write!(html, "</table></div>\n{}", head("<th>line</th><th>tool</th>"));
        for own in table.operations.iter().filter(|own| own.times.counts()) {
            let name = own.name.as_deref().unwrap_or("before the first heading");
            let _ = writeln!(
                html,
                "<tr><td>{}</td><td>T{}</td>{}<td class=\"t\">{}</td></tr>",
                link(own.line),
                own.tool,
                own.times.cells(),
                escaped(name)
            );
        }
        html.push_str("</table></div>\n");
    }

    /// The lines that are named with those around them; all where they are few.
    fn write_program(&self, html: &mut String, wrong: &[(u32, String)]) -> io::Result<()> {
        let feed = &self.work.judged.feed;
        let places = feed.slow_places.iter().chain(&feed.stop_places).map(|place| place.line);
        let least = self.work.real_time.least;
        let stretch = least.iter().flat_map(|least| [least.from_line, least.to_line]);
        let set = |lines: &mut dyn Iterator<Item = u32>| lines.map(|line| line as usize).collect::<BTreeSet<usize>>();
        let places = set(&mut places.chain(stretch).chain(wrong.iter().map(|(line, _)| *line)));
        let headings = set(&mut self.work.judged.times.operations.iter().map(|own| own.line));
        let mut count = 0;
        each_line(self.text, 0, |_, _| {
            count += 1;
            ControlFlow::Continue(())
        })?;
        let near = |all: &BTreeSet<usize>, line: usize, around: usize| {
            all.range(line.saturating_sub(around)..=line + around).next().is_some()
        };
        let named = |line: usize| places.contains(&line) || headings.contains(&line);
        let shown = |line: usize| {
            count <= WHOLE_LINES || near(&places, line, AROUND_PLACE) || near(&headings, line, AROUND_HEADING)
        };
        html.push_str("<h2 id=\"program\">Program</h2>\n<div class=\"code\">\n");
        let mut last = 0;
        // Cut before it is made text: a line may be as long as the program.
        each_line(self.text, 4 * WIDTH_MAX, |line, octets| {
            let line = line as usize;
            if !shown(line) {
                return ControlFlow::Continue(());
            }
            if line != last + 1 {
                let _ = writeln!(html, "<div class=\"gap\">... {} lines</div>", line - last - 1);
            }
            last = line;
            let text = String::from_utf8_lossy(octets);
            let short: String = text.chars().take(WIDTH_MAX).collect();
            let class = if named(line) { " class=\"n\"" } else { "" };
            let _ = writeln!(
                html,
                "<div id=\"L{line}\"{class}><a href=\"#L{line}\">{line}</a>{}</div>",
                escaped(short.trim_end())
            );
            ControlFlow::Continue(())
        })?;
        if last < count {
            let _ = writeln!(html, "<div class=\"gap\">... {} lines</div>", count - last);
        }
        html.push_str("</div>\n");
        Ok(())
    }
}

fn link(line: u32) -> String {
    match line {
        0 => String::from("-"),
        line => format!("<a href=\"#L{line}\">line {line}</a>"),
    }
}

fn lines(text: &str) -> String {
    text.lines().map(|line| escaped(line) + "\n").collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run_down::{Wanted, run_down};
    use machine::tables::Tables;
    use motion::cancel::Cancel;
    use motion::canon::Position;
    use program::doubts;
    use std::path::Path;

    fn page(text: &str) -> (String, String) {
        let machine = include_str!("../../../configs/mill3-demo.toml");
        let config = config::parse(machine, Path::new("demo.toml")).unwrap();
        let tables = Tables::read(&config).unwrap();
        let wanted = Wanted {
            picture: true,
            ..Wanted::default()
        };
        let work = run_down(&config, &tables, ("p.ngc", text.into()), Some(1), wanted).unwrap();
        let report = Report::new(&config, &work);
        let page = Page {
            name: "<p>.ngc",
            text: text.into(),
            config: &config,
            work: &work,
            report: &report,
            doubts: &doubts(
                &config,
                &tables,
                ("p.ngc", text.into()),
                Position::ZERO,
                &Cancel::default(),
            ),
        };
        (
            page.html().unwrap().unwrap(),
            serde_json::to_string_pretty(&report).unwrap(),
        )
    }

    #[test]
    fn a_page_shows_path_strips_places_times_and_lines_and_runs_nothing() {
        let (html, json) = page(
            "G21 G90 G61 S500\n(<script>alert 1</script> & \"face\")\nG1 X30 F3000\nY20 (</code><img src=x onerror=alert>)\nX0\nM2\n",
        );
        assert!(
            !html.contains("<script") && !html.contains("<img") && !html.contains("src=\"http"),
            "{html}"
        );
        assert!(html.contains("&lt;script&gt;alert 1&lt;/script&gt; &amp; &quot;face&quot;"));
        let doubt = "p.ngc:1: S without M3 or M4: the spindle stands while the tool cuts in line 3";
        assert!(html.contains(&format!("<p class=\"wrong\">{doubt}</p>")), "{html}");
        assert_eq!(html.matches("<svg ").count(), 3);
        assert!(html.contains("default-src 'none'"));
        // Every line that something leads to is there.
        let leads: Vec<&str> = html
            .split("href=\"#L")
            .skip(1)
            .map(|rest| rest.split('"').next().unwrap())
            .collect();
        assert!(leads.len() > 6 && leads.contains(&"4"), "{leads:?}");
        for line in leads {
            assert!(html.contains(&format!("<div id=\"L{line}\"")), "{line}");
        }
        assert!(html.contains("stop: corner of 90 degrees"), "{html}");
        // The same as numbers.
        let json: serde_json::Value = serde_json::from_str(&json).unwrap();
        let picture = &json["picture"];
        assert!(picture["path"].as_array().unwrap().len() > 100);
        assert_eq!(picture["strips"].as_array().unwrap().len(), 9);
        assert_eq!(json["stop_places"][0]["reason"]["kind"], "corner");
        assert_eq!(json["operations"][0]["line"], 2);
    }

    #[test]
    fn a_page_of_a_long_program_is_short() {
        let comment = format!("({})\n", "long ".repeat(48));
        let mut text = String::from("G21 G90 G61 F3000\n");
        for pass in 0..40 {
            text += &format!("G1 X{} Y{}\n", pass % 2 * 10, pass % 3);
            text += &comment.repeat(200);
        }
        text += "M2\n";
        let (html, json) = page(&text);
        assert!(
            html.len() < 600_000 && json.len() < 1_000_000,
            "{} {}",
            html.len(),
            json.len()
        );
        assert!(html.contains("class=\"gap\""));
        for line in html
            .split("href=\"#L")
            .skip(1)
            .map(|rest| rest.split('"').next().unwrap())
        {
            assert!(html.contains(&format!("<div id=\"L{line}\"")), "{line}");
        }
    }
}
