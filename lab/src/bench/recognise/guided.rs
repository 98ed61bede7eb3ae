//! Guided recognition on frames of a robot whose pose is known. The corridor's posters have their
//! places; the other landmarks hang in other parts of a large building.

use super::scenes::{Scenes, number};
use engine::{
    context::FrameContext,
    guided::{GuidedResult, recognise_guided},
    snapshot::{LandmarkInfo, MapSnapshot},
};
use map::{
    extrinsics::CameraExtrinsics,
    place::{LandmarkPlace, PlaceSigmas},
    pose2::Pose2Covariance,
    segments::LaserSegment,
    visibility::{Obstacle, VisibilitySettings, visibility},
};
use nalgebra::{Matrix2, Matrix3, Vector3};
use std::{collections::BTreeMap, sync::Arc};
use vision::{
    frame::{GrayImage, Intrinsics},
    model::{LandmarkId, ModelSet},
    pipeline::FrameAnalysis,
    pose::LandmarkSize,
    random::Random,
};

/// Standard deviations of the known pose: of its position along each axis, and of its heading.
const POSITION_M: f64 = 0.03;
const HEADING_RAD: f64 = 0.01;
/// Distance between the parts of the building that the other landmarks hang in.
const ELSEWHERE_M: f64 = 200.0;
/// Landmarks of such a part.
const PER_PART: u64 = 50;

/// A map of known places, and a pose for every frame.
pub(super) struct Guide {
    map: MapSnapshot,
    poses: Vec<(Pose2Covariance, CameraExtrinsics)>,
}

impl Guide {
    /// Poses have errors by the stated standard deviations, drawn from `seed`.
    pub(super) fn new(scenes: &Scenes, models: &ModelSet, seed: u64) -> anyhow::Result<Self> {
        let size = LandmarkSize { width_m: 0.6, height_m: 0.84 };
        let walls = scenes.building.walls().iter();
        let walls: Vec<LaserSegment> = walls
            .map(|w| LaserSegment::from_ends(w.a_m, w.b_m, Matrix2::identity() * 1e-4))
            .collect::<Result<_, _>>()?;
        let obstacles: Vec<Obstacle> = walls.iter().map(Obstacle::from).collect();
        let mut map = MapSnapshot::empty("bench", 1);
        (map.walls, map.models) = (std::sync::Arc::new(walls), models.clone());
        let sigmas = PlaceSigmas::default();
        let mut place_landmark = |id: LandmarkId, place: LandmarkPlace| {
            let (size, name) = (Some(place.size), id.0.to_string());
            map.landmarks
                .insert(id, LandmarkInfo { name, size, place: Some(place), ..LandmarkInfo::default() });
            map.sizes.insert(id, place.size);
        };
        let mut posters = BTreeMap::new();
        for poster in scenes.building.posters() {
            let Some(index) = number(&poster.name) else { continue };
            let (at, normal) = (
                poster.map_from_landmark.translation.vector,
                poster.map_from_landmark.rotation * Vector3::x(),
            );
            let size = LandmarkSize { width_m: poster.width_m, height_m: poster.height_m };
            let place = LandmarkPlace::by_hand(at, normal.y.atan2(normal.x), size, sigmas)?;
            posters.insert(LandmarkId(index as u64 + 1), place);
        }
        for model in models.iter() {
            let place = if let Some(place) = posters.get(&model.id) {
                *place
            } else {
                let (part, along) = (model.id.0 / PER_PART + 1, model.id.0 % PER_PART);
                let at = Vector3::new(along as f64, ELSEWHERE_M * part as f64, 1.5);
                LandmarkPlace::by_hand(at, std::f64::consts::FRAC_PI_2, size, sigmas)?
            };
            place_landmark(model.id, place);
        }
        let sight = VisibilitySettings::default();
        for (id, place) in posters.iter().filter(|(id, _)| models.get(**id).is_some()) {
            let area = visibility(place, &obstacles, &sight.viewer, &sight.seen)?;
            map.visibility.insert(*id, Arc::new(area));
        }
        let mut random = Random::new(seed);
        let mut normal = || (0..12).map(|_| random.range(0.0, 1.0)).sum::<f64>() - 6.0;
        let (p, h) = (POSITION_M * POSITION_M, HEADING_RAD * HEADING_RAD);
        let covariance = Matrix3::from_diagonal(&Vector3::new(p, p, h));
        let mut pose = |step: &sim::drive::Step| {
            let off = Vector3::new(POSITION_M * normal(), POSITION_M * normal(), HEADING_RAD * normal());
            let pose = Pose2Covariance { pose: step.map_from_robot.plus(&off), covariance };
            Ok((pose, CameraExtrinsics::new(step.robot_from_camera)?))
        };
        let poses = scenes.steps.iter().map(&mut pose).collect::<anyhow::Result<_>>()?;
        Ok(Self { map, poses })
    }

    /// Guided recognition of frame `i` without detected quads.
    pub(super) fn recognise(&self, i: usize, frame: &GrayImage, camera: &Intrinsics) -> GuidedResult {
        let (pose, mounting) = &self.poses[i];
        let nothing = FrameAnalysis { quads: Vec::new() };
        let view = FrameContext {
            is_whole: true,
            analysis: &nothing,
            map: &self.map,
            extrinsics: Some(mounting),
            camera: Some(camera),
            image_px: [frame.width() as f64, frame.height() as f64],
            prior: None,
        };
        recognise_guided(frame, &view, pose)
    }
}
