//! The first map by a robot that knows neither walls nor landmarks: drives there and back, as
//! `waymark survey` takes them. In: the building. Out: walls, and the landmarks that passed its
//! gates, laid on the building by all drives, as a person lays a map on a floor plan.

use crate::evaluate::{experiment::mixed, survey::truth_at};
use cli::survey::{DriveLog, simulated_drive, surveyed};
use engine::survey::{ObjectView, SurveyedObject, picture};
use map::{place::LandmarkPlace, segments::LaserSegment};
use nalgebra::Point2;
use sim::{building::Building, drive::DriveParams};
use std::{collections::BTreeMap, sync::Arc};
use vision::{frame::GrayImage, geometry::Corners, params::Params};

/// A landmark of the first drives, with its photographs.
pub(super) struct Photographed {
    pub(super) name: String,
    pub(super) place: LandmarkPlace,
    pub(super) pictures: Vec<(GrayImage, Corners)>,
}

/// Walls and landmarks.
pub(super) type FirstMap = (Vec<LaserSegment>, Vec<Photographed>);

/// Surveys the building in so many drives of one robot; each landmark has at most so many
/// photographs.
pub(super) fn survey(
    building: &Arc<Building>,
    (drives, photographs): (usize, usize),
    seed: u64,
) -> anyhow::Result<FirstMap> {
    let mut truth = Vec::new();
    let mut drive = |number: u64| {
        let of_drive = if number == 0 { seed } else { mixed(&[seed, number]) };
        let params = DriveParams { seed: of_drive, legs: 2, ..DriveParams::default() };
        let driven = simulated_drive(building, params, seed, |readings| {
            truth.push(Point2::from(readings.step.map_from_robot.position()));
        });
        Ok(driven?.log)
    };
    let logs = (0..drives as u64).map(&mut drive).collect::<anyhow::Result<Vec<DriveLog>>>()?;
    let found = surveyed(&logs, None, &Params::default())?.laid_on_path(&truth);
    let frames: Vec<_> = logs.iter().flat_map(|log| &log.drive.frames).collect();
    let mut named: BTreeMap<String, Photographed> = BTreeMap::new();
    let accepted = found.objects.iter().filter(|object| object.refused.is_none());
    for (number, SurveyedObject { place, views, .. }) in accepted.enumerate() {
        let truth = truth_at(building, place);
        let name = truth.map_or_else(|| format!("other-{number}"), |truth| truth.name.clone());
        let every = views.len().div_ceil(photographs).max(1);
        let photograph = |view: &ObjectView| {
            let seen = picture(frames[view.frame]).ok()?;
            Some((seen.grey().clone(), view.corners_px))
        };
        let pictures = views.iter().step_by(every).filter_map(photograph).collect();
        named.insert(name.clone(), Photographed { name, place: *place, pictures });
    }
    Ok((found.walls, named.into_values().collect()))
}
