//! The evaluation format (`truth.json`) as plain values, with camera poses besides, and pictures as
//! PGM bytes. Writes no files: the caller does.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use vision::frame::GrayImage;
use vision::geometry::Corners;

use crate::building::{Building, LandmarkKind};
use crate::camera::Camera;
use crate::truth::{FrameTruth, ViewState};

/// A data set with its truth.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct DataSet {
    /// Name of the set.
    pub name: String,
    /// The camera of all images.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub camera: Option<CameraEntry>,
    /// Width and height of landmarks, in metres.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub sizes_m: BTreeMap<String, [f64; 2]>,
    /// Pictures of which the whole is a landmark.
    #[serde(default)]
    pub teach: Vec<TeachEntry>,
    /// Groups of names of one picture.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub same: Vec<[String; 2]>,
    /// Pictures to be evaluated.
    pub images: Vec<ImageEntry>,
}

/// Intrinsics and image size.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CameraEntry {
    /// Focal length along u, px.
    pub fx: f64,
    /// Focal length along v, px.
    pub fy: f64,
    /// Principal point, column.
    pub cx: f64,
    /// Principal point, row.
    pub cy: f64,
    /// Image width, px.
    pub width: usize,
    /// Image height, px.
    pub height: usize,
}

/// A picture of one landmark.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TeachEntry {
    /// Path in the set.
    pub file: String,
    /// Name of the landmark.
    pub landmark: String,
}

/// How much of a quad is visible in an image.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum QuadState {
    /// The whole quad is visible.
    #[default]
    Full,
    /// Cut by the image border.
    Truncated,
    /// Another object hides a part of it.
    Occluded,
}

/// A labelled quad of an image.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct QuadEntry {
    /// TL, TR, BR, BL in pixels.
    pub corners: Corners,
    /// Name of the landmark; `None` for a distractor.
    pub landmark: Option<String>,
    /// How much of it is visible.
    #[serde(default)]
    pub state: QuadState,
    /// Whether a detector must find it. One that is not counted is neither missed nor false.
    #[serde(default = "yes", skip_serializing_if = "is_true")]
    pub counted: bool,
    /// Kind of the object.
    pub kind: LandmarkKind,
    /// Hidden share of what lies within the image.
    pub occluded_share: f64,
    /// Angle between its normal and the direction to the camera.
    pub view_angle_rad: f64,
    /// From the camera to its centre.
    pub distance_m: f64,
}

/// An image and the quads in it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ImageEntry {
    /// Path in the set.
    pub file: String,
    /// Class of difficulty.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stratum: Option<String>,
    /// The quads.
    pub quads: Vec<QuadEntry>,
    /// Other real quads, neither missed nor false: parts of the quads, whole walls.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub others: Vec<Corners>,
    /// Whether the image has no other real quad.
    pub quads_complete: bool,
    /// True camera pose: rows of the 3 x 4 matrix `map_from_camera`.
    pub map_from_camera: [[f64; 4]; 3],
}

fn yes() -> bool {
    true
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde's signature")]
fn is_true(value: &bool) -> bool {
    *value
}

/// Which quads of a rendered picture are listed, and under which names.
#[derive(Debug, Clone, PartialEq)]
pub struct Labels<'a> {
    /// Landmarks that are taught; all others are distractors.
    pub taught: &'a [String],
    /// Quads with a shorter side are left out.
    pub min_side_px: f64,
    /// Whether the list holds every quad. Floor tiles, ceiling panels and whole walls are never
    /// listed.
    pub complete: bool,
}

impl CameraEntry {
    /// The entry of a simulated camera. The format has no distortion.
    pub fn new(camera: &Camera) -> Self {
        let k = camera.intrinsics();
        let (width, height) = (camera.width_px(), camera.height_px());
        Self { fx: k.fx_px, fy: k.fy_px, cx: k.cx_px, cy: k.cy_px, width, height }
    }
}

