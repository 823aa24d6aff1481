//! What clients ask the server for, read from the broker's table.

use elk_proto::broker::{Broker, Carried, Surveyed};
use elk_proto::types::Type;
use elk_proto::wire::{self, BULK, ValueKind};

use crate::message::{Data, Kind, Message, NO_NUMBER, REQUEST_ID};
use crate::outgoing::PacketWriter;
use crate::session::{Answers, Request, data_of};
use crate::text::{Form, Texts};

/// The longest answer (bytes, about): of variables beyond it the names are said, and not the values.
const LONGEST: usize = 16 << 20;

/// The answers to what a client has asked.
pub(super) struct Answering<'a> {
    pub broker: &'a Broker,
    pub texts: &'a Texts,
    pub requests: Vec<Request>,
}

impl Answering<'_> {
    /// The value of a variable as text, if it is told as one and can be.
    fn text(&self, one: &Surveyed<'_>) -> Option<String> {
        let latest = one.latest.as_ref().filter(|frame| frame.header.flags & BULK == 0)?;
        let poses = self.texts.poses(one.key).filter(|_| latest.header.value_kind == ValueKind::Binary)?;
        let Some(Carried::Typed { name, layout, description }) = self.broker.carried(one.key) else { return None };
        let form = Form::of(Type::from_text(name, layout, description).ok()?).ok()?;
        form.text(one.key, latest.value, poses).ok()
    }
}

impl Answers for Answering<'_> {
    fn put(&mut self, packet: &mut PacketWriter<'_>) {
        for request in std::mem::take(&mut self.requests) {
            match request {
                Request::All => self.broker.survey().for_each(|one| put_variable(&one, self.text(&one), packet)),
                Request::Variables => {
                    let mut names: Vec<&str> = self.broker.survey().map(|one| one.key).collect();
                    names.sort_unstable();
                    put_text("VAR_SUMMARY", &names.join(","), packet);
                }
                Request::Processes => {
                    for (name, read, written) in self.broker.reads_and_writes() {
                        let list = |names: &[&str]| names.iter().map(|name| format!(",{name}")).collect::<String>();
                        let (read, written) = (list(&read), list(&written));
                        let text = format!("{name}:SUBSCRIBED={read},PUBLISHED={written}");
                        put_text("PROC_SUMMARY", &text, packet);
                    }
                }
            }
        }
    }
}

fn put_text(key: &str, text: &str, packet: &mut PacketWriter<'_>) {
    let answer = Message::new(Kind::NOTIFY, Data::STRING);
    packet.put(&Message { id: REQUEST_ID, key: key.as_bytes(), value: text.as_bytes(), ..answer });
}

/// A variable, its value perhaps as text: its time is since the server's start, its second number how often it is written
/// (Hz).
fn put_variable(one: &Surveyed<'_>, text: Option<String>, packet: &mut PacketWriter<'_>) {
    let message = Message { id: REQUEST_ID, key: one.key.as_bytes(), ..Message::new(Kind::NOTIFY, Data::NOT_SET) };
    // One that somebody waits for, and nobody has written.
    let Some(frame) = &one.latest else { return packet.put(&Message { second: one.rate_hz, ..message }) };
    let (data, bytes) = match &text {
        Some(text) => (Data::STRING, text.as_bytes()),
        None => (data_of(frame.header.value_kind), frame.value),
    };
    let is_here = frame.header.flags & BULK == 0 && packet.written() + bytes.len() <= LONGEST;
    packet.put(&Message {
        data,
        source: one.source.as_bytes(),
        source_aux: frame.aux,
        community: one.community.as_bytes(),
        time: if one.written_secs < 0.0 { NO_NUMBER } else { one.written_secs },
        number: if data == Data::DOUBLE { wire::double(frame.value).unwrap_or(NO_NUMBER) } else { NO_NUMBER },
        second: one.rate_hz,
        value: if data != Data::DOUBLE && is_here { bytes } else { b"" },
        ..message
    });
}
