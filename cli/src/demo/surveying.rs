//! The demo's first part with `--survey`: a robot that knows neither walls nor landmarks drives
//! once there and back, and the server gets what it found.

use super::{MAP, teaching::Taught};
use crate::{
    screen,
    survey::{SimulatedDrive, report::SurveyReport, simulated_drive, surveyed, upload::upload},
};
use client::{MapClient, api::LandmarkStatus};
use server::RunningServer;
use sim::{building::Building, drive::DriveParams};
use std::{collections::BTreeMap, sync::Arc};
use vision::params::Params;

/// Surveys the building, and uploads walls, landmarks and views.
pub(super) async fn survey(
    building: &Arc<Building>,
    server: &RunningServer,
    (seed, rate_hz): (u64, f64),
) -> anyhow::Result<Taught> {
    let maps = MapClient::new(&format!("http://{}", server.http_addr))?;
    let (drive, through) =
        (DriveParams { seed, legs: 2, rate_hz, ..DriveParams::default() }, building.clone());
    let work = move || {
        let steps = screen::progress(0, "first drive");
        let mut path = Vec::new();
        let SimulatedDrive { log, .. } = simulated_drive(&through, drive, seed, |readings| {
            path.push(readings.step.map_from_robot.position().into());
            steps.inc(1);
        })?;
        steps.finish_and_clear();
        // As of a building that nobody has a plan of; then laid on it, to show how well robots find
        // their way.
        let logs = vec![log];
        let found = surveyed(&logs, None, &Params::default())?.laid_on_path(&path);
        anyhow::Ok((logs, found))
    };
    let (logs, found) = tokio::task::spawn_blocking(work).await??;
    let landmarks = upload(&maps, MAP, &logs, &found).await?;
    screen::complain(&SurveyReport::new(&logs, &found, Some((MAP, &landmarks)), BTreeMap::new()).text());
    let active = landmarks.iter().filter(|landmark| landmark.status == LandmarkStatus::Active);
    Ok(Taught {
        walls: found.walls.len(),
        landmarks: landmarks.len(),
        active: active.count(),
        views: landmarks.iter().map(|landmark| landmark.views as usize).sum(),
        ..Taught::default()
    })
}
