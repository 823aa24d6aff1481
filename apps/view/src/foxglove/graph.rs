//! Who writes which variable, and who reads it, as Foxglove's clients draw it.

use std::collections::{BTreeMap, BTreeSet};

use elk_bus::broker::table::CommunityTable;
use elk_bus::pattern;
use serde_json::{Value, json};

/// Names of clients, by variable.
type Clients = BTreeMap<String, BTreeSet<String>>;

/// Who says what to whom in a community.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct Graph {
    writers: Clients,
    readers: Clients,
    /// Who does what services do.
    services: Clients,
}

impl Graph {
    /// That of a community; `services` are done by whoever is called `provider`.
    pub fn of(table: &CommunityTable, services: impl Iterator<Item = &'static str>, provider: &str) -> Self {
        let mut graph = Self::default();
        for variable in &table.variables {
            let writers = graph.writers.entry(variable.name.clone()).or_default();
            writers.extend(variable.routes.iter().map(|route| route.source.clone()));
            let readers = variable.routes.iter().flat_map(|route| route.readers.iter().cloned());
            graph.readers.entry(variable.name.clone()).or_default().extend(readers);
        }
        // Routes come with what is said; who waits for a first word has only registered.
        for client in &table.clients {
            for registration in client.registrations.iter().filter(|one| pattern::is_literal(&one.key_pattern)) {
                if !graph.writers.contains_key(&registration.key_pattern) {
                    let readers = graph.readers.entry(registration.key_pattern.clone()).or_default();
                    readers.insert(client.name.clone());
                }
            }
        }
        graph.services = services.map(|name| (name.to_owned(), BTreeSet::from([provider.to_owned()]))).collect();
        graph
    }

    /// What somebody who knows `before` has to be told; `None`: nothing.
    pub fn update(&self, before: &Self) -> Option<Value> {
        if self == before {
            return None;
        }
        let gone = |now: &Clients, before: &Clients| -> BTreeSet<String> {
            before.keys().filter(|name| !now.contains_key(*name)).cloned().collect()
        };
        let is_there = |name: &String| self.writers.contains_key(name) || self.readers.contains_key(name);
        let topics = before.writers.keys().chain(before.readers.keys()).filter(|name| !is_there(name));
        Some(json!({
            "op": "connectionGraphUpdate",
            "publishedTopics": changed(&self.writers, &before.writers, "publisherIds"),
            "subscribedTopics": changed(&self.readers, &before.readers, "subscriberIds"),
            "advertisedServices": changed(&self.services, &before.services, "providerIds"),
            "removedTopics": topics.collect::<BTreeSet<_>>(),
            "removedServices": gone(&self.services, &before.services),
        }))
    }
}

/// Variables whose clients are others than before; of one that is gone, nobody.
fn changed(now: &Clients, before: &Clients, ids: &str) -> Vec<Value> {
    let nobody = BTreeSet::new();
    let names: BTreeSet<&String> = now.keys().chain(before.keys()).collect();
    let of = |clients: &'_ Clients, name: &String| clients.get(name).cloned().unwrap_or_default();
    let differing = names.into_iter().filter(|name| now.get(*name).unwrap_or(&nobody) != &of(before, name));
    differing.map(|name| json!({"name": name, ids: of(now, name)})).collect()
}

#[cfg(test)]
mod tests {
    use elk_bus::broker::table::{LatestValue, RouteEntry, VariableEntry, VariableKind};

    use super::*;

    fn table(routes: &[(&str, &str, &[&str])]) -> CommunityTable {
        let route = |(name, source, readers): &(&str, &str, &[&str])| VariableEntry {
            name: (*name).into(),
            kind: VariableKind::Number,
            messages: 1,
            bytes: 8,
            rate_hz: 0.0,
            written: 0.0,
            writer: (*source).into(),
            latest: LatestValue::Number(1.0),
            latest_bytes: 8,
            routes: vec![RouteEntry {
                source: (*source).into(),
                readers: readers.iter().map(|reader| (*reader).to_owned()).collect(),
            }],
        };
        CommunityTable {
            community: "c".into(),
            time: 0.0,
            started: 0.0,
            clock: None,
            clients: vec![],
            variables: routes.iter().map(route).collect(),
            types: vec![],
            left_out: 0,
        }
    }

    fn graph(routes: &[(&str, &str, &[&str])]) -> Graph {
        Graph::of(&table(routes), ["pause"].into_iter(), "launcher")
    }

    #[test]
    fn a_client_is_told_what_is_other_than_what_it_knows() {
        let first = graph(&[("SCAN", "Sensor", &["Map"]), ("PLAN", "Explorer", &[])]);
        let told = first.update(&Graph::default()).unwrap();
        assert_eq!(
            told["publishedTopics"],
            json!([{"name": "PLAN", "publisherIds": ["Explorer"]}, {"name": "SCAN", "publisherIds": ["Sensor"]}])
        );
        assert_eq!(told["subscribedTopics"], json!([{"name": "SCAN", "subscriberIds": ["Map"]}]));
        assert_eq!(told["advertisedServices"], json!([{"name": "pause", "providerIds": ["launcher"]}]));
        assert_eq!(first.update(&first), None);

        let then = graph(&[("SCAN", "Sensor", &["Filter", "Map"])]);
        let told = then.update(&first).unwrap();
        assert_eq!(told["publishedTopics"], json!([{"name": "PLAN", "publisherIds": []}]));
        assert_eq!(told["subscribedTopics"], json!([{"name": "SCAN", "subscriberIds": ["Filter", "Map"]}]));
        assert_eq!((&told["removedTopics"], &told["advertisedServices"]), (&json!(["PLAN"]), &json!([])));
    }
}
