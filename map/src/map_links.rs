//! Links between maps. Each map may name a parent map and its pose in it, so that a pose on one
//! floor can be expressed in the frame of another.
//!
//! In: one link for each map. Out: the transform between two maps with covariance, or why there is
//! none. The path goes up to the nearest common ancestor and down again. Links above it are left
//! out: they move both maps equally.

use crate::{
    check::{self, OutOfRange},
    pose2::Pose2Covariance,
};
use std::collections::BTreeMap;

/// Most links between a map and its root.
pub const MAX_DEPTH: usize = 16;
/// Largest height of a floor above or below its parent's, metres.
pub const MAX_LEVEL_M: f64 = 1_000.0;

/// Pose and level of a map in its parent.
#[derive(Debug, Clone, PartialEq)]
pub struct MapLink<K> {
    /// The parent map.
    pub parent: K,
    /// Pose of the map in its parent. Errors of different links are independent.
    pub parent_from_map: Pose2Covariance,
    /// Height of the map's floor above the parent's, metres.
    pub level_m: f64,
}

impl<K> MapLink<K> {
    /// Refuses numbers out of range and impossible covariances.
    pub fn check(&self) -> Result<(), OutOfRange> {
        self.parent_from_map.check()?;
        check::within("level_m", self.level_m, -MAX_LEVEL_M, MAX_LEVEL_M)
    }
}

/// The transform from one map to another.
#[derive(Debug, Clone, PartialEq)]
pub struct MapTransform<K> {
    /// Transforms coordinates of the source map to those of the target map.
    pub to_from_map: Pose2Covariance,
    /// Height of the source map's floor above the target map's, metres.
    pub level_m: f64,
    /// The maps on the path, both ends included.
    pub via: Vec<K>,
}

/// Why two maps have no transform.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum MapLinkError {
    /// They have no common ancestor.
    #[error("the maps have no common ancestor: link both to one map")]
    NotRelated,
    /// A map is its own ancestor.
    #[error("the link makes a map its own ancestor: link it to another map")]
    Cycle,
    /// More than [`MAX_DEPTH`] links above one another.
    #[error("more than {MAX_DEPTH} links above one another: link the map nearer to its root")]
    TooDeep,
}

/// The links of all maps, by map.
pub type MapLinks<K> = BTreeMap<K, MapLink<K>>;

/// The map itself and its ancestors, nearest first.
fn above<K: Ord + Clone>(links: &MapLinks<K>, map: &K) -> Result<Vec<K>, MapLinkError> {
    let mut chain = vec![map.clone()];
    let mut at = map;
    while let Some(link) = links.get(at) {
        if chain.contains(&link.parent) {
            return Err(MapLinkError::Cycle);
        }
        if chain.len() > MAX_DEPTH {
            return Err(MapLinkError::TooDeep);
        }
        chain.push(link.parent.clone());
        at = &link.parent;
    }
    Ok(chain)
}

/// Refuses cycles and chains that are too long.
pub fn check_all<K: Ord + Clone>(links: &MapLinks<K>) -> Result<(), MapLinkError> {
    links.keys().try_for_each(|map| above(links, map).map(drop))
}

/// The transform from one map to another.
pub fn relation<K: Ord + Clone>(
    links: &MapLinks<K>,
    from: &K,
    to: &K,
) -> Result<MapTransform<K>, MapLinkError> {
    let (up, down) = (above(links, from)?, above(links, to)?);
    let meet = up.iter().find(|map| down.contains(map)).ok_or(MapLinkError::NotRelated)?;
    let part = |chain: &[K]| chain.iter().take_while(|map| *map != meet).cloned().collect::<Vec<_>>();
    let (up, mut down) = (part(&up), part(&down));
    let ((meet_from_map, from_m), (meet_from_to, to_m)) = (climb(links, &up), climb(links, &down));
    down.reverse();
    let via = up.into_iter().chain([meet.clone()]).chain(down).collect();
    Ok(MapTransform {
        to_from_map: meet_from_to.inverse().compose(&meet_from_map),
        level_m: from_m - to_m,
        via,
    })
}

