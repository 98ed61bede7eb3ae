//! `waymark replay`: plays a recording or a bag of ROS 2 into a server, as a robot, and compares the answers.

use super::{
    Endpoints, PROGRAM,
    player::{Player, PlayerOptions},
    report::{ReplayReport, table},
};
use crate::screen;
use anyhow::{Context as _, bail};
use client::{MapClient, protos::Name};
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
};

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
    /// Compare the answers with those of the recording, or of another file; exit status 1 if they differ.
    #[arg(long, value_name = "OTHER", num_args = 0..=1)]
    #[allow(clippy::option_option, reason = "clap's form of an option with an optional value")]
    compare: Option<Option<PathBuf>>,
    /// End with the counts as one JSON object.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    bag: BagArgs,
    #[command(flatten)]
    endpoints: Endpoints,
}

/// Topics and frames of a bag, where they have other names than usual.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Bags of ROS 2")]
struct BagArgs {
    /// A topic of images, as `NAME=TOPIC` with the camera's name; may be given several times [default: all of the bag].
    #[arg(long, value_name = "NAME=TOPIC")]
    image: Vec<String>,
    /// Topic of the laser [default: /scan].
    #[arg(long, value_name = "TOPIC")]
    scan: Option<String>,
    /// Topic of the odometry; `tf` takes it from the transforms [default: /odom, or `tf` if the bag lacks that].
    #[arg(long, value_name = "TOPIC")]
    odometry: Option<String>,
    /// The robot's frame [default: `base_link`].
    #[arg(long, value_name = "FRAME")]
    base_frame: Option<String>,
    /// The odometry's frame [default: odom].
    #[arg(long, value_name = "FRAME")]
    odom_frame: Option<String>,
}

fn speed(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(factor) if (0.01..=100.0).contains(&factor) => Ok(factor),
        _ => Err("a number from 0.01 to 100".to_owned()),
    }
}

/// Plays a file.
pub(crate) async fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let (robot, recorded, bag) = tokio::task::block_in_place(|| robots(args))?;
    if let Some(map) = &args.map {
        MapClient::new(&args.endpoints.server)?.put_robot(robot.as_str(), map.as_str()).await?;
    }
    let before = match &args.compare {
        Some(Some(other)) => Some(tokio::task::block_in_place(|| play_of(other, &recorded))?),
        _ => None,
    };
    let answers = args.answers.as_deref().map(|path| {
        let file = File::create_new(path).with_context(|| format!("cannot make {}", path.display()))?;
        Ok::<_, anyhow::Error>(DriveWriter::create(BufWriter::new(file), &args.endpoints.fleet, PROGRAM)?)
    });
    let options = PlayerOptions {
        zenoh: args.endpoints.zenoh.clone(),
        fleet: args.endpoints.fleet.clone(),
        robot: robot.clone(),
        recorded,
        speed: args.speed,
        is_map_given: args.map.is_some(),
    };
    let drive = DriveReader::open_bag(opened(&args.file)?, bag).with_context(|| unreadable(&args.file))?;
    let player = Player::connect(options, answers.transpose()?).await?;
    let played = player.play(drive).await.with_context(|| unreadable(&args.file))?;
    let before = before.or_else(|| args.compare.is_some().then_some(played.before));
    let comparison = before.map(|before| before.compare(&played.now));
    if comparison.as_ref().is_some_and(|c| c.frames == 0) {
        bail!("there are no answers to compare with in {}", args.file.display());
    }
    let is_different = comparison.as_ref().is_some_and(recordings::compare::Comparison::is_different);
    let report = ReplayReport { robot, counts: played.counts, comparison };
    if args.json {
        screen::say(&serde_json::to_string(&report)?);
    } else {
        screen::say(&table(&report));
    }
    Ok(if is_different { ExitCode::FAILURE } else { ExitCode::SUCCESS })
}

