//! Figures of all drives: errors along and across the corridor, consistency of the covariance,
//! names.

use super::{
    journey::{Journey, Moment, Named, of},
    kidnap::KidnapOutcome,
    world::World,
};
use crate::evaluate::statistics::quantile;
use map::pose2::{Pose2Covariance, wrap_rad};
use serde::Serialize;
use std::collections::BTreeMap;

/// Outcomes that changed the pose.
const APPLIED: [&str; 3] = ["started", "applied", "reset"];
/// 95 % of chi2 with 3 degrees of freedom.
const CHI2_3_95: f64 = 7.815;

/// Median, 95 % quantile and largest of absolute errors.
#[derive(Debug, Clone, Copy, Serialize)]
pub(super) struct Errors {
    median: f64,
    p95: f64,
    worst: f64,
}

impl Errors {
    fn of(errors: impl Iterator<Item = f64>) -> Option<Self> {
        let mut all: Vec<f64> = errors.map(f64::abs).collect();
        let worst = all.iter().copied().fold(0.0, f64::max);
        Some(Self { median: quantile(&mut all, 0.5)?, p95: quantile(&mut all, 0.95)?, worst })
    }

    fn in_words(this: Option<&Self>) -> String {
        this.map_or("-".to_owned(), |e| format!("{:.3}  {:.3}  {:.3}", e.median, e.p95, e.worst))
    }
}

/// Names of one kind of landmark in one state.
#[derive(Debug, Serialize)]
struct Row {
    kind: &'static str,
    state: &'static str,
    #[serde(flatten)]
    named: Named,
}

impl Row {
    fn in_words(&self) -> String {
        let Named { shown, global, shown_to_pose, guided } = self.named;
        let share = |count: usize, of: usize| 100.0 * count as f64 / of.max(1) as f64;
        let what = format!("{} {}", self.kind, self.state);
        let (alone, with) = (share(global, shown), share(guided, shown_to_pose));
        format!("  {what:<33} {alone:>5.1} % of {shown:<6} {with:>5.1} % of {shown_to_pose}")
    }
}

fn rows(journeys: &[Journey]) -> Vec<Row> {
    let mut all: BTreeMap<(&'static str, &'static str), Named> = BTreeMap::new();
    for (key, named) in journeys.iter().flat_map(|j| &j.named) {
        let sum = all.entry(*key).or_default();
        sum.shown += named.shown;
        sum.global += named.global;
        sum.shown_to_pose += named.shown_to_pose;
        sum.guided += named.guided;
    }
    all.into_iter().map(|((kind, state), named)| Row { kind, state, named }).collect()
}

/// Corners of rightly named landmarks.
#[derive(Debug, Serialize)]
struct CornerErrors {
    named: &'static str,
    corners: usize,
    median_px: f64,
    p90_px: f64,
    /// Squared Mahalanobis distance of a corner: mean (2 expected), median (1.39 expected); share
    /// of corners within 95 %.
    nees: f64,
    median_square: f64,
    within_95: f64,
}

/// 95 % of chi2 with 2 degrees of freedom.
const CHI2_2_95: f64 = 5.991;

impl CornerErrors {
    fn of(named: &'static str, all: &[(f64, f64)]) -> Option<Self> {
        let mut errors: Vec<f64> = all.iter().map(|(px, _)| *px).collect();
        let mut squares: Vec<f64> = all.iter().map(|(_, d2)| *d2).collect();
        let count = all.len().max(1) as f64;
        Some(Self {
            named,
            corners: all.len(),
            median_px: quantile(&mut errors, 0.5)?,
            p90_px: quantile(&mut errors, 0.9)?,
            median_square: quantile(&mut squares, 0.5)?,
            nees: all.iter().map(|(_, d2)| d2).sum::<f64>() / count,
            within_95: all.iter().filter(|(_, d2)| *d2 < CHI2_2_95).count() as f64 / count,
        })
    }

    fn in_words(&self) -> String {
        let Self { named, corners, median_px, p90_px, nees, median_square, within_95 } = self;
        let within = 100.0 * within_95;
        format!(
            "  {named:<33} {corners:>6}   {median_px:>6.2}  {p90_px:>6.2}    {nees:>6.2}  {median_square:>6.2}   {within:>5.1} %"
        )
    }
}

fn corner_errors(journeys: &[Journey]) -> Vec<CornerErrors> {
    let mut all: BTreeMap<&'static str, Vec<(f64, f64)>> = BTreeMap::new();
    for (named, corners) in journeys.iter().flat_map(|j| &j.corners) {
        all.entry(named).or_default().extend(corners);
    }
    all.into_iter().filter_map(|(named, corners)| CornerErrors::of(named, &corners)).collect()
}

