//! Which quad of a photograph is meant, when nobody says: the only one, or the one that is far larger than any other.
//! In: the detector's quads. Out: one of them, or those between which a person must choose.

use nalgebra::Matrix2;
use vision::{
    detect::{Quad, QuadKind, detect},
    frame::GrayImage,
    geometry::{Corners, polygon::iou},
    params::Params,
    trace::NoTrace,
};

/// So many times larger than any other quad is beyond doubt.
const FAR_LARGER: f64 = 3.0;
/// A larger photograph is made smaller for the search: the detector is made for robots' cameras, and its time is
/// bounded by this.
const SEARCH_MAX_PX: usize = 1_920 * 1_200;
/// Quads that share more of their union than this show the same thing.
const SAME_IOU: f64 = 0.5;

/// A whole quad of a photograph.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Whole {
    /// Its corners.
    pub corners_px: Corners,
    /// Their covariance by the detector, in the same pixels.
    pub covariance_px2: [Matrix2<f64>; 4],
}

/// The quads of a photograph, largest first, in its own pixels: four sides seen, none cut off by the image border.
pub fn whole_quads(image: &GrayImage, p: &Params) -> Vec<Whole> {
    let factor = ((image.width() * image.height()) as f64 / SEARCH_MAX_PX as f64).sqrt().ceil() as usize;
    let quads = if factor > 1 {
        detect(&smaller(image, factor), &p.detect, &mut NoTrace)
    } else {
        detect(image, &p.detect, &mut NoTrace)
    };
    let whole = |q: &&Quad| q.kind == QuadKind::Full && !q.side_clipped.contains(&true);
    let mut found: Vec<Whole> =
        quads.iter().filter(whole).filter_map(|q| enlarged(q, factor.max(1))).collect();
    found.sort_by(|a, b| b.corners_px.area_px2().total_cmp(&a.corners_px.area_px2()));
    found
}

/// The one quad that is meant, of quads sorted by falling area.
pub fn dominant(quads: &[Corners]) -> Option<&Corners> {
    let first = quads.first()?;
    let rival = quads[1..].iter().find(|q| !inside(q, first) && iou(q.points(), first.points()) < SAME_IOU);
    rival.is_none_or(|r| first.area_px2() >= FAR_LARGER * r.area_px2()).then_some(first)
}

/// The quads that show something else than `taken`.
pub fn others<'a>(quads: &'a [Corners], taken: &Corners) -> impl Iterator<Item = &'a Corners> {
    let taken = *taken;
    quads.iter().filter(move |q| iou(q.points(), taken.points()) < 1e-3)
}

/// Every corner of `inner` lies in `outer`: part of the same picture.
fn inside(inner: &Corners, outer: &Corners) -> bool {
    inner.points().iter().all(|c| vision::geometry::polygon::contains(outer.points(), c, 1.0))
}

/// Means of `factor` x `factor` pixels; a remainder at the right and the bottom is left out.
fn smaller(image: &GrayImage, factor: usize) -> GrayImage {
    GrayImage::from_fn(image.width() / factor, image.height() / factor, |u, v| {
        let rows = (v * factor..(v + 1) * factor).map(|row| &image.data()[row * image.width()..]);
        let sum: usize = rows
            .map(|row| row[u * factor..(u + 1) * factor].iter().map(|g| usize::from(*g)).sum::<usize>())
            .sum();
        (sum / (factor * factor)) as u8
    })
}

/// Pixel centres are at whole numbers: the centre of a block lies between its pixels.
fn enlarged(quad: &Quad, factor: usize) -> Option<Whole> {
    let scale = factor as f64;
    let corners_px =
        Corners::new(quad.corners_px.points().map(|c| c.map(|x| (x + 0.5) * scale - 0.5))).ok()?;
    Some(Whole { corners_px, covariance_px2: quad.corner_covariance_px2.map(|c| c * scale * scale) })
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
        // Three times the area, and just not.
        assert_eq!(dominant(&[large, square(400.0, 173.2)]), Some(&large));
        assert_eq!(dominant(&[large, square(400.0, 173.3)]), None);
        // An inner frame, and nearly the same border, are the same thing.
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
        // So are their covariances: two pixels for each.
        let halves = detect(&smaller(&image, 2), &Params::default().detect, &mut NoTrace);
        let half = halves.iter().max_by(|a, b| a.corners_px.area_px2().total_cmp(&b.corners_px.area_px2()));
        let half = half.unwrap().corner_covariance_px2;
        assert!((quads[0].covariance_px2[0] - half[0] * 4.0).norm() < 1e-12);
    }
}
