//! Pictures with homographies that are a few pixels off in, windows of the reference picture with
//! their places in the others out, to a fraction of a pixel, and homographies that fit them.

use crate::{
    camera_calibration::pictures::{
        common_object::{CommonObject, Picture},
        denoise::denoised,
        side_lines::side_lines,
        window_tracking::{Window, followed},
    },
    detect::pyramid::reduce,
    frame::GrayImage,
    geometry::{corners::Corners, homography::Homography, polygon::contains},
};
use nalgebra::{Matrix2, Matrix3, Point2};

/// Cells along each side of the border's bounding box; each gives at most one window.
const CELLS: usize = 16;
/// Half the side of a window, px, for an object of [`USUAL_SIDE_PX`]; it grows with the object's
/// root.
const HALF_WINDOW_PX: f64 = 6.0;
const USUAL_SIDE_PX: f64 = 250.0;
/// Factors by which the pictures are reduced, one after the other; windows from the second on
/// become tracks.
const FACTORS: [usize; 3] = [4, 2, 1];
const FINE_FACTOR: usize = 2;
/// The object is at least this large on a scale, px.
const MIN_SIDE_PX: f64 = 60.0;
/// A window that reaches to within this of an edge is beside it, px.
const BESIDE_PX: f64 = 2.0;
const MIN_HALF_PX: usize = 5;
const MAX_HALF_PX: usize = 14;
/// Smallest standard deviation of a grey level, of which a window's expected accuracy is computed.
const GREY_SIGMA: f64 = 3.0;
/// Windows whose position is expected to be worse than this are not used, px.
const MAX_SIGMA_PX: f64 = 0.12;
/// A window is followed at most this far, px of the reference: first, and when the homography is
/// refined.
const REACH_PX: [f64; 3] = [6.0, 3.0, 2.0];
/// Smallest correlation of a window with its picture.
const MIN_CORRELATION: f64 = 0.7;
/// Windows that are this many standard deviations off are left out.
const OUTLIER_SIGMAS: f64 = 3.0;
/// The standard deviation of windows about a homography is at least this, px: the lens bends.
const MIN_SCATTER_PX: f64 = 0.5;
/// Fewest windows that a homography is refined by.
const MIN_WINDOWS: usize = 12;

/// Where a picture shows a window of the reference picture.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Track {
    pub(crate) picture: usize,
    /// The window's centre in the reference picture, and in this one, px.
    pub(crate) reference_px: Point2<f64>,
    pub(crate) px: Point2<f64>,
    pub(crate) covariance_px2: Matrix2<f64>,
}

/// The tracks of windows that touch no edge, and for each picture the map from pixels of the
/// reference to its own; `None` where it shows too little of the object.
pub(crate) type Tracked = (Vec<Track>, Vec<Option<Homography>>);

/// Follows the object's windows through all pictures, from coarse to fine: what is noise on one
/// scale may be texture on the other, and the homographies of one are the start of the next.
pub(crate) fn tracked(pictures: &[Picture<'_>], object: &CommonObject) -> Tracked {
    let edges = edges(&pictures[object.reference], &object.border_px);
    let mut tracks: Vec<Track> = Vec::new();
    let mut maps = object.picture_from_reference.clone();
    for factor in FACTORS {
        if object.border_px.area_px2().sqrt() < MIN_SIDE_PX * factor as f64 {
            continue;
        }
        let images: Vec<GrayImage> = pictures.iter().map(|p| denoised(&reduce(p.image, factor))).collect();
        let scale = Scale::new(&images, object, &edges, factor as f64);
        let found = scale.map_or_else(Vec::new, |scale| scale.followed(&mut maps));
        if factor <= FINE_FACTOR {
            tracks.extend(found);
        }
    }
    for (picture, map) in maps.iter_mut().enumerate().filter(|(i, _)| *i != object.reference) {
        if tracks.iter().filter(|t| t.picture == picture).count() < MIN_WINDOWS {
            *map = None;
        }
    }
    tracks.retain(|t| maps[t.picture].is_some());
    (tracks, maps)
}

/// The pictures, reduced by a whole factor, and the reference's windows.
struct Scale<'a> {
    images: &'a [GrayImage],
    reference: usize,
    factor: f64,
    half: usize,
    /// Centres of the windows, px.
    corners: Vec<Point2<f64>>,
    /// For each window: whether it touches no edge.
    is_inside: Vec<bool>,
}

