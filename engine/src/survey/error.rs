//! Why drives give no building.

use map::joint::JointError;

/// Why drives give no building.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SurveyError {
    /// There is nothing to look at.
    #[error("no frame with intrinsics and the camera's mounting")]
    NoFrame,
    /// The laser map is not that of the drive's scans.
    #[error("{0} scans were driven, {1} are in the laser map")]
    Scans(usize, usize),
    /// Frames cannot be put between scans.
    #[error("the capture time of scan {0} is not after that of the scan before")]
    Times(usize),
    /// One estimate has one camera.
    #[error("another camera than in the first drive")]
    OtherCamera,
    /// The estimate cannot be computed.
    #[error(transparent)]
    Joint(#[from] JointError),
    /// The camera as found is not on the robot.
    #[error("the drive puts the camera off its robot")]
    Camera,
    /// What is wrong with one of several drives.
    #[error("drive {0}: {1}")]
    Of(usize, Box<SurveyError>),
}
