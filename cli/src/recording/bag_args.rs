//! Topics and frames of a bag on the command line. In: options, and the channels of the file. Out:
//! settings of a robot.

use recordings::read::ChannelInfo;
use ros2::robot::{CameraSettings, RobotSettings};
use std::sync::Arc;

/// How a bag of ROS 2 names what a robot moves by.
#[derive(Debug, Clone, Default, clap::Args)]
#[command(next_help_heading = "Bags of ROS 2")]
pub(crate) struct MotionArgs {
    /// Topic of the laser [default: /scan].
    #[arg(long, value_name = "TOPIC")]
    pub(crate) scan: Option<String>,
    /// Topic of the odometry; `tf` takes it from the transforms [default: /odom, or `tf` if the bag
    /// lacks that].
    #[arg(long, value_name = "TOPIC")]
    odometry: Option<String>,
    /// The robot's frame [default: `base_link`].
    #[arg(long, value_name = "FRAME")]
    base_frame: Option<String>,
    /// The odometry's frame [default: odom].
    #[arg(long, value_name = "FRAME")]
    odom_frame: Option<String>,
}

impl MotionArgs {
    /// The robot of a file with these channels and cameras.
    pub(super) fn settings(
        &self,
        channels: &[Arc<ChannelInfo>],
        cameras: Vec<CameraSettings>,
    ) -> RobotSettings {
        let usual = RobotSettings::default();
        let has = |topic: &str| channels.iter().any(|channel| channel.topic == topic);
        let odometry = match self.odometry.as_deref() {
            Some("tf") => None,
            Some(topic) => Some(topic.to_owned()),
            None => usual.odometry.clone().filter(|topic| has(topic)),
        };
        RobotSettings {
            base_frame: self.base_frame.clone().unwrap_or(usual.base_frame),
            odom_frame: self.odom_frame.clone().unwrap_or(usual.odom_frame),
            scan: self.scan.clone().or(usual.scan),
            odometry,
            cameras,
            ..RobotSettings::default()
        }
    }
}
