//! What came of a localisation, as HTTP and zenoh say it.

use engine::{localise::Localisation, snapshot::MapSnapshot};
use protos::{
    api::{LocaliseHypothesisBody, LocaliseResult, LocaliseStatus},
    convert::geometry::pose2_covariance_wire,
};

/// With the names of landmarks, and the map's version.
pub(crate) fn localise_body(found: Localisation, map: &MapSnapshot) -> LocaliseResult {
    let Localisation { hypotheses, reason, answer } = found;
    let name = |id| map.landmarks.get(id).map(|landmark| landmark.name.clone());
    let hypotheses: Vec<_> = hypotheses
        .iter()
        .map(|hypothesis| LocaliseHypothesisBody {
            map_from_robot: pose2_covariance_wire(&hypothesis.pose),
            probability: hypothesis.probability,
            landmarks: hypothesis.landmarks.iter().filter_map(name).collect(),
            matched: hypothesis.matched,
        })
        .collect();
    let status = match (&reason, hypotheses.as_slice()) {
        (_, []) => LocaliseStatus::NoMatch,
        (None, _) => LocaliseStatus::Located,
        (Some(_), _) => LocaliseStatus::Ambiguous,
    };
    let pose = hypotheses.first().filter(|_| status == LocaliseStatus::Located);
    LocaliseResult {
        map: map.name.clone(),
        map_version: map.version,
        status,
        reason: reason.map(|reason| reason.as_str().to_owned()),
        map_from_robot: pose.map(|pose| pose.map_from_robot.clone()),
        hypotheses,
        answer,
    }
}
