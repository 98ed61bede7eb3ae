//! Pictures with their candidate borders in, the object that they all show out: its border in a
//! reference picture, and homographies of its texture from there to the others.
//!
//! A border only says where to look: it may be the object's, a frame's or a shadow's. The
//! homographies come from matched points.

use crate::{
    camera_calibration::pictures::search_windows::search_windows,
    detect::{detector::detect, params::DetectParams, quad::QuadKind},
    frame::GrayImage,
    geometry::{corners::Corners, homography::Homography, polygon::iou},
    points::{
        agreement::unturned,
        consensus::{consensus, distinct},
        evidence::log10_tail,
        matching::matches,
        patch::{Patch, inner_px},
        point::{Point, SeenPatch},
        verify::{GLOBAL_GATE, MAX_PATCH_POINTS},
    },
    trace::NoTrace,
};
use nalgebra::Point2;

/// Most candidate borders of a picture that are tried.
const MAX_BORDERS: usize = 5;
/// Borders that overlap by more than this give the same points.
const SAME_BORDER_IOU: f64 = 0.75;
/// Smallest probability of a quad of the detector.
const MIN_PROBABILITY: f64 = 0.05;
/// A match agrees with a homography by chance with this probability.
const CHANCE_OF_MATCH: f64 = 0.01;
/// Largest log10 tail probability of the matches that agree (method 25).
const MIN_LOG10_MATCHES: f64 = -8.0;

/// A picture and its candidate borders.
#[derive(Debug, Clone)]
pub(crate) struct Picture<'a> {
    pub(crate) image: &'a GrayImage,
    /// Borders that may be the object's, likeliest first, px.
    pub(crate) borders_px: Vec<Corners>,
}

impl<'a> Picture<'a> {
    /// Whole quads of the detector and the borders nested in them, the largest first. Quads that it
    /// hardly believes are among them: the texture decides.
    pub(crate) fn detected(image: &'a GrayImage) -> Self {
        let mut p = DetectParams::default();
        (p.quads.min_probability, p.quads.three_sided) = (MIN_PROBABILITY, false);
        let quads = detect(image, &p, &mut NoTrace);
        let whole = quads.iter().filter(|q| q.kind == QuadKind::Full && !q.side_clipped.contains(&true));
        let mut borders_px: Vec<Corners> =
            whole.flat_map(|q| std::iter::once(q.corners_px).chain(q.alternates.iter().copied())).collect();
        borders_px.sort_by(|a, b| b.area_px2().total_cmp(&a.area_px2()));
        Self { image, borders_px }
    }
}

/// The object that pictures have in common.
#[derive(Debug, Clone)]
pub(crate) struct CommonObject {
    /// Index of the reference picture.
    pub(crate) reference: usize,
    /// A border around the object in the reference picture, px.
    pub(crate) border_px: Corners,
    /// For each picture: maps pixels of the reference picture to its own; `None` where the object
    /// was not found.
    pub(crate) picture_from_reference: Vec<Option<Homography>>,
}

struct Candidate {
    corners_px: Corners,
    seen: SeenPatch,
}

