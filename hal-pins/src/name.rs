//! Names of pins, nets and machines.

use crate::HalError;

/// Longest name of a pin or net, octets.
pub const NAME_LEN_MAX: usize = 64;

/// Longest name of a machine, octets.
const MACHINE_LEN_MAX: usize = 64;

/// Checks the name of a pin or net: lower case, dots between levels, dashes inside a level, a letter first.
///
/// # Errors
/// [`HalError::Name`] with the rule that is broken.
pub fn check_name(name: &str) -> Result<(), HalError> {
    let bad = |rule| {
        Err(HalError::Name {
            name: name.to_owned(),
            rule,
        })
    };
    if name.is_empty() {
        return bad("must not be empty");
    }
    if name.len() > NAME_LEN_MAX {
        return bad("must not be longer than 64 characters");
    }
    if !name.starts_with(|c: char| c.is_ascii_lowercase()) {
        return bad("must start with a lower-case letter");
    }
    if !name
        .bytes()
        .all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == b'.' || c == b'-')
    {
        return bad("may hold lower-case letters, digits, dots between levels and dashes inside them only");
    }
    if name
        .split('.')
        .any(|level| level.is_empty() || level.starts_with('-') || level.ends_with('-'))
    {
        return bad("every level between dots must begin and end with a letter or digit");
    }
    Ok(())
}

/// Checks the name of a machine, which becomes part of a file name.
pub(crate) fn check_machine(name: &str) -> Result<(), HalError> {
    let legal = |c: u8| c.is_ascii_alphanumeric() || matches!(c, b'.' | b'-' | b'_');
    if name.is_empty() || name.len() > MACHINE_LEN_MAX || name.starts_with('.') || !name.bytes().all(legal) {
        return Err(HalError::Machine { name: name.to_owned() });
    }
    Ok(())
}

/// The candidate most like `name`, if one is near enough to be what was meant: by few letters, or because levels in front of it are
/// missing, as in `feed-hold`.
pub fn nearest<'a>(name: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let near_enough = (name.len() / 4).max(2);
    let near = |candidate: &'a str| {
        let is_end = candidate.strip_suffix(name).is_some_and(|front| front.ends_with('.')) && !name.is_empty();
        let distance = edit_distance(name.as_bytes(), candidate.as_bytes());
        (distance <= near_enough || is_end).then_some((if is_end { 0 } else { distance }, candidate))
    };
    let found = candidates
        .into_iter()
        .filter_map(near)
        .min_by_key(|(distance, _)| *distance);
    found.map(|(_, candidate)| candidate)
}

/// Levenshtein distance: fewest insertions, deletions and replacements of one octet.
fn edit_distance(a: &[u8], b: &[u8]) -> usize {
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, from) in a.iter().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, to) in b.iter().enumerate() {
            let replaced = diagonal + usize::from(from != to);
            diagonal = row[j + 1];
            row[j + 1] = replaced.min(diagonal + 1).min(row[j] + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_name_is_the_one_that_was_meant() {
        let pins = [
            "motion.feed-hold",
            "motion.adaptive-feed",
            "joint.0.pos-cmd",
            "spindle.0.hold",
        ];
        for (name, meant) in [
            ("motion.feed-hodl", Some("motion.feed-hold")),
            ("feed-hold", Some("motion.feed-hold")),
            ("hold", Some("spindle.0.hold")),
            ("joint.1.pos-cmd", Some("joint.0.pos-cmd")),
            ("-hold", None),
            ("", None),
        ] {
            assert_eq!(nearest(name, pins), meant, "{name}");
        }
    }

    #[test]
    fn names_of_linuxcnc_and_of_the_network_are_legal() {
        for name in [
            "joint.0.motor-pos-cmd",
            "axis.x.pos-cmd",
            "motion.digital-in-00",
            "plk.1.nmt-state",
            "x",
            "spindle-run",
        ] {
            check_name(name).unwrap();
        }
        check_name(&"a".repeat(64)).unwrap();
    }

    #[test]
    fn each_rule_is_enforced() {
        for name in [
            "", "0.x", "Joint.0", "joint_0", "joint..0", ".joint", "joint.", "joint.-a", "joint.a-", "jöint", "a b",
        ] {
            assert!(matches!(check_name(name), Err(HalError::Name { .. })), "{name:?}");
        }
        assert!(check_name(&"a".repeat(65)).is_err());
        for name in ["", ".hidden", "a/b", "a b", "ä"] {
            assert!(matches!(check_machine(name), Err(HalError::Machine { .. })), "{name:?}");
        }
        check_machine("Mill_3.demo-1").unwrap();
    }

    #[test]
    fn distances_by_hand() {
        for (a, b, distance) in [
            ("", "", 0),
            ("abc", "", 3),
            ("kitten", "sitting", 3),
            ("f-error", "f-eror", 1),
            ("ab", "ba", 2),
        ] {
            assert_eq!(edit_distance(a.as_bytes(), b.as_bytes()), distance, "{a} {b}");
            assert_eq!(edit_distance(b.as_bytes(), a.as_bytes()), distance, "{b} {a}");
        }
        assert_eq!(
            nearest("joint.0.f-eror", ["joint.1.f-error", "joint.0.f-error"]),
            Some("joint.0.f-error")
        );
        assert_eq!(nearest("joint.0.f-error", ["spindle.0.on"]), None);
    }
}
