//! What is in a log, in words and as JSON.

use std::fmt::Write as _;
use std::path::Path;
use std::process::ExitCode;

use anyhow::Result;
use elk_log::csv::LONGEST_JSON;
use elk_log::index::{Extra, ExtraKind};
use elk_log::{Index, Metadata};
use elk_outside::text;
use serde_json::{Value as Json, json};

use super::reading::HOW_TO_MEND;
use crate::terminal::{progress, say};

/// `elk log info`
pub fn info(log: &Path, as_json: bool) -> Result<ExitCode> {
    let index = Index::read(log, &mut progress("reading a log without an index:"))?;
    say(&if as_json { info_json(&index)? } else { info_text(&index) })?;
    Ok(ExitCode::SUCCESS)
}

fn info_json(index: &Index) -> Result<String> {
    let topic = |topic: &elk_log::Topic| {
        json!({
            "name": topic.name, "source": topic.source, "type": topic.type_name, "schema": topic.schema,
            "count": topic.count,
        })
    };
    let Metadata { mission_name, version, seed, started, world, world_checksum, effective_mission, run, .. } =
        &index.metadata;
    let span = index.span();
    // A tree of it takes many times its length.
    let said = match run.len() > LONGEST_JSON {
        true => Json::from(run.as_str()),
        false => serde_json::from_str(run).unwrap_or_default(),
    };
    let (extras, unnamed) = index.extras();
    let of_kind = |kind| extras.iter().filter(move |extra| extra.kind == kind).map(extra_json).collect::<Vec<_>>();
    let info = json!({
        "files": index.files().collect::<Vec<_>>(),
        "bytes": index.bytes(),
        "messages": index.messages(),
        "topics": index.topics().iter().map(topic).collect::<Vec<_>>(),
        "attachments": of_kind(ExtraKind::Attachment),
        "metadata": of_kind(ExtraKind::Metadata),
        "attachments_and_metadata_not_listed": unnamed,
        "start": span.map(|(start, _)| start),
        "end": span.map(|(_, end)| end),
        "whole": index.whole(),
        "damage": index.damage(),
        "dropped": index.dropped(),
        "mission": mission_name,
        "seed": seed,
        "version": version,
        "started": started,
        "world": world,
        "world_checksum": world_checksum,
        "effective_mission": effective_mission,
        "run": said,
    });
    Ok(text::printable_json(&serde_json::to_string_pretty(&info)?).into_owned() + "\n")
}

fn extra_json(extra: &Extra) -> Json {
    let Extra { kind, name, media_type, count, bytes } = extra;
    match kind {
        ExtraKind::Attachment => json!({ "name": name, "media_type": media_type, "count": count, "bytes": bytes }),
        ExtraKind::Metadata => json!({ "name": name, "count": count, "bytes": bytes }),
    }
}

fn info_text(index: &Index) -> String {
    let mut said = String::new();
    let Metadata { mission_name, version, seed, world, world_checksum, .. } = &index.metadata;
    for file in index.files() {
        let _ = writeln!(said, "{}", file.display());
    }
    if !mission_name.is_empty() {
        // A world that is built in has no checksum, and a mission may have no world.
        let world = format!("world {world} {world_checksum}");
        let world = if world.trim_end() == "world" { "no world" } else { world.trim_end() };
        let _ = writeln!(said, "  mission {mission_name}, seed {seed}, {world}, elk {version}");
    }
    let secs = index.span().map_or(0.0, |(start, end)| end - start);
    let bytes = index.bytes() as f64 / 1e6;
    let _ = writeln!(said, "  {} messages in {secs:.3} s, {bytes:.1} MB", index.messages());
    match index.dropped() {
        0 => {}
        dropped => said += &format!("  {dropped} messages are missing: the logger did not keep up\n"),
    }
    match index.whole() {
        true => said += "  has its end (elk log check reads all of it)\n",
        false => {
            index.damage().iter().for_each(|reason| said += &format!("  NOT whole: {reason}\n"));
            said += HOW_TO_MEND;
        }
    }
    let _ = writeln!(said, "  {:<24} {:<16} {:<20} {:>10}", "variable", "source", "type", "messages");
    for topic in index.topics() {
        let elk_log::Topic { name, source, type_name, count, .. } = &topic;
        let (name, source, type_name) = (text::name(name), text::name(source), text::name(type_name));
        let _ = writeln!(said, "  {name:<24} {source:<16} {type_name:<20} {count:>10}");
    }
    put_extras(index, &mut said);
    said
}

/// What stands in a log beside its messages, if anything does.
fn put_extras(index: &Index, said: &mut String) {
    let (extras, unnamed) = index.extras();
    if !extras.is_empty() {
        let _ = writeln!(
            said,
            "  {:<24} {:<16} {:<20} {:>10} {:>12}",
            "beside them", "kind", "media type", "count", "bytes"
        );
    }
    for extra in &extras {
        let (name, media_type, kind) = (text::name(&extra.name), text::name(&extra.media_type), extra.kind.word());
        let _ = writeln!(said, "  {name:<24} {kind:<16} {media_type:<20} {:>10} {:>12}", extra.count, extra.bytes);
    }
    if unnamed > 0 {
        let _ = writeln!(said, "  {unnamed} attachments and metadata more, of other names or too large to be read");
    }
}
