//! A quad and a learnt icon in, the quad's corners moved so that its picture lies on the icon out. Evidence for the
//! decision (a true match fits far better afterwards, a false one hardly does) and sharper corners for the pose.
//! Beyond the method (its sections 4 and 6.3 name it as an option). It decides nothing itself.

use super::{
    correlation::{CorrelationParams, LANES, dot},
    harris::blurred,
};
use crate::{
    detect::quads::Corners,
    frame::GrayImage,
    geometry::homography::Homography,
    icon::{Icon, IconParams, rectify},
};
use nalgebra::{Point2, SMatrix, SVector, Vector2};
use serde::{Deserialize, Serialize};
use std::cell::OnceCell;

/// Most Gauss-Newton steps at one level, whatever the parameters say.
pub const MAX_STEPS: usize = 50;

/// Looks at a picture, from coarse to fine.
const LEVELS: usize = 3;

/// Parameters of this stage.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct AlignParams {
    /// No corner moves further than this share of the icon's side, along either axis.
    pub max_shift: f64,
    /// Both pictures are smoothed by these, one after the other, in icon pixels. At the first only the four sides move,
    /// each along its normal; then all corners.
    pub sigmas: [f64; LEVELS],
    /// Gauss-Newton steps at each smoothing, at most [`MAX_STEPS`].
    pub steps: usize,
    /// Mean squared correlation of the buckets below which a picture is given up after each smoothing: it is of something
    /// else. On real photographs, true ones stay above 0.46, 0.50 and 0.49.
    pub min_alike: [f64; LEVELS],
}

impl Default for AlignParams {
    fn default() -> Self {
        Self { max_shift: 0.2, sigmas: [4.0, 2.0, 1.0], steps: 10, min_alike: [0.33, 0.4, 0.0] }
    }
}

type Vector8 = SVector<f64, 8>;
type Matrix8 = SMatrix<f64, 8, 8>;
/// Corner moves (x and y of TL, TR, BR, BL) from moves of the sides left, right, top, bottom.
type Sides = SMatrix<f64, 8, 4>;

/// A step of less than this, in icon pixels, is the last of its level.
const LAST_STEP_PX: f64 = 0.02;
/// Smoothing from which on every second pixel says as much as every one.
const COARSE_SIGMA_PX: f64 = 2.0;

/// A picture laid on a template.
#[derive(Debug, Clone, PartialEq)]
pub struct Laid {
    /// Where the template's corners are in the image.
    pub corners_px: Corners,
    /// What they enclose, cut from the rectified surroundings.
    pub icon: Icon,
}

/// The surroundings of a quad, rectified once, in which corners may move.
#[derive(Debug, Clone)]
pub struct Surroundings {
    image_from_icon: Homography,
    margin: usize,
    size: usize,
    pixels: Vec<f32>,
    /// The coarse looks' pictures, smoothed when first asked for: most candidates are given up at the first.
    coarse: [OnceCell<Vec<f32>>; LEVELS],
}

impl Surroundings {
    /// Rectifies `corners_px` with a margin around. `None` when the quad is too close to the horizon.
    pub fn new(image: &GrayImage, corners_px: &Corners, icon: &IconParams, p: &AlignParams) -> Option<Self> {
        let image_from_icon = Homography::square_to_quad(icon.size, corners_px).ok()?;
        let margin = margin(icon.size, p);
        let (low, high) = (-0.5 - margin as f64, icon.size as f64 - 0.5 + margin as f64);
        let wide = [[low, low], [high, low], [high, high], [low, high]].map(Point2::from);
        if wide.iter().any(|c| image_from_icon.denominator(c) <= 0.0) {
            return None;
        }
        let wide = Corners::new(wide.map(|c| image_from_icon.apply(&c))).ok()?;
        let size = icon.size + 2 * margin;
        let picture = rectify(image, &wide, &IconParams { size, max_outside: 1.0, ..icon.clone() }).ok()?;
        Some(Self { image_from_icon, margin, size, pixels: picture.pixels, coarse: Default::default() })
    }

