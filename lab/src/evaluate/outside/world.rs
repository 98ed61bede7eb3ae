//! A world of the outside format: `truth.json` in the evaluation format and, where poses are known,
//! `world.json` beside it with the camera of every picture and the corners of every landmark. In: a
//! folder. Out: labels, cameras, sizes and places, checked.

use crate::evaluate::truth::{Truth, TruthError};
use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};
use protos::{
    api::{Place, Size},
    convert::geometry,
    v1,
};
use serde::Deserialize;
use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};
use vision::{frame::Intrinsics, pose::LandmarkSize};

/// Largest departure of a rotation in the file from an orthonormal one: numbers there have seven
/// digits.
const MAX_SKEW: f64 = 1e-3;
/// Largest share of the longer side by which opposite sides of a landmark may differ.
const MAX_UNEVEN: f64 = 0.02;

/// Why a world cannot be used.
#[derive(Debug, thiserror::Error)]
pub(crate) enum WorldError {
    #[error(transparent)]
    Truth(#[from] TruthError),
    #[error("cannot read {path}")]
    Read { path: PathBuf, source: std::io::Error },
    #[error("{path} is not a description of a world")]
    Parse { path: PathBuf, source: serde_json::Error },
    #[error("{path}: {field}: {problem}")]
    Value { path: PathBuf, field: String, problem: String },
}

/// A landmark as it hangs in the world.
#[derive(Debug, Clone, Copy)]
pub(super) struct LandmarkTruth {
    /// x outward normal, y the viewer's right, z up; origin at the centre, metres.
    pub(super) world_from_landmark: Isometry3<f64>,
    pub(super) size: LandmarkSize,
}

/// The camera of one picture.
#[derive(Debug, Clone, Copy)]
pub(super) struct CameraTruth {
    /// x right, y down, z forward, metres.
    pub(super) camera_from_world: Isometry3<f64>,
    pub(super) intrinsics: Intrinsics,
}

/// What is stated of the errors of the cameras.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum CameraSigmas {
    /// There are none.
    Exact,
    /// Nothing: the server takes usual ones.
    Absent,
}

#[derive(Debug, Clone)]
pub(super) struct World {
    pub(super) truth: Truth,
    /// By name; empty without a `world.json`.
    pub(super) landmarks: BTreeMap<String, LandmarkTruth>,
    /// By file of the picture; empty without a `world.json`.
    pub(super) cameras: BTreeMap<String, CameraTruth>,
}

impl LandmarkTruth {
    /// As the interface takes them.
    pub(super) fn size_and_place(&self) -> (Size, Place) {
        let (roll_rad, tilt_rad, theta_rad) = self.world_from_landmark.rotation.euler_angles();
        let at = self.world_from_landmark.translation.vector;
        let size = Size { width_m: self.size.width_m, height_m: self.size.height_m };
        (size, Place { x_m: at.x, y_m: at.y, z_m: at.z, theta_rad, roll_rad, tilt_rad })
    }
}

impl World {
    /// Reads `folder/truth.json` and, if it is there, `folder/world.json`.
    pub(super) fn read(folder: &Path, sigmas: CameraSigmas) -> Result<Self, WorldError> {
        let truth = Truth::read(folder)?;
        let path = folder.join("world.json");
        if !path.exists() {
            return Ok(Self { truth, landmarks: BTreeMap::new(), cameras: BTreeMap::new() });
        }
        let text = std::fs::read(&path).map_err(|source| WorldError::Read { path: path.clone(), source })?;
        let raw: RawWorld = serde_json::from_slice(&text)
            .map_err(|source| WorldError::Parse { path: path.clone(), source })?;
        let wrong = |field: String, problem: String| WorldError::Value { path: path.clone(), field, problem };
        let mut landmarks = BTreeMap::new();
        for (i, landmark) in raw.landmarks.iter().enumerate() {
            let made = landmark_truth(&landmark.corners)
                .map_err(|problem| wrong(format!("landmarks[{i}].corners"), problem))?;
            landmarks.insert(landmark.name.clone(), made);
        }
        let mut cameras = BTreeMap::new();
        for (i, frame) in raw.frames.iter().enumerate() {
            let pose = isometry(&frame.camera_from_world)
                .map_err(|problem| wrong(format!("frames[{i}].camera_from_world"), problem))?;
            let intrinsics =
                frame.intrinsics(sigmas).map_err(|problem| wrong(format!("frames[{i}].fx"), problem))?;
            cameras.insert(frame.file.clone(), CameraTruth { camera_from_world: pose, intrinsics });
        }
        let world = Self { truth, landmarks, cameras };
        world.complete().map_err(|(field, problem)| wrong(field.to_owned(), problem))?;
        Ok(world)
    }

    /// Every picture has a camera and every taught landmark a pose: figures without them would
    /// leave out in silence.
    fn complete(&self) -> Result<(), (&'static str, String)> {
        let mut shown = self.truth.images.iter().filter(|image| !image.whole_image);
        if let Some(image) = shown.find(|image| !self.cameras.contains_key(&image.file)) {
            return Err(("frames", format!("none is of {}, which truth.json shows", image.file)));
        }
        let mut taught = self.truth.teach.iter();
        if let Some((_, name)) = taught.find(|(_, name)| !self.landmarks.contains_key(name)) {
            return Err(("landmarks", format!("none is {name}, which truth.json teaches")));
        }
        Ok(())
    }
}

