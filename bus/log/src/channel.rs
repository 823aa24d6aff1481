//! A channel of a log: what its messages say of themselves once for all of them.

use std::collections::BTreeMap;
use std::sync::Arc;

use mcap::records;

use elk_bus::Type;

use crate::encoding::{self, Kind};
use crate::foreign::{Foreign, Schema};
use crate::said::{Garbled, text};

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
    Foreign(Foreign),
}

impl Channel {
    /// What `channel` announces, whose messages are made as `schema` says; what is garbled of it goes into `garbled`.
    pub fn announced(channel: records::Channel, schema: Option<&Arc<Schema>>, garbled: &mut Garbled) -> Self {
        let said = |name: &str| text(&channel.metadata, name);
        let name = schema.map_or("", |schema| schema.name.as_str());
        let (source, community) = (said("source"), said("community"));
        let epoch = garbled.number(&channel.metadata, "epoch");
        let kind = match Kind::announced(&channel.message_encoding, name, type_of(&channel.metadata)) {
            Some(kind) => ChannelKind::Value(kind),
            None if name == encoding::DROPPED => ChannelKind::Dropped,
            None => {
                let (schema, metadata) = (schema.cloned(), channel.metadata);
                ChannelKind::Foreign(Foreign::announced(schema, channel.message_encoding, metadata))
            }
        };
        Self { source, community, epoch, schema: name.into(), key: channel.topic, kind }
    }

    /// Whether elk knows what its messages say.
    pub fn is_understood(&self) -> bool {
        if let ChannelKind::Foreign(foreign) = &self.kind { foreign.is_understood() } else { true }
    }

    /// Bytes of all that is kept of its names.
    pub fn names_bytes(&self) -> usize {
        let Self { key, source, community, schema, .. } = self;
        let foreign = match &self.kind {
            ChannelKind::Foreign(foreign) => foreign.names_bytes(),
            ChannelKind::Value(kind) => kind.type_().map_or(0, Type::kept_bytes),
            ChannelKind::Dropped => 0,
        };
        [key, source, community, schema].map(String::len).iter().sum::<usize>() + self.type_name().len() + foreign
    }

    /// What its values are, as people call it: `number`, `text`, or the type's name.
    pub fn type_name(&self) -> &str {
        match &self.kind {
            ChannelKind::Value(Kind::Double) => "number",
            ChannelKind::Value(Kind::Text) => "text",
            ChannelKind::Value(kind) => kind.type_().map_or("", |type_| type_.as_ref().name()),
            ChannelKind::Foreign(foreign) => foreign.type_name(),
            ChannelKind::Dropped => &self.schema,
        }
    }
}

/// The type that a channel's metadata name, if they name one. A description that is none is as good as none.
fn type_of(metadata: &BTreeMap<String, String>) -> Option<Type> {
    let said = |name: &str| metadata.get(name).map(String::as_str).unwrap_or_default();
    let layout = u64::from_str_radix(said("layout"), 16).ok()?;
    let name = Some(said("type")).filter(|name| !name.is_empty())?;
    Some(Type::from_text(name, layout, said("description")).unwrap_or_else(|_| Type::undescribed(name, layout)))
}
