//! A patch in, its keypoints out: extrema of the difference of Gaussians over place and scale (Lowe
//! 2004). No orientation: the patch is rectified already.

use crate::{
    points::patch::Patch,
    recognise::features::harris::{blurred, blurred_to},
};
use fearless_simd::{Level, dispatch};

/// Smoothing of the first level of an octave, in its pixels.
pub const BASE_SIGMA: f64 = 1.15;
/// Assumed smoothing of a patch by its sampling, in pixels.
const SAMPLING_SIGMA: f64 = 0.5;
/// Scales of an octave at which extrema are searched.
pub const SCALES: usize = 3;
/// Smoothed levels of an octave.
const LEVELS: usize = SCALES + 3;
/// No octave is smaller than this.
const MIN_OCTAVE_PX: usize = 16;
const MAX_OCTAVES: usize = 4;
/// Smallest response in a patch, in grey levels.
const MIN_RESPONSE: f32 = 0.25;
/// Largest ratio of the principal curvatures: beyond it the point is an edge.
const MAX_EDGE_RATIO: f32 = 10.0;
/// Where the Gaussians of a frame end, in their sigmas: patches take four, which costs a third
/// more.
const FRAME_REACH: f64 = 2.5;
/// Pixels along the border of an octave without extrema.
const BORDER_PX: usize = 3;

/// A keypoint of a patch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Keypoint {
    /// Column and row in patch pixels.
    pub x: f32,
    /// See `x`.
    pub y: f32,
    /// Scale, in patch pixels.
    pub sigma: f32,
    /// Absolute difference of Gaussians, in grey levels.
    pub response: f32,
    /// Octave and level of the smoothed picture that the descriptor is taken from.
    pub octave: usize,
    /// See `octave`.
    pub level: usize,
}

/// The smoothed pictures of a patch.
#[derive(Debug, Clone)]
pub struct ScaleSpace {
    /// Octaves, each half the size of the one before.
    pub octaves: Vec<Octave>,
}

/// The smoothed pictures of one size.
#[derive(Debug, Clone)]
pub struct Octave {
    /// Pixels of a row, and of a column.
    pub width: usize,
    /// See `width`.
    pub height: usize,
    /// Patch pixels along one of its pixels.
    pub step: f32,
    /// Pictures of rising smoothing.
    pub levels: Vec<Vec<f32>>,
}

impl ScaleSpace {
    /// Smooths `patch`.
    pub fn new(patch: &Patch) -> Self {
        Self::of(&patch.pixels, patch.side, MAX_OCTAVES, blurred)
    }

    /// The same of a whole frame: `pixels`, row-major in rows of `width`, over at most `most`
    /// octaves.
    pub fn of_frame(pixels: &[f32], width: usize, most: usize) -> Self {
        let smooth = |pixels: &[f32], width: usize, sigma: f64| {
            blurred_to(pixels, width, sigma, (FRAME_REACH * sigma).ceil() as usize)
        };
        Self::of(pixels, width, most, smooth)
    }

    fn of(
        pixels: &[f32],
        width: usize,
        most: usize,
        smooth: impl Fn(&[f32], usize, f64) -> Vec<f32>,
    ) -> Self {
        let mut octaves: Vec<Octave> = Vec::new();
        let start = (BASE_SIGMA.powi(2) - SAMPLING_SIGMA.powi(2)).sqrt();
        let (mut width, mut height, mut step) = (width, pixels.len() / width.max(1), 1.0);
        let mut first = smooth(pixels, width, start);
        while width.min(height) >= MIN_OCTAVE_PX && octaves.len() < most {
            let mut levels = vec![first];
            for i in 1..LEVELS {
                let sigma = |i: usize| BASE_SIGMA * 2.0_f64.powf(i as f64 / SCALES as f64);
                let more = (sigma(i).powi(2) - sigma(i - 1).powi(2)).sqrt();
                levels.push(smooth(&levels[i - 1], width, more));
            }
            let (across, down) = (width / 2, height / 2);
            let every_second = |i: usize| levels[SCALES][2 * (i / across) * width + 2 * (i % across)];
            first = (0..across * down).map(every_second).collect();
            octaves.push(Octave { width, height, step, levels });
            (width, height, step) = (across, down, step * 2.0);
        }
        Self { octaves }
    }
}

/// The keypoints of `patch` that the image shows, strongest first, at most `most`.
pub fn keypoints(patch: &Patch, space: &ScaleSpace, most: usize) -> Vec<Keypoint> {
    let mut found = all_keypoints(space, MIN_RESPONSE);
    found.retain(|k| patch.is_seen(k.x, k.y, SUPPORT * k.sigma));
    found.truncate(most);
    found
}

/// All keypoints with a response of `least` grey levels or more, strongest first.
pub fn all_keypoints(space: &ScaleSpace, least: f32) -> Vec<Keypoint> {
    let mut found = Vec::new();
    for (index, octave) in space.octaves.iter().enumerate() {
        extrema(octave, index, least, &mut found);
    }
    found.sort_by(|a, b| {
        b.response.total_cmp(&a.response).then(a.y.total_cmp(&b.y)).then(a.x.total_cmp(&b.x))
    });
    found
}

