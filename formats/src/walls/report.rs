//! What an import took from a file, and what it left: figures, one sentence where it left much, and
//! a picture.

use super::{
    evidence::{Evidence, explained, near, reach_cells},
    grid::{CellState, GridError, OccupancyGrid},
    map_file::Wall,
    picture,
};
use crate::svg::{put, text};
use base64::{Engine as _, prelude::BASE64_STANDARD};
use image::ColorType;

/// Below this share of explained cells an import is not to be trusted unseen.
pub const MIN_EXPLAINED: f64 = 0.9;
/// Longest side of the picture, pixels.
const SIDE_PX: f64 = 1400.0;
/// Height of the line of words under it.
const WORDS_PX: f64 = 24.0;
/// Points along a wall that are looked at, per cell.
const POINTS_PER_CELL: f64 = 2.0;
/// Colours of the picture.
const UNEXPLAINED: [u8; 3] = [214, 39, 40];
const WALLS: &str = "#1f77b4";

/// What an import took from a file.
#[derive(Debug, Clone, PartialEq)]
pub struct ImportReport {
    /// Wall segments.
    pub segments: usize,
    /// Their length, metres.
    pub length_m: f64,
    /// Of a grid: how much of it they explain.
    pub grid: Option<GridReport>,
    /// What a person should know of how it was read.
    pub note: Option<String>,
}

/// How much of a grid its walls explain. A wall explains the cells within 0.2 m of it (a cell's
/// side, where that is more).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GridReport {
    /// Cells above `occupied_thresh`.
    pub occupied: usize,
    /// Cells below it that are darker than the map's unknown ones: walls seen seldom.
    pub grey: usize,
    /// Free cells.
    pub free: usize,
    /// Unknown cells, without the grey ones.
    pub unknown: usize,
    /// Occupied and grey cells within 0.2 m of free ones: those that walls are to explain. Insides
    /// of blocks and what lies behind unknown floor are not among them.
    pub wall_cells: usize,
    /// Those of them that a wall explains.
    pub wall_cells_explained: usize,
    /// Those of all occupied cells that a wall explains.
    pub occupied_explained: usize,
    /// Share of the walls' length within 0.2 m of an occupied or grey cell, 0 to 1.
    pub length_on_wall_cells: f64,
}

impl GridReport {
    /// Share of `wall_cells` that walls explain, 0 to 1; 1 where there are none.
    pub fn share_explained(&self) -> f64 {
        if self.wall_cells == 0 { 1.0 } else { self.wall_cells_explained as f64 / self.wall_cells as f64 }
    }

    /// One sentence where there are no wall cells, or walls explain less than [`MIN_EXPLAINED`] of
    /// them.
    pub fn warning(&self) -> Option<String> {
        if self.wall_cells == 0 {
            let sentence =
                "The grid has no walls beside free floor: check negate and the thresholds of its .yaml.";
            return Some(sentence.to_owned());
        }
        let share = self.share_explained();
        (share < MIN_EXPLAINED).then(|| {
            let missed = self.wall_cells - self.wall_cells_explained;
            format!(
                "Walls explain {:.0} % of the grid's wall cells, less than {:.0} %: look at the {missed} others, red in the picture, before you use this map.",
                100.0 * share,
                100.0 * MIN_EXPLAINED
            )
        })
    }
}

/// A grid that was imported, for its report and its picture.
#[derive(Debug, Clone)]
pub(super) struct GridImport {
    grid: OccupancyGrid,
    evidence: Evidence,
    is_explained: Vec<bool>,
}

impl GridImport {
    pub(super) fn new(grid: OccupancyGrid, evidence: Evidence, walls: &[Wall]) -> Self {
        let is_explained = explained(&grid, walls);
        Self { grid, evidence, is_explained }
    }

    pub(super) fn report(&self, walls: &[Wall]) -> GridReport {
        let count = |state| self.grid.cells.iter().filter(|c| **c == state).count();
        let reachable = self.evidence.is_reachable.iter().zip(&self.is_explained).filter(|(r, _)| **r);
        let occupied = self.grid.cells.iter().zip(&self.is_explained);
        GridReport {
            occupied: count(CellState::Occupied),
            grey: self.evidence.grey,
            free: count(CellState::Free),
            unknown: count(CellState::Unknown) - self.evidence.grey,
            wall_cells: reachable.clone().count(),
            wall_cells_explained: reachable.filter(|(_, e)| **e).count(),
            occupied_explained: occupied.filter(|(c, e)| **c == CellState::Occupied && **e).count(),
            length_on_wall_cells: self.length_on_wall_cells(walls),
        }
    }

    fn length_on_wall_cells(&self, walls: &[Wall]) -> f64 {
        let (width, height) = (self.grid.width, self.grid.height);
        let is_near = near((width, height), &self.evidence.is_wall, reach_cells(self.grid.resolution_m));
        let (mut on, mut all) = (0.0, 0.0);
        for wall in walls {
            let [a, b] = [wall.a, wall.b].map(|p| self.grid.to_cells(p));
            let length = (b[0] - a[0]).hypot(b[1] - a[1]);
            let points = (length * POINTS_PER_CELL).ceil().max(1.0);
            let is_on = |k: usize| {
                let s = (k as f64 + 0.5) / points;
                let at = [0, 1].map(|i| (a[i] + s * (b[i] - a[i])).floor());
                let cell = [0, 1].map(|i| at[i].clamp(0.0, [width, height][i] as f64 - 1.0) as usize);
                is_near[cell[1] * width + cell[0]]
            };
            let hits = (0..points as usize).filter(|k| is_on(*k)).count();
            on += length * hits as f64 / points;
            all += length;
        }
        if all > 0.0 { on / all } else { 1.0 }
    }

