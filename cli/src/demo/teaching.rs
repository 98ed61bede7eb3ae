//! The demo's first part: teaches the server over HTTP what the robot of the first drive measured
//! (`cli/first_drive.rs`).

use super::MAP;
use crate::{
    first_drive::{first_drive, known_poses, place_on_walls},
    pictures, screen,
    simulated_errors::SimulatedRobotErrors,
};
use client::{
    LandmarkRegion, MapClient,
    api::{Job, LandmarkStatus, NewMap, Place, Size, WallsBody},
};
use server::RunningServer;
use sim::{
    building::Building,
    lesson::{LessonParams, stops},
    robot::{Robot, RobotParams},
};
use std::{sync::Arc, time::Duration};
use vision::detect::DetectParams;

/// Longest wait for the lesson.
const LESSON_TIMEOUT: Duration = Duration::from_mins(10);

/// What was taught.
#[derive(Debug, Default)]
pub(super) struct Taught {
    pub(super) walls: usize,
    pub(super) landmarks: usize,
    pub(super) active: usize,
    pub(super) views: usize,
    /// Frames of a poster in which the detector did not find it.
    pub(super) views_missed: usize,
    /// Views whose rectangle on the wall disagrees with the others'.
    pub(super) views_left_out: usize,
}

/// Surveys the building, and uploads walls, landmarks and views.
pub(super) async fn teach(
    building: &Arc<Building>,
    server: &RunningServer,
    seed: u64,
) -> anyhow::Result<Taught> {
    let maps = MapClient::new(&format!("http://{}", server.http_addr))?;
    maps.create_map(&NewMap::new(MAP)).await?;
    let robot = Robot::new(building.clone(), &RobotParams::default());
    let camera = *robot.camera().intrinsics();
    let stops = known_poses(stops(building, &LessonParams { seed, ..LessonParams::default() }));
    let exact = SimulatedRobotErrors::none(&camera);
    let work = move || first_drive(robot, &stops, &exact, &DetectParams::default());
    let driven = tokio::task::spawn_blocking(work).await??;

    let mut taught = Taught { walls: driven.walls.len(), views_missed: driven.missed, ..Taught::default() };
    let walls: WallsBody = driven.walls.iter().map(|w| [w.a.into(), w.b.into()]).collect();
    maps.set_walls(MAP, &walls).await?;
    let progress = screen::progress(driven.views.values().map(Vec::len).sum(), "teaching");
    for (name, views) in &driven.views {
        taught.landmarks += 1;
        let Some((place, agreed)) = place_on_walls(views, &driven.walls, &camera) else {
            screen::complain(&format!("{name} is on no wall of the laser's; it is left out"));
            continue;
        };
        let size = Size { width_m: place.size.width_m, height_m: place.size.height_m };
        let place = Place {
            x_m: place.x_m,
            y_m: place.y_m,
            z_m: place.z_m,
            theta_rad: place.theta_rad,
            ..Place::default()
        };
        maps.add_landmark(MAP, name, Some(size), Some(place)).await?;
        taught.views_left_out += views.len() - agreed.len();
        for view in agreed.iter().map(|&i| &views[i]) {
            let region = LandmarkRegion::Corners(view.quad.corners_px.into());
            let jpeg = pictures::jpeg(&view.readings.frame.image)?;
            maps.upload_view(MAP, name, jpeg, region).await?;
            taught.views += 1;
            progress.inc(1);
        }
    }
    progress.finish_and_clear();
    let job = maps.learn(MAP, None, None).await?;
    let bar = screen::progress(1000, "learning");
    maps.wait_for_job(job, LESSON_TIMEOUT, |job: &Job| bar.set_position((job.progress * 1000.0) as u64))
        .await?;
    bar.finish_and_clear();
    for landmark in maps.landmarks(MAP).await? {
        if landmark.status == LandmarkStatus::Active {
            taught.active += 1;
        } else {
            let reasons: Vec<String> = landmark.failed_gates.iter().map(ToString::to_string).collect();
            screen::complain(&format!("{} is not in use: {}", landmark.name, reasons.join("; ")));
        }
    }
    Ok(taught)
}
