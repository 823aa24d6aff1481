//! Texts of XML elements, and where they stand.

use roxmltree::Node;

use crate::problem::{At, Findings};

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
