//! The messages of a drive. In: a file. Out: messages of the wire in the order of time, with the
//! images of frames; those of ROS are converted where a robot is given for them.

use super::{
    error::{ReadError, ReadFault},
    ordered::{MessageReader, RawMessage},
};
use crate::{
    bag::BagRobot,
    foxglove::{CompressedImage, RawImage},
    message::{Body, Recorded},
    topics,
};
use protos::{
    Key, Keys, Name,
    keys::{PROTOCOL, ROOT},
    prost::{Message as _, bytes::Bytes},
};
use std::{
    collections::{BTreeMap, VecDeque},
    io::{Read, Seek},
};

/// Most cameras whose last image waits for its frame.
const MAX_IMAGES: usize = 4096;

/// The last image of a camera: when and with which number it was written.
#[derive(Debug)]
struct LastImage {
    log_time_ns: u64,
    sequence: u32,
    data: Bytes,
}

/// Reads the messages of a drive.
#[derive(Debug)]
pub struct DriveReader<R> {
    messages: MessageReader<R>,
    images: BTreeMap<String, LastImage>,
    bag: Option<BagRobot>,
    /// What one message of ROS gave: at most one of each kind that waited for it.
    ready: VecDeque<Recorded>,
    unused: u64,
}

impl<R: Read + Seek> DriveReader<R> {
    /// Opens a recording.
    pub fn open(file: R) -> Result<Self, ReadError> {
        Self::open_bag(file, None)
    }

    /// Opens a recording or a bag of ROS 2, whose messages are those of this robot.
    pub fn open_bag(file: R, bag: Option<BagRobot>) -> Result<Self, ReadError> {
        let messages = MessageReader::open(file)?;
        Ok(Self { messages, images: BTreeMap::new(), bag, ready: VecDeque::new(), unused: 0 })
    }

    /// What became of the messages of ROS; `None` if no robot is given for them.
    pub fn bag(&self) -> Option<&BagRobot> {
        self.bag.as_ref()
    }

    /// Where the file ends inside a record; `None` for a whole file.
    pub fn cut_off_at(&self) -> Option<u64> {
        self.messages.cut_off_at()
    }

    /// Messages until now that are none of ours: those for viewers, and other programs'.
    pub fn unused(&self) -> u64 {
        self.unused
    }

    /// The next message of the wire; `None` at the end.
    pub fn next_message(&mut self) -> Result<Option<Recorded>, ReadError> {
        if let Some(ready) = self.ready.pop_front() {
            return Ok(Some(ready));
        }
        while let Some(raw) = self.messages.next_message()? {
            if let Some(bag) = self.bag.as_mut().filter(|_| raw.channel.encoding == "cdr") {
                self.ready.extend(bag.take(&raw));
                match self.ready.pop_front() {
                    Some(ready) => return Ok(Some(ready)),
                    None => continue,
                }
            }
            let is_protobuf = raw.channel.encoding == "protobuf";
            match raw.channel.schema.split_once('.') {
                Some(("foxglove", "CompressedImage" | "RawImage")) if is_protobuf => self.keep_image(&raw)?,
                Some(("waymark", _)) if is_protobuf => {
                    if let Some(own) = self.own(&raw)? {
                        return Ok(Some(own));
                    }
                    self.unused += 1;
                }
                _ => self.unused += 1,
            }
        }
        Ok(None)
    }

    /// Keeps an image for the frame that follows it.
    fn keep_image(&mut self, raw: &RawMessage) -> Result<(), ReadError> {
        let data = if raw.channel.schema == "foxglove.RawImage" {
            RawImage::decode(raw.data.clone()).map(|image| image.data)
        } else {
            CompressedImage::decode(raw.data.clone()).map(|image| image.data)
        };
        let data = data.map_err(|e| malformed(raw, &e.to_string()))?;
        self.unused += 1;
        let last = LastImage { log_time_ns: raw.log_time_ns, sequence: raw.sequence, data };
        if self.images.len() < MAX_IMAGES {
            self.images.insert(raw.channel.topic.clone(), last);
        }
        Ok(())
    }

    /// One of our own messages; `None` if its topic is not a key of a recorded message.
    fn own(&mut self, raw: &RawMessage) -> Result<Option<Recorded>, ReadError> {
        let Some(key) = key_of(&raw.channel.topic) else { return Ok(None) };
        let body = Body::decode(&key, &raw.data).map_err(|e| malformed(raw, &e.to_string()))?;
        let Some(mut body) = body else { return Ok(None) };
        if let (Key::Frame(robot, camera), Body::Frame(frame)) = (&key, &mut body)
            && frame.image.is_empty()
        {
            let image = self.images.remove(&topics::image(robot, camera));
            let of_frame =
                image.filter(|i| (i.log_time_ns, i.sequence) == (raw.log_time_ns, frame.seq as u32));
            frame.image = of_frame.ok_or_else(|| malformed(raw, "the image of the frame is missing"))?.data;
        }
        Ok(Some(Recorded { log_time_ns: raw.log_time_ns, key, body }))
    }
}

/// The key of a topic, whatever the fleet.
fn key_of(topic: &str) -> Option<Key> {
    let rest = topic.strip_prefix(ROOT)?.strip_prefix('/')?.strip_prefix(PROTOCOL)?.strip_prefix('/')?;
    let fleet = Name::new(rest.split('/').next()?).ok()?;
    Keys::new(&fleet).parse(topic).ok()
}

fn malformed(raw: &RawMessage, detail: &str) -> ReadError {
    ReadFault::Message { topic: raw.channel.topic.clone(), detail: detail.to_owned() }.at(raw.offset)
}
