//! What a survey found, for people and for programs.

use super::drive_log::DriveLog;
use crate::screen::{Table, counted};
use client::api::Landmark;
use engine::survey::{SurveyedBuilding, SurveyedObject};
use serde::Serialize;
use std::{collections::BTreeMap, fmt::Write as _};

/// A landmark.
#[derive(Debug, Serialize)]
struct LandmarkLine {
    /// At the server; none where nothing was sent.
    name: Option<String>,
    /// Centre (metres) and direction of the normal (radians), map frame.
    x_m: f64,
    y_m: f64,
    z_m: f64,
    theta_rad: f64,
    /// Standard deviation of the centre on the floor, metres.
    sigma_m: f64,
    width_m: f64,
    height_m: f64,
    views: usize,
    /// Why it is no landmark.
    refused: Option<String>,
}

/// The camera as found, against the stated one: standard deviations follow each value.
#[derive(Debug, Serialize)]
struct CameraLine {
    turned_deg: [f64; 3],
    turned_sigma_deg: [f64; 3],
    moved_m: [f64; 3],
    moved_sigma_m: [f64; 3],
    focal_percent: f64,
    focal_sigma_percent: f64,
}

/// What a survey found.
#[derive(Debug, Serialize)]
pub(crate) struct SurveyReport {
    scans: usize,
    frames: usize,
    walls: usize,
    loops: usize,
    distance_m: f64,
    odometry_scale_percent: Vec<f64>,
    camera: CameraLine,
    landmarks: Vec<LandmarkLine>,
    map: Option<String>,
    /// Landmarks that the server uses.
    in_use: Option<usize>,
    /// What of the file was not used: how often, and the first in words.
    problems: BTreeMap<String, (u64, String)>,
}

impl SurveyReport {
    pub(crate) fn new(
        logs: &[DriveLog],
        building: &SurveyedBuilding,
        sent: Option<(&str, &[Landmark])>,
        mut problems: BTreeMap<String, (u64, String)>,
    ) -> Self {
        if building.undecodable > 0 {
            let first = "an image that cannot be decoded".to_owned();
            problems.insert("bad_image".to_owned(), (building.undecodable as u64, first));
        }
        let mut number = 0;
        let line = |object: &SurveyedObject| {
            number += usize::from(object.refused.is_none());
            let name = sent.filter(|_| object.refused.is_none()).map(|(map, _)| format!("{map}-{number:02}"));
            let place = &object.place;
            LandmarkLine {
                name,
                x_m: place.x_m,
                y_m: place.y_m,
                z_m: place.z_m,
                theta_rad: place.theta_rad,
                sigma_m: (place.covariance[(0, 0)] + place.covariance[(1, 1)]).sqrt(),
                width_m: place.size.width_m,
                height_m: place.size.height_m,
                views: object.views.len(),
                refused: object.refused.clone(),
            }
        };
        let landmarks = building.objects.iter().map(line).collect();
        let scans = || logs.iter().flat_map(|log| log.drive.scans.windows(2));
        let steps = scans().map(|pair| pair[0].odom.between(&pair[1].odom).position().norm());
        let active = |landmark: &&Landmark| landmark.status == client::api::LandmarkStatus::Active;
        Self {
            scans: logs.iter().map(|log| log.scans.len()).sum(),
            frames: logs.iter().map(|log| log.drive.frames.len()).sum(),
            walls: building.walls.len(),
            loops: building.loops,
            distance_m: steps.sum(),
            odometry_scale_percent: building.odometry_scales.iter().map(|scale| 100.0 * scale).collect(),
            camera: camera(building),
            landmarks,
            map: sent.map(|(map, _)| map.to_owned()),
            in_use: sent.map(|(_, landmarks)| landmarks.iter().filter(active).count()),
            problems,
        }
    }

    pub(crate) fn text(&self) -> String {
        let scales = self.odometry_scale_percent.iter().map(|scale| format!("{scale:+.1}"));
        let mut text = format!(
            "{} scans and {} frames over {:.0} m: {}, {}; odometry is {} % off\n",
            self.scans,
            self.frames,
            self.distance_m,
            counted(self.walls as u64, "wall"),
            counted(self.loops as u64, "loop closure"),
            scales.collect::<Vec<_>>().join(", ")
        );
        let c = &self.camera;
        let with = |values: &[f64; 3], sigmas: &[f64; 3], scale: f64| {
            let each =
                values.iter().zip(sigmas).map(|(v, s)| format!("{:+.2} ± {:.2}", v * scale, s * scale));
            each.collect::<Vec<_>>().join(", ")
        };
        writeln!(
            text,
            "camera against its stated mounting: turned by {} deg, moved by {} cm, focal length {:+.2} ± {:.2} %",
            with(&c.turned_deg, &c.turned_sigma_deg, 1.0),
            with(&c.moved_m, &c.moved_sigma_m, 100.0),
            c.focal_percent,
            c.focal_sigma_percent
        )
        .ok();
        let rows: Vec<&LandmarkLine> = self.landmarks.iter().collect();
        let table = Table::of(
            ["landmark", "x, y, z in m", "±", "size in m", "views", ""],
            &rows,
            |landmark: &&LandmarkLine| {
                [
                    landmark.name.clone().unwrap_or_else(|| "-".to_owned()),
                    format!("{:.2}, {:.2}, {:.2}", landmark.x_m, landmark.y_m, landmark.z_m),
                    format!("{:.2}", landmark.sigma_m),
                    format!("{:.2} x {:.2}", landmark.width_m, landmark.height_m),
                    landmark.views.to_string(),
                    landmark.refused.as_ref().map_or_else(String::new, |why| format!("left out: {why}")),
                ]
            },
        );
        text += &table.text();
        for (count, first) in self.problems.values() {
            write!(text, "\nnot used: {count} times {first}").ok();
        }
        if let (Some(map), Some(in_use)) = (&self.map, self.in_use) {
            write!(
                text,
                "\n{map}: {} in use. `waymark open` shows the map.",
                counted(in_use as u64, "landmark")
            )
            .ok();
        }
        text
    }
}

fn camera(building: &SurveyedBuilding) -> CameraLine {
    let (found, sigmas) = &building.camera;
    let d = found.minus(&building.stated);
    let three = |from: usize, scale: f64| [0, 1, 2].map(|i| d[from + i] * scale);
    let sigma = |from: usize, scale: f64| [0, 1, 2].map(|i| sigmas[from + i] * scale);
    let degrees = 1.0_f64.to_degrees();
    CameraLine {
        turned_deg: three(0, degrees),
        turned_sigma_deg: sigma(0, degrees),
        moved_m: three(3, 1.0),
        moved_sigma_m: sigma(3, 1.0),
        focal_percent: 100.0 * d[6] / building.stated.focal_px,
        focal_sigma_percent: 100.0 * sigmas[6] / building.stated.focal_px,
    }
}
