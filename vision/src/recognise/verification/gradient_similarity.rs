//! Two aligned icons in, their gradient similarity out. Slopes are compared bucket by bucket:
//! unlike grey levels, they are not correlated by common shading, and buckets without texture do
//! not count.
//!
//! Beyond the method: its distances compare icons at the detected corners; this one is for icons
//! after alignment (`aligner.rs`), where it separates landmarks from look-alikes far better
//! (docs/EVALUATION.md).

use crate::{
    icon::Icon,
    recognise::features::{correlation::CorrelationParams, separable::LANES},
};
use fearless_simd::{Level, dispatch};

/// Variance that noise adds to a difference of two grey levels, squared grey levels.
const NOISE: f32 = 4.0;
/// Pixels along the icon's border that are not compared: alignment is least accurate there.
const BORDER_PX: usize = 3;

/// A smoothed icon for comparison.
#[derive(Debug, Clone, PartialEq)]
pub struct Smoothed {
    size: usize,
    pixels: Vec<f32>,
}

impl Smoothed {
    /// Smooths `icon`.
    pub fn new(icon: &Icon) -> Self {
        Self { size: icon.size, pixels: dispatch!(Level::new(), _s => smoothed(icon)) }
    }

    /// Of `size` by `size` pixels that are already smoothed.
    pub(crate) fn of(size: usize, pixels: Vec<f32>) -> Self {
        debug_assert_eq!(pixels.len(), size * size);
        Self { size, pixels }
    }

    /// Its side, in pixels.
    pub(crate) fn size(&self) -> usize {
        self.size
    }

    /// Its pixels, row by row.
    pub(crate) fn pixels(&self) -> &[f32] {
        &self.pixels
    }
}

/// Similarity of two icons.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct IconComparison {
    /// Mean over the buckets of the correlation of their slopes, -1 to 1; 0 where both are flat, or
    /// cut differently.
    pub likeness: f64,
    /// Share of the buckets in which both have texture that differs, 0 to 1. An untextured occluder
    /// does not contradict; another picture does.
    pub contradicting: f64,
}

/// A bucket contradicts when its correlation is below this...
pub(crate) const CONTRADICTS: f32 = 0.3;
/// ... and both have slopes of at least this share of their icon's mean, and this much, in squared
/// grey levels.
const SHOWS_SHARE: f32 = 0.1;
const SHOWS_LEAST: f32 = 10.0;

/// Compares two aligned icons.
pub fn compare_gradients(a: &Icon, b: &Icon, p: &CorrelationParams) -> IconComparison {
    between(&Smoothed::new(a), &Smoothed::new(b), p)
}

/// Gradient similarity, see [`IconComparison::likeness`].
pub fn likeness(a: &Icon, b: &Icon, p: &CorrelationParams) -> f64 {
    compare_gradients(a, b, p).likeness
}

/// The same as [`compare_gradients`] of smoothed icons.
pub fn between(a: &Smoothed, b: &Smoothed, p: &CorrelationParams) -> IconComparison {
    let Some(buckets) = compare(a, b, p) else { return IconComparison { likeness: 0.0, contradicting: 0.0 } };
    let count = buckets.len() as f64;
    let mean = |power: fn(&Bucket) -> f32| buckets.iter().map(power).sum::<f32>() / count as f32;
    let (mean, other_mean) = (mean(|b| b.power), mean(|b| b.other_power));
    let contradicts =
        |b: &&Bucket| b.correlation < CONTRADICTS && shows(b.power, mean) && shows(b.other_power, other_mean);
    IconComparison {
        likeness: buckets.iter().map(|b| f64::from(b.correlation)).sum::<f64>() / count,
        contradicting: buckets.iter().filter(contradicts).count() as f64 / count,
    }
}

/// The gradient correlation of every bucket pair, row by row: [`IconComparison::likeness`] is their
/// mean. `None` where the icons are cut differently, or too small.
pub fn bucket_similarities(a: &Icon, b: &Icon, p: &CorrelationParams) -> Option<Vec<f32>> {
    let buckets = compare(&Smoothed::new(a), &Smoothed::new(b), p)?;
    Some(buckets.iter().map(|b| b.correlation).collect())
}