    /// An icon alone, its border pixels repeated around it: for icons whose image is gone.
    pub fn of_icon(icon: &Icon, p: &AlignParams) -> Option<Self> {
        let margin = margin(icon.size, p);
        let size = icon.size + 2 * margin;
        let inside = |i: usize| i.saturating_sub(margin).min(icon.size - 1);
        let row = |y: usize| (0..size).map(move |x| icon.pixels[inside(y) * icon.size + inside(x)]);
        let pixels: Vec<f32> = (0..size).flat_map(row).collect();
        let image_from_icon = Homography::from_matrix(nalgebra::Matrix3::identity())?;
        Some(Self { image_from_icon, margin, size, pixels, coarse: Default::default() })
    }

    /// Moves the corners until the picture lies on `template`. `None` when the picture is of something else, or says
    /// nothing about where it lies.
    pub fn align(&self, template: &Template<'_>, p: &AlignParams) -> Option<Laid> {
        let size = template.icon.size;
        if size + 2 * self.margin != self.size {
            return None;
        }
        let mut moved = square(size);
        for (level, sigma) in p.sigmas.into_iter().enumerate() {
            let goal = template.goal(level, sigma);
            // A fine look smooths after cutting, as the template was: the wall around must not bleed in.
            let pixels = match goal.fine_sigma {
                Some(_) => &self.pixels,
                None => self.coarse[level].get_or_init(|| blurred(&self.pixels, self.size, sigma)),
            };
            let picture = Picture { pixels, width: self.size, margin: self.margin };
            let (place, alike) = goal.settle(&picture, moved, level == 0, p)?;
            if alike < p.min_alike[level] {
                return None;
            }
            moved = place;
        }
        if moved.iter().any(|m| self.image_from_icon.denominator(m) <= 0.0) {
            return None;
        }
        let corners_px = Corners::new(moved.map(|m| self.image_from_icon.apply(&m))).ok()?;
        let map = Homography::from_points(&square(size), &moved).ok()?;
        let mut pixels = Vec::with_capacity(size * size);
        let picture = Picture { pixels: &self.pixels, width: self.size, margin: self.margin };
        sample(&picture, &map, &everywhere(size), &mut pixels);
        Some(Laid { corners_px, icon: Icon { size, pixels, source_scale: 1.0 } })
    }
}

/// A learnt icon on which pictures are laid; what each look needs is worked out when it is first taken.
#[derive(Debug)]
pub struct Template<'a> {
    icon: &'a Icon,
    correlation: &'a CorrelationParams,
    goals: [OnceCell<Goal>; LEVELS],
}

impl<'a> Template<'a> {
    /// Takes the icon as it is.
    pub fn new(icon: &'a Icon, correlation: &'a CorrelationParams) -> Self {
        Self { icon, correlation, goals: Default::default() }
    }

    fn goal(&self, level: usize, sigma: f64) -> &Goal {
        self.goals[level].get_or_init(|| Goal::new(self.icon, sigma, self.correlation))
    }
}

/// Pixels around the icon in which corners may move.
fn margin(size: usize, p: &AlignParams) -> usize {
    (p.max_shift.clamp(0.0, 0.5) * size as f64).ceil() as usize + 1
}

/// Corners of the icon's square.
fn square(size: usize) -> [Point2<f64>; 4] {
    let (low, high) = (-0.5, size as f64 - 0.5);
    [[low, low], [high, low], [high, high], [low, high]].map(Point2::from)
}

/// What the picture shall look like, bucket by bucket, and how that changes with the corners.
#[derive(Debug)]
struct Goal {
    size: usize,
    /// Pictures are smoothed by this after they were cut, if at all: earlier they are smoothed with their surroundings.
    fine_sigma: Option<f64>,
    /// Those with nothing to see included.
    all_buckets: usize,
    buckets: Vec<Bucket>,
}

/// The pixels of one bucket that are compared.
#[derive(Debug)]
struct Bucket {
    /// Where they are.
    xy: Vec<[f32; 2]>,
    /// Their grey levels, of mean 0 and norm 1, padded with zeros.
    values: Vec<f32>,
    /// Their change with each of the corners' eight coordinates, padded likewise.
    slopes: [Vec<f32>; 8],
    /// Products of the slopes.
    normal: Matrix8,
}

