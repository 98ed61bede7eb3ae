//! Which quads of a drive are one object. In: the sightings of each frame, and where walls, camera
//! and frames are by the last solution. Out: objects with their views and the wall of each.
//!
//! A quad has a place where it lies on a wall; sightings of one place and appearance are one object
//! (`map::tracks`), whatever passage they are of. Its views are cut along the border of the first.

use super::{
    drive::Drive,
    parallel::Effort,
    sightings::{Sighting, picture},
};
use map::{
    extrinsics::CameraExtrinsics,
    joint::MappedWall,
    placement::{PlacementParams, PosedView, placement, view_on_wall},
    pose2::{Pose2, Pose2Covariance},
    segments::LaserSegment,
    tracks::{GatherParams, Identity, QuadObservation, TrackOutcome, ViewTracker},
};
use nalgebra::{Matrix2, Matrix3, Point2, Vector3};
use std::collections::BTreeMap;
use vision::{
    frame::Intrinsics,
    geometry::Corners,
    icon::Icon,
    learn::reference_border::reference_border,
    params::Params,
    seen_border::{FoundBy, SeenBorder},
};

/// How well neighbouring frames are known relative to each other: standard deviations of x and y
/// (metres) and heading (radians).
const NEAR_SIGMA: [f64; 3] = [0.02, 0.02, 0.005];
/// Sightings of an object before its first view: a place on a wall is evidence besides.
const MIN_SIGHTINGS: u32 = 2;
/// Fewest views of an object.
const MIN_VIEWS: usize = 3;
/// The tracker's name of the camera.
const CAMERA: &str = "camera";

/// A view of an object.
#[derive(Debug, Clone)]
pub struct ObjectView {
    /// Number of the frame.
    pub frame: usize,
    /// Corners in the image, px.
    pub corners_px: Corners,
    /// Their covariances, px^2.
    pub covariance_px2: [Matrix2<f64>; 4],
}

/// An object of a drive.
#[derive(Debug, Clone)]
pub(super) struct SeenObject {
    pub(super) views: Vec<ObjectView>,
    /// The wall of the laser map, and how far from its first end, metres.
    pub(super) on_wall: (usize, f64),
}

/// Walls, camera and frames as they are known so far.
#[derive(Debug, Clone)]
pub(super) struct Known {
    pub(super) walls: Vec<MappedWall>,
    /// `map_from_robot` of each frame.
    pub(super) frames: Vec<Pose2>,
    /// Mounting of each frame.
    pub(super) mountings: Vec<CameraExtrinsics>,
    pub(super) camera: Intrinsics,
}

/// Follows objects through the drive.
pub(super) fn objects(
    drive: &Drive,
    seen: &[Vec<Sighting>],
    known: &Known,
    (params, effort): (&Params, Effort<'_>),
) -> Vec<SeenObject> {
    let walls: Vec<LaserSegment> = known.walls.iter().map(|wall| wall.segment.clone()).collect();
    let mut tracker =
        ViewTracker::new(GatherParams { min_sightings: MIN_SIGHTINGS, ..GatherParams::default() });
    let mut kept: BTreeMap<u32, Kept> = BTreeMap::new();
    for (frame, sightings) in seen.iter().enumerate() {
        let placed: Vec<Observed> =
            sightings.iter().filter_map(|sighting| observed(frame, sighting, known, &walls)).collect();
        let quads: Vec<QuadObservation> = placed.iter().map(|(quad, ..)| quad.clone()).collect();
        let at = (drive.frames[frame].frame.captured_ns, CAMERA);
        let outcomes = tracker.update(at, &quads, |_| false, true, &params.recognise);
        for ((quad, covariance_px2, on_wall), outcome) in placed.into_iter().zip(outcomes) {
            let TrackOutcome::Keep(number) = outcome else { continue };
            let object = kept.entry(number).or_insert_with(|| Kept {
                reference: quad.icon.icon.clone(),
                views: Vec::new(),
                on_wall,
            });
            object.views.push(ObjectView { frame, corners_px: quad.corners_px, covariance_px2 });
        }
    }
    let objects = kept.into_values().filter(|object| object.views.len() >= MIN_VIEWS);
    along_first_border(drive, objects, (params, effort))
}

/// A sighting as the tracker takes it, its covariances, and its wall with the way along it.
type Observed = (QuadObservation, [Matrix2<f64>; 4], (usize, f64));

/// A followed object.
struct Kept {
    /// What its first view shows.
    reference: Icon,
    views: Vec<ObjectView>,
    on_wall: (usize, f64),
}

/// `None` where a sighting lies on no wall.
fn observed(frame: usize, sighting: &Sighting, known: &Known, walls: &[LaserSegment]) -> Option<Observed> {
    let sigmas = Vector3::from(NEAR_SIGMA);
    let covariance = Matrix3::from_diagonal(&sigmas.component_mul(&sigmas));
    let view = PosedView {
        corners: &sighting.corners_px,
        covariance_px2: &sighting.covariance_px2,
        camera: &known.camera,
        map_from_robot: &Pose2Covariance { pose: known.frames[frame], covariance },
        mounting: &known.mountings[frame],
    };
    let p = PlacementParams::default();
    let on_wall = view_on_wall(&view, walls, &p).ok()?;
    let wall = known.walls.get(on_wall.wall)?;
    let place = placement(&[on_wall], walls, &p).ok()?.place;
    let along_m = wall.segment.direction().dot(&(Point2::new(place.x_m, place.y_m) - wall.segment.a));
    let quad = QuadObservation {
        corners_px: sighting.corners_px,
        icon: sighting.icon.clone(),
        place: Some(place),
        identity: Identity::Stranger,
    };
    Some((quad, sighting.covariance_px2, (wall.of, wall.from_m + along_m)))
}

/// The objects with every view along the border of the first; views that show something else there
/// are left out.
fn along_first_border(
    drive: &Drive,
    objects: impl Iterator<Item = Kept>,
    (params, effort): (&Params, Effort<'_>),
) -> Vec<SeenObject> {
    let objects: Vec<Kept> = objects.collect();
    let mut by_frame: BTreeMap<usize, Vec<(usize, usize)>> = BTreeMap::new();
    for (object, kept) in objects.iter().enumerate() {
        for (view, at) in kept.views.iter().enumerate() {
            by_frame.entry(at.frame).or_default().push((object, view));
        }
    }
    let by_frame: Vec<(usize, Vec<(usize, usize)>)> = by_frame.into_iter().collect();
    let cut = effort.of_each(&by_frame, "borders", |_, (frame, views)| {
        let Ok(picture) = picture(&drive.frames[*frame]) else { return Vec::new() };
        let border = |&(object, view): &(usize, usize)| {
            let at = &objects[object].views[view];
            let (corners_px, covariance_px2) = (at.corners_px, at.covariance_px2);
            let detected = SeenBorder { corners_px, covariance_px2, found_by: FoundBy::Edges };
            let found = reference_border(picture.grey(), &detected, &objects[object].reference, params)?;
            Some((
                object,
                ObjectView {
                    frame: *frame,
                    corners_px: found.corners_px,
                    covariance_px2: found.covariance_px2,
                },
            ))
        };
        views.iter().filter_map(border).collect()
    });
    let mut made: Vec<SeenObject> =
        objects.iter().map(|kept| SeenObject { views: Vec::new(), on_wall: kept.on_wall }).collect();
    // In the order of frames.
    for (object, view) in cut.into_iter().flatten() {
        made[object].views.push(view);
    }
    made.retain(|object| object.views.len() >= MIN_VIEWS);
    made
}
