//! The evaluation format (`truth.json`) as plain values, with camera poses besides, and pictures as PGM bytes.
//! Writes no files: the caller does.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use vision::detect::quads::Corners;
use vision::frame::GrayImage;

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
    /// Names of one and the same picture.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub same: Vec<[String; 2]>,
    /// Pictures to be judged.
    pub images: Vec<ImageEntry>,
}

/// Intrinsics and size.
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

/// How much of a quad an image holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum QuadState {
    /// All of it.
    #[default]
    Full,
    /// Cut by the image border.
    Truncated,
    /// Partly hidden.
    Occluded,
}

/// A quad that is in an image.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct QuadEntry {
    /// TL, TR, BR, BL in pixels.
    pub corners: Corners,
    /// Its name, or none for a stranger.
    pub landmark: Option<String>,
    /// How much of it is there.
    #[serde(default)]
    pub state: QuadState,
    /// What it is.
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
    /// Whether no other real quad is there.
    pub quads_complete: bool,
    /// True camera pose: rows of the 3 x 4 matrix `map_from_camera`.
    pub map_from_camera: [[f64; 4]; 3],
}

/// Which quads of a rendered picture are listed, and under which names.
#[derive(Debug, Clone, PartialEq)]
pub struct Labels<'a> {
    /// Landmarks that are taught; all others are strangers.
    pub taught: &'a [String],
    /// Quads with a shorter side are left out.
    pub min_side_px: f64,
    /// Whether the list holds every quad. Floor tiles, ceiling panels and whole walls are never listed.
    pub complete: bool,
}

impl CameraEntry {
    /// Of a simulated camera. Distortion has no place in the format.
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
