//! The messages of a file in the order of their log time; those of one time in the order of the file. In: a file. Out:
//! one message after the other.
//!
//! Parts are opened in the order of the file, because a channel is announced before its messages. A part is opened as
//! soon as it, or a later one, may hold an earlier message than those that are open.

use super::{
    MAX_CHUNK_MESSAGES, MAX_OPEN_BYTES, chunk,
    error::{ReadError, ReadFault},
    parts::{Part, Parts, parts},
    records::{HEAD_BYTES, MESSAGE_HEAD_BYTES, announcement, message_head, walk},
};
use mcap::records::{Record, op};
use protos::prost::bytes::Bytes;
use std::{
    cmp::Reverse,
    collections::{BTreeMap, BinaryHeap},
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

/// A message that waits for its turn: by log time, then by the order of the file.
#[derive(Debug, PartialEq, Eq)]
struct Waiting {
    order: (u64, u64),
    part: usize,
    message: RawMessage,
}

impl Ord for Waiting {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.order.cmp(&other.order)
    }
}

impl PartialOrd for Waiting {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

/// Reads the messages of a file in the order of time.
#[derive(Debug)]
pub struct MessageReader<R> {
    file: R,
    parts: Vec<Part>,
    /// For each part, the earliest time of it and all that follow, ns.
    earliest_ns: Vec<u64>,
    cut_off_at: Option<u64>,
    next_part: usize,
    /// Messages that wait, of each open part, with its bytes.
    open: BTreeMap<usize, (usize, u64)>,
    waiting: BinaryHeap<Reverse<Waiting>>,
    count: u64,
    schemas: BTreeMap<u16, String>,
    channels: BTreeMap<u16, Arc<ChannelInfo>>,
}

impl<R: Read + Seek> MessageReader<R> {
    /// Walks over the file once, without reading its messages.
    pub fn open(mut file: R) -> Result<Self, ReadError> {
        let Parts { parts, cut_off_at } = parts(&mut file)?;
        let mut earliest_ns: Vec<u64> = parts.iter().map(|part| part.start_ns).collect();
        for i in (1..earliest_ns.len()).rev() {
            earliest_ns[i - 1] = earliest_ns[i - 1].min(earliest_ns[i]);
        }
        Ok(Self {
            file,
            parts,
            earliest_ns,
            cut_off_at,
            next_part: 0,
            open: BTreeMap::new(),
            waiting: BinaryHeap::new(),
            count: 0,
            schemas: BTreeMap::new(),
            channels: BTreeMap::new(),
        })
    }

    /// Where the file ends inside a record, bytes, as that of a recorder that was killed does; messages before that
    /// are read. `None` for a whole file.
    pub fn cut_off_at(&self) -> Option<u64> {
        self.cut_off_at
    }

    /// All channels, by topic, without their messages; it unpacks every chunk once. Call it before the first message.
    pub fn channels(&mut self) -> Result<Vec<Arc<ChannelInfo>>, ReadError> {
        for part in self.parts.clone() {
            let announced = self.content(part).and_then(|content| {
                walk(&content).try_for_each(|record| {
                    let (kind, range) = record?;
                    announcement(kind, &content[range])?.into_iter().for_each(|found| self.announce(found));
                    Ok(())
                })
            });
            announced.map_err(|fault: ReadFault| fault.at(part.offset))?;
        }
        let mut all: Vec<_> = self.channels.values().cloned().collect();
        all.sort_by(|a, b| (&a.topic, &a.schema).cmp(&(&b.topic, &b.schema)));
        Ok(all)
    }

    /// The next message; `None` at the end. After an error the reader is at its end.
    pub fn next_message(&mut self) -> Result<Option<RawMessage>, ReadError> {
        while let Some(&earliest_ns) = self.earliest_ns.get(self.next_part) {
            if self.waiting.peek().is_some_and(|Reverse(first)| first.order.0 < earliest_ns) {
                break;
            }
            let number = self.next_part;
            self.next_part += 1;
            let part = self.parts[number];
            if let Err(fault) = self.open_part(number, part) {
                self.next_part = self.parts.len();
                self.waiting.clear();
                return Err(fault.at(part.offset));
            }
        }
        let Some(Reverse(first)) = self.waiting.pop() else { return Ok(None) };
        if let Some((waiting, _)) = self.open.get_mut(&first.part) {
            *waiting -= 1;
            if *waiting == 0 {
                self.open.remove(&first.part);
            }
        }
        Ok(Some(first.message))
    }

    /// The records of a part.
    fn content(&mut self, part: Part) -> Result<Bytes, ReadFault> {
        self.file.seek(SeekFrom::Start(part.offset))?;
        let mut bytes = Vec::new();
        (&mut self.file).take(part.bytes).read_to_end(&mut bytes)?;
        if !part.is_chunk {
            return Ok(Bytes::from(bytes));
        }
        Ok(Bytes::from(chunk::unpack(bytes.get(HEAD_BYTES..).ok_or(ReadFault::Short)?)?))
    }

    fn open_part(&mut self, number: usize, part: Part) -> Result<(), ReadFault> {
        let content = self.content(part)?;
        let open: u64 = self.open.values().map(|(_, bytes)| bytes).sum();
        if open + content.len() as u64 > MAX_OPEN_BYTES {
            return Err(ReadFault::Overlap(MAX_OPEN_BYTES));
        }
        let mut messages = 0;
        for record in walk(&content) {
            let (kind, range) = record?;
            if kind == op::MESSAGE {
                messages += 1;
                if messages > MAX_CHUNK_MESSAGES {
                    return Err(ReadFault::TooManyMessages(MAX_CHUNK_MESSAGES));
                }
                self.wait(number, part.offset, &content.slice(range))?;
            } else if let Some(record) = announcement(kind, &content[range])? {
                self.announce(record);
            }
        }
        if messages > 0 {
            self.open.insert(number, (messages, content.len() as u64));
        }
        Ok(())
    }

    fn wait(&mut self, part: usize, offset: u64, body: &Bytes) -> Result<(), ReadFault> {
        let header = message_head(body)?;
        let channel = self.channels.get(&header.channel_id);
        let channel = channel.ok_or(ReadFault::Channel(header.channel_id))?.clone();
        let message = RawMessage {
            channel,
            log_time_ns: header.log_time,
            sequence: header.sequence,
            data: body.slice(MESSAGE_HEAD_BYTES..),
            offset,
        };
        self.waiting.push(Reverse(Waiting { order: (header.log_time, self.count), part, message }));
        self.count += 1;
        Ok(())
    }

    fn announce(&mut self, record: Record<'_>) {
        match record {
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
    }
}
