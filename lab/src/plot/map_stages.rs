//! The stages of `map`: each gives an SVG picture of a small scene, worked out by the functions that the server calls.

use super::{
    Target, map_fusion, map_gaze, map_guided, map_health, map_laser, map_localisation, map_placement,
    map_relocalisation,
};

/// Which stage of `map` to draw.
#[derive(Debug, clap::Subcommand)]
pub(crate) enum Command {
    /// A landmark is placed on its wall by posed views: rays of the corners, rectangles of the views, their fusion.
    ///
    /// Page 11 of docs/method. The picture is an SVG file, as those of all metric stages are.
    Placement(Target),
    /// The robot's pose by one landmark, by two, and where one landmark leaves two poses.
    ///
    /// Page 13 of docs/method.
    Localisation(Target),
    /// Which landmark is worth a look: who is in sight, what a look at each would tell, which one is chosen.
    ///
    /// Page 14 of docs/method.
    Gaze(Target),
    /// Odometry, fixes and the fused pose along a drive, and what a late fix changes.
    ///
    /// Page 15 of docs/method.
    Fusion(Target),
    /// A map of walls: lines of a scan, scan matching, a loop before and after it is closed.
    ///
    /// Page 17 of docs/method.
    LaserMap(Target),
    /// Where a known pose expects landmarks in the image, with search gates, and which observation is which landmark.
    ///
    /// Page 26 of docs/method.
    Guided(Target),
    /// A landmark that was moved and one that is gone: evidence frame by frame, flag, quarantine.
    ///
    /// Page 27 of docs/method.
    Health(Target),
    /// A robot that does not know where it is among doors that look the same: its belief, observation by observation.
    ///
    /// Page 28 of docs/method.
    Relocalisation(Target),
}

/// Draws one stage.
pub(super) fn run(command: &Command) -> anyhow::Result<()> {
    let (target, svg) = match command {
        Command::Placement(target) => (target, map_placement::svg()?),
        Command::Localisation(target) => (target, map_localisation::svg()?),
        Command::Gaze(target) => (target, map_gaze::svg()?),
        Command::Fusion(target) => (target, map_fusion::svg()?),
        Command::LaserMap(target) => (target, map_laser::svg()?),
        Command::Guided(target) => (target, map_guided::svg()?),
        Command::Health(target) => (target, map_health::svg()?),
        Command::Relocalisation(target) => (target, map_relocalisation::svg()?),
    };
    Ok(std::fs::write(&target.out, svg)?)
}
