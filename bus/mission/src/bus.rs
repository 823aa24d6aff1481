//! `<Bus>`: who may come to a mission's broker beside its apps.

use elk_bus::moos::gateway::{Address, GatewayOptions, Network};
use elk_bus::moos::text::Texts;
use roxmltree::Node;

use crate::kind::Kind;
use crate::nearest::instead;
use crate::policy::Attribute;
use crate::problem::{At, Findings};
use crate::xml::loose_text;

/// The element's name.
pub(crate) const BUS: &str = "Bus";

/// Its attributes.
pub(crate) const OF_BUS: [Attribute; 4] = [
    Attribute {
        name: "moos",
        kind: Kind::Text,
        default: "nowhere",
        doc: "Where clients of MOOS' may connect, as to a MOOSDB: 127.0.0.1:9000. An evaluation lets nobody in.",
    },
    Attribute {
        name: "from",
        kind: Kind::Text,
        default: "this machine alone",
        doc: "From where else they may: networks such as 192.168.1.0/24, with blanks between them.",
    },
    Attribute {
        name: "sources",
        kind: Kind::Choice(&["own", "any"]),
        default: "own",
        doc: "Under whose names they may publish: players of logs and bridges do so under others'.",
    },
    Attribute {
        name: "texts",
        kind: Kind::Text,
        default: "none",
        doc: "Variables whose typed values they hear and say as Key=Value texts: names or patterns, with blanks between them.",
    },
];

/// What the element says; what is wrong with it goes to `problems`.
pub(crate) fn read(node: Node, problems: &mut Findings) -> Option<GatewayOptions> {
    loose_text(node, problems);
    for child in node.children().filter(Node::is_element) {
        let said = format!("<{}> within <{BUS}>; right is nothing", child.tag_name().name());
        problems.add(&At::Byte(child.range().start), said);
    }
    let (mut address, mut networks, mut any_source, mut texts) = (None, Vec::new(), false, Texts::default());
    for attribute in node.attributes() {
        let at = At::Byte(attribute.range_value().start);
        let value = attribute.value().trim();
        match attribute.name() {
            "moos" => match value.parse::<Address>() {
                Ok(parsed) => address = Some(parsed),
                Err(error) => problems.add(&at, format!("moos: {error}")),
            },
            "from" => value.split_whitespace().for_each(|one| match one.parse::<Network>() {
                Ok(parsed) => networks.push(parsed),
                Err(error) => problems.add(&at, format!("from: {error}")),
            }),
            "sources" if value == "any" => any_source = true,
            "sources" if value == "own" => {}
            "sources" => {
                let right = instead(value, &["own", "any"]);
                problems.add(&at, format!("sources {value:?} is not offered; {right}"));
            }
            "texts" => texts = Texts::of(value),
            other => {
                let right = instead(other, &OF_BUS.each_ref().map(|attribute| attribute.name));
                problems.add(&At::Byte(attribute.range().start), format!("{BUS} has no attribute {other}; {right}"));
            }
        }
    }
    if address.is_none() && !node.has_attribute("moos") {
        problems.add(
            &At::Byte(node.range().start),
            format!("<{BUS}> says nothing of moos; right is moos=\"127.0.0.1:9000\""),
        );
    }
    Some(GatewayOptions { networks, any_source, texts, ..GatewayOptions::new(address?) })
}
