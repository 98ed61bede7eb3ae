//! What is known of robots' cameras from their frames: intrinsics as sent, a watch over them, and a few views of
//! landmarks from different sides, from which the camera can be calibrated again.
//!
//! In: frames with what was seen in them. Bounded; nothing is stored on disk.

use super::{slots::SlotKey, snapshot::MapSnapshot};
use crate::fixes::NoFix;
use map::{
    extrinsics::CameraExtrinsics,
    localise::{
        Fix, LandmarkObservation,
        intrinsics_monitor::{IntrinsicsMonitor, IntrinsicsMonitorState, focal_evidence},
    },
};
use nalgebra::{Matrix2, Point2, Vector3};
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

/// Cameras that are known at a time; a new one beyond is not watched.
pub const MAX_CAMERAS: usize = 4_096;
/// Views kept of one camera.
pub const MAX_KEPT: usize = 64;
/// Views kept of one landmark by one camera.
pub const MAX_KEPT_OF_LANDMARK: usize = 12;
/// A view is kept when the landmark's normal differs from that of every kept view by more than this.
const KEPT_STEP_RAD: f64 = 0.09;

/// A view of a landmark of known size.
#[derive(Debug, Clone)]
struct Kept {
    landmark: LandmarkId,
    normal: Vector3<f64>,
    view: PlanarView,
}

#[derive(Debug, Clone)]
struct Record {
    intrinsics: Intrinsics,
    image_px: [u32; 2],
    frames: u64,
    watch: IntrinsicsMonitor,
    kept: Vec<Kept>,
}

/// A camera as it is shown.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraState {
    /// As its frames say.
    pub intrinsics: Intrinsics,
    /// Of its frames.
    pub image_px: [u32; 2],
    /// Frames with these intrinsics in which something was recognised.
    pub frames: u64,
    /// What its residuals say.
    pub watch: IntrinsicsMonitorState,
    /// Views kept to calibrate from.
    pub views: usize,
}

/// All cameras.
#[derive(Debug, Default)]
pub struct CameraRegistry(Mutex<BTreeMap<SlotKey, Record>>);

/// What one frame showed.
#[derive(Debug, Clone, Copy)]
pub struct CameraSample<'a> {
    /// As the frame says.
    pub intrinsics: &'a Intrinsics,
    /// Of the frame.
    pub image_px: [u32; 2],
    /// Landmarks recognised without doubt, with their poses.
    pub seen: &'a [(LandmarkId, &'a LandmarkPose)],
    /// The map they hang in.
    pub map: &'a MapSnapshot,
    /// Where the camera sits.
    pub mounting: Option<&'a CameraExtrinsics>,
    /// The fix, or why there is none.
    pub fix: Result<&'a Fix, NoFix>,
}

impl CameraRegistry {
    /// Takes note of a frame in which landmarks were recognised.
    pub fn looked(&self, key: &SlotKey, look: &CameraSample<'_>) {
        if look.seen.is_empty() {
            return;
        }
        let evidence = look.fix.ok().and_then(|fix| {
            let sightings: Vec<LandmarkObservation<'_>> = look
                .seen
                .iter()
                .filter(|(id, _)| fix.landmarks.contains(id))
                .filter_map(|(id, seen)| {
                    let place = look.map.landmarks.get(id)?.place.as_ref()?;
                    Some(LandmarkObservation { landmark: *id, seen, place })
                })
                .collect();
            (!sightings.is_empty())
                .then(|| focal_evidence(&sightings, look.mounting?, &fix.pose.pose))
                .flatten()
        });
        let mut all = self.lock();
        if !all.contains_key(key) && all.len() >= MAX_CAMERAS {
            return;
        }
        let new = || Record {
            intrinsics: *look.intrinsics,
            image_px: look.image_px,
            frames: 0,
            watch: IntrinsicsMonitor::default(),
            kept: vec![],
        };
        let record = all.entry(key.clone()).or_insert_with(new);
        if record.image_px != look.image_px {
            *record = new();
        } else if record.intrinsics != *look.intrinsics {
            // Another calibration of the same camera: its views stay true, what was said of the old one does not.
            let kept = std::mem::take(&mut record.kept);
            *record = Record { kept, ..new() };
        }
        record.frames += 1;
        match look.fix {
            Ok(fix) => record.watch.add_fix(fix, evidence),
            Err(NoFix::GateReprojection | NoFix::GateInconsistent) => record.watch.add_refusal(),
            Err(_) => {}
        }
        for (id, seen) in look.seen {
            record.keep(*id, seen, look.intrinsics);
        }
    }

    /// The cameras of a robot, by name.
    pub fn of_robot(&self, robot: &str) -> Vec<(String, CameraState)> {
        let all = self.lock();
        let of = all.iter().filter(|(key, _)| key.robot.as_str() == robot);
        of.map(|(key, record)| (key.camera.to_string(), record.state())).collect()
    }

    /// The views kept of a camera and the size of its images.
    pub fn views(&self, robot: &str, camera: &str) -> Option<(Vec<PlanarView>, [u32; 2])> {
        let all = self.lock();
        let (_, record) =
            all.iter().find(|(key, _)| key.robot.as_str() == robot && key.camera.as_str() == camera)?;
        Some((record.kept.iter().map(|k| k.view.clone()).collect(), record.image_px))
    }

