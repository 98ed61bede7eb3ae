//! The visibility area of one landmark.

use crate::{
    check::OutOfRange,
    place::LandmarkPlace,
    visibility::{
        limits::Limits,
        local_frame::{LocalFrame, Moved},
        obstacle::Obstacle,
        outline::{Polygon, distance_to_segment, measure, outline},
        quadrants::{Quadrant, contains, quadrants},
        settings::{PanTiltCamera, VisibilityParams},
    },
};
use nalgebra::Point2;

/// Most obstacles of one landmark's area; of more, the nearest.
pub const MAX_OBSTACLES: usize = 20_000;

/// The visibility area of one landmark.
#[derive(Debug, Clone, PartialEq)]
pub struct VisibilityMap {
    pub(super) frame: LocalFrame,
    /// Centre of the landmark on the floor, metres, map frame.
    pub(super) centre: Point2<f64>,
    /// Pan range of the camera, radians.
    pub(super) pan_rad: [f64; 2],
    /// Bounds of the area over direction.
    pub(super) quadrants: [Quadrant; 4],
    pub(super) polygons: Vec<Polygon>,
    pub(super) area_m2: f64,
    pub(super) centroid: Option<Point2<f64>>,
    pub(super) reach_m: f64,
    pub(super) obstacles: Vec<Obstacle>,
}

// Departs from method 12: no polygon Booleans, see the module `visibility`; the area is the same.
// Free space is not an input, since walls hide what they enclose. Every condition applies to the
// landmark moved off its wall, not only occlusion: a difference of 5 cm.
/// The visibility area of a landmark among `obstacles`: `O(M log M)` in those within reach.
///
/// A landmark that an obstacle cuts is visible from nowhere, and so is one that the camera cannot
/// show large enough or as a whole. Its roll is ignored.
pub fn visibility(
    place: &LandmarkPlace,
    obstacles: &[Obstacle],
    viewer: &PanTiltCamera,
    p: &VisibilityParams,
) -> Result<VisibilityMap, OutOfRange> {
    place.check()?;
    viewer.check()?;
    p.check()?;
    let frame = LocalFrame::new(place, p.standoff_m);
    let moved = Moved::new(place, p.standoff_m);
    let limits = Limits::new(&moved, viewer, p);
    let mut made = VisibilityMap {
        frame,
        centre: Point2::new(place.x_m, place.y_m),
        pan_rad: viewer.pan_rad,
        quadrants: Default::default(),
        polygons: Vec::new(),
        area_m2: 0.0,
        centroid: None,
        reach_m: limits.as_ref().map_or(0.0, Limits::reach_m),
        obstacles: within_reach(place, obstacles, viewer, p),
    };
    let Some(limits) = limits else { return Ok(made) };
    let footprint = moved.footprint();
    let local: Vec<_> = made.obstacles.iter().map(|o| (frame.local(&o.a), frame.local(&o.b))).collect();
    if local.iter().any(|(a, b)| footprint.touches(a, b)) {
        return Ok(made);
    }
    made.quadrants = quadrants(&limits, &footprint, &local);
    made.polygons = outline(&frame, &made.quadrants);
    (made.area_m2, made.centroid) = measure(&made.polygons);
    Ok(made)
}

/// The obstacles that can affect a landmark's area, in the order given: the area changes only if
/// they do.
pub fn within_reach(
    place: &LandmarkPlace,
    obstacles: &[Obstacle],
    viewer: &PanTiltCamera,
    p: &VisibilityParams,
) -> Vec<Obstacle> {
    let frame = LocalFrame::new(place, p.standoff_m);
    let moved = Moved::new(place, p.standoff_m);
    let Some(reach_m) = Limits::new(&moved, viewer, p).map(|l| l.reach_m()) else { return Vec::new() };
    let behind = if moved.tilt_rad.abs() > 0.0 { -reach_m } else { 0.0 };
    let mut near: Vec<(f64, &Obstacle)> = obstacles
        .iter()
        .filter(|o| o.hides(place, viewer))
        .filter_map(|o| {
            let (a, b) = (frame.local(&o.a), frame.local(&o.b));
            let distance = distance_to_segment(&Point2::origin(), &a, &b);
            (a.x.max(b.x) >= behind && distance <= reach_m).then_some((distance, o))
        })
        .collect();
    if near.len() > MAX_OBSTACLES {
        near.sort_by(|a, b| a.0.total_cmp(&b.0));
        near.truncate(MAX_OBSTACLES);
    }
    near.into_iter().map(|(_, o)| *o).collect()
}

impl VisibilityMap {
    /// The area as disjoint polygons, counter-clockwise.
    pub fn polygons(&self) -> &[Polygon] {
        &self.polygons
    }

    /// Size of the area, square metres; 0 when the landmark is visible from nowhere.
    pub fn area_m2(&self) -> f64 {
        self.area_m2
    }

    /// Centroid of the area, which may lie outside of it; `None` without an area.
    pub fn centroid(&self) -> Option<Point2<f64>> {
        self.centroid
    }

    /// Largest distance of the area from the landmark's centre, metres.
    pub fn reach_m(&self) -> f64 {
        self.reach_m
    }

    /// The obstacles that were considered ([`within_reach`]).
    pub fn obstacles(&self) -> &[Obstacle] {
        &self.obstacles
    }

    /// Whether the landmark is visible for a camera at a point.
    pub fn contains(&self, camera: &Point2<f64>) -> bool {
        let q = self.frame.local(camera);
        !self.polygons.is_empty() && q.coords.norm() <= self.reach_m && contains(&self.quadrants, &q)
    }

    /// Distance to the boundary of the area, metres, positive inside; minus infinity without an
    /// area.
    pub fn margin_m(&self, camera: &Point2<f64>) -> f64 {
        let distance =
            self.polygons.iter().map(|p| p.boundary_distance_m(camera)).fold(f64::INFINITY, f64::min);
        if self.contains(camera) { distance } else { -distance }
    }
}
