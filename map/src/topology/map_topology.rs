//! Places and doorways of one map.

use super::{
    floor::{Floor, RADIUS_M, TooLarge, box_of},
    search::{Search, straightened},
    watershed::places,
};
use crate::{segments::LaserSegment, visibility::VisibilityMap};
use nalgebra::{Point2, Vector2};
use std::collections::BTreeMap;
use vision::model::LandmarkId;

/// Most doorways of a map; of more, the widest.
pub const MAX_DOORWAYS: usize = 512;
/// Most landmarks that a place or a passage names; of more, those seen best.
pub const MAX_SEEN: usize = 32;
/// A point that is not on free floor belongs to the place of the nearest cell within this, metres.
pub const NEAR_M: f64 = 1.0;
/// Where landmarks are seen is asked at points this far apart, metres.
const SAMPLE_M: f64 = 0.2;

/// Free floor that no doorway divides.
#[derive(Debug, Clone, PartialEq)]
pub struct Place {
    /// The point of the place nearest to its centre of gravity, metres, map frame.
    pub centre: Point2<f64>,
    /// Free floor, square metres.
    pub area_m2: f64,
    /// What is seen from it, by falling share, then by number; at most [`MAX_SEEN`].
    pub landmarks: Vec<SeenLandmark>,
}

/// A landmark that is seen from a place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SeenLandmark {
    /// Number of the landmark.
    pub landmark: LandmarkId,
    /// Share of the place from which it is seen, above 0 to 1.
    pub share: f64,
}

/// A narrow spot between two places of a map.
#[derive(Debug, Clone, PartialEq)]
pub struct Doorway {
    /// The two places, the lower first.
    pub places: [usize; 2],
    /// Its middle, metres, map frame.
    pub middle: Point2<f64>,
    /// Free width there, at most 2 m.
    pub width_m: f64,
    /// Length of the ways from the centres of the two places to its middle, metres.
    pub ways_m: [f64; 2],
    /// What is seen from its middle, deepest inside its visibility area first; at most
    /// [`MAX_SEEN`].
    pub landmarks: Vec<LandmarkId>,
}

/// Places and doorways of a map.
#[derive(Debug, Clone, PartialEq)]
pub struct MapTopology {
    /// The places, in the order of their first cells: along x, then along y.
    pub places: Vec<Place>,
    /// The doorways, by places, then by their first cells.
    pub doorways: Vec<Doorway>,
    floor: Floor,
    place_of: Vec<u16>,
}

/// Places and doorways by walls and visibility areas. A map in which no landmark is seen from free
/// floor has none. Errors: the map is too large.
pub fn map_topology(
    walls: &[LaserSegment],
    areas: &[(LandmarkId, &VisibilityMap)],
) -> Result<MapTopology, TooLarge> {
    let floor = Floor::new(walls, &areas.iter().map(|(_, area)| *area).collect::<Vec<_>>())?;
    let seeds = areas.iter().flat_map(|(_, area)| seeing(&floor, area));
    let place_of = places(&floor, seeds);
    let places = described(&floor, &place_of, areas);
    let mut made = MapTopology { places, doorways: Vec::new(), floor, place_of };
    made.doorways = made.found_doorways(areas);
    Ok(made)
}

/// Sample cells from which a landmark is seen.
fn seeing(floor: &Floor, area: &VisibilityMap) -> impl Iterator<Item = usize> {
    let samples = box_of(area).into_iter().flat_map(|[low, high]| floor.within(low, high, stride(floor)));
    samples.filter(|cell| area.contains(&floor.centre(*cell)))
}

/// Cells from one sample to the next.
fn stride(floor: &Floor) -> usize {
    (SAMPLE_M / floor.cell_m).round().max(1.0) as usize
}

