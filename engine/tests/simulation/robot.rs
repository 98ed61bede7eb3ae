//! A robot: its program restarts, its link breaks, its clock jumps. In: what the seed decides. Out:
//! messages for the network.

use super::random::Random;
use engine::slots::SlotKey;
use protos::{
    Name,
    prost::{Message as _, bytes::Bytes},
    v1,
};

/// Cameras of a robot.
pub(crate) const CAMERAS: usize = 2;

/// What identifies a frame.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct FrameId {
    pub(crate) key: SlotKey,
    pub(crate) epoch: u64,
    pub(crate) seq: u64,
}

/// A message on its way.
#[derive(Debug, Clone)]
pub(crate) enum Packet {
    Frame {
        id: FrameId,
        deadline_ms: u64,
        bytes: Bytes,
    },
    /// A liveliness token appears or goes.
    Token {
        robot: Name,
        epoch: u64,
        appeared: bool,
    },
}

/// Deadline of frames that ask for none, ms.
pub(crate) const DEADLINE_MS: u64 = 500;

pub(crate) struct Robot {
    pub(crate) name: Name,
    cameras: Vec<Name>,
    pub(crate) epoch: u64,
    seqs: [u64; CAMERAS],
    pub(crate) is_connected: bool,
}

impl Robot {
    pub(crate) fn new(number: usize, random: &mut Random) -> Self {
        let named = |text: String| Name::new(text).expect("a name");
        Self {
            name: named(format!("r{number}")),
            cameras: (0..CAMERAS).map(|c| named(format!("c{c}"))).collect(),
            epoch: random.next(),
            seqs: [0; CAMERAS],
            is_connected: false,
        }
    }

    /// The token of its program.
    pub(crate) fn token(&self, appeared: bool) -> Packet {
        Packet::Token { robot: self.name.clone(), epoch: self.epoch, appeared }
    }

    /// Another start of its program.
    pub(crate) fn restart(&mut self, random: &mut Random) {
        (self.epoch, self.seqs) = (random.next(), [0; CAMERAS]);
    }

    /// Its next frame. Numbers have gaps; the clock shows anything.
    pub(crate) fn frame(&mut self, random: &mut Random) -> Packet {
        let camera = random.below(CAMERAS);
        self.seqs[camera] += 1 + if random.once_in(5) { random.below(9) as u64 } else { 0 };
        let id = FrameId {
            key: SlotKey { robot: self.name.clone(), camera: self.cameras[camera].clone() },
            epoch: self.epoch,
            seq: self.seqs[camera],
        };
        let asked_ms = if random.once_in(3) { 1 + random.below(900) as u32 } else { 0 };
        let frame = v1::Frame {
            epoch: id.epoch,
            seq: id.seq,
            captured_ns: random.next() as i64,
            encoding: v1::ImageEncoding::Gray8.into(),
            width_px: 4,
            height_px: 3,
            image: Bytes::from_static(&[0; 12]),
            deadline_ms: asked_ms,
            ..v1::Frame::default()
        };
        let deadline_ms = if asked_ms == 0 { DEADLINE_MS } else { u64::from(asked_ms) };
        Packet::Frame { id, deadline_ms, bytes: frame.encode_to_vec().into() }
    }
}