/// How far around a keypoint the image must show the patch, in its scales.
const SUPPORT: f32 = 1.0;

/// Pictures whose differences are the responses at one scale and at the two next to it, from the
/// finest on.
type Levels<'a> = [&'a [f32]; 4];

fn extrema(octave: &Octave, index: usize, least: f32, found: &mut Vec<Keypoint>) {
    let (n, height) = (octave.width, octave.height);
    let mut peaks = vec![0_u8; n];
    for level in 1..=SCALES {
        let levels: Levels<'_> = std::array::from_fn(|i| octave.levels[level - 1 + i].as_slice());
        let [below, own, above] =
            [0, 1, 2].map(|scale| move |at: usize| levels[scale + 1][at] - levels[scale][at]);
        for y in BORDER_PX..height - BORDER_PX {
            dispatch!(Level::new(), _s => row_peaks(levels, y * n, least, &mut peaks));
            for x in marked(&peaks).filter(|x| (BORDER_PX..n - BORDER_PX).contains(x)) {
                let at = y * n + x;
                let d = own(at);
                if !is_extremum(d, at, n, &levels) {
                    continue;
                }
                let (left, right, up, down) = (own(at - 1), own(at + 1), own(at - n), own(at + n));
                let (dxx, dyy) = (right + left - 2.0 * d, down + up - 2.0 * d);
                let dxy = 0.25 * (own(at + n + 1) + own(at - n - 1) - own(at + n - 1) - own(at - n + 1));
                let (trace, det) = (dxx + dyy, dxx * dyy - dxy * dxy);
                let limit = (MAX_EDGE_RATIO + 1.0).powi(2) / MAX_EDGE_RATIO;
                if det <= 0.0 || trace * trace >= limit * det {
                    continue;
                }
                // Peak of a parabola along each axis by itself.
                let peak = |before: f32, after: f32| {
                    let bend = before + after - 2.0 * d;
                    if bend.abs() > 1e-6 { (0.5 * (before - after) / bend).clamp(-0.5, 0.5) } else { 0.0 }
                };
                let (dx, dy) = (peak(left, right), peak(up, down));
                let ds = peak(below(at), above(at));
                let scale = (level as f32 + ds) / SCALES as f32;
                found.push(Keypoint {
                    x: (x as f32 + dx) * octave.step,
                    y: (y as f32 + dy) * octave.step,
                    sigma: BASE_SIGMA as f32 * scale.exp2() * octave.step,
                    response: d.abs(),
                    octave: index,
                    level,
                });
            }
        }
    }
}

/// Where `peaks` are marked; most are not, sixteen at a time.
fn marked(peaks: &[u8]) -> impl Iterator<Item = usize> {
    let any = |part: &&[u8]| part.first_chunk::<16>().is_none_or(|p| u128::from_ne_bytes(*p) != 0);
    let parts = (0..).step_by(16).zip(peaks.chunks(16)).filter(move |(_, part)| any(part));
    parts.flat_map(|(start, part)| (start..).zip(part).filter(|(_, mark)| **mark != 0).map(|(x, _)| x))
}

/// Marks what may be an extremum in a row that begins at `start`: strong enough, and beyond its
/// neighbours to the left, the right, and at the two next scales.
#[expect(
    clippy::inline_always,
    reason = "an instruction set holds only in what is inlined where it was chosen"
)]
#[inline(always)]
fn row_peaks(levels: Levels<'_>, start: usize, least: f32, peaks: &mut [u8]) {
    let n = peaks.len();
    let [first, second, third, fourth] = levels.map(|level| &level[start..][..n]);
    let beside = |by: usize| [1, 2].map(|level| &levels[level][start + by - 1..][..n]);
    let ([left2, left3], [right2, right3]) = (beside(0), beside(2));
    for x in 0..n {
        let d = third[x] - second[x];
        let (below, above) = (second[x] - first[x], fourth[x] - third[x]);
        let (left, right) = (left3[x] - left2[x], right3[x] - right2[x]);
        let high = left.max(right).max(below).max(above);
        let low = left.min(right).min(below).min(above);
        let top = u8::from(d >= least) & u8::from(d >= high);
        let bottom = u8::from(d <= -least) & u8::from(d <= low);
        peaks[x] = top | bottom;
    }
}

fn is_extremum(d: f32, at: usize, n: usize, levels: &Levels<'_>) -> bool {
    let around = [at - n - 1, at - n, at - n + 1, at - 1, at, at + 1, at + n - 1, at + n, at + n + 1];
    let top = d > 0.0;
    (0..3).all(|scale| {
        around.iter().all(|i| {
            let other = levels[scale + 1][*i] - levels[scale][*i];
            (scale == 1 && *i == at) || if top { d >= other } else { d <= other }
        })
    })
}
