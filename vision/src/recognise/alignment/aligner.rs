//! Template alignment: moves the corners of a quad until its picture agrees with a learnt icon. A
//! true match fits far better afterwards, a false one hardly does; the corners get more accurate
//! for the pose. Beyond the method (its sections 4 and 6.3 name it as an option). `decision`
//! applies the thresholds.
//!
//! Three levels, coarse to fine. The first rejects most candidates cheaply: sides only, at a third
//! of the icon's resolution. The second moves all corners; the third gives the last tenths of a
//! pixel.

use crate::{
    detect::quad::BORDER_SIGMA_PX,
    geometry::{corners::Corners, homography::Homography},
    icon::Icon,
    recognise::{
        alignment::{
            align_params::{self, AlignParams, LEVELS},
            cost::{Cost, Levels},
            minimise::{Limits, LmResult, minimise},
            sampling_grid::{PaddedIcon, Pattern, SamplingGrid, SquareMap, sample, square},
            surroundings::{Surroundings, coarse_size},
        },
        features::{correlation::CorrelationParams, harris::blurred},
    },
    seen_border::aligned_covariance_px2,
};
use fearless_simd::{Level, dispatch};
use nalgebra::{Matrix2, Point2, Vector2};
use std::cell::OnceCell;

/// Pixels along the icon's border that are not compared: smoothing mixes in the wall outside, which
/// differs from that of training.
const SECOND_BORDER_PX: usize = 2;
/// The same of the coarse level, in its pixels.
const COARSE_BORDER_PX: usize = 1;

/// Least standard deviation of an aligned corner, in icon pixels.
const LEAST_SIGMA_ICON_PX: f64 = 0.1;

/// A level ends with a step below this, in pixels of that level.
const SETTLED_PX: [f64; LEVELS] = [0.08, 0.08, 0.02];

/// A picture aligned with a template.
#[derive(Debug, Clone, PartialEq)]
pub struct Alignment {
    /// The template's corners in the image.
    pub corners_px: Corners,
    /// Their covariances, px^2, from the residuals of the alignment.
    pub covariance_px2: [Matrix2<f64>; 4],
    /// The icon of these corners, cut from the rectified surroundings.
    pub icon: Icon,
}

/// A learnt icon as the template of alignments; the fine levels are computed on first use.
#[derive(Debug)]
pub struct Template<'a> {
    icon: &'a Icon,
    coarse: &'a [f32],
    second: OnceCell<Cost<8>>,
    last: OnceCell<Levels>,
}

impl<'a> Template<'a> {
    /// A template of the icon and its
    /// [`coarse()`](crate::recognise::alignment::surroundings::coarse) level.
    pub fn new(icon: &'a Icon, coarse: &'a [f32]) -> Self {
        Self { icon, coarse, second: OnceCell::new(), last: OnceCell::new() }
    }
}

/// The alignment after the coarse level.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CoarseAlignment {
    corners: [Point2<f64>; 4],
    /// Mean squared correlation of the buckets, 0 to 1.
    pub likeness: f64,
}

/// Sampling grids of all levels for icons of one size. Computed once, for any number of pictures.
#[derive(Debug, Clone, Default)]
pub struct SamplingGrids {
    size: usize,
    min_deviation: f32,
    coarse: SamplingGrid,
    second: SamplingGrid,
    last: SamplingGrid,
}

impl SamplingGrids {
    /// For icons of `size`, cut into buckets as `c` says.
    pub fn new(size: usize, c: &CorrelationParams) -> Self {
        let lattice = |size, border, pattern| SamplingGrid::new(size, c.per_side(), border, pattern);
        Self {
            size,
            min_deviation: c.min_deviation as f32,
            coarse: lattice(coarse_size(size), COARSE_BORDER_PX, Pattern::All),
            second: lattice(size, SECOND_BORDER_PX, Pattern::Fourth),
            last: lattice(size, 0, Pattern::Half),
        }
    }
}

/// Aligns pictures with templates.
#[derive(Debug, Clone, Copy)]
pub struct Aligner<'a> {
    on: &'a SamplingGrids,
    p: &'a AlignParams,
}

impl<'a> Aligner<'a> {
    /// An aligner on the grids `on`.
    pub fn new(on: &'a SamplingGrids, p: &'a AlignParams) -> Self {
        Self { on, p }
    }

