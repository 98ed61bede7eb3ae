//! The last frames of robots whose answers were stored, in memory: with them a draft of a map is
//! tried before it is published. In: frames of the workers. Out: the newest of a map. Bounded by
//! their bytes; the oldest go. A restart forgets them.

use crate::frame::slots::SlotKey;
use protos::{CheckedFrame, convert::Pixels};
use std::{
    collections::VecDeque,
    sync::{Arc, Mutex, PoisonError},
};

/// What a frame takes beside its pixels, about, bytes.
const BESIDE_PIXELS: usize = 1024;

/// A frame that was answered.
#[derive(Debug, Clone)]
pub struct KeptFrame {
    /// Robot and camera.
    pub key: SlotKey,
    /// The map that it was compared with.
    pub map: String,
    /// What the robot sent; its pixels are still encoded.
    pub frame: CheckedFrame,
}

impl KeptFrame {
    fn bytes(&self) -> usize {
        let of_pixels = match &self.frame.pixels {
            Pixels::Image(image) => image.bytes.len(),
            Pixels::Quads(quads) => {
                quads.iter().map(|quad| quad.patch.image.bytes.len() + BESIDE_PIXELS).sum()
            }
        };
        BESIDE_PIXELS + of_pixels
    }
}

#[derive(Debug, Default)]
struct Ring {
    frames: VecDeque<Arc<KeptFrame>>,
    bytes: usize,
}

/// The frames.
#[derive(Debug)]
pub struct KeptFrames {
    kept: Mutex<Ring>,
    max_bytes: usize,
}

impl KeptFrames {
    /// None yet.
    pub fn new(max_bytes: usize) -> Self {
        Self { kept: Mutex::default(), max_bytes }
    }

    /// Keeps a frame, and forgets the oldest beyond the bound.
    pub fn keep(&self, frame: KeptFrame) {
        let bytes = frame.bytes();
        if bytes > self.max_bytes {
            return;
        }
        // Every change is a few steps that do not panic: nothing can be left half done.
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        kept.bytes += bytes;
        kept.frames.push_back(Arc::new(frame));
        while kept.bytes > self.max_bytes
            && let Some(oldest) = kept.frames.pop_front()
        {
            kept.bytes -= oldest.bytes();
        }
    }

    /// At most `max` frames of a map, newest first; of each camera in turn, so that a fast one does
    /// not hide the others.
    pub fn newest(&self, map: &str, max: usize) -> Vec<Arc<KeptFrame>> {
        let of_map: Vec<Arc<KeptFrame>> = {
            let kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
            kept.frames.iter().rev().filter(|frame| frame.map == map).cloned().collect()
        };
        let mut of_camera = std::collections::BTreeMap::<&SlotKey, usize>::new();
        let mut in_turn: Vec<(usize, usize)> = Vec::with_capacity(of_map.len());
        for (age, frame) in of_map.iter().enumerate() {
            let before = of_camera.entry(&frame.key).or_default();
            in_turn.push((*before, age));
            *before += 1;
        }
        in_turn.sort_unstable();
        in_turn.iter().take(max).map(|(_, age)| of_map[*age].clone()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use protos::{
        Name,
        convert::{EncodedImage, Encoding},
    };

    fn frame(camera: &str, map: &str, seq: u64, bytes: usize) -> KeptFrame {
        let pixels = Pixels::Image(EncodedImage { encoding: Encoding::Gray8, bytes: vec![0; bytes].into() });
        let key = SlotKey { robot: Name::new("r1").unwrap(), camera: Name::new(camera).unwrap() };
        let frame = CheckedFrame {
            epoch: 1,
            seq,
            captured_ns: 0,
            width_px: 1,
            height_px: 1,
            pixels,
            intrinsics: None,
            mounting: None,
            odometry: None,
            prior: None,
            deadline_ms: None,
            map: None,
        };
        KeptFrame { key, map: map.to_owned(), frame }
    }

    fn seqs(kept: &KeptFrames, map: &str, max: usize) -> Vec<u64> {
        kept.newest(map, max).iter().map(|kept| kept.frame.seq).collect()
    }

    #[test]
    fn the_oldest_go_beyond_the_bound() {
        let kept = KeptFrames::new(3 * (1000 + BESIDE_PIXELS));
        for seq in 0..5 {
            kept.keep(frame("front", "hall", seq, 1000));
        }
        assert_eq!(seqs(&kept, "hall", 10), [4, 3, 2]);
        kept.keep(frame("front", "hall", 5, 4 * 1000 + 3 * BESIDE_PIXELS));
        assert_eq!(seqs(&kept, "hall", 10), [4, 3, 2], "one that is too large for all of it is left out");
        kept.keep(frame("front", "hall", 6, 2000));
        assert_eq!(seqs(&kept, "hall", 10), [6, 4]);
        assert_eq!(kept.kept.lock().unwrap().bytes, 3000 + 2 * BESIDE_PIXELS);
    }

    #[test]
    fn cameras_come_in_turn_and_other_maps_do_not() {
        let kept = KeptFrames::new(1 << 20);
        for seq in 0..4 {
            kept.keep(frame("front", "hall", seq, 10));
        }
        kept.keep(frame("rear", "hall", 10, 10));
        kept.keep(frame("front", "yard", 20, 10));
        kept.keep(frame("front", "hall", 4, 10));
        assert_eq!(seqs(&kept, "hall", 3), [4, 10, 3]);
        // A camera that has sent nothing for long has its turn, too.
        for seq in 5..8 {
            kept.keep(frame("front", "hall", seq, 10));
        }
        assert_eq!(seqs(&kept, "hall", 3), [7, 10, 6]);
        assert_eq!(seqs(&kept, "yard", 3), [20]);
        assert_eq!(seqs(&kept, "cellar", 3), [0; 0]);
    }
}