impl Goal {
    fn new(template: &Icon, sigma: f64, c: &CorrelationParams) -> Self {
        let (size, per_side) = (template.size, c.per_side());
        let smooth = blurred(&template.pixels, size, sigma);
        let edge = |i: usize| i * size / per_side;
        let coarse = sigma >= COARSE_SIGMA_PX;
        // Beyond the border lies another wall than the one learnt: what smoothing brings in from there is left out.
        let (border, stride) = if coarse { (sigma.round() as usize, 2) } else { (0, 1) };
        let within = |i: usize| edge(i).max(border)..edge(i + 1).min(size.saturating_sub(border));
        let buckets = (0..per_side * per_side)
            .filter_map(|i| {
                let (row, column) = (i / per_side, i % per_side);
                let pixels: Vec<(usize, usize)> = within(row)
                    .step_by(stride)
                    .flat_map(|y| within(column).step_by(stride).map(move |x| (x, y)))
                    .collect();
                Bucket::new(&smooth, size, &pixels, c.min_deviation)
            })
            .collect();
        Self { size, fine_sigma: (!coarse).then_some(sigma), all_buckets: per_side * per_side, buckets }
    }

    /// Moves the corners until the picture is as near as it gets: least squares over normalised buckets, each weighted by
    /// how well it correlates already, so that covered parts have no say. Levenberg-Marquardt: a step that brings
    /// nothing is taken back and tried again, shorter.
    ///
    /// Also the mean squared correlation there. Inverse compositional (Baker and Matthews 2004): the template's slopes
    /// are worked out once, not the picture's at every step; but for the last look.
    fn settle(
        &self,
        picture: &Picture<'_>,
        start: [Point2<f64>; 4],
        sides_only: bool,
        p: &AlignParams,
    ) -> Option<([Point2<f64>; 4], f64)> {
        let square = square(self.size);
        let mut damping = LEAST_DAMPING;
        let mut map = Homography::from_points(&square, &start).ok()?;
        let mut best = (start, self.equations(picture, &map, -1.0));
        for _ in 0..p.steps.min(MAX_STEPS) {
            let step = best.1.step(damping, sides_only)?;
            // The template was moved in thought: the picture moves by the inverse, before what it moved already.
            let moved =
                std::array::from_fn(|i| map.apply(&(square[i] + Vector2::new(step[2 * i], step[2 * i + 1]))));
            let shift = moved.iter().zip(&square).map(|(m, s)| (m - s).amax()).fold(0.0, f64::max);
            let next = (shift <= p.max_shift * self.size as f64)
                .then(|| Homography::from_points(&square, &moved).ok())
                .flatten()
                .map(|map| (map, self.equations(picture, &map, best.1.likeness)));
            match next {
                Some((there, equations)) if equations.likeness > best.1.likeness => {
                    (map, best, damping) = (there, (moved, equations), LEAST_DAMPING.max(damping / 10.0));
                    if step.amax() < LAST_STEP_PX {
                        break;
                    }
                }
                _ if damping > MOST_DAMPING => break,
                _ => damping *= 10.0,
            }
        }
        Some((best.0, best.1.likeness / self.all_buckets as f64))
    }

    /// How alike the picture is at `map`, and how to move on from there, if it is more alike than `least`.
    fn equations(&self, picture: &Picture<'_>, map: &Homography, least: f64) -> Equations {
        let mut sum = Equations { normal: Matrix8::zeros(), right: Vector8::zeros(), likeness: 0.0 };
        let cut = self.fine_sigma.map(|sigma| {
            let mut all = Vec::new();
            sample(picture, map, &everywhere(self.size), &mut all);
            blurred(&all, self.size, sigma)
        });
        let mut looked = Vec::with_capacity(self.buckets.len());
        for bucket in &self.buckets {
            let mut seen = Vec::with_capacity(bucket.values.len());
            match &cut {
                Some(cut) => {
                    seen.extend(bucket.xy.iter().map(|[x, y]| cut[*y as usize * self.size + *x as usize]));
                }
                None => sample(picture, map, &bucket.xy, &mut seen),
            }
            let Some(norm) = normalise(&mut seen, 0.0) else { continue };
            seen.resize(bucket.values.len(), 0.0);
            let weight = f64::from(dot(&seen, &bucket.values).max(0.0));
            sum.likeness += weight * weight;
            if weight >= 1e-3 {
                looked.push((bucket, seen, norm, weight));
            }
        }
        if sum.likeness <= least {
            return sum;
        }
        for (bucket, mut seen, norm, weight) in looked {
            // Up close the picture's own slopes: the template's would pull where one of the two is softer.
            let own = cut.as_ref().map(|cut| {
                let slopes = slopes(cut, self.size, &bucket.xy, &seen, norm);
                let normal = products(&slopes);
                (slopes, normal)
            });
            let (slopes, normal) = own.as_ref().map_or((&bucket.slopes, &bucket.normal), |(s, n)| (s, n));
            for (s, t) in seen.iter_mut().zip(&bucket.values) {
                *s = t - *s;
            }
            sum.normal += normal * weight;
            sum.right += Vector8::from_fn(|i, _| f64::from(dot(&slopes[i], &seen)) * weight);
        }
        sum
    }
}

