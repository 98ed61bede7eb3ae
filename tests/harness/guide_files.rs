//! The files that the guides name: those of `waymark sample`, and what only the tests need beside
//! them.

use crate::{
    bag,
    scenes::{self, png},
};
use image::{ExtendedColorType, codecs::jpeg::JpegEncoder};
use map::pose2::Pose2;
use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use sim::{
    building::Building,
    laser::{LaserParams, scan},
    lesson::LessonParams,
    office::{self, PHOTOGRAPHS, Standpoint, camera, office, photograph},
    render::Renderer,
};
use std::{fs, path::Path, sync::Arc};
use vision::frame::GrayImage;

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
    for (number, standpoint) in (0_u64..).zip(office::around()) {
        let image = photograph(&mut renderer, &building, &standpoint, 100 + number);
        fs::write(pictures.join(format!("{number}.png")), png(&image)).expect("a photograph");
    }
    hall(&folder.join("my-hall"), &building);
    fs::write(folder.join("drive.log"), office::laser_log(&building)).expect("a laser log");
    for (name, content) in office::floor_plans(&building) {
        fs::write(folder.join(name), content).expect("a plan");
    }
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
    office::map_from_camera(name).expect("a photograph")
}

/// What a robot below the camera measured, whose odometry began at the map's origin.
fn stop(building: &Building, standpoint: &Standpoint, picture: GrayImage) -> bag::Stop {
    let map_from_camera = office::pose(building, standpoint);
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

pub(crate) fn jpeg(image: &GrayImage) -> Vec<u8> {
    let mut out = Vec::new();
    JpegEncoder::new_with_quality(&mut out, 92)
        .encode(image.data(), image.width() as u32, image.height() as u32, ExtendedColorType::L8)
        .expect("in memory");
    out
}
