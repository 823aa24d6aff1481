//! Channels are announced again, so that they outlive the chunk in which they were announced first.
//!
//! A channel is announced once, in the chunk of its first message, and once more at the end of the file. If the logger
//! was killed there is no end, and whatever makes that chunk unreadable takes the names of all that its channels said.
//! So the writer says them again in a metadata record beside the chunks, which other programs pass over: as JSON, with
//! its checksum.

use std::collections::BTreeMap;

use mcap::records;
use serde::{Deserialize, Serialize};

/// The metadata record's name.
pub(crate) const NAME: &str = "elk.channels";
/// What it holds.
const CHANNELS: &str = "channels";
const CHECKSUM: &str = "crc32";

/// What a channel of elk's was announced with. Of its schema the name says all.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct SaidChannel {
    pub id: u16,
    pub topic: String,
    pub schema: String,
    pub encoding: String,
    pub metadata: BTreeMap<String, String>,
}

/// The record that says these channels.
pub(crate) fn record(channels: &[SaidChannel]) -> Result<records::Metadata, serde_json::Error> {
    let channels = serde_json::to_string(channels)?;
    let checksum = format!("{:08x}", crc32fast::hash(channels.as_bytes()));
    let metadata = BTreeMap::from([(CHANNELS.into(), channels), (CHECKSUM.into(), checksum)]);
    Ok(records::Metadata { name: NAME.into(), metadata })
}

/// The channels that a record says; what does not agree with its checksum says none.
pub(crate) fn channels(record: &records::Metadata) -> Vec<SaidChannel> {
    let said = record.metadata.get(CHANNELS).zip(record.metadata.get(CHECKSUM));
    let right = said.filter(|(said, sum)| format!("{:08x}", crc32fast::hash(said.as_bytes())) == **sum);
    right.and_then(|(said, _)| serde_json::from_str(said).ok()).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn channels_come_back_and_damaged_ones_do_not() {
        let metadata = BTreeMap::from([("source".into(), "Sensor".into()), ("layout".into(), "00ff".into())]);
        let scan = SaidChannel {
            id: 7,
            topic: "SCAN".into(),
            schema: "foxglove.PointCloud".into(),
            encoding: "protobuf".into(),
            metadata,
        };
        let said = vec![scan.clone(), SaidChannel { id: 8, topic: "A \"name\"".into(), ..scan }];
        let mut record = record(&said).unwrap();
        assert_eq!(channels(&record), said);
        record.metadata.get_mut(CHANNELS).unwrap().replace_range(10..11, "x");
        assert_eq!(channels(&record), []);
    }
}
