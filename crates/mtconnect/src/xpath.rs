//! Which items a `path` means: the part of XPath that clients of MTConnect use.
//!
//! Steps by name or `*`, below (`/`) or anywhere below (`//`), each with conditions on attributes (`[@type="POSITION"]`, `and`, `or`), and
//! several paths with `|`. What a path finds means all items in it. Anything else is refused by its name.

use crate::xml::Element;

/// Longest path, octets, and its steps and alternatives at the most.
const LENGTH_MAX: usize = 1024;
const PARTS_MAX: usize = 32;

#[derive(Debug)]
struct Step {
    anywhere: bool,
    name: String,
    /// All of one of these lists hold.
    conditions: Vec<Vec<(String, String)>>,
}

/// Ids of the data items that a path means.
///
/// # Errors
/// What of it cannot be read.
pub(crate) fn items(path: &str, device: &Element) -> Result<Vec<String>, String> {
    if path.len() > LENGTH_MAX {
        return Err(format!("a path has {LENGTH_MAX} octets at the most"));
    }
    let root = Element::new("")
        .holding([Element::new("MTConnectDevices").holding([Element::new("Devices").holding([device.clone()])])]);
    let mut ids = Vec::new();
    for alternative in path.split('|') {
        let steps = steps(alternative.trim())?;
        let mut found = vec![&root];
        for step in &steps {
            let mut next: Vec<&Element> = Vec::new();
            for element in found {
                collect(element, step, &mut next);
            }
            found = next;
        }
        found.into_iter().for_each(|element| collect_ids(element, &mut ids));
    }
    ids.sort();
    ids.dedup();
    match ids.is_empty() {
        true => Err(format!("{path} finds no data item")),
        false => Ok(ids),
    }
}

fn collect<'e>(element: &'e Element, step: &Step, found: &mut Vec<&'e Element>) {
    for child in &element.children {
        let holds =
            |list: &Vec<(String, String)>| list.iter().all(|(name, value)| child.attribute(name) == Some(value));
        let is_meant = step.name == "*" || step.name == child.name;
        if is_meant && (step.conditions.is_empty() || step.conditions.iter().any(holds)) {
            // Found by another way already.
            if !found.iter().any(|known| std::ptr::eq(*known, child)) {
                found.push(child);
            }
        }
        if step.anywhere {
            collect(child, step, found);
        }
    }
}

fn collect_ids(element: &Element, ids: &mut Vec<String>) {
    if element.name == "DataItem" {
        ids.extend(element.attribute("id").map(str::to_owned));
    }
    element.children.iter().for_each(|child| collect_ids(child, ids));
}

fn steps(path: &str) -> Result<Vec<Step>, String> {
    let mut rest = path;
    let mut steps = Vec::new();
    while !rest.is_empty() {
        let anywhere = rest.starts_with("//");
        let Some(behind) = rest.strip_prefix("//").or_else(|| rest.strip_prefix('/')) else {
            return Err(format!("expected / or // before {rest}"));
        };
        let end = behind.find(['/', '[']).unwrap_or(behind.len());
        let name = behind[..end].trim();
        let is_name = name == "*" || !name.is_empty() && name.chars().all(|c| c.is_ascii_alphanumeric());
        if !is_name {
            return Err(format!("{name:?} is no name of an element"));
        }
        rest = &behind[end..];
        let mut conditions = Vec::new();
        if let Some(inside) = rest.strip_prefix('[') {
            let end = inside.find(']').ok_or_else(|| "[ without ]".to_owned())?;
            conditions = self::conditions(&inside[..end])?;
            rest = &inside[end + 1..];
        }
        steps.push(Step {
            anywhere,
            name: name.to_owned(),
            conditions,
        });
        if steps.len() > PARTS_MAX {
            return Err(format!("a path has {PARTS_MAX} steps at the most"));
        }
    }
    match steps.is_empty() {
        true => Err("expected / or //".into()),
        false => Ok(steps),
    }
}

/// `@a="b" and @c='d' or @e="f"`
fn conditions(text: &str) -> Result<Vec<Vec<(String, String)>>, String> {
    let mut all = Vec::new();
    for alternative in text.split(" or ") {
        let mut list = Vec::new();
        for condition in alternative.split(" and ") {
            let wrong = || format!("expected @name=\"value\", got {condition}");
            let (name, value) = condition
                .trim()
                .strip_prefix('@')
                .and_then(|rest| rest.split_once('='))
                .ok_or_else(wrong)?;
            let value = value.trim();
            let bare = ['"', '\'']
                .into_iter()
                .find_map(|mark| value.strip_prefix(mark)?.strip_suffix(mark));
            let bare = bare.filter(|bare| !bare.contains(['"', '\''])).ok_or_else(wrong)?;
            list.push((name.trim().to_owned(), bare.to_owned()));
        }
        all.push(list);
    }
    match all.len() > PARTS_MAX {
        true => Err(format!("a path has {PARTS_MAX} conditions at the most")),
        false => Ok(all),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Axis, Machine, Model};
    use proptest::prelude::*;

    fn device() -> Element {
        let axes = ['X', 'Z'].map(|letter| Axis {
            letter,
            ..Axis::default()
        });
        let machine = Machine {
            name: "mill".into(),
            axes: axes.to_vec(),
            ..Machine::default()
        };
        Model::new(&machine).device()
    }

    #[test]
    fn paths_of_clients_mean_what_they_mean() {
        let found = |path: &str| items(path, &device()).unwrap().join(" ");
        assert_eq!(found("//Linear[@name=\"X\"]"), "x_com x_drive x_state x_travel");
        assert_eq!(
            found("//DataItem[@type='POSITION' and @category='SAMPLE']"),
            "x_com z_com"
        );
        assert_eq!(found("//Axes//DataItem[@category=\"SAMPLE\"]"), "x_com z_com");
        assert_eq!(found("//DataItem[@id=\"mode\" or @id=\"execution\"]"), "execution mode");
        assert_eq!(
            found("//Path/DataItems/DataItem[@type=\"EXECUTION\"]|//Device/DataItems/*[@id='avail']"),
            "avail execution"
        );
        assert_eq!(
            found("/MTConnectDevices/Devices/Device[@name='mill']//Linear[@name='Z']//DataItem[@type='AXIS_STATE']"),
            "z_state"
        );
        assert!(found("//Device").contains("comms"));
    }

    #[test]
    fn what_cannot_be_read_is_told() {
        for (path, told) in [
            ("", "expected / or //"),
            ("Linear", "expected / or // before Linear"),
            ("//", "is no name"),
            ("//Linear[", "[ without ]"),
            ("//Linear[1]", "expected @name"),
            ("//Linear[@name=X]", "expected @name"),
            ("//ancestor::x", "is no name"),
            ("//Linear[@name='Y']", "finds no data item"),
        ] {
            let error = items(path, &device()).unwrap_err();
            assert!(error.contains(told), "{path}: {error}");
        }
        assert!(items(&"/a".repeat(600), &device()).is_err());
        assert!(items(&"//*".repeat(40), &device()).is_err());
    }

    proptest! {
        #[test]
        fn any_text_is_answered(path in "[/@\\[\\]a-zA-Z*='\"| .:()]{0,60}") {
            let _ = items(&path, &device());
        }
    }
}
