//! OpenCV's SIFT with RANSAC on the same pictures: a landmark is named from ten inliers of a
//! homography on.

use super::{
    score::{PICTURES, View, view},
    world::World,
};
use crate::{
    bench::Python,
    evaluate::{
        recognition::is_on,
        statistics::median,
        truth::{TruthImage, TruthQuad},
    },
};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use vision::geometry::Corners;

const PROGRAM: &str = include_str!("../../../peers/sift_homographies.py");

/// The peer's figures.
#[derive(Debug, Clone, Serialize)]
pub(super) struct PeerReport {
    pub(super) version: String,
    /// Full views of landmarks, and those with their right name.
    pub(super) full_views: usize,
    pub(super) named: usize,
    /// The same without doors and windows.
    pub(super) pictures_and_boards: usize,
    pub(super) pictures_and_boards_named: usize,
    /// Cut or hidden ones.
    pub(super) partial_named: usize,
    /// Names whose projected border is not on that landmark.
    pub(super) wrong_names: usize,
    /// Median processor time of a picture.
    pub(super) ms_per_picture: Option<f64>,
}

#[derive(Deserialize)]
struct Greeting {
    version: String,
}

#[derive(Deserialize)]
struct Answer {
    ms: f64,
    named: Vec<Named>,
}

#[derive(Deserialize)]
struct Named {
    number: usize,
    corners: [[f64; 2]; 4],
}

/// The error is the reason why there is no peer, for people.
pub(super) fn beside(python: &Path, worlds: &[World]) -> Result<PeerReport, String> {
    let mut report = PeerReport {
        version: String::new(),
        full_views: 0,
        named: 0,
        pictures_and_boards: 0,
        pictures_and_boards_named: 0,
        partial_named: 0,
        wrong_names: 0,
        ms_per_picture: None,
    };
    let mut times_ms = Vec::new();
    for world in worlds {
        let files: Vec<PathBuf> = world.truth.teach.iter().map(|(path, _)| path.clone()).collect();
        let (mut python, Greeting { version }) = Python::start(python, PROGRAM, &files)?;
        report.version = version;
        for image in world.truth.images.iter().filter(|image| !image.whole_image) {
            let answer: Answer = python.ask(&image.path.to_string_lossy())?;
            times_ms.push(answer.ms);
            report.count(world, image, &answer.named);
        }
    }
    report.ms_per_picture = median(&mut times_ms);
    Ok(report)
}

impl PeerReport {
    fn count(&mut self, world: &World, image: &TruthImage, named: &[Named]) {
        // A border that is folded over is no border.
        let named: Vec<(&str, Option<Corners>)> = named
            .iter()
            .filter_map(|n| {
                Some((world.truth.teach.get(n.number)?.1.as_str(), Corners::try_from(n.corners).ok()))
            })
            .collect();
        let is_of = |label: &TruthQuad, (name, corners): &(&str, Option<Corners>)| {
            let is_it = label.landmark.as_ref().is_some_and(|l| world.truth.same_landmark(l, name));
            is_it && corners.is_some_and(|c| is_on(&label.corners, &c))
        };
        for label in image.quads.iter().filter(|l| l.landmark.is_some()) {
            let right = usize::from(named.iter().any(|n| is_of(label, n)));
            let is_picture = label.class.as_deref().is_some_and(|kind| PICTURES.contains(&kind));
            match view(label) {
                Some(View::Full) => {
                    self.full_views += 1;
                    self.named += right;
                    self.pictures_and_boards += usize::from(is_picture);
                    self.pictures_and_boards_named += right * usize::from(is_picture);
                }
                Some(View::Partial) => self.partial_named += right,
                None => {}
            }
        }
        self.wrong_names += named.iter().filter(|n| !image.quads.iter().any(|l| is_of(l, n))).count();
    }
}
