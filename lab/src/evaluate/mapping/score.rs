//! Error of a path by relative poses (Kuemmerle et al. 2009), and share of scan points on walls.

use formats::scan_log::{LineTokens, LogEntry, ReadError, lines};
use map::{pose2::Pose2, slam::SlamMap};
use std::path::Path;

/// Poses within this distance of each other and far apart along the path: their relation is
/// compared too.
const NEAR_M: f64 = 3.0;
/// Distance along the path that counts as far apart.
const FAR_M: f64 = 10.0;
/// Most such relations of one log; evenly taken.
const MAX_REVISITS: usize = 20_000;
/// A point on a wall is not farther from it than this.
const ON_WALL_M: f64 = 0.1;
/// Points farther than this from the robot are ignored.
const MAX_POINT_M: f64 = 10.0;

/// Puts the poses of a reference file (lines `scan x y theta`) into the records.
pub(super) fn reference(path: &Path, records: &mut [LogEntry]) -> Result<(), ReadError> {
    lines(path, |line, text| {
        if text.is_empty() {
            return Ok(());
        }
        let mut words = LineTokens::new(line, text);
        let scan = words.count("scan", records.len().saturating_sub(1))?;
        records[scan].truth = Some(words.pose("pose")?);
        Ok(())
    })
}

/// Pairs of scans whose relative pose is known: each known pose with the next, and revisited
/// places.
pub(super) struct Relations(Vec<(usize, usize)>);

impl Relations {
    pub(super) fn of(records: &[LogEntry]) -> Self {
        let known: Vec<(usize, Pose2)> =
            records.iter().enumerate().filter_map(|(i, r)| Some((i, r.truth?))).collect();
        let mut pairs: Vec<(usize, usize)> = known.windows(2).map(|w| (w[0].0, w[1].0)).collect();
        let mut distance_m = vec![0.0];
        for w in known.windows(2) {
            distance_m
                .push(distance_m[distance_m.len() - 1] + (w[1].1.position() - w[0].1.position()).norm());
        }
        let mut revisits = Vec::new();
        for a in 0..known.len() {
            for b in a + 1..known.len() {
                let near = (known[a].1.position() - known[b].1.position()).norm() < NEAR_M;
                if near && distance_m[b] - distance_m[a] > FAR_M {
                    revisits.push((known[a].0, known[b].0));
                }
            }
        }
        let stride = revisits.len().div_ceil(MAX_REVISITS).max(1);
        pairs.extend(revisits.into_iter().step_by(stride));
        Self(pairs)
    }

    pub(super) fn len(&self) -> usize {
        self.0.len()
    }

    pub(super) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The error of every relation of a path.
    pub(super) fn errors(&self, records: &[LogEntry], path: &[Pose2]) -> Errors {
        let one = |&(a, b): &(usize, usize)| {
            let truth = records[a].truth?.between(&records[b].truth?);
            let error = truth.between(&path[a].between(&path[b]));
            Some((error.position().norm(), error.theta_rad.abs().to_degrees()))
        };
        Errors(self.0.iter().filter_map(one).collect())
    }
}

/// Metres and degrees of every relation.
pub(super) struct Errors(Vec<(f64, f64)>);

impl Errors {
    /// Mean and standard deviation.
    pub(super) fn translation_m(&self) -> [f64; 2] {
        mean_and_std(self.0.iter().map(|e| e.0))
    }

    /// Mean and standard deviation.
    pub(super) fn rotation_deg(&self) -> [f64; 2] {
        mean_and_std(self.0.iter().map(|e| e.1))
    }

    /// Share of the errors below each of 100 values up to `high`.
    pub(super) fn curve(&self, of: impl Fn(&(f64, f64)) -> f64, high: f64) -> Vec<(f64, f64)> {
        let mut sorted: Vec<f64> = self.0.iter().map(of).collect();
        sorted.sort_by(f64::total_cmp);
        let n = sorted.len().max(1) as f64;
        (0..=100)
            .map(|i| high * f64::from(i) / 100.0)
            .map(|x| (x, sorted.partition_point(|e| *e <= x) as f64 / n))
            .collect()
    }
}

fn mean_and_std(values: impl Iterator<Item = f64> + Clone) -> [f64; 2] {
    let n = values.clone().count().max(1) as f64;
    let mean = values.clone().sum::<f64>() / n;
    [mean, (values.map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt()]
}

/// Share of the scans' points within 10 cm of a wall, and the root mean square distance of those.
pub(super) fn on_walls(map: &SlamMap, records: &[LogEntry]) -> (f64, f64) {
    let (mut all, mut on, mut squares) = (0_usize, 0_usize, 0.0);
    let stride = records.len().div_ceil(300).max(1);
    for (record, pose) in records.iter().zip(&map.path).step_by(stride) {
        let laser = pose.compose(record.scan.robot_from_laser());
        for i in (0..record.scan.ranges_m().len()).step_by(3) {
            let Some(p) = record.scan.point(i).filter(|p| p.coords.norm() < MAX_POINT_M) else { continue };
            let at = laser.apply(&p);
            let distance = |w: &map::segments::LaserSegment| {
                let k = w.direction().dot(&(at - w.a)).clamp(0.0, w.length_m());
                (at - (w.a + w.direction() * k)).norm()
            };
            let nearest = map.walls.iter().map(distance).fold(f64::INFINITY, f64::min);
            all += 1;
            if nearest < ON_WALL_M {
                on += 1;
                squares += nearest * nearest;
            }
        }
    }
    (on as f64 / all.max(1) as f64, (squares / on.max(1) as f64).sqrt())
}
