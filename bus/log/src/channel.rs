//! A channel of a log: what its messages say of themselves once for all of them.

use std::collections::BTreeMap;

use mcap::records;

use crate::encoding::{self, Kind};

/// A channel, as far as a reader has to know it.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Channel {
    pub key: String,
    pub source: String,
    pub community: String,
    pub epoch: u64,
    /// The schema's name: what its messages are, for people.
    pub schema: String,
    pub kind: ChannelKind,
}

#[derive(Debug, Clone, PartialEq)]
pub(crate) enum ChannelKind {
    /// Messages of the bus.
    Value(Kind),
    /// The logger's own losses.
    Dropped,
    /// Another tool's.
    Foreign,
}

impl Channel {
    /// What `channel` announces, under the schema called `schema`.
    pub fn announced(channel: records::Channel, schema: &str) -> Self {
        let said = |name: &str| text(&channel.metadata, name);
        let kind = match Kind::announced(&channel.message_encoding, schema, &said("type"), &said("layout")) {
            Some(kind) => ChannelKind::Value(kind),
            None if schema == encoding::DROPPED => ChannelKind::Dropped,
            None => ChannelKind::Foreign,
        };
        Self {
            source: said("source"),
            community: said("community"),
            epoch: said("epoch").parse().unwrap_or_default(),
            schema: schema.into(),
            key: channel.topic,
            kind,
        }
    }

    /// Bytes of all that is kept of its names.
    pub fn names_bytes(&self) -> usize {
        let Self { key, source, community, schema, .. } = self;
        [key, source, community, schema].map(String::len).iter().sum::<usize>() + self.type_name().len()
    }

    /// What its values are, as the bus calls it: `double`, `text`, or the type's name.
    pub fn type_name(&self) -> &str {
        match &self.kind {
            ChannelKind::Value(Kind::Double) => "double",
            ChannelKind::Value(Kind::Text) => "text",
            ChannelKind::Value(
                Kind::Protobuf { type_name, .. } | Kind::Known { type_name, .. } | Kind::Binary { type_name, .. },
            ) => type_name,
            ChannelKind::Dropped | ChannelKind::Foreign => &self.schema,
        }
    }
}

/// What `metadata` says under `name`; empty: nothing.
pub(crate) fn text(metadata: &BTreeMap<String, String>, name: &str) -> String {
    metadata.get(name).cloned().unwrap_or_default()
}