    /// Aligns the picture with `template`. `None` when it does not match or does not determine the
    /// corners.
    pub fn align(&self, around: &Surroundings<'_>, template: &Template<'_>) -> Option<Alignment> {
        self.align_fine(around, template, &self.align_coarse(around, template)?)
    }

    /// The coarse level. `None` when the picture does not match.
    pub fn align_coarse(
        &self,
        around: &Surroundings<'_>,
        template: &Template<'_>,
    ) -> Option<CoarseAlignment> {
        let size = coarse_size(self.on.size);
        if around.icon.size != self.on.size
            || template.icon.size != self.on.size
            || template.coarse.len() != size * size
        {
            return None;
        }
        let picture = around.coarse(self.p);
        let (lattice, start, limits) = (&self.on.coarse, square(size), self.limits(0, size));
        let settled: Option<LmResult> = dispatch!(Level::new(), _s => {
            let see = |map: &SquareMap, seen: &mut [f32]| sample(picture, map, &lattice.x, &lattice.y, seen);
            minimise(&Cost::<4>::new(lattice, template.coarse, self.on.min_deviation), lattice, see, start, limits)
        });
        let settled = settled.filter(|s| s.likeness >= self.p.min_alike[0])?;
        let scale = self.on.size as f64 / size as f64;
        let corners =
            settled.corners.map(|c| Point2::new((c.x + 0.5) * scale - 0.5, (c.y + 0.5) * scale - 0.5));
        Some(CoarseAlignment { corners, likeness: settled.likeness })
    }

    /// The two fine levels, from the corners of the coarse one.
    pub fn align_fine(
        &self,
        around: &Surroundings<'_>,
        template: &Template<'_>,
        from: &CoarseAlignment,
    ) -> Option<Alignment> {
        let enough = |settled: &LmResult, level: usize| settled.likeness >= self.p.min_alike[level];
        let second = self.second(around, template, from.corners).filter(|s| enough(s, 1))?;
        let last = self.last(around, template, second.corners).filter(|s| enough(s, 2))?;
        let corners = last.corners;
        let map = &around.image_from_icon;
        if corners.iter().any(|m| map.denominator(m) <= 0.0) {
            return None;
        }
        let corners_px = Corners::new(corners.map(|m| map.apply(&m))).ok()?;
        let size = self.on.size;
        let cut = SquareMap::new(size, &corners)?;
        let pixels = dispatch!(Level::new(), _s => whole(&cut, size, around.full()));
        let covariance_px2 = in_image(&corners_px, size, last.covariances);
        Some(Alignment { corners_px, covariance_px2, icon: Icon { size, pixels, source_scale: 1.0 } })
    }

    /// The second level, on smoothed surroundings.
    fn second(
        &self,
        around: &Surroundings<'_>,
        template: &Template<'_>,
        start: [Point2<f64>; 4],
    ) -> Option<LmResult> {
        let (sigma, lattice, size) = (self.p.sigmas[1], &self.on.second, self.on.size);
        let (picture, limits) = (around.smooth(sigma), self.limits(1, size));
        dispatch!(Level::new(), _s => {
            let smooth = || blurred(&template.icon.pixels, size, sigma);
            let cost = template.second.get_or_init(|| Cost::new(lattice, &smooth(), self.on.min_deviation));
            let see = |map: &SquareMap, seen: &mut [f32]| sample(picture, map, &lattice.x, &lattice.y, seen);
            minimise(cost, lattice, see, start, limits)
        })
    }

    /// The last level smooths after cutting, as the template was: the wall around does not mix in,
    /// so the border of the icon is compared, too. The gradients are those of the picture: those of
    /// the template bias the step where one of the two is blurred more.
    fn last(
        &self,
        around: &Surroundings<'_>,
        template: &Template<'_>,
        start: [Point2<f64>; 4],
    ) -> Option<LmResult> {
        let (sigma, lattice, size) = (self.p.sigmas[2], &self.on.last, self.on.size);
        let (picture, limits) = (around.full(), self.limits(2, size));
        dispatch!(Level::new(), _s => {
            let smooth = || blurred(&template.icon.pixels, size, sigma);
            let levels =
                template.last.get_or_init(|| Levels::new(lattice, &smooth(), self.on.min_deviation));
            let cut = |map: &SquareMap| blurred(&whole(map, size, picture), size, sigma);
            let first = cut(&SquareMap::new(size, &start)?);
            let own = Cost::<8>::with_slopes_of(lattice, levels, &first);
            let mut first = Some(first);
            let see = |map: &SquareMap, seen: &mut [f32]| {
                // The iteration begins at the position of the gradients.
                let cut = first.take().unwrap_or_else(|| cut(map));
                for (seen, at) in seen.iter_mut().zip(&lattice.at) {
                    *seen = cut[*at as usize];
                }
            };
            minimise(&own, lattice, see, start, limits)
        })
    }

