//! What runs beside a supposed side of a quad: the band of image around it, unrolled, and the lines in it that edges
//! support. Two points in, lines out; which of them is the border is `side_model`'s.

use super::evidence::Gradients;
use nalgebra::{Point2, Vector2};

/// Most samples along a side: a line keeps which of them it has in a 64-bit word.
pub const MAX_BAND_SAMPLES: usize = 48;
/// Fewest samples along a side.
const MIN_BAND_SAMPLES: usize = 12;
/// Half the width of a band, as a share of the quad's extent across the side.
const REACH_SHARE: f64 = 0.25;
/// Half the width of a band, smallest and largest.
const REACH_PX: (f64, f64) = (6.0, 128.0);
/// Most lines of a band, the best supported first.
pub const MAX_LINES: usize = 24;
/// Share of the samples that a line needs.
const MIN_SUPPORT: f64 = 0.4;
/// Slopes tried to each side of the supposed direction.
const SLOPES: usize = 8;
/// One step of slope as a share of the side, and the least step, in pixels over the whole side.
const SLOPE_STEP: (f64, f64) = (0.006, 0.5);
/// Share of the side left out at both ends: near a corner the other side's gradient mixes in.
const CORNER_SHARE: f64 = 0.06;
/// Smallest step height of an edge, grey levels.
pub const MIN_STEP: f32 = 4.0;
/// The gradient points along the normal to within about 35 degrees.
const MIN_COS: f32 = 0.82;

/// A line beside a side: its offset from the side, out of the quad for positive ones, at the middle of the side.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SideLine {
    /// Offset at the middle of the side.
    pub offset_px: f64,
    /// How much the offset grows from the first to the second end of the side.
    pub slope_px: f64,
    /// Share of the samples with an edge on the line.
    pub support: f64,
    /// Mean sign of the steps, -1 to 1; positive where it is brighter outside.
    pub sign: f64,
    /// Mean step height in grey levels.
    pub step: f64,
}

/// The image around a side, a row for each sample along it, a column for each pixel across, from inside outwards.
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
    /// Derivative along the normal; 0 outside the image.
    step: Vec<f32>,
    /// Squared gradient; negative outside the image.
    square: Vec<f32>,
    level: Vec<u8>,
    /// The lines, by descending support when found.
    pub lines: Vec<SideLine>,
}

/// An edge point of a band.
#[derive(Clone, Copy)]
struct Peak {
    row: usize,
    /// Where along the side, -0.5 to 0.5.
    along: f64,
    offset_px: f64,
    step: f32,
}

impl Band {
    /// Unrolls the band of the side from `from` to `to`, of a quad walked clockwise on screen that reaches `extent_px`
    /// across the side, and finds its lines. None for a side shorter than 4 px.
    pub fn new(g: &Gradients, from: &Point2<f64>, to: &Point2<f64>, extent_px: f64) -> Option<Self> {
        let length_px = (to - from).norm();
        if !(length_px >= 4.0 && length_px.is_finite() && extent_px.is_finite()) {
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
            rows: ((length_px / 2.0) as usize).clamp(MIN_BAND_SAMPLES, MAX_BAND_SAMPLES),
            step: Vec::new(),
            square: Vec::new(),
            level: Vec::new(),
            lines: Vec::new(),
        };
        band.unroll(g);
        band.lines = band.find_lines();
        Some(band)
    }

    fn unroll(&mut self, g: &Gradients) {
        let cells = self.rows * self.columns;
        self.step.reserve_exact(cells);
        self.square.reserve_exact(cells);
        self.level.reserve_exact(cells);
        let (width, height) = (g.width(), g.height());
        let (nx, ny) = (self.normal.x as f32, self.normal.y as f32);
        for row in 0..self.rows {
            let start = self.at(self.along(row) * self.length_px, f64::from(self.first_px));
            for column in 0..self.columns {
                let p = start + self.normal * column as f64 + Vector2::new(0.5, 0.5);
                // A negative number becomes 0 in the cast: its sign is asked for first.
                let (u, v) = (p.x as usize, p.y as usize);
                if p.x < 0.0 || p.y < 0.0 || u >= width || v >= height {
                    self.step.push(0.0);
                    self.square.push(-1.0);
                    self.level.push(0);
                    continue;
                }
                let i = v * width + u;
                let (x, y) = (g.gx[i], g.gy[i]);
                self.step.push(x * nx + y * ny);
                self.square.push(x * x + y * y);
                self.level.push(g.image.data()[i]);
            }
        }
    }

    /// Where along the side a row lies, 0 to 1.
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