impl<'a> Scale<'a> {
    fn new(images: &'a [GrayImage], object: &CommonObject, edges: &[Edge], factor: f64) -> Option<Self> {
        let border = Corners::new(object.border_px.points().map(|c| small(&c, factor))).ok()?;
        let half = (HALF_WINDOW_PX * (border.area_px2().sqrt() / USUAL_SIDE_PX).sqrt()).round() as usize;
        let half = half.clamp(MIN_HALF_PX, MAX_HALF_PX);
        let reach_px = (half as f64 + BESIDE_PX) * factor;
        let is_inside = |c: &Point2<f64>| edges.iter().all(|e| distance_px(e, &large(c, factor)) > reach_px);
        let corners = corners(&images[object.reference], &border, half, &is_inside);
        let is_inside = corners.iter().map(is_inside).collect();
        Some(Self { images, reference: object.reference, factor, half, corners, is_inside })
    }

    /// The tracks, in pixels of the whole pictures; `maps` (of whole pictures, too) are refined.
    fn followed(&self, maps: &mut [Option<Homography>]) -> Vec<Track> {
        let shift = 0.5 / self.factor - 0.5;
        let scale = 1.0 / self.factor;
        let shrink = Matrix3::new(scale, 0.0, shift, 0.0, scale, shift, 0.0, 0.0, 1.0);
        let grow = shrink.try_inverse().unwrap_or_else(Matrix3::identity);
        let mut tracks = Vec::new();
        for (picture, map) in maps.iter_mut().enumerate().filter(|(i, _)| *i != self.reference) {
            let start = map.and_then(|m| Homography::from_matrix(shrink * m.matrix() * grow));
            let Some((refined, seen)) = start.and_then(|start| self.in_picture(picture, start)) else {
                continue;
            };
            *map = Homography::from_matrix(grow * refined.matrix() * shrink).or(*map);
            let inside = seen.into_iter().filter(|(window, ..)| self.is_inside[*window]);
            tracks.extend(inside.map(|(window, px, covariance)| Track {
                picture,
                reference_px: large(&self.corners[window], self.factor),
                px: large(&px, self.factor),
                covariance_px2: covariance * self.factor.powi(2),
            }));
        }
        tracks
    }

    /// The windows in one picture, and the homography that most of them fit; `None` where too few
    /// do.
    fn in_picture(&self, picture: usize, start: Homography) -> Option<(Homography, Vec<Followed>)> {
        let (reference, image) = (&self.images[self.reference], &self.images[picture]);
        let (mut map, mut seen) = (start, Vec::new());
        for (round, reach) in REACH_PX.into_iter().enumerate() {
            let half = if round == 0 { self.half + self.half / 2 } else { self.half };
            let follow = |(i, c): (usize, &Point2<f64>)| {
                let found = followed(&Window::new(reference, *c, half)?, image, &map, reach)?;
                (found.correlation > MIN_CORRELATION).then_some((i, found.px, found.covariance_px2))
            };
            seen = self.corners.iter().enumerate().filter_map(follow).collect();
            map = fitted(&self.corners, &seen)?;
        }
        Some((map, seen))
    }
}

/// A point of the whole picture, and of the reduced one. Pixel centres are integers: a block's
/// centre lies between its pixels.
fn large(p: &Point2<f64>, factor: f64) -> Point2<f64> {
    p.map(|x| (x + 0.5) * factor - 0.5)
}

fn small(p: &Point2<f64>, factor: f64) -> Point2<f64> {
    p.map(|x| (x + 0.5) / factor - 0.5)
}

/// A piece of a straight line in the reference picture.
type Edge = [Point2<f64>; 2];

