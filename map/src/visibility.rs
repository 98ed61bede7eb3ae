//! From where a landmark can be seen: the closed-form visibility map of method 12, for a landmark of any tilt: on a wall,
//! under a ceiling, on the floor, or leaning.
//!
//! In: the landmark's place, the walls and other obstacles, the camera that is to see it. Out: a multipolygon on the floor
//! with area and centroid, and tests of points and of uncertain poses against it. Says nothing of recognition.
//!
//! Seen from the middle of the landmark the area is a range of distances in every direction: whatever is seen from a point
//! is seen from everywhere between it and the landmark, but for what is too near. So penumbrae and limits become bounds
//! over direction (`envelope`), a quarter of all directions at a time, and no polygons are cut with each other.

mod chance;
mod coverage;
mod envelope;
mod geojson;
mod limits;
mod outline;
mod penumbra;
pub mod pointwise;
mod quarters;
mod rims;

pub use chance::{DRAWS, PoseDraws};
pub use coverage::{Coverage, Gap, MAX_STEPS, Seen, coverage};
pub use geojson::{Feature, Geometry, Properties};
pub use outline::Polygon;

use crate::{
    check::{self, OutOfRange},
    place::LandmarkPlace,
};
use limits::Limits;
use nalgebra::{Point2, Vector2};
use penumbra::Footprint;
use quarters::Quarter;
use serde::{Deserialize, Serialize};
use std::f64::consts::FRAC_PI_2;
use vision::pose::LandmarkSize;

/// Most obstacles of one landmark's map; of more, the nearest.
pub const MAX_OBSTACLES: usize = 20_000;
/// Tilted less, a landmark hangs on a wall: what is behind it hides nothing.
const UPRIGHT_RAD: f64 = 1e-9;

/// The camera that is to see landmarks.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Viewer {
    /// Focal length, pixels; 10 to 20 000.
    pub focal_px: f64,
    /// Width of the image, pixels; 16 to 20 000.
    pub width_px: f64,
    /// Height of the image, pixels; 16 to 20 000.
    pub height_px: f64,
    /// Height of the camera above the floor; 0 to 10 m.
    pub camera_height_m: f64,
    /// Lowest and highest tilt, up positive; within 89 degrees.
    pub tilt_rad: [f64; 2],
    /// Rightmost and leftmost pan, left positive; from -pi to pi is all round.
    pub pan_rad: [f64; 2],
}

impl Default for Viewer {
    /// 640 x 480, 64 degrees across, at 1.2 m on a unit that tilts by 20 and pans by 97 degrees.
    fn default() -> Self {
        Self {
            focal_px: 512.0,
            width_px: 640.0,
            height_px: 480.0,
            camera_height_m: 1.2,
            tilt_rad: [-0.35, 0.35],
            pan_rad: [-1.7, 1.7],
        }
    }
}

impl Viewer {
    /// Every number finite and in range.
    pub fn check(&self) -> Result<(), OutOfRange> {
        check::within("focal_px", self.focal_px, 10.0, 20_000.0)?;
        check::within("width_px", self.width_px, 16.0, 20_000.0)?;
        check::within("height_px", self.height_px, 16.0, 20_000.0)?;
        check::within("camera_height_m", self.camera_height_m, 0.0, 10.0)?;
        let most = FRAC_PI_2 - 0.017;
        check::within("tilt_rad[0]", self.tilt_rad[0], -most, most)?;
        check::within("tilt_rad[1]", self.tilt_rad[1], self.tilt_rad[0], most)?;
        let half_turn = std::f64::consts::PI;
        check::within("pan_rad[0]", self.pan_rad[0], -half_turn, half_turn)?;
        check::within("pan_rad[1]", self.pan_rad[1], self.pan_rad[0], half_turn)
    }
}

/// What counts as seen.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct VisibilityParams {
    /// Most oblique view against the normal; up to 85 degrees.
    pub max_incidence_rad: f64,
    /// Shortest side in the image, pixels: that of an icon.
    pub min_side_px: f64,
    /// Largest share of the image that a side may take; method 12.3 has 0.9.
    pub max_fill: f64,
    /// How far before its wall the landmark is taken to hang, so that its own wall does not hide it; 1 mm to 0.5 m.
    pub standoff_m: f64,
}

impl Default for VisibilityParams {
    fn default() -> Self {
        Self { max_incidence_rad: 75.0_f64.to_radians(), min_side_px: 75.0, max_fill: 0.9, standoff_m: 0.05 }
    }
}

impl VisibilityParams {
    /// Every number finite and in range.
    pub fn check(&self) -> Result<(), OutOfRange> {
        check::within("max_incidence_rad", self.max_incidence_rad, 0.01, 85.0_f64.to_radians())?;
        check::within("min_side_px", self.min_side_px, 1.0, 20_000.0)?;
        check::within("max_fill", self.max_fill, 0.01, 1.0)?;
        check::within("standoff_m", self.standoff_m, 0.001, 0.5)
    }
}

/// Who looks for landmarks, and what counts as seen.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Sight {
    /// The camera.
    pub viewer: Viewer,
    /// What counts.
    pub seen: VisibilityParams,
}

impl Sight {
    /// Every number finite and in range.
    pub fn check(&self) -> Result<(), OutOfRange> {
        self.viewer.check()?;
        self.seen.check()
    }

    /// No landmark of this size is seen from further, metres.
    pub fn reach_m(&self, size: &LandmarkSize) -> f64 {
        self.viewer.focal_px * size.width_m.min(size.height_m) / self.seen.min_side_px
    }
}

/// Something straight that stands on the floor and hides what is behind it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Obstacle {
    /// One end, metres.
    pub a: Point2<f64>,
    /// The other.
    pub b: Point2<f64>,
    /// How high it is; a wall of the laser map has none and hides everything.
    pub height_m: Option<f64>,
}

