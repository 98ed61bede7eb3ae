//! The floor as a grid: how far each cell is from the nearest wall.

use crate::{
    segments::LaserSegment,
    visibility::{VisibilityMap, distance_to_segment},
};
use nalgebra::{Point2, Vector2};

/// Side of a cell of a map of up to [`MAX_CELLS`], metres.
pub const CELL_M: f64 = 0.1;
/// Most cells; a larger map has larger cells.
pub const MAX_CELLS: usize = 1 << 18;
/// Largest side of a cell, metres. Two neighbouring free cells have no wall between them: a wall
/// passes within 0.71 sides of one of them, which is less than [`RADIUS_M`].
pub const MAX_CELL_M: f64 = 0.3;
/// A cell nearer to a wall than this is not free: half the width of a narrow robot, metres.
pub const RADIUS_M: f64 = 0.25;
/// Clearance is not measured beyond this, metres.
const MAX_CLEARANCE_M: f64 = 1.0;

/// The floor of a map does not fit the grid.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error(
    "the floor of {width_m:.0} x {height_m:.0} m has no places: at most {MAX_CELLS} cells of {MAX_CELL_M} m"
)]
pub struct TooLarge {
    /// Extent along x, metres.
    pub width_m: f64,
    /// Extent along y, metres.
    pub height_m: f64,
}

/// Cells of the box around walls and visibility areas, row by row from its lowest x and y.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Floor {
    pub(super) cell_m: f64,
    pub(super) columns: usize,
    origin: Point2<f64>,
    /// Distance of each cell's centre from the nearest wall, at most [`MAX_CLEARANCE_M`].
    pub(super) clearance_m: Vec<f64>,
}

impl Floor {
    pub(super) fn new(walls: &[LaserSegment], areas: &[&VisibilityMap]) -> Result<Self, TooLarge> {
        let points = walls
            .iter()
            .flat_map(|wall| [wall.a, wall.b])
            .chain(areas.iter().filter_map(|area| box_of(area)).flatten());
        let Some((low, high)) = box_around(points) else {
            let origin = Point2::origin();
            return Ok(Self { cell_m: CELL_M, columns: 0, origin, clearance_m: Vec::new() });
        };
        let size = high - low;
        // A row and a column more than the quotient.
        let cells = |cell_m: f64| (size.x / cell_m + 1.0).floor() * (size.y / cell_m + 1.0).floor();
        let sides = (0..=20).map(|i| CELL_M + 0.01 * f64::from(i));
        let Some(cell_m) = sides.into_iter().find(|side| cells(*side) <= MAX_CELLS as f64) else {
            return Err(TooLarge { width_m: size.x, height_m: size.y });
        };
        let [columns, rows] = [size.x, size.y].map(|extent| (extent / cell_m + 1.0).floor() as usize);
        let clearance_m = vec![MAX_CLEARANCE_M; columns * rows];
        let mut floor = Self { cell_m, columns, origin: low, clearance_m };
        for wall in walls {
            floor.add(wall);
        }
        Ok(floor)
    }

    /// Lowers the clearance around a wall, in pieces: the box of a long oblique wall is large.
    fn add(&mut self, wall: &LaserSegment) {
        let along = wall.b - wall.a;
        let pieces = (along.norm() / MAX_CLEARANCE_M).ceil().max(1.0);
        for i in 0..pieces as usize {
            let (a, b) = (wall.a + along * (i as f64 / pieces), wall.a + along * ((i + 1) as f64 / pieces));
            let reach = Vector2::repeat(MAX_CLEARANCE_M);
            for cell in self.within(a.inf(&b) - reach, a.sup(&b) + reach, 1) {
                let distance_m = distance_to_segment(&self.centre(cell), &a, &b);
                self.clearance_m[cell] = self.clearance_m[cell].min(distance_m);
            }
        }
    }

    /// Cells with their centre in a box, every `stride`th column and row of the floor.
    pub(super) fn within(
        &self,
        low: Point2<f64>,
        high: Point2<f64>,
        stride: usize,
    ) -> impl Iterator<Item = usize> + use<> {
        let columns = self.columns;
        let rows = self.clearance_m.len().checked_div(columns).unwrap_or(0);
        let range = move |low: f64, high: f64, origin: f64, count: usize, cell_m: f64| {
            let first = ((low - origin) / cell_m).ceil().max(0.0) as usize;
            let end = (((high - origin) / cell_m).floor() + 1.0).max(0.0) as usize;
            (first.div_ceil(stride) * stride..end.min(count)).step_by(stride)
        };
        let across = range(low.x, high.x, self.origin.x, columns, self.cell_m);
        let up = range(low.y, high.y, self.origin.y, rows, self.cell_m);
        up.flat_map(move |row| across.clone().map(move |column| row * columns + column))
    }

    /// Every `stride`th column and row.
    pub(super) fn every(&self, stride: usize) -> impl Iterator<Item = usize> + use<> {
        self.within(self.origin, Point2::from(Vector2::repeat(f64::INFINITY)), stride)
    }

    /// Centre of a cell, metres, map frame.
    pub(super) fn centre(&self, cell: usize) -> Point2<f64> {
        let (row, column) = (cell / self.columns, cell % self.columns);
        self.origin + Vector2::new(column as f64, row as f64) * self.cell_m
    }

    /// The cell that contains a point, if one does.
    pub(super) fn cell(&self, point: &Point2<f64>) -> Option<usize> {
        let at = (point - self.origin) / self.cell_m;
        let (column, row) = (at.x.round(), at.y.round());
        let is_inside = column >= 0.0 && row >= 0.0 && (column as usize) < self.columns;
        let cell = is_inside.then(|| row as usize * self.columns + column as usize)?;
        (cell < self.clearance_m.len()).then_some(cell)
    }

    /// The up to eight cells around a cell, lowest first, with their distance in cells.
    pub(super) fn around(&self, cell: usize) -> impl Iterator<Item = (usize, f64)> + use<> {
        let (columns, cells) = (self.columns as isize, self.clearance_m.len() as isize);
        let (row, column) = (cell as isize / columns, cell as isize % columns);
        let steps = (-1..=1).flat_map(|up| (-1..=1).map(move |right| (up, right)));
        steps.filter(|step| *step != (0, 0)).filter_map(move |(up, right)| {
            let next = (row + up) * columns + column + right;
            let is_inside = (0..columns).contains(&(column + right)) && (0..cells).contains(&next);
            let distance = if up != 0 && right != 0 { std::f64::consts::SQRT_2 } else { 1.0 };
            is_inside.then_some((next as usize, distance))
        })
    }

    pub(super) fn is_free(&self, cell: usize) -> bool {
        self.clearance_m[cell] >= RADIUS_M
    }
}

/// The box around an area; `None` without one.
pub(super) fn box_of(area: &VisibilityMap) -> Option<[Point2<f64>; 2]> {
    let points = area.polygons().iter().flat_map(|polygon| polygon.corners.iter().copied());
    box_around(points).map(|(low, high)| [low, high])
}

fn box_around(points: impl Iterator<Item = Point2<f64>>) -> Option<(Point2<f64>, Point2<f64>)> {
    points.map(|p| (p, p)).reduce(|(low, high), (p, _)| (low.inf(&p), high.sup(&p)))
}
