//! Why recognised landmarks fit no pose of an upright robot. In: the observations and the refused fix. Out: which number does
//! not fit and by how much, for programs and as a sentence.

use map::{
    extrinsics::CameraExtrinsics,
    localise::{
        FixQuantity, FixRefusal, FixResult, LandmarkObservation, LocaliseParams, RefusalCause, refusal_causes,
    },
    pose2::Pose2Covariance,
};
use protos::v1;
use vision::model::LandmarkId;

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
) -> Option<PoseRefusal> {
    let Some(FixResult::Refused(FixRefusal::Room { chi2, limit } | FixRefusal::Disagree { chi2, limit })) =
        fix
    else {
        return None;
    };
    let causes = refusal_causes(observations, extrinsics?, prior, &LocaliseParams::default());
    Some(PoseRefusal { chi2: *chi2, limit: *limit, causes })
}

/// As a message; `name` gives the landmark's name.
pub fn refusal_wire(refusal: &PoseRefusal, name: impl Fn(LandmarkId) -> String) -> v1::PoseRefusalDetail {
    let causes = refusal.causes.iter().map(|cause| cause_wire(cause, &name)).collect();
    let sentence = sentence(&refusal.causes, &name);
    v1::PoseRefusalDetail { chi2: refusal.chi2, limit: refusal.limit, causes, sentence }
}

fn cause_wire(cause: &RefusalCause, name: impl Fn(LandmarkId) -> String) -> v1::PoseRefusalCause {
    let (quantity, unit) = match cause.quantity {
        FixQuantity::Size(_) => (v1::FixQuantity::Size, "m"),
        FixQuantity::CameraHeight => (v1::FixQuantity::CameraHeight, "m"),
        FixQuantity::CameraTilt => (v1::FixQuantity::CameraTilt, "rad"),
        FixQuantity::Mounting => (v1::FixQuantity::Mounting, "px"),
    };
    v1::PoseRefusalCause {
        quantity: quantity.into(),
        landmark: match cause.quantity {
            FixQuantity::Size(landmark) => name(landmark),
            FixQuantity::CameraHeight | FixQuantity::CameraTilt | FixQuantity::Mounting => String::new(),
        },
        expected: cause.expected,
        measured: cause.measured,
        sigma: cause.sigma,
        unit: unit.to_owned(),
    }
}

/// What does not fit, by how much, and what to check.
fn sentence(causes: &[RefusalCause], name: impl Fn(LandmarkId) -> String) -> String {
    let (mut parts, mut checks) = (Vec::new(), Vec::new());
    for RefusalCause { quantity, expected, measured, .. } in causes {
        match quantity {
            FixQuantity::Size(landmark) => {
                let landmark = name(*landmark);
                parts.push(format!("`{landmark}` would be {measured:.2} m wide, not {expected:.2} m"));
                checks.push("size");
            }
            FixQuantity::CameraHeight => {
                parts.push(format!("the camera would hang at {measured:.2} m, not at {expected:.2} m"));
                checks.push("camera height");
            }
            FixQuantity::CameraTilt => {
                let [measured, expected] = [measured, expected].map(|a| a.to_degrees());
                parts
                    .push(format!("the camera would look up by {measured:.1} degrees, not by {expected:.1}"));
                checks.push("tilt");
            }
            FixQuantity::Mounting => {
                let sentence = "Landmark seen, but its corners are off by";
                return format!(
                    "{sentence} {measured:.1} px with any one of size, camera height and tilt changed: check the mounting and its place."
                );
            }
        }
    }
    checks.dedup();
    format!("Landmark seen, but {}: check {} and mounting.", parts.join(", or "), checks.join(", "))
}

#[cfg(test)]
mod tests;