/// The object that most pictures show; `aspect` is about its width over its height. `None` where no
/// two pictures have one in common.
pub(crate) fn common_object(pictures: &[Picture<'_>], aspect: f64) -> Option<CommonObject> {
    let candidates: Vec<Vec<Candidate>> = pictures.iter().map(candidates).collect();
    let mut order: Vec<(usize, usize)> =
        (0..pictures.len()).flat_map(|i| (0..candidates[i].len()).map(move |k| (i, k))).collect();
    // The most frontal picture first, of each picture the likeliest border first.
    let frontal = |&(i, _): &(usize, usize)| candidates[i].first().map_or(0.0, |c| frontality(&c.corners_px));
    order.sort_by(|a, b| a.1.cmp(&b.1).then(frontal(b).total_cmp(&frontal(a))).then(a.0.cmp(&b.0)));
    let mut best: Option<(usize, usize, CommonObject)> = None;
    for (reference, k) in order {
        let (found, matched) = around(&candidates, reference, k);
        let count = found.picture_from_reference.iter().flatten().count();
        if count > 1 && best.as_ref().is_none_or(|(c, m, _)| (count, matched) > (*c, *m)) {
            best = Some((count, matched, found));
        }
        if best.as_ref().is_some_and(|(c, ..)| *c == pictures.len()) {
            break;
        }
    }
    let (.., mut found) = best?;
    for (i, picture) in pictures.iter().enumerate() {
        if found.picture_from_reference[i].is_none() {
            found.picture_from_reference[i] =
                by_windows(picture, &candidates[found.reference], &found.border_px, aspect);
        }
    }
    Some(found)
}

/// The object in a picture in which no border of it was found.
fn by_windows(
    picture: &Picture<'_>,
    reference: &[Candidate],
    border_px: &Corners,
    aspect: f64,
) -> Option<Homography> {
    let own = reference.iter().find(|c| c.corners_px == *border_px)?;
    let size_px = [picture.image.width() as f64, picture.image.height() as f64];
    let borders_px = search_windows(size_px, aspect);
    let windows: Vec<Candidate> =
        borders_px.iter().filter_map(|corners_px| Candidate::new(picture.image, corners_px)).collect();
    best_match(own, &windows).map(|(.., map)| map)
}

/// The object in border `k` of picture `reference`, searched in the others: directly, then by way
/// of those found.
fn around(candidates: &[Vec<Candidate>], reference: usize, k: usize) -> (CommonObject, usize) {
    let own = &candidates[reference][k];
    let mut maps: Vec<Option<Homography>> = vec![None; candidates.len()];
    let mut found: Vec<Option<usize>> = vec![None; candidates.len()];
    (maps[reference], found[reference]) = (Homography::from_matrix(nalgebra::Matrix3::identity()), Some(k));
    let mut matched = 0;
    let mut reached = vec![reference];
    while let Some(from) = reached.pop() {
        let (Some(map), Some(border)) = (maps[from], found[from]) else { continue };
        for to in 0..candidates.len() {
            if maps[to].is_some() {
                continue;
            }
            let Some((count, border, to_from)) = best_match(&candidates[from][border], &candidates[to])
            else {
                continue;
            };
            let Ok(composed) = to_from.compose(&map) else { continue };
            if own.corners_px.points().iter().all(|p| composed.denominator(p) > 0.0) {
                (maps[to], found[to]) = (Some(composed), Some(border));
                matched += count;
                reached.insert(0, to);
            }
        }
    }
    (CommonObject { reference, border_px: own.corners_px, picture_from_reference: maps }, matched)
}

/// The border of a picture in which most points agree: their number, the border's index, and the
/// homography.
fn best_match(from: &Candidate, among: &[Candidate]) -> Option<(usize, usize, Homography)> {
    let mut best: Option<(usize, usize, Homography)> = None;
    for turned in 0..4 {
        for (k, to) in among.iter().enumerate() {
            let Some((count, map)) = matched(from, to, turned) else { continue };
            if best.as_ref().is_none_or(|b| count > b.0) {
                best = Some((count, k, map));
            }
        }
        // Another turn is tried only where the upright one has nothing.
        if best.is_some() {
            break;
        }
    }
    best
}

/// Matches of the points of `from` with those of `to`, turned by `turned` quarters: how many agree,
/// and their homography in pixels.
fn matched(from: &Candidate, to: &Candidate, turned: usize) -> Option<(usize, Homography)> {
    let points: Vec<Point> = to.seen.points.iter().map(|p| p.rotated(turned)).collect();
    let taught = &from.seen.points;
    let pairs = matches(&points, taught, &GLOBAL_GATE);
    let all: Vec<usize> = (0..pairs.len()).collect();
    let count = distinct(&all, taught, &pairs);
    let least = (4..=count).find(|k| log10_tail(count, *k, CHANCE_OF_MATCH) <= MIN_LOG10_MATCHES)?;
    let found = consensus(&points, taught, &pairs, least)?;
    if found.distinct < least {
        return None;
    }
    let unit = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(Point2::from);
    let mut there = [Point2::origin(); 4];
    for (px, at) in there.iter_mut().zip(&unit) {
        let at = found.seen_from_taught.apply(at);
        *px = to.seen.patch.to_image(unturned([at.x, at.y], turned))?;
    }
    Some((found.distinct, Homography::from_points(from.corners_px.points(), &there).ok()?))
}

impl Candidate {
    fn new(image: &GrayImage, corners_px: &Corners) -> Option<Self> {
        let patch = Patch::new(image, corners_px, inner_px(corners_px))?;
        Some(Self { corners_px: *corners_px, seen: SeenPatch::new(patch, MAX_PATCH_POINTS) })
    }
}

fn candidates(picture: &Picture<'_>) -> Vec<Candidate> {
    let mut made: Vec<Candidate> = Vec::new();
    for corners_px in &picture.borders_px {
        let is_new = made.iter().all(|c| iou(c.corners_px.points(), corners_px.points()) < SAME_BORDER_IOU);
        if made.len() < MAX_BORDERS && is_new {
            made.extend(Candidate::new(picture.image, corners_px));
        }
    }
    made
}

/// 1 for a rectangle seen from the front; smaller the more opposite sides differ.
fn frontality(corners: &Corners) -> f64 {
    let side = |i: usize| {
        let p = corners.points();
        (p[(i + 1) % 4] - p[i]).norm()
    };
    (0..2).map(|i| side(i).min(side(i + 2)) / side(i).max(side(i + 2))).product()
}
