//! A frame through the pipeline of `vision`, with the times of its stages. In: image, camera, a version of the map. Out:
//! quads with verdicts and landmark poses.

use super::snapshot::MapSnapshot;
use protos::{
    CheckedFrame,
    convert::{CheckedQuad, Pixels},
    v1,
};
use std::{cell::RefCell, time::Instant};
use vision::{
    frame::{GrayImage, Intrinsics},
    pipeline::{FrameAnalysis, LandmarkDatabase, Pipeline, analyse_quads},
    trace::{Stage, Trace},
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
pub fn analyse_checked(
    frame: &CheckedFrame,
    image: &GrayImage,
    map: &MapSnapshot,
    times: &mut StageTimes,
) -> FrameAnalysis {
    let camera = frame.intrinsics.as_ref();
    let Pixels::Quads(found) = &frame.pixels else { return analyse_frame(image, camera, map, times) };
    let quads = found.iter().map(|CheckedQuad { quad, .. }| quad.clone()).collect();
    analyse_quads(image, quads, camera, database(map), &map.params, times)
}

/// Recognises an image against one version of a map: the whole pipeline.
pub fn analyse_frame(
    image: &GrayImage,
    camera: Option<&Intrinsics>,
    map: &MapSnapshot,
    times: &mut StageTimes,
) -> FrameAnalysis {
    // Taken out while in use: a panic leaves no half-written pipeline behind.
    let mut pipeline = PIPELINE.take();
    let analysis = pipeline.analyse(image, camera, database(map), &map.params, times);
    PIPELINE.set(pipeline);
    analysis
}

fn database(map: &MapSnapshot) -> LandmarkDatabase<'_> {
    LandmarkDatabase { models: &map.models, sizes: &map.sizes, kind: map.distance }
}

thread_local! {
    /// Buffers that the pipeline reuses from frame to frame; one pipeline a worker thread.
    static PIPELINE: RefCell<Pipeline> = RefCell::default();
}