    fn peaks(&self) -> Vec<Peak> {
        let mut peaks = Vec::new();
        for row in 0..self.rows {
            let cells = row * self.columns..(row + 1) * self.columns;
            let (step, square) = (&self.step[cells.clone()], &self.square[cells]);
            for (i, w) in step.windows(3).enumerate() {
                let (a, b, c) = (w[0].abs(), w[1].abs(), w[2].abs());
                if b < MIN_STEP || b < a || b <= c || b * b < MIN_COS * MIN_COS * square[i + 1] {
                    continue;
                }
                let bend = a - 2.0 * b + c;
                let shift = if bend < 0.0 { (0.5 * (a - c) / bend).clamp(-0.5, 0.5) } else { 0.0 };
                let offset_px = f64::from(self.first_px + i as i32 + 1) + f64::from(shift);
                peaks.push(Peak { row, along: self.along(row) - 0.5, offset_px, step: w[1] });
            }
        }
        peaks
    }

    /// Lines by Hough transform over offset and slope, the best supported first, each refitted.
    fn find_lines(&self) -> Vec<SideLine> {
        let peaks = self.peaks();
        let unit = (SLOPE_STEP.0 * self.length_px).max(SLOPE_STEP.1);
        let bins = self.columns + 4;
        let mut cells = vec![0_u64; (2 * SLOPES + 1) * bins];
        for (j, votes) in cells.chunks_exact_mut(bins).enumerate() {
            let slope = (j as f64 - SLOPES as f64) * unit;
            for p in &peaks {
                let offset = p.offset_px - slope * p.along;
                let bin = offset + 2.5 - f64::from(self.first_px);
                if bin >= 1.0 && bin < bins as f64 - 1.0 {
                    // Above 0, so the cast rounds down.
                    let (bin, bit) = (bin as usize, 1 << p.row);
                    votes[bin - 1] |= bit;
                    votes[bin] |= bit;
                    votes[bin + 1] |= bit;
                }
            }
        }
        // Lines of neighbouring slopes are one: the best slope of every offset is enough.
        let mut best: Vec<(u32, usize)> = (0..bins)
            .map(|bin| {
                let count = |j: usize| cells[j * bins + bin].count_ones();
                let nearest = |j: usize| j.abs_diff(SLOPES);
                (0..=2 * SLOPES)
                    .map(|j| (count(j), j))
                    .max_by(|x, y| x.0.cmp(&y.0).then(nearest(y.1).cmp(&nearest(x.1))).then(y.1.cmp(&x.1)))
                    .unwrap_or((0, SLOPES))
            })
            .collect();
        let mut lines: Vec<SideLine> = Vec::new();
        let least = MIN_SUPPORT * self.rows as f64;
        while lines.len() < MAX_LINES {
            let top = (0..bins).max_by(|x, y| best[*x].0.cmp(&best[*y].0).then(y.cmp(x))).unwrap_or(0);
            let (count, j) = best[top];
            if f64::from(count) < least {
                break;
            }
            best[top.saturating_sub(2)..(top + 3).min(bins)].fill((0, SLOPES));
            let offset_px = top as f64 - 2.0 + f64::from(self.first_px);
            let rough = (offset_px, (j as f64 - SLOPES as f64) * unit);
            let Some(line) = self.fit(&peaks, rough) else { continue };
            let known = |l: &SideLine| {
                (l.offset_px - line.offset_px).abs() < 1.5 && (l.slope_px - line.slope_px).abs() < 3.0
            };
            if line.support >= MIN_SUPPORT && !lines.iter().any(known) {
                lines.push(line);
            }
        }
        lines
    }

    /// Least squares on the edge points near a line (offset, slope), three rounds of closer ones.
    fn fit(&self, peaks: &[Peak], mut line: (f64, f64)) -> Option<SideLine> {
        const NEAR_PX: [f64; 4] = [1.6, 1.6, 1.3, 1.1];
        const MIN_POINTS: f64 = 8.0;
        let mut result = None;
        for near in NEAR_PX {
            let close = peaks.iter().filter(|p| (p.offset_px - line.0 - line.1 * p.along).abs() < near);
            let (mut n, mut t, mut o, mut tt, mut to) = (0.0, 0.0, 0.0, 0.0, 0.0);
            let (mut rows, mut sign, mut step) = (0_u64, 0.0, 0.0);
            for p in close {
                let (x, y) = (p.along, p.offset_px);
                n += 1.0;
                t += x;
                o += y;
                tt += x * x;
                to += x * y;
                rows |= 1 << p.row;
                sign += f64::from(p.step.signum());
                step += f64::from(p.step.abs());
            }
            if n < MIN_POINTS {
                return result;
            }
            let spread = tt - t * t / n;
            if spread <= 1e-9 * n {
                return result;
            }
            let slope = (to - t * o / n) / spread;
            line = ((o - slope * t) / n, slope);
            result = Some(SideLine {
                offset_px: line.0,
                slope_px: line.1,
                support: f64::from(rows.count_ones()) / self.rows as f64,
                sign: sign / n,
                step: step / n,
            });
        }
        result
    }

