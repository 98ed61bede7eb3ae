//! Localisation in a finished map of walls by one scan without any prior. In: walls and a scan.
//! Out: every pose that matches as well as the best one, with its covariance, or a refusal.
//!
//! Poses on a grid over the map are scored by how many points of the scan have a wall near by; the
//! best are refined as in [`super::laser_fix`].

use crate::{
    check::OutOfRange,
    laser::Scan,
    laser_fix::{fit::descend, fix::LaserFix, index::WallIndex, params::LaserFixParams, search::flat_points},
    pose2::{Pose2, wrap_rad},
    slam::cloud::Cloud,
};
use nalgebra::{Point2, Vector2};
use std::f64::consts::TAU;

/// Most positions of the grid; a larger map has a coarser grid, up to `MAX_STEP_M`.
pub const MAX_POSITIONS: usize = 40_000;
/// Most poses that are returned.
pub const MAX_POSES: usize = 16;
/// Step of the grid, metres.
const STEP_M: f64 = 0.5;
/// Coarsest step: beyond it no start is near enough to the truth.
const MAX_STEP_M: f64 = 0.8;
/// Headings of a full turn. Half a step moves a point 7 m away by 0.6 m.
const HEADINGS: usize = 36;
/// Points that score a start: those of nearer surfaces, which a wrong heading moves less.
const SCORING_POINTS: usize = 48;
/// Farther surfaces score only where there are too few near ones, metres.
const SCORING_RANGE_M: f64 = 7.0;
/// Points that are tried first; a start that has less than a third of them is given up.
const FIRST_POINTS: usize = 12;
/// Best starts that are refined.
const REFINED: usize = 64;
/// Solutions nearer than this are the same, metres and radians.
const SAME: [f64; 2] = [0.3, 0.2];

/// Why a scan gave no pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum GlobalRefusal {
    /// Too few returns from flat surfaces, or no walls.
    FewPoints {
        /// Number of such returns.
        points: usize,
    },
    /// No pose matches.
    PoorMatch {
        /// Share of the points with a wall at the best pose, 0 to 1.
        matched: f64,
    },
    /// The map is too large for a search.
    TooLarge,
    /// The search was stopped.
    Stopped,
}

/// A start and its score.
#[derive(Debug, Clone, Copy)]
struct Start {
    pose: Pose2,
    score: usize,
}

/// The poses of the robot when it took `scan`, best first: one where the walls tell, several where
/// they look alike. `stop` is asked now and then. Errors name an input that is out of range.
pub fn global_laser_fixes(
    walls: &WallIndex,
    scan: &Scan,
    p: &LaserFixParams,
    stop: &dyn Fn() -> bool,
) -> Result<Result<Vec<LaserFix>, GlobalRefusal>, OutOfRange> {
    p.check()?;
    let cloud = flat_points(scan, p);
    if cloud.points.len() < p.min_points || walls.is_empty() {
        return Ok(Err(GlobalRefusal::FewPoints { points: cloud.points.len() }));
    }
    let Some(grid) = positions(walls) else { return Ok(Err(GlobalRefusal::TooLarge)) };
    let Some(starts) = scored(walls, &cloud, grid, p, stop) else {
        return Ok(Err(GlobalRefusal::Stopped));
    };
    let mut found: Vec<LaserFix> = Vec::new();
    for start in apart(starts) {
        if stop() {
            return Ok(Err(GlobalRefusal::Stopped));
        }
        found.extend(descend(walls, &cloud, &start.pose, p));
    }
    found.sort_by(|a, b| b.points.cmp(&a.points).then(a.rms_m.total_cmp(&b.rms_m)));
    let best = found.first().map_or((0, 0.0), |best| (best.points, best.matched));
    let is_matched = |fix: &LaserFix| fix.points >= p.min_points && fix.matched >= p.min_matched;
    found.retain(|fix| is_matched(fix) && fix.points as f64 >= p.rival_share * best.0 as f64);
    if found.is_empty() {
        return Ok(Err(GlobalRefusal::PoorMatch { matched: best.1 }));
    }
    let mut distinct: Vec<LaserFix> = Vec::new();
    for fix in found {
        let is_new = distinct.iter().all(|other| !is_same(&other.pose.pose, &fix.pose.pose));
        if is_new && distinct.len() < MAX_POSES {
            distinct.push(fix);
        }
    }
    Ok(Ok(distinct))
}

