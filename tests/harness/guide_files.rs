//! The files that the guides name: photographs of an office, a laser log, a floor plan. The office is rendered, so that
//! where each photograph was taken is known.

use crate::{
    bag,
    scenes::{self, png},
};
use image::{ExtendedColorType, codecs::jpeg::JpegEncoder};
use map::{extrinsics::pan_tilt, pose2::Pose2};
use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use sim::{
    building::Building,
    camera::Camera,
    corridor::CorridorParams,
    laser::{LaserParams, scan},
    lesson::LessonParams,
    render::Renderer,
    sensor::SensorParams,
};
use std::{fmt::Write as _, fs, path::Path, sync::Arc};
use vision::frame::{Distortion, GrayImage, Intrinsics};

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
    let intrinsics = Intrinsics::new(1000.0, 1000.0, 639.5, 479.5, Distortion::None).expect("a camera");
    Camera::new(intrinsics, 1280, 960)
}

/// Where a photograph of a poster was taken.
#[derive(Debug, Clone, Copy)]
struct Standpoint {
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

const PHOTOGRAPHS: [(&str, Standpoint); 6] = [
    ("poster1.jpg", at("poster-0", [1.5, 3.0], 1.5, [0.0, 1.0])),
    ("poster2.jpg", at("poster-0", [1.6, 35.0], 1.6, [2.0, -3.0])),
    ("poster3.jpg", at("poster-0", [1.6, -33.0], 1.35, [-2.0, 4.0])),
    ("map1.jpg", at("poster-1", [1.5, 5.0], 1.5, [1.0, 0.0])),
    ("here.jpg", at("poster-0", [2.2, 38.0], 1.45, [4.0, 1.5])),
    ("wall.jpg", at("poster-0", [2.3, 0.0], 1.5, [-25.0, 0.0])),
];

/// Makes all files of the guides in a folder.
pub fn write(folder: &Path) {
    let building = office();
    let mut renderer = Renderer::new(camera());
    let mut stops = Vec::new();
    for (number, (name, standpoint)) in PHOTOGRAPHS.iter().enumerate() {
        let image = photograph(&mut renderer, &building, standpoint, number as u64);
        fs::write(folder.join(name), jpeg(&image)).expect("a photograph");
        stops.push(stop(&building, standpoint, image));
    }
    fs::create_dir_all(folder.join("bag")).expect("a folder");
    bag::write(&folder.join("bag/bag_0.mcap"), &camera(), &stops[..3]);
    fs::write(folder.join("blank.jpg"), jpeg(&GrayImage::from_fn(640, 480, |_, _| 180)))
        .expect("a photograph");
    let pictures = folder.join("pictures");
    fs::create_dir_all(&pictures).expect("a folder");
    for number in 0..8_u32 {
        let angle = f64::from(number) * 45.0 + 10.0;
        let (u, v) = (angle.to_radians().cos(), angle.to_radians().sin());
        let standpoint = at("poster-0", [1.6, 38.0 * u], 1.5 + 0.8 * v, [0.0, 0.0]);
        let image = photograph(&mut renderer, &building, &standpoint, 100 + u64::from(number));
        fs::write(pictures.join(format!("{number}.png")), png(&image)).expect("a photograph");
    }
    hall(&folder.join("my-hall"), &building);
    fs::write(folder.join("drive.log"), laser_log(&building)).expect("a laser log");
    floor_plans(folder, &building);
}

/// A labelled set of pictures, in the evaluation format.
fn hall(folder: &Path, building: &Building) {
    fs::create_dir_all(folder).expect("a folder");
    let building = Arc::new(building.clone());
    let near = LessonParams { seed: 3, views: 2, distance_m: [1.3, 2.5], ..LessonParams::default() };
    let taught = ["poster-0".to_owned(), "poster-1".to_owned()];
    scenes::write_set(folder, &building, &scenes::views(&building, &near), &taught, 32.0);
}

/// The pose of the camera of a photograph, by its file name.
pub fn map_from_camera(name: &str) -> Isometry3<f64> {
    let (_, standpoint) = PHOTOGRAPHS.iter().find(|(file, _)| *file == name).expect("a photograph");
    pose(&office(), standpoint)
}

fn pose(building: &Building, standpoint: &Standpoint) -> Isometry3<f64> {
    let poster = building.landmark(standpoint.poster).expect("a poster").map_from_landmark;
    let [distance_m, degrees] = standpoint.from;
    let normal = poster.rotation * Vector3::x();
    let to_camera = normal.y.atan2(normal.x) - degrees.to_radians();
    let centre = poster.translation.vector;
    let (x, y) = (centre.x + distance_m * to_camera.cos(), centre.y + distance_m * to_camera.sin());
    let up = (centre.z - standpoint.height_m).atan2(distance_m);
    let heading = to_camera + std::f64::consts::PI + standpoint.turned[0].to_radians();
    pan_tilt(heading, up + standpoint.turned[1].to_radians(), Vector3::new(x, y, standpoint.height_m))
}

/// What a robot below the camera measured, whose odometry began at the map's origin.
fn stop(building: &Building, standpoint: &Standpoint, picture: GrayImage) -> bag::Stop {
    let map_from_camera = pose(building, standpoint);
    let ahead = map_from_camera.rotation * Vector3::z();
    let at = map_from_camera.translation.vector;
    let odom_from_robot = Pose2::new(at.x, at.y, ahead.y.atan2(ahead.x));
    let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), odom_from_robot.theta_rad);
    let map_from_robot = Isometry3::from_parts(Vector3::new(at.x, at.y, 0.0).into(), turn);
    bag::Stop {
        odom_from_robot,
        scan: scan(building, &odom_from_robot, &LaserParams::default(), 1),
        picture,
        robot_from_camera: map_from_robot.inv_mul(&map_from_camera),
    }
}

