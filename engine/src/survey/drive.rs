//! A drive as a survey takes it: the odometry of its scans, and the frames of one camera between
//! which it has moved. In: scans, odometry and frames as they come. Out: the drive, and what of it
//! was not used.

use map::pose2::{Pose2, wrap_rad};
use protos::{CheckedFrame, Name, Rejection, convert::frame::Pixels};
use std::collections::BTreeMap;
use vision::frame::Intrinsics;

/// Most frames of a survey, and most bytes of their images.
pub const OF_FILE: DriveBounds = DriveBounds { frames: 20_000, image_bytes: 1 << 30 };
/// The same of a survey while it drives: some 110 m with pictures of 50 kB.
pub const WHILE_DRIVING: DriveBounds = DriveBounds { frames: 4096, image_bytes: 56 << 20 };
/// A frame counts after this motion of the camera: metres and radians.
const MOVED_M: f64 = 0.1;
const TURNED_RAD: f64 = 0.05;
/// Odometry farther from a frame in time is not that of the frame, ns.
const NEAR_NS: i64 = 500_000_000;

/// When a scan was captured, and where by odometry.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ScanStamp {
    /// Capture time, ns.
    pub captured_ns: i64,
    /// Odometry of that time.
    pub odom: Pose2,
}

/// A frame with its odometry. It has intrinsics and a mounting.
#[derive(Debug, Clone)]
pub struct DriveFrame {
    /// Odometry at capture.
    pub odom: Pose2,
    /// The frame.
    pub frame: CheckedFrame,
}

/// A drive.
#[derive(Debug, Clone, Default)]
pub struct Drive {
    /// Scans, in the order in which they were mapped.
    pub scans: Vec<ScanStamp>,
    /// Frames of one camera, in the order of time.
    pub frames: Vec<DriveFrame>,
}

/// Bounds of a drive.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DriveBounds {
    /// Most frames.
    pub frames: usize,
    /// Most bytes of their images.
    pub image_bytes: usize,
}

/// A drive that is being read.
#[derive(Debug)]
pub struct DriveReading {
    most: DriveBounds,
    /// Of the first frame.
    camera: Option<(Name, Intrinsics)>,
    scans: Vec<ScanStamp>,
    frames: Vec<CheckedFrame>,
    image_bytes: usize,
    /// By capture time.
    odometry: BTreeMap<i64, Pose2>,
    problems: BTreeMap<String, (u64, String)>,
}

impl DriveReading {
    /// Nothing is read yet.
    pub fn new(most: DriveBounds) -> Self {
        let (camera, scans, frames, odometry, problems) = Default::default();
        Self { most, camera, scans, frames, image_bytes: 0, odometry, problems }
    }

    /// A message that is not used.
    pub fn refused(&mut self, why: &Rejection) {
        self.problem(why.code.as_str(), || format!("{}: {}", why.field, why.detail));
    }

    fn problem(&mut self, word: &str, first: impl FnOnce() -> String) {
        self.problems.entry(word.to_owned()).or_insert_with(|| (0, first())).0 += 1;
    }

    /// A scan that was mapped.
    pub fn scan(&mut self, stamp: ScanStamp) {
        self.odometry.insert(stamp.captured_ns, stamp.odom);
        self.scans.push(stamp);
    }

    /// Odometry without a scan.
    pub fn odometry(&mut self, captured_ns: i64, odom: Pose2) {
        self.odometry.insert(captured_ns, odom);
    }

