//! The drive of a file. In: a recording of ours or a bag of ROS 2. Out: its scans, the drive with
//! the frames of one camera, and what of it was not used.

use crate::{
    failure::{Class, Failure},
    recording::{drive_args::DriveArgs, replay::unreadable},
    screen,
};
use anyhow::Context as _;
use client::protos::{
    Key, Name,
    convert::frame::CheckedFrame,
    convert::motion::{CheckedOdometry, CheckedScan},
};
use engine::survey::{Drive, DriveFrame, DriveReading, OF_FILE, ScanStamp};
use map::{laser::Scan, slam::MAX_SCANS};
use recordings::Body;
use std::{
    collections::{BTreeMap, BTreeSet},
    path::Path,
};

/// A drive with its scans.
#[derive(Debug, Clone, Default)]
pub struct DriveLog {
    /// Scans, those of the drive's stamps.
    pub scans: Vec<Scan>,
    /// The drive.
    pub drive: Drive,
}

/// A frame by its number through all drives.
pub(crate) fn frame_of(logs: &[DriveLog], number: usize) -> Option<&DriveFrame> {
    logs.iter().flat_map(|log| &log.drive.frames).nth(number)
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
    let (mut reading, mut scans) = (DriveReading::new(OF_FILE), Vec::new());
    let mut cameras = BTreeSet::new();
    let progress = screen::progress(0, "reading");
    while let Some(recorded) = drive.next_message().with_context(|| unreadable(path))? {
        progress.inc(1);
        match (recorded.key, recorded.body) {
            (Key::Scan(of), Body::Scan(scan)) if of == robot => match CheckedScan::try_from(scan) {
                Ok(CheckedScan { captured_ns, odom_from_robot: odom, scan, .. }) => {
                    reading.scan(ScanStamp { captured_ns, odom });
                    scans.push(scan);
                }
                Err(why) => reading.refused(&why),
            },
            (Key::Odometry(of), Body::Odometry(odometry)) if of == robot => {
                match CheckedOdometry::try_from(odometry) {
                    Ok(odometry) => reading.odometry(odometry.captured_ns, odometry.odom_from_robot),
                    Err(why) => reading.refused(&why),
                }
            }
            (Key::Frame(of, name), Body::Frame(frame)) if of == robot => {
                let is_wanted = camera.is_none_or(|camera| *camera == name);
                cameras.insert(name.clone());
                match CheckedFrame::try_from(frame) {
                    Ok(frame) if is_wanted => drop(reading.frame(&name, frame)),
                    Ok(_) => {}
                    Err(why) => reading.refused(&why),
                }
            }
            _ => {}
        }
        if scans.len() > MAX_SCANS {
            let sentence = format!("{} has more than {MAX_SCANS} scans.", path.display());
            let advice = "Cut it: `ros2 bag convert`, or `mcap filter --end-secs`.";
            return Err(Failure::new(Class::Refused, "too_many", sentence).advise(advice).into());
        }
    }
    progress.finish_and_clear();
    if camera.is_none() && cameras.len() > 1 {
        let all: Vec<&str> = cameras.iter().map(Name::as_str).collect();
        let sentence = format!("Which camera of {}? There are {}.", path.display(), all.join(", "));
        return Err(Failure::usage(sentence).advise("Name it with --camera.").into());
    }
    let (drive, problems) = reading.finished();
    if drive.scans.is_empty() || drive.frames.is_empty() {
        return Err(nothing(path, drive.scans.is_empty(), &problems).into());
    }
    Ok(FileDrive { log: DriveLog { scans, drive }, problems })
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

    #[test]
    fn a_file_without_frames_says_what_was_not_used() {
        let none = BTreeMap::from([("no_camera".to_owned(), (3, "a frame without intrinsics".to_owned()))]);
        let failure = nothing(Path::new("a.mcap"), false, &none);
        assert_eq!((failure.code.as_str(), failure.class), ("nothing_to_survey", Class::NotFound));
        assert!(failure.sentence.contains("no frames in a.mcap"), "{failure:?}");
        assert!(failure.advice.contains("mounting. 3 times a frame without intrinsics."), "{failure:?}");
        assert!(nothing(Path::new("a.mcap"), true, &BTreeMap::new()).advice.contains("scans and odometry."));
    }
}
