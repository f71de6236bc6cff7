//! Another cycle for a machine file, for measurements: the number is put in its place, so that all else is checked against it.
//!
//! In:  the text of a machine file. Out: the text with another `machine.cycle_us`, line for line the same.

use toml::de::DeTable;

/// The text with this cycle; unchanged if it has no section `machine` with a name, which is an error of its own.
pub(super) fn with_cycle_us(text: &str, cycle_us: u32) -> String {
    let (document, _) = DeTable::parse_recoverable(text);
    let machine = document
        .get_ref()
        .get("machine")
        .and_then(|machine| machine.get_ref().as_table());
    let key = |name: &str| machine.and_then(|machine| machine.get_key_value(name));
    match (key("cycle_us"), key("name")) {
        (Some((_, value)), _) => {
            let span = value.span();
            format!("{}{cycle_us}{}", &text[..span.start], &text[span.end..])
        }
        (None, Some((name, _))) => {
            let start = text[..name.span().start].rfind('\n').map_or(0, |newline| newline + 1);
            format!("{}cycle_us = {cycle_us}\n{}", &text[..start], &text[start..])
        }
        (None, None) => text.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::with_cycle_us;

    #[test]
    fn the_number_is_put_in_its_place() {
        let text = "schema = 1\n[machine]\nname = \"a\"\ncycle_us = 1_000 # usual\n[rt]\n";
        let other = "schema = 1\n[machine]\nname = \"a\"\ncycle_us = 500 # usual\n[rt]\n";
        assert_eq!(with_cycle_us(text, 500), other);
        let without = "[rt]\n[machine]\n  name = \"a\"\n";
        assert_eq!(
            with_cycle_us(without, 250),
            "[rt]\n[machine]\ncycle_us = 250\n  name = \"a\"\n"
        );
        assert_eq!(with_cycle_us("[rt]\n", 250), "[rt]\n");
        assert_eq!(with_cycle_us("[machine\nname = 1", 250).lines().count(), 2);
    }
}
