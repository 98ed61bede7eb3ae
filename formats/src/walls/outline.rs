//! From an occupancy grid to straight walls: the border of the free floor is followed, cut where it
//! bends, and every piece with walls behind it is fitted with a line.
//!
//! In: a grid. Out: walls in map metres, the free side on their left. Borders between free and
//! unknown cells are walls where they close a gap in one; elsewhere they are where the laser's
//! sight ended.

use super::{
    border::{self, BorderEdge},
    evidence::{Evidence, for_cells_beside, reach_cells},
    grid::OccupancyGrid,
    map_file::Wall,
};
use map::segments::MIN_SEGMENT_M;
use nalgebra::{Matrix2, Point2, Vector2};

/// The border may leave the chord of a piece by this much, metres, and at least so many cells: a
/// stair of cells is a straight wall.
const CUT_M: f64 = 0.08;
const CUT_CELLS: f64 = 1.2;
/// Longest part of a border that is cut in one go: the time of cutting may grow with its square.
const MAX_CHAIN: usize = 1 << 13;
/// Longest part of a wall without any wall cell, metres.
const GAP_M: f64 = 0.5;
/// A short piece is kept if it alone explains so many wall cells; fewer are noise of the mapping.
/// Chosen on the maps willow-2010 and willow-full of `maps-ros-grid`: 1 gives a fifth more walls, 8
/// loses legs of tables.
const MIN_EXPLAINED_CELLS: usize = 3;

/// The walls of a grid. Pieces shorter than `min_length_m` are left out unless they explain wall
/// cells that no longer one does.
pub(super) fn walls(grid: &OccupancyGrid, evidence: &Evidence, min_length_m: f64) -> Vec<Wall> {
    let cut = (CUT_M / grid.resolution_m).max(CUT_CELLS);
    let gap = (GAP_M / grid.resolution_m).ceil() as usize;
    let mut found = Vec::new();
    for chain in border::chains(grid, evidence) {
        for part in chain.chunks(MAX_CHAIN) {
            for (i, j) in pieces(part, cut) {
                found.extend(with_walls(&part[i..=j], gap).filter_map(fitted));
            }
        }
    }
    // Cells may be smaller than the shortest wall of a map.
    found.retain(|[a, b]: &Line| (b - a).norm() * grid.resolution_m >= MIN_SEGMENT_M);
    let found = needed(grid, evidence, found, min_length_m / grid.resolution_m);
    found.into_iter().map(|[a, b]| Wall::between(grid.to_map(a.x, a.y), grid.to_map(b.x, b.y))).collect()
}

type Line = [Point2<f64>; 2];

/// Index ranges of edges that lie near their chord.
fn pieces(chain: &[BorderEdge], cut: f64) -> Vec<(usize, usize)> {
    let (mut done, mut open) = (Vec::new(), vec![(0, chain.len() - 1)]);
    while let Some((i, j)) = open.pop() {
        let chord = chain[j].middle - chain[i].middle;
        let length = chord.norm();
        let off = |k: usize| {
            let d = chain[k].middle - chain[i].middle;
            if length > 1.0 { (chord.perp(&d) / length).abs() } else { d.norm() }
        };
        let farthest = (i + 1..j).max_by(|a, b| off(*a).total_cmp(&off(*b)));
        match farthest {
            Some(k) if off(k) > cut => open.extend([(k, j), (i, k)]),
            _ => done.push((i, j)),
        }
    }
    done
}

/// The parts of a piece that have walls behind them, gaps of up to `gap` edges included.
fn with_walls(piece: &[BorderEdge], gap: usize) -> impl Iterator<Item = &[BorderEdge]> {
    let mut runs: Vec<(usize, usize)> = Vec::new();
    for at in (0..piece.len()).filter(|at| piece[*at].has_wall) {
        match runs.last_mut() {
            Some((_, end)) if at - *end <= gap + 1 => *end = at,
            _ => runs.push((at, at)),
        }
    }
    runs.into_iter().map(|(i, j)| &piece[i..=j])
}

/// The line through the faces of the wall's cells; both ends on it, half an edge beyond the
/// outermost middles.
fn fitted(edges: &[BorderEdge]) -> Option<Line> {
    let faces: Vec<Vector2<f64>> = edges.iter().filter(|e| e.has_wall).map(|e| e.middle.coords).collect();
    let (first, last) = (faces.first()?, faces.last()?);
    let centre = faces.iter().sum::<Vector2<f64>>() / faces.len() as f64;
    let scatter: Matrix2<f64> = faces.iter().map(|m| (m - centre) * (m - centre).transpose()).sum();
    let angle = 0.5 * (2.0 * scatter[(0, 1)]).atan2(scatter[(0, 0)] - scatter[(1, 1)]);
    let mut along = Vector2::new(angle.cos(), angle.sin());
    let way = along.dot(&(last - first));
    if way.abs() < 1e-9 {
        return None;
    }
    along *= way.signum();
    let foot =
        |p: &Vector2<f64>, beyond: f64| Point2::from(centre + along * (along.dot(&(p - centre)) + beyond));
    Some([foot(first, -0.5), foot(last, 0.5)])
}

/// The lines of at least `min_length` cells, and of the others those that explain what longer ones
/// do not.
fn needed(grid: &OccupancyGrid, evidence: &Evidence, mut lines: Vec<Line>, min_length: f64) -> Vec<Line> {
    let length = |[a, b]: &Line| (b - a).norm();
    lines.sort_by(|a, b| length(b).total_cmp(&length(a)));
    let size = (grid.width, grid.height);
    let reach = reach_cells(grid.resolution_m);
    let mut is_open = evidence.is_reachable.clone();
    lines.retain(|line| {
        let mut cells = 0;
        for_cells_beside(size, line.map(|p| [p.x, p.y]), reach, |at| {
            cells += usize::from(is_open[at]);
            is_open[at] = false;
        });
        cells >= MIN_EXPLAINED_CELLS || length(line) >= min_length
    });
    lines
}
