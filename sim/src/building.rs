//! A building: flat textured rectangles in the map frame, walls as lines for the laser, and the
//! exact truth about its landmarks. Read only; `builder` makes it, `corridor` lays it out.

pub use crate::wall::WallSegment;

use crate::{lighting::LightMap, texture::Texture, wall::range};
use nalgebra::{Isometry3, Point2, Point3};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Most surfaces of a building; further ones are not added.
pub const MAX_SURFACES: usize = 4096;

/// Kind of a landmark.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LandmarkKind {
    /// A poster on a wall; the landmark to learn.
    Poster,
    /// A door; the floor is its lower side.
    Door,
    /// A window with its frame.
    Window,
    /// A lamp in the ceiling.
    Lamp,
    /// A picture in a frame or a bare canvas; in scenes only.
    Picture,
    /// A sign; in scenes only.
    Sign,
    /// A notice board; in scenes only.
    Board,
}

/// A landmark with its exact place.
#[derive(Debug, Clone, PartialEq)]
pub struct LandmarkTruth {
    /// Name, unique in the building, `[a-z0-9_-]{1,64}`.
    pub name: String,
    /// Kind of the landmark.
    pub kind: LandmarkKind,
    /// Landmark frame: origin at the centre, x outward (towards the viewer), y the viewer's right,
    /// z up.
    pub map_from_landmark: Isometry3<f64>,
    /// Extent along y, metres.
    pub width_m: f64,
    /// Extent along z, metres.
    pub height_m: f64,
}

impl LandmarkTruth {
    /// Corners TL, TR, BR, BL in the map frame (method 0.2).
    pub fn corners_map(&self) -> [Point3<f64>; 4] {
        rectangle(self.width_m, self.height_m).map(|p| self.map_from_landmark * p)
    }
}

/// Corners TL, TR, BR, BL of a rectangle in its own frame (plane x = 0).
pub fn rectangle(width_m: f64, height_m: f64) -> [Point3<f64>; 4] {
    let (w, h) = (0.5 * width_m, 0.5 * height_m);
    [Point3::new(0.0, -w, h), Point3::new(0.0, w, h), Point3::new(0.0, w, -h), Point3::new(0.0, -w, -h)]
}

/// A textured rectangle, visible from its outward side only. Its frame is that of a landmark.
#[derive(Debug, Clone)]
pub struct Surface {
    /// Name of the surface; the landmark's name if it is one.
    pub name: String,
    /// Surface frame: x outward normal, y right, z up for a viewer in front.
    pub map_from_surface: Isometry3<f64>,
    /// Extent along y, metres.
    pub width_m: f64,
    /// Extent along z, metres.
    pub height_m: f64,
    /// Reflectance, 0 to 255.
    pub texture: Arc<Texture>,
    /// Width and height of one repetition of the texture, metres; the surface's size when it does
    /// not repeat.
    pub texture_m: [f64; 2],
    /// Index into [`Building::landmarks`] if it is one.
    pub landmark: Option<usize>,
    /// Whether it emits light and is not lit by the lamps.
    pub glows: bool,
    pub(crate) light: LightMap,
}

/// A building, lit and read only.
#[derive(Debug, Clone)]
pub struct Building {
    pub(crate) surfaces: Vec<Surface>,
    pub(crate) walls: Vec<WallSegment>,
    pub(crate) landmarks: Vec<LandmarkTruth>,
}

impl Building {
    /// All textured rectangles.
    pub fn surfaces(&self) -> &[Surface] {
        &self.surfaces
    }

    /// Walls for the laser.
    pub fn walls(&self) -> &[WallSegment] {
        &self.walls
    }

    /// All landmarks, in the order they were added.
    pub fn landmarks(&self) -> &[LandmarkTruth] {
        &self.landmarks
    }

    /// The landmark of a name.
    pub fn landmark(&self, name: &str) -> Option<&LandmarkTruth> {
        self.landmarks.iter().find(|l| l.name == name)
    }

    /// All posters.
    pub fn posters(&self) -> impl Iterator<Item = &LandmarkTruth> {
        self.landmarks.iter().filter(|l| l.kind == LandmarkKind::Poster)
    }

    /// Whether no wall crosses the straight line between two points of the floor.
    pub fn in_sight(&self, from_m: &Point2<f64>, to_m: &Point2<f64>) -> bool {
        let d = to_m - from_m;
        let length = d.norm();
        length < 1e-9 || range(&self.walls, from_m, &(d / length), length - 1e-6).is_none()
    }

    /// Distance from a point of the floor to the nearest wall, metres; infinite without walls.
    pub fn clearance_m(&self, p_m: &Point2<f64>) -> f64 {
        let distance = |w: &WallSegment| {
            let along = (p_m - w.a_m).dot(&w.direction()).clamp(0.0, w.length_m());
            (p_m - (w.a_m + w.direction() * along)).norm()
        };
        self.walls.iter().map(distance).fold(f64::INFINITY, f64::min)
    }
}
