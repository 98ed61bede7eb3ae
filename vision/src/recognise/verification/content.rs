//! Two aligned icons in, their similarity beyond the frame out.
//!
//! A frame is uniform along a whole side: moulding, mat, the edge of a panel. Many pictures and
//! blank boards share one, so similarity of the frame does not identify a landmark. The frame is
//! subtracted, and only the remaining content of the learnt icon counts. Beyond the method; the
//! thresholds are in `VerdictParams`.

use crate::recognise::{
    features::correlation::CorrelationParams,
    verification::gradient_similarity::{Bucket, Smoothed, compare},
};

/// Similarity of two icons beyond the frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Content {
    /// Mean correlation of the slopes over the buckets, each weighted by the share of the learnt
    /// icon's slopes that its frame does not explain, where both have texture; -1 to 1.
    pub likeness: f64,
    /// Sum of those weights, in buckets. At most the number of buckets without the corners.
    pub shown: f64,
}

impl Content {
    /// No content beyond the frame.
    pub const NONE: Self = Self { likeness: 0.0, shown: 0.0 };
}

/// A bucket of the learnt icon has texture with slopes of this, in squared grey levels...
const SHOWS: f32 = 15.0;
/// ... to which noise and grain may add that much.
const GRAIN: f32 = 30.0;
/// A bucket of the picture has texture with slopes of this share of its mean, and this much:
/// buckets under an untextured cover are ignored.
const TEXTURED_SHARE: f32 = 0.08;
const TEXTURED: f32 = 10.0;

/// Compares `picture`, aligned with `learnt`, with it.
pub fn content(picture: &Smoothed, learnt: &Smoothed, p: &CorrelationParams) -> Content {
    let side = p.per_side();
    let (Some(whole), Some(beyond)) =
        (compare(picture, learnt, p), compare(&without_frame(picture), &without_frame(learnt), p))
    else {
        return Content::NONE;
    };
    let mean = whole.iter().map(|b| b.power).sum::<f32>() / whole.len() as f32;
    let (mut agreement, mut shown) = (0.0, 0.0);
    for (i, (whole, beyond)) in whole.iter().zip(&beyond).enumerate() {
        let textured = whole.power > TEXTURED.max(TEXTURED_SHARE * mean);
        if textured && !is_corner(i, side) {
            let weight = weight(whole, beyond);
            agreement += weight * f64::from(beyond.correlation);
            shown += weight;
        }
    }
    if shown > 0.0 { Content { likeness: agreement / shown, shown } } else { Content::NONE }
}

/// Content of `icon` beyond its frame, in buckets: [`Content::shown`] of the icon and itself.
pub fn shown(icon: &Smoothed, p: &CorrelationParams) -> f64 {
    content(icon, icon, p).shown
}

/// The share of the learnt icon's slopes in a bucket that its frame does not explain, 0 to 1.
fn weight(whole: &Bucket, beyond: &Bucket) -> f64 {
    // Written so that a NaN gets weight 0.
    if whole.other_power > SHOWS {
        f64::from((beyond.other_power / (whole.other_power + GRAIN)).clamp(0.0, 1.0))
    } else {
        0.0
    }
}

/// Corner buckets, where two sides of the frame meet: neither side's mean explains them.
fn is_corner(bucket: usize, side: usize) -> bool {
    let end = |i: usize| i == 0 || i + 1 == side;
    end(bucket % side) && end(bucket / side)
}

/// The icon without its frame: from every pixel the mean of the pixels at the same distance from
/// the same side is subtracted.
fn without_frame(icon: &Smoothed) -> Smoothed {
    let size = icon.size();
    let mut sums = vec![[(0.0_f32, 0.0_f32); 4]; size.div_ceil(2)];
    for (i, grey) in icon.pixels().iter().enumerate() {
        let (side, depth) = nearest_side(i, size);
        let (sum, count) = &mut sums[depth][side];
        *sum += grey;
        *count += 1.0;
    }
    let less = |(i, grey): (usize, &f32)| {
        let (side, depth) = nearest_side(i, size);
        let (sum, count) = sums[depth][side];
        grey - sum / count
    };
    Smoothed::of(size, icon.pixels().iter().enumerate().map(less).collect())
}

/// Which side pixel `i` is nearest to, and how many pixels lie between.
fn nearest_side(i: usize, size: usize) -> (usize, usize) {
    let (x, y) = (i % size, i / size);
    let depths = [y, size - 1 - x, size - 1 - y, x];
    let mut side = 0;
    for other in 1..4 {
        if depths[other] < depths[side] {
            side = other;
        }
    }
    (side, depths[side])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recognise::fixture::{drawn_icon, waves};

    fn made(f: impl Fn(f64, f64) -> f64) -> Smoothed {
        Smoothed::new(&drawn_icon(f))
    }

    /// A dark frame a tenth wide, a mat to three tenths, and `inside` within.
    fn framed(inside: impl Fn(f64, f64) -> f64) -> Smoothed {
        made(|x, y| match x.min(1.0 - x).min(y).min(1.0 - y) {
            depth if depth < 0.1 => 30.0,
            depth if depth < 0.3 => 220.0,
            _ => inside(x, y),
        })
    }

    #[test]
    fn pictures_in_the_same_frame_are_dissimilar() {
        let p = CorrelationParams::default();
        let (one, other) = (framed(waves), framed(|x, y| waves(y - 0.3, x + 5.0)));
        let same = content(&one, &one, &p);
        assert!(same.likeness > 0.98 && (3.0..12.0).contains(&same.shown), "{same:?}");
        // By all slopes they are similar: the frame outweighs the content.
        let whole = crate::recognise::verification::gradient_similarity::between(&one, &other, &p).likeness;
        assert!(whole > 0.5, "{whole}");
        let beyond = content(&other, &one, &p);
        assert!(beyond.likeness < 0.35, "{beyond:?}");
    }

    #[test]
    fn an_empty_frame_has_no_content() {
        let p = CorrelationParams::default();
        let empty = framed(|_, _| 180.0);
        assert!(shown(&empty, &p) < 0.5, "{}", shown(&empty, &p));
        // Frames wider below than at the side, too.
        let wide = made(|x, y| if x.min(1.0 - x) < 0.08 || y.min(1.0 - y) < 0.15 { 30.0 } else { 200.0 });
        assert!(shown(&wide, &p) < 1.0, "{}", shown(&wide, &p));
        assert!(shown(&made(waves), &p) > 15.0, "{}", shown(&made(waves), &p));
        // Buckets under an untextured cover are ignored; the others agree.
        let covered = made(|x, y| if y > 0.6 { 128.0 } else { waves(x, y) });
        let left = content(&covered, &made(waves), &p);
        assert!(left.likeness > 0.7 && (10.0..16.0).contains(&left.shown), "{left:?}");
    }

    #[test]
    fn content_is_invariant_to_light_and_zero_for_invalid_icons() {
        let p = CorrelationParams::default();
        let learnt = framed(waves);
        let dimmed = framed(|x, y| 0.5 * waves(x, y) + 20.0);
        let dimmed = content(&dimmed, &learnt, &p);
        assert!(dimmed.likeness > 0.85, "{dimmed:?}");
        assert_eq!(content(&made(|_, _| f64::NAN), &learnt, &p).shown.to_bits(), 0.0_f64.to_bits());
        assert_eq!(content(&learnt, &made(|_, _| f64::NAN), &p), Content::NONE);
        let small = Smoothed::of(10, vec![0.0; 100]);
        assert_eq!(content(&small, &learnt, &p), Content::NONE);
        assert_eq!(content(&small, &small, &p), Content::NONE);
    }
}