#[derive(Deserialize)]
struct RawWorld {
    landmarks: Vec<RawLandmark>,
    frames: Vec<RawFrame>,
}

#[derive(Deserialize)]
struct RawLandmark {
    name: String,
    corners: [[f64; 3]; 4],
}

#[derive(Deserialize)]
struct RawFrame {
    file: String,
    fx: f64,
    fy: Option<f64>,
    cx: f64,
    cy: f64,
    camera_from_world: Vec<[f64; 4]>,
}

impl RawFrame {
    fn intrinsics(&self, sigmas: CameraSigmas) -> Result<Intrinsics, String> {
        let sigma_px = (sigmas == CameraSigmas::Exact).then_some(0.0);
        let wire = v1::Intrinsics {
            fx_px: self.fx,
            fy_px: self.fy.unwrap_or(self.fx),
            cx_px: self.cx,
            cy_px: self.cy,
            focal_sigma_px: sigma_px,
            center_sigma_px: sigma_px,
            ..v1::Intrinsics::default()
        };
        geometry::intrinsics(&wire).map_err(|refused| refused.detail)
    }
}

/// The pose that three or four rows of a homogeneous matrix give.
fn isometry(rows: &[[f64; 4]]) -> Result<Isometry3<f64>, String> {
    let [a, b, c, ..] = rows else { return Err(format!("3 or 4 rows expected, {} given", rows.len())) };
    let matrix = Matrix3::from_fn(|row, column| [a, b, c][row][column]);
    rigid(&matrix, Vector3::new(a[3], b[3], c[3]))
}

/// The pose of a landmark from its corners: top left, top right, bottom right, bottom left.
fn landmark_truth(corners: &[[f64; 3]; 4]) -> Result<LandmarkTruth, String> {
    let [top_left, top_right, bottom_right, bottom_left] = corners.map(Vector3::from);
    let [top, bottom] = [top_right - top_left, bottom_right - bottom_left];
    let [left, right] = [top_left - bottom_left, top_right - bottom_right];
    let (width_m, height_m) = (0.5 * (top.norm() + bottom.norm()), 0.5 * (left.norm() + right.norm()));
    let uneven = (top - bottom).norm().max((left - right).norm());
    if uneven.is_nan() || uneven > MAX_UNEVEN * width_m.max(height_m) {
        return Err(format!("no rectangle: opposite sides differ by {uneven:.4} m"));
    }
    let (y, z) = ((top + bottom).normalize(), (left + right).normalize());
    let centre = 0.25 * (top_left + top_right + bottom_right + bottom_left);
    let world_from_landmark = rigid(&Matrix3::from_columns(&[y.cross(&z), y, z]), centre)?;
    Ok(LandmarkTruth { world_from_landmark, size: LandmarkSize { width_m, height_m } })
}

fn rigid(rotation: &Matrix3<f64>, translation: Vector3<f64>) -> Result<Isometry3<f64>, String> {
    let skew = (rotation.transpose() * rotation - Matrix3::identity()).abs().max();
    if skew.is_nan() || skew > MAX_SKEW || rotation.determinant() <= 0.0 {
        return Err(format!("no rotation: its columns are {skew:.4} from orthonormal"));
    }
    let turn = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix(rotation));
    Ok(Isometry3::from_parts(Translation3::from(translation), turn))
}

#[cfg(test)]
mod tests {
    use super::*;
    use map::place::{LandmarkPlace, PlaceSigmas};

    /// Corners of a landmark that is placed by hand.
    fn corners(place: &LandmarkPlace) -> [[f64; 3]; 4] {
        [(-1.0, 1.0), (1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)].map(|(right, up)| {
            let at = Vector3::new(0.0, 0.5 * right * place.size.width_m, 0.5 * up * place.size.height_m);
            (place.map_from_landmark() * nalgebra::Point3::from(at)).into()
        })
    }

    #[test]
    fn a_landmark_comes_back_from_its_corners_at_any_turn() {
        let size = LandmarkSize { width_m: 0.6, height_m: 0.9 };
        let at = Vector3::new(2.0, -5.0, 1.5);
        for (theta, roll, tilt) in [(0.4, 0.0, 0.0), (-2.8, 0.1, 0.3), (1.2, -0.2, 1.0)] {
            let mut place = LandmarkPlace::by_hand(at, theta, size, PlaceSigmas::default()).unwrap();
            (place.roll_rad, place.tilt_rad) = (roll, tilt);
            let made = landmark_truth(&corners(&place)).unwrap();
            let (size, stated) = made.size_and_place();
            assert!((size.width_m - 0.6).abs() < 1e-9 && (size.height_m - 0.9).abs() < 1e-9);
            let expected = [2.0, -5.0, 1.5, theta, roll, tilt];
            let found =
                [stated.x_m, stated.y_m, stated.z_m, stated.theta_rad, stated.roll_rad, stated.tilt_rad];
            assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-9), "{found:?}");
        }
    }

    #[test]
    fn a_mirrored_pose_is_no_pose() {
        let rows = |sign: f64| [[1.0, 0.0, 0.0, 2.0], [0.0, sign, 0.0, 3.0], [0.0, 0.0, 1.0, 4.0]];
        assert_eq!(isometry(&rows(1.0)).unwrap().translation.vector, Vector3::new(2.0, 3.0, 4.0));
        assert!(isometry(&rows(-1.0)).is_err() && isometry(&rows(1.0)[..2]).is_err());
    }
}
