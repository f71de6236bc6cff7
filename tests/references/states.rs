//! `docs/states.md`: what may be ordered when, from the table that decides it.

use super::{check, code, head, row};
use isocnc::machine::permission::{Activity, Condition, Power, Wish, permit};

/// A cell: carried out, or the reason against it.
fn cell(wish: Wish, condition: &Condition) -> String {
    match permit(wish, condition) {
        Ok(()) => "yes".into(),
        Err(refusal) => refusal.to_string(),
    }
}

#[test]
fn the_states() {
    check("docs/states.md", |_| {
        let idle = Condition {
            stands_by: true,
            power: Power::On,
            network: true,
            homed: true,
            on_limit: false,
            activity: Activity::Idle,
            loaded: true,
        };
        let mut text = "## By power, nothing going on\n\n".to_owned();
        let mut names = vec!["order"];
        names.extend(Power::ALL.iter().map(|power| power.name()));
        text += &head(&names);
        for wish in Wish::ALL {
            let mut cells = vec![code(wish.command())];
            cells.extend(Power::ALL.map(|power| cell(wish, &Condition { power, ..idle })));
            text += &row(&cells.iter().map(String::as_str).collect::<Vec<_>>());
        }
        text += "\n## By what is going on, drives on\n\n";
        let mut names = vec!["order"];
        names.extend(Activity::ALL.iter().map(|activity| activity.name()));
        names.extend(["not homed", "limit switch closed", "nothing loaded"]);
        text += &head(&names);
        for wish in Wish::ALL {
            let mut cells = vec![code(wish.command())];
            cells.extend(Activity::ALL.map(|activity| cell(wish, &Condition { activity, ..idle })));
            cells.push(cell(wish, &Condition { homed: false, ..idle }));
            cells.push(cell(wish, &Condition { on_limit: true, ..idle }));
            cells.push(cell(wish, &Condition { loaded: false, ..idle }));
            text += &row(&cells.iter().map(String::as_str).collect::<Vec<_>>());
        }
        text
    });
}