/// The transform from the first map of a chain to the parent of its last, and the height.
fn climb<K: Ord>(links: &MapLinks<K>, chain: &[K]) -> (Pose2Covariance, f64) {
    let nowhere = Pose2Covariance {
        pose: crate::pose2::Pose2::new(0.0, 0.0, 0.0),
        covariance: nalgebra::Matrix3::zeros(),
    };
    chain.iter().filter_map(|map| links.get(map)).fold((nowhere, 0.0), |(so_far, level_m), link| {
        (link.parent_from_map.compose(&so_far), level_m + link.level_m)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pose2::Pose2;
    use nalgebra::{Matrix3, Point2, Vector3};

    fn link(parent: u32, pose: [f64; 3], sigma: f64, level_m: f64) -> MapLink<u32> {
        let covariance = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, 0.01)) * sigma * sigma;
        let pose = Pose2::new(pose[0], pose[1], pose[2]);
        MapLink { parent, parent_from_map: Pose2Covariance { pose, covariance }, level_m }
    }

    /// A site (0) with a house (1) of two floors (2, 3) and another house (4); a map (9) of its
    /// own.
    fn links() -> MapLinks<u32> {
        [
            (1, link(0, [100.0, 50.0, 0.6], 0.5, 0.0)),
            (2, link(1, [3.0, -2.0, 1.2], 0.02, 0.0)),
            (3, link(1, [-1.0, 4.0, -2.0], 0.03, 3.4)),
            (4, link(0, [-40.0, 7.0, 2.9], 0.4, -2.0)),
        ]
        .into()
    }

    #[test]
    fn points_go_from_floor_to_floor_and_back() {
        let links = links();
        // By hand: up to the house, down to the other floor.
        let p = Point2::new(1.5, -0.7);
        let house = links[&2].parent_from_map.pose.apply(&p);
        let by_hand = links[&3].parent_from_map.pose.inverse().apply(&house);
        let there = relation(&links, &2, &3).unwrap();
        assert!((there.to_from_map.pose.apply(&p) - by_hand).norm() < 1e-12);
        assert!((there.level_m + 3.4).abs() < 1e-12);
        assert_eq!(there.via, [2, 1, 3]);
        let back = relation(&links, &3, &2).unwrap();
        assert!((back.to_from_map.pose.apply(&by_hand) - p).norm() < 1e-12);
        assert_eq!(relation(&links, &2, &4).unwrap().via, [2, 1, 0, 4]);
        let itself = relation(&links, &9, &9).unwrap();
        assert!(itself.to_from_map.covariance.norm() < 1e-15 && itself.via == [9]);
        assert_eq!(relation(&links, &2, &9), Err(MapLinkError::NotRelated));
    }

    #[test]
    fn links_above_the_common_ancestor_add_no_uncertainty() {
        let sure = links();
        let mut vague = links();
        vague.insert(1, link(0, [100.0, 50.0, 0.6], 50.0, 0.0));
        let same = |a: &u32, b: &u32| {
            let [x, y] = [&sure, &vague].map(|l| relation(l, a, b).unwrap().to_from_map.covariance);
            (x - y).norm() < 1e-9
        };
        assert!(same(&2, &3) && !same(&2, &4) && !same(&1, &0));
    }

    /// Monte Carlo over draws of the links.
    #[test]
    fn the_covariance_is_that_of_drawn_links() {
        let links = links();
        let computed = relation(&links, &2, &3).unwrap().to_from_map;
        let mut state = 1_u64;
        let mut unit = move || {
            // The sum of twelve uniform numbers is nearly normal.
            (0..12).fold(-6.0, |sum, _| {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                sum + (state >> 11) as f64 / (1_u64 << 53) as f64
            })
        };
        let mut sum = Matrix3::zeros();
        let draws = 20_000;
        for _ in 0..draws {
            let mut drawn = links.clone();
            for (map, sigma) in [(2, 0.02), (3, 0.03)] {
                let link = drawn.get_mut(&map).unwrap();
                let d = Vector3::new(unit(), unit(), 0.1 * unit()) * sigma;
                let p = link.parent_from_map.pose;
                link.parent_from_map.pose = Pose2::new(p.x_m + d.x, p.y_m + d.y, p.theta_rad + d.z);
            }
            let off = relation(&drawn, &2, &3).unwrap().to_from_map.pose.minus(&computed.pose);
            sum += off * off.transpose();
        }
        let drawn = sum / f64::from(draws);
        assert!(
            (drawn - computed.covariance).norm() < 0.05 * computed.covariance.norm(),
            "{drawn} {}",
            computed.covariance
        );
    }

    #[test]
    fn cycles_and_depth_are_refused() {
        let mut ring = links();
        ring.insert(0, link(3, [0.0; 3], 0.1, 0.0));
        assert_eq!(check_all(&ring), Err(MapLinkError::Cycle));
        assert_eq!(relation(&ring, &2, &4), Err(MapLinkError::Cycle));
        assert_eq!(check_all(&[(7, link(7, [0.0; 3], 0.1, 0.0))].into()), Err(MapLinkError::Cycle));
        let tower = |n: usize| -> MapLinks<u32> {
            (1..=n as u32).map(|i| (i, link(i - 1, [0.0; 3], 0.1, 3.0))).collect()
        };
        assert_eq!(check_all(&tower(MAX_DEPTH)), Ok(()));
        assert_eq!(check_all(&tower(MAX_DEPTH + 1)), Err(MapLinkError::TooDeep));
        let top = relation(&tower(MAX_DEPTH), &(MAX_DEPTH as u32), &0).unwrap();
        assert!((top.level_m - 3.0 * MAX_DEPTH as f64).abs() < 1e-9);
        let high = MapLink { level_m: MAX_LEVEL_M + 0.1, ..link(0, [0.0; 3], 0.1, 0.0) };
        assert_eq!(high.check().unwrap_err().field, "level_m");
        assert!(MapLink { level_m: MAX_LEVEL_M, ..high }.check().is_ok());
    }
}
