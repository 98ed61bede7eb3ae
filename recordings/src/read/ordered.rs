//! The messages of a file in the order of their log time; those of one time in the order of the
//! file. In: a file. Out: one message after the other.
//!
//! Parts are opened in the order of the file, because a channel is announced before its messages. A
//! part is opened as soon as it, or a later one, may hold an earlier message than those that are
//! open.

use super::{
    MAX_CHUNK_MESSAGES, MAX_OPEN_BYTES, chunk,
    error::{ReadError, ReadFault},
    parts::{HEAD_BYTES, Part, parts, records},
};
use mcap::records::{Record, op};
use protos::prost::bytes::Bytes;
use std::{
    collections::BTreeMap,
    io::{Read, Seek, SeekFrom},
    sync::Arc,
};

/// A channel of a file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ChannelInfo {
    /// Its topic.
    pub topic: String,
    /// How its messages are written: `protobuf`, `cdr`.
    pub encoding: String,
    /// Name of its messages: `waymark.v1.Frame`, `sensor_msgs/msg/Image`; empty without a schema.
    pub schema: String,
}

/// A message of any kind.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RawMessage {
    /// Its channel.
    pub channel: Arc<ChannelInfo>,
    /// When it was recorded, ns.
    pub log_time_ns: u64,
    /// Its number, if the writer counts.
    pub sequence: u32,
    /// Its content.
    pub data: Bytes,
    /// Where its part begins in the file, bytes.
    pub offset: u64,
}

/// Reads the messages of a file in the order of time.
#[derive(Debug)]
pub struct MessageReader<R> {
    file: R,
    parts: Vec<Part>,
    cut_off_at: Option<u64>,
    next_part: usize,
    /// Bytes of each part that may have messages that wait, by its latest log time and its place.
    open: BTreeMap<(u64, u64), u64>,
    open_bytes: u64,
    /// Messages that wait for their turn: by log time, then by the order of the file.
    waiting: BTreeMap<(u64, u64), RawMessage>,
    count: u64,
    schemas: BTreeMap<u16, String>,
    channels: BTreeMap<u16, Arc<ChannelInfo>>,
}

impl<R: Read + Seek> MessageReader<R> {
    /// Walks over the file once, without reading its messages.
    pub fn open(mut file: R) -> Result<Self, ReadError> {
        let (parts, cut_off_at) = parts(&mut file)?;
        Ok(Self {
            file,
            parts,
            cut_off_at,
            next_part: 0,
            open: BTreeMap::new(),
            open_bytes: 0,
            waiting: BTreeMap::new(),
            count: 0,
            schemas: BTreeMap::new(),
            channels: BTreeMap::new(),
        })
    }

    /// Where the file ends inside a record, bytes, as that of a recorder that was killed does;
    /// messages before that are read. `None` for a whole file.
    pub fn cut_off_at(&self) -> Option<u64> {
        self.cut_off_at
    }

    /// All channels, by topic, without their messages; it unpacks every chunk once. Call it before
    /// the first message.
    pub fn channels(&mut self) -> Result<Vec<Arc<ChannelInfo>>, ReadError> {
        for part in self.parts.clone() {
            let announced = self.content(part).and_then(|content| {
                records(content)
                    .try_for_each(|record| record.and_then(|(kind, body)| self.announce(kind, &body)))
            });
            announced.map_err(|fault| fault.at(part.offset))?;
        }
        let mut all: Vec<_> = self.channels.values().cloned().collect();
        all.sort_by(|a, b| (&a.topic, &a.schema).cmp(&(&b.topic, &b.schema)));
        Ok(all)
    }

    /// The next message; `None` at the end. After an error the reader is at its end.
    pub fn next_message(&mut self) -> Result<Option<RawMessage>, ReadError> {
        while let Some(&part) = self.parts.get(self.next_part) {
            let next_ns = self.waiting.first_key_value().map(|(order, _)| order.0);
            if next_ns.is_some_and(|next_ns| next_ns < part.earliest_ns) {
                break;
            }
            while let Some(first) = self.open.first_entry()
                && next_ns.is_none_or(|next_ns| first.key().0 < next_ns)
            {
                self.open_bytes -= first.remove();
            }
            self.next_part += 1;
            if let Err(fault) = self.open_part(part) {
                self.next_part = self.parts.len();
                self.waiting.clear();
                return Err(fault.at(part.offset));
            }
        }
        Ok(self.waiting.pop_first().map(|(_, message)| message))
    }

