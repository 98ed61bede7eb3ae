//! Robots' cameras by their frames. In: frames with the landmarks recognised in them. Out:
//! intrinsics as sent, the state of an intrinsics monitor, and views of landmarks from different
//! sides, for a new calibration.
//!
//! Bounded; nothing is stored on disk.

use crate::{
    frame::{
        analysis::{AnalysedFrame, Effect},
        fixes::{NoFix, unique_landmarks},
        slots::SlotKey,
    },
    snapshot::MapSnapshot,
};
use map::{
    extrinsics::CameraExtrinsics,
    localise::{
        Fix, LandmarkObservation,
        intrinsics_monitor::{IntrinsicsMonitor, IntrinsicsMonitorState, focal_evidence},
    },
};
use nalgebra::{Matrix2, Point2, Vector3};
use protos::CheckedFrame;
use std::{
    collections::BTreeMap,
    sync::{Mutex, MutexGuard, PoisonError},
};
use vision::{
    camera_calibration::PlanarView,
    frame::Intrinsics,
    model::LandmarkId,
    pose::{LandmarkPose, reprojection::corner_points},
};

/// Cameras in the registry; further ones are not recorded.
pub const MAX_CAMERAS: usize = 4_096;
/// Views of one camera.
pub const MAX_VIEWS: usize = 64;
/// Views of one landmark by one camera.
pub const MAX_VIEWS_OF_LANDMARK: usize = 12;
/// A view is new when the landmark's normal (camera frame) differs from that of every stored view
/// by more than this.
const MIN_NEW_ANGLE_RAD: f64 = 0.09;

/// A view of a landmark of known size, for calibration. `normal` is in the camera frame.
#[derive(Debug, Clone)]
struct CalibrationView {
    landmark: LandmarkId,
    normal: Vector3<f64>,
    view: PlanarView,
}

#[derive(Debug, Clone)]
struct CameraRecord {
    intrinsics: Intrinsics,
    image_px: [u32; 2],
    frames: u64,
    monitor: IntrinsicsMonitor,
    views: Vec<CalibrationView>,
}

/// What the registry has of a camera.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraState {
    /// As its frames state them.
    pub intrinsics: Intrinsics,
    /// Width and height of its frames, px.
    pub image_px: [u32; 2],
    /// Frames with these intrinsics in which something was recognised.
    pub frames: u64,
    /// State of the intrinsics monitor.
    pub monitor: IntrinsicsMonitorState,
    /// Stored views to calibrate from.
    pub views: usize,
}

/// All cameras.
#[derive(Debug, Default)]
pub struct CameraRegistry(Mutex<BTreeMap<SlotKey, CameraRecord>>);

/// One frame of a camera with what was recognised in it.
#[derive(Debug, Clone, Copy)]
pub struct CameraSample<'a> {
    /// As the frame states them.
    pub intrinsics: &'a Intrinsics,
    /// Width and height of the frame, px.
    pub image_px: [u32; 2],
    /// Landmarks with verdict unique, with their poses (camera frame).
    pub landmarks: &'a [(LandmarkId, &'a LandmarkPose)],
    /// Their map.
    pub map: &'a MapSnapshot,
    /// `robot_from_camera`, where it is known.
    pub extrinsics: Option<&'a CameraExtrinsics>,
    /// The fix, or why there is none.
    pub fix: Result<&'a Fix, NoFix>,
}

impl CameraRegistry {
    /// Records a frame that may change its robot's pose.
    pub fn record_answered(&self, key: &SlotKey, frame: &CheckedFrame, found: &AnalysedFrame) {
        let (Effect::Full, Some(intrinsics)) = (found.effect, &frame.intrinsics) else { return };
        let (landmarks, picture) = (unique_landmarks(&found.analysis), &found.picture);
        let image_px = [picture.width() as u32, picture.height() as u32];
        let fix = found.evaluation.fix.as_ref().map_err(|reason| *reason);
        let (landmarks, map, extrinsics) = (&landmarks[..], &*found.map, frame.mounting.as_ref());
        self.record_frame(key, &CameraSample { intrinsics, image_px, landmarks, map, extrinsics, fix });
    }

