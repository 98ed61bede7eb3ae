//! The image band around a proposed side, resampled, with the lines in it that edges support. In:
//! two points. Out: statistics along each line. `side_lines` finds the lines, `choose_sides` picks
//! the border.

use crate::detect::{
    border_model::{
        band_row::Row,
        feature_constants::{
            CORNER_SHARE, MAX_BAND_SAMPLES, MIN_BAND_SAMPLES, MIN_SIDE_PX, PX_PER_SAMPLE, REACH_PX,
            REACH_SHARE, STEPS_OUTSIDE,
        },
        side_lines::{self, Peak, Peaks, SideLine},
    },
    edge_support::{fixed_point::Fixed, gradients::Gradients},
};
use fearless_simd::{Level, dispatch};
use nalgebra::{Point2, Vector2};

/// A number for each row; unused rows are 0.
type Rows = [i32; MAX_BAND_SAMPLES];

/// The image around a side, a row for each sample along it, a column for each pixel across, from
/// inside outwards.
#[derive(Debug, Clone)]
pub struct Band {
    from: Point2<f64>,
    direction: Vector2<f64>,
    normal: Vector2<f64>,
    length_px: f64,
    /// Offset of column 0.
    first_px: i32,
    columns: usize,
    rows: usize,
    /// The columns of each row that lie in the image: from the first to before the second.
    inside: [Rows; 2],
    /// Derivative along the normal; 0 outside the image.
    step: Vec<f32>,
    level: Vec<u8>,
    /// Prefix sums: how many pixels of the row before a column are textured; one column more than
    /// the band has.
    rough: Vec<u16>,
    /// Outermost column of each row with an edge along the side of at least each of
    /// [`STEPS_OUTSIDE`]; -1 without.
    outermost: [Rows; 2],
    /// The lines, by descending support when found.
    pub lines: Vec<SideLine>,
}

impl Band {
    /// Resamples the band of the side from `from` to `to`, of a quad walked clockwise on screen
    /// that reaches `extent_px` across the side, and finds its lines. None for a side shorter than
    /// 4 px.
    pub fn new(g: &Gradients, from: &Point2<f64>, to: &Point2<f64>, extent_px: f64) -> Option<Self> {
        let length_px = (to - from).norm();
        if !(length_px >= MIN_SIDE_PX && length_px.is_finite() && extent_px.is_finite()) {
            return None;
        }
        let direction = (to - from) / length_px;
        let reach = (REACH_SHARE * extent_px).clamp(REACH_PX.0, REACH_PX.1) as i32;
        let mut band = Self {
            from: *from,
            direction,
            normal: Vector2::new(direction.y, -direction.x),
            length_px,
            first_px: -reach,
            columns: (2 * reach + 1) as usize,
            rows: ((length_px / PX_PER_SAMPLE) as usize).clamp(MIN_BAND_SAMPLES, MAX_BAND_SAMPLES),
            inside: [[0; MAX_BAND_SAMPLES]; 2],
            step: Vec::new(),
            level: Vec::new(),
            rough: Vec::new(),
            outermost: [[-1; MAX_BAND_SAMPLES]; 2],
            lines: Vec::new(),
        };
        dispatch!(Level::new(), _s => band.fill(g));
        Some(band)
    }

    #[expect(
        clippy::inline_always,
        reason = "an instruction set holds only in what is inlined where it was chosen"
    )]
    #[inline(always)]
    fn fill(&mut self, g: &Gradients) {
        let cells = self.rows * self.columns;
        self.step = vec![0.0; cells];
        self.level = vec![0; cells];
        self.rough = vec![0; cells + self.rows];
        let (across, normal) = (Fixed::step(&self.normal), self.normal.cast().into());
        let mut pixels = Row::EMPTY;
        let mut peaks = Peaks::with_capacity(PEAKS_OF_A_ROW * self.rows);
        for row in 0..self.rows {
            let along = self.along(row);
            let start = Fixed::point(&self.at(along * self.length_px, f64::from(self.first_px)));
            let cells = row * self.columns..(row + 1) * self.columns;
            let (steps, levels) = (&mut self.step[cells.clone()], &mut self.level[cells]);
            (self.inside[0][row], self.inside[1][row]) =
                pixels.read(g, (start, across), normal, (steps, levels));
            pixels.count_rough(&mut self.rough[row * (self.columns + 1)..(row + 1) * (self.columns + 1)]);
            for (outermost, least) in self.outermost.iter_mut().zip(STEPS_OUTSIDE) {
                outermost[row] = pixels.outermost(self.columns, least);
            }
            pixels.peaks(steps, |column, shift| {
                peaks.push(Peak {
                    row: row as u32,
                    along: (along - 0.5) as f32,
                    offset_px: (self.first_px + column as i32) as f32 + shift,
                    step: steps[column],
                });
            });
        }
        self.lines = side_lines::find(&peaks, self.rows, (self.first_px, self.columns), self.length_px);
    }

    /// Position of a row along the side, 0 to 1.
    fn along(&self, row: usize) -> f64 {
        CORNER_SHARE + (1.0 - 2.0 * CORNER_SHARE) * (row as f64 + 0.5) / self.rows as f64
    }

    fn at(&self, along_px: f64, offset_px: f64) -> Point2<f64> {
        self.from + self.direction * along_px + self.normal * offset_px
    }

    /// The line's ends, beside the ends of the side.
    pub fn ends(&self, line: &SideLine) -> [Point2<f64>; 2] {
        [
            self.at(0.0, line.offset_px - 0.5 * line.slope_px),
            self.at(self.length_px, line.offset_px + 0.5 * line.slope_px),
        ]
    }

    /// The statistics along one of its lines.
    pub fn along_line(&self, line: &SideLine) -> AlongLine<'_> {
        let mut column = [0; MAX_BAND_SAMPLES];
        for (row, column) in column.iter_mut().enumerate().take(self.rows) {
            let at = line.offset_px + line.slope_px * (self.along(row) - 0.5) - f64::from(self.first_px);
            *column = columns(at);
        }
        AlongLine { band: self, column }
    }
}