fn is_same(a: &Pose2, b: &Pose2) -> bool {
    (a.position() - b.position()).norm() < SAME[0] && wrap_rad(a.theta_rad - b.theta_rad).abs() < SAME[1]
}

/// Points of a grid over the walls; `None` for a map that is too large.
fn positions(walls: &WallIndex) -> Option<Vec<Vector2<f64>>> {
    let [low, high] = walls.extent();
    let size = high - low;
    let count = |step: f64| ((size.x / step) as usize + 1).saturating_mul((size.y / step) as usize + 1);
    let mut step = STEP_M;
    while count(step) > MAX_POSITIONS {
        step *= 1.1;
        if step > MAX_STEP_M {
            return None;
        }
    }
    let (width, height) = ((size.x / step) as usize + 1, (size.y / step) as usize + 1);
    let at = |i: usize| {
        let (x, y) = ((i % width) as f64 * step, (i / width) as f64 * step);
        // In the middle of what is left over.
        let rest = Vector2::new(size.x % step, size.y % step) * 0.5;
        low.coords + rest + Vector2::new(x, y)
    };
    Some((0..width * height).map(at).collect())
}

/// The best starts, best first; `None` when stopped.
fn scored(
    walls: &WallIndex,
    cloud: &Cloud,
    grid: Vec<Vector2<f64>>,
    p: &LaserFixParams,
    stop: &dyn Fn() -> bool,
) -> Option<Vec<Start>> {
    let points = scoring_points(cloud);
    let cos_turn = p.max_turn_rad.cos();
    let turned: Vec<(f64, Vec<[Vector2<f64>; 2]>)> = (0..HEADINGS)
        .map(|k| {
            let theta = wrap_rad(k as f64 * TAU / HEADINGS as f64);
            let (s, c) = theta.sin_cos();
            let turn = |v: &Vector2<f64>| Vector2::new(c * v.x - s * v.y, s * v.x + c * v.y);
            (theta, points.iter().map(|[at, normal]| [turn(at), turn(normal)]).collect())
        })
        .collect();
    let mut starts: Vec<Start> = Vec::new();
    let mut least = 0;
    for position in grid {
        if stop() {
            return None;
        }
        for (theta, points) in &turned {
            let hits = |points: &[[Vector2<f64>; 2]]| {
                let near = |[at, normal]: &&[Vector2<f64>; 2]| {
                    let at = Point2::from(at + position);
                    walls.nearest(&at, normal, p.start_radius_m, cos_turn).is_some()
                };
                points.iter().filter(near).count()
            };
            let (first, rest) = points.split_at(FIRST_POINTS.min(points.len()));
            let score = hits(first);
            if 3 * score < first.len() {
                continue;
            }
            let score = score + hits(rest);
            if score > least {
                starts.push(Start { pose: Pose2::new(position.x, position.y, *theta), score });
            }
        }
        // Keeps the list short: what is below the best so far will not be refined.
        if starts.len() > 64 * REFINED {
            starts.sort_by_key(|start| std::cmp::Reverse(start.score));
            starts.truncate(32 * REFINED);
            least = starts.last().map_or(0, |start| start.score);
        }
    }
    starts.sort_by_key(|start| std::cmp::Reverse(start.score));
    Some(starts)
}

/// Position and normal of a few points, the near ones first where there are enough, and spread over
/// the scan.
fn scoring_points(cloud: &Cloud) -> Vec<[Vector2<f64>; 2]> {
    let all: Vec<_> = cloud.points.iter().filter_map(|q| Some([q.at.coords, q.normal?])).collect();
    let near: Vec<_> = all.iter().filter(|[at, _]| at.norm() <= SCORING_RANGE_M).copied().collect();
    let of = if near.len() >= SCORING_POINTS { near } else { all };
    let stride = of.len().div_ceil(SCORING_POINTS).max(1);
    // The first ones are spread over the whole scan, too.
    let chosen: Vec<_> = of.into_iter().step_by(stride).collect();
    let each = chosen.len().div_ceil(FIRST_POINTS).max(1);
    (0..each)
        .flat_map(|offset| chosen.iter().skip(offset).step_by(each).copied().collect::<Vec<_>>())
        .collect()
}