    /// A frame. It is left out if its camera has not moved; and counted besides if it has no
    /// intrinsics or mounting, is no whole image, of another camera or calibration than the first,
    /// or beyond a bound. Whether it is kept.
    pub fn frame(&mut self, camera: &Name, frame: CheckedFrame) -> bool {
        let Pixels::Image(image) = &frame.pixels else {
            self.problem("no_image", || "quads without their image".into());
            return false;
        };
        // How well they are known may be stated later.
        let stated = frame.intrinsics.map(|camera| Intrinsics { sigmas: None, ..camera });
        let Some(intrinsics) = stated.filter(|_| frame.mounting.is_some()) else {
            self.problem("no_camera", || {
                "a frame without intrinsics or without the camera's mounting".into()
            });
            return false;
        };
        if let Some((first, known)) = self.camera.clone().filter(|of| *of != (camera.clone(), intrinsics)) {
            let other = known != intrinsics && first == *camera;
            let what = if other { "with other intrinsics than the first" } else { "of another camera" };
            self.problem("another_camera", || format!("a frame {what}; only `{first}` is used, as it began"));
            return false;
        }
        if !self.has_moved(&frame) {
            return false;
        }
        let bytes = self.image_bytes + image.bytes.len();
        let DriveBounds { frames, image_bytes } = self.most;
        if self.frames.len() >= frames || bytes > image_bytes {
            let most = image_bytes >> 20;
            self.problem("too_many", || format!("more than {frames} frames or {most} MiB of images"));
            return false;
        }
        self.image_bytes = bytes;
        self.camera = Some((camera.clone(), intrinsics));
        self.frames.push(frame);
        true
    }

    /// Frames that were kept.
    pub fn frames(&self) -> usize {
        self.frames.len()
    }

    /// What was not used so far: how often, and the first in words.
    pub fn problems(&self) -> &BTreeMap<String, (u64, String)> {
        &self.problems
    }

    /// Since the last frame, by the odometry that has come; a frame with none waits for its own.
    fn has_moved(&self, frame: &CheckedFrame) -> bool {
        let odom_at = |ns| self.odometry.range(..=ns).next_back().map(|(_, odom)| *odom);
        let Some(last) = self.frames.last() else { return true };
        let (then, now) = (odom_at(last.captured_ns), odom_at(frame.captured_ns));
        let moved = then.zip(now).is_none_or(|(then, now)| {
            let motion = then.between(&now);
            motion.position().norm() >= MOVED_M || motion.theta_rad.abs() >= TURNED_RAD
        });
        let mounted = |frame: &CheckedFrame| frame.mounting.as_ref().map(|m| m.robot_from_camera.rotation);
        let turned = mounted(last).zip(mounted(frame)).is_some_and(|(a, b)| a.angle_to(&b) >= TURNED_RAD);
        moved || turned
    }

    /// The drive, and what was not used: how often, and the first in words.
    pub fn finished(mut self) -> (Drive, BTreeMap<String, (u64, String)>) {
        self.frames.sort_by_key(|frame| frame.captured_ns);
        self.frames.dedup_by_key(|frame| frame.captured_ns);
        let mut frames = Vec::new();
        for frame in std::mem::take(&mut self.frames) {
            match frame.odometry.or_else(|| odometry_at(&self.odometry, frame.captured_ns)) {
                Some(odom) => frames.push(DriveFrame { odom, frame }),
                None => self.problem("no_odometry", || "a frame without odometry of its time".into()),
            }
        }
        (Drive { scans: self.scans, frames }, self.problems)
    }
}