/// Peaks of a row that memory is taken for at first.
const PEAKS_OF_A_ROW: usize = 8;

/// Fractional bits of a column in fixed point.
const BITS: u32 = 16;

/// A column position in fixed point, clamped far outside any band.
#[inline]
fn columns(x: f64) -> i32 {
    const FARTHEST: f64 = 8192.0;
    (x.clamp(-FARTHEST, FARTHEST) * f64::from(1 << BITS)) as i32
}

/// A line in its band. Strips beside it go from one offset to another, positive ones outwards.
#[derive(Debug, Clone)]
pub struct AlongLine<'a> {
    band: &'a Band,
    /// Its column in each row, see [`columns`].
    column: Rows,
}

impl AlongLine<'_> {
    /// The columns of a strip that lie in the image, row by row.
    #[inline]
    fn strip(&self, (from_px, to_px): (f64, f64)) -> impl Iterator<Item = (usize, std::ops::Range<usize>)> {
        let (from, to) = (columns(from_px) + (1 << BITS) - 1, columns(to_px));
        let rows = self.column.iter().zip(self.band.inside[0].iter().zip(&self.band.inside[1]));
        rows.take(self.band.rows).enumerate().map(move |(row, (at, (first, end)))| {
            let (low, high) = (((at + from) >> BITS).max(*first), (((at + to) >> BITS) + 1).min(*end));
            (row, low as usize..high.max(low) as usize)
        })
    }

    /// Number of pixels of a strip in the image, and how many of them are textured.
    pub fn rough(&self, range_px: (f64, f64)) -> (usize, usize) {
        let stride = self.band.columns + 1;
        self.strip(range_px).filter(|(_, columns)| !columns.is_empty()).fold(
            (0, 0),
            |(in_image, rough), (row, columns)| {
                let sums = &self.band.rough[row * stride..(row + 1) * stride];
                (in_image + columns.len(), rough + usize::from(sums[columns.end] - sums[columns.start]))
            },
        )
    }

    /// Calls `row` with the grey levels of each row of a strip in the image; returns the number of
    /// pixels.
    #[inline]
    pub fn levels(&self, range_px: (f64, f64), row: impl FnMut(&[u8])) -> usize {
        self.each(&self.band.level, range_px, row)
    }

    /// The same with the steps.
    #[inline]
    pub fn steps(&self, range_px: (f64, f64), row: impl FnMut(&[f32])) -> usize {
        self.each(&self.band.step, range_px, row)
    }

    #[inline]
    fn each<T>(&self, cells: &[T], range_px: (f64, f64), mut row_of: impl FnMut(&[T])) -> usize {
        let mut in_image = 0;
        for (row, columns) in self.strip(range_px).filter(|(_, columns)| !columns.is_empty()) {
            in_image += columns.len();
            let start = row * self.band.columns;
            row_of(&cells[start + columns.start..start + columns.end]);
        }
        in_image
    }

    /// Share of the samples with an edge along the side further out than `beyond_px`, for both
    /// thresholds of `STEPS_OUTSIDE`.
    pub fn edges_outside(&self, beyond_px: f64) -> [f64; 2] {
        let from = columns(beyond_px) + (1 << BITS) - 1;
        self.band.outermost.each_ref().map(|outermost| {
            let rows = outermost.iter().zip(&self.column).take(self.band.rows);
            let with = rows.filter(|(last, at)| **last >= ((**at + from) >> BITS).max(0)).count();
            with as f64 / self.band.rows as f64
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        detect::{
            border_model::feature_constants::MAX_LINES,
            edges::edge_map::{EdgeParams, edges},
            tests::fixtures::render,
        },
        frame::GrayImage,
    };

    fn band(image: &GrayImage, from: [f64; 2], to: [f64; 2], extent_px: f64) -> Option<Band> {
        let map = edges(image, &EdgeParams::default());
        let g = Gradients { image, gx: map.gx(), gy: map.gy() };
        Band::new(&g, &Point2::from(from), &Point2::from(to), extent_px)
    }

    #[test]
    fn lines_beside_a_side_are_found_at_their_offsets() {
        // A frame with an inner border 12 px in, and a line 20 px above; slightly slanted.
        let frame = [[50.0, 80.2], [250.0, 84.2], [250.0, 200.0], [50.0, 200.0]];
        let inner = [[62.0, 92.2], [238.0, 96.2], [238.0, 188.0], [62.0, 188.0]];
        let above = [[0.0, 10.0], [300.0, 10.0], [300.0, 64.2], [0.0, 58.2]];
        let image = render(300, 240, 200, &[(above, 120), (frame, 60), (inner, 160)]);
        let band = band(&image, [50.0, 83.0], [250.0, 83.0], 120.0).unwrap();
        let offset = |wanted: f64| {
            let near = |l: &&SideLine| (l.offset_px - wanted).abs() < 0.3;
            *band.lines.iter().find(near).unwrap_or_else(|| panic!("{wanted}: {:?}", band.lines))
        };
        // Out of the quad is up here; the middle of the frame's upper side is at 82.2, of the inner
        // one's at 94.2.
        let (side, inside, outside) = (offset(0.8), offset(-11.2), offset(21.8));
        assert!(side.support > 0.95 && side.sign > 0.99 && inside.sign < -0.99 && outside.sign < -0.99);
        assert!((side.slope_px + 4.0).abs() < 0.3, "{side:?}");
        let [from, to] = band.ends(&side);
        assert!((from.y - 80.2).abs() < 0.3 && (to.y - 84.2).abs() < 0.3, "{from} {to}");
    }

    #[test]
    fn the_size_of_bands_and_the_number_of_lines_are_bounded() {
        let stripes = GrayImage::from_fn(600, 600, |_, v| if v / 5 % 2 == 0 { 40 } else { 220 });
        let band_ = band(&stripes, [20.0, 300.0], [580.0, 300.0], 1e6).unwrap();
        assert_eq!(band_.lines.len(), MAX_LINES);
        assert!(band_.lines.iter().all(|l| l.offset_px.abs() <= REACH_PX.1 + 1.0));
        assert!(band(&stripes, [20.0, 300.0], [23.0, 300.0], 100.0).is_none());
        assert!(band(&stripes, [20.0, 300.0], [f64::NAN, 300.0], 100.0).is_none());
        // No band wholly outside the image.
        assert!(band(&stripes, [-300.0, -300.0], [-200.0, -300.0], 100.0).unwrap().lines.is_empty());
    }

    #[test]
    fn strips_contain_the_rows_between_two_offsets() {
        // Grey levels equal the row of the image; the side runs along row 50, the outside of the
        // quad is up.
        let image = GrayImage::from_fn(300, 200, |_, v| v as u8);
        let band = band(&image, [50.0, 50.0], [250.0, 50.0], 80.0).unwrap();
        let line = SideLine { offset_px: 0.25, slope_px: 0.0, support: 1.0, sign: 1.0, step: 1.0 };
        let levels = |range| {
            let mut all = std::collections::BTreeSet::new();
            let in_image = band.along_line(&line).levels(range, |levels| all.extend(levels));
            assert_eq!(in_image, band.along_line(&line).rough(range).0);
            (in_image / MAX_BAND_SAMPLES, all.into_iter().collect::<Vec<_>>())
        };
        // From 1.25 to 4.25 above row 50: rows 48, 47 and 46.
        assert_eq!(levels((1.0, 4.0)), (3, vec![46, 47, 48]));
        assert_eq!(levels((-2.25, -0.25)), (3, vec![50, 51, 52]));
        assert_eq!(levels((4.0, 1.0)), (0, vec![]));
        // At most the width of the band: a quarter of 80 px to each side.
        assert_eq!(levels((18.0, 1e9)), (2, vec![30, 31]));
    }

    #[test]
    fn strips_are_clipped_at_the_image_border() {
        let image = GrayImage::from_fn(300, 200, |u, v| if v < 25 { 0 } else { (u / 2 % 2 * 200) as u8 });
        // Rows 191 to 199 lie further in; then the image ends.
        let low = band(&image, [50.0, 190.0], [250.0, 190.0], 200.0).unwrap();
        let band = band(&image, [50.0, 28.0], [250.0, 28.0], 200.0).unwrap();
        let line = SideLine { offset_px: 0.0, slope_px: 0.0, support: 1.0, sign: 1.0, step: 1.0 };
        assert_eq!(low.along_line(&line).rough((-40.0, -0.5)).0, 9 * MAX_BAND_SAMPLES);
        let along = band.along_line(&line);
        // Rows 27 to 0 of the image lie further out, however wide the strip.
        assert_eq!(along.rough((0.5, 40.0)).0, 28 * MAX_BAND_SAMPLES);
        let (in_image, rough) = along.rough((-20.0, -3.0));
        assert_eq!((in_image, rough), (18 * MAX_BAND_SAMPLES, 18 * MAX_BAND_SAMPLES));
        assert_eq!(along.rough((18.0, 40.0)).1, 0);
        assert!(along.edges_outside(18.0).iter().all(|share| *share <= 0.0));
        assert!(along.edges_outside(-18.0).iter().all(|share| *share >= 1.0));
    }
}
