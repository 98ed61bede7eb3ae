//! The shortest route over places and passages, as legs from one passage to the next.

use super::site_topology::{PlaceAt, SiteTopology};
use nalgebra::Point2;
use std::{
    cmp::Reverse,
    collections::{BTreeMap, BinaryHeap},
};

/// A part of a route within one place.
#[derive(Debug, Clone, PartialEq)]
pub struct Leg<K> {
    /// The place that it crosses.
    pub place: PlaceAt<K>,
    /// The passage at its end, by its index; `None` on the last leg.
    pub passage: Option<usize>,
    /// Corners of the way, metres, frame of the place's map; at least one.
    pub path: Vec<Point2<f64>>,
    /// Length of the way and of the passage after it, metres.
    pub length_m: f64,
}

/// Edges of the shortest path between two nodes, by index. Edges are two nodes and a length, which
/// is not negative. `None` without a path.
pub fn shortest(nodes: usize, edges: &[([usize; 2], f64)], from: usize, to: usize) -> Option<Vec<usize>> {
    let mut at: Vec<Vec<(usize, usize, f64)>> = vec![Vec::new(); nodes];
    for (i, ([a, b], length_m)) in edges.iter().enumerate().filter(|(_, edge)| edge.1.is_finite()) {
        at[*a].push((*b, i, *length_m));
        at[*b].push((*a, i, *length_m));
    }
    let mut best: Vec<(f64, Option<(usize, usize)>)> = vec![(f64::INFINITY, None); nodes];
    best.get_mut(from)?.0 = 0.0;
    // Not negative, so their bits are in the order of the numbers.
    let mut open = BinaryHeap::from([Reverse((0.0_f64.to_bits(), from))]);
    while let Some(Reverse((bits, node))) = open.pop() {
        if f64::from_bits(bits) > best[node].0 {
            continue;
        }
        for (next, edge, length_m) in &at[node] {
            let to_next = best[node].0 + length_m;
            if to_next < best[*next].0 {
                best[*next] = (to_next, Some((node, *edge)));
                open.push(Reverse((to_next.to_bits(), *next)));
            }
        }
    }
    best.get(to).filter(|(length_m, _)| length_m.is_finite())?;
    let mut edges = Vec::new();
    let mut node = to;
    while let Some((before, edge)) = best[node].1 {
        edges.push(edge);
        node = before;
    }
    edges.reverse();
    Some(edges)
}

impl<K: Ord + Clone> SiteTopology<K> {
    /// The legs from a point of a place (its centre if `None`) to the centre of another one. The
    /// passages are those of the shortest way over the centres of places. `None` without a way, and
    /// for a place that does not exist.
    pub fn route(
        &self,
        from: &PlaceAt<K>,
        start: Option<Point2<f64>>,
        to: &PlaceAt<K>,
    ) -> Option<Vec<Leg<K>>> {
        let all = self.maps.iter().flat_map(|(map, topology)| {
            (0..topology.places.len()).map(|place| PlaceAt { map: map.clone(), place })
        });
        let number: BTreeMap<PlaceAt<K>, usize> = all.zip(0..).collect();
        let edges: Vec<([usize; 2], f64)> =
            self.passages.iter().map(|p| (p.places.each_ref().map(|at| number[at]), p.length_m())).collect();
        let passages = shortest(number.len(), &edges, *number.get(from)?, *number.get(to)?)?;
        let centre = |at: &PlaceAt<K>| self.maps[&at.map].places[at.place].centre;
        let (mut place, mut point) = (from.clone(), start.unwrap_or_else(|| centre(from)));
        let mut legs = Vec::new();
        for index in passages {
            let passage = &self.passages[index];
            let side = usize::from(passage.places[1] == place);
            let (path, way_m) = self.maps[&place.map].path(place.place, &point, &passage.middles[side])?;
            let length_m = way_m + passage.between_m;
            legs.push(Leg { place, passage: Some(index), path, length_m });
            (place, point) = (passage.places[1 - side].clone(), passage.middles[1 - side]);
        }
        let (path, length_m) = self.maps[&place.map].path(place.place, &point, &centre(&place))?;
        legs.push(Leg { place, passage: None, path, length_m });
        Some(legs)
    }
}