/// Normal equations of the corners' moves, and how alike picture and template are: squared correlations of the buckets,
/// added up.
struct Equations {
    normal: Matrix8,
    right: Vector8,
    likeness: f64,
}

/// Share of the mean diagonal element that is added to each.
const LEAST_DAMPING: f64 = 1e-3;
/// A step that brings nothing although it is held back by more is given up.
const MOST_DAMPING: f64 = 1.0;

impl Equations {
    fn step(&self, damping: f64, sides_only: bool) -> Option<Vector8> {
        if sides_only {
            let basis = sides();
            let step =
                solved(basis.transpose() * self.normal * basis, basis.transpose() * self.right, damping)?;
            Some(basis * step)
        } else {
            solved(self.normal, self.right, damping)
        }
    }
}

/// Solves the normal equations. Damping keeps still what nothing ties down.
fn solved<const N: usize>(
    mut normal: SMatrix<f64, N, N>,
    right: SVector<f64, N>,
    damping: f64,
) -> Option<SVector<f64, N>> {
    let damping = damping * normal.trace() / N as f64;
    if damping <= 0.0 || !damping.is_finite() {
        return None;
    }
    for i in 0..N {
        normal[(i, i)] += damping;
    }
    normal.cholesky().map(|factor| factor.solve(&right)).filter(|step| step.iter().all(|s| s.is_finite()))
}

/// Left moves the x of TL and BL, right of TR and BR; top the y of TL and TR, bottom of BL and BR.
fn sides() -> Sides {
    let mut basis = Sides::zeros();
    for (corner, [x, y]) in [[0, 2], [1, 2], [1, 3], [0, 3]].into_iter().enumerate() {
        basis[(2 * corner, x)] = 1.0;
        basis[(2 * corner + 1, y)] = 1.0;
    }
    basis
}

impl Bucket {
    /// `None` when there is nothing to see, or too little of it.
    fn new(smooth: &[f32], size: usize, pixels: &[(usize, usize)], min_deviation: f64) -> Option<Self> {
        let n = pixels.len();
        let mut values: Vec<f32> = pixels.iter().map(|(x, y)| smooth[y * size + x]).collect();
        let norm = normalise(&mut values, min_deviation).filter(|_| n > 8)?;
        values.resize(n.next_multiple_of(LANES), 0.0);
        let xy: Vec<[f32; 2]> = pixels.iter().map(|(x, y)| [*x as f32, *y as f32]).collect();
        let slopes = slopes(smooth, size, &xy, &values, norm);
        let normal = products(&slopes);
        Some(Self { xy, values, slopes, normal })
    }
}

