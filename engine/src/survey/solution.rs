//! The joint map of drives as a building. In: the objects that were followed, and the map. Out: the
//! building with the objects that have a place, and what each fails by its own views.

use super::{
    follow::Stated,
    gates::{refusal, refuse_twins},
    objects::SeenObject,
    surveyed::{SurveyedBuilding, SurveyedObject},
};
use map::joint::JointLaserMap;

/// The solution, without what is of the laser map and the frames.
pub(super) fn building(found: Vec<SeenObject>, map: &JointLaserMap, stated: &Stated) -> SurveyedBuilding {
    let mut objects = Vec::new();
    for (seen, mapped) in found.into_iter().zip(&map.objects) {
        let Some(mapped) = mapped else { continue };
        let poses = seen.views.iter().map(|view| map.frames[view.frame].pose);
        let refused = refusal(&mapped.place, mapped.agreement, &poses.collect::<Vec<_>>());
        objects.push(SurveyedObject { place: mapped.place, views: seen.views, refused });
    }
    refuse_twins(&mut objects);
    SurveyedBuilding {
        walls: map.walls.iter().map(|wall| wall.segment.clone()).collect(),
        laser_walls: Vec::new(),
        laser_frames: Vec::new(),
        objects,
        frames: map.frames.clone(),
        camera: (map.camera, map.camera_sigmas),
        stated: stated.camera,
        odometry_scales: map.odometry.iter().map(|errors| errors.scale).collect(),
        loops: 0,
        undecodable: 0,
    }
}