/// Odometry between that before and that after.
fn odometry_at(all: &BTreeMap<i64, Pose2>, at_ns: i64) -> Option<Pose2> {
    let near = |ns: i64| (ns - at_ns).abs() <= NEAR_NS;
    let before = all.range(..=at_ns).next_back().filter(|(ns, _)| near(**ns));
    let after = all.range(at_ns..).next().filter(|(ns, _)| near(**ns));
    let ((a_ns, a), (b_ns, b)) = before.zip(after)?;
    if b_ns == a_ns {
        return Some(*a);
    }
    let share = (at_ns - a_ns) as f64 / (b_ns - a_ns) as f64;
    let motion = a.between(b);
    Some(a.compose(&Pose2::new(motion.x_m * share, motion.y_m * share, wrap_rad(motion.theta_rad) * share)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use map::extrinsics::CameraExtrinsics;
    use nalgebra::Isometry3;
    use protos::convert::frame::{EncodedImage, Encoding};
    use vision::frame::Distortion;

    fn front() -> Name {
        Name::new("front").unwrap()
    }

    fn frame(captured_ns: i64) -> CheckedFrame {
        CheckedFrame {
            epoch: 1,
            seq: 1,
            captured_ns,
            width_px: 640,
            height_px: 480,
            pixels: Pixels::Image(EncodedImage { encoding: Encoding::Jpeg, bytes: vec![0; 10].into() }),
            intrinsics: Some(Intrinsics::new(500.0, 500.0, 320.0, 240.0, Distortion::None).unwrap()),
            mounting: Some(CameraExtrinsics::new(Isometry3::identity()).unwrap()),
            odometry: None,
            prior: None,
            deadline_ms: None,
            map: None,
        }
    }

    #[test]
    fn frames_count_after_a_motion_and_with_a_camera() {
        let mut reading = DriveReading::new(OF_FILE);
        let taken: Vec<bool> = [0.0, 0.05, 0.11, 0.15, 0.22]
            .into_iter()
            .enumerate()
            .map(|(i, x_m)| {
                let at_ns = i as i64 * 100_000_000;
                reading.odometry(at_ns, Pose2::new(x_m, 0.0, 0.0));
                reading.frame(&front(), frame(at_ns))
            })
            .collect();
        assert_eq!(taken, [true, false, true, false, true]);
        assert!(!reading.frame(&front(), CheckedFrame { mounting: None, ..frame(500_000_000) }));
        // Two seconds after the last odometry.
        reading.odometry(2_000_000_000, Pose2::new(9.0, 0.0, 0.0));
        assert!(reading.frame(&front(), frame(4_000_000_000)));
        let (drive, problems) = reading.finished();
        assert_eq!(drive.frames.len(), 3);
        assert!((drive.frames[1].odom.x_m - 0.11).abs() < 1e-9);
        assert_eq!((problems["no_camera"].0, problems["no_odometry"].0), (1, 1));
    }

    #[test]
    fn only_the_first_camera_counts_as_it_began() {
        let mut reading = DriveReading::new(OF_FILE);
        assert!(reading.frame(&front(), frame(0)));
        assert!(!reading.frame(&Name::new("back").unwrap(), frame(1)));
        let zoomed = Intrinsics { fx_px: 700.0, ..frame(2).intrinsics.unwrap() };
        assert!(!reading.frame(&front(), CheckedFrame { intrinsics: Some(zoomed), ..frame(2) }));
        assert!(reading.frame(&front(), frame(3)), "without odometry each frame counts");
        let (count, first) = &reading.problems()["another_camera"];
        assert!(*count == 2 && first.contains("of another camera; only `front`"), "{first}");
    }

    #[test]
    fn a_drive_is_bounded() {
        for most in [DriveBounds { frames: 9, image_bytes: 20 }, DriveBounds { frames: 2, image_bytes: 99 }] {
            let mut reading = DriveReading::new(most);
            let taken = [0, 1, 2].map(|at_ns| reading.frame(&front(), frame(at_ns)));
            assert_eq!((taken, reading.problems()["too_many"].0), ([true, true, false], 1));
        }
    }

    #[test]
    fn odometry_is_interpolated_and_not_taken_from_far() {
        let all = BTreeMap::from([
            (0, Pose2::new(1.0, 0.0, 0.0)),
            (100_000_000, Pose2::new(2.0, 0.0, 0.2)),
            (900_000_000, Pose2::new(3.0, 0.0, 0.2)),
        ]);
        let at = odometry_at(&all, 25_000_000).unwrap();
        assert!((at.x_m - 1.25).abs() < 1e-9 && (at.theta_rad - 0.05).abs() < 1e-9, "{at:?}");
        assert_eq!(odometry_at(&all, 100_000_000), Some(Pose2::new(2.0, 0.0, 0.2)));
        assert_eq!(odometry_at(&all, 300_000_000), None, "600 ms before the next");
        assert_eq!(odometry_at(&all, 950_000_000), None, "nothing after");
    }
}
