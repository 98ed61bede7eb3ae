//! Grey profiles across segments and their correlation, cue c6 of method 2: outside a quad the
//! background is uniform, and just inside two opposite borders the texture is similar. Profiles are
//! sampled on demand and cached.

use crate::{detect::segments::edge_segments::EdgeSegment, frame::GrayImage};
use nalgebra::{Point2, Vector2};

/// Largest half width of a profile.
const MAX_HALF_WIDTH_PX: usize = 32;
/// Most lines that a profile averages.
const MAX_LINES: usize = 24;
/// Gaussian of sigma 1 cut at 2 px.
const KERNEL: [f64; 5] = [0.0545, 0.2442, 0.4026, 0.2442, 0.0545];
/// A profile flatter than this, in squared grey levels, has no shape to compare.
const MIN_VARIANCE: f64 = 1e-6;

/// Profiles of a frame's segments.
pub(crate) struct Profiles<'a> {
    segments: &'a [EdgeSegment],
    image: &'a GrayImage,
    /// Per segment and half width: the profile along the segment's normal.
    cached: Vec<Vec<(usize, Vec<f64>)>>,
}

impl<'a> Profiles<'a> {
    pub(crate) fn new(segments: &'a [EdgeSegment], image: &'a GrayImage) -> Self {
        Self { segments, image, cached: vec![Vec::new(); segments.len()] }
    }

    /// ZNCC of the profiles of `k` and `l`, both read from outside to inside, -1 to 1; 0 when one
    /// is flat.
    pub(crate) fn correlation(&mut self, k: usize, l: usize, half_width_px: usize) -> f64 {
        let half_width = half_width_px.clamp(1, MAX_HALF_WIDTH_PX);
        let a = self.inward(k, l, half_width);
        let b = self.inward(l, k, half_width);
        zncc(&a, &b)
    }

    /// Profile of `k` along the normal that points to `other`.
    fn inward(&mut self, k: usize, other: usize, half_width: usize) -> Vec<f64> {
        let mut profile = self.along_normal(k, half_width);
        let o = &self.segments[other];
        let towards = nalgebra::center(&o.p_px, &o.q_px);
        if self.segments[k].normal.dot(&towards.coords) < self.segments[k].rho_px {
            profile.reverse();
        }
        profile
    }

    fn along_normal(&mut self, k: usize, half_width: usize) -> Vec<f64> {
        if let Some((_, profile)) = self.cached[k].iter().find(|(width, _)| *width == half_width) {
            return profile.clone();
        }
        let profile = sample(self.image, &self.segments[k], half_width);
        self.cached[k].push((half_width, profile.clone()));
        profile
    }
}

/// Mean grey levels at offsets -half..=half along the segment's normal, over the central 80 % of
/// its length.
///
/// Departs from method 2: sampled on the raw image and smoothed along the profile, not on a
/// smoothed image; averaging over the lines already smooths the other direction, and the image need
/// not be filtered a second time. The number of lines is capped, as neighbours hardly differ.
fn sample(image: &GrayImage, segment: &EdgeSegment, half_width: usize) -> Vec<f64> {
    // One more sample on both sides for the smoothing kernel.
    let reach = half_width as f64 + 2.0;
    let lines = ((segment.length_px / 2.0) as usize).clamp(8, MAX_LINES);
    let mut raw = vec![0.0; 2 * half_width + 5];
    for line in 0..lines {
        let t = 0.1 + 0.8 * (line as f64 + 0.5) / lines as f64;
        let foot: Point2<f64> = segment.p_px + (segment.q_px - segment.p_px) * t;
        let mut at = foot - segment.normal * reach;
        let step: Vector2<f64> = segment.normal;
        for value in &mut raw {
            *value += f64::from(image.sample(at.x, at.y));
            at += step;
        }
    }
    raw.windows(5).map(|w| w.iter().zip(KERNEL).map(|(v, k)| v * k).sum::<f64>() / lines as f64).collect()
}

/// Zero-mean normalised cross-correlation, -1 to 1; 0 when either is flat.
fn zncc(a: &[f64], b: &[f64]) -> f64 {
    let n = a.len() as f64;
    let (mean_a, mean_b) = (a.iter().sum::<f64>() / n, b.iter().sum::<f64>() / n);
    let (mut saa, mut sbb, mut sab) = (0.0, 0.0, 0.0);
    for (x, y) in a.iter().zip(b) {
        let (x, y) = (x - mean_a, y - mean_b);
        saa += x * x;
        sbb += y * y;
        sab += x * y;
    }
    if saa < MIN_VARIANCE * n || sbb < MIN_VARIANCE * n {
        0.0
    } else {
        (sab / (saa * sbb).sqrt()).clamp(-1.0, 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detect::tests::fixtures::segment;

    #[test]
    fn correlation_of_known_vectors() {
        assert!((zncc(&[1.0, 2.0, 3.0], &[10.0, 20.0, 30.0]) - 1.0).abs() < 1e-12);
        assert!((zncc(&[1.0, 2.0, 3.0], &[3.0, 2.0, 1.0]) + 1.0).abs() < 1e-12);
        // Means 2 and 7/3: sab = 1, saa = 2, sbb = 2/3.
        assert!((zncc(&[1.0, 2.0, 3.0], &[2.0, 2.0, 3.0]) - 1.0 / (4.0_f64 / 3.0).sqrt()).abs() < 1e-12);
        assert!(zncc(&[5.0, 5.0, 5.0], &[1.0, 2.0, 3.0]).abs() < 1e-12);
    }

    #[test]
    fn a_profile_reads_from_outside_to_inside() {
        // Dark outside, a bright band just inside, grey further in.
        let image = GrayImage::from_fn(100, 60, |u, _| match u {
            20..=24 | 76..=80 => 250,
            25..=75 => 120,
            _ => 10,
        });
        let segments = [segment([19.5, 10.0], [19.5, 50.0]), segment([80.5, 10.0], [80.5, 50.0])];
        let mut profiles = Profiles::new(&segments, &image);
        let left = profiles.inward(0, 1, 10);
        assert!(left[0] < 20.0 && left[12] > 200.0 && (left[20] - 120.0).abs() < 5.0, "{left:?}");
        assert!(profiles.correlation(0, 1, 10) > 0.999);
        // An image with gain and offset, not saturated, changes nothing.
        let dimmed = GrayImage::from_fn(100, 60, |u, v| image.at(u, v) / 2 + 30);
        let other = Profiles::new(&segments, &dimmed).correlation(0, 1, 10);
        assert!((other - profiles.correlation(0, 1, 10)).abs() < 1e-3);
    }
}
