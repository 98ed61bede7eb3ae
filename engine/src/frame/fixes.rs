//! The robot's pose by the landmarks that a frame shows. In: analysed quads, the map, extrinsics,
//! an optional prior pose. Out: a fix (map frame, m and rad, with covariance), or why there is
//! none.

use crate::snapshot::MapSnapshot;
use map::{
    extrinsics::CameraExtrinsics,
    localise::{
        CameraPose, CameraPoseRefusal, Fix, FixRefusal, FixResult, LandmarkObservation, LocaliseParams,
        RefusalCause, camera_pose, refusal_causes, robot_pose,
    },
    pose2::Pose2Covariance,
};
use vision::{
    model::LandmarkId,
    pipeline::{FrameAnalysis, QuadAnalysis},
    pose::LandmarkPose,
    recognise::Verdict,
};

/// Why a frame gives no pose of the robot.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NoFix {
    /// No landmark was recognised and posed; the quads say why each has no pose.
    NothingRecognised,
    /// None of the recognised landmarks has a place.
    LandmarkNotPlaced,
    /// All of the placed landmarks are quarantined.
    LandmarkQuarantined,
    /// The camera's extrinsics are not known.
    NoExtrinsics,
    /// Every observation was dropped as unreliable.
    WeakObservation,
    /// Several poses are left.
    Ambiguous,
    /// The geometry does not determine a pose.
    Degenerate,
    /// The re-projection error is above its gate for every pose on the floor.
    GateReprojection,
    /// Every solution was gated by the prior pose.
    GatePrior,
    /// The robot would stand behind the wall.
    GateBehindWall,
    /// The landmarks contradict one another.
    GateInconsistent,
    /// The camera would be below the floor or far above it.
    GateCameraHeight,
    /// The position of the camera is known too poorly.
    GateImprecise,
}

impl NoFix {
    /// The word on the wire; empty where the quads say why.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::NothingRecognised => "",
            Self::LandmarkNotPlaced => "landmark_not_placed",
            Self::LandmarkQuarantined => "landmark_quarantined",
            Self::NoExtrinsics => "no_extrinsics",
            Self::WeakObservation => "weak_observation",
            Self::Ambiguous => "ambiguous",
            Self::Degenerate => "degenerate",
            Self::GateReprojection => "gate_reprojection",
            Self::GatePrior => "gate_prior",
            Self::GateBehindWall => "gate_behind_wall",
            Self::GateInconsistent => "gate_inconsistent",
            Self::GateCameraHeight => "gate_camera_height",
            Self::GateImprecise => "gate_imprecise",
        }
    }
}

impl From<&FixRefusal> for NoFix {
    fn from(refusal: &FixRefusal) -> Self {
        match refusal {
            FixRefusal::ReprojectionError { .. } => Self::GateReprojection,
            FixRefusal::Prior { .. } => Self::GatePrior,
            FixRefusal::BehindWall => Self::GateBehindWall,
            FixRefusal::Disagree { .. } => Self::GateInconsistent,
            FixRefusal::Degenerate => Self::Degenerate,
        }
    }
}

impl From<CameraPoseRefusal> for NoFix {
    fn from(refusal: CameraPoseRefusal) -> Self {
        match refusal {
            CameraPoseRefusal::Ambiguous => Self::Ambiguous,
            CameraPoseRefusal::Height => Self::GateCameraHeight,
            CameraPoseRefusal::Disagree => Self::GateInconsistent,
            CameraPoseRefusal::Imprecise => Self::GateImprecise,
        }
    }
}

/// The landmarks with verdict unique, with their poses (camera frame).
pub fn unique_landmarks(analysis: &FrameAnalysis) -> Vec<(LandmarkId, &LandmarkPose)> {
    let unique = |q: &QuadAnalysis| match q.recognition.as_ref()?.verdict {
        Verdict::Unique(id) => Some(id),
        Verdict::Unknown | Verdict::Ambiguous(_) => None,
    };
    analysis.quads.iter().filter_map(|q| Some((unique(q)?, q.pose.as_ref().ok()?))).collect()
}

