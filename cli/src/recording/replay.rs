//! `waymark replay`: plays a recording or a bag of ROS 2 into a server, as a robot, and compares
//! the answers.

use super::{
    Endpoints, PROGRAM,
    bag_args::MotionArgs,
    new_file,
    playable::playable,
    player::{Counts, Player, PlayerOptions},
    poses::PosesFile,
    report::{ReplayReport, table},
};
use crate::{
    failure::{Class, Failure},
    robot::inputs,
    session::Session,
};
use anyhow::Context as _;
use client::{
    api::{RobotActivity, RobotInput},
    protos::Name,
};
use recordings::{
    BagRobot, Body, DriveReader, DriveWriter, bag,
    compare::Play,
    read::{ChannelInfo, MessageReader},
};
use ros2::robot::{CameraSettings, ImageForm, RobotSettings};
use std::{
    collections::BTreeSet,
    fs::File,
    io::{BufReader, BufWriter},
    path::{Path, PathBuf},
    process::ExitCode,
    sync::Arc,
    time::{Duration, Instant},
};

/// Longest wait until the server has seen what was sent.
const SETTLED: Duration = Duration::from_secs(2);
/// First bytes of a message that rosbag2 packed with `compression_mode: message`. A message of ROS
/// begins with 0.
const ZSTD: &[u8] = b"\x28\xb5\x2f\xfd";

/// `waymark replay`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// A recording, or a bag of ROS 2 with MCAP storage (the .mcap file in its folder).
    file: PathBuf,
    /// Name of the robot at the server [default: that of the recording].
    #[arg(long, value_name = "NAME")]
    robot: Option<Name>,
    /// The robot of the recording that is played, if there are several.
    #[arg(long, value_name = "NAME")]
    recorded: Option<Name>,
    /// Register the robot on this map first, and recognise all frames against it.
    #[arg(long, value_name = "MAP")]
    map: Option<Name>,
    /// No faster than so many times as it was recorded [default: as fast as the server answers].
    #[arg(long, value_name = "FACTOR", value_parser = speed)]
    speed: Option<f64>,
    /// Write the new answers to this file; it must not exist.
    #[arg(long, value_name = "OUT")]
    answers: Option<PathBuf>,
    /// Write the fused poses to this file, which must not exist, as lines of the TUM benchmark:
    /// stamp x y z qx qy qz qw. Stamps are those of the recording in seconds, positions metres in
    /// the frame of the map (z is 0), and the quaternion is map from robot. Fused poses depend on
    /// the speed: `--speed 1` plays as it was recorded.
    #[arg(long, value_name = "OUT")]
    poses: Option<PathBuf>,
    /// Compare the answers with those of the recording, or of another file; exit status 1 if they
    /// differ.
    #[arg(long, value_name = "OTHER", num_args = 0..=1)]
    #[allow(clippy::option_option, reason = "clap's form of an option with an optional value")]
    compare: Option<Option<PathBuf>>,
    #[command(flatten)]
    bag: BagArgs,
    #[command(flatten)]
    endpoints: Endpoints,
}

/// Topics and frames of a bag, where they have other names than usual.
#[derive(Debug, Clone, Default, clap::Args)]
#[command(next_help_heading = "Bags of ROS 2")]
pub(super) struct BagArgs {
    /// A topic of images, as `NAME=TOPIC` with the camera's name; may be given several times
    /// [default: all of the bag].
    #[arg(long, value_name = "NAME=TOPIC")]
    image: Vec<String>,
    #[command(flatten)]
    motion: MotionArgs,
}

fn speed(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(factor) if (0.01..=100.0).contains(&factor) => Ok(factor),
        _ => Err("a number from 0.01 to 100".to_owned()),
    }
}

/// Plays a file.
pub(crate) async fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let session = args.endpoints.server.session()?;
    let done = replay(&session, args).await;
    session.explained(done).await
}

async fn replay(session: &Session, args: &Args) -> anyhow::Result<ExitCode> {
    let (robot, recorded, bag) = tokio::task::block_in_place(|| robots(args))?;
    if let Some(map) = &args.map {
        session.maps().put_robot(robot.as_str(), map.as_str()).await?;
    }
    let before = match &args.compare {
        Some(Some(other)) => Some(tokio::task::block_in_place(|| play_of(other, &recorded))?),
        _ => None,
    };
    let answers = args.answers.as_deref().map(|path| {
        let file = BufWriter::new(new_file(path)?);
        Ok::<_, anyhow::Error>(DriveWriter::create(file, &args.endpoints.fleet, PROGRAM)?)
    });
    let poses = args.poses.as_deref().map(PosesFile::create).transpose()?;
    let options = PlayerOptions {
        zenoh: args.endpoints.zenoh.clone(),
        fleet: args.endpoints.fleet.clone(),
        robot: robot.clone(),
        recorded,
        speed: args.speed,
        is_map_given: args.map.is_some(),
    };
    let drive = DriveReader::open_bag(opened(&args.file)?, bag).with_context(|| unreadable(&args.file))?;
    let earlier = activity(session, &robot).await;
    let player = Player::connect(options, answers.transpose()?, poses).await?;
    let played = player.play(drive).await.with_context(|| unreadable(&args.file))?;
    if played.counts.sent() == 0 {
        return Err(nothing_played(&args.file, &played.counts).into());
    }
    let inputs =
        inputs_used(session, &robot, earlier.as_ref(), played.counts.odometry + played.counts.scans).await;
    let before = before.or_else(|| args.compare.is_some().then_some(played.before));
    let comparison = before.map(|before| before.compare(&played.now));
    if comparison.as_ref().is_some_and(|c| c.frames == 0) {
        let other = args.compare.iter().flatten().next().unwrap_or(&args.file);
        let sentence = format!("There are no answers to compare with in {}.", other.display());
        return Err(Failure::new(Class::NotFound, "no_answers", sentence).into());
    }
    let is_different = comparison.as_ref().is_some_and(recordings::compare::Comparison::is_different);
    let report = ReplayReport { robot, counts: played.counts, inputs, comparison };
    session.show(&report, &table(&report))?;
    Ok(if is_different { ExitCode::FAILURE } else { ExitCode::SUCCESS })
}

