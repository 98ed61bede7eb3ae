//! What the walls of a map say against a pose by landmarks (method 13.8). In: where the camera is,
//! the landmarks that say so, and the walls. Out: cautions, none of which takes the pose back:
//! walls may be of glass, low, or not in the map.

use crate::segments::LaserSegment;
use nalgebra::{Point2, Vector2};

/// Of the way to a landmark, what is not looked at before it, metres: places and walls are known to
/// some centimetres.
const BEFORE_LANDMARK_M: f64 = 0.2;
/// Least distance from the camera at which a wall counts, metres; more where the pose is known
/// worse.
const BEFORE_CAMERA_M: f64 = 0.1;
/// Least distance beyond the walls at which a camera is outside, metres; more where the pose is
/// known worse.
const BEYOND_M: f64 = 0.3;
/// Standard deviations of the pose that count as its error.
const SIGMAS: f64 = 3.0;
/// Least area that walls surround, square metres: a map with fewer walls tells nothing of its
/// outside.
const MIN_AREA_M2: f64 = 4.0;

/// Something that speaks against a pose.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PoseCaution {
    /// A wall is between the camera and a landmark that the pose rests on.
    BehindWall,
    /// The camera is outside of what the walls of the map surround.
    OutsideMap,
}

impl PoseCaution {
    /// The word on the wire.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::BehindWall => "behind_wall",
            Self::OutsideMap => "outside_map",
        }
    }
}

/// The cautions of a camera at `at_m`, known to `sigma_m`, by landmarks with these centres (map
/// frame, metres). Empty without walls.
pub fn pose_cautions(
    at_m: &Point2<f64>,
    sigma_m: f64,
    landmarks_m: &[Point2<f64>],
    walls: &[LaserSegment],
) -> Vec<PoseCaution> {
    let error_m = SIGMAS * sigma_m;
    let is_behind = landmarks_m.iter().any(|landmark_m| {
        let (way, skipped_m) = (landmark_m - at_m, BEFORE_CAMERA_M.max(error_m));
        let length_m = way.norm();
        if length_m <= BEFORE_LANDMARK_M + skipped_m {
            return false;
        }
        let ends = [skipped_m, length_m - BEFORE_LANDMARK_M].map(|m| at_m + way * (m / length_m));
        walls.iter().any(|wall| crosses(ends, [wall.a, wall.b]))
    });
    let is_outside = beyond_m(at_m, walls).is_some_and(|m| m > BEYOND_M.max(error_m));
    let found = [(is_behind, PoseCaution::BehindWall), (is_outside, PoseCaution::OutsideMap)];
    found.into_iter().filter_map(|(holds, caution)| holds.then_some(caution)).collect()
}

fn cross(a: Vector2<f64>, b: Vector2<f64>) -> f64 {
    a.x * b.y - a.y * b.x
}

/// Whether two lines between two points each cross.
fn crosses(p: [Point2<f64>; 2], q: [Point2<f64>; 2]) -> bool {
    let splits =
        |[a, b]: [Point2<f64>; 2], [c, d]: [Point2<f64>; 2]| cross(b - a, c - a) * cross(b - a, d - a) < 0.0;
    splits(p, q) && splits(q, p)
}

/// Distance by which a point is beyond the convex hull of the walls, at least; negative within.
/// `None` where they surround too little.
fn beyond_m(at_m: &Point2<f64>, walls: &[LaserSegment]) -> Option<f64> {
    let hull = hull(walls.iter().flat_map(|wall| [wall.a, wall.b]).collect());
    let next = |i: usize| hull[(i + 1) % hull.len()];
    let area_m2: f64 = (0..hull.len()).map(|i| 0.5 * cross(hull[i].coords, next(i).coords)).sum();
    if hull.len() < 3 || area_m2 < MIN_AREA_M2 {
        return None;
    }
    let outside = |i: usize| {
        let side = next(i) - hull[i];
        cross(at_m - hull[i], side) / side.norm()
    };
    Some((0..hull.len()).map(outside).fold(f64::NEG_INFINITY, f64::max))
}