/// Whether slopes of the mean square `power` are texture, in an icon with the mean `mean`.
pub(crate) fn shows(power: f32, mean: f32) -> bool {
    power > (SHOWS_SHARE * mean).max(SHOWS_LEAST)
}

/// One bucket of two icons.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Bucket {
    /// Correlation of the slopes, -1 to 1.
    pub(crate) correlation: f32,
    /// Mean square of the slopes of both, in squared grey levels, less the noise.
    pub(crate) power: f32,
    pub(crate) other_power: f32,
}

/// Bucket by bucket, row by row. None where the icons are cut differently, or too small.
pub(crate) fn compare(a: &Smoothed, b: &Smoothed, p: &CorrelationParams) -> Option<Vec<Bucket>> {
    Some(cells(a, b, p.per_side())?.iter().map(Cell::bucket).collect())
}

/// Sums over a cell of two icons: products of slopes, squares of each with noise, and pixels.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Cell {
    products: f32,
    squares: f32,
    other_squares: f32,
    pixels: f32,
}

impl std::ops::Add for Cell {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            products: self.products + other.products,
            squares: self.squares + other.squares,
            other_squares: self.other_squares + other.other_squares,
            pixels: self.pixels + other.pixels,
        }
    }
}

impl Cell {
    pub(crate) fn bucket(&self) -> Bucket {
        let correlation = self.products / (self.squares * self.other_squares).sqrt();
        let correlation = if correlation.is_finite() { correlation } else { 0.0 };
        let power = |squares: f32| squares / self.pixels.max(1.0) - NOISE;
        Bucket { correlation, power: power(self.squares), other_power: power(self.other_squares) }
    }
}

/// `per_side` by `per_side` cells of two icons, row by row. None where the icons are cut
/// differently, or too small.
pub(crate) fn cells(a: &Smoothed, b: &Smoothed, per_side: usize) -> Option<Vec<Cell>> {
    let size = a.size;
    let fit = b.size == size && size > 2 * BORDER_PX + per_side;
    fit.then(|| dispatch!(Level::new(), _s => summed(&a.pixels, &b.pixels, size, per_side)))
}

#[expect(
    clippy::inline_always,
    reason = "an instruction set holds only in what is inlined where it was chosen"
)]
#[inline(always)]
fn summed(a: &[f32], b: &[f32], size: usize, per_side: usize) -> Vec<Cell> {
    let edge = |i: usize| i * size / per_side;
    let within = |i: usize| edge(i).max(BORDER_PX)..edge(i + 1).min(size - BORDER_PX);
    let mut found = Vec::with_capacity(per_side * per_side);
    for bucket in 0..per_side * per_side {
        let (columns, rows) = (within(bucket % per_side), within(bucket / per_side));
        let pixels = (columns.len() * rows.len()) as f32;
        let mut sums = [[0.0_f32; LANES]; 3];
        for y in rows {
            for x in columns.clone() {
                let at = y * size + x;
                let slope = |icon: &[f32]| [icon[at + 1] - icon[at - 1], icon[at + size] - icon[at - size]];
                let ([ax, ay], [bx, by]) = (slope(a), slope(b));
                let lane = (x - columns.start) % LANES;
                sums[0][lane] += ax * bx + ay * by;
                sums[1][lane] += ax * ax + ay * ay + NOISE;
                sums[2][lane] += bx * bx + by * by + NOISE;
            }
        }
        let [products, squares, other_squares] = sums.map(|lanes| lanes.iter().sum::<f32>());
        found.push(Cell { products, squares, other_squares, pixels });
    }
    found
}