/// Observations of the landmarks that were recognised, posed, and have a trusted place; or why
/// there are none.
pub fn landmark_observations<'a>(
    analysis: &'a FrameAnalysis,
    map: &'a MapSnapshot,
) -> Result<Vec<LandmarkObservation<'a>>, NoFix> {
    let posed = unique_landmarks(analysis);
    if posed.is_empty() {
        return Err(NoFix::NothingRecognised);
    }
    let placed = |(landmark, seen)| {
        let info = map.landmarks.get(&landmark)?;
        Some((info, LandmarkObservation { landmark, seen, place: info.place.as_ref()? }))
    };
    let placed: Vec<_> = posed.into_iter().filter_map(placed).collect();
    if placed.is_empty() {
        return Err(NoFix::LandmarkNotPlaced);
    }
    let trusted: Vec<_> = placed.into_iter().filter(|(info, _)| info.is_trusted()).map(|(_, s)| s).collect();
    if trusted.is_empty() { Err(NoFix::LandmarkQuarantined) } else { Ok(trusted) }
}

/// The pose of the robot by observations, one or several; or why there is none. `prior` gates.
pub fn robot_fixes(
    observations: &[LandmarkObservation<'_>],
    extrinsics: Option<&CameraExtrinsics>,
    prior: Option<&Pose2Covariance>,
    p: &LocaliseParams,
) -> Result<FixResult, NoFix> {
    let Some(extrinsics) = extrinsics else { return Err(NoFix::NoExtrinsics) };
    if observations.is_empty() {
        return Err(NoFix::WeakObservation);
    }
    robot_pose(observations, extrinsics, prior, p).map_err(|error| {
        tracing::error!(%error, "localisation_refused_checked_input");
        NoFix::Degenerate
    })
}

/// The fix, if there is exactly one; or why there is none.
pub fn single_fix(fix: &FixResult) -> Result<Fix, NoFix> {
    match fix {
        FixResult::Fixed(fix) => Ok((**fix).clone()),
        FixResult::Ambiguous(_) => Err(NoFix::Ambiguous),
        FixResult::Refused(refusal) => Err(NoFix::from(refusal)),
    }
}

/// The one pose of the robot by observations, or why there is none.
pub fn robot_fix(
    observations: &[LandmarkObservation<'_>],
    extrinsics: Option<&CameraExtrinsics>,
    prior: Option<&Pose2Covariance>,
    p: &LocaliseParams,
) -> Result<Fix, NoFix> {
    single_fix(&robot_fixes(observations, extrinsics, prior, p)?)
}

/// Where a photograph was taken, by the landmarks that it shows, or why that is not known.
pub fn photograph_pose(analysis: &FrameAnalysis, map: &MapSnapshot) -> Result<CameraPose, NoFix> {
    let found = camera_pose(&landmark_observations(analysis, map)?).map_err(|error| {
        tracing::error!(%error, "localisation_refused_checked_input");
        NoFix::Degenerate
    })?;
    found.map_err(NoFix::from)
}

/// A refusal by re-projection error.
#[derive(Debug, Clone, PartialEq)]
pub struct PoseRefusal {
    /// Weighted squared re-projection error of the best pose.
    pub chi2: f64,
    /// The largest that is accepted.
    pub limit: f64,
    /// The numbers that explain it, the likeliest first.
    pub causes: Vec<RefusalCause>,
}

/// The causes, if the fix was refused by re-projection error.
pub fn pose_refusal(
    observations: &[LandmarkObservation<'_>],
    extrinsics: Option<&CameraExtrinsics>,
    prior: Option<&Pose2Covariance>,
    fix: Option<&FixResult>,
    p: &LocaliseParams,
) -> Option<PoseRefusal> {
    let Some(FixResult::Refused(
        FixRefusal::ReprojectionError { chi2, limit } | FixRefusal::Disagree { chi2, limit },
    )) = fix
    else {
        return None;
    };
    let causes = refusal_causes(observations, extrinsics?, prior, p);
    Some(PoseRefusal { chi2: *chi2, limit: *limit, causes })
}