/// How the normalised grey levels `values` of the points change with the corners' eight coordinates, each padded with
/// zeros to the length of `values`.
fn slopes(smooth: &[f32], size: usize, xy: &[[f32; 2]], values: &[f32], norm: f32) -> [Vec<f32>; 8] {
    let gradients: Vec<[f32; 4]> = xy
        .iter()
        .map(|[column, row]| {
            let (x, y) = (*column as usize, *row as usize);
            let (left, right) = (x.saturating_sub(1), (x + 1).min(size - 1));
            let (up, down) = (y.saturating_sub(1), (y + 1).min(size - 1));
            let gx = (smooth[y * size + right] - smooth[y * size + left]) / (right - left) as f32;
            let gy = (smooth[down * size + x] - smooth[up * size + x]) / (down - up) as f32;
            [gx / norm, gy / norm, (column + 0.5) / size as f32, (row + 0.5) / size as f32]
        })
        .collect();
    // A point moves with the corners by its bilinear weights: exact for affine moves, near enough for others.
    let along = |axis: usize, weight: fn(f32, f32) -> f32| -> Vec<f32> {
        gradients.iter().map(|g| g[axis] * weight(g[2], g[3])).collect()
    };
    let weights: [fn(f32, f32) -> f32; 4] =
        [|s, t| (1.0 - s) * (1.0 - t), |s, t| s * (1.0 - t), |s, t| s * t, |s, t| (1.0 - s) * t];
    let mut slopes: [Vec<f32>; 8] = std::array::from_fn(|i| along(i % 2, weights[i / 2]));
    for slope in &mut slopes {
        let mean = slope.iter().sum::<f32>() / xy.len() as f32;
        for s in slope.iter_mut() {
            *s -= mean;
        }
        slope.resize(values.len(), 0.0);
        // What only scales the grey levels is lost when they are normalised.
        let along = dot(slope, values);
        slope.iter_mut().zip(values).for_each(|(s, v)| *s -= along * v);
    }
    slopes
}

fn products(slopes: &[Vec<f32>; 8]) -> Matrix8 {
    let mut products = Matrix8::zeros();
    for i in 0..8 {
        for j in 0..=i {
            products[(i, j)] = f64::from(dot(&slopes[i], &slopes[j]));
            products[(j, i)] = products[(i, j)];
        }
    }
    products
}

/// A square of grey levels, `width` wide, with the icon's pixel (0, 0) at (`margin`, `margin`).
struct Picture<'a> {
    pixels: &'a [f32],
    width: usize,
    margin: usize,
}

/// Every pixel of an icon, row by row.
fn everywhere(size: usize) -> Vec<[f32; 2]> {
    (0..size * size).map(|i| [(i % size) as f32, (i / size) as f32]).collect()
}

/// Grey levels where `map` takes the points.
fn sample(picture: &Picture<'_>, map: &Homography, xy: &[[f32; 2]], seen: &mut Vec<f32>) {
    let Picture { pixels, width, margin } = *picture;
    let h = map.matrix().map(|e| (e / map.matrix()[(2, 2)]) as f32);
    let (offset, last) = (margin as f32, (width - 1) as f32 - 1e-3);
    seen.clear();
    // Places first, sixteen abreast, then the pixels there.
    let (mut at, mut dx, mut dy) = ([0_i32; LANES], [0.0_f32; LANES], [0.0_f32; LANES]);
    for xy in xy.chunks(LANES) {
        for (i, [x, y]) in xy.iter().copied().enumerate() {
            let scale = 1.0 / (h[(2, 0)] * x + h[(2, 1)] * y + h[(2, 2)]);
            let u = ((h[(0, 0)] * x + h[(0, 1)] * y + h[(0, 2)]) * scale + offset).clamp(0.0, last);
            let v = ((h[(1, 0)] * x + h[(1, 1)] * y + h[(1, 2)]) * scale + offset).clamp(0.0, last);
            let (column, row) = (u as i32, v as i32);
            (at[i], dx[i], dy[i]) = (row * width as i32 + column, u - column as f32, v - row as f32);
        }
        for i in 0..xy.len() {
            let (above, below) = (at[i] as usize, at[i] as usize + width);
            let top = pixels[above] + dx[i] * (pixels[above + 1] - pixels[above]);
            let bottom = pixels[below] + dx[i] * (pixels[below + 1] - pixels[below]);
            seen.push(top + dy[i] * (bottom - top));
        }
    }
}