fn photograph(renderer: &mut Renderer, building: &Building, standpoint: &Standpoint, seed: u64) -> GrayImage {
    renderer.render(building, &pose(building, standpoint), &SensorParams::default(), seed).image
}

fn jpeg(image: &GrayImage) -> Vec<u8> {
    let mut out = Vec::new();
    JpegEncoder::new_with_quality(&mut out, 92)
        .encode(image.data(), image.width() as u32, image.height() as u32, ExtendedColorType::L8)
        .expect("in memory");
    out
}

/// A drive through the office as a CARMEN log, 180 degrees, one reading a degree.
fn laser_log(building: &Building) -> String {
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
            .expect("in memory");
    }
    log
}

/// The walls of the office as a grid of `map_server`, as GeoJSON and as an SVG floor plan (1 px = 1 cm).
fn floor_plans(folder: &Path, building: &Building) {
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
    fs::write(folder.join("floor.pgm"), pgm).expect("a grid");
    let yaml = format!(
        "image: floor.pgm\nresolution: {CELL_M}\norigin: [{}, {}, 0.0]\nnegate: 0\noccupied_thresh: 0.65\n\
         free_thresh: 0.196\n",
        origin[0], origin[1]
    );
    fs::write(folder.join("floor.yaml"), yaml).expect("a grid");
    let walls = building.walls();
    let lines: Vec<String> =
        walls.iter().map(|w| format!("[[{}, {}], [{}, {}]]", w.a_m.x, w.a_m.y, w.b_m.x, w.b_m.y)).collect();
    let geojson = format!(
        "{{\"type\": \"FeatureCollection\", \"features\": [{{\"type\": \"Feature\", \"properties\": {{}}, \
         \"geometry\": {{\"type\": \"MultiLineString\", \"coordinates\": [{}]}}}}]}}\n",
        lines.join(", ")
    );
    fs::write(folder.join("floor.geojson"), geojson).expect("a plan");
    let svg = "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"1100\" height=\"600\" viewBox=\"0 0 1100 600\">\
               <path d=\"M 50 50 H 1050 V 550 H 50 Z\" fill=\"none\" stroke=\"black\"/></svg>\n";
    fs::write(folder.join("plan.svg"), svg).expect("a plan");
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
        let camera = map_from_camera("here.jpg");
        let (at, ahead) = (camera.translation.vector, camera.rotation * Vector3::z());
        let found = [at.x, at.y, at.z, ahead.y.atan2(ahead.x).to_degrees()];
        assert!(found.iter().zip([3.23, 0.76, 1.45, 56.0]).all(|(f, s)| (f - s).abs() < 0.006), "{found:?}");
    }
}