impl ImageEntry {
    /// The entry of a rendered picture.
    pub fn new(file: &str, stratum: Option<&str>, truth: &FrameTruth, labels: &Labels) -> Self {
        let quad = |l: &crate::truth::LandmarkView| QuadEntry {
            corners: l.corners_px,
            landmark: labels.taught.iter().find(|t| **t == l.name).cloned(),
            state: match l.state {
                ViewState::Full => QuadState::Full,
                ViewState::Truncated => QuadState::Truncated,
                ViewState::Occluded => QuadState::Occluded,
            },
            counted: true,
            kind: l.kind,
            occluded_share: l.occluded_share,
            view_angle_rad: l.view_angle_rad,
            distance_m: l.distance_m,
        };
        let pose = truth.map_from_camera.to_homogeneous();
        Self {
            file: file.into(),
            stratum: stratum.map(Into::into),
            quads: truth
                .landmarks
                .iter()
                .filter(|l| l.min_side_px() >= labels.min_side_px)
                .map(quad)
                .collect(),
            others: vec![],
            quads_complete: labels.complete,
            map_from_camera: std::array::from_fn(|row| std::array::from_fn(|column| pose[(row, column)])),
        }
    }
}

/// Sizes of all landmarks of a building.
pub fn sizes_m(building: &Building) -> BTreeMap<String, [f64; 2]> {
    building.landmarks().iter().map(|l| (l.name.clone(), [l.width_m, l.height_m])).collect()
}

/// A picture as binary PGM.
pub fn pgm(image: &GrayImage) -> Vec<u8> {
    let mut bytes = format!("P5\n{} {}\n255\n", image.width(), image.height()).into_bytes();
    bytes.extend_from_slice(image.data());
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::building::Building;
    use crate::lesson::{LessonParams, stops};
    use crate::robot::{Robot, RobotParams};
    use std::sync::Arc;

    fn entry(min_side_px: f64) -> (ImageEntry, FrameTruth) {
        let building = Arc::new(Building::corridor(6));
        let mut robot = Robot::new(building.clone(), &RobotParams::default());
        let stop = &stops(&building, &LessonParams { views: 1, ..LessonParams::default() })[1];
        let truth = robot.look(&stop.step).frame.truth;
        let taught = [stop.landmark.clone()];
        let labels = Labels { taught: &taught, min_side_px, complete: false };
        (ImageEntry::new("a.png", Some("plain"), &truth, &labels), truth)
    }

    #[test]
    fn the_keys_are_those_of_the_format() {
        let (image, truth) = entry(20.0);
        let set = DataSet {
            name: "corridor".into(),
            camera: Some(CameraEntry::new(&Camera::vga())),
            sizes_m: sizes_m(&Building::corridor(6)),
            teach: vec![TeachEntry { file: "poster-1.png".into(), landmark: "poster-1".into() }],
            same: vec![],
            images: vec![image],
        };
        let json = serde_json::to_value(&set).unwrap();
        assert_eq!(json["camera"]["fx"], 512.0);
        assert_eq!(json["sizes_m"]["poster-1"], serde_json::json!([0.6, 0.84]));
        assert_eq!(json["images"][0]["quads_complete"], false);
        let quads = json["images"][0]["quads"].as_array().unwrap();
        let poster = quads.iter().find(|q| q["landmark"] == "poster-1").unwrap();
        assert_eq!(poster["state"], "full");
        let corner = truth.landmark("poster-1").unwrap().corners_px.points()[0];
        assert_eq!(poster["corners"][0], serde_json::json!([corner.x, corner.y]));
        assert!(quads.iter().all(|q| q["landmark"] == "poster-1" || q["landmark"].is_null()));
        assert_eq!(serde_json::from_value::<DataSet>(json).unwrap(), set);
    }

    #[test]
    fn small_quads_are_left_out_and_the_pose_is_the_cameras() {
        let (image, truth) = entry(1e4);
        assert!(image.quads.is_empty() && !truth.landmarks.is_empty());
        let position = truth.map_from_camera.translation;
        for (row, expected) in image.map_from_camera.iter().zip(position.vector.iter()) {
            assert!((row[3] - expected).abs() < 1e-12);
        }
    }

    #[test]
    fn pgm_is_header_and_pixels() {
        let image = GrayImage::from_fn(3, 2, |u, v| (10 * v + u) as u8);
        assert_eq!(pgm(&image), b"P5\n3 2\n255\n\x00\x01\x02\x0a\x0b\x0c");
    }
}
