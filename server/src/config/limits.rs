//! Every bound of the server, with its default.

use super::{ConfigError, invalid};
use engine::decode::ImageLimits;
use serde::{Deserialize, Serialize};
use vision::model::MAX_LANDMARKS;

/// Every bound of the server, each with its unit. A value beyond a bound is refused, never cut.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Limits {
    /// Largest message from a robot, in bytes. Up to 60 000 bytes fit one zenoh batch and are not
    /// fragmented. Raw colour of 640 x 480 takes 921 600, of 1280 x 1024 (the default's largest) 3
    /// 932 160.
    pub frame_bytes: usize,
    /// Largest frame, in pixels.
    pub frame_pixels: usize,
    /// Bytes of all frames that wait or are in work; a frame beyond them is refused.
    pub waiting_frame_bytes: usize,
    /// Frames and quads a second of one robot, over all its cameras.
    pub robot_frames_per_s: u32,
    /// Odometry messages a second of one robot.
    pub robot_odometry_per_s: u32,
    /// Laser scans a second of one robot.
    pub robot_scans_per_s: u32,
    /// Bytes a second of one robot, over all its messages.
    pub robot_bytes_per_s: usize,
    /// Largest uploaded image, in bytes.
    pub upload_bytes: usize,
    /// Largest bundle of a map that is taken, in bytes.
    pub bundle_bytes: usize,
    /// Largest uploaded image, in pixels.
    pub upload_pixels: usize,
    /// Largest JSON request, in bytes.
    pub json_bytes: usize,
    /// Oldest frame that work is still started on, in ms after receipt; a robot may ask for less.
    pub frame_deadline_ms: u32,
    /// Maps.
    pub maps: usize,
    /// Landmarks in one map.
    pub landmarks: usize,
    /// Views of one landmark.
    pub views: usize,
    /// Wall segments of one map.
    pub laser_segments: usize,
    /// Robots.
    pub robots: usize,
    /// Cameras with a slot.
    pub cameras: usize,
    /// HTTP connections at a time.
    pub connections: usize,
    /// The same from one address: of a proxy, all of its clients.
    pub connections_per_address: usize,
    /// Requests a second of one token over HTTP. The local token is not bound by it.
    pub token_requests_per_s: u32,
    /// Requests a second without a valid token, of one address.
    pub address_requests_per_s: u32,
    /// Live event streams (SSE) at a time.
    pub streams: usize,
    /// Seconds until the head of a request must be there.
    pub header_timeout_s: u64,
    /// Seconds until a request must be answered; event streams are not bound by it.
    pub request_timeout_s: u64,
    /// Longest time for a request that brings or takes the bundle of a map, in seconds.
    pub bundle_timeout_s: u64,
    /// Seconds for which a client may leave an answer unread before its connection is closed; event
    /// streams that have nothing to send are not bound by it.
    pub write_timeout_s: u64,
    /// Requests at a time with a body of more than 64 KiB, or of unknown length: what their bodies
    /// take in memory is bounded by this times the largest body.
    pub uploads: usize,
    /// Seconds that such a request waits for its place before it is refused.
    pub upload_wait_s: u64,
    /// Most items on a page of a list.
    pub page: usize,
    /// Commands waiting for the writer.
    pub write_queue: usize,
    /// Jobs waiting or running.
    pub jobs: usize,
    /// Finished jobs that are retained.
    pub jobs_kept: usize,
    /// Answers to frames that are stored; the oldest go.
    pub stored_answers: usize,
    /// Bytes of frames that are kept in memory to try drafts with; the oldest go.
    pub replay_bytes: usize,
    /// Answers to creations that are kept for repeats, for a day at most; the oldest go.
    pub kept_answers: usize,
    /// Commits of each map that are kept; the oldest go.
    pub kept_commits: usize,
    /// Bytes of each map that are stored only for its kept commits, about; the oldest commits go.
    pub history_bytes: usize,
    /// Entries of the audit log; the oldest are forgotten.
    pub audit_entries: usize,
    /// Seconds for which a part of the server may not go on before the server ends with an error.
    pub stalled_s: u64,
    /// Used share of the disk of the data directory, in percent, from which on nothing is added:
    /// views, lessons, maps, backups. Recognition and deletions go on. 100: only a full disk
    /// refuses.
    pub disk_percent: u32,
    /// A disk with more bytes free than this is not nearly full, whatever its used share.
    pub disk_spare_bytes: usize,
    /// Nothing is added while fewer bytes than this are free.
    pub disk_free_bytes: usize,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            frame_bytes: 4 << 20,
            frame_pixels: 2_304_000,
            waiting_frame_bytes: 256 << 20,
            robot_frames_per_s: 120,
            robot_odometry_per_s: 500,
            robot_scans_per_s: 100,
            robot_bytes_per_s: 32 << 20,
            upload_bytes: 16 << 20,
            bundle_bytes: 1 << 30,
            upload_pixels: vision::frame::MAX_AREA_PX,
            json_bytes: 2 << 20,
            frame_deadline_ms: 500,
            maps: 200,
            landmarks: 2_000,
            views: 200,
            laser_segments: 20_000,
            robots: 1_000,
            cameras: 2_000,
            connections: 256,
            connections_per_address: 128,
            token_requests_per_s: 200,
            address_requests_per_s: 50,
            streams: 64,
            header_timeout_s: 5,
            request_timeout_s: 30,
            bundle_timeout_s: 600,
            write_timeout_s: 20,
            uploads: 16,
            upload_wait_s: 5,
            page: 500,
            write_queue: 256,
            jobs: 64,
            jobs_kept: 1_000,
            stored_answers: 2_000,
            replay_bytes: 64 << 20,
            kept_answers: 10_000,
            kept_commits: 1_000,
            history_bytes: 4 << 30,
            audit_entries: 100_000,
            stalled_s: 15,
            disk_percent: 90,
            disk_spare_bytes: 5 << 30,
            disk_free_bytes: 8 << 20,
        }
    }
}