/// Figures of all drives. Along is the map's x axis.
#[derive(Debug, Serialize)]
pub(super) struct Report {
    experiment: &'static str,
    seed: u64,
    length_m: f64,
    posters: usize,
    /// Landmarks that were learnt and placed, and how many of them are active.
    taught: usize,
    landmarks: usize,
    /// Of the landmarks' places against the truth.
    place_error_m: Option<Errors>,
    drives: usize,
    frames: usize,
    shown: usize,
    recognised: usize,
    false_matches: usize,
    /// Wrong names by guided recognition.
    guided_false: usize,
    /// Of taught landmarks with sides of 38 px and more of which a quarter is visible, active or
    /// not.
    named: Vec<Row>,
    corners: Vec<CornerErrors>,
    /// The robots had one.
    laser: bool,
    /// Fixes by landmarks: applied, and gated out by the filter.
    corrections: u64,
    gated: u64,
    /// By landmarks that guided recognition named.
    guided_corrections: u64,
    /// Applied fixes by scans, and the outcomes of the others.
    laser_corrections: u64,
    laser_others: BTreeMap<&'static str, u64>,
    /// Landmarks wrongly said to have moved or to be missing.
    flagged: usize,
    quarantined: usize,
    /// Drives without any fix.
    never_fixed: usize,
    /// Frames that showed a landmark up to the first fix, in the worst drive.
    frames_to_fix_worst: Option<usize>,
    /// From the first fix on.
    along_m: Option<Errors>,
    across_m: Option<Errors>,
    heading_rad: Option<Errors>,
    /// Odometry alone from the true start; all frames.
    odometry_along_m: Option<Errors>,
    odometry_across_m: Option<Errors>,
    /// Mean normalised squared error of the fused pose, 3 expected, and the share of frames within
    /// its 95 %.
    nees: f64,
    nees_within_95: f64,
    /// Mean squared error over the stated variance: along, across, heading; 1 expected of each.
    nees_each: [f64; 3],
    /// Intrinsics, extrinsics and survey poses are exact.
    exact: bool,
    /// Outcomes of the kidnapped robots.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    kidnapped: Vec<KidnapOutcome>,
}

impl Report {
    pub(super) fn new(world: &World, journeys: &[Journey], (laser, exact): (bool, bool), seed: u64) -> Self {
        let moments = || journeys.iter().flat_map(|j| &j.moments);
        let fused = || moments().filter_map(|m| Some((m, m.fused.as_ref()?)));
        let errors = |of: fn(&Moment, &Pose2Covariance) -> f64| Errors::of(fused().map(|(m, f)| of(m, f)));
        let squares: Vec<f64> = fused().filter_map(|(m, f)| nees(m, f)).collect();
        let count = squares.len().max(1) as f64;
        let of_each = |count: fn(&Journey) -> usize| journeys.iter().map(count).sum();
        let logged =
            |modality, outcomes: &[&str]| journeys.iter().map(|j| of(&j.log, modality, outcomes)).sum();
        let mut laser_others = BTreeMap::new();
        let scans = journeys.iter().filter_map(|j| j.log.totals.get("laser")).flatten();
        for (outcome, count) in scans.filter(|(outcome, _)| !APPLIED.contains(outcome)) {
            *laser_others.entry(*outcome).or_default() += count;
        }
        Self {
            experiment: "navigation",
            seed,
            length_m: world.course.length_m,
            posters: world.course.posters,
            taught: world.map.landmarks.len(),
            landmarks: world.map.models.len(),
            place_error_m: Errors::of(world.place_errors_m.iter().copied()),
            drives: journeys.len(),
            frames: moments().count(),
            shown: of_each(|j| j.shown),
            recognised: of_each(|j| j.recognised),
            false_matches: of_each(|j| j.false_matches),
            guided_false: of_each(|j| j.guided_false),
            named: rows(journeys),
            corners: corner_errors(journeys),
            laser,
            corrections: logged("landmarks", &APPLIED),
            gated: logged("landmarks", &["gated_out"]),
            guided_corrections: logged("guided", &APPLIED),
            laser_corrections: logged("laser", &APPLIED),
            laser_others,
            flagged: of_each(|j| j.flagged),
            quarantined: of_each(|j| j.quarantined),
            never_fixed: journeys.iter().filter(|j| j.frames_to_fix.is_none()).count(),
            frames_to_fix_worst: journeys.iter().filter_map(|j| j.frames_to_fix).max(),
            along_m: errors(|m, f| f.pose.x_m - m.truth.x_m),
            across_m: errors(|m, f| f.pose.y_m - m.truth.y_m),
            heading_rad: errors(|m, f| wrap_rad(f.pose.theta_rad - m.truth.theta_rad)),
            odometry_along_m: Errors::of(moments().map(|m| m.odometry.x_m - m.truth.x_m)),
            odometry_across_m: Errors::of(moments().map(|m| m.odometry.y_m - m.truth.y_m)),
            nees: squares.iter().sum::<f64>() / count,
            nees_within_95: squares.iter().filter(|s| **s < CHI2_3_95).count() as f64 / count,
            nees_each: std::array::from_fn(|k| {
                fused().map(|(m, f)| f.pose.minus(&m.truth)[k].powi(2) / f.covariance[(k, k)]).sum::<f64>()
                    / count
            }),
            exact,
            kidnapped: journeys.iter().filter_map(|j| j.kidnapped.clone()).collect(),
        }
    }

