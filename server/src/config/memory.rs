//! How much memory the server may take at most, beside its maps. In: the settings. Out: a sum of
//! named shares, each a bound times what one item takes. It is told at the start, and measured
//! under load (`waymark-lab bench load`).

use super::Config;
use engine::{
    decode::PICTURE_BYTES_PER_PX,
    live,
    mapping::{FRAMES_WAITING, MAX_MAPPINGS},
    survey::WHILE_DRIVING,
};

/// The program itself: code, runtime, router, caches of the database.
const PROGRAM_BYTES: usize = 96 << 20;
/// What the analysis of a frame takes for each pixel: the picture, a part of it at full size,
/// filters of its planes, edges, chains and features of quads.
const ANALYSIS_BYTES_PER_PX: usize = 2 * PICTURE_BYTES_PER_PX + 72;
/// What a photograph takes for each pixel while it is decoded and searched: the picture as it is
/// and upright, eight bytes of PNG with 16 bits, and the analysis at reduced size.
const PHOTOGRAPH_BYTES_PER_PX: usize = 2 * PICTURE_BYTES_PER_PX + 8 + 14;
/// A request: its head, a body that needs no place, buffers of encryption.
const CONNECTION_BYTES: usize = (32 << 10) + (64 << 10) + (64 << 10);
/// A robot: its session at the router with encryption, epochs, fused pose, corrections,
/// trajectories. 0.8 MB each are measured with a thousand.
const ROBOT_BYTES: usize = 1 << 20;
/// The queue of readings of one live event stream.
const STREAM_BYTES: usize = 256 << 10;

/// A share of the memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MemoryShare {
    /// What it is for.
    pub what: &'static str,
    /// The most that it takes.
    pub bytes: usize,
}

impl Config {
    /// Every share.
    pub fn memory_shares(&self) -> [MemoryShare; 10] {
        let limits = &self.limits;
        let share = |what, bytes| MemoryShare { what, bytes };
        [
            share("program", PROGRAM_BYTES),
            share("frames that wait or are in work", limits.waiting_frame_bytes),
            // Vision threads, and the thread that localises robots.
            share("analysis of frames", (self.workers + 1) * limits.frame_pixels * ANALYSIS_BYTES_PER_PX),
            share("frames that pages show", live::MAX_CAMERAS * limits.frame_bytes),
            share("frames to try drafts with", limits.replay_bytes),
            share("bodies of large requests", limits.uploads * limits.upload_bytes.max(limits.json_bytes)),
            // As many for requests as for a lesson.
            share("photographs", 2 * self.workers * limits.upload_pixels * PHOTOGRAPH_BYTES_PER_PX),
            share(
                "connections and event streams",
                limits.connections * CONNECTION_BYTES + limits.streams * STREAM_BYTES,
            ),
            share("robots", limits.robots * ROBOT_BYTES),
            share(
                "frames of drives that make maps",
                MAX_MAPPINGS * (WHILE_DRIVING.image_bytes + FRAMES_WAITING * limits.frame_bytes),
            ),
        ]
    }

    /// The sum of [`Config::memory_shares`], MB (of 1024 kB).
    pub fn memory_ceiling_mb(&self) -> usize {
        self.memory_shares().iter().map(|share| share.bytes).sum::<usize>().div_ceil(1 << 20)
    }

    /// Tells the ceiling and its shares in the log.
    pub(crate) fn log_memory_ceiling(&self) {
        let shares = self.memory_shares().map(|share| format!("{} {} MB", share.what, share.bytes >> 20));
        tracing::info!(memory_ceiling_mb = self.memory_ceiling_mb(), shares = shares.join(", "), "memory");
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Limits, RawConfig};
    use super::*;

    type Change = fn(&mut Limits);

    fn with(change: impl Fn(&mut Limits)) -> Config {
        let mut raw = RawConfig { workers: 2, ..RawConfig::default() };
        change(&mut raw.limits);
        Config::try_from(raw).unwrap()
    }

    #[test]
    fn the_memory_ceiling_follows_every_bound() {
        let of = |change: Change| with(change).memory_ceiling_mb();
        let usual = of(|_| ());
        let changes: [(Change, usize); 7] = [
            (|l| l.waiting_frame_bytes += 10 << 20, 10),
            (|l| l.frame_bytes += 1 << 20, live::MAX_CAMERAS + MAX_MAPPINGS * FRAMES_WAITING),
            (|l| l.replay_bytes += 7 << 20, 7),
            (|l| l.uploads += 1, 16),
            (|l| l.upload_bytes += 1 << 20, 16),
            (|l| l.robots += 1024, 1024),
            (|l| l.frame_pixels += 1 << 20, 3 * ANALYSIS_BYTES_PER_PX),
        ];
        for (change, more_mb) in changes {
            assert_eq!(of(change), usual + more_mb);
        }
        let pixels = of(|l| l.upload_pixels = 1 << 20);
        assert!(pixels < usual - 1_000, "{pixels}");
        // Cameras have no share of their own: their frames share one.
        assert_eq!(of(|l| l.cameras *= 10), usual);
        assert!(usual < 4_608, "{usual} MB are no bound on a usual machine");
    }
}