impl Limits {
    /// Refuses bounds that cannot be, by name.
    pub(super) fn check(&self) -> Result<(), ConfigError> {
        for (field, value) in self.counts() {
            if value == 0 {
                return Err(invalid(field, "must be at least 1".into()));
            }
        }
        if !(1..=100).contains(&self.disk_percent) {
            let reason = format!("{} is not 1 to 100", self.disk_percent);
            return Err(invalid("limits.disk_percent", reason));
        }
        for (field, value) in
            [("limits.frame_pixels", self.frame_pixels), ("limits.upload_pixels", self.upload_pixels)]
        {
            if value > vision::frame::MAX_AREA_PX {
                return Err(invalid(
                    field,
                    format!("{value} is more than {} px", vision::frame::MAX_AREA_PX),
                ));
            }
        }
        if self.waiting_frame_bytes < self.frame_bytes {
            let reason =
                format!("less than limits.frame_bytes = {}: no such frame would be taken", self.frame_bytes);
            return Err(invalid("limits.waiting_frame_bytes", reason));
        }
        if self.landmarks > MAX_LANDMARKS {
            return Err(invalid("limits.landmarks", format!("more than {MAX_LANDMARKS}")));
        }
        Ok(())
    }

    /// Name and value of every bound that must not be 0.
    fn counts(&self) -> [(&'static str, usize); 38] {
        [
            ("limits.frame_bytes", self.frame_bytes),
            ("limits.frame_pixels", self.frame_pixels),
            ("limits.waiting_frame_bytes", self.waiting_frame_bytes),
            ("limits.robot_frames_per_s", self.robot_frames_per_s as usize),
            ("limits.robot_odometry_per_s", self.robot_odometry_per_s as usize),
            ("limits.robot_scans_per_s", self.robot_scans_per_s as usize),
            ("limits.robot_bytes_per_s", self.robot_bytes_per_s),
            ("limits.upload_bytes", self.upload_bytes),
            ("limits.bundle_bytes", self.bundle_bytes),
            ("limits.bundle_timeout_s", self.bundle_timeout_s as usize),
            ("limits.upload_pixels", self.upload_pixels),
            ("limits.json_bytes", self.json_bytes),
            ("limits.frame_deadline_ms", self.frame_deadline_ms as usize),
            ("limits.maps", self.maps),
            ("limits.landmarks", self.landmarks),
            ("limits.views", self.views),
            ("limits.laser_segments", self.laser_segments),
            ("limits.robots", self.robots),
            ("limits.cameras", self.cameras),
            ("limits.connections", self.connections),
            ("limits.connections_per_address", self.connections_per_address),
            ("limits.token_requests_per_s", self.token_requests_per_s as usize),
            ("limits.address_requests_per_s", self.address_requests_per_s as usize),
            ("limits.header_timeout_s", self.header_timeout_s as usize),
            ("limits.request_timeout_s", self.request_timeout_s as usize),
            ("limits.write_timeout_s", self.write_timeout_s as usize),
            ("limits.uploads", self.uploads),
            ("limits.upload_wait_s", self.upload_wait_s as usize),
            ("limits.page", self.page),
            ("limits.write_queue", self.write_queue),
            ("limits.jobs", self.jobs),
            ("limits.stored_answers", self.stored_answers),
            ("limits.replay_bytes", self.replay_bytes),
            ("limits.kept_answers", self.kept_answers),
            ("limits.kept_commits", self.kept_commits),
            ("limits.history_bytes", self.history_bytes),
            ("limits.audit_entries", self.audit_entries),
            ("limits.stalled_s", self.stalled_s as usize),
        ]
    }

    /// Limits of an uploaded picture.
    pub fn upload(&self) -> ImageLimits {
        ImageLimits { bytes: self.upload_bytes, pixels: self.upload_pixels }
    }
}
