//! Objects that look like something else of the building, as doors do: each is learnt from its
//! views and looked for in every frame of the drive. Where it is named at another place, a robot
//! would be, too. In: the drive and its map. Out: such objects, refused.
//!
//! What the drive did not show is not tested.

use super::{
    drive::{Drive, DriveFrame},
    objects::ObjectView,
    parallel::Effort,
    sightings::{analysed, picture},
    surveyed::{SurveyedBuilding, SurveyedObject},
};
use map::place::LandmarkPlace;
use nalgebra::{Isometry3, Point2, Vector2, Vector3};
use std::{collections::BTreeMap, sync::Arc};
use vision::{
    frame::{GrayImage, Intrinsics},
    geometry::Corners,
    learn::{TrainingView, learn},
    model::{LandmarkId, LandmarkModel, ModelSet, ModelStatus},
    params::Params,
    points::taught::{MAX_POINT_VIEWS, view_points},
    pose::reprojection::pixel,
    recognise::{MatchRefusal, RecognitionResult, Verdict},
};

/// Views that an object is learnt from.
const MAX_VIEWS: usize = 6;
/// An object is where it is named if the centre of the quad is so near to its own, as a share of
/// its longest side in the image. A quad may be a part of it.
const NEAR_SHARE: f64 = 0.5;
/// Without one that was refused, others may be named in its place: so often they are tested again.
const ROUNDS: usize = 3;

