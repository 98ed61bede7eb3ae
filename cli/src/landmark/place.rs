//! `waymark landmark place`: where a landmark hangs, by tape measure, by coordinates, or by a
//! photograph.

use super::{photograph::Photograph, show};
use crate::{
    arg_parsers::{height_m, numbers},
    camera_arg::{CameraArg, camera},
    failure::{Class, Failure},
    pictures,
    session::Session,
};
use client::{
    LandmarkRegion, NewView,
    api::{CaptureMetadata, Landmark, LandmarkPatch, Place, WallBody},
};
use map::{
    extrinsics::pan_tilt,
    pose2::{Pose2, Pose2Covariance},
};
use nalgebra::{Matrix3, Vector3};
use protos::convert::geometry::{intrinsics_wire, pose2_covariance_wire, pose3_wire};
use std::path::PathBuf;
use vision::frame::Intrinsics;

/// `waymark landmark place`.
#[derive(Debug, clap::Args)]
#[command(group = clap::ArgGroup::new("where").required(true).args(["wall", "xy", "photo", "nowhere"]))]
pub(super) struct PlaceArgs {
    /// The landmark.
    landmark: String,
    /// The number of its wall, as `waymark map walls` says.
    #[arg(long, value_name = "N", requires = "at")]
    wall: Option<usize>,
    /// Metres along the wall to its middle, from the left end as you stand before the wall.
    #[arg(long, value_name = "METRES")]
    at: Option<f64>,
    /// Its middle in the map: x,y in metres.
    #[arg(long, value_name = "X,Y", value_parser = pair, requires = "facing", allow_hyphen_values = true)]
    xy: Option<[f64; 2]>,
    /// Direction that it faces, away from its wall: degrees, counter-clockwise from the map's x
    /// axis.
    #[arg(long, value_name = "DEG", allow_hyphen_values = true)]
    facing: Option<f64>,
    /// Metres from the floor to its middle.
    #[arg(long, value_name = "METRES", conflicts_with = "lower_edge", value_parser = height_m)]
    height: Option<f64>,
    /// Metres from the floor to its lower edge; the landmark must have a size.
    #[arg(long, value_name = "METRES", value_parser = height_m)]
    lower_edge: Option<f64>,
    /// A photograph of it from a known place; it is also stored as a training view.
    #[arg(long, value_name = "FILE", requires_all = ["camera", "from", "camera_height"])]
    photo: Option<PathBuf>,
    /// The framed object to take where the photograph shows several: 1 is the leftmost.
    #[arg(long, value_name = "N", requires = "photo")]
    pick: Option<usize>,
    /// The camera of the photograph: the file that `waymark camera calibrate --json` wrote, ROS'
    /// ost.yaml, or fx,fy,cx,cy in pixels.
    #[arg(long, value_name = "FILE|FX,FY,CX,CY", value_parser = camera)]
    camera: Option<CameraArg>,
    /// Where the camera stood and looked: x,y in metres, direction in degrees.
    #[arg(long, value_name = "X,Y,DEG", value_parser = standpoint, allow_hyphen_values = true)]
    from: Option<[f64; 3]>,
    /// Standard deviations of that: of each coordinate in metres, of the direction in degrees.
    #[arg(long, value_name = "METRES,DEG", value_parser = pair, default_value = "0.03,1")]
    from_sigma: [f64; 2],
    /// Height of the lens above the floor, metres.
    #[arg(long, value_name = "METRES", value_parser = height_m)]
    camera_height: Option<f64>,
    /// Tilt of the camera, degrees, up positive.
    #[arg(long, value_name = "DEG", default_value_t = 0.0, allow_hyphen_values = true)]
    camera_tilt: f64,
    /// Delete its place.
    #[arg(long)]
    nowhere: bool,
}

fn pair(text: &str) -> Result<[f64; 2], String> {
    numbers(text, ',').ok_or_else(|| "two numbers with a comma between".to_owned())
}

fn standpoint(text: &str) -> Result<[f64; 3], String> {
    numbers(text, ',').ok_or_else(|| "three numbers: x,y in metres, direction in degrees".to_owned())
}

pub(super) async fn run(session: &Session, map: &str, args: &PlaceArgs) -> anyhow::Result<()> {
    let landmark = session.maps().landmark(map, &args.landmark).await?;
    let placed = if args.photo.is_some() {
        by_photograph(session, map, args).await?
    } else {
        let place = if args.nowhere { None } else { Some(by_tape(session, map, args, &landmark).await?) };
        let patch = LandmarkPatch { place: Some(place), ..LandmarkPatch::default() };
        session.maps().if_match(&landmark.revision).update_landmark(map, &args.landmark, &patch).await?
    };
    session.show(&placed, &show::text(&placed))?;
    for line in show::next(&placed) {
        session.note(&format!("  {line}"));
    }
    Ok(())
}

async fn by_tape(
    session: &Session,
    map: &str,
    args: &PlaceArgs,
    landmark: &Landmark,
) -> anyhow::Result<Place> {
    let z_m = height(args, landmark)?;
    let (x_m, y_m, theta_rad) = match (args.wall, args.xy) {
        (Some(number), _) => {
            let walls = session.maps().walls(map).await?;
            let wall = number.checked_sub(1).and_then(|i| walls.segments.get(i)).ok_or_else(|| {
                let count = walls.segments.len();
                Failure::new(
                    Class::NotFound,
                    "unknown_wall",
                    format!("There is no wall {number}; {map} has {count}."),
                )
                .advise(format!("waymark map walls {map} lists them; --draw FILE draws them."))
            })?;
            on_wall(wall, args.at.unwrap_or_default())?
        }
        (None, Some([x, y])) => (x, y, args.facing.unwrap_or_default().to_radians()),
        (None, None) => return Err(Failure::usage("Say where: --wall, --xy or --photo.").into()),
    };
    Ok(Place { x_m, y_m, z_m, theta_rad, ..Place::default() })
}