/// What may be a border of the object, of its frame or of a shadow: beside it two planes meet, and
/// move against each other.
fn edges(reference: &Picture<'_>, border_px: &Corners) -> Vec<Edge> {
    let sides = |c: &Corners| {
        let p = *c.points();
        std::array::from_fn::<Edge, 4, _>(|i| [p[i], p[(i + 1) % 4]])
    };
    let mut all: Vec<Edge> = reference.borders_px.iter().flat_map(sides).collect();
    all.extend(sides(border_px));
    for line in side_lines(&denoised(reference.image), border_px) {
        // The line's two points are about a quarter of the side from its ends.
        let [a, b] = line.ends_px;
        all.push([a - (b - a) * 0.5, b + (b - a) * 0.5]);
    }
    all
}

fn distance_px([a, b]: &Edge, p: &Point2<f64>) -> f64 {
    let d = b - a;
    let along = ((p - a).dot(&d) / d.norm_squared()).clamp(0.0, 1.0);
    (p - (a + d * along)).norm()
}

/// A window's index, its pixel, and the covariance of that.
type Followed = (usize, Point2<f64>, Matrix2<f64>);

/// The homography that most windows fit.
fn fitted(corners: &[Point2<f64>], seen: &[Followed]) -> Option<Homography> {
    let mut seen = seen.to_vec();
    loop {
        if seen.len() < MIN_WINDOWS {
            return None;
        }
        let from: Vec<_> = seen.iter().map(|s| corners[s.0]).collect();
        let to: Vec<_> = seen.iter().map(|s| s.1).collect();
        let map = Homography::fit(&from, &to).ok()?;
        let off = |s: &Followed| (map.apply(&corners[s.0]) - s.1).norm();
        let mut all: Vec<f64> = seen.iter().map(off).collect();
        all.sort_by(f64::total_cmp);
        // The median distance of two normal coordinates is 1.18 sigma.
        let sigma = (all[all.len() / 2] / 1.18).max(MIN_SCATTER_PX);
        let before = seen.len();
        seen.retain(|s| off(s) < OUTLIER_SIGMAS * sigma);
        if seen.len() == before {
            return Some(map);
        }
    }
}

/// The best corner of each cell inside `border`; beside an edge only where the cell has no other.
fn corners(
    image: &GrayImage,
    border: &Corners,
    half: usize,
    is_inside: &impl Fn(&Point2<f64>) -> bool,
) -> Vec<Point2<f64>> {
    let p = border.points();
    let bound = |of: fn(&Point2<f64>) -> f64, fold: fn(f64, f64) -> f64| {
        p.iter().map(of).reduce(fold).unwrap_or_default()
    };
    let low = [bound(|p| p.x, f64::min), bound(|p| p.y, f64::min)];
    let high = [bound(|p| p.x, f64::max), bound(|p| p.y, f64::max)];
    let step = [(high[0] - low[0]) / CELLS as f64, (high[1] - low[1]) / CELLS as f64];
    let pitch = (step[0].min(step[1]) / 6.0).max(1.0);
    let mut made = Vec::new();
    for cell in 0..CELLS * CELLS {
        let from = [low[0] + (cell % CELLS) as f64 * step[0], low[1] + (cell / CELLS) as f64 * step[1]];
        let mut best: Option<(bool, f64, Point2<f64>)> = None;
        let (nx, ny) = ((step[0] / pitch).ceil() as usize, (step[1] / pitch).ceil() as usize);
        for at in (0..nx * ny).map(|k| {
            Point2::new(
                (from[0] + (k % nx) as f64 * pitch).round(),
                (from[1] + (k / nx) as f64 * pitch).round(),
            )
        }) {
            if !contains(p, &at, 0.0) {
                continue;
            }
            let Some(window) = Window::new(image, at, half) else { continue };
            let Some(covariance_px2) = window.information().try_inverse().map(|c| c * GREY_SIGMA.powi(2))
            else {
                continue;
            };
            let worst = covariance_px2.symmetric_eigenvalues().max();
            let is_beside = !is_inside(&at);
            let is_better = best.is_none_or(|b| (is_beside, worst) < (b.0, b.1));
            if worst < MAX_SIGMA_PX.powi(2) && is_better {
                best = Some((is_beside, worst, at));
            }
        }
        made.extend(best.map(|b| b.2));
    }
    made
}