/// Each pixel with its eight neighbours, weighted 1 2 1 along both axes; border replicated.
#[expect(
    clippy::inline_always,
    reason = "an instruction set holds only in what is inlined where it was chosen"
)]
#[inline(always)]
fn smoothed(icon: &Icon) -> Vec<f32> {
    let size = icon.size;
    let mut across = Vec::with_capacity(size * size);
    for row in icon.pixels.chunks_exact(size) {
        across.extend((0..size).map(|x| {
            let (left, right) = (row[x.saturating_sub(1)], row[(x + 1).min(size - 1)]);
            0.25 * (left + 2.0 * row[x] + right)
        }));
    }
    let mut out = Vec::with_capacity(size * size);
    for y in 0..size {
        let row = |y: usize| &across[y * size..(y + 1) * size];
        let (above, here, below) = (row(y.saturating_sub(1)), row(y), row((y + 1).min(size - 1)));
        out.extend(above.iter().zip(here).zip(below).map(|((a, h), b)| 0.25 * (a + 2.0 * h + b)));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recognise::fixture::{drawn_icon as made, waves};

    #[test]
    fn likeness_is_high_for_equal_pictures_under_any_light() {
        let p = CorrelationParams::default();
        let icon = made(waves);
        assert!(likeness(&icon, &icon, &p) > 0.95);
        let dimmed = made(|x, y| 0.5 * waves(x, y) + 40.0);
        assert!(likeness(&icon, &dimmed, &p) > 0.93);
        // Light from the side.
        let slanted = made(|x, y| (0.3 + x) * waves(x, y));
        assert!(likeness(&icon, &slanted, &p) > 0.9);
        assert!(likeness(&icon, &made(|x, y| 250.0 - waves(x, y)), &p) < -0.9);
        assert!((likeness(&icon, &dimmed, &p) - likeness(&dimmed, &icon, &p)).abs() < 1e-6);
    }

    #[test]
    fn a_covered_part_lowers_the_likeness_by_its_share() {
        let p = CorrelationParams::default();
        let (icon, whole) = (made(waves), likeness(&made(waves), &made(waves), &p));
        // A flat label over the two lower rows of buckets.
        let covered = made(|x, y| if y > 0.6 { 230.0 } else { waves(x, y) });
        let left = likeness(&icon, &covered, &p);
        assert!((left - 0.6 * whole).abs() < 0.06, "{left} of {whole}");
    }

    #[test]
    fn another_picture_contradicts_and_an_untextured_cover_does_not() {
        let p = CorrelationParams::default();
        let icon = made(waves);
        let with = |lower: fn(f64, f64) -> f64| {
            let other = made(|x, y| if y > 0.6 { lower(x, y) } else { waves(x, y) });
            let comparison = compare_gradients(&icon, &other, &p);
            assert!(compare_gradients(&other, &icon, &p) == comparison, "{comparison:?}");
            comparison.contradicting
        };
        assert!(with(waves) < 1e-9);
        // Except for its edge.
        let plain = with(|_, _| 230.0);
        assert!(plain <= 0.2, "{plain}");
        // Ten of 25 buckets show another picture.
        let replaced = with(|x, y| waves(y - 0.4, x + 3.0));
        assert!((0.24..=0.4).contains(&replaced), "{replaced}");
        // In half the light, too.
        let dimmed = with(|x, y| 0.5 * waves(y - 0.4, x + 3.0));
        assert!((dimmed - replaced).abs() < 0.05, "{dimmed} {replaced}");
    }

    #[test]
    fn equal_shading_alone_is_not_similar() {
        let p = CorrelationParams::default();
        let shade = |x: f64, y: f64| 60.0 + 90.0 * y + 20.0 * x;
        let one = made(|x, y| shade(x, y) + 0.1 * waves(x, y));
        let two = made(|x, y| shade(x, y) + 0.1 * waves(1.0 - y, x));
        let by_grey = {
            let f = |i: &Icon| {
                crate::recognise::features::icon_features::features(
                    i.clone(),
                    &crate::recognise::params::RecogniseParams::default(),
                )
            };
            crate::recognise::features::correlation::correlation(&f(&one).buckets, &f(&two).buckets, &p)
        };
        assert!(by_grey < 0.5, "C^r accepts the pair: {by_grey}");
        assert!(likeness(&one, &two, &p) < 0.55, "{}", likeness(&one, &two, &p));
        assert!(likeness(&one, &one, &p) > 0.7, "{}", likeness(&one, &one, &p));
    }

    #[test]
    fn icons_without_texture_have_likeness_zero() {
        let p = CorrelationParams::default();
        let flat = made(|_, _| 80.0);
        assert!(likeness(&flat, &made(waves), &p).abs() < 1e-9);
        assert!(likeness(&made(|_, _| f64::NAN), &made(waves), &p).abs() < 1e-9);
        let small = Icon { size: 10, pixels: vec![0.0; 100], source_scale: 1.0 };
        assert!(likeness(&small, &small, &p).abs() < 1e-9);
        assert!(likeness(&small, &flat, &p).abs() < 1e-9);
    }
}