/// Height of the middle above the floor.
fn height(args: &PlaceArgs, landmark: &Landmark) -> Result<f64, Failure> {
    match (args.height, args.lower_edge, landmark.size) {
        (Some(height), _, _) => Ok(height),
        (None, Some(edge), Some(size)) => Ok(edge + size.height_m / 2.0),
        (None, Some(_), None) => Err(Failure::usage("--lower-edge: the landmark has no size.")
            .advise(format!("waymark landmark size {} 0.60x0.84", landmark.name))),
        (None, None, _) => {
            Err(Failure::usage("How high does it hang? Add --height METRES, floor to its middle."))
        }
    }
}

/// Place and direction at so many metres from the left end of a wall, as seen from its free side,
/// which is left of a to b: the left end is b.
fn on_wall(wall: &WallBody, at_m: f64) -> Result<(f64, f64, f64), Failure> {
    let (dx, dy) = (wall.a[0] - wall.b[0], wall.a[1] - wall.b[1]);
    let length_m = dx.hypot(dy);
    if !(0.0..=length_m).contains(&at_m) {
        return Err(Failure::usage(format!("--at {at_m}: the wall is {length_m:.2} m long.")));
    }
    let share = if length_m > 0.0 { at_m / length_m } else { 0.0 };
    // The normal to the free side: a to b turned to the left.
    let theta_rad = (-dx).atan2(dy);
    Ok((wall.b[0] + share * dx, wall.b[1] + share * dy, theta_rad))
}

/// Sends the photograph with the camera's pose; the server finds the place on the map's walls.
async fn by_photograph(session: &Session, map: &str, args: &PlaceArgs) -> anyhow::Result<Landmark> {
    let (Some(path), Some(camera), Some(from), Some(height_m)) =
        (&args.photo, &args.camera, args.from, args.camera_height)
    else {
        return Err(Failure::usage("--photo needs --camera, --from and --camera-height.").into());
    };
    let photograph = Photograph { path, region: LandmarkRegion::Detect, pick: args.pick };
    let sent = pictures::photograph(path)
        .map_err(|error| Failure::new(Class::Usage, "unreadable", format!("{}: {error}", path.display())))?;
    if let Some(caution) = camera.check_lens(sent.lens.as_ref())? {
        session.note(&caution);
    }
    let capture =
        capture(&camera.of_photograph(&sent.bytes)?, from, args.from_sigma, height_m, args.camera_tilt);
    let view = |view| NewView { capture: Some(capture.clone()), keep_near_duplicate: true, ..view };
    let view = photograph.send(session, (map, &args.landmark), view).await?;
    match view.placing {
        Some(report) if report.placed => Ok(session.maps().landmark(map, &args.landmark).await?),
        report => {
            let why = report.and_then(|r| r.reason).unwrap_or_else(|| "no place was found".to_owned());
            Err(Failure::new(Class::Refused, "not_placed", format!("{} was not placed: {why}.", args.landmark))
                .advise("Check --from, --camera-height and the map's walls, or measure: --wall N --at METRES --height METRES")
                .into())
        }
    }
}

fn capture(
    camera: &Intrinsics,
    [x_m, y_m, degrees]: [f64; 3],
    [sigma_m, sigma_deg]: [f64; 2],
    height_m: f64,
    tilt_deg: f64,
) -> CaptureMetadata {
    let variance = Vector3::new(sigma_m, sigma_m, sigma_deg.to_radians()).map(|s| s * s);
    let pose = Pose2Covariance {
        pose: Pose2::new(x_m, y_m, degrees.to_radians()),
        covariance: Matrix3::from_diagonal(&variance),
    };
    let robot_from_camera = pan_tilt(0.0, tilt_deg.to_radians(), Vector3::new(0.0, 0.0, height_m));
    CaptureMetadata {
        intrinsics: intrinsics_wire(camera),
        map_from_robot: pose2_covariance_wire(&pose),
        robot_from_camera: pose3_wire(&robot_from_camera),
        ceiling_height_m: None,
        corner_covariance_px2: None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn metres_run_from_the_left_end_as_one_stands_before_the_wall() {
        // The wall runs along x with the free side at y above it: whoever stands there has b, at
        // x = 5, to the left.
        let wall = WallBody::between([1.0, 2.0], [5.0, 2.0]);
        let (x, y, theta) = on_wall(&wall, 1.0).unwrap();
        assert!((x - 4.0).abs() < 1e-12 && (y - 2.0).abs() < 1e-12);
        assert!((theta - std::f64::consts::FRAC_PI_2).abs() < 1e-12, "{theta}");
        assert!(
            on_wall(&wall, 4.1).is_err()
                && on_wall(&wall, -0.1).is_err()
                && on_wall(&wall, f64::NAN).is_err()
        );
        let (_, _, theta) = on_wall(&WallBody::between([0.0, 0.0], [0.0, 3.0]), 1.0).unwrap();
        assert!((theta.abs() - std::f64::consts::PI).abs() < 1e-12, "{theta}");
    }
}
