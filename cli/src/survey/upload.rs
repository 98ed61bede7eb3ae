//! Puts a surveyed building on a server: walls, then the views of each landmark with how each was
//! taken. The server places the landmarks by them, and learns them.

use super::drive_log::{DriveLog, frame_of};
use crate::{
    failure::{Class, Failure},
    pictures, screen,
};
use anyhow::Context as _;
use client::{
    LandmarkRegion, MapClient, NewView,
    api::{CaptureMetadata, Job, Landmark, NewMap, WallBody, WallsBody},
    protos::convert::{
        frame::{Encoding, Pixels},
        geometry::{intrinsics_wire, pose2_covariance_wire, pose3_wire},
    },
};
use engine::survey::{DriveFrame, ObjectView, SurveyedBuilding, SurveyedObject, picture};
use std::time::Duration;

/// Most views of a landmark that are sent.
const MAX_VIEWS: usize = 12;
/// Longest wait for the lesson.
const LESSON_TIMEOUT: Duration = Duration::from_hours(1);

/// Makes the map, which must be new or empty, and fills it; the landmarks as the server has them.
pub(crate) async fn upload(
    maps: &MapClient,
    map: &str,
    logs: &[DriveLog],
    building: &SurveyedBuilding,
) -> anyhow::Result<Vec<Landmark>> {
    make_map(maps, map).await?;
    let wall = |wall: &map::segments::LaserSegment| {
        let c = wall.covariance_about_middle();
        let covariance = Some([c[(0, 0)], c[(0, 1)], c[(1, 1)]]);
        WallBody { a: wall.a.into(), b: wall.b.into(), covariance }
    };
    maps.set_walls(map, &WallsBody { segments: building.walls.iter().map(wall).collect() }).await?;
    let accepted = || building.objects.iter().filter(|object| object.refused.is_none());
    let progress = screen::progress(accepted().count(), "sending");
    for (number, object) in accepted().enumerate() {
        let name = format!("{map}-{:02}", number + 1);
        for view in spread(object) {
            let new = new_view(logs, building, view)?.or_make_landmark(None);
            maps.upload_view_with(map, &name, NewView { keep_near_duplicate: true, ..new }).await?;
        }
        progress.inc(1);
    }
    progress.finish_and_clear();
    if accepted().next().is_none() {
        return Ok(Vec::new());
    }
    let job = maps.learn(map, None, None).await?;
    let bar = screen::progress(1000, "learning");
    let learnt = |job: &Job| bar.set_position((job.progress * 1000.0) as u64);
    maps.wait_for_job(job, LESSON_TIMEOUT, learnt).await?;
    bar.finish_and_clear();
    Ok(maps.landmarks(map).await?)
}

async fn make_map(maps: &MapClient, map: &str) -> anyhow::Result<()> {
    if !maps.maps().await?.iter().any(|known| known.name == map) {
        maps.create_map(&NewMap::new(map)).await?;
        return Ok(());
    }
    let has_walls = !maps.walls(map).await?.segments.is_empty();
    if has_walls || !maps.landmarks(map).await?.is_empty() {
        let sentence = format!("Map `{map}` is not empty; nothing is changed.");
        let advice = "A survey makes a map: name one that is new. `waymark map diff` compares two.";
        return Err(Failure::new(Class::Conflict, "not_empty", sentence).advise(advice).into());
    }
    Ok(())
}

/// Views spread over the drive.
fn spread(object: &SurveyedObject) -> impl Iterator<Item = &ObjectView> {
    let every = object.views.len().div_ceil(MAX_VIEWS).max(1);
    object.views.iter().step_by(every)
}

fn new_view(logs: &[DriveLog], building: &SurveyedBuilding, view: &ObjectView) -> anyhow::Result<NewView> {
    let taken = frame_of(logs, view.frame).context("a view of no frame")?;
    let DriveFrame { frame, .. } = taken;
    let camera = frame.intrinsics.as_ref().context("a frame without intrinsics")?;
    let mounting = frame.mounting.as_ref().context("a frame without a mounting")?;
    let image = match &frame.pixels {
        Pixels::Image(sent) if matches!(sent.encoding, Encoding::Jpeg | Encoding::Png) => sent.bytes.to_vec(),
        _ => pictures::photograph_jpeg(picture(taken)?.grey())?,
    };
    let variances = |c: &nalgebra::Matrix2<f64>| [c[(0, 0)], c[(0, 1)], c[(1, 1)]];
    let capture = CaptureMetadata {
        intrinsics: intrinsics_wire(&building.intrinsics(camera)),
        map_from_robot: pose2_covariance_wire(&building.frames[view.frame]),
        robot_from_camera: pose3_wire(&building.mounting(&mounting.robot_from_camera)),
        ceiling_height_m: None,
        corner_covariance_px2: Some(view.covariance_px2.each_ref().map(variances)),
    };
    let region = LandmarkRegion::Corners(view.corners_px.into());
    Ok(NewView { capture: Some(capture), ..NewView::new(image, region) })
}
