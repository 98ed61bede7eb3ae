//! Writes a recording. In: messages in the order of their receipt, and maps. Out: an MCAP file.
//!
//! A chunk is written whole, after at most [`CHUNK_BYTES`] or [`CHUNK_NS`], so a file whose writer
//! was killed lacks the last chunk and is read up to there. Memory: one chunk, and its place in the
//! index for each chunk before.

use crate::{
    foxglove,
    message::Recorded,
    view::{MapContent, Shown, View},
};
use mcap::{
    McapError, WriteOptions,
    records::{MessageHeader, Metadata},
};
use protos::{Keys, Name};
use std::{
    collections::BTreeMap,
    io::{Seek, Write},
};

/// Size of a chunk. One message more may follow, at most a frame.
pub const CHUNK_BYTES: u64 = 1 << 20;
/// A message received later than this after the first of a chunk begins the next, ns.
pub const CHUNK_NS: u64 = 1_000_000_000;
/// Largest recording, bytes: the index of its chunks stays in memory until the end.
pub const MAX_FILE_BYTES: u64 = 64 << 30;
/// Name of the recording's own metadata.
pub const METADATA: &str = "waymark";
/// The profile in the head of the file.
pub const PROFILE: &str = "waymark";

/// Why a recording cannot go on.
#[derive(Debug, thiserror::Error)]
pub enum WriteError {
    /// The file cannot be written.
    #[error("the recording cannot be written: {0}")]
    Mcap(#[from] McapError),
    /// The recording is full.
    #[error("the recording has {MAX_FILE_BYTES} bytes, which is the most")]
    Full,
}

/// What a recording contains.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize)]
pub struct Written {
    /// Messages of the wire.
    pub messages: u64,
    /// Messages for viewers.
    pub shown: u64,
    /// Bytes of all messages, without the file's own.
    pub bytes: u64,
}

/// A recording that is being written.
pub struct DriveWriter<W: Write + Seek> {
    mcap: mcap::Writer<W>,
    keys: Keys,
    channels: BTreeMap<String, u16>,
    view: View,
    chunk_began_ns: Option<u64>,
    written: Written,
}

impl<W: Write + Seek> DriveWriter<W> {
    /// Begins a recording of a fleet. `program` is the name and version of who records.
    pub fn create(file: W, fleet: &Name, program: &str) -> Result<Self, WriteError> {
        let options = WriteOptions::library(WriteOptions::new().profile(PROFILE), program)
            .compression(None)
            .chunk_size(Some(CHUNK_BYTES))
            // A chunk is written when it is whole; otherwise its length would be corrected
            // afterwards.
            .disable_seeking(true);
        let mut mcap = options.create(file)?;
        let metadata = [("fleet", fleet.to_string()), ("program", program.to_owned())];
        let metadata = metadata.into_iter().map(|(name, value)| (name.to_owned(), value)).collect();
        mcap.write_metadata(&Metadata { name: METADATA.to_owned(), metadata })?;
        Ok(Self {
            mcap,
            keys: Keys::new(fleet),
            channels: BTreeMap::new(),
            view: View::default(),
            chunk_began_ns: None,
            written: Written::default(),
        })
    }

    /// Adds a message, and what viewers get of it before it.
    pub fn write(&mut self, mut recorded: Recorded) -> Result<(), WriteError> {
        let sequence = sequence(&recorded);
        for shown in self.view.of(&mut recorded) {
            self.show(&shown, recorded.log_time_ns, sequence)?;
        }
        let topic = self.keys.build(&recorded.key);
        let bytes = recorded.body.encode();
        self.put(&topic, recorded.body.schema(), &bytes, recorded.log_time_ns, sequence)?;
        self.written.messages += 1;
        Ok(())
    }

    /// Adds walls and landmarks of a map, for viewers; they replace those of the map that were
    /// added before.
    pub fn write_map(&mut self, content: &MapContent<'_>, log_time_ns: u64) -> Result<(), WriteError> {
        self.show(&View::of_map(content, log_time_ns), log_time_ns, 0)
    }

    /// Ends the chunk and flushes the file.
    pub fn flush(&mut self) -> Result<(), WriteError> {
        self.chunk_began_ns = None;
        Ok(self.mcap.flush()?)
    }

    /// What was written until now.
    pub fn written(&self) -> Written {
        self.written
    }

    /// Writes the index and ends the file.
    pub fn finish(mut self) -> Result<Written, WriteError> {
        self.mcap.finish()?;
        Ok(self.written)
    }

    fn show(&mut self, shown: &Shown, log_time_ns: u64, sequence: u32) -> Result<(), WriteError> {
        self.put(&shown.topic, shown.schema, &shown.bytes, log_time_ns, sequence)?;
        self.written.shown += 1;
        Ok(())
    }

    fn put(
        &mut self,
        topic: &str,
        schema: &'static str,
        data: &[u8],
        log_time: u64,
        sequence: u32,
    ) -> Result<(), WriteError> {
        if self.written.bytes + data.len() as u64 > MAX_FILE_BYTES {
            return Err(WriteError::Full);
        }
        let began_ns = *self.chunk_began_ns.get_or_insert(log_time);
        if log_time.saturating_sub(began_ns) > CHUNK_NS {
            self.flush()?;
            self.chunk_began_ns = Some(log_time);
        }
        let channel_id = self.channel(topic, schema)?;
        let header = MessageHeader { channel_id, sequence, log_time, publish_time: log_time };
        self.mcap.write_to_known_channel(&header, data)?;
        self.written.bytes += data.len() as u64;
        Ok(())
    }

    /// The channel of a topic. A raw and a compressed image may share their topic, as two channels.
    fn channel(&mut self, topic: &str, schema: &'static str) -> Result<u16, WriteError> {
        let name = format!("{topic} {schema}");
        if let Some(id) = self.channels.get(&name) {
            return Ok(*id);
        }
        let set = if schema.starts_with("foxglove.") {
            foxglove::FILE_DESCRIPTOR_SET
        } else {
            protos::FILE_DESCRIPTOR_SET
        };
        let schema = self.mcap.add_schema(schema, "protobuf", set)?;
        let id = self.mcap.add_channel(schema, topic, "protobuf", &BTreeMap::new())?;
        self.channels.insert(name, id);
        Ok(id)
    }
}

/// The number that a frame shares with its image: the last 32 bits of the message's own.
fn sequence(recorded: &Recorded) -> u32 {
    use crate::message::Body;
    let seq = match &recorded.body {
        Body::Frame(message) => message.seq,
        Body::Answer(message) => message.seq,
        Body::Odometry(message) => message.seq,
        Body::Scan(message) => message.seq,
        Body::Pose(_) | Body::MapChanged(_) => 0,
    };
    seq as u32
}