    /// Records a frame; one without recognised landmarks changes nothing.
    pub fn record_frame(&self, key: &SlotKey, sample: &CameraSample<'_>) {
        if sample.landmarks.is_empty() {
            return;
        }
        let evidence = sample.fix.ok().and_then(|fix| {
            let observations: Vec<LandmarkObservation<'_>> = sample
                .landmarks
                .iter()
                .filter(|(id, _)| fix.landmarks.contains(id))
                .filter_map(|(id, seen)| {
                    let place = sample.map.landmarks.get(id)?.place.as_ref()?;
                    Some(LandmarkObservation { landmark: *id, seen, place })
                })
                .collect();
            (!observations.is_empty())
                .then(|| focal_evidence(&observations, sample.extrinsics?, &fix.pose.pose))
                .flatten()
        });
        let mut all = self.lock();
        if !all.contains_key(key) && all.len() >= MAX_CAMERAS {
            return;
        }
        let new = || CameraRecord {
            intrinsics: *sample.intrinsics,
            image_px: sample.image_px,
            frames: 0,
            monitor: IntrinsicsMonitor::default(),
            views: vec![],
        };
        let record = all.entry(key.clone()).or_insert_with(new);
        if record.image_px != sample.image_px {
            *record = new();
        } else if record.intrinsics != *sample.intrinsics {
            // Another calibration of the same camera: its views still hold, the monitor's
            // statistics do not.
            let views = std::mem::take(&mut record.views);
            *record = CameraRecord { views, ..new() };
        }
        record.frames += 1;
        match sample.fix {
            Ok(fix) => record.monitor.add_fix(fix, evidence),
            Err(NoFix::GateReprojection | NoFix::GateInconsistent) => record.monitor.add_refusal(),
            Err(_) => {}
        }
        for (id, pose) in sample.landmarks {
            record.add_view(*id, pose, sample.intrinsics);
        }
    }

    /// The cameras of a robot, by name.
    pub fn of_robot(&self, robot: &str) -> Vec<(String, CameraState)> {
        let all = self.lock();
        let of = all.iter().filter(|(key, _)| key.robot.as_str() == robot);
        of.map(|(key, record)| (key.camera.to_string(), record.state())).collect()
    }

    /// The stored views of a camera and the size of its images, px.
    pub fn views(&self, robot: &str, camera: &str) -> Option<(Vec<PlanarView>, [u32; 2])> {
        let all = self.lock();
        let (_, record) =
            all.iter().find(|(key, _)| key.robot.as_str() == robot && key.camera.as_str() == camera)?;
        Some((record.views.iter().map(|v| v.view.clone()).collect(), record.image_px))
    }

    fn lock(&self) -> MutexGuard<'_, BTreeMap<SlotKey, CameraRecord>> {
        // Single steps only: a panic elsewhere leaves nothing half changed.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl CameraRecord {
    /// Stores a view from a new side, within the bounds. A pose that may be flipped gives none.
    fn add_view(&mut self, landmark: LandmarkId, pose: &LandmarkPose, intrinsics: &Intrinsics) {
        let normal = pose.best.camera_from_landmark.rotation * Vector3::x();
        let own: Vec<_> = self.views.iter().filter(|v| v.landmark == landmark).collect();
        let is_new = own.iter().all(|v| v.normal.angle(&normal) > MIN_NEW_ANGLE_RAD);
        let is_full = self.views.len() >= MAX_VIEWS || own.len() >= MAX_VIEWS_OF_LANDMARK;
        if is_full || !is_new || pose.ambiguous {
            return;
        }
        self.views.push(CalibrationView { landmark, normal, view: distorted_view(pose, intrinsics) });
    }

    fn state(&self) -> CameraState {
        CameraState {
            intrinsics: self.intrinsics,
            image_px: self.image_px,
            frames: self.frames,
            monitor: self.monitor.state(),
            views: self.views.len(),
        }
    }
}

