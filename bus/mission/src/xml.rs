//! Texts of XML elements, and where they stand.

use roxmltree::Node;

use crate::problem::{At, Findings};

/// The most attributes of an element: they are held against each other, each against all.
const MOST_ATTRIBUTES: usize = 1000;

/// Where an element with too many attributes begins, and what is right: looked for before the text is read as XML, by quotes, of
/// which each attribute has two.
pub fn crowded(text: &str) -> Option<(usize, String)> {
    let mut from = 0;
    for element in text.split_inclusive('<') {
        let quotes = quotes_of_tag(element);
        if quotes > 2 * MOST_ATTRIBUTES {
            let what =
                format!("there are {quotes} quotes in one element; at most {MOST_ATTRIBUTES} attributes are right");
            return Some((from, what));
        }
        from += element.len();
    }
    None
}

/// Quotes around values in what follows a `<`, up to the `>` that belongs to it. A comment and the like has none.
fn quotes_of_tag(element: &str) -> usize {
    if element.starts_with(['!', '?']) {
        return 0;
    }
    let (mut quotes, mut open) = (0, None);
    for byte in element.bytes() {
        match (byte, open) {
            (b'>', None) => break,
            (b'"' | b'\'', None) => (quotes, open) = (quotes + 1, Some(byte)),
            (_, Some(quote)) if quote == byte => (quotes, open) = (quotes + 1, None),
            _ => {}
        }
    }
    quotes
}

/// Text between elements is a forgotten tag.
pub(crate) fn loose_text(parent: Node, problems: &mut Findings) {
    for text in parent.children().filter(Node::is_text) {
        let said = text.text().unwrap_or_default();
        if !said.trim().is_empty() {
            let lead = said.len() - said.trim_start().len();
            let at = At::Byte(text.range().start + lead);
            let word = said.split_whitespace().next().unwrap_or_default();
            let parent = parent.tag_name().name();
            problems.add(&at, format!("{word:?} stands loose in <{parent}>; right is an element"));
        }
    }
}

/// Where the first letter of an element's text stands.
pub(crate) fn value_at(node: Node) -> Option<At> {
    let text = node.children().find(|child| own_text(*child).is_some_and(|t| !t.trim().is_empty()))?;
    let said = text.text()?;
    let lead = said.len() - said.trim_start().len();
    Some(At::Byte(text.range().start + lead))
}

/// The text of a text node; comments have text, too, and do not count.
pub(crate) fn own_text<'a>(node: Node<'a, '_>) -> Option<&'a str> {
    node.text().filter(|_| node.is_text())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Regression: half a megabyte of one element's attributes took seconds to be held against each other.
    #[test]
    fn attributes_are_counted_before_they_are_read() {
        let with = |attributes: usize| format!("<A>\n<B {}/></A>", "a = '1' ".repeat(attributes));
        assert_eq!(crowded(&with(MOST_ATTRIBUTES)), None);
        let (byte, what) = crowded(&with(MOST_ATTRIBUTES + 1)).unwrap();
        assert_eq!(&with(1)[byte..=byte], "B");
        assert_eq!(what, "there are 2002 quotes in one element; at most 1000 attributes are right");
        assert_eq!(crowded(&"<a b='1'/>".repeat(10_000)), None, "of many elements each has few");
        let quotes = "\"".repeat(10_000);
        assert_eq!(
            crowded(&format!("<!-- {quotes} --><A b='>'>{quotes}</A>")),
            None,
            "of texts and comments they are none"
        );
    }
}
