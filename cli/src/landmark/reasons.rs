//! Why a landmark is not in use, for people: one sentence and one advice for each failed gate.

use crate::failure::{Class, Failure};
use client::api::{Landmark, LandmarkStatus};

/// A line for each reason why a landmark is not in use; none where it is.
pub(super) fn lines(landmark: &Landmark) -> Vec<String> {
    landmark.failed_gates.iter().map(ToString::to_string).collect()
}

/// A failure for a landmark that is not in use, with its reasons.
pub(super) fn in_use(landmark: &Landmark) -> Result<(), Failure> {
    if landmark.status == LandmarkStatus::Active {
        return Ok(());
    }
    let sentence = format!("{} is not in use.", landmark.name);
    let mut failure =
        Failure::new(Class::Refused, "not_in_use", sentence).advise(lines(landmark).join("\n  "));
    failure.more.insert("failed_gates".into(), serde_json::json!(landmark.failed_gates));
    Err(failure)
}
