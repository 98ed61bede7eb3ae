//! A drive as a survey reads it: scans, and the frames of one camera, each with odometry. In: a
//! recording of ours or a bag of ROS 2. Out: the drive, and what of it was not used.

use crate::{
    failure::{Class, Failure},
    recording::{drive_args::DriveArgs, replay::unreadable},
    screen,
};
use anyhow::Context as _;
use client::protos::{
    Key, Name, Rejection,
    convert::frame::{CheckedFrame, Pixels},
    convert::motion::{CheckedOdometry, CheckedScan},
};
use map::{
    laser::Scan,
    pose2::{Pose2, wrap_rad},
    slam::MAX_SCANS,
};
use recordings::Body;
use std::{
    collections::{BTreeMap, BTreeSet},
    path::Path,
};

/// Most frames of a survey, and most bytes of their images.
const MAX_FRAMES: usize = 20_000;
const MAX_IMAGE_BYTES: usize = 1 << 30;
/// A frame counts after this motion of the camera: metres and radians.
const MOVED_M: f64 = 0.1;
const TURNED_RAD: f64 = 0.05;
/// Odometry farther from a frame in time is not that of the frame, ns.
const NEAR_NS: i64 = 500_000_000;

/// A scan with its odometry.
#[derive(Debug, Clone)]
pub struct LoggedScan {
    /// Capture time, ns.
    pub captured_ns: i64,
    /// Odometry of that time.
    pub odom: Pose2,
    /// The scan.
    pub scan: Scan,
}

/// A frame with its odometry. It has intrinsics and a mounting.
#[derive(Debug, Clone)]
pub struct LoggedFrame {
    /// Odometry at capture.
    pub odom: Pose2,
    /// The frame.
    pub frame: CheckedFrame,
}

/// A drive.
#[derive(Debug, Clone, Default)]
pub struct DriveLog {
    /// Where the drive begins in the frame of the map.
    pub origin: Pose2,
    /// Scans, in the order of time.
    pub scans: Vec<LoggedScan>,
    /// Frames of one camera between which it has moved, in the order of time.
    pub frames: Vec<LoggedFrame>,
}

/// A drive of a file.
pub(super) struct FileDrive {
    pub(super) log: DriveLog,
    /// What was not used: how often, and the first in words.
    pub(super) problems: BTreeMap<String, (u64, String)>,
}

/// Reads the drive of a robot, and the frames of `camera`, or of the only one.
pub(super) fn read(path: &Path, drives: &DriveArgs, camera: Option<&Name>) -> anyhow::Result<FileDrive> {
    let (robot, mut drive) = drives.open(path)?;
    let mut made = Reading { camera: camera.cloned(), ..Reading::default() };
    let progress = screen::progress(0, "reading");
    while let Some(recorded) = drive.next_message().with_context(|| unreadable(path))? {
        progress.inc(1);
        match (recorded.key, recorded.body) {
            (Key::Scan(of), Body::Scan(scan)) if of == robot => made.scan(CheckedScan::try_from(scan)),
            (Key::Odometry(of), Body::Odometry(odometry)) if of == robot => {
                made.odometry(CheckedOdometry::try_from(odometry));
            }
            (Key::Frame(of, camera), Body::Frame(frame)) if of == robot => {
                made.frame(&camera, CheckedFrame::try_from(frame));
            }
            _ => {}
        }
        made.check_bounds(path)?;
    }
    progress.finish_and_clear();
    made.finished(path)
}

/// What was read so far.
#[derive(Debug, Default)]
struct Reading {
    camera: Option<Name>,
    cameras: BTreeSet<Name>,
    scans: Vec<LoggedScan>,
    frames: Vec<CheckedFrame>,
    image_bytes: usize,
    /// By capture time.
    odometry: BTreeMap<i64, Pose2>,
    problems: BTreeMap<String, (u64, String)>,
}

impl Reading {
    fn refused(&mut self, why: &Rejection) {
        self.problem(why.code.as_str(), || format!("{}: {}", why.field, why.detail));
    }

    fn problem(&mut self, word: &str, first: impl FnOnce() -> String) {
        self.problems.entry(word.to_owned()).or_insert_with(|| (0, first())).0 += 1;
    }

    fn scan(&mut self, scan: Result<CheckedScan, Rejection>) {
        match scan {
            Ok(CheckedScan { captured_ns, odom_from_robot: odom, scan, .. }) => {
                self.odometry.insert(captured_ns, odom);
                self.scans.push(LoggedScan { captured_ns, odom, scan });
            }
            Err(why) => self.refused(&why),
        }
    }

    fn odometry(&mut self, odometry: Result<CheckedOdometry, Rejection>) {
        match odometry {
            Ok(odometry) => drop(self.odometry.insert(odometry.captured_ns, odometry.odom_from_robot)),
            Err(why) => self.refused(&why),
        }
    }