    /// The records of a part.
    fn content(&mut self, part: Part) -> Result<Bytes, ReadFault> {
        self.file.seek(SeekFrom::Start(part.offset))?;
        let mut bytes = Vec::new();
        (&mut self.file).take(part.bytes).read_to_end(&mut bytes)?;
        if !part.is_chunk {
            return Ok(Bytes::from(bytes));
        }
        match mcap::parse_record(op::CHUNK, bytes.get(HEAD_BYTES as usize..).ok_or(ReadFault::Short)?)? {
            Record::Chunk { header, data } => Ok(Bytes::from(chunk::unpack(&header, &data)?)),
            _ => Err(ReadFault::Short),
        }
    }

    fn open_part(&mut self, part: Part) -> Result<(), ReadFault> {
        let content = self.content(part)?;
        let bytes = content.len() as u64;
        if self.open_bytes + bytes > MAX_OPEN_BYTES {
            return Err(ReadFault::Overlap(MAX_OPEN_BYTES));
        }
        let (mut messages, mut latest_ns) = (0, 0);
        for record in records(content) {
            let (kind, body) = record?;
            if kind != op::MESSAGE {
                self.announce(kind, &body)?;
                continue;
            }
            messages += 1;
            if messages > MAX_CHUNK_MESSAGES {
                return Err(ReadFault::TooManyMessages(MAX_CHUNK_MESSAGES));
            }
            let Record::Message { header, data } = mcap::parse_record(kind, &body)? else { continue };
            let channel = self.channels.get(&header.channel_id);
            let message = RawMessage {
                channel: channel.ok_or(ReadFault::Channel(header.channel_id))?.clone(),
                log_time_ns: header.log_time,
                sequence: header.sequence,
                data: body.slice_ref(&data),
                offset: part.offset,
            };
            latest_ns = latest_ns.max(header.log_time);
            self.waiting.insert((header.log_time, self.count), message);
            self.count += 1;
        }
        if messages > 0 {
            self.open.insert((latest_ns, part.offset), bytes);
            self.open_bytes += bytes;
        }
        Ok(())
    }

    /// Takes a schema or a channel. Others are not even parsed: `parse_record` panics on a short
    /// attachment.
    fn announce(&mut self, kind: u8, body: &[u8]) -> Result<(), ReadFault> {
        if !matches!(kind, op::SCHEMA | op::CHANNEL) {
            return Ok(());
        }
        match mcap::parse_record(kind, body)? {
            Record::Schema { header, .. } => {
                self.schemas.insert(header.id, header.name);
            }
            Record::Channel(channel) => {
                let schema = self.schemas.get(&channel.schema_id).cloned().unwrap_or_default();
                let info = ChannelInfo { topic: channel.topic, encoding: channel.message_encoding, schema };
                self.channels.insert(channel.id, Arc::new(info));
            }
            _ => {}
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use mcap::records::MessageHeader;
    use std::io::Cursor;

    /// Of messages of 1000 bytes, each in a chunk of its own.
    fn reader(times: impl Iterator<Item = u64>) -> MessageReader<Cursor<Vec<u8>>> {
        let mut file = Cursor::new(Vec::new());
        let options = mcap::WriteOptions::new().compression(None).chunk_size(Some(1));
        let mut writer = options.create(&mut file).unwrap();
        let channel_id = writer.add_channel(0, "/a", "cdr", &BTreeMap::new()).unwrap();
        for log_time in times {
            let header = MessageHeader { channel_id, sequence: 0, log_time, publish_time: 0 };
            writer.write_to_known_channel(&header, &[0; 1000]).unwrap();
        }
        writer.finish().unwrap();
        drop(writer);
        MessageReader::open(file).unwrap()
    }

    #[test]
    fn parts_are_open_only_while_their_messages_wait_and_not_too_many() {
        let mut in_order = reader(0..100);
        for time in 0..100 {
            assert_eq!(in_order.next_message().unwrap().unwrap().log_time_ns, time);
            assert!(in_order.open_bytes < 3000, "{}", in_order.open_bytes);
        }
        let mut overlapping = reader((0..100).rev());
        overlapping.open_bytes = MAX_OPEN_BYTES - 50_000;
        let error = overlapping.next_message().unwrap_err();
        assert!(matches!(error.fault, ReadFault::Overlap(_)), "{error}");
        assert_eq!(overlapping.next_message().unwrap(), None);
    }
}