/// The convex hull, counter-clockwise, without points on its sides.
fn hull(mut points: Vec<Point2<f64>>) -> Vec<Point2<f64>> {
    points.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    let half = |points: &mut dyn Iterator<Item = &Point2<f64>>| {
        let mut kept: Vec<Point2<f64>> = Vec::new();
        for p in points {
            while let [.., a, b] = kept.as_slice()
                && cross(b - a, p - a) <= 0.0
            {
                kept.pop();
            }
            kept.push(*p);
        }
        // The last is the first of the other half.
        kept.pop();
        kept
    };
    let mut all = half(&mut points.iter());
    all.extend(half(&mut points.iter().rev()));
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A room of 8 m x 6 m, and a wall across it at x = 5 with a door at its upper end.
    fn walls() -> Vec<LaserSegment> {
        let ends = [
            [[0.0, 0.0], [8.0, 0.0]],
            [[8.0, 0.0], [8.0, 6.0]],
            [[8.0, 6.0], [0.0, 6.0]],
            [[0.0, 6.0], [0.0, 0.0]],
            [[5.0, 0.0], [5.0, 4.5]],
        ];
        let segment = |[a, b]: [[f64; 2]; 2]| {
            LaserSegment::from_ends(a.into(), b.into(), nalgebra::Matrix2::identity() * 1e-4).unwrap()
        };
        ends.into_iter().map(segment).collect()
    }

    fn told(at: [f64; 2], sigma_m: f64, landmark: [f64; 2]) -> Vec<PoseCaution> {
        pose_cautions(&at.into(), sigma_m, &[landmark.into()], &walls())
    }

    #[test]
    fn a_pose_in_the_room_of_its_landmark_is_without_caution() {
        for at in [[1.0, 1.0], [4.9, 5.9], [4.0, 5.7], [4.5, 3.0]] {
            assert_eq!(told(at, 0.02, [4.0, 6.0]), [], "{at:?}");
        }
        // Through the door.
        assert_eq!(told([6.0, 5.0], 0.02, [4.0, 6.0]), []);
    }

    #[test]
    fn a_pose_behind_a_wall_is_told() {
        assert_eq!(told([6.5, 1.0], 0.02, [4.0, 6.0]), [PoseCaution::BehindWall]);
        // Known so badly that it may be before the wall.
        assert_eq!(told([5.2, 1.0], 0.1, [3.0, 0.0]), []);
        assert_eq!(told([5.2, 1.0], 0.02, [3.0, 0.0]), [PoseCaution::BehindWall]);
    }

    #[test]
    fn a_pose_mirrored_by_its_wall_is_outside_of_the_map() {
        // The landmark hangs on the wall y = 6 and faces the room; somebody said that it faces
        // away.
        assert_eq!(told([4.5, 8.0], 0.02, [4.0, 6.0]), [PoseCaution::OutsideMap]);
        assert_eq!(told([4.5, 6.2], 0.02, [4.0, 6.0]), [], "walls are known to some centimetres");
        assert_eq!(told([4.5, 6.5], 0.3, [4.0, 6.0]), [], "so badly known that it may be inside");
        let both = told([9.5, 1.0], 0.02, [4.0, 6.0]);
        assert_eq!(both, [PoseCaution::BehindWall, PoseCaution::OutsideMap]);
    }

    #[test]
    fn without_walls_around_nothing_is_told() {
        let none = pose_cautions(&[4.5, 8.0].into(), 0.02, &[[4.0, 6.0].into()], &[]);
        assert_eq!(none, []);
        let one = &walls()[2..3];
        assert_eq!(pose_cautions(&[4.5, 8.0].into(), 0.02, &[[4.0, 6.0].into()], one), []);
    }
}
