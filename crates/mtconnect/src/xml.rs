//! Elements, and their text.

use quick_xml::Writer;
use quick_xml::events::{BytesDecl, BytesEnd, BytesStart, BytesText, Event};

/// An element.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Element {
    pub(crate) name: String,
    pub(crate) attributes: Vec<(&'static str, String)>,
    pub(crate) text: String,
    pub(crate) children: Vec<Element>,
}

impl Element {
    pub(crate) fn new(name: impl Into<String>) -> Element {
        Element {
            name: name.into(),
            ..Element::default()
        }
    }

    pub(crate) fn with(mut self, attribute: &'static str, value: impl Into<String>) -> Element {
        self.attributes.push((attribute, value.into()));
        self
    }

    pub(crate) fn saying(self, text: impl Into<String>) -> Element {
        let text = text.into();
        Element { text, ..self }
    }

    pub(crate) fn holding(mut self, children: impl IntoIterator<Item = Element>) -> Element {
        self.children.extend(children);
        self
    }

    pub(crate) fn attribute(&self, name: &str) -> Option<&str> {
        let found = self.attributes.iter().find(|(known, _)| *known == name);
        found.map(|(_, value)| value.as_str())
    }

    /// The document whose root this is.
    pub(crate) fn document(&self) -> String {
        let mut writer = Writer::new_with_indent(Vec::new(), b' ', 2);
        // Into memory nothing fails.
        let _ = writer.write_event(Event::Decl(BytesDecl::new("1.0", Some("UTF-8"), None)));
        write(&mut writer, self);
        let mut octets = writer.into_inner();
        octets.push(b'\n');
        String::from_utf8(octets).unwrap_or_default()
    }
}

fn write(to: &mut Writer<Vec<u8>>, element: &Element) {
    let mut start = BytesStart::new(element.name.as_str());
    for (name, value) in &element.attributes {
        start.push_attribute((*name, plain(value).as_str()));
    }
    if element.text.is_empty() && element.children.is_empty() {
        let _ = to.write_event(Event::Empty(start));
        return;
    }
    let _ = to.write_event(Event::Start(start));
    if !element.text.is_empty() {
        let _ = to.write_event(Event::Text(BytesText::new(&plain(&element.text))));
    }
    element.children.iter().for_each(|child| write(to, child));
    let _ = to.write_event(Event::End(BytesEnd::new(element.name.as_str())));
}

/// What XML cannot hold is left out.
fn plain(text: &str) -> String {
    let may_be = |c: &char| matches!(c, ' '..='\u{D7FF}' | '\u{E000}'..='\u{FFFD}' | '\u{10000}'..);
    text.chars()
        .map(|c| if c.is_ascii_whitespace() { ' ' } else { c })
        .filter(may_be)
        .collect()
}

/// Whether a text may be an XML name without a colon, as identifiers have to be.
pub(crate) fn is_name(text: &str) -> bool {
    let is_first = |c: char| c.is_ascii_alphabetic() || c == '_';
    text.starts_with(is_first)
        && text
            .chars()
            .all(|c| is_first(c) || c.is_ascii_digit() || c == '-' || c == '.')
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn elements_are_written_with_what_they_hold() {
        let text = Element::new("A")
            .with("x", "1 < \"2\" & '3'")
            .holding([Element::new("B").saying("<&>"), Element::new("C")])
            .document();
        assert!(
            text.starts_with("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<A x="),
            "{text}"
        );
        let read = roxmltree::Document::parse(&text).unwrap();
        let root = read.root_element();
        assert_eq!(root.attribute("x"), Some("1 < \"2\" & '3'"));
        assert_eq!(root.first_element_child().unwrap().text(), Some("<&>"));
    }

    #[test]
    fn names_are_told_from_what_is_none() {
        for name in ["a", "_1", "T-1.b"] {
            assert!(is_name(name), "{name}");
        }
        for name in ["", "1", "-a", "a b", "ä", "a:b"] {
            assert!(!is_name(name), "{name}");
        }
    }

    proptest! {
        #[test]
        fn any_text_is_read_back_but_for_what_xml_cannot_hold(text in any::<String>()) {
            let written = Element::new("A").with("x", text.clone()).saying(text.clone()).document();
            let read = roxmltree::Document::parse(&written).unwrap();
            prop_assert_eq!(read.root_element().attribute("x").unwrap(), plain(&text));
        }
    }
}
