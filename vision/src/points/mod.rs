//! Point evidence for the identity of a landmark: keypoints on a rectified patch, matches with the
//! learnt points, a homography, and how improbable so many consistent matches are by chance.

pub mod patch;
pub mod keypoints;
pub mod descriptor;
pub mod point;
pub mod matching;
pub mod consensus;
pub mod evidence;
pub mod agreement;
pub mod plain;
pub mod vocabulary;
pub mod taught;
pub mod index;
pub mod verify;
pub mod search;
pub mod shown_matches;
pub mod frame_points;
pub mod frame_places;
#[cfg(test)]
pub(crate) mod tests;
