//! The dominant quad of a photograph: the only one, or the one that is far larger than any other.
//! In: the detector's quads. Out: one of them, or those between which a person must choose.

use nalgebra::Matrix2;
use vision::{
    detect::{Quad, QuadKind, detect},
    frame::{GrayImage, PictureRef},
    geometry::{Corners, polygon::iou},
    params::Params,
    trace::NoTrace,
};

/// A dominant quad has this many times the area of any other.
const DOMINANT_AREA_RATIO: f64 = 3.0;
/// A larger photograph is reduced before detection: the detector is made for robots' cameras, and
/// this bounds its time.
const MAX_DETECT_PX: usize = 1_920 * 1_200;
/// Quads with a greater intersection over union show the same object.
const SAME_OBJECT_IOU: f64 = 0.5;

/// A quad of a photograph, wholly in the image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WholeQuad {
    /// Its corners, px of the photograph.
    pub corners_px: Corners,
    /// Their covariances by the detector, px^2.
    pub covariance_px2: [Matrix2<f64>; 4],
}

impl WholeQuad {
    /// The same with corner `shift` (0 to 3) named top-left.
    #[must_use]
    pub fn rotated(&self, shift: usize) -> Self {
        let Self { corners_px, covariance_px2 } = self;
        let covariance_px2 = std::array::from_fn(|i| covariance_px2[(i + shift) % 4]);
        Self { corners_px: corners_px.rotated(shift), covariance_px2 }
    }
}

/// The quads of a photograph, largest first, px of the photograph: each with four detected sides,
/// none clipped by the image border.
pub fn whole_quads<'a>(picture: impl Into<PictureRef<'a>>, p: &Params) -> Vec<WholeQuad> {
    let picture = picture.into();
    let factor = ((picture.width() * picture.height()) as f64 / MAX_DETECT_PX as f64).sqrt().ceil() as usize;
    let quads = if factor > 1 {
        detect(&picture.map(|plane| reduced(plane, factor)), &p.detect, &mut NoTrace)
    } else {
        detect(picture, &p.detect, &mut NoTrace)
    };
    let whole = |q: &&Quad| q.kind == QuadKind::Full && !q.side_clipped.contains(&true);
    let mut found: Vec<WholeQuad> =
        quads.iter().filter(whole).filter_map(|q| enlarged(q, factor.max(1))).collect();
    found.sort_by(|a, b| b.corners_px.area_px2().total_cmp(&a.corners_px.area_px2()));
    found
}

/// The dominant one of quads that are sorted by falling area, if there is one.
pub fn dominant(quads: &[Corners]) -> Option<&Corners> {
    let first = quads.first()?;
    let rival =
        quads[1..].iter().find(|q| !inside(q, first) && iou(q.points(), first.points()) < SAME_OBJECT_IOU);
    rival.is_none_or(|r| first.area_px2() >= DOMINANT_AREA_RATIO * r.area_px2()).then_some(first)
}

/// The quads that do not overlap `taken`.
pub fn others<'a>(quads: &'a [Corners], taken: &Corners) -> impl Iterator<Item = &'a Corners> {
    let taken = *taken;
    quads.iter().filter(move |q| iou(q.points(), taken.points()) < 1e-3)
}

/// Whether every corner of `inner` lies in `outer`: then it is part of the same picture.
fn inside(inner: &Corners, outer: &Corners) -> bool {
    inner.points().iter().all(|c| vision::geometry::polygon::contains(outer.points(), c, 1.0))
}

/// A plane reduced by means of `factor` x `factor` pixels; a remainder at the right and the bottom
/// is left out.
fn reduced(image: &GrayImage, factor: usize) -> GrayImage {
    GrayImage::from_fn(image.width() / factor, image.height() / factor, |u, v| {
        let rows = (v * factor..(v + 1) * factor).map(|row| &image.data()[row * image.width()..]);
        let sum: usize = rows
            .map(|row| row[u * factor..(u + 1) * factor].iter().map(|g| usize::from(*g)).sum::<usize>())
            .sum();
        (sum / (factor * factor)) as u8
    })
}

/// A quad of the reduced image in px of the photograph. Pixel centres are integers, so a block's
/// centre lies between its pixels.
fn enlarged(quad: &Quad, factor: usize) -> Option<WholeQuad> {
    let scale = factor as f64;
    let corners_px =
        Corners::new(quad.corners_px.points().map(|c| c.map(|x| (x + 0.5) * scale - 0.5))).ok()?;
    Some(WholeQuad { corners_px, covariance_px2: quad.corner_covariance_px2.map(|c| c * scale * scale) })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(x: f64, side: f64) -> Corners {
        Corners::try_from([[x, 0.0], [x + side, 0.0], [x + side, side], [x, side]]).unwrap()
    }

    #[test]
    fn only_a_clear_case_is_decided() {
        let large = square(0.0, 300.0);
        assert_eq!(dominant(&[]), None);
        assert_eq!(dominant(&[large]), Some(&large));
        // Three times the area, and slightly less.
        assert_eq!(dominant(&[large, square(400.0, 173.2)]), Some(&large));
        assert_eq!(dominant(&[large, square(400.0, 173.3)]), None);
        // An inner border, and nearly the same border, belong to the same object.
        let inner = Corners::try_from([[20.0, 20.0], [280.0, 20.0], [280.0, 280.0], [20.0, 280.0]]).unwrap();
        assert_eq!(dominant(&[large, inner, square(10.0, 295.0)]), Some(&large));
        assert_eq!(others(&[large, inner, square(400.0, 50.0)], &large).count(), 1);
    }

    #[test]
    fn a_large_photograph_is_searched_small_and_answered_in_its_own_pixels() {
        let (u, v) = (600..1_800, 500..1_700);
        let image = GrayImage::from_fn(2_400, 2_200, |x, y| {
            let (inside, check) = (u.contains(&x) && v.contains(&y), (x / 100 + y / 100) % 2 == 0);
            if inside { if check { 60 } else { 90 } } else { 220 }
        });
        let quads = whole_quads(&image, &Params::default());
        let corners: Vec<Corners> = quads.iter().map(|q| q.corners_px).collect();
        let found = dominant(&corners).unwrap_or_else(|| panic!("{quads:?}"));
        let [tl, _, br, _] = found.points();
        for (found, true_px) in [(tl.x, 599.5), (tl.y, 499.5), (br.x, 1_799.5), (br.y, 1_699.5)] {
            assert!((found - true_px).abs() < 2.0, "{found} instead of {true_px}");
        }
        // The covariances are enlarged, too: two pixels for each.
        let halves = detect(&reduced(&image, 2), &Params::default().detect, &mut NoTrace);
        let half = halves.iter().max_by(|a, b| a.corners_px.area_px2().total_cmp(&b.corners_px.area_px2()));
        let half = half.unwrap().corner_covariance_px2;
        assert!((quads[0].covariance_px2[0] - half[0] * 4.0).norm() < 1e-12);
    }
}