/// What the robot has done; none before its first message, or where it is not registered.
async fn activity(session: &Session, robot: &Name) -> Option<RobotActivity> {
    session.maps().robot(robot.as_str()).await.ok()?.activity
}

/// What the server used and refused of the messages since `earlier`, as soon as it has seen the
/// `sent` ones without an answer.
async fn inputs_used(
    session: &Session,
    robot: &Name,
    earlier: Option<&RobotActivity>,
    sent: u64,
) -> Vec<RobotInput> {
    let until = Instant::now() + SETTLED;
    loop {
        let new = activity(session, robot).await.map(|now| inputs::since(earlier, &now)).unwrap_or_default();
        let is_answered = |input: &&RobotInput| input.input == "frame";
        let seen: u64 = new.iter().filter(|i| !is_answered(i)).map(|i| i.used + i.refused).sum();
        if seen >= sent || Instant::now() > until {
            return new;
        }
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
}

/// Nothing of a file was sent: a failure, with what was not used.
fn nothing_played(file: &Path, counts: &Counts) -> Failure {
    let sentence = format!("Nothing of {} was played.", file.display());
    let reasons = counts.problems.values().map(|(count, first)| format!("{count} times {first}"));
    let reasons: Vec<String> = reasons.collect();
    let advice = if reasons.is_empty() {
        "It has no frames, odometry or scans of this robot.".to_owned()
    } else {
        reasons.join("\n")
    };
    Failure::new(Class::Refused, "nothing_played", sentence).advise(advice)
}

fn opened(path: &Path) -> anyhow::Result<BufReader<File>> {
    let unreadable =
        |error| Failure::new(Class::Usage, "unreadable", format!("{}: {error}", unreadable(path)));
    let path = playable(path)?;
    Ok(BufReader::new(File::open(path).map_err(unreadable)?))
}

/// A file of messages, and its channels. Error: it is none, or each of its messages is packed.
pub(super) fn open_messages(path: &Path) -> anyhow::Result<(BufReader<File>, Vec<Arc<ChannelInfo>>)> {
    let mut messages = MessageReader::open(opened(path)?).with_context(|| unreadable(path))?;
    let channels = messages.channels().with_context(|| unreadable(path))?;
    let first = messages.next_message().with_context(|| unreadable(path))?;
    if first.is_some_and(|first| first.channel.encoding == "cdr" && first.data.starts_with(ZSTD)) {
        let sentence = format!("cannot play {}: each of its messages is packed with zstd.", path.display());
        let advice =
            "`ros2 bag convert` unpacks them: compression_mode: none, or `file` in its output options.";
        return Err(Failure::new(Class::Usage, "packed_messages", sentence).advise(advice).into());
    }
    Ok((opened(path)?, channels))
}

pub(crate) fn unreadable(path: &Path) -> String {
    format!("cannot play {}", path.display())
}

/// The robot's name at the server and in the recording, and its settings if the file is a bag.
fn robots(args: &Args) -> anyhow::Result<(Name, Name, Option<BagRobot>)> {
    let (_, channels) = open_messages(&args.file)?;
    if bag::is_bag(channels.iter().map(AsRef::as_ref)) {
        let Some(robot) = args.robot.clone() else {
            let sentence = format!("{} is a bag of ROS: which robot plays it?", args.file.display());
            return Err(Failure::usage(sentence).advise("Name it with --robot.").into());
        };
        let bag = BagRobot::new(robot.clone(), settings(&args.bag, &channels)?)?;
        return Ok((robot.clone(), robot, Some(bag)));
    }
    let names: BTreeSet<&str> = channels.iter().filter_map(|channel| robot_of(channel)).collect();
    let recorded = recorded_robot(args.recorded.as_ref(), &names, &args.file)?;
    Ok((args.robot.clone().unwrap_or_else(|| recorded.clone()), recorded, None))
}

/// The robot of a recording that is played: the one named, or the only one.
pub(super) fn recorded_robot(
    named: Option<&Name>,
    names: &BTreeSet<&str>,
    file: &Path,
) -> anyhow::Result<Name> {
    let all = || names.iter().copied().collect::<Vec<_>>().join(", ");
    let missing = |sentence: String| Failure::new(Class::NotFound, "not_recorded", sentence);
    match (named, names.len()) {
        (_, 0) => {
            let advice = "Messages of ROS 1 are not read: `rosbags-convert` makes a bag of ROS 2.";
            let missing = missing(format!("No robot's messages are in {}.", file.display()));
            Err(missing.advise(advice).into())
        }
        (Some(named), _) if names.contains(named.as_str()) => Ok(named.clone()),
        (Some(named), _) => {
            let sentence =
                format!("There is no robot `{named}` in {} (there are: {}).", file.display(), all());
            Err(missing(sentence).into())
        }
        (None, 1) => Ok(Name::new(*names.first().context("a robot")?)?),
        (None, _) => Err(Failure::usage(format!("Which robot is played? There are {}.", all()))
            .advise("Name it with --recorded.")
            .into()),
    }
}

/// The robot that a topic of ours belongs to: the chunk after `robot` of its key.
pub(super) fn robot_of(channel: &Arc<ChannelInfo>) -> Option<&str> {
    let is_ours = channel.schema.starts_with("waymark.");
    channel.topic.split('/').skip_while(|chunk| *chunk != "robot").nth(1).filter(|_| is_ours)
}

pub(super) fn settings(args: &BagArgs, channels: &[Arc<ChannelInfo>]) -> anyhow::Result<RobotSettings> {
    let cameras = if args.image.is_empty() {
        bag::cameras(channels.iter().map(AsRef::as_ref))
    } else {
        args.image.iter().map(|given| camera(given, channels)).collect::<anyhow::Result<_>>()?
    };
    Ok(args.motion.settings(channels, cameras))
}

fn camera(given: &str, channels: &[Arc<ChannelInfo>]) -> anyhow::Result<CameraSettings> {
    let wrong = |sentence: String| anyhow::Error::from(Failure::usage(sentence));
    let (name, topic) =
        given.split_once('=').ok_or_else(|| wrong(format!("--image {given}: not NAME=TOPIC.")))?;
    let found = channels.iter().find(|channel| channel.topic == topic);
    let form = match found.map(|channel| channel.schema.as_str()) {
        Some("sensor_msgs/msg/Image") => ImageForm::Raw,
        Some("sensor_msgs/msg/CompressedImage") => ImageForm::Compressed,
        Some(other) => return Err(wrong(format!("{topic} has messages of {other}, not images."))),
        None => {
            let sentence = format!("There is no topic {topic} in the bag.");
            return Err(Failure::new(Class::NotFound, "unknown_topic", sentence).into());
        }
    };
    let camera =
        bag::camera(topic, form).ok_or_else(|| wrong(format!("{topic} is no usual topic of images.")))?;
    let name = Name::new(name).map_err(|error| wrong(format!("--image {given}: {error}.")))?;
    Ok(CameraSettings { name, ..camera })
}

/// The answers to a robot in a file.
fn play_of(path: &Path, robot: &Name) -> anyhow::Result<Play> {
    let mut play = Play::default();
    let mut drive = DriveReader::open(opened(path)?).with_context(|| unreadable(path))?;
    while let Some(recorded) = drive.next_message().with_context(|| unreadable(path))? {
        if let (client::protos::Key::Answer(of, camera), Body::Answer(answer)) =
            (&recorded.key, &recorded.body)
            && of == robot
        {
            play.add(of, camera, answer);
        }
    }
    Ok(play)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_plays_nothing_fails_with_the_reasons() {
        let mut counts = Counts::default();
        let failure = nothing_played(Path::new("bag.mcap"), &counts);
        assert!(failure.class == Class::Refused && failure.advice.contains("no frames"), "{failure:?}");
        counts.problems.insert("malformed", (21, "a message of `/image`: its header".into()));
        assert!(nothing_played(Path::new("bag.mcap"), &counts).advice.contains("21 times a message"));
    }

    #[test]
    fn the_only_robot_of_a_recording_need_not_be_named() {
        let file = Path::new("drive.mcap");
        let name = |text: &str| Name::new(text).unwrap();
        let refused = |named: Option<&Name>, names: &[&str]| {
            let error = recorded_robot(named, &names.iter().copied().collect(), file).unwrap_err();
            Failure::of(&error)
        };
        assert_eq!(recorded_robot(None, &["r1"].into(), file).unwrap(), name("r1"));
        assert_eq!(recorded_robot(Some(&name("r2")), &["r1", "r2"].into(), file).unwrap(), name("r2"));
        let several = refused(None, &["r1", "r2"]);
        assert!(several.class == Class::Usage && several.sentence.contains("r1, r2"), "{several:?}");
        let other = refused(Some(&name("r3")), &["r1", "r2"]);
        assert!(other.class == Class::NotFound && other.sentence.contains("`r3`"), "{other:?}");
        assert_eq!(refused(None, &[]).class, Class::NotFound);
    }
}
