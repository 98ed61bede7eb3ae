//! A frame through the pipeline of `vision`, with the times of its stages. In: picture, camera, a version of the map. Out:
//! quads with verdicts and landmark poses.

use crate::snapshot::MapSnapshot;
use map::extrinsics::CameraExtrinsics;
use protos::{
    CheckedFrame,
    convert::{CheckedQuad, Pixels},
    v1,
};
use std::{cell::RefCell, time::Instant};
use vision::{
    frame::{Intrinsics, PictureRef},
    pipeline::{FrameAnalysis, FrameCamera, LandmarkDatabase, Pipeline, analyse_quads},
    trace::{Stage, Trace},
    up::Up,
};

/// Times the stages of the pipeline.
#[derive(Debug)]
pub struct StageTimes {
    since: Instant,
    times: Vec<v1::StageTime>,
}

impl StageTimes {
    /// The first stage begins now.
    pub fn start() -> Self {
        Self { since: Instant::now(), times: Vec::new() }
    }

    /// A stage outside the pipeline has just ended.
    pub fn ended(&mut self, stage: &str) {
        let now = Instant::now();
        let ms = (now - self.since).as_secs_f64() * 1e3;
        tracing::trace!(stage, ms, "stage_ended");
        self.times.push(v1::StageTime { stage: stage.to_owned(), ms });
        self.since = now;
    }

    /// Every stage so far.
    pub fn finish(&mut self) -> Vec<v1::StageTime> {
        std::mem::take(&mut self.times)
    }
}

impl Trace for StageTimes {
    fn finished(&mut self, stage: Stage) {
        self.ended(stage.name());
    }
}

/// Recognises a frame: what its detector finds, or the quads that the robot found, from there on alike.
pub fn analyse_checked<'a>(
    frame: &CheckedFrame,
    picture: impl Into<PictureRef<'a>>,
    map: &MapSnapshot,
    times: &mut StageTimes,
) -> FrameAnalysis {
    let picture = picture.into();
    let camera = frame_camera(frame.intrinsics.as_ref(), frame.mounting.as_ref(), map);
    let Pixels::Quads(found) = &frame.pixels else { return analyse_frame(picture, camera, map, times) };
    let quads = found.iter().map(|CheckedQuad { quad, .. }| quad.clone()).collect();
    analyse_quads(picture.grey(), quads, camera, database(map), &map.params, times)
}

/// Recognises a picture against one version of a map: the whole pipeline.
pub fn analyse_frame<'a>(
    picture: impl Into<PictureRef<'a>>,
    camera: FrameCamera<'_>,
    map: &MapSnapshot,
    times: &mut StageTimes,
) -> FrameAnalysis {
    // Taken out while in use: a panic leaves no half-written pipeline behind.
    let mut pipeline = PIPELINE.take();
    let analysis = pipeline.analyse(picture, camera, database(map), &map.params, times);
    PIPELINE.set(pipeline);
    analysis
}

/// A camera on a robot. Without its mounting, up is not known.
pub fn frame_camera<'a>(
    intrinsics: Option<&'a Intrinsics>,
    mounting: Option<&CameraExtrinsics>,
    map: &MapSnapshot,
) -> FrameCamera<'a> {
    let up = mounting.and_then(|mounting| Up::new(mounting.camera_up()));
    let up = if map.has_level_landmarks() { up.map(Up::with_level_landmarks) } else { up };
    FrameCamera { intrinsics, up }
}

fn database(map: &MapSnapshot) -> LandmarkDatabase<'_> {
    LandmarkDatabase { models: &map.models, sizes: &map.sizes, kind: map.distance }
}

thread_local! {
    /// Buffers that the pipeline reuses from frame to frame; one pipeline a worker thread.
    static PIPELINE: RefCell<Pipeline> = RefCell::default();
}

#[cfg(test)]
mod tests;
