//! One row of a band: the pixels across a side, and where edges along the side run in it. In: a
//! point and a direction. Out: steps, grey levels, peaks.

use crate::detect::{
    border_model::feature_constants::{MIN_STEP, REACH_PX},
    edge_support::{
        fixed_point::Fixed,
        gradients::{Gradients, MIN_COS, across},
    },
};

/// Most columns of a band, rounded up to whole vectors.
const MAX_COLUMNS: usize = (2 * REACH_PX.1 as usize + 1).next_multiple_of(FLAGS);
/// Columns whose flags are read as one number.
const FLAGS: usize = 8;

/// Memory of a row of pixels. Outside the image all is 0.
pub(super) struct Row {
    /// Derivatives along u and v.
    gx: [f32; MAX_COLUMNS],
    gy: [f32; MAX_COLUMNS],
    /// Squared length of the gradient.
    square: [f32; MAX_COLUMNS],
    /// Height of the step where the gradient points along the normal, to within about 35
    /// degrees; -1 elsewhere.
    height: [f32; MAX_COLUMNS],
}

impl Row {
    pub(super) const EMPTY: Self = Self {
        gx: [0.0; MAX_COLUMNS],
        gy: [0.0; MAX_COLUMNS],
        square: [0.0; MAX_COLUMNS],
        height: [-1.0; MAX_COLUMNS],
    };