    /// Calls `cell` with the step, the squared gradient and the grey level of every pixel between two offsets from a
    /// line that lies in the image, and returns how many there were.
    pub fn strip(&self, line: &SideLine, range_px: (f64, f64), mut cell: impl FnMut(f32, f32, u8)) -> usize {
        let mut seen = 0;
        for row in 0..self.rows {
            let at = line.offset_px + line.slope_px * (self.along(row) - 0.5) - f64::from(self.first_px);
            let low = first_from(at + range_px.0);
            let high =
                if at + range_px.1 < 0.0 { 0 } else { ((at + range_px.1) as usize + 1).min(self.columns) };
            for i in row * self.columns + low..(row * self.columns + high).max(row * self.columns + low) {
                if self.square[i] >= 0.0 {
                    seen += 1;
                    cell(self.step[i], self.square[i], self.level[i]);
                }
            }
        }
        seen
    }

    /// Share of the samples with an edge along the side further out than `beyond_px` from a line, of at least
    /// `min_step`.
    pub fn edges_outside(&self, line: &SideLine, beyond_px: f64, min_step: f32) -> f64 {
        let with = (0..self.rows).filter(|row| {
            let at = line.offset_px + line.slope_px * (self.along(*row) - 0.5) - f64::from(self.first_px);
            let low = first_from(at + beyond_px).min(self.columns);
            (row * self.columns + low..(row + 1) * self.columns).any(|i| {
                let step = self.step[i].abs();
                step > min_step && step * step > MIN_COS * MIN_COS * self.square[i]
            })
        });
        with.count() as f64 / self.rows as f64
    }
}

/// The first column at or after `x`. Casts round towards 0; `ceil` is a call on the oldest processors.
fn first_from(x: f64) -> usize {
    let whole = x.max(0.0) as usize;
    whole + usize::from((whole as f64) < x)
}

#[cfg(test)]
mod tests {
    use super::{
        super::{
            edges::{EdgeParams, edges},
            fixtures::render,
        },
        *,
    };
    use crate::frame::GrayImage;

    fn band(image: &GrayImage, from: [f64; 2], to: [f64; 2], extent_px: f64) -> Option<Band> {
        let map = edges(image, &EdgeParams::default());
        let g = Gradients { image, gx: map.gx(), gy: map.gy() };
        Band::new(&g, &Point2::from(from), &Point2::from(to), extent_px)
    }

    #[test]
    fn lines_beside_a_side_are_found_where_they_are() {
        // A frame with an inner border 12 px in, and something 20 px above; slightly slanted.
        let frame = [[50.0, 80.2], [250.0, 84.2], [250.0, 200.0], [50.0, 200.0]];
        let inner = [[62.0, 92.2], [238.0, 96.2], [238.0, 188.0], [62.0, 188.0]];
        let above = [[0.0, 10.0], [300.0, 10.0], [300.0, 64.2], [0.0, 58.2]];
        let image = render(300, 240, 200, &[(above, 120), (frame, 60), (inner, 160)]);
        let band = band(&image, [50.0, 83.0], [250.0, 83.0], 120.0).unwrap();
        let offset = |wanted: f64| {
            let near = |l: &&SideLine| (l.offset_px - wanted).abs() < 0.3;
            *band.lines.iter().find(near).unwrap_or_else(|| panic!("{wanted}: {:?}", band.lines))
        };
        // Out of the quad is up here; the middle of the frame's upper side is at 82.2, of the inner one's at 94.2.
        let (side, inside, outside) = (offset(0.8), offset(-11.2), offset(21.8));
        assert!(side.support > 0.95 && side.sign > 0.99 && inside.sign < -0.99 && outside.sign < -0.99);
        assert!((side.slope_px + 4.0).abs() < 0.3, "{side:?}");
        let [from, to] = band.ends(&side);
        assert!((from.y - 80.2).abs() < 0.3 && (to.y - 84.2).abs() < 0.3, "{from} {to}");
    }

    #[test]
    fn bands_and_their_lines_are_bounded() {
        let stripes = GrayImage::from_fn(600, 600, |_, v| if v / 5 % 2 == 0 { 40 } else { 220 });
        let band_ = band(&stripes, [20.0, 300.0], [580.0, 300.0], 1e6).unwrap();
        assert_eq!(band_.lines.len(), MAX_LINES);
        assert!(band_.lines.iter().all(|l| l.offset_px.abs() <= REACH_PX.1 + 1.0));
        assert!(band(&stripes, [20.0, 300.0], [23.0, 300.0], 100.0).is_none());
        assert!(band(&stripes, [20.0, 300.0], [f64::NAN, 300.0], 100.0).is_none());
        // Wholly outside the image there is nothing.
        assert!(band(&stripes, [-300.0, -300.0], [-200.0, -300.0], 100.0).unwrap().lines.is_empty());
    }

    #[test]
    fn columns_start_at_the_next_whole_number() {
        for (x, column) in [(-3.5, 0), (-0.2, 0), (0.0, 0), (0.1, 1), (1.0, 1), (1.0001, 2)] {
            assert_eq!(first_from(x), column, "{x}");
        }
    }
}
