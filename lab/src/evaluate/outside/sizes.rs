//! Whether the ratio of sides that views show contradicts the true size of their landmark: the
//! check that refuses a stated size (`aspect_differs`), with the borders that the detector shows,
//! as a person accepts them when teaching.

use super::{
    score::{FOUND_WELL, PictureScore, View},
    world::World,
};
use serde::Serialize;
use std::collections::BTreeMap;
use vision::{
    frame::Intrinsics,
    learn::aspect::{Aspect, AspectAgreement, AspectView, aspect},
    pose::LandmarkSize,
};

/// Sides that differ by less than this ratio are not told from swapped ones.
const UNEVEN: f64 = 1.25;

/// Answers to one kind of question.
#[derive(Debug, Clone, Copy, Default, Serialize)]
pub(super) struct SizeFigures {
    /// Times that the true size was stated; of those, how many were refused and how many doubted.
    pub(super) stated: usize,
    pub(super) refused: usize,
    pub(super) doubted: usize,
    /// Refused ones whose views all outline the landmark well, at the stricter overlap: the check
    /// alone is wrong there.
    pub(super) refused_wrongly: usize,
    /// Times that width and height were stated in the other order, where that differs; how many
    /// were refused.
    pub(super) swapped: usize,
    pub(super) swapped_refused: usize,
}

/// Figures by what is known: the number of views, and the camera.
#[derive(Debug, Clone, Copy, Default, Serialize)]
pub(super) struct SizeReport {
    pub(super) one_view: SizeFigures,
    pub(super) one_view_of_known_camera: SizeFigures,
    /// All views of a landmark in its world together.
    pub(super) all_views: SizeFigures,
    pub(super) all_views_of_known_camera: SizeFigures,
}

impl SizeFigures {
    fn add(&mut self, shown: Option<Aspect>, size: LandmarkSize, are_good: bool) {
        let Some(shown) = shown else { return };
        self.stated += 1;
        match shown.agreement(size) {
            AspectAgreement::Agrees => {}
            AspectAgreement::Doubtful => self.doubted += 1,
            AspectAgreement::Differs { .. } => {
                self.refused += 1;
                self.refused_wrongly += usize::from(are_good);
            }
        }
        let LandmarkSize { width_m, height_m } = size;
        if (width_m / height_m).max(height_m / width_m) >= UNEVEN {
            let turned = LandmarkSize { width_m: height_m, height_m: width_m };
            self.swapped += 1;
            self.swapped_refused +=
                usize::from(matches!(shown.agreement(turned), AspectAgreement::Differs { .. }));
        }
    }
}

/// Of the worlds with true sizes; `None` where there are none.
pub(super) fn sizes(worlds: &[World], scores: &[PictureScore]) -> Option<SizeReport> {
    let mut report = SizeReport::default();
    for world in worlds.iter().filter(|world| !world.landmarks.is_empty()) {
        let mut by_landmark: BTreeMap<&str, Vec<(AspectView, Intrinsics, bool)>> = BTreeMap::new();
        for score in scores.iter().filter(|score| score.world == world.truth.name) {
            let Some(camera) = world.cameras.get(&score.file) else { continue };
            for label in score.labels.iter().filter(|label| label.view == View::Full) {
                let (Some(name), Some(corners_px)) = (label.landmark.as_deref(), label.found) else {
                    continue;
                };
                let view = AspectView { corners_px, size_px: score.size_px, camera: None };
                by_landmark.entry(name).or_default().push((
                    view,
                    camera.intrinsics,
                    label.shown_iou >= FOUND_WELL,
                ));
            }
        }
        for (name, views) in by_landmark {
            let Some(truth) = world.landmarks.get(name) else { continue };
            let unknown: Vec<AspectView> = views.iter().map(|(view, ..)| view.clone()).collect();
            let with_camera = |(view, camera, _): &(AspectView, Intrinsics, bool)| AspectView {
                camera: Some(*camera),
                ..view.clone()
            };
            let known: Vec<AspectView> = views.iter().map(with_camera).collect();
            let one = |view: &AspectView| aspect(std::slice::from_ref(view));
            for ((view, of_known), (.., is_good)) in unknown.iter().zip(&known).zip(&views) {
                report.one_view.add(one(view), truth.size, *is_good);
                report.one_view_of_known_camera.add(one(of_known), truth.size, *is_good);
            }
            let are_good = views.iter().all(|(.., is_good)| *is_good);
            report.all_views.add(aspect(&unknown), truth.size, are_good);
            report.all_views_of_known_camera.add(aspect(&known), truth.size, are_good);
        }
    }
    (report.one_view.stated > 0).then_some(report)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_true_size_agrees_and_a_swapped_one_is_refused() {
        let shown = Some(Aspect { ratio: 0.75, sigma_log: 0.02 });
        let size = |width_m, height_m| LandmarkSize { width_m, height_m };
        let mut figures = SizeFigures::default();
        figures.add(None, size(0.6, 0.8), true);
        figures.add(shown, size(0.6, 0.8), true);
        // Another border than the one that was measured, and a square, which has no swapped sides.
        figures.add(shown, size(0.7, 0.7), false);
        figures.add(shown, size(0.8, 0.6), true);
        let SizeFigures { stated, refused, refused_wrongly, doubted, swapped, swapped_refused } = figures;
        assert_eq!((stated, refused, refused_wrongly, doubted), (3, 2, 1, 0));
        assert_eq!((swapped, swapped_refused), (2, 1));
    }
}
