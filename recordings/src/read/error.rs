//! Why a file cannot be read.

/// What is wrong, at which byte of the file.
#[derive(Debug, thiserror::Error)]
#[error("at byte {offset}: {fault}")]
pub struct ReadError {
    /// Where the record at fault begins, bytes from the start of the file.
    pub offset: u64,
    /// What is wrong.
    pub fault: ReadFault,
}

/// The kinds of fault.
#[derive(Debug, thiserror::Error)]
pub enum ReadFault {
    /// The file does not begin as MCAP.
    #[error("it is no MCAP file")]
    NotMcap,
    /// The file cannot be read.
    #[error("{0}")]
    Io(#[from] std::io::Error),
    /// A record is not what its kind promises.
    #[error("a record is malformed: {0}")]
    Record(#[from] mcap::McapError),
    /// A record ends before its fields do.
    #[error("a record is cut off")]
    Short,
    /// A record is longer than is read.
    #[error("a record has {bytes} bytes, at most {most} are read")]
    TooLong {
        /// Its length.
        bytes: u64,
        /// The limit.
        most: u64,
    },
    /// More chunks than are read.
    #[error("over {0} chunks")]
    TooManyParts(usize),
    /// More messages in a chunk than are read.
    #[error("over {0} messages in a chunk")]
    TooManyMessages(usize),
    /// Chunks overlap in time by more than is kept open.
    #[error("the times of its chunks overlap by over {0} bytes; sort the file first, with `mcap sort`")]
    Overlap(u64),
    /// A chunk is packed in a way that is not known.
    #[error("chunks packed with `{0}` are not read, only those with zstd or lz4")]
    Packing(String),
    /// A chunk does not unpack.
    #[error("a chunk does not unpack: {0}")]
    Unpack(String),
    /// A chunk unpacks to something else than was packed.
    #[error("a chunk is damaged: its checksum is {found:08x}, not {stated:08x}")]
    Checksum {
        /// In the file.
        stated: u32,
        /// Of the content.
        found: u32,
    },
    /// A message names a channel that was not announced.
    #[error("a message of the unknown channel {0}")]
    Channel(u16),
    /// A message of ours is malformed.
    #[error("`{topic}`: {detail}")]
    Message {
        /// Its topic.
        topic: String,
        /// What is wrong.
        detail: String,
    },
}

impl ReadFault {
    /// With its place.
    pub(super) fn at(self, offset: u64) -> ReadError {
        ReadError { offset, fault: self }
    }
}