fn described(floor: &Floor, place_of: &[u16], areas: &[(LandmarkId, &VisibilityMap)]) -> Vec<Place> {
    let count = place_of.iter().copied().max().unwrap_or(0) as usize;
    let (mut sums, mut cells) = (vec![Vector2::zeros(); count], vec![0_usize; count]);
    let inside = |cell: &usize| place_of[*cell] > 0;
    for cell in (0..place_of.len()).filter(inside) {
        let place = place_of[cell] as usize - 1;
        sums[place] += floor.centre(cell).coords;
        cells[place] += 1;
    }
    let mut centres = vec![(f64::INFINITY, Point2::origin()); count];
    for cell in (0..place_of.len()).filter(inside) {
        let (place, point) = (place_of[cell] as usize - 1, floor.centre(cell));
        let off = (point.coords - sums[place] / cells[place] as f64).norm_squared();
        if off < centres[place].0 {
            centres[place] = (off, point);
        }
    }
    let mut samples = vec![0_usize; count];
    floor.every(stride(floor)).filter(inside).for_each(|cell| samples[place_of[cell] as usize - 1] += 1);
    let mut seen: Vec<Vec<SeenLandmark>> = vec![Vec::new(); count];
    for (landmark, area) in areas {
        let mut seeing_cells: BTreeMap<usize, usize> = BTreeMap::new();
        for cell in seeing(floor, area).filter(inside) {
            *seeing_cells.entry(place_of[cell] as usize - 1).or_default() += 1;
        }
        for (place, cells) in seeing_cells {
            seen[place]
                .push(SeenLandmark { landmark: *landmark, share: cells as f64 / samples[place] as f64 });
        }
    }
    let place = |((centre, cells), mut landmarks): ((Point2<f64>, usize), Vec<SeenLandmark>)| {
        landmarks.sort_by(|a, b| b.share.total_cmp(&a.share).then(a.landmark.cmp(&b.landmark)));
        landmarks.truncate(MAX_SEEN);
        Place { centre, area_m2: cells as f64 * floor.cell_m * floor.cell_m, landmarks }
    };
    centres.into_iter().map(|(_, centre)| centre).zip(cells).zip(seen).map(place).collect()
}

/// The landmarks seen from a point, deepest inside its area first.
pub(super) fn seen_from(point: &Point2<f64>, areas: &[(LandmarkId, &VisibilityMap)]) -> Vec<LandmarkId> {
    let inside = areas.iter().filter(|(_, area)| area.contains(point));
    let mut seen: Vec<(f64, LandmarkId)> = inside.map(|(id, area)| (area.margin_m(point), *id)).collect();
    seen.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    seen.into_iter().map(|(_, id)| id).take(MAX_SEEN).collect()
}

impl MapTopology {
    /// The place at a point, from 0: that of the nearest free floor within [`NEAR_M`].
    pub fn place_at(&self, point: &Point2<f64>) -> Option<usize> {
        self.cell_at(point).map(|cell| self.place_of[cell] as usize - 1)
    }

