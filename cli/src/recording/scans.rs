//! Laser scans of a file of messages. In: a recording of ours, or a bag of ROS 2, and which robot
//! or topics. Out: a scan log, as walls are built from.

use super::{
    bag_args::MotionArgs,
    replay::{open_messages, recorded_robot, robot_of, unreadable},
};
use crate::{
    failure::{Class, Failure},
    screen,
};
use anyhow::Context as _;
use client::protos::{Name, convert::motion::CheckedScan};
use formats::scan_log::{LogEntry, ScanLog};
use map::slam::MAX_SCANS;
use recordings::{BagRobot, Body, DriveReader, bag, read::ChannelInfo};
use std::{
    collections::{BTreeMap, BTreeSet},
    fs::File,
    io::Read as _,
    path::Path,
    sync::Arc,
};

/// First bytes of every MCAP file, plain or packed, of bags in SQLite and of ROS 1: files that are
/// no scan log of text.
const MESSAGE_FILES: [&[u8]; 4] = [b"\x89MCAP", b"\x28\xb5\x2f\xfd", b"SQLite format 3\0", b"#ROSBAG V"];
/// Why messages of other topics are not used: walls need none of them.
const OTHER_MESSAGES: [&str; 2] = ["not_used", "unknown_type"];
/// The robot of a bag: nobody sees its name.
const BAG_ROBOT: &str = "bag";

/// Which messages of a file of messages are the robot's.
#[derive(Debug, Clone, Default, clap::Args)]
pub(crate) struct ScanArgs {
    /// The robot of a recording of Waymark whose scans are used, if there are several.
    #[arg(long, value_name = "NAME")]
    pub(crate) recorded: Option<Name>,
    #[command(flatten)]
    pub(crate) motion: MotionArgs,
}

/// The scans of a file, and why others were not used.
#[derive(Debug)]
pub(crate) struct FileScans {
    pub(crate) log: ScanLog,
    /// Where the file ends inside a record.
    pub(crate) cut_off_at: Option<u64>,
    /// What was not used: how often, and the first in words.
    pub(crate) problems: BTreeMap<String, (u64, String)>,
}

/// Whether a file, or the folder of a bag, holds messages, and no scan log of text.
pub(crate) fn has_messages(path: &Path) -> bool {
    let mut head = [0; 16];
    let read = File::open(path).and_then(|mut file| file.read(&mut head)).unwrap_or(0);
    path.is_dir() || MESSAGE_FILES.iter().any(|form| head[..read].starts_with(form))
}

/// Reads the scans of a file of messages. Errors: no file of messages; no scans in it, with the
/// topics that there are; none that can be used, with the first reason.
pub(crate) fn scans(path: &Path, args: &ScanArgs) -> anyhow::Result<FileScans> {
    let (messages, channels) = open_messages(path)?;
    let is_bag = bag::is_bag(channels.iter().map(AsRef::as_ref));
    let (robot, bag) = if is_bag {
        check_topic(path, args, &channels)?;
        let robot = Name::new(BAG_ROBOT)?;
        let settings = args.motion.settings(&channels, Vec::new());
        (robot.clone(), Some(BagRobot::new(robot, settings)?))
    } else {
        let names: BTreeSet<&str> = channels.iter().filter_map(|channel| robot_of(channel)).collect();
        (recorded_robot(args.recorded.as_ref(), &names, path)?, None)
    };
    let mut drive = DriveReader::open_bag(messages, bag).with_context(|| unreadable(path))?;
    let mut problems = BTreeMap::<String, (u64, String)>::new();
    let mut log = ScanLog::default();
    let progress = screen::progress(0, "reading");
    while let Some(recorded) = drive.next_message().with_context(|| unreadable(path))? {
        progress.inc(1);
        let (client::protos::Key::Scan(of), Body::Scan(scan)) = (recorded.key, recorded.body) else {
            continue;
        };
        if of != robot {
            continue;
        }
        let time_s = Some(scan.captured_ns as f64 * 1e-9);
        match CheckedScan::try_from(scan) {
            Ok(CheckedScan { odom_from_robot: odom, scan, .. }) => {
                if log.records.len() == MAX_SCANS {
                    let sentence = format!("{} has more than {MAX_SCANS} scans.", path.display());
                    let advice = "Cut it: `ros2 bag convert`, or `mcap filter --end-secs`.";
                    return Err(Failure::new(Class::Refused, "too_many", sentence).advise(advice).into());
                }
                log.records.push(LogEntry { odom, truth: None, time_s, scan });
            }
            Err(why) => {
                let first = || (0, format!("{}: {}", why.field, why.detail));
                problems.entry(why.code.as_str().to_owned()).or_insert_with(first).0 += 1;
            }
        }
    }
    progress.finish_and_clear();
    if let Some(bag) = drive.bag() {
        let of_scans = bag.problems().filter(|(word, ..)| !OTHER_MESSAGES.contains(word));
        problems.extend(of_scans.map(|(word, count, first)| (word.to_owned(), (count, first.to_owned()))));
    }
    if log.records.is_empty() {
        return Err(no_scans(path, &robot, is_bag, &problems).into());
    }
    Ok(FileScans { log, cut_off_at: drive.cut_off_at(), problems })
}

/// That the topic of scans is in the bag, and has scans.
fn check_topic(path: &Path, args: &ScanArgs, channels: &[Arc<ChannelInfo>]) -> Result<(), Failure> {
    const SCAN: &str = "sensor_msgs/msg/LaserScan";
    let topic = args.motion.scan.as_deref().unwrap_or("/scan");
    let kind = channels.iter().find(|channel| channel.topic == topic).map(|channel| channel.schema.as_str());
    if kind == Some(SCAN) {
        return Ok(());
    }
    let sentence = match kind {
        Some(other) => format!("{topic} of {} has messages of {other}, not {SCAN}.", path.display()),
        None => format!("There is no topic {topic} in {}.", path.display()),
    };
    let lasers: Vec<&str> =
        channels.iter().filter(|c| c.schema == SCAN).map(|channel| channel.topic.as_str()).collect();
    let advice = if lasers.is_empty() {
        let all: BTreeSet<String> =
            channels.iter().map(|channel| format!("{} ({})", channel.topic, channel.schema)).collect();
        let all: Vec<String> = all.into_iter().collect();
        format!("Walls need laser scans, and no topic has them. There are: {}.", all.join(", "))
    } else {
        format!("Name the laser with --scan. Laser scans are on: {}.", lasers.join(", "))
    };
    Err(Failure::new(Class::NotFound, "no_scans", sentence).advise(advice))
}

fn no_scans(path: &Path, robot: &Name, is_bag: bool, problems: &BTreeMap<String, (u64, String)>) -> Failure {
    let whose = if is_bag { String::new() } else { format!(" of robot {robot}") };
    if let Some((count, first)) = problems.values().max_by_key(|(count, _)| *count) {
        let sentence = format!("No scan{whose} in {} can be used: {count} times {first}.", path.display());
        let advice = if is_bag {
            "Scans need odometry of their time: --odometry, --base-frame and --odom-frame name topic and frames."
        } else {
            ""
        };
        return Failure::new(Class::Refused, "no_scans", sentence).advise(advice);
    }
    let sentence = format!("There are no laser scans{whose} in {}.", path.display());
    Failure::new(Class::NotFound, "no_scans", sentence)
        .advise("Walls need the scans of a laser: record a robot that sends them.")
}
