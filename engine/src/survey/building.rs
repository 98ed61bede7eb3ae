//! The map of drives: walls, objects and camera in one estimate. In: the drives. Out: the walls,
//! the objects with their places and views, the camera as it was found, and what each object fails.

use super::{
    drive::Drive,
    error::SurveyError,
    follow::{Followed, Stated, followed, solved},
    identities::pairs,
    look_alikes::refuse_look_alikes,
    objects::SeenObject,
    parallel::Effort,
    solution::building,
    surveyed::SurveyedBuilding,
};
use map::{
    joint::{Datum, JointLaserMap},
    pose2::{Pose2, Pose2Covariance},
    slam::SlamMap,
};
use nalgebra::Matrix3;
use std::borrow::Cow;
use vision::{frame::Intrinsics, params::Params};

/// Surveys drives of one robot, each with the laser map that its scans made. `origin` is the first
/// pose of the first where it is known in the frame of the map; else the map begins at (0, 0, 0),
/// and covariances are relative to the drives as a whole. Later drives begin anywhere.
pub fn surveyed(
    drives: &[Drive],
    slams: Vec<SlamMap>,
    origin: Option<&Pose2>,
    (params, effort): (&Params, Effort<'_>),
) -> Result<SurveyedBuilding, SurveyError> {
    let datum = if origin.is_some() { Datum::FirstPose } else { Datum::WholeDrive };
    let slams: Vec<SlamMap> = slams
        .into_iter()
        .enumerate()
        .map(|(number, slam)| match origin.filter(|_| number == 0) {
            Some(origin) => beginning_at(slam, origin),
            None => beginning_at(slam, &Pose2::default()),
        })
        .collect();
    if drives.is_empty() || drives.len() != slams.len() {
        return Err(SurveyError::NoFrame);
    }
    let at = |number: usize| {
        move |error| if drives.len() == 1 { error } else { SurveyError::Of(number + 1, Box::new(error)) }
    };
    for (number, (drive, slam)) in drives.iter().zip(&slams).enumerate() {
        check(drive, slam).map_err(at(number))?;
    }
    let stated = Stated::of(&drives[0]).map_err(at(0))?;
    let mut all = Vec::new();
    for (number, of) in drives.iter().zip(&slams).enumerate() {
        if !has_camera(of.0, &stated.intrinsics) {
            return Err(at(number)(SurveyError::OtherCamera));
        }
        all.push(followed(of, &stated, datum, (params, effort)).map_err(at(number))?);
    }
    let mut made = together(&all, &stated, datum, (params, effort))?;
    refuse_look_alikes(&joined(drives), &mut made, (params, effort));
    Ok(made)
}

fn check(drive: &Drive, slam: &SlamMap) -> Result<(), SurveyError> {
    if drive.scans.is_empty() || drive.scans.len() != slam.path.len() {
        return Err(SurveyError::Scans(drive.scans.len(), slam.path.len()));
    }
    match drive.scans.windows(2).position(|pair| pair[1].captured_ns <= pair[0].captured_ns) {
        Some(i) => Err(SurveyError::Times(i + 1)),
        None => Ok(()),
    }
}

/// Whether all frames are of this camera; how well it is known may be stated otherwise.
fn has_camera(drive: &Drive, camera: &Intrinsics) -> bool {
    let plain = |of: &Intrinsics| Intrinsics { sigmas: None, ..*of };
    let of = |intrinsics: &Option<Intrinsics>| intrinsics.as_ref().map(plain);
    drive.frames.iter().all(|frame| of(&frame.frame.intrinsics).is_none_or(|of| of == plain(camera)))
}

/// The map in a frame where its first pose is `origin`.
fn beginning_at(mut map: SlamMap, origin: &Pose2) -> SlamMap {
    // A definition: it adds no error.
    let by = Pose2Covariance { pose: *origin, covariance: Matrix3::zeros() };
    map.path.iter_mut().for_each(|pose| *pose = origin.compose(pose));
    map.keys.iter_mut().for_each(|key| key.pose.pose = origin.compose(&key.pose.pose));
    map.walls.iter_mut().for_each(|wall| *wall = wall.transformed(&by));
    map
}

/// All drives in one estimate.
fn together(
    all: &[Followed<'_>],
    stated: &Stated,
    datum: Datum,
    (params, effort): (&Params, Effort<'_>),
) -> Result<SurveyedBuilding, SurveyError> {
    let [first, ..] = all else { return Err(SurveyError::NoFrame) };
    let (found, map) = if all.len() == 1 {
        (first.found.clone(), Cow::Borrowed(&first.map))
    } else {
        let same = pairs(all, stated, (params, effort));
        let drives: Vec<_> = all.iter().map(|of| (of.drive, of.slam, of.found.as_slice())).collect();
        let mut map = solved(&drives, &same, stated, datum)?;
        (one_of_each(numbered_through(all), &mut map), Cow::Owned(map))
    };
    Ok(SurveyedBuilding {
        laser_walls: first.slam.walls.clone(),
        laser_frames: first.laser_frames.clone(),
        loops: all.iter().map(|of| of.slam.loops.len()).sum(),
        undecodable: all.iter().map(|of| of.undecodable).sum(),
        ..building(found, &map, stated)
    })
}

/// Objects of all drives, their frames numbered through.
fn numbered_through(all: &[Followed<'_>]) -> Vec<SeenObject> {
    let mut first = 0;
    let mut found = Vec::new();
    for of in all {
        found.extend(of.found.iter().cloned().map(|mut object| {
            object.views.iter_mut().for_each(|view| view.frame += first);
            object
        }));
        first += of.drive.frames.len();
    }
    found
}

/// Objects that are one get the place of the earliest and the views of all.
fn one_of_each(mut found: Vec<SeenObject>, map: &mut JointLaserMap) -> Vec<SeenObject> {
    for &[earlier, later] in &map.same {
        let views = std::mem::take(&mut found[later].views);
        found[earlier].views.extend(views);
        map.objects[later] = None;
    }
    found
}

/// All drives as one: their frames, one drive after the other.
fn joined(drives: &[Drive]) -> Cow<'_, Drive> {
    if let [only] = drives {
        return Cow::Borrowed(only);
    }
    let mut all = Drive::default();
    for drive in drives {
        all.scans.extend_from_slice(&drive.scans);
        all.frames.extend_from_slice(&drive.frames);
    }
    Cow::Owned(all)
}

#[cfg(test)]
mod tests {
    use super::{super::drive::ScanStamp, *};
    use map::segments::LaserSegment;
    use nalgebra::{Point2, Vector2};

    #[test]
    fn a_drive_whose_scans_go_back_in_time_is_refused() {
        let (told, params) = (|_: &'static str, _: usize, _: usize| {}, Params::default());
        let effort = Effort { threads: std::num::NonZeroUsize::MIN, told: &told };
        let drive = |times: &[i64]| {
            let stamp = |captured_ns: &i64| ScanStamp { captured_ns: *captured_ns, odom: Pose2::default() };
            let drive = Drive { scans: times.iter().map(stamp).collect(), frames: Vec::new() };
            let path = vec![Pose2::default(); times.len()];
            (drive, SlamMap { path, keys: Vec::new(), loops: Vec::new(), refused: 0, walls: Vec::new() })
        };
        let surveyed_at = |times: &[&[i64]]| {
            let (drives, slams): (Vec<Drive>, Vec<SlamMap>) = times.iter().map(|of| drive(of)).unzip();
            surveyed(&drives, slams, None, (&params, effort)).unwrap_err()
        };
        assert_eq!(surveyed_at(&[&[]]), SurveyError::Scans(0, 0));
        assert_eq!(surveyed_at(&[&[5, 9, 8]]), SurveyError::Times(2));
        assert_eq!(surveyed_at(&[&[0, 0]]), SurveyError::Times(1));
        assert_eq!(surveyed_at(&[&[5, 9]]), SurveyError::NoFrame);
        assert_eq!(surveyed_at(&[]), SurveyError::NoFrame);
        let second = surveyed_at(&[&[5, 9], &[0, 0]]);
        assert_eq!(second, SurveyError::Of(2, Box::new(SurveyError::Times(1))));
        assert!(second.to_string().starts_with("drive 2: the capture time"), "{second}");
    }

    #[test]
    fn a_map_begins_where_it_is_told_to() {
        let laser = SlamMap {
            path: vec![Pose2::default(), Pose2::new(1.0, 0.0, 0.0)],
            keys: Vec::new(),
            loops: Vec::new(),
            refused: 0,
            walls: vec![LaserSegment::by_hand(&[0.0, 1.0, 2.0, 1.0]).unwrap()],
        };
        let made = beginning_at(laser, &Pose2::new(5.0, 1.0, std::f64::consts::FRAC_PI_2));
        assert!((made.path[1].position() - Vector2::new(5.0, 2.0)).norm() < 1e-9, "{:?}", made.path);
        assert!((made.walls[0].a - Point2::new(4.0, 1.0)).norm() < 1e-9, "{:?}", made.walls[0]);
        assert!((made.walls[0].b - Point2::new(4.0, 3.0)).norm() < 1e-9, "{:?}", made.walls[0]);
    }
}
