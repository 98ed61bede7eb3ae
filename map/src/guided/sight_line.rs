//! Which share of a landmark walls leave in view of a camera: lines of sight to a grid of points on
//! its face.

use crate::{place::LandmarkPlace, visibility::Obstacle};
use nalgebra::{Point2, Point3, Vector2};

/// Points of the grid along each side; they lie at these shares of width and height from the
/// middle.
const GRID: [f64; 3] = [-0.4, 0.0, 0.4];
/// A crossing nearer than this to the camera or the landmark, as a share of the line of sight,
/// hides nothing.
const END_SHARE: f64 = 1e-6;

/// Share of the landmark's face, 0 to 1, to which no obstacle blocks the line of sight from
/// `camera` (map frame, metres). The face is moved `standoff_m` off its wall, so that its own wall
/// does not hide it.
pub(super) fn unoccluded_share(
    camera: &Point3<f64>,
    place: &LandmarkPlace,
    obstacles: &[Obstacle],
    standoff_m: f64,
) -> f64 {
    let map_from_landmark = place.map_from_landmark();
    let near = near_sight_lines(camera, place, obstacles);
    let points = GRID.iter().flat_map(|y| GRID.iter().map(move |z| (*y, *z)));
    let free = points.filter(|(y, z)| {
        let on_face = Point3::new(standoff_m, y * place.size.width_m, z * place.size.height_m);
        let point = map_from_landmark * on_face;
        !near.iter().any(|o| blocks(o, camera, &point))
    });
    free.count() as f64 / (GRID.len() * GRID.len()) as f64
}

/// Obstacles whose bounding box meets that of camera and landmark on the floor.
fn near_sight_lines<'a>(
    camera: &Point3<f64>,
    place: &LandmarkPlace,
    obstacles: &'a [Obstacle],
) -> Vec<&'a Obstacle> {
    let reach_m = 0.5 * place.size.width_m.hypot(place.size.height_m) + 1.0;
    let (low_x, high_x) = (camera.x.min(place.x_m - reach_m), camera.x.max(place.x_m + reach_m));
    let (low_y, high_y) = (camera.y.min(place.y_m - reach_m), camera.y.max(place.y_m + reach_m));
    let meets = |o: &&Obstacle| {
        o.a.x.min(o.b.x) <= high_x
            && o.a.x.max(o.b.x) >= low_x
            && o.a.y.min(o.b.y) <= high_y
            && o.a.y.max(o.b.y) >= low_y
    };
    obstacles.iter().filter(meets).collect()
}

/// Whether an obstacle crosses the line of sight and is higher than it there.
fn blocks(obstacle: &Obstacle, camera: &Point3<f64>, point: &Point3<f64>) -> bool {
    let from: Point2<f64> = camera.xy();
    let sight: Vector2<f64> = point.xy() - from;
    let wall = obstacle.b - obstacle.a;
    let cross = sight.perp(&wall);
    if cross == 0.0 {
        return false;
    }
    let to_wall = obstacle.a - from;
    let along = to_wall.perp(&wall) / cross;
    let across = to_wall.perp(&sight) / cross;
    let crosses = (END_SHARE..=1.0 - END_SHARE).contains(&along) && (0.0..=1.0).contains(&across);
    crosses && obstacle.height_m.is_none_or(|height| camera.z + along * (point.z - camera.z) < height)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::place::PlaceSigmas;
    use nalgebra::Vector3;
    use vision::pose::LandmarkSize;

    /// On the wall x = 4, facing a camera at the origin.
    fn poster() -> LandmarkPlace {
        let size = LandmarkSize { width_m: 1.0, height_m: 1.0 };
        let centre = Vector3::new(4.0, 0.0, 1.5);
        LandmarkPlace::by_hand(centre, std::f64::consts::PI, size, PlaceSigmas::default()).unwrap()
    }

    fn wall(a: [f64; 2], b: [f64; 2], height_m: Option<f64>) -> Obstacle {
        Obstacle { a: Point2::from(a), b: Point2::from(b), height_m }
    }

    #[test]
    fn walls_hide_what_is_behind_them_and_low_ones_what_is_lower() {
        let camera = Point3::new(0.0, 0.0, 1.2);
        let share = |obstacles: &[Obstacle]| unoccluded_share(&camera, &poster(), obstacles, 0.05);
        assert!((share(&[]) - 1.0).abs() < 1e-12);
        // Its own wall, a wall beside the line of sight, one behind the camera.
        let beside = [
            wall([4.0, -3.0], [4.0, 3.0], None),
            wall([1.0, 2.0], [3.0, 2.0], None),
            wall([-1.0, -1.0], [-1.0, 1.0], None),
        ];
        assert!((share(&beside) - 1.0).abs() < 1e-12);
        assert!(share(&[wall([2.0, -2.0], [2.0, 2.0], None)]).abs() < 1e-12);
        // Half of the lines of sight: the middle column and the one on its side.
        assert!((share(&[wall([2.0, 0.0], [2.0, 2.0], None)]) - 1.0 / 3.0).abs() < 1e-12);
        // At half way the lines of sight run at 1.15, 1.35 and 1.55 m.
        assert!((share(&[wall([2.0, -2.0], [2.0, 2.0], Some(1.25))]) - 2.0 / 3.0).abs() < 1e-12);
    }
}
