//! Which drive of a file: the robot of a recording, or the topics of a bag.

use super::replay::{BagArgs, open_messages, recorded_robot, robot_of, settings, unreadable};
use anyhow::Context as _;
use client::protos::Name;
use recordings::{BagRobot, DriveReader, bag};
use std::{collections::BTreeSet, fs::File, io::BufReader, path::Path};

/// The robot of a bag: nobody sees its name.
const BAG_ROBOT: &str = "bag";

/// Whose messages of a file are used.
#[derive(Debug, Clone, Default, clap::Args)]
pub(crate) struct DriveArgs {
    /// The robot of a recording of Waymark that drove, if there are several.
    #[arg(long, value_name = "NAME")]
    recorded: Option<Name>,
    #[command(flatten)]
    bag: BagArgs,
}

impl DriveArgs {
    /// Opens a file; the name of the robot in it.
    pub(crate) fn open(&self, path: &Path) -> anyhow::Result<(Name, DriveReader<BufReader<File>>)> {
        let (messages, channels) = open_messages(path)?;
        let (robot, bag) = if bag::is_bag(channels.iter().map(AsRef::as_ref)) {
            let robot = Name::new(BAG_ROBOT)?;
            let settings = settings(&self.bag, &channels)?;
            (robot.clone(), Some(BagRobot::new(robot, settings)?))
        } else {
            let names: BTreeSet<&str> = channels.iter().filter_map(|channel| robot_of(channel)).collect();
            (recorded_robot(self.recorded.as_ref(), &names, path)?, None)
        };
        Ok((robot, DriveReader::open_bag(messages, bag).with_context(|| unreadable(path))?))
    }
}
