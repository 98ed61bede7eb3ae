//! Rendered frames of a corridor with posters, with their truth, as files in the evaluation format.

use crate::pictures;
use sim::{
    building::Building,
    camera::Camera,
    export::{CameraEntry, DataSet, ImageEntry, Labels, TeachEntry, sizes_m},
    lesson::{LessonParams, stops},
    robot::{Robot, RobotParams, SensorReadings},
};
use std::{fs, path::Path, sync::Arc};
use vision::frame::GrayImage;

/// A grey image as a PNG file.
pub fn png(image: &GrayImage) -> Vec<u8> {
    pictures::png(image.width(), image.height(), image.data())
}

/// Readings in front of every poster from `views` viewpoints, each with the poster's name.
pub fn views(building: &Arc<Building>, params: &LessonParams) -> Vec<(String, SensorReadings)> {
    let mut robot = Robot::new(building.clone(), &RobotParams::default());
    let measure = |stop: sim::lesson::Stop| {
        let readings = robot.look(&stop.step);
        (stop.landmark, readings)
    };
    stops(building, params).into_iter().map(measure).collect()
}

/// Writes `truth.json`, the pictures, and the posters of `taught` as pictures to teach from. Quads
/// with a side shorter than `min_side_px` are not labelled.
pub fn write_set(
    folder: &Path,
    building: &Building,
    views: &[(String, SensorReadings)],
    taught: &[String],
    min_side_px: f64,
) -> DataSet {
    let labels = Labels { taught, min_side_px, complete: true };
    let mut images = Vec::new();
    for (number, (_, readings)) in views.iter().enumerate() {
        let file = format!("frame-{number:02}.png");
        fs::write(folder.join(&file), png(&readings.frame.image)).expect("picture");
        images.push(ImageEntry::new(&file, Some("rendered"), &readings.frame.truth, &labels));
    }
    let mut teach = Vec::new();
    for name in taught {
        let surface = building.surfaces().iter().find(|s| s.name == *name).expect("a poster");
        let (texture, file) = (&surface.texture, format!("{name}.png"));
        let picture = pictures::png(texture.width(), texture.height(), texture.data());
        fs::write(folder.join(&file), picture).expect("poster");
        teach.push(TeachEntry { file, landmark: name.clone() });
    }
    let set = DataSet {
        name: "rendered".into(),
        camera: Some(CameraEntry::new(&Camera::vga())),
        sizes_m: sizes_m(building),
        teach,
        same: Vec::new(),
        images,
    };
    save(folder, &set);
    set
}

/// Writes `truth.json` alone.
pub fn save(folder: &Path, set: &DataSet) {
    fs::write(folder.join("truth.json"), serde_json::to_vec(set).expect("JSON")).expect("truth.json");
}