    fn cell_at(&self, point: &Point2<f64>) -> Option<usize> {
        let reach = Vector2::repeat(NEAR_M);
        let near = self.floor.within(point - reach, point + reach, 1).filter(|cell| self.place_of[*cell] > 0);
        near.map(|cell| ((self.floor.centre(cell) - point).norm(), cell))
            .filter(|(distance_m, _)| *distance_m <= NEAR_M)
            .min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)))
            .map(|(_, cell)| cell)
    }

    /// Samples of the free floor with their places and clearances: point, place, metres.
    pub(super) fn samples(&self) -> impl Iterator<Item = (Point2<f64>, usize, f64)> {
        let all = self.floor.every(stride(&self.floor));
        all.filter(|cell| self.place_of[*cell] > 0).map(|cell| {
            (self.floor.centre(cell), self.place_of[cell] as usize - 1, self.floor.clearance_m[cell])
        })
    }

    /// Place and clearance of the cell at a point, if it is free.
    pub(super) fn free_at(&self, point: &Point2<f64>) -> Option<(usize, f64)> {
        let cell = self.floor.cell(point).filter(|cell| self.place_of[*cell] > 0)?;
        Some((self.place_of[cell] as usize - 1, self.floor.clearance_m[cell]))
    }

    /// The way between two points of a place: its corners and its length. It keeps [`RADIUS_M`]
    /// from walls, except at its ends. `None` if either is not in the place or next to it.
    pub fn path(
        &self,
        place: usize,
        from: &Point2<f64>,
        to: &Point2<f64>,
    ) -> Option<(Vec<Point2<f64>>, f64)> {
        let [start, end] = [self.cell_at(from)?, self.cell_at(to)?];
        let mut search = Search::new(&self.floor);
        search.from(&self.floor, start, |cell| self.place_of[cell] as usize == place + 1, |cell| cell == end);
        if search.distance_m(end).is_infinite() {
            return None;
        }
        let points = straightened(&self.floor, &search.path(end));
        let length_m = points.windows(2).map(|w| (w[1] - w[0]).norm()).sum();
        Some((points, length_m))
    }

    /// Length of the way from a place's centre to a point of it, metres; infinite without one.
    pub(super) fn way_m(&self, place: usize, to: &Point2<f64>) -> f64 {
        self.path(place, &self.places[place].centre, to).map_or(f64::INFINITY, |(_, length_m)| length_m)
    }

    /// Cells of each place that touch another one, in connected groups.
    fn found_doorways(&self, areas: &[(LandmarkId, &VisibilityMap)]) -> Vec<Doorway> {
        let mut borders: BTreeMap<(u16, u16), Vec<usize>> = BTreeMap::new();
        for cell in (0..self.place_of.len()).filter(|cell| self.place_of[*cell] > 0) {
            let place = self.place_of[cell];
            let mut others: Vec<u16> =
                self.floor.around(cell).map(|(next, _)| self.place_of[next]).filter(|o| *o > place).collect();
            others.sort_unstable();
            others.dedup();
            for other in others {
                borders.entry((place, other)).or_default().push(cell);
            }
        }
        let mut middles: Vec<(usize, [usize; 2])> = Vec::new();
        for ((a, b), cells) in borders {
            let places = [a as usize - 1, b as usize - 1];
            middles.extend(self.groups(cells).into_iter().map(|group| (self.widest(&group), places)));
        }
        let width = |cell: usize| self.floor.clearance_m[cell];
        if middles.len() > MAX_DOORWAYS {
            middles.sort_by(|a, b| width(b.0).total_cmp(&width(a.0)).then(a.cmp(b)));
            middles.truncate(MAX_DOORWAYS);
            middles.sort_by_key(|(cell, places)| (*places, *cell));
        }
        let ways = self.ways_m(&middles);
        let doorway = |((cell, places), ways_m): ((usize, [usize; 2]), [f64; 2])| {
            let middle = self.floor.centre(cell);
            let width_m = 2.0 * width(cell).max(RADIUS_M);
            Doorway { places, middle, width_m, ways_m, landmarks: seen_from(&middle, areas) }
        };
        middles.into_iter().zip(ways).map(doorway).collect()
    }

    /// Cells in groups of neighbours.
    fn groups(&self, cells: Vec<usize>) -> Vec<Vec<usize>> {
        let mut left: std::collections::BTreeSet<usize> = cells.into_iter().collect();
        let mut groups = Vec::new();
        while let Some(first) = left.pop_first() {
            let mut group = vec![first];
            let mut at = 0;
            while let Some(cell) = group.get(at).copied() {
                group.extend(self.floor.around(cell).map(|(next, _)| next).filter(|next| left.remove(next)));
                at += 1;
            }
            groups.push(group);
        }
        groups
    }

    /// The cell with the largest clearance, the lowest of equals.
    fn widest(&self, cells: &[usize]) -> usize {
        let clearance = |cell: usize| self.floor.clearance_m[cell];
        let widest =
            cells.iter().copied().max_by(|a, b| clearance(*a).total_cmp(&clearance(*b)).then(b.cmp(a)));
        widest.unwrap_or_default()
    }

    /// From the centres of both places to each middle, metres: one search for each place.
    fn ways_m(&self, middles: &[(usize, [usize; 2])]) -> Vec<[f64; 2]> {
        let mut ways = vec![[f64::INFINITY; 2]; middles.len()];
        let mut search = Search::new(&self.floor);
        let mut is_middle = vec![false; self.place_of.len()];
        for (cell, _) in middles {
            is_middle[*cell] = true;
        }
        for (place, described) in self.places.iter().enumerate() {
            let Some(start) = self.cell_at(&described.centre) else { continue };
            let is_inside = |cell: usize| self.place_of[cell] as usize == place + 1;
            search.from(&self.floor, start, is_inside, |cell| is_middle[cell]);
            for (way, (cell, places)) in ways.iter_mut().zip(middles) {
                for side in [0, 1].into_iter().filter(|side| places[*side] == place) {
                    way[side] = search.distance_m(*cell);
                }
            }
        }
        ways
    }
}