impl From<&crate::segments::LaserSegment> for Obstacle {
    fn from(wall: &crate::segments::LaserSegment) -> Self {
        Self { a: wall.a, b: wall.b, height_m: None }
    }
}

impl Obstacle {
    /// Whether it can come between camera and landmark at all: the lines of sight run above the lower of the two.
    fn hides(&self, place: &LandmarkPlace, viewer: &Viewer) -> bool {
        let half_height = 0.5 * place.size.height_m * place.tilt_rad.cos();
        let lowest = (place.z_m - half_height).min(viewer.camera_height_m);
        self.height_m.is_none_or(|height| height > lowest)
    }
}

/// From where one landmark can be seen.
#[derive(Debug, Clone, PartialEq)]
pub struct VisibilityMap {
    frame: LocalFrame,
    /// Centre of the landmark on the floor.
    centre: Point2<f64>,
    /// Pan range of the viewer.
    pan_rad: [f64; 2],
    /// Bounds of what is seen, over direction.
    quarters: [Quarter; 4],
    polygons: Vec<Polygon>,
    area_m2: f64,
    centroid: Option<Point2<f64>>,
    reach_m: f64,
    obstacles: Vec<Obstacle>,
}

/// The frame whose origin is the landmark's middle, moved off its wall; x along the normal on the floor.
#[derive(Debug, Clone, Copy, PartialEq)]
struct LocalFrame {
    origin: Point2<f64>,
    normal: Vector2<f64>,
}

/// A landmark as it is looked at: moved along its normal by the standoff.
#[derive(Debug, Clone, Copy)]
struct Moved {
    /// Of its middle above the floor.
    height_m: f64,
    tilt_rad: f64,
    size: LandmarkSize,
}

impl Moved {
    fn new(place: &LandmarkPlace, standoff_m: f64) -> Self {
        let tilt_rad = if place.tilt_rad.abs() < UPRIGHT_RAD { 0.0 } else { place.tilt_rad };
        Self { height_m: place.z_m - standoff_m * tilt_rad.sin(), tilt_rad, size: place.size }
    }

    fn footprint(&self) -> Footprint {
        let half_depth_m = 0.5 * self.size.height_m * self.tilt_rad.sin().abs();
        Footprint { half_depth_m, half_width_m: 0.5 * self.size.width_m }
    }
}

impl LocalFrame {
    fn new(place: &LandmarkPlace, standoff_m: f64) -> Self {
        let normal = Vector2::new(place.theta_rad.cos(), place.theta_rad.sin());
        let off = standoff_m * place.tilt_rad.cos();
        Self { origin: Point2::new(place.x_m, place.y_m) + normal * off, normal }
    }

    fn local(&self, map: &Point2<f64>) -> Point2<f64> {
        let d = map - self.origin;
        Point2::new(self.normal.dot(&d), self.normal.perp(&d))
    }

    fn map(&self, local: &Point2<f64>) -> Point2<f64> {
        let along = Vector2::new(-self.normal.y, self.normal.x);
        self.origin + self.normal * local.x + along * local.y
    }
}

/// The visibility map of a landmark among `obstacles`: `O(M log M)` in those within reach.
///
/// A landmark that an obstacle cuts is seen from nowhere; neither is one that the camera cannot show large enough, or whole.
/// Its roll counts for nothing.
// Departs from method 12: no polygon Booleans, see the head of this file; the area is the same. Free space known
// otherwise is not asked: what walls enclose they hide. Every condition is asked of the landmark moved off its wall, not only
// what hides it: 5 cm of the way.
pub fn visibility(
    place: &LandmarkPlace,
    obstacles: &[Obstacle],
    viewer: &Viewer,
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
        quarters: Default::default(),
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
    made.quarters = quarters::quarters(&limits, &footprint, &local);
    made.polygons = outline::outline(&frame, &made.quarters);
    (made.area_m2, made.centroid) = outline::measure(&made.polygons);
    Ok(made)
}

/// The obstacles that can matter to a landmark's map, in the order given: as long as these are the same, so is the map.
pub fn within_reach(
    place: &LandmarkPlace,
    obstacles: &[Obstacle],
    viewer: &Viewer,
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
            let distance = outline::distance_to_segment(&Point2::origin(), &a, &b);
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
    /// The area as polygons, counter-clockwise, apart from each other.
    pub fn polygons(&self) -> &[Polygon] {
        &self.polygons
    }

    /// Size of the area, square metres; 0 when the landmark is seen from nowhere.
    pub fn area_m2(&self) -> f64 {
        self.area_m2
    }

    /// Centre of gravity of the area; it may lie outside of it. None when there is no area.
    pub fn centroid(&self) -> Option<Point2<f64>> {
        self.centroid
    }

    /// Nothing further from the landmark's middle is in the area.
    pub fn reach_m(&self) -> f64 {
        self.reach_m
    }

    /// The obstacles that were looked at ([`within_reach`]).
    pub fn obstacles(&self) -> &[Obstacle] {
        &self.obstacles
    }

    /// Whether a camera at a point sees the landmark.
    pub fn contains(&self, camera: &Point2<f64>) -> bool {
        let q = self.frame.local(camera);
        !self.polygons.is_empty() && q.coords.norm() <= self.reach_m && quarters::contains(&self.quarters, &q)
    }

    /// Distance to the boundary of the area, positive inside; minus infinity when there is no area.
    pub fn margin_m(&self, camera: &Point2<f64>) -> f64 {
        let distance =
            self.polygons.iter().map(|p| p.boundary_distance_m(camera)).fold(f64::INFINITY, f64::min);
        if self.contains(camera) { distance } else { -distance }
    }
}

#[cfg(test)]
mod tests;
