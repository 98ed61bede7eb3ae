//! The golden drive as a survey.

use super::super::{
    CameraState, CameraStated, DriveRecord, JointParams, LineSeen, Motion, QuadView, Survey, Track,
};
use crate::pose2::Pose2;
use nalgebra::{Isometry3, Matrix2, Matrix3, Point2, Quaternion, SVector, UnitQuaternion, Vector3};
use serde::Deserialize;
use std::collections::BTreeMap;

#[derive(Deserialize)]
pub(super) struct Golden {
    start: [f64; 3],
    camera: GoldenCamera,
    camera_sigmas: [f64; 10],
    scale_sigma: f64,
    drift_sigma: f64,
    motions: Vec<[f64; 3]>,
    motion_sigmas: Vec<[f64; 3]>,
    /// Keyframe, section, facing angle, offset, root of the information: (0, 0), (1, 0), (1, 1).
    lines: Vec<(usize, usize, f64, f64, f64, f64, f64)>,
    tracks: Vec<GoldenTrack>,
    pub(super) solution: Solution,
}

#[derive(Deserialize)]
pub(super) struct GoldenCamera {
    quaternion_xyzw: [f64; 4],
    translation: [f64; 3],
    /// Focal length, centre, k1.
    intrinsics: [f64; 4],
}

impl GoldenCamera {
    pub(super) fn state(&self) -> CameraState {
        let [x, y, z, w] = self.quaternion_xyzw;
        let rotation = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
        let [focal_px, cx, cy, k1] = self.intrinsics;
        CameraState {
            robot_from_camera: Isometry3::from_parts(Vector3::from(self.translation).into(), rotation),
            focal_px,
            aspect: 1.0,
            centre_px: Point2::new(cx, cy),
            k1,
        }
    }
}

#[derive(Deserialize)]
struct GoldenTrack {
    wall: usize,
    keyframes: Vec<usize>,
    corners_px: Vec<[f64; 8]>,
}

#[derive(Deserialize)]
pub(super) struct Solution {
    pub(super) keyframes: Vec<[f64; 3]>,
    /// Anchor, facing angle, offset, by section.
    pub(super) walls: BTreeMap<usize, [f64; 4]>,
    pub(super) landmarks: Vec<[f64; 8]>,
    pub(super) camera: GoldenCamera,
    pub(super) odometry: [f64; 2],
    pub(super) landmark_variances: Vec<[f64; 8]>,
    pub(super) camera_variances: [f64; 10],
    pub(super) first_last_landmark: Vec<[f64; 8]>,
}

impl Golden {
    pub(super) fn read() -> Self {
        serde_json::from_str(include_str!("golden.json")).unwrap()
    }

    pub(super) fn params(&self) -> JointParams {
        JointParams {
            scale_sigma: self.scale_sigma,
            drift_sigma_rad_per_m: self.drift_sigma,
            border_sigma_px: 0.0,
            ..JointParams::default()
        }
    }

    pub(super) fn survey(&self) -> Survey {
        let pose = |[x, y, theta]: [f64; 3]| Pose2::new(x, y, theta);
        let motion = |(motion, sigmas): (&[f64; 3], &[f64; 3])| Motion {
            motion: pose(*motion),
            covariance: Matrix3::from_diagonal(&Vector3::from(sigmas.map(|s| s * s))),
        };
        let line =
            |&(keyframe, wall, facing_rad, offset_m, a, b, c): &(usize, usize, f64, f64, f64, f64, f64)| {
                let root = Matrix2::new(a, 0.0, b, c);
                let covariance = (root.transpose() * root).try_inverse().unwrap();
                LineSeen { keyframe, wall, facing_rad, offset_m, covariance }
            };
        let view = |(keyframe, px): (&usize, &[f64; 8])| QuadView {
            keyframe: *keyframe,
            mounting_from_camera: nalgebra::Isometry3::identity(),
            corners_px: [0, 1, 2, 3].map(|i| Point2::new(px[2 * i], px[2 * i + 1])),
            covariance_px2: [Matrix2::identity() * 0.25; 4],
        };
        let track = |t: &GoldenTrack| Track {
            views: t.keyframes.iter().zip(&t.corners_px).map(view).collect(),
            wall: Some(t.wall),
            size: None,
        };
        let drive = DriveRecord {
            motions: self.motions.iter().zip(&self.motion_sigmas).map(motion).collect(),
            lines: self.lines.iter().map(line).collect(),
            tracks: self.tracks.iter().map(track).collect(),
        };
        let sections = self.lines.iter().map(|l| l.1 + 1).max().unwrap_or(0);
        Survey {
            start: pose(self.start),
            camera: CameraStated {
                camera: self.camera.state(),
                sigmas: Some(SVector::from(self.camera_sigmas)),
            },
            drives: vec![drive],
            same_wall: (0..sections).collect(),
            plan: Vec::new(),
            candidates: Vec::new(),
        }
    }
}