/// The view with the lens distortion put back: a calibration must not rest on the intrinsics that
/// it replaces.
fn distorted_view(pose: &LandmarkPose, k: &Intrinsics) -> PlanarView {
    let m = &pose.measured;
    let distorted =
        |p: &Point2<f64>| k.project(&Vector3::new((p.x - k.cx_px) / k.fx_px, (p.y - k.cy_px) / k.fy_px, 1.0));
    let covariance = |p: &Point2<f64>, s: &Matrix2<f64>| {
        let back = k.undistort_with(&distorted(p)).and_then(|(_, j)| j.try_inverse());
        back.map_or(*s, |j| j * s * j.transpose())
    };
    let corners = m.corners_px.points();
    PlanarView {
        plane_m: corner_points(&m.size).map(|p| Point2::new(p.y, p.z)).to_vec(),
        seen_px: corners.iter().map(distorted).collect(),
        covariance_px2: corners
            .iter()
            .zip(&m.covariance_px2.blocks())
            .map(|(p, s)| covariance(p, s))
            .collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Isometry3, UnitQuaternion};
    use protos::Name;
    use vision::{
        camera_calibration::{CalibrateParams, calibrate},
        frame::Distortion,
        geometry::Corners,
        pose::{LandmarkSize, landmark_pose},
    };

    const SIZE: LandmarkSize = LandmarkSize { width_m: 0.6, height_m: 0.84 };

    fn key(camera: &str) -> SlotKey {
        SlotKey { robot: Name::new("r1").unwrap(), camera: Name::new(camera).unwrap() }
    }

    /// Poses of a landmark by a camera with intrinsics `real` that states `stated`.
    fn poses(real: &Intrinsics, stated: &Intrinsics) -> Vec<LandmarkPose> {
        (0..9)
            .map(|i| {
                let (turn, tilt) = (f64::from(i % 3 - 1) * 0.6, f64::from(i / 3 - 1) * 0.4 + 0.05);
                let front =
                    UnitQuaternion::from_rotation_matrix(&nalgebra::Rotation3::from_matrix_unchecked(
                        nalgebra::Matrix3::new(0.0, 1.0, 0.0, 0.0, 0.0, -1.0, -1.0, 0.0, 0.0),
                    ));
                let rotation = UnitQuaternion::from_euler_angles(tilt, turn, 0.0) * front;
                let pose = Isometry3::from_parts(Vector3::new(0.05, 0.0, 2.0).into(), rotation);
                let px = corner_points(&SIZE)
                    .map(|p| real.project(&(pose.rotation * p + pose.translation.vector)));
                let covariance = [Matrix2::identity() * 0.01; 4];
                landmark_pose(&Corners::new(px).unwrap(), &covariance, SIZE, stated).unwrap()
            })
            .collect()
    }

    #[test]
    fn a_camera_that_lies_is_calibrated_from_its_own_views() {
        let lens = Distortion::PlumbBob([-0.1, 0.0, 0.0, 0.0, 0.0]);
        let real = Intrinsics::new(600.0, 600.0, 330.0, 250.0, Distortion::None).unwrap();
        // The frames state a wrong focal length, and a lens that is not there.
        let stated = Intrinsics::new(640.0, 640.0, 319.5, 239.5, lens).unwrap();
        let (cameras, map) = (CameraRegistry::default(), MapSnapshot::empty("hall", 1));
        let poses = poses(&real, &stated);
        for pose in poses.iter().chain(&poses) {
            let landmarks = [(LandmarkId(1), pose)];
            let sample = CameraSample {
                intrinsics: &stated,
                image_px: [640, 480],
                landmarks: &landmarks,
                map: &map,
                extrinsics: None,
                fix: Err(NoFix::NoExtrinsics),
            };
            cameras.record_frame(&key("front"), &sample);
        }
        let shown = cameras.of_robot("r1");
        assert_eq!((shown.len(), shown[0].0.as_str(), shown[0].1.frames), (1, "front", 18));
        let (views, size) = cameras.views("r1", "front").unwrap();
        // A side gives one view; poses that may be flipped give none.
        assert!((5..=9).contains(&views.len()), "{}", views.len());
        assert_eq!(shown[0].1.views, views.len());
        let found = calibrate(&views, size.map(|s| s as usize), &CalibrateParams::default()).unwrap();
        assert!((found.camera.fx_px - 600.0).abs() < 1e-3 && (found.camera.cx_px - 330.0).abs() < 1e-3);
        assert!(cameras.of_robot("r2").is_empty() && cameras.views("r1", "rear").is_none());
    }

    #[test]
    fn a_change_of_intrinsics_restarts_the_monitor_and_keeps_the_views() {
        let real = Intrinsics::new(600.0, 600.0, 330.0, 250.0, Distortion::None).unwrap();
        let (cameras, map) = (CameraRegistry::default(), MapSnapshot::empty("hall", 1));
        let poses = poses(&real, &real);
        let frame_with = |k: &Intrinsics, width| {
            let landmarks = [(LandmarkId(1), &poses[0])];
            let (image_px, fix) = ([width, 480], Err(NoFix::GateReprojection));
            cameras.record_frame(
                &key("front"),
                &CameraSample {
                    intrinsics: k,
                    image_px,
                    landmarks: &landmarks,
                    map: &map,
                    extrinsics: None,
                    fix,
                },
            );
            let state = cameras.of_robot("r1").remove(0).1;
            (state.frames, state.monitor.refused, state.views)
        };
        assert_eq!(frame_with(&real, 640), (1, 1, 1));
        assert_eq!(frame_with(&real, 640), (2, 2, 1));
        assert_eq!(frame_with(&Intrinsics { fx_px: 601.0, ..real }, 640), (1, 1, 1));
        assert_eq!(frame_with(&real, 800), (1, 1, 1), "other images: everything anew");
    }
}