    /// For people.
    pub(super) fn lines(&self) -> Vec<String> {
        let words = |e: &Option<Errors>| Errors::in_words(e.as_ref());
        let mut lines = vec![
            format!(
                "navigation: corridor of {} m, {} posters; {} landmarks taught, {} active; {} drives, seed {}",
                self.length_m, self.posters, self.taught, self.landmarks, self.drives, self.seed
            ),
            format!("  frames          {}", self.frames),
            format!("  recognitions    {} of {} full views of active landmarks", self.recognised, self.shown),
            format!(
                "  false matches   {}, {} more by guided recognition",
                self.false_matches, self.guided_false
            ),
            format!(
                "  by landmarks    {} corrections, {} more gated out; {} by guided names",
                self.corrections, self.gated, self.guided_corrections
            ),
            if self.laser {
                let others: Vec<String> = self.laser_others.iter().map(|(o, n)| format!("{o} {n}")).collect();
                format!("  by the laser    {} corrections; {}", self.laser_corrections, others.join(", "))
            } else {
                "  by the laser    the robots have none".to_owned()
            },
            format!(
                "  wrong health    {} times flagged, {} quarantined; nothing was moved",
                self.flagged, self.quarantined
            ),
            format!(
                "  first fix       after {} frames that show a landmark at worst; {} drives had none",
                self.frames_to_fix_worst.map_or("-".to_owned(), |n| n.to_string()),
                self.never_fixed
            ),
            "  errors                        median  95 %   worst".to_owned(),
            format!("  places of landmarks, m        {}", words(&self.place_error_m)),
            format!("  along the corridor, m         {}", words(&self.along_m)),
            format!("  across it, m                  {}", words(&self.across_m)),
            format!("  heading, rad                  {}", words(&self.heading_rad)),
            format!("  odometry alone, along, m      {}", words(&self.odometry_along_m)),
            format!("  odometry alone, across, m     {}", words(&self.odometry_across_m)),
            format!(
                "  covariance: mean NEES {:.2} (3 expected), {:.1} % of poses within its 95 %",
                self.nees,
                100.0 * self.nees_within_95
            ),
            format!(
                "  of each number: {:.2} along, {:.2} across, {:.2} heading (1 expected)",
                self.nees_each[0], self.nees_each[1], self.nees_each[2]
            ),
            if self.exact {
                "  Intrinsics, extrinsics and survey poses are exact, and stated with the usual covariances."
                    .to_owned()
            } else {
                "  Intrinsics, extrinsics and survey poses have errors by their stated covariances."
                    .to_owned()
            },
            "  Errors from the first fix on; odometry alone starts at the true pose.".to_owned(),
            "  named rightly                      by the picture    with a known pose".to_owned(),
        ];
        lines.extend(self.named.iter().map(Row::in_words));
        lines.extend(self.kidnapped_in_words());
        lines.push(
            "  corners of these                 number   median   90 %  NEES (2)  median (1.39)  within 95 %"
                .to_owned(),
        );
        lines.extend(self.corners.iter().map(CornerErrors::in_words));
        lines
    }
}

impl Report {
    fn kidnapped_in_words(&self) -> Option<String> {
        if self.kidnapped.is_empty() {
            return None;
        }
        let (found, left): (Vec<&KidnapOutcome>, Vec<&KidnapOutcome>) =
            self.kidnapped.iter().partition(|c| c.is_found_out);
        let frames: Vec<String> = found.iter().map(|c| c.frames.to_string()).collect();
        let misled: usize = self.kidnapped.iter().map(|c| c.misled).sum();
        Some(format!(
            "  kidnapped       detected after {} frames that show an active landmark, {} never; {misled} wrong names by the pose until then",
            frames.join(", "),
            left.len()
        ))
    }
}

/// Squared error normalised by the stated covariance.
fn nees(moment: &Moment, fused: &Pose2Covariance) -> Option<f64> {
    let error = fused.pose.minus(&moment.truth);
    Some(error.dot(&(fused.covariance.try_inverse()? * error)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use map::pose2::Pose2;
    use nalgebra::Matrix3;

    #[test]
    fn errors_by_hand() {
        let e = Errors::of([0.1, -0.3, 0.2].into_iter()).unwrap();
        assert!((e.median - 0.2).abs() < 1e-12 && (e.worst - 0.3).abs() < 1e-12 && e.p95 <= 0.3);
        assert!(Errors::of(std::iter::empty()).is_none());
    }

    #[test]
    fn a_normalised_error_by_hand() {
        let fused = Pose2Covariance {
            pose: Pose2::new(1.0, 2.0, 0.0),
            covariance: Matrix3::from_diagonal(&nalgebra::Vector3::new(0.01, 0.04, 0.01)),
        };
        let truth = Pose2::new(1.2, 2.0, 0.1);
        let moment = Moment { time_s: 0.0, truth, odometry: truth, fused: Some(fused), corrected: false };
        // Two sigma along, one in heading.
        assert!((nees(&moment, &fused).unwrap() - 5.0).abs() < 1e-9);
        let sure = Pose2Covariance { covariance: Matrix3::zeros(), ..fused };
        assert!(nees(&moment, &sure).is_none());
    }
}