/// To mean 0 and norm 1; what the norm was. All zeros and `None` when the standard deviation is below `min_deviation`.
fn normalise(values: &mut [f32], min_deviation: f64) -> Option<f32> {
    let n = values.len().max(1) as f32;
    let mean = values.iter().sum::<f32>() / n;
    let square: f32 = values.iter().map(|v| (v - mean) * (v - mean)).sum();
    let seen = square > 0.0 && square.is_finite() && f64::from(square / n).sqrt() >= min_deviation;
    let scale = if seen { 1.0 / square.sqrt() } else { 0.0 };
    for v in values.iter_mut() {
        *v = (*v - mean) * scale;
    }
    seen.then(|| square.sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        icon::icon,
        recognise::fixture::{oblique, photograph, poster},
    };

    fn setting() -> (IconParams, CorrelationParams, AlignParams) {
        (IconParams::default(), CorrelationParams::default(), AlignParams::default())
    }

    #[test]
    fn displaced_corners_come_back() {
        let (ip, c, p) = setting();
        let template = icon(&photograph(&poster(1), &oblique(), 1.0, 0.0), &oblique(), &ip).unwrap();
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
            let around = Surroundings::new(&image, &Corners::new(wrong).unwrap(), &ip, &p).unwrap();
            let found = around.align(&Template::new(&template, &c), &p).unwrap().corners_px;
            for (a, b) in found.points().iter().zip(oblique().points()) {
                // An icon pixel is 2.7 px here.
                assert!((a - b).norm() < 0.7, "{offset:?}: {a} for {b}");
            }
        }
    }

    #[test]
    fn an_icon_alone_is_laid_on_another() {
        let (ip, c, p) = setting();
        let image = photograph(&poster(1), &oblique(), 1.0, 0.0);
        let all = icon(&image, &oblique(), &ip).unwrap();
        let inset =
            oblique().points().map(|q| Point2::new(0.94 * q.x + 0.06 * 185.0, 0.94 * q.y + 0.06 * 205.0));
        let template = icon(&image, &Corners::new(inset).unwrap(), &ip).unwrap();
        let laid = Surroundings::of_icon(&all, &p).unwrap().align(&Template::new(&template, &c), &p).unwrap();
        let icon_from_image = Homography::square_to_quad(ip.size, &oblique()).unwrap().inverse().unwrap();
        for (found, wanted) in laid.corners_px.points().iter().zip(inset) {
            let wanted = icon_from_image.apply(&wanted);
            assert!((found - wanted).norm() < 0.4, "{found} for {wanted}");
        }
        // Of something else it is given up.
        let other = icon(&photograph(&poster(2), &oblique(), 1.0, 0.0), &oblique(), &ip).unwrap();
        assert!(
            Surroundings::of_icon(&other, &p).unwrap().align(&Template::new(&template, &c), &p).is_none()
        );
    }

    #[test]
    fn a_covered_part_has_no_say() {
        let (ip, c, p) = setting();
        let template = icon(&photograph(&poster(2), &oblique(), 1.0, 0.0), &oblique(), &ip).unwrap();
        let image = photograph(&poster(2), &oblique(), 1.0, 0.0);
        let covered = GrayImage::from_fn(400, 400, |u, v| {
            if (120..250).contains(&u) && (160..240).contains(&v) {
                if (u / 7) % 2 == 0 { 255 } else { 0 }
            } else {
                image.at(u, v)
            }
        });
        let wrong = Corners::new(oblique().points().map(|q| Point2::new(q.x + 4.0, q.y - 3.0))).unwrap();
        let found = Surroundings::new(&covered, &wrong, &ip, &p)
            .unwrap()
            .align(&Template::new(&template, &c), &p)
            .unwrap()
            .corners_px;
        for (a, b) in found.points().iter().zip(oblique().points()) {
            assert!((a - b).norm() < 0.8, "{a} for {b}");
        }
    }

    #[test]
    fn corners_never_move_further_than_allowed() {
        let (ip, c, p) = setting();
        let image = photograph(&poster(1), &oblique(), 1.0, 0.0);
        for seed in 2..10 {
            let template = icon(&photograph(&poster(seed), &oblique(), 1.0, 0.0), &oblique(), &ip).unwrap();
            let around = Surroundings::new(&image, &oblique(), &ip, &p).unwrap();
            if let Some(moved) = around.align(&Template::new(&template, &c), &p) {
                for (a, b) in moved.corners_px.points().iter().zip(oblique().points()) {
                    // 20 % of a side of at most 252 px, both coordinates.
                    assert!((a - b).norm() < 0.2 * 252.0 * 1.42 * 1.2);
                }
            }
        }
        let flat = GrayImage::from_fn(400, 400, |_, _| 99);
        let around = Surroundings::new(&flat, &oblique(), &ip, &p).unwrap();
        let template = icon(&image, &oblique(), &ip).unwrap();
        assert!(around.align(&Template::new(&template, &c), &p).is_none());
    }
}
