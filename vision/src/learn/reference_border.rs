//! The border of a new view of an object that has a first view.
//!
//! In: the picture, the detected border, the icon of the first view. Out: the corners of what that
//! icon shows. The detector takes now the sheet, now its frame, now the shadow beside it for the
//! border: views cut along different borders make a blurred model and a wrong size.

use crate::{
    frame::GrayImage,
    icon::{Icon, rectify},
    params::Params,
    recognise::alignment::{
        aligner::{Aligner, SamplingGrids, Template},
        surroundings::{Surroundings, coarse},
    },
    seen_border::{FoundBy, SeenBorder, is_same_border},
};

/// The corners in `image` of what `reference` shows, near the border `detected`: these corners
/// themselves where they are the same border, for its edges are the more accurate, or else by
/// alignment. `None` where the picture shows something else.
pub fn reference_border(
    image: &GrayImage,
    detected: &SeenBorder,
    reference: &Icon,
    p: &Params,
) -> Option<SeenBorder> {
    let align = &p.recognise.verdict.align;
    let icon = rectify(image, &detected.corners_px, &p.icon).ok()?;
    let around = Surroundings::new(image, &detected.corners_px, &icon, align)?;
    let grids = SamplingGrids::new(p.icon.size, &p.recognise.correlation);
    let coarse = coarse(reference, align);
    let aligned = Aligner::new(&grids, align).align(&around, &Template::new(reference, &coarse))?;
    if is_same_border(&detected.corners_px, &aligned.corners_px, p) {
        return Some(*detected);
    }
    Some(SeenBorder {
        corners_px: aligned.corners_px,
        covariance_px2: aligned.covariance_px2,
        found_by: FoundBy::Alignment,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        geometry::corners::Corners,
        icon::icon,
        recognise::fixture::{oblique, photograph, poster},
    };
    use nalgebra::{Matrix2, Point2};

    fn detected(corners_px: Corners) -> SeenBorder {
        SeenBorder { corners_px, covariance_px2: [Matrix2::identity(); 4], found_by: FoundBy::Edges }
    }

    #[test]
    fn another_border_of_the_object_gives_way_to_that_of_the_reference() {
        let p = Params::default();
        let image = photograph(&poster(1), &oblique(), 1.0, 0.0);
        let reference = icon(&image, &oblique(), &p.icon).unwrap();
        // 6 % inside the border, as the mat of a framed picture is.
        let inner =
            oblique().points().map(|q| Point2::new(0.94 * q.x + 0.06 * 185.0, 0.94 * q.y + 0.06 * 205.0));
        let found =
            reference_border(&image, &detected(Corners::new(inner).unwrap()), &reference, &p).unwrap();
        assert_eq!(found.found_by, FoundBy::Alignment);
        assert!(found.corners_px.furthest_px(&oblique()) < 1.0, "{:?}", found.corners_px);
        // The same border stays as it was detected.
        let same = detected(Corners::new(oblique().points().map(|q| Point2::new(q.x + 0.5, q.y))).unwrap());
        assert_eq!(reference_border(&image, &same, &reference, &p), Some(same));
    }

    #[test]
    fn another_object_has_no_border_of_the_reference() {
        let p = Params::default();
        let reference = icon(&photograph(&poster(1), &oblique(), 1.0, 0.0), &oblique(), &p.icon).unwrap();
        let other = photograph(&poster(2), &oblique(), 1.0, 0.0);
        assert_eq!(reference_border(&other, &detected(oblique()), &reference, &p), None);
    }
}
