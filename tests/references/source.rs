//! Variants of an enum and what their comments say, from the source.

/// One variant.
pub(crate) struct Variant {
    pub(crate) name: String,
    /// Its comment on one line.
    pub(crate) doc: String,
}

/// All variants of an enum, in their order.
pub(crate) fn variants(path: &str, name: &str) -> Vec<Variant> {
    let text = std::fs::read_to_string(crate::root(path)).unwrap_or_else(|error| panic!("{path}: {error}"));
    // An enum of codes is declared within `codes!`: deeper, with its group.
    let (begin, indent) = match text.contains(&format!("pub enum {name} {{\n")) {
        true => (format!("pub enum {name} {{\n"), ""),
        false => (format!("    {name} \""), "    "),
    };
    let body = text.split_once(&begin);
    let body = body.unwrap_or_else(|| panic!("{path}: no enum {name}")).1;
    let mut variants = Vec::new();
    let mut doc = Vec::new();
    // Indented by four: what belongs to a variant's fields stands deeper.
    let (end, indented) = (format!("{indent}}}"), format!("{indent}    "));
    let lines = body.lines().take_while(|line| *line != end);
    for line in lines
        .filter_map(|line| line.strip_prefix(&indented))
        .filter(|line| !line.starts_with(' '))
    {
        if let Some(comment) = line.strip_prefix("/// ") {
            doc.push(comment);
        } else if line.starts_with(char::is_uppercase) {
            let name = line.chars().take_while(|letter| letter.is_alphanumeric()).collect();
            let doc = std::mem::take(&mut doc).join(" ");
            variants.push(Variant { name, doc });
        }
    }
    assert!(variants.len() > 1, "{path}: hardly a variant of {name}");
    variants
}

/// Fails unless the examples have all variants of an enum, by their names.
pub(crate) fn covers(path: &str, name: &str, examples: &[impl std::fmt::Debug]) {
    let named: Vec<String> = examples.iter().map(|example| format!("{example:?}")).collect();
    for variant in variants(path, name) {
        let is_it =
            |text: &&String| text.split(|letter: char| !letter.is_alphanumeric()).next() == Some(&*variant.name);
        assert!(
            named.iter().any(|text| is_it(&text)),
            "no example of {name}::{}",
            variant.name
        );
    }
}