    /// The limits for an icon of `size`.
    fn limits(&self, level: usize, size: usize) -> Limits {
        let (shift_px, steps) = (self.p.max_shift * size as f64, self.p.steps.min(align_params::MAX_STEPS));
        Limits { shift_px, steps, settled_px: SETTLED_PX[level] }
    }
}

/// Covariances of corners in the image, from those in squared pixels of an icon of `size`.
fn in_image(corners_px: &Corners, size: usize, covariances: Option<[Matrix2<f64>; 4]>) -> [Matrix2<f64>; 4] {
    let unknown = || aligned_covariance_px2(corners_px, size);
    let (Some(own), Ok(map)) = (covariances, Homography::square_to_quad(size, corners_px)) else {
        return unknown();
    };
    let floor = Matrix2::identity() * LEAST_SIGMA_ICON_PX.powi(2);
    std::array::from_fn(|i| {
        let at = square(size)[i];
        let along = |d: Vector2<f64>| map.apply(&(at + 0.5 * d)) - map.apply(&(at - 0.5 * d));
        let slope = Matrix2::from_columns(&[along(Vector2::x()), along(Vector2::y())]);
        let sum = slope * (own[i] + floor) * slope.transpose();
        0.5 * (sum + sum.transpose()) + Matrix2::identity() * BORDER_SIGMA_PX.powi(2)
    })
}