    fn lock(&self) -> MutexGuard<'_, BTreeMap<SlotKey, Record>> {
        // Single steps only: a panic elsewhere leaves nothing half changed.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Record {
    /// Keeps a view from a new side.
    fn keep(&mut self, landmark: LandmarkId, seen: &LandmarkPose, intrinsics: &Intrinsics) {
        let normal = seen.best.camera_from_landmark.rotation * Vector3::x();
        let own: Vec<&Kept> = self.kept.iter().filter(|k| k.landmark == landmark).collect();
        let new = own.iter().all(|k| k.normal.angle(&normal) > KEPT_STEP_RAD);
        if self.kept.len() >= MAX_KEPT || own.len() >= MAX_KEPT_OF_LANDMARK || !new || seen.ambiguous {
            return;
        }
        self.kept.push(Kept { landmark, normal, view: as_seen(seen, intrinsics) });
    }

    fn state(&self) -> CameraState {
        CameraState {
            intrinsics: self.intrinsics,
            image_px: self.image_px,
            frames: self.frames,
            watch: self.watch.state(),
            views: self.kept.len(),
        }
    }
}

/// The view with its lens: what calibration starts from must not rest on the calibration that is in doubt.
fn as_seen(seen: &LandmarkPose, k: &Intrinsics) -> PlanarView {
    let m = &seen.measured;
    let bent =
        |p: &Point2<f64>| k.project(&Vector3::new((p.x - k.cx_px) / k.fx_px, (p.y - k.cy_px) / k.fy_px, 1.0));
    let by = |p: &Point2<f64>, s: &Matrix2<f64>| {
        let back = k.undistort_with(&bent(p)).and_then(|(_, j)| j.try_inverse());
        back.map_or(*s, |j| j * s * j.transpose())
    };
    let corners = m.corners_px.points();
    PlanarView {
        plane_m: corner_points(&m.size).map(|p| Point2::new(p.y, p.z)).to_vec(),
        seen_px: corners.iter().map(bent).collect(),
        covariance_px2: corners.iter().zip(&m.covariance_px2).map(|(p, s)| by(p, s)).collect(),
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

    /// Poses of a landmark, as one camera sees it that claims to be another.
    fn poses(real: &Intrinsics, said: &Intrinsics) -> Vec<LandmarkPose> {
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
                landmark_pose(&Corners::new(px).unwrap(), &covariance, SIZE, said).unwrap()
            })
            .collect()
    }

    #[test]
    fn a_camera_that_lies_is_calibrated_from_its_own_views() {
        let lens = Distortion::PlumbBob([-0.1, 0.0, 0.0, 0.0, 0.0]);
        let real = Intrinsics::new(600.0, 600.0, 330.0, 250.0, Distortion::None).unwrap();
        // What frames claim: wrong focal length, and a lens that is not there.
        let said = Intrinsics::new(640.0, 640.0, 319.5, 239.5, lens).unwrap();
        let (cameras, map) = (CameraRegistry::default(), MapSnapshot::empty("hall", 1));
        let poses = poses(&real, &said);
        for pose in poses.iter().chain(&poses) {
            let seen = [(LandmarkId(1), pose)];
            let look = CameraSample {
                intrinsics: &said,
                image_px: [640, 480],
                seen: &seen,
                map: &map,
                mounting: None,
                fix: Err(NoFix::NoExtrinsics),
            };
            cameras.looked(&key("front"), &look);
        }
        let shown = cameras.of_robot("r1");
        assert_eq!((shown.len(), shown[0].0.as_str(), shown[0].1.frames), (1, "front", 18));
        let (views, size) = cameras.views("r1", "front").unwrap();
        // The same sides again are not kept twice; poses that may be flipped are not kept at all.
        assert!((5..=9).contains(&views.len()), "{}", views.len());
        assert_eq!(shown[0].1.views, views.len());
        let found = calibrate(&views, size.map(|s| s as usize), &CalibrateParams::default()).unwrap();
        assert!((found.camera.fx_px - 600.0).abs() < 1e-3 && (found.camera.cx_px - 330.0).abs() < 1e-3);
        assert!(cameras.of_robot("r2").is_empty() && cameras.views("r1", "rear").is_none());
    }

    #[test]
    fn a_change_of_intrinsics_begins_the_watch_anew_and_keeps_the_views() {
        let real = Intrinsics::new(600.0, 600.0, 330.0, 250.0, Distortion::None).unwrap();
        let (cameras, map) = (CameraRegistry::default(), MapSnapshot::empty("hall", 1));
        let poses = poses(&real, &real);
        let look_with = |k: &Intrinsics, width| {
            let seen = [(LandmarkId(1), &poses[0])];
            let (image_px, fix) = ([width, 480], Err(NoFix::GateReprojection));
            cameras.looked(
                &key("front"),
                &CameraSample { intrinsics: k, image_px, seen: &seen, map: &map, mounting: None, fix },
            );
            let state = cameras.of_robot("r1").remove(0).1;
            (state.frames, state.watch.refused, state.views)
        };
        assert_eq!(look_with(&real, 640), (1, 1, 1));
        assert_eq!(look_with(&real, 640), (2, 2, 1));
        assert_eq!(look_with(&Intrinsics { fx_px: 601.0, ..real }, 640), (1, 1, 1));
        assert_eq!(look_with(&real, 800), (1, 1, 1), "other images: everything anew");
    }
}
