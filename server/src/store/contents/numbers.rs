//! Numbers of landmarks inside of what is stored of a model: in its bytes, and in the texts that
//! name look-alikes.

use super::ModelContents;
use crate::failed_gates;
use std::collections::BTreeMap;
use vision::model::{LandmarkId, renumbered};

/// Numbers of landmarks in one map, with those of the same landmarks in another.
pub(crate) type Numbers = BTreeMap<LandmarkId, LandmarkId>;

/// The same model for the landmark `of` of another map. Bytes that are no model stay what they are:
/// no map uses them.
pub(crate) fn in_other_map(model: &ModelContents, of: LandmarkId, numbers: &Numbers) -> ModelContents {
    let mut made = model.clone();
    if let Ok(bytes) = renumbered(&model.bytes, of) {
        made.bytes = bytes;
    }
    made.summary.facts = failed_gates::renumbered(&model.summary.facts, numbers);
    made.summary.looks_like =
        model.summary.looks_like.as_deref().map(|text| failed_gates::renumbered(text, numbers));
    made
}
