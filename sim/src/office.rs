//! The office of the guides: a room with four posters, where each photograph in it was taken, and
//! what else the guides name: a laser log and floor plans. Everything follows from fixed seeds.

use std::fmt::Write as _;

use map::{extrinsics::pan_tilt, pose2::Pose2};
use nalgebra::{Isometry3, Vector3};
use vision::frame::{Distortion, GrayImage, Intrinsics};

use crate::building::Building;
use crate::camera::Camera;
use crate::corridor::CorridorParams;
use crate::laser::{LaserParams, scan};
use crate::render::Renderer;
use crate::sensor::SensorParams;

/// The office: 10 m x 5 m, four posters of 0.60 m x 0.84 m.
pub fn office() -> Building {
    let params = CorridorParams {
        length_m: 10.0,
        width_m: 5.0,
        posters: 4,
        column: false,
        first_poster: 41,
        ..CorridorParams::default()
    };
    Building::corridor_with(&params, 7)
}

/// The camera of the photographs.
pub fn camera() -> Camera {
    let intrinsics = Intrinsics {
        fx_px: 1000.0,
        fy_px: 1000.0,
        cx_px: 639.5,
        cy_px: 479.5,
        distortion: Distortion::None,
        sigmas: None,
    };
    Camera::new(intrinsics, 1280, 960)
}

/// Where a photograph of a poster was taken.
#[derive(Debug, Clone, Copy)]
pub struct Standpoint {
    poster: &'static str,
    /// Metres from the poster, degrees from its normal (to the left of who looks at it positive).
    from: [f64; 2],
    /// Height of the camera, metres.
    height_m: f64,
    /// Degrees by which it looks past the poster to the left, and up.
    turned: [f64; 2],
}

const fn at(poster: &'static str, from: [f64; 2], height_m: f64, turned: [f64; 2]) -> Standpoint {
    Standpoint { poster, from, height_m, turned }
}

/// The photographs of the guides, by file name.
pub const PHOTOGRAPHS: [(&str, Standpoint); 6] = [
    ("poster1.jpg", at("poster-0", [1.5, 3.0], 1.5, [0.0, 1.0])),
    ("poster2.jpg", at("poster-0", [1.6, 35.0], 1.6, [2.0, -3.0])),
    ("poster3.jpg", at("poster-0", [1.6, -33.0], 1.35, [-2.0, 4.0])),
    ("map1.jpg", at("poster-1", [1.5, 5.0], 1.5, [1.0, 0.0])),
    ("here.jpg", at("poster-0", [2.2, 38.0], 1.45, [4.0, 1.5])),
    ("wall.jpg", at("poster-0", [2.3, 0.0], 1.5, [-25.0, 0.0])),
];

/// Pictures that calibrate the camera, from all around the first poster: their standpoints.
pub fn around() -> [Standpoint; 8] {
    std::array::from_fn(|number| {
        let angle = (number as f64 * 45.0 + 10.0).to_radians();
        at("poster-0", [1.6, 38.0 * angle.cos()], 1.5 + 0.8 * angle.sin(), [0.0, 0.0])
    })
}

/// The pose of the camera of a photograph, by its file name; `None` if there is none of that name.
pub fn map_from_camera(name: &str) -> Option<Isometry3<f64>> {
    let (_, standpoint) = PHOTOGRAPHS.iter().find(|(file, _)| *file == name)?;
    Some(pose(&office(), standpoint))
}

/// The pose of a camera at a standpoint.
pub fn pose(building: &Building, standpoint: &Standpoint) -> Isometry3<f64> {
    let poster =
        building.landmark(standpoint.poster).map_or_else(Isometry3::identity, |l| l.map_from_landmark);
    let [distance_m, degrees] = standpoint.from;
    let normal = poster.rotation * Vector3::x();
    let to_camera = normal.y.atan2(normal.x) - degrees.to_radians();
    let centre = poster.translation.vector;
    let (x, y) = (centre.x + distance_m * to_camera.cos(), centre.y + distance_m * to_camera.sin());
    let up = (centre.z - standpoint.height_m).atan2(distance_m);
    let heading = to_camera + std::f64::consts::PI + standpoint.turned[0].to_radians();
    pan_tilt(heading, up + standpoint.turned[1].to_radians(), Vector3::new(x, y, standpoint.height_m))
}

/// A photograph from a standpoint; `seed` is for the noise.
pub fn photograph(
    renderer: &mut Renderer,
    building: &Building,
    standpoint: &Standpoint,
    seed: u64,
) -> GrayImage {
    renderer.render(building, &pose(building, standpoint), &SensorParams::default(), seed).image
}

