//! Who may come to a mission's broker beside its apps: `<Bus>`, and what MOOS' apps are told, `MOOSHost` and `MOOSPort`.

use elk_bus::moos::gateway::{Address, CONNECTIONS, GatewayOptions, MOST_CONNECTIONS, Network};
use elk_bus::moos::text::Texts;
use roxmltree::Node;

use crate::draft::Draft;
use crate::element;
use crate::kind::Kind;
use crate::nearest::instead;
use crate::policy::{Attribute, integer};
use crate::problem::{At, Findings};
use crate::resolve::Given;
use crate::xml::loose_text;

/// The element's name.
pub(crate) const BUS: &str = "Bus";

/// What the thesis' apps are told of where MOOS' database is, and what holds of what is left out. Elk's find their broker by the
/// community's name; to a mission it says where clients of MOOS' find it.
const HOST: (&str, &str) = ("MOOSHost", "localhost");
const PORT: (&str, &str) = ("MOOSPort", "9000");

const COUNT: Kind = Kind::Integer { min: 1, max: MOST_CONNECTIONS as i64 };

/// Its attributes.
pub(crate) const OF_BUS: [Attribute; 5] = [
    Attribute {
        name: "moos",
        kind: Kind::Text,
        default: "nowhere",
        doc: "Where clients of MOOS' may connect, as to a MOOSDB: 127.0.0.1:9000. MOOSHost and MOOSPort, said to an app of elk's, are \
              the same. An evaluation lets nobody in.",
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
    Attribute {
        name: "connections",
        kind: COUNT,
        default: "128",
        doc: "The most of them at a time; a further one is refused.",
    },
];

/// What the element says.
pub(crate) struct Said {
    at: At,
    /// Where clients may connect; `None`: it does not say so, or what it says is none.
    address: Option<Address>,
    /// Whether it says where.
    says_where: bool,
    networks: Vec<Network>,
    any_source: bool,
    texts: Texts,
    connections: usize,
}

impl Said {
    /// That clients of this machine may connect there.
    pub fn at(at: At, address: Address) -> Self {
        let (networks, any_source, texts) = (Vec::new(), false, Texts::default());
        Self { at, address: Some(address), says_where: true, networks, any_source, texts, connections: CONNECTIONS }
    }
}

/// What the element says; what is wrong with it goes to `problems`.
pub(crate) fn read(node: Node, problems: &mut Findings) -> Said {
    loose_text(node, problems);
    for child in node.children().filter(Node::is_element) {
        let said = format!("<{}> within <{BUS}>; right is nothing", child.tag_name().name());
        problems.add(&At::Byte(child.range().start), said);
    }
    let (mut address, mut networks, mut any_source, mut texts) = (None, Vec::new(), false, Texts::default());
    let mut connections = CONNECTIONS;
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
            "connections" => match integer(COUNT, value, CONNECTIONS as u32) {
                Ok(count) => connections = count as usize,
                Err(error) => problems.add(&at, format!("connections {error}")),
            },
            other => {
                let right = instead(other, &OF_BUS.each_ref().map(|attribute| attribute.name));
                problems.add(&At::Byte(attribute.range().start), format!("{BUS} has no attribute {other}; {right}"));
            }
        }
    }
    let (at, says_where) = (At::Byte(node.range().start), node.has_attribute("moos"));
    Said { at, address, says_where, networks, any_source, texts, connections }
}

/// Where clients of MOOS' of the mission itself connect if nobody says where: whoever starts it chooses the port, so that no
/// mission is in another one's way.
const ANYWHERE: &str = "127.0.0.1:0";

/// Where clients of MOOS' may connect, and which: as `<Bus>` says, or as elk's apps are told, whom it is no parameter; if some
/// are the mission's own, anywhere on this machine.
pub(crate) fn gateway(bus: Option<Said>, drafts: &mut [Draft], problems: &mut Findings) -> Option<GatewayOptions> {
    let has_clients = drafts.iter().any(Draft::is_moos);
    let [host, port] = [HOST, PORT].map(|(param, _)| of_apps(param, drafts, problems));
    let to_apps = match (&host, &port) {
        (None, None) => None,
        (Some(first), _) | (None, Some(first)) => {
            let or = |given: &Option<Given>, usual: &str| {
                given.as_ref().map_or(usual.to_owned(), |given| given.text.clone())
            };
            let said = format!("{}:{}", or(&host, HOST.1), or(&port, PORT.1)).parse::<Address>();
            said.map_err(|error| problems.add(&first.value_at, format!("{} and {}: {error}", HOST.0, PORT.0))).ok()
        }
    };
    let to_apps = to_apps.or_else(|| ANYWHERE.parse().ok().filter(|_| has_clients));
    let Some(bus) = bus else { return to_apps.map(GatewayOptions::new) };
    match &bus.address {
        Some(address) => {
            differs(HOST.0, host.as_ref(), address.host(), problems);
            differs(PORT.0, port.as_ref(), address.port(), problems);
        }
        None if !bus.says_where && to_apps.is_none() => {
            problems.add(&bus.at, format!("<{BUS}> says nothing of moos; right is moos=\"127.0.0.1:9000\""));
        }
        None => {}
    }
    let Said { networks, any_source, texts, connections, .. } = bus;
    Some(GatewayOptions { address: bus.address.or(to_apps)?, networks, any_source, texts, connections })
}

/// What elk's apps are told of a parameter, all of them the same. Of a program of somebody else's it may be a parameter.
fn of_apps(param: &str, drafts: &mut [Draft], problems: &mut Findings) -> Option<Given> {
    let mut first: Option<(String, Given)> = None;
    for draft in drafts.iter_mut().filter(|draft| draft.element != element::APP) {
        for given in draft.take(param) {
            match &first {
                Some((app, other)) if !is_same(&other.text, &given.text) => {
                    let (text, right) = (&given.text, &other.text);
                    let said = format!(
                        "{param}: {text:?} is not {app}'s {right:?}; right is one for all: clients of MOOS' connect there"
                    );
                    problems.add(&given.value_at, said);
                }
                Some(_) => {}
                None => first = Some((draft.name().to_owned(), given)),
            }
        }
    }
    first.map(|(_, given)| given)
}

/// Says what apps are told, if it is not what `<Bus>` says.
fn differs(param: &str, given: Option<&Given>, right: &str, problems: &mut Findings) {
    if let Some(given) = given.filter(|given| !is_same(&given.text, right)) {
        let said = format!(
            "{param}: {:?} is not the {right:?} of <{BUS} moos>; right is the same, or one of the two alone",
            given.text
        );
        problems.add(&given.value_at, said);
    }
}

/// Whether two words are the same host, or the same port.
fn is_same(one: &str, other: &str) -> bool {
    let plain = |word: &str| {
        if word.eq_ignore_ascii_case("localhost") { "127.0.0.1".to_owned() } else { word.to_ascii_lowercase() }
    };
    plain(one) == plain(other)
}