    /// Reads the pixels from `start` on, one a step; returns the columns in the image, from the
    /// first to before the second.
    #[expect(
        clippy::inline_always,
        reason = "an instruction set holds only in what is inlined where it was chosen"
    )]
    #[inline(always)]
    pub(super) fn read(
        &mut self,
        g: &Gradients,
        (start, step): (Fixed, Fixed),
        normal: [f32; 2],
        (steps, levels): (&mut [f32], &mut [u8]),
    ) -> (i32, i32) {
        let columns = steps.len().min(levels.len()).min(MAX_COLUMNS);
        let inside = self.gather(g, (start, step), &mut levels[..columns]);
        let gradients = self.gx[..columns].iter().zip(&self.gy[..columns]);
        let results = self.square.iter_mut().zip(&mut self.height);
        for ((slot, (gx, gy)), (square, height)) in steps.iter_mut().zip(gradients).zip(results) {
            let (step, squared) = across([*gx, *gy], normal);
            (*slot, *square) = (step, squared);
            *height = if step * step >= MIN_COS * MIN_COS * squared { step.abs() } else { -1.0 };
        }
        inside
    }

    #[expect(clippy::inline_always, reason = "as above")]
    #[inline(always)]
    fn gather(&mut self, g: &Gradients, (start, step): (Fixed, Fixed), levels: &mut [u8]) -> (i32, i32) {
        let (width, height) = (g.width(), g.height());
        let columns = levels.len();
        let last = start.on(step, columns as i64 - 1);
        let cells = levels.iter_mut().zip(self.gx.iter_mut().zip(&mut self.gy));
        let mut place = start;
        // A straight line lies in the image from one column to another, and in between if both ends
        // do.
        if start.pixel(width, height).is_some() && last.pixel(width, height).is_some() {
            for (level, (gx, gy)) in cells {
                let at = place.index(width);
                place = place.on(step, 1);
                (*gx, *gy, *level) = (g.gx[at], g.gy[at], g.image.data()[at]);
            }
            return (0, columns as i32);
        }
        let (mut first, mut end) = (0, 0);
        for (i, (level, (gx, gy))) in cells.enumerate() {
            let pixel = place.pixel(width, height);
            place = place.on(step, 1);
            (*gx, *gy, *level) = pixel.map_or((0.0, 0.0, 0), |at| (g.gx[at], g.gy[at], g.image.data()[at]));
            if pixel.is_some() {
                (first, end) = (if end == 0 { i } else { first }, i + 1);
            }
        }
        (first as i32, end as i32)
    }

    /// Prefix sums of texture: how many pixels before a column have a step of more than
    /// [`MIN_STEP`].
    #[expect(clippy::inline_always, reason = "as above")]
    #[inline(always)]
    pub(super) fn count_rough(&self, rough: &mut [u16]) {
        let mut sum = 0;
        for (rough, square) in rough[1..].iter_mut().zip(&self.square) {
            sum += u16::from(*square > MIN_STEP * MIN_STEP);
            *rough = sum;
        }
    }

    /// The outermost of so many columns with an edge along the side of more than `least`; -1
    /// without.
    #[expect(clippy::inline_always, reason = "as above")]
    #[inline(always)]
    pub(super) fn outermost(&self, columns: usize, least: f32) -> i32 {
        let edges = self.height[..columns].iter().zip(0_i32..);
        edges.map(|(height, i)| if *height > least { i } else { -1 }).fold(-1, i32::max)
    }

    /// Calls `peak` with the column of each local maximum of the step along the side, and how far
    /// beside the column's middle it is, to a fraction of a pixel.
    #[expect(clippy::inline_always, reason = "as above")]
    #[inline(always)]
    pub(super) fn peaks(&self, steps: &[f32], mut peak: impl FnMut(usize, f32)) {
        let mut is_peak = [0_u8; MAX_COLUMNS];
        let columns = steps.len().min(MAX_COLUMNS);
        let Some(inner) = columns.checked_sub(2) else { return };
        // Windows of three columns; a flag belongs to the middle one.
        let neighbours = steps[..inner].iter().zip(&steps[2..]);
        let heights = steps[1..].iter().zip(&self.height[1..]);
        for ((flag, (before, after)), (step, along)) in is_peak.iter_mut().zip(neighbours).zip(heights) {
            let (a, b, c) = (before.abs(), step.abs(), after.abs());
            *flag = u8::from(b >= MIN_STEP && b >= a && b > c && *along >= 0.0);
        }
        for (first, flags) in
            is_peak[..inner.next_multiple_of(FLAGS)].as_chunks::<FLAGS>().0.iter().enumerate()
        {
            let mut left = u64::from_le_bytes(*flags);
            while left != 0 {
                let i = first * FLAGS + left.trailing_zeros() as usize / 8;
                left &= left - 1;
                let (a, b, c) = (steps[i].abs(), steps[i + 1].abs(), steps[i + 2].abs());
                let bend = a - 2.0 * b + c;
                let shift = if bend < 0.0 { (0.5 * (a - c) / bend).clamp(-0.5, 0.5) } else { 0.0 };
                peak(i + 1, shift);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        detect::edges::edge_map::{EdgeParams, edges},
        frame::GrayImage,
        random::Random,
    };
    use nalgebra::{Point2, Vector2};

    /// Rows anywhere in an image and across its border, against a search pixel by pixel.
    #[test]
    fn a_row_has_the_pixels_edges_and_peaks_that_a_plain_search_finds() {
        let mut random = Random::new(7);
        let (width, height) = (90, 70);
        let noise = GrayImage::from_fn(width, height, |_, _| (random.unit() * 256.0) as u8);
        let map = edges(&noise, &EdgeParams::default());
        let g = Gradients { image: &noise, gx: map.gx(), gy: map.gy() };
        let (mut row, mut clipped, mut found) = (Row::EMPTY, 0, 0);
        for _ in 0..300 {
            let mut within = |low: f64, high: f64| low + (high - low) * random.unit();
            let angle = within(0.0, std::f64::consts::TAU);
            let (normal, columns) = (Vector2::new(angle.cos(), angle.sin()), within(13.0, 80.0) as usize);
            let start = Fixed::point(&Point2::new(within(-20.0, 110.0), within(-20.0, 90.0)));
            let (step, facing) = (Fixed::step(&normal), normal.cast().into());
            let (mut steps, mut levels) = (vec![9.0; columns], vec![9; columns]);
            let inside = row.read(&g, (start, step), facing, (&mut steps, &mut levels));

            let pixels: Vec<_> =
                (0..columns as i64).map(|i| start.on(step, i).pixel(width, height)).collect();
            let plain: Vec<(f32, f32)> = pixels
                .iter()
                .map(|p| p.map_or((0.0, 0.0), |at| across([g.gx[at], g.gy[at]], facing)))
                .collect();
            assert!(steps.iter().zip(&plain).all(|(step, plain)| (step - plain.0).abs() <= 0.0));
            assert!(pixels.iter().zip(&levels).all(|(p, l)| *l == p.map_or(0, |at| noise.data()[at])));
            let (first, end) =
                (pixels.iter().position(Option::is_some), pixels.iter().rposition(Option::is_some));
            assert_eq!(inside, first.zip(end).map_or((0, 0), |(first, end)| (first as i32, end as i32 + 1)));
            clipped += usize::from(inside != (0, columns as i32));

            let along = |i: usize| plain[i].0.powi(2) >= MIN_COS * MIN_COS * plain[i].1;
            let edge = |i: &usize| along(*i) && steps[*i].abs() > MIN_STEP;
            assert_eq!(row.outermost(columns, MIN_STEP), (0..columns).rfind(edge).map_or(-1, |i| i as i32));
            let peak = |i: &usize| {
                let [a, b, c] = [i - 1, *i, i + 1].map(|i| steps[i].abs());
                b >= MIN_STEP && b >= a && b > c && along(*i)
            };
            let wanted: Vec<usize> = (1..columns - 1).filter(peak).collect();
            let mut peaks = Vec::new();
            row.peaks(&steps, |column, shift| {
                assert!(shift.abs() <= 0.5);
                peaks.push(column);
            });
            assert_eq!(peaks, wanted);
            found += peaks.len();
            let mut rough = vec![0; columns + 1];
            row.count_rough(&mut rough);
            let textured = plain.iter().filter(|p| p.1 > MIN_STEP * MIN_STEP).count();
            assert_eq!(usize::from(rough[columns]), textured);
        }
        assert!(clipped > 50 && found > 500, "{clipped} rows across the border, {found} peaks");
    }
}