/// A drive through the office as a CARMEN log, 180 degrees, one reading a degree.
pub fn laser_log(building: &Building) -> String {
    // CARMEN logs have the laser in the robot's origin.
    let params = LaserParams { robot_from_laser: Pose2::default(), beams: 181, ..LaserParams::default() };
    let mut log = String::new();
    for step in 0..60_u32 {
        let s = f64::from(step) / 59.0;
        let pose = Pose2::new(1.0 + 8.0 * s, -1.0 + 2.0 * s, 0.4 * (12.0 * s).sin());
        let scan = scan(building, &pose, &params, u64::from(step));
        let ranges: Vec<String> = scan.ranges_m().iter().map(|range| format!("{range:.3}")).collect();
        let at = format!("{:.4} {:.4} {:.5}", pose.x_m, pose.y_m, pose.theta_rad);
        writeln!(log, "FLASER 181 {} {at} {at} {:.2} office {:.2}", ranges.join(" "), s * 20.0, s * 20.0)
            .ok();
    }
    log
}

/// The walls of the office for other programs, by file name: a grid of `map_server`, GeoJSON, and
/// an SVG floor plan (1 px = 1 cm).
pub fn floor_plans(building: &Building) -> Vec<(&'static str, Vec<u8>)> {
    const CELL_M: f64 = 0.05;
    let (origin, width, height) = ([-1.0, -4.0], 240_usize, 160_usize);
    let mut cells = vec![205_u8; width * height];
    for (i, cell) in cells.iter_mut().enumerate() {
        let x = origin[0] + (i % width) as f64 * CELL_M + 0.5 * CELL_M;
        let y = origin[1] + (height - 1 - i / width) as f64 * CELL_M + 0.5 * CELL_M;
        let outside = (x - 5.0).abs() - 5.0;
        let outside = outside.max(y.abs() - 2.5);
        if outside < 0.0 {
            *cell = 254;
        } else if outside < CELL_M {
            *cell = 0;
        }
    }
    let mut pgm = format!("P5\n{width} {height}\n255\n").into_bytes();
    pgm.extend(&cells);
    let yaml = format!(
        "image: floor.pgm\nresolution: {CELL_M}\norigin: [{}, {}, 0.0]\nnegate: 0\noccupied_thresh: 0.65\n\
         free_thresh: 0.196\n",
        origin[0], origin[1]
    );
    let walls = building.walls();
    let lines: Vec<String> =
        walls.iter().map(|w| format!("[[{}, {}], [{}, {}]]", w.a_m.x, w.a_m.y, w.b_m.x, w.b_m.y)).collect();
    let geojson = format!(
        "{{\"type\": \"FeatureCollection\", \"features\": [{{\"type\": \"Feature\", \"properties\": {{}}, \
         \"geometry\": {{\"type\": \"MultiLineString\", \"coordinates\": [{}]}}}}]}}\n",
        lines.join(", ")
    );
    let svg = "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"1100\" height=\"600\" viewBox=\"0 0 1100 600\">\
               <path d=\"M 50 50 H 1050 V 550 H 50 Z\" fill=\"none\" stroke=\"black\"/></svg>\n";
    vec![
        ("floor.pgm", pgm),
        ("floor.yaml", yaml.into_bytes()),
        ("floor.geojson", geojson.into_bytes()),
        ("plan.svg", svg.as_bytes().to_vec()),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_poster_hangs_where_the_guides_say() {
        let office = office();
        let poster = office.landmark("poster-0").expect("a poster");
        let (at, normal) =
            (poster.map_from_landmark.translation.vector, poster.map_from_landmark.rotation * Vector3::x());
        let found =
            [at.x, at.y, at.z, normal.y.atan2(normal.x).to_degrees(), poster.width_m, poster.height_m];
        let said = [4.59, 2.50, 1.50, -90.0, 0.60, 0.84];
        assert!(found.iter().zip(said).all(|(f, s)| (f - s).abs() < 0.005), "{found:?}");
        let camera = map_from_camera("here.jpg").expect("a photograph");
        let (at, ahead) = (camera.translation.vector, camera.rotation * Vector3::z());
        let found = [at.x, at.y, at.z, ahead.y.atan2(ahead.x).to_degrees()];
        assert!(found.iter().zip([3.23, 0.76, 1.45, 56.0]).all(|(f, s)| (f - s).abs() < 0.006), "{found:?}");
    }
}
