//! Places and passages of several maps in one graph: doorways within maps, links between them.

use super::map_topology::{MapTopology, seen_from};
use crate::{
    map_links::{MapLink, MapLinks},
    visibility::VisibilityMap,
};
use nalgebra::Point2;
use std::collections::BTreeMap;
use vision::model::LandmarkId;

/// Most maps of a site.
pub const MAX_SITE_MAPS: usize = 64;

/// A site has more than [`MAX_SITE_MAPS`] maps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("the site has {0} maps: at most {MAX_SITE_MAPS} have a common topology")]
pub struct TooManyMaps(pub usize);

/// A place of a map, from 0.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct PlaceAt<K> {
    /// The map.
    pub map: K,
    /// Its place.
    pub place: usize,
}

/// A way between two places: a doorway, or a link of two maps.
#[derive(Debug, Clone, PartialEq)]
pub struct Passage<K> {
    /// The two places; of a link, that of the map that lies in the other first.
    pub places: [PlaceAt<K>; 2],
    /// Its middle in the map of each place, metres.
    pub middles: [Point2<f64>; 2],
    /// Free width, at most 2 m; `None` for a link.
    pub width_m: Option<f64>,
    /// Length of the way from the centre of each place to its middle, metres.
    pub ways_m: [f64; 2],
    /// Between the two middles, metres: 0 for a doorway; the height of a link between floors.
    pub between_m: f64,
    /// What is seen from the first middle, in the first place's map.
    pub landmarks: Vec<LandmarkId>,
}

impl<K> Passage<K> {
    /// From centre to centre, metres.
    pub fn length_m(&self) -> f64 {
        self.ways_m[0] + self.between_m + self.ways_m[1]
    }
}

/// Visibility areas of a map.
type Areas<'a> = Vec<(LandmarkId, &'a VisibilityMap)>;

/// Places and passages of several maps.
#[derive(Debug, Clone, PartialEq)]
pub struct SiteTopology<K> {
    /// By map.
    pub maps: BTreeMap<K, MapTopology>,
    /// Doorways by map, then links by the map that lies in another.
    pub passages: Vec<Passage<K>>,
}

impl<K: Ord + Clone> SiteTopology<K> {
    /// Of maps with their visibility areas; links to other maps are left out.
    pub fn new(
        maps: BTreeMap<K, (MapTopology, Areas<'_>)>,
        links: &MapLinks<K>,
    ) -> Result<Self, TooManyMaps> {
        if maps.len() > MAX_SITE_MAPS {
            return Err(TooManyMaps(maps.len()));
        }
        let mut passages = Vec::new();
        for (map, (topology, _)) in &maps {
            let at = |place: usize| PlaceAt { map: map.clone(), place };
            passages.extend(topology.doorways.iter().map(|doorway| Passage {
                places: doorway.places.map(at),
                middles: [doorway.middle; 2],
                width_m: Some(doorway.width_m),
                ways_m: doorway.ways_m,
                between_m: 0.0,
                landmarks: doorway.landmarks.clone(),
            }));
        }
        for (map, (topology, areas)) in &maps {
            let link = links.get(map).and_then(|link| Some((link, &maps.get(&link.parent)?.0)));
            let Some((link, outer)) = link else { continue };
            passages.extend(linked(link, topology, outer).map(|meeting| {
                Passage {
                    places: [(map, meeting.places[0]), (&link.parent, meeting.places[1])]
                        .map(|(map, place)| PlaceAt { map: map.clone(), place }),
                    landmarks: seen_from(&meeting.middles[0], areas),
                    middles: meeting.middles,
                    width_m: None,
                    ways_m: meeting.ways_m,
                    between_m: meeting.between_m,
                }
            }));
        }
        Ok(Self { maps: maps.into_iter().map(|(map, (topology, _))| (map, topology)).collect(), passages })
    }
}

/// Where two maps meet: in the map that lies in the other, then in that.
struct Meeting {
    places: [usize; 2],
    middles: [Point2<f64>; 2],
    ways_m: [f64; 2],
    between_m: f64,
}

/// A link does not say where people pass from one map to the other. It joins the two places that
/// have most floor in common, at the point of it that is farthest from the walls of both; without
/// common floor, the two places with the nearest centres.
fn linked<K>(link: &MapLink<K>, inner: &MapTopology, outer: &MapTopology) -> Option<Meeting> {
    let outer_from_inner = link.parent_from_map.pose;
    let mut common: BTreeMap<[usize; 2], (usize, f64, Point2<f64>)> = BTreeMap::new();
    for (point, place, clearance_m) in inner.samples() {
        let Some((other, there_m)) = outer.free_at(&outer_from_inner.apply(&point)) else { continue };
        let both_m = clearance_m.min(there_m);
        let (cells, best_m, best) = common.entry([place, other]).or_insert((0, 0.0, point));
        *cells += 1;
        if both_m > *best_m {
            (*best_m, *best) = (both_m, point);
        }
    }
    let most = common.iter().max_by_key(|(places, (cells, ..))| (*cells, std::cmp::Reverse(**places)));
    if let Some((places, (_, _, point))) = most {
        let middles = [*point, outer_from_inner.apply(point)];
        let ways_m = [inner.way_m(places[0], &middles[0]), outer.way_m(places[1], &middles[1])];
        return Some(Meeting { places: *places, middles, ways_m, between_m: link.level_m.abs() });
    }
    let pairs = (0..inner.places.len()).flat_map(|i| (0..outer.places.len()).map(move |o| [i, o]));
    let gap_m = |[i, o]: [usize; 2]| {
        (outer_from_inner.apply(&inner.places[i].centre) - outer.places[o].centre).norm()
    };
    let places = pairs.min_by(|a, b| gap_m(*a).total_cmp(&gap_m(*b)).then(a.cmp(b)))?;
    let middles = [inner.places[places[0]].centre, outer.places[places[1]].centre];
    Some(Meeting { places, middles, ways_m: [0.0; 2], between_m: gap_m(places) + link.level_m.abs() })
}