fn opened(path: &Path) -> anyhow::Result<BufReader<File>> {
    Ok(BufReader::new(File::open(path).with_context(|| unreadable(path))?))
}

fn unreadable(path: &Path) -> String {
    format!("cannot play {}", path.display())
}

/// The robot's name at the server and in the recording, and its settings if the file is a bag.
fn robots(args: &Args) -> anyhow::Result<(Name, Name, Option<BagRobot>)> {
    let mut file = MessageReader::open(opened(&args.file)?).with_context(|| unreadable(&args.file))?;
    let channels = file.channels().with_context(|| unreadable(&args.file))?;
    if bag::is_bag(channels.iter().map(AsRef::as_ref)) {
        let Some(robot) = args.robot.clone() else {
            bail!("{} is a bag of ROS: say with --robot as which robot it is played", args.file.display());
        };
        let bag = BagRobot::new(robot.clone(), settings(&args.bag, &channels)?)?;
        return Ok((robot.clone(), robot, Some(bag)));
    }
    let names: BTreeSet<&str> = channels.iter().filter_map(|channel| robot_of(channel)).collect();
    let recorded = match (&args.recorded, names.len()) {
        (Some(recorded), _) if names.contains(recorded.as_str()) => recorded.clone(),
        (None, 1) => Name::new(*names.first().context("a robot")?)?,
        (_, 0) => bail!("no robot's messages are in {}", args.file.display()),
        _ => {
            let names: Vec<&str> = names.into_iter().collect();
            bail!("say with --recorded which robot is played: {}", names.join(", "));
        }
    };
    Ok((args.robot.clone().unwrap_or_else(|| recorded.clone()), recorded, None))
}

/// The robot that a topic of ours belongs to: the chunk after `robot` of its key.
fn robot_of(channel: &Arc<ChannelInfo>) -> Option<&str> {
    let is_ours = channel.schema.starts_with("waymark.");
    channel.topic.split('/').skip_while(|chunk| *chunk != "robot").nth(1).filter(|_| is_ours)
}

fn settings(args: &BagArgs, channels: &[Arc<ChannelInfo>]) -> anyhow::Result<RobotSettings> {
    let usual = RobotSettings::default();
    let has = |topic: &str| channels.iter().any(|channel| channel.topic == topic);
    let odometry = match args.odometry.as_deref() {
        Some("tf") => None,
        Some(topic) => Some(topic.to_owned()),
        None => usual.odometry.clone().filter(|topic| has(topic)),
    };
    let cameras = if args.image.is_empty() {
        bag::cameras(channels.iter().map(AsRef::as_ref))
    } else {
        args.image.iter().map(|given| camera(given, channels)).collect::<anyhow::Result<_>>()?
    };
    Ok(RobotSettings {
        base_frame: args.base_frame.clone().unwrap_or(usual.base_frame),
        odom_frame: args.odom_frame.clone().unwrap_or(usual.odom_frame),
        scan: args.scan.clone().or(usual.scan),
        odometry,
        cameras,
        ..RobotSettings::default()
    })
}

fn camera(given: &str, channels: &[Arc<ChannelInfo>]) -> anyhow::Result<CameraSettings> {
    let (name, topic) = given.split_once('=').with_context(|| format!("`{given}` is not NAME=TOPIC"))?;
    let found = channels.iter().find(|channel| channel.topic == topic);
    let form = match found.map(|channel| channel.schema.as_str()) {
        Some("sensor_msgs/msg/Image") => ImageForm::Raw,
        Some("sensor_msgs/msg/CompressedImage") => ImageForm::Compressed,
        Some(other) => bail!("{topic} has messages of {other}, not images"),
        None => bail!("there is no topic {topic} in the bag"),
    };
    let camera = bag::camera(topic, form).with_context(|| format!("{topic} is no usual topic"))?;
    Ok(CameraSettings { name: Name::new(name)?, ..camera })
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