/// All pixels of the icon under `map`.
#[expect(
    clippy::inline_always,
    reason = "an instruction set holds only in what is inlined where it was chosen"
)]
#[inline(always)]
fn whole(map: &SquareMap, size: usize, picture: PaddedIcon<'_>) -> Vec<f32> {
    let padded = size.next_multiple_of(crate::recognise::features::separable::LANES);
    let x: Vec<f32> = (0..padded).map(|x| x as f32).collect();
    let (mut y, mut row) = (vec![0.0; padded], vec![0.0; padded]);
    let mut pixels = Vec::with_capacity(size * size);
    for v in 0..size {
        y.fill(v as f32);
        sample(picture, map, &x, &y, &mut row);
        pixels.extend_from_slice(&row[..size]);
    }
    pixels
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        frame::GrayImage,
        geometry::homography::Homography,
        icon::{IconParams, icon},
        recognise::{
            alignment::surroundings::coarse,
            fixture::{oblique, photograph, poster},
        },
    };

    fn cut(image: &GrayImage, corners: &Corners) -> Icon {
        icon(image, corners, &IconParams::default()).unwrap()
    }

    /// Aligns `around` with `template`.
    fn aligned(around: &Surroundings<'_>, template: &Icon) -> Option<Alignment> {
        let (on, p) = (SamplingGrids::new(75, &CorrelationParams::default()), AlignParams::default());
        Aligner::new(&on, &p).align(around, &Template::new(template, &coarse(template, &p)))
    }

    fn aligned_in_image(image: &GrayImage, corners: &Corners, template: &Icon) -> Option<Alignment> {
        let icon = cut(image, corners);
        aligned(&Surroundings::new(image, corners, &icon, &AlignParams::default()).unwrap(), template)
    }

    #[test]
    fn displaced_corners_are_recovered() {
        let template = cut(&photograph(&poster(1), &oblique(), 1.0, 0.0), &oblique());
        let image = photograph(&poster(1), &oblique(), 0.7, 40.0);
        // Up to 8 px of 200: 3 icon pixels of 75.
        for offset in
            [[6.0, -5.0, 8.0, 4.0, -6.0, 7.0, 3.0, -8.0], [-8.0, -8.0, 8.0, -8.0, 8.0, 8.0, -8.0, 8.0]]
        {
            let mut i = 0;
            let wrong = oblique().points().map(|q| {
                i += 2;
                Point2::new(q.x + offset[i - 2], q.y + offset[i - 1])
            });
            let found =
                aligned_in_image(&image, &Corners::new(wrong).unwrap(), &template).unwrap().corners_px;
            for (a, b) in found.points().iter().zip(oblique().points()) {
                // An icon pixel is 2.7 px here.
                assert!((a - b).norm() < 0.7, "{offset:?}: {a} for {b}");
            }
        }
    }

    #[test]
    fn an_icon_without_its_image_is_aligned() {
        let image = photograph(&poster(1), &oblique(), 1.0, 0.0);
        let all = cut(&image, &oblique());
        let inset =
            oblique().points().map(|q| Point2::new(0.94 * q.x + 0.06 * 185.0, 0.94 * q.y + 0.06 * 205.0));
        let template = cut(&image, &Corners::new(inset).unwrap());
        let around = Surroundings::of_icon(&all, &AlignParams::default()).unwrap();
        let aligned_in_image = aligned(&around, &template).unwrap();
        let icon_from_image = Homography::square_to_quad(75, &oblique()).unwrap().inverse().unwrap();
        for (found, wanted) in aligned_in_image.corners_px.points().iter().zip(inset) {
            let wanted = icon_from_image.apply(&wanted);
            assert!((found - wanted).norm() < 0.4, "{found} for {wanted}");
        }
        // Another picture is rejected.
        let other = cut(&photograph(&poster(2), &oblique(), 1.0, 0.0), &oblique());
        let around = Surroundings::of_icon(&other, &AlignParams::default()).unwrap();
        assert!(aligned(&around, &template).is_none());
    }

    #[test]
    fn a_covered_part_does_not_move_the_corners() {
        let image = photograph(&poster(2), &oblique(), 1.0, 0.0);
        let template = cut(&image, &oblique());
        let covered = GrayImage::from_fn(400, 400, |u, v| {
            if (120..250).contains(&u) && (160..240).contains(&v) {
                if (u / 7) % 2 == 0 { 255 } else { 0 }
            } else {
                image.at(u, v)
            }
        });
        let wrong = Corners::new(oblique().points().map(|q| Point2::new(q.x + 4.0, q.y - 3.0))).unwrap();
        let found = aligned_in_image(&covered, &wrong, &template).unwrap().corners_px;
        for (a, b) in found.points().iter().zip(oblique().points()) {
            assert!((a - b).norm() < 0.8, "{a} for {b}");
        }
    }

    #[test]
    fn the_displacement_of_corners_is_bounded() {
        let image = photograph(&poster(1), &oblique(), 1.0, 0.0);
        let template = cut(&image, &oblique());
        // 20 % of a side of at most 252 px, both coordinates.
        let limit_px = 0.2 * 252.0 * std::f64::consts::SQRT_2;
        let mut moved = 0;
        for off_px in [3.0, 6.0, 12.0, 25.0, 50.0, 100.0] {
            let start = Corners::new(oblique().points().map(|q| Point2::new(q.x + off_px, q.y))).unwrap();
            let Some(found) = aligned_in_image(&image, &start, &template) else { continue };
            moved += 1;
            for (a, b) in found.corners_px.points().iter().zip(start.points()) {
                assert!((a - b).norm() <= limit_px, "{off_px}: {a} from {b}");
            }
        }
        assert!(moved >= 2, "only {moved} were aligned: the bound was not tested");
        let flat = GrayImage::from_fn(400, 400, |_, _| 99);
        assert!(aligned_in_image(&flat, &oblique(), &cut(&image, &oblique())).is_none());
    }

    #[test]
    fn icons_of_other_sizes_are_refused() {
        let image = photograph(&poster(1), &oblique(), 1.0, 0.0);
        let (whole, p) = (cut(&image, &oblique()), AlignParams::default());
        let small = icon(&image, &oblique(), &IconParams { size: 60, ..IconParams::default() }).unwrap();
        assert!(aligned(&Surroundings::of_icon(&small, &p).unwrap(), &whole).is_none());
        assert!(aligned(&Surroundings::of_icon(&whole, &p).unwrap(), &small).is_none());
        let empty = Icon { size: 0, pixels: vec![], source_scale: 1.0 };
        assert!(Surroundings::of_icon(&empty, &p).is_none());
    }
}