    fn frame(&mut self, camera: &Name, frame: Result<CheckedFrame, Rejection>) {
        self.cameras.insert(camera.clone());
        if self.camera.as_ref().is_some_and(|named| named != camera) {
            return;
        }
        match frame {
            Err(why) => self.refused(&why),
            Ok(frame) if frame.intrinsics.is_none() || frame.mounting.is_none() => {
                self.problem("no_camera", || {
                    "a frame without intrinsics or without the camera's mounting".into()
                });
            }
            Ok(frame) if self.has_moved(&frame) => {
                self.image_bytes += image_bytes(&frame);
                self.frames.push(frame);
            }
            Ok(_) => {}
        }
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

    fn check_bounds(&self, path: &Path) -> Result<(), Failure> {
        let too_many = |what: String| {
            let sentence = format!("{} has more than {what}.", path.display());
            let advice = "Cut it: `ros2 bag convert`, or `mcap filter --end-secs`.";
            Err(Failure::new(Class::Refused, "too_many", sentence).advise(advice))
        };
        if self.scans.len() > MAX_SCANS || self.odometry.len() > 8 * MAX_SCANS {
            return too_many(format!("{MAX_SCANS} scans"));
        }
        if self.frames.len() > MAX_FRAMES || self.image_bytes > MAX_IMAGE_BYTES {
            return too_many(format!("{MAX_FRAMES} frames or {} MiB of images", MAX_IMAGE_BYTES >> 20));
        }
        Ok(())
    }

    fn finished(mut self, path: &Path) -> anyhow::Result<FileDrive> {
        if self.camera.is_none() && self.cameras.len() > 1 {
            let all: Vec<&str> = self.cameras.iter().map(Name::as_str).collect();
            let sentence = format!("Which camera of {}? There are {}.", path.display(), all.join(", "));
            return Err(Failure::usage(sentence).advise("Name it with --camera.").into());
        }
        self.scans.sort_by_key(|scan| scan.captured_ns);
        self.frames.sort_by_key(|frame| frame.captured_ns);
        self.scans.dedup_by_key(|scan| scan.captured_ns);
        self.frames.dedup_by_key(|frame| frame.captured_ns);
        let mut frames = Vec::new();
        for frame in std::mem::take(&mut self.frames) {
            match frame.odometry.or_else(|| odometry_at(&self.odometry, frame.captured_ns)) {
                Some(odom) => frames.push(LoggedFrame { odom, frame }),
                None => self.problem("no_odometry", || "a frame without odometry of its time".into()),
            }
        }
        if self.scans.is_empty() || frames.is_empty() {
            return Err(nothing(path, self.scans.is_empty(), &self.problems).into());
        }
        Ok(FileDrive {
            log: DriveLog { scans: self.scans, frames, ..DriveLog::default() },
            problems: self.problems,
        })
    }
}

fn image_bytes(frame: &CheckedFrame) -> usize {
    match &frame.pixels {
        Pixels::Image(image) => image.bytes.len(),
        Pixels::Quads(_) => 0,
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

fn nothing(path: &Path, no_scans: bool, problems: &BTreeMap<String, (u64, String)>) -> Failure {
    let (what, advice) = if no_scans {
        ("laser scans", "A survey needs a robot that sends scans and odometry.")
    } else {
        ("frames", "A survey needs frames with intrinsics and the camera's mounting.")
    };
    let sentence = format!("There are no {what} in {} that can be used.", path.display());
    let reasons: Vec<String> =
        problems.values().map(|(count, first)| format!("{count} times {first}")).collect();
    let advice =
        if reasons.is_empty() { advice.to_owned() } else { format!("{advice} {}.", reasons.join("; ")) };
    Failure::new(Class::NotFound, "nothing_to_survey", sentence).advise(advice)
}

#[cfg(test)]
mod tests {
    use super::*;
    use client::protos::convert::frame::{EncodedImage, Encoding};
    use map::extrinsics::CameraExtrinsics;
    use nalgebra::Isometry3;
    use vision::frame::{Distortion, Intrinsics};

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

    fn moved(reading: &mut Reading, captured_ns: i64, x_m: f64) {
        let odom_from_robot = Pose2::new(x_m, 0.0, 0.0);
        reading.odometry(Ok(CheckedOdometry { epoch: 1, seq: 1, captured_ns, odom_from_robot }));
    }

    #[test]
    fn frames_count_after_a_motion_and_are_of_one_camera() {
        let (front, back) = (Name::new("front").unwrap(), Name::new("back").unwrap());
        let mut reading = Reading::default();
        for (i, x_m) in [0.0, 0.05, 0.11, 0.15, 0.22].into_iter().enumerate() {
            let at_ns = i as i64 * 100_000_000;
            moved(&mut reading, at_ns, x_m);
            reading.frame(&front, Ok(frame(at_ns)));
        }
        assert_eq!(reading.frames.iter().map(|f| f.captured_ns / 100_000_000).collect::<Vec<_>>(), [0, 2, 4]);
        // A frame that has no camera is named.
        reading.frame(&front, Ok(CheckedFrame { mounting: None, ..frame(500_000_000) }));
        assert_eq!(reading.problems["no_camera"].0, 1);
        reading.frame(&back, Ok(frame(600_000_000)));
        let which = Failure::of(&reading.finished(Path::new("a.mcap")).err().unwrap());
        assert!(which.sentence.contains("back, front") && which.advice.contains("--camera"), "{which:?}");
        let mut named = Reading { camera: Some(front), ..Reading::default() };
        named.frame(&back, Ok(frame(0)));
        let none = Failure::of(&named.finished(Path::new("a.mcap")).err().unwrap());
        assert_eq!((none.code.as_str(), none.class), ("nothing_to_survey", Class::NotFound));
    }

    #[test]
    fn a_drive_is_bounded() {
        let mut reading = Reading::default();
        reading.image_bytes = MAX_IMAGE_BYTES;
        assert!(reading.check_bounds(Path::new("a.mcap")).is_ok());
        reading.image_bytes += 1;
        assert_eq!(reading.check_bounds(Path::new("a.mcap")).unwrap_err().code, "too_many");
        let mut reading = Reading::default();
        reading.frames = vec![frame(0); MAX_FRAMES];
        assert!(reading.check_bounds(Path::new("a.mcap")).is_ok());
        reading.frames.push(frame(0));
        assert_eq!(reading.check_bounds(Path::new("a.mcap")).unwrap_err().code, "too_many");
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