    /// The grid with its walls, and in red the wall cells that they do not explain, as SVG.
    pub(super) fn svg(&self, walls: &[Wall]) -> Result<String, GridError> {
        let (width, height) = (self.grid.width as f64, self.grid.height as f64);
        let scale = SIDE_PX / width.max(height);
        let (w, h) = (width * scale, height * scale);
        let mut svg = String::new();
        put(
            &mut svg,
            &format!(
                r#"<svg xmlns="http://www.w3.org/2000/svg" width="{w:.0}" height="{:.0}" font-family="sans-serif" font-size="14">"#,
                h + WORDS_PX
            ),
        );
        put(&mut svg, r#"<rect width="100%" height="100%" fill="white"/>"#);
        let png = BASE64_STANDARD.encode(self.png()?);
        put(
            &mut svg,
            &format!(
                r#"<image width="{w:.1}" height="{h:.1}" style="image-rendering:pixelated" href="data:image/png;base64,{png}"/>"#
            ),
        );
        for wall in walls {
            let [a, b] = [wall.a, wall.b]
                .map(|p| self.grid.to_cells(p))
                .map(|[x, y]| (x * scale, (height - y) * scale));
            put(
                &mut svg,
                &format!(
                    r#"<path d="M{:.1} {:.1}L{:.1} {:.1}" stroke="{WALLS}" stroke-width="1.6"/>"#,
                    a.0, a.1, b.0, b.1
                ),
            );
        }
        let report = self.report(walls);
        let words = format!(
            "{} segments (blue), {:.1} % of {} wall cells within 0.2 m; the others are red",
            walls.len(),
            100.0 * report.share_explained(),
            report.wall_cells
        );
        text(&mut svg, (4.0, h + WORDS_PX - 8.0), "start", &words);
        put(&mut svg, "</svg>");
        Ok(svg)
    }

    /// The cells, top row first: free white, unknown light, walls dark, unexplained ones red.
    fn png(&self) -> Result<Vec<u8>, GridError> {
        let (width, height) = (self.grid.width, self.grid.height);
        let mut colours = Vec::with_capacity(3 * width * height);
        for at in (0..height).rev().flat_map(|y| y * width..(y + 1) * width) {
            let is_missed = self.evidence.is_reachable[at] && !self.is_explained[at];
            let colour = match self.grid.cells[at] {
                _ if is_missed => UNEXPLAINED,
                CellState::Occupied => [60; 3],
                CellState::Free => [255; 3],
                CellState::Unknown if self.evidence.is_wall[at] => [120; 3],
                CellState::Unknown => [205; 3],
            };
            colours.extend(colour);
        }
        picture::png(&colours, (width, height), ColorType::Rgb8)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use map::pose2::Pose2;

    /// Four rows of twenty occupied cells between free ones, 0.1 m each.
    fn imported(walls: &[Wall]) -> GridImport {
        let mut grid = OccupancyGrid::empty((20, 12), 0.1, Pose2::new(1.0, 2.0, 0.0));
        for y in 0..12 {
            for _ in 0..20 {
                match y {
                    4..8 => grid.push(CellState::Occupied, Some(1.0)),
                    _ => grid.push(CellState::Free, Some(0.0)),
                }
            }
        }
        let evidence = Evidence::of(&grid);
        GridImport::new(grid, evidence, walls)
    }

    #[test]
    fn a_report_says_what_walls_explain_and_what_they_do_not() {
        // Along the lower face, from its left end to the middle.
        let half = [Wall::between([2.0, 2.4], [1.0, 2.4])];
        let report = imported(&half).report(&half);
        assert_eq!((report.occupied, report.free, report.unknown, report.grey), (80, 160, 0, 0));
        // Two rows of ten, and beyond the end two more cells of each row, the second of the upper
        // row too far.
        assert_eq!((report.wall_cells, report.wall_cells_explained, report.occupied_explained), (80, 23, 23));
        assert!((report.length_on_wall_cells - 1.0).abs() < 1e-9);
        let warning = report.warning().unwrap();
        assert!(
            warning.contains("29 % of the grid's wall cells, less than 90 %: look at the 57 others"),
            "{warning}"
        );
        let beside = [Wall::between([1.0, 5.0], [2.0, 5.0])];
        assert!(imported(&beside).report(&beside).length_on_wall_cells < 1e-9);
        let both = [half[0], Wall::between([3.0, 2.4], [2.0, 2.4]), Wall::between([1.0, 2.8], [3.0, 2.8])];
        assert_eq!(imported(&both).report(&both).warning(), None);
        let mut none = report;
        none.wall_cells = 0;
        assert!(none.warning().unwrap().contains("check negate"));
    }

    #[test]
    fn the_picture_has_every_unexplained_cell_in_red() {
        let half = [Wall::between([2.0, 2.4], [1.0, 2.4])];
        let svg = imported(&half).svg(&half).unwrap();
        let data = svg.split("base64,").nth(1).and_then(|s| s.split('"').next()).unwrap();
        let png = image::load_from_memory(&BASE64_STANDARD.decode(data).unwrap()).unwrap().to_rgb8();
        assert_eq!(png.pixels().filter(|p| p.0 == UNEXPLAINED).count(), 57);
        // The upper face is red all along, and the picture's top row is the map's.
        assert_eq!((png.get_pixel(0, 4).0, png.get_pixel(0, 7).0), (UNEXPLAINED, [60; 3]));
        assert_eq!(svg.matches(WALLS).count(), 1, "one wall");
        assert!(svg.contains("1 segments (blue), 28.7 % of 80 wall cells"), "{svg}");
    }
}
