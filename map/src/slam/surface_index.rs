//! Surface points of several scans in one frame, indexed by position; scans are matched to them.
//! In: scans at poses. Out: the nearest surface point of similar direction.

use super::cloud::Cloud;
use crate::pose2::Pose2;
use nalgebra::{Point2, Vector2};

/// Most buckets; a larger area gets larger buckets.
const MAX_BUCKETS: usize = 1 << 20;
/// Most points; later ones are left out.
const MAX_POINTS: usize = 1 << 20;

/// A point of a flat surface, reference frame.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Surface {
    pub at: Point2<f64>,
    pub normal: Vector2<f64>,
    pub turn_variance: f64,
}

/// Surface points in square buckets.
#[derive(Debug, Clone)]
pub(crate) struct SurfaceIndex {
    low: Point2<f64>,
    bucket_m: f64,
    width: usize,
    height: usize,
    /// Index in `surfaces` at which each bucket begins.
    starts: Vec<u32>,
    surfaces: Vec<Surface>,
}

impl SurfaceIndex {
    /// Indexes the flat points of `scans`; `bucket_m` is the largest radius of
    /// [`SurfaceIndex::nearest`].
    pub(crate) fn new<'a>(scans: impl Iterator<Item = (Pose2, &'a Cloud)>, bucket_m: f64) -> Self {
        let mut all = Vec::new();
        for (pose, cloud) in scans {
            let (s, c) = pose.theta_rad.sin_cos();
            for point in &cloud.points {
                let Some(n) = point.normal else { continue };
                let normal = Vector2::new(c * n.x - s * n.y, s * n.x + c * n.y);
                if all.len() < MAX_POINTS {
                    all.push(Surface {
                        at: pose.apply(&point.at),
                        normal,
                        turn_variance: point.turn_variance,
                    });
                }
            }
        }
        let (mut low, mut high) = (Point2::new(f64::MAX, f64::MAX), Point2::new(f64::MIN, f64::MIN));
        for s in &all {
            low = Point2::new(low.x.min(s.at.x), low.y.min(s.at.y));
            high = Point2::new(high.x.max(s.at.x), high.y.max(s.at.y));
        }
        if all.is_empty() {
            (low, high) = (Point2::origin(), Point2::origin());
        }
        let mut bucket_m = bucket_m.max(1e-3);
        let cells = |b: f64| (((high.x - low.x) / b) as usize + 1, ((high.y - low.y) / b) as usize + 1);
        while cells(bucket_m).0.saturating_mul(cells(bucket_m).1) > MAX_BUCKETS {
            bucket_m *= 2.0;
        }
        let (width, height) = cells(bucket_m);
        let bucket = |p: &Point2<f64>| {
            let (i, j) = (((p.x - low.x) / bucket_m) as usize, ((p.y - low.y) / bucket_m) as usize);
            j.min(height - 1) * width + i.min(width - 1)
        };
        // A stable counting sort keeps the order of the scans within a bucket.
        let mut starts = vec![0_u32; width * height + 1];
        for s in &all {
            starts[bucket(&s.at) + 1] += 1;
        }
        for i in 1..starts.len() {
            starts[i] += starts[i - 1];
        }
        let mut next = starts.clone();
        let mut surfaces = all.clone();
        for s in &all {
            let at = &mut next[bucket(&s.at)];
            surfaces[*at as usize] = *s;
            *at += 1;
        }
        Self { low, bucket_m, width, height, starts, surfaces }
    }

    /// The nearest surface point within `radius_m` (at most a bucket) whose normal differs by less
    /// than `cos_turn` says.
    pub(crate) fn nearest(
        &self,
        p: &Point2<f64>,
        normal: &Vector2<f64>,
        radius_m: f64,
        cos_turn: f64,
    ) -> Option<&Surface> {
        let (fx, fy) = ((p.x - self.low.x) / self.bucket_m, (p.y - self.low.y) / self.bucket_m);
        let reach = (radius_m / self.bucket_m).min(1.0);
        let span = |f: f64, n: usize| {
            let (from, to) = ((f - reach).floor(), (f + reach).floor());
            (to >= 0.0 && from < n as f64).then(|| (from.max(0.0) as usize, (to as usize).min(n - 1)))
        };
        let ((i0, i1), (j0, j1)) = (span(fx, self.width)?, span(fy, self.height)?);
        let (mut best, mut best2) = (None, radius_m * radius_m);
        for j in j0..=j1 {
            let row = j * self.width;
            let (a, b) = (self.starts[row + i0] as usize, self.starts[row + i1 + 1] as usize);
            for s in &self.surfaces[a..b] {
                let d2 = (s.at - p).norm_squared();
                if d2 < best2 && s.normal.dot(normal) > cos_turn {
                    (best, best2) = (Some(s), d2);
                }
            }
        }
        best
    }
}
