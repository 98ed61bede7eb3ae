//! What a drive comes to: walls, and what hangs on them where landmarks were asked for. In: the
//! laser map and the drive. Out: what was made, and what was left out and why.

use super::{MadeMap, MadeSurvey, Walls};
use crate::survey::{Drive, Effort, SurveyedObject, surveyed};
use map::{
    pose2::{Pose2, Pose2Covariance},
    slam::SlamMap,
};
use nalgebra::Matrix3;
use std::{num::NonZeroUsize, sync::Arc};
use vision::params::Params;

/// Most objects of which it is told why they are no landmarks: those with the most views.
pub const MAX_LEFT_OUT: usize = 64;

/// An object that is no landmark.
#[derive(Debug, Clone, PartialEq)]
pub struct LeftOut {
    /// Its centre, map frame, metres.
    pub centre_m: [f64; 3],
    /// Width and height, metres.
    pub size_m: [f64; 2],
    /// Number of its views.
    pub views: usize,
    /// Why it is none.
    pub reason: String,
}

/// What was made, and what is to be told of it.
pub(super) struct Fitted {
    pub(super) made: MadeMap,
    /// Number of landmarks; `None` where none were looked for.
    pub(super) landmarks: Option<usize>,
    pub(super) left_out: Vec<LeftOut>,
    /// Why no landmarks are proposed.
    pub(super) reason: Option<String>,
}

/// Surveys the drive, if there is one with frames; `origin` is the first pose where it is known.
pub(super) fn fitted(map: SlamMap, drive: Option<Drive>, origin: Option<&Pose2>) -> Fitted {
    let made = MadeMap { walls: walls(&map, &origin.copied().unwrap_or_default()), survey: None };
    let alone = Fitted { made, landmarks: None, left_out: Vec::new(), reason: None };
    let Some(drive) = drive.filter(|drive| !drive.frames.is_empty()) else { return alone };
    let effort = Effort { threads: NonZeroUsize::MIN, told: &|_, _, _| {} };
    match surveyed(std::slice::from_ref(&drive), vec![map], origin, (&Params::default(), effort)) {
        Ok(building) => {
            let left_out = left_out(&building.objects);
            let landmarks = building.objects.iter().filter(|object| object.refused.is_none()).count();
            let walls = building.walls.clone();
            let made = MadeMap { walls, survey: Some(Arc::new(MadeSurvey { drive, building })) };
            Fitted { made, landmarks: Some(landmarks), left_out, reason: None }
        }
        // The walls of the scans alone are none the worse.
        Err(error) => Fitted { reason: Some(no_landmarks(&error.to_string())), ..alone },
    }
}

fn left_out(objects: &[SurveyedObject]) -> Vec<LeftOut> {
    let why = |object: &SurveyedObject| {
        let place = &object.place;
        Some(LeftOut {
            centre_m: [place.x_m, place.y_m, place.z_m],
            size_m: [place.size.width_m, place.size.height_m],
            views: object.views.len(),
            reason: object.refused.clone()?,
        })
    };
    let mut all: Vec<LeftOut> = objects.iter().filter_map(why).collect();
    all.sort_by_key(|object| std::cmp::Reverse(object.views));
    all.truncate(MAX_LEFT_OUT);
    all
}

pub(super) fn no_landmarks(reason: &str) -> String {
    format!("no landmarks are proposed: {reason}")
}

/// The walls in the map frame, for a map whose first pose is `origin`.
fn walls(map: &SlamMap, origin: &Pose2) -> Walls {
    // Where the first pose lies in the map is a definition: it adds no error.
    let origin = Pose2Covariance { pose: *origin, covariance: Matrix3::zeros() };
    map.walls.iter().map(|wall| wall.transformed(&origin)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use map::place::{LandmarkPlace, PlaceSigmas};
    use nalgebra::{Matrix2, Point2, Vector3};
    use vision::{geometry::Corners, pose::LandmarkSize};

    #[test]
    fn of_many_objects_those_with_most_views_are_told() {
        let corners = [[0.0, 0.0], [9.0, 0.0], [9.0, 9.0], [0.0, 9.0]].map(Point2::from);
        let view = crate::survey::ObjectView {
            frame: 0,
            corners_px: Corners::new(corners).unwrap(),
            covariance_px2: [Matrix2::identity(); 4],
        };
        let object = |i: usize| {
            let size = LandmarkSize { width_m: 0.6, height_m: 0.8 };
            let at = Vector3::new(i as f64, 0.0, 1.5);
            SurveyedObject {
                place: LandmarkPlace::by_hand(at, 0.0, size, PlaceSigmas::default()).unwrap(),
                views: vec![view.clone(); i],
                refused: (i != 80).then(|| format!("reason {i}")),
            }
        };
        let told = left_out(&(1..=80).map(object).collect::<Vec<_>>());
        assert_eq!((told.len(), told[0].views, told[63].views), (MAX_LEFT_OUT, 79, 16));
        assert_eq!((told[0].centre_m, told[0].size_m), ([79.0, 0.0, 1.5], [0.6, 0.8]));
        assert_eq!(told[0].reason, "reason 79");
    }
}
