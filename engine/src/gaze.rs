//! Where a robot should look, over one version of its map: `map::gaze` with the landmarks that are learnt, placed and
//! trusted. Robots that ask keep to one landmark until another is clearly better; pages that ask get the ranking only.

use super::snapshot::MapSnapshot;
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
use vision::model::LandmarkId;

/// Robots whose gaze is remembered; the one longest silent gives way.
pub const MAX_ROBOTS: usize = 10_000;

/// What is asked.
#[derive(Debug, Clone)]
pub struct GazeQuery {
    /// Where the robot is.
    pub pose: Pose2Covariance,
    /// Ranges of its pan-tilt unit, and its focal length.
    pub viewer: PanTiltCamera,
    /// Where its camera is and looks.
    pub head: PanTiltUnit,
    /// How to choose.
    pub params: GazeParams,
}

/// Every landmark worth looking at, best first.
pub fn ranked(map: &MapSnapshot, ask: &GazeQuery) -> Result<Vec<GazeTarget>, OutOfRange> {
    let targets: Vec<GazeCandidate<'_>> = map
        .models
        .iter()
        .filter_map(|model| {
            let (info, visible) = (map.landmarks.get(&model.id)?, map.visibility.get(&model.id)?);
            let place = info.place.as_ref().filter(|_| info.is_trusted())?;
            let (saliency, v_c) = (model.saliency, model.v_c);
            Some(GazeCandidate { landmark: model.id, place, visible, saliency, v_c })
        })
        .collect();
    rank(&ask.pose, &targets, &ask.viewer, &ask.head, &ask.params)
}

/// Which landmark each robot was told to look at.
#[derive(Debug, Default)]
pub struct GazeControllers(Mutex<BTreeMap<Name, (u64, GazeController)>>);

impl GazeControllers {
    /// Where a robot should look at its own time `at_ns`; `looked` is what came of the last look.
    pub fn choose(
        &self,
        robot: &Name,
        at_ns: i64,
        looked: Option<(LandmarkId, bool)>,
        map: &MapSnapshot,
        ask: &GazeQuery,
    ) -> Result<GazeAction, OutOfRange> {
        let ranked = ranked(map, ask)?;
        let mut gazes = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let tick = gazes.values().map(|(tick, _)| *tick).max().unwrap_or(0) + 1;
        if gazes.len() >= MAX_ROBOTS && !gazes.contains_key(robot) {
            let stalest = gazes.iter().min_by_key(|(_, (tick, _))| *tick).map(|(name, _)| name.clone());
            stalest.and_then(|name| gazes.remove(&name));
        }
        let (ticked, gaze) = gazes.entry(robot.clone()).or_default();
        *ticked = tick;
        if let Some((landmark, recognised)) = looked {
            gaze.report_outcome(at_ns, landmark, recognised, &ask.params);
        }
        Ok(gaze.choose(at_ns, &ranked, &ask.pose, &ask.params))
    }
}