/// The best starts without their neighbours.
fn apart(starts: Vec<Start>) -> Vec<Start> {
    let mut kept: Vec<Start> = Vec::new();
    for start in starts {
        let is_new = kept.iter().all(|other| {
            (other.pose.position() - start.pose.position()).norm() >= STEP_M
                || wrap_rad(other.pose.theta_rad - start.pose.theta_rad).abs() >= TAU / HEADINGS as f64
        });
        if is_new {
            kept.push(start);
            if kept.len() == REFINED {
                break;
            }
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::slam::world::{Walls, rectangle, ring, scan, segments};
    use vision::random::Random;

    fn search(walls: &Walls, at: &Pose2, seed: u64) -> Result<Vec<LaserFix>, GlobalRefusal> {
        let index = WallIndex::new(&segments(walls, 0.005, 0.002));
        let scan = scan(walls, at, 0.01, 12.0, &mut Random::new(seed));
        global_laser_fixes(&index, &scan, &LaserFixParams::default(), &|| false).unwrap()
    }

    fn error(found: &LaserFix, at: &Pose2) -> (f64, f64) {
        let e = found.pose.pose.minus(at);
        (e.xy().norm(), e.z.abs())
    }

    #[test]
    fn a_scan_finds_its_place_in_a_building_without_a_prior() {
        let poses = [Pose2::new(1.0, 6.0, 1.4), Pose2::new(5.7, 1.2, 0.3), Pose2::new(16.0, 15.0, 3.0)];
        for (seed, at) in poses.iter().enumerate() {
            let found = search(&ring(), at, seed as u64).unwrap();
            // Half a turn of a scan looks the same from many places of these corridors: the right
            // one is among the best.
            let right = found.iter().filter(|fix| error(fix, at).0 < 0.1 && error(fix, at).1 < 0.05);
            let all: Vec<Pose2> = found.iter().map(|fix| fix.pose.pose).collect();
            assert!(right.count() == 1 && all.len() <= MAX_POSES, "{at:?}: {all:?}");
        }
    }

    #[test]
    fn a_symmetric_room_has_several_places() {
        let at = Pose2::new(2.0, 1.5, 0.4);
        let found = search(&rectangle([0.0, 0.0, 8.0, 5.0]), &at, 1).unwrap();
        let turned = Pose2::new(6.0, 3.5, wrap_rad(0.4 + std::f64::consts::PI));
        for pose in [at, turned] {
            let near = found.iter().filter(|fix| error(fix, &pose).0 < 0.1 && error(fix, &pose).1 < 0.05);
            let all: Vec<Pose2> = found.iter().map(|fix| fix.pose.pose).collect();
            assert_eq!(near.count(), 1, "{pose:?}: {all:?}");
        }
        assert!(found.len() <= MAX_POSES);
    }

    #[test]
    fn another_building_a_large_one_and_a_stopped_search_give_no_place() {
        let index = WallIndex::new(&segments(&rectangle([0.0, 0.0, 4.0, 3.0]), 0.005, 0.002));
        let elsewhere = scan(&ring(), &Pose2::new(1.0, 6.0, 1.4), 0.01, 12.0, &mut Random::new(3));
        let p = LaserFixParams::default();
        let found = |index: &WallIndex, stop: &dyn Fn() -> bool| {
            global_laser_fixes(index, &elsewhere, &p, stop).unwrap().unwrap_err()
        };
        assert!(matches!(found(&index, &|| false), GlobalRefusal::PoorMatch { .. }));
        assert_eq!(found(&index, &|| true), GlobalRefusal::Stopped);
        let large = WallIndex::new(&segments(&rectangle([0.0, 0.0, 400.0, 400.0]), 0.005, 0.002));
        assert_eq!(found(&large, &|| false), GlobalRefusal::TooLarge);
        let none = WallIndex::new([]);
        assert!(matches!(found(&none, &|| false), GlobalRefusal::FewPoints { .. }));
    }
}
