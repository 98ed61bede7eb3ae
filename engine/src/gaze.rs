//! Which landmark a robot's pan-tilt camera shall look at, over one version of its map: `map::gaze`
//! with the landmarks that are learnt, placed and trusted. A robot keeps one landmark until another
//! is clearly better; a page gets the ranking.

use crate::snapshot::MapSnapshot;
use map::{
    check::OutOfRange,
    gaze::{GazeAction, GazeCandidate, GazeController, GazeParams, GazeTarget, PanTiltUnit, rank},
    pose2::Pose2Covariance,
    visibility::PanTiltCamera,
};
use protos::Name;
use std::{
    collections::BTreeMap,
    sync::{Mutex, PoisonError},
};
use vision::model::{LandmarkId, LandmarkModel};

/// Robots whose target is remembered; the one with the oldest query is dropped for a new one.
pub const MAX_ROBOTS: usize = 10_000;

/// A robot's pose and camera, for which gaze targets are ranked.
#[derive(Debug, Clone)]
pub struct GazeQuery {
    /// `map_from_robot`, with covariance.
    pub pose: Pose2Covariance,
    /// Image size, focal length, and ranges of the pan-tilt unit.
    pub camera: PanTiltCamera,
    /// The pan-tilt unit's place on the robot and its present angles.
    pub pan_tilt: PanTiltUnit,
    /// Criterion and limits.
    pub params: GazeParams,
}

/// The landmarks of a map that are learnt, placed and trusted.
pub fn candidates(map: &MapSnapshot) -> Vec<GazeCandidate<'_>> {
    let candidate = |model: &LandmarkModel| {
        let (info, visible) = (map.landmarks.get(&model.id)?, map.visibility.get(&model.id)?);
        let place = info.place.as_ref().filter(|_| info.is_trusted())?;
        let (saliency, v_c) = (model.saliency, model.v_c_for_gaze());
        Some(GazeCandidate { landmark: model.id, place, visible, saliency, v_c })
    };
    map.models.iter().filter_map(|model| candidate(model)).collect()
}

/// Every landmark that can be looked at, best first. Errors: a query out of range.
pub fn ranked(map: &MapSnapshot, query: &GazeQuery) -> Result<Vec<GazeTarget>, OutOfRange> {
    rank(&query.pose, &candidates(map), &query.camera, &query.pan_tilt, &query.params)
}

/// The gaze target of each robot, with the tick of its last query.
#[derive(Debug, Default)]
pub struct GazeControllers(Mutex<BTreeMap<Name, (u64, GazeController)>>);

impl GazeControllers {
    /// The action of a robot at its own time `at_ns`; `outcome` says whether the last target was
    /// recognised. Errors: a query out of range.
    pub fn choose(
        &self,
        robot: &Name,
        at_ns: i64,
        outcome: Option<(LandmarkId, bool)>,
        map: &MapSnapshot,
        query: &GazeQuery,
    ) -> Result<GazeAction, OutOfRange> {
        let ranked = ranked(map, query)?;
        let mut controllers = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let tick = controllers.values().map(|(tick, _)| *tick).max().unwrap_or(0) + 1;
        if controllers.len() >= MAX_ROBOTS && !controllers.contains_key(robot) {
            let stalest = controllers.iter().min_by_key(|(_, (tick, _))| *tick).map(|(name, _)| name.clone());
            stalest.and_then(|name| controllers.remove(&name));
        }
        let (last, controller) = controllers.entry(robot.clone()).or_default();
        *last = tick;
        if let Some((landmark, recognised)) = outcome {
            controller.report_outcome(at_ns, landmark, recognised, &query.params);
        }
        Ok(controller.choose(at_ns, &ranked, &query.pose, &query.params))
    }
}