/// Refuses objects that are named where they are not.
pub(super) fn refuse_look_alikes(
    drive: &Drive,
    building: &mut SurveyedBuilding,
    (params, effort): (&Params, Effort<'_>),
) {
    for _ in 0..ROUNDS {
        let Some(models) = models(drive, &building.objects, (params, effort)) else { return };
        let places = |id: LandmarkId| building.objects.get(id.0 as usize).map(|object| object.place);
        let named = effort.of_each(&drive.frames, "telling apart", |number, frame| {
            let seen = FrameLook::new(building, number, frame)?;
            Some(seen.named_elsewhere(frame, &models, places, params))
        });
        let mut wrong: BTreeMap<LandmarkId, usize> = BTreeMap::new();
        named.into_iter().flatten().flatten().for_each(|id| *wrong.entry(id).or_default() += 1);
        for (id, times) in &wrong {
            let Some(object) = building.objects.get_mut(id.0 as usize) else { continue };
            object.refused = Some(format!("something else looks like it: taken for it {times} times"));
        }
        if wrong.is_empty() {
            return;
        }
    }
}

/// Of all objects that are not refused; `None` without any. They are `LandmarkId`s by number.
fn models(
    drive: &Drive,
    objects: &[SurveyedObject],
    (params, effort): (&Params, Effort<'_>),
) -> Option<ModelSet> {
    let accepted: Vec<usize> = (0..objects.len()).filter(|i| objects[*i].refused.is_none()).collect();
    let models = effort.of_each(&accepted, "learning", |_, number| {
        model(drive, &objects[*number], LandmarkId(*number as u64), params).map(Arc::new)
    });
    let models: Vec<Arc<LandmarkModel>> = models.into_iter().flatten().collect();
    if models.is_empty() { None } else { ModelSet::in_use(models.into_iter(), params).ok() }
}

/// Learnt from some of its views, whatever the gates of a lesson say.
pub(super) fn model(
    drive: &Drive,
    object: &SurveyedObject,
    id: LandmarkId,
    params: &Params,
) -> Option<LandmarkModel> {
    let every = object.views.len().div_ceil(MAX_VIEWS).max(1);
    let photograph = |view: &ObjectView| {
        let seen = picture(&drive.frames[view.frame]).ok()?;
        Some((seen.grey().clone(), view.corners_px))
    };
    let photographs: Vec<(GrayImage, Corners)> =
        object.views.iter().step_by(every).filter_map(photograph).collect();
    let view =
        |(image, corners): &(GrayImage, Corners)| TrainingView::photographed(image, corners, params).ok();
    let views: Vec<TrainingView> = photographs.iter().filter_map(view).collect();
    let points = photographs.iter().step_by(photographs.len().div_ceil(MAX_POINT_VIEWS).max(1));
    let points: Vec<_> = points.map(|(image, corners)| view_points(image, corners)).collect();
    let model = learn(id, &views, &[], params).ok()?.with_points(&points);
    Some(LandmarkModel { status: ModelStatus::Active, ..model })
}

/// How a frame was looked at, by the solution.
pub(super) struct FrameLook {
    camera_from_map: Isometry3<f64>,
    camera: Intrinsics,
}

impl FrameLook {
    pub(super) fn new(building: &SurveyedBuilding, number: usize, frame: &DriveFrame) -> Option<Self> {
        let mounting = building.mounting(&frame.frame.mounting.as_ref()?.robot_from_camera);
        let map_from_camera = building.frames.get(number)?.pose.to_isometry3() * mounting;
        let camera = building.intrinsics(frame.frame.intrinsics.as_ref()?);
        Some(Self { camera_from_map: map_from_camera.inverse(), camera })
    }

    /// The objects that a frame is said to show where they are not.
    fn named_elsewhere(
        &self,
        frame: &DriveFrame,
        models: &ModelSet,
        place: impl Fn(LandmarkId) -> Option<LandmarkPlace>,
        params: &Params,
    ) -> Vec<LandmarkId> {
        let named = recognised(frame, models, params);
        let elsewhere = named.iter().filter_map(|(result, corners)| {
            let id = taken_for(result)?;
            let there = self.sees(&place(id)?);
            (!there.is_some_and(|there| is_at(corners.points(), &there))).then_some(id)
        });
        elsewhere.collect()
    }

    /// The object that is where a quad is, the one with most views of several.
    pub(super) fn at(&self, corners: &Corners, objects: &[SurveyedObject]) -> Option<usize> {
        let is_there = |object: &SurveyedObject| {
            self.sees(&object.place).is_some_and(|there| is_at(corners.points(), &there))
        };
        let there = (0..objects.len()).filter(|i| is_there(&objects[*i]));
        there.max_by_key(|i| (objects[*i].views.len(), std::cmp::Reverse(*i)))
    }

    /// Corners of a landmark; `None` behind the camera.
    fn sees(&self, place: &LandmarkPlace) -> Option<[Point2<f64>; 4]> {
        let camera_from_landmark = self.camera_from_map * place.map_from_landmark();
        let (w, h) = (0.5 * place.size.width_m, 0.5 * place.size.height_m);
        let corner = |[y, z]: [f64; 2]| pixel(&camera_from_landmark, &Vector3::new(0.0, y, z), &self.camera);
        let [a, b, c, d] = [[-w, h], [w, h], [w, -h], [-w, -h]].map(corner);
        Some([a?, b?, c?, d?])
    }
}

/// What is recognised in a frame, and where the quad is: corners by points of a part may be far
/// off.
pub(super) fn recognised(
    frame: &DriveFrame,
    models: &ModelSet,
    params: &Params,
) -> Vec<(RecognitionResult, Corners)> {
    let Ok(picture) = picture(frame) else { return Vec::new() };
    let analysed = analysed(frame, &picture, models, params);
    let quads = analysed.quads.into_iter();
    quads.filter_map(|quad| Some((quad.recognition?, quad.quad.corners_px))).collect()
}

fn is_at(quad: &[Point2<f64>; 4], there: &[Point2<f64>; 4]) -> bool {
    let centre = |corners: &[Point2<f64>; 4]| corners.iter().map(|c| c.coords).sum::<Vector2<f64>>() / 4.0;
    let side = |i: usize| (there[i] - there[(i + 1) % 4]).norm();
    let longest_px = (0..4).map(side).fold(0.0, f64::max);
    (centre(quad) - centre(there)).norm() <= NEAR_SHARE * longest_px
}

/// The object that a quad looks like: by its verdict, and where points or the icon agree but some
/// other gate says no, which it may not say from another side. Of two objects that are both known
/// the verdict already says that they look alike.
fn taken_for(result: &RecognitionResult) -> Option<LandmarkId> {
    match result.verdict {
        Verdict::Unique(id) => Some(id),
        Verdict::Ambiguous(id) => {
            let refusal = result.candidates.first()?.refusal?;
            (refusal != MatchRefusal::Margin).then_some(id)
        }
        Verdict::Unknown => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_part_of_an_object_is_at_it_and_its_neighbour_is_not() {
        let square = |x: f64, side: f64| {
            [[x, 0.0], [x + side, 0.0], [x + side, side], [x, side]].map(|[x, y]| Point2::new(x, y))
        };
        let there = square(100.0, 80.0);
        assert!(is_at(&square(105.0, 40.0), &there), "a panel of it");
        assert!(!is_at(&square(185.0, 80.0), &there), "the door beside it");
    }
}
