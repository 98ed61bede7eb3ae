//! Recognises one picture as `POST recognise` does, without a prior, and detects in it as
//! `waymark detect` does.

use super::world::CameraTruth;
use anyhow::Context as _;
use cli::clock::Clock;
use engine::{answer::analyse_photograph, decode::ImageLimits, picture, snapshot::MapSnapshot};
use protos::v1;
use std::path::Path;
use vision::{
    detect::{Quad, QuadKind, detect},
    frame::Picture,
    geometry::Corners,
    pipeline::FrameAnalysis,
    trace::NoTrace,
};

/// One picture and what was made of it.
pub(super) struct Recognised {
    pub(super) image: Picture,
    /// Quads that the detector shows to people.
    pub(super) shown: Vec<Quad>,
    /// Quad by quad in the order of `analysis`.
    pub(super) answer: v1::Answer,
    pub(super) analysis: FrameAnalysis,
    /// Processor time of recognition, on one thread.
    pub(super) ms: f64,
}

impl Recognised {
    /// Every border that recognition was asked for: corners and alternates.
    pub(super) fn asked(&self) -> impl Iterator<Item = &Corners> {
        let asked = self.analysis.quads.iter().filter(|q| q.recognition.is_some());
        asked.flat_map(|q| std::iter::once(&q.quad.corners_px).chain(&q.quad.alternates))
    }
}

pub(super) fn recognise(
    path: &Path,
    camera: Option<&CameraTruth>,
    map: &MapSnapshot,
) -> anyhow::Result<Recognised> {
    let bytes = std::fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
    let image = picture::decode(&bytes, ImageLimits::UPLOAD)
        .map_err(|refused| anyhow::anyhow!("{}: {}", path.display(), refused.detail))?;
    let clock = Clock::start();
    let (answer, analysis) = analyse_photograph(&image, camera.map(|c| &c.intrinsics), map);
    let ms = clock.ms();
    let mut shown = detect(&image, &map.params.detect, &mut NoTrace);
    shown.retain(|quad| quad.kind == QuadKind::Full);
    Ok(Recognised { image, shown, answer, analysis, ms })
}
