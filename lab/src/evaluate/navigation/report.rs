//! Figures of all drives: errors along and across the corridor, consistency of the covariance.

use super::{
    journey::{Journey, Moment},
    kidnap::KidnapOutcome,
    names::{CornerErrors, Row, corner_errors, rows},
    world::{FirstMapBy, World},
};
use crate::evaluate::{experiment::robot_server::of, statistics::quantile};
use map::{
    modality_stats::FusionMode,
    pose2::{Pose2Covariance, wrap_rad},
};
use serde::Serialize;
use std::collections::BTreeMap;
use vision::params::preset::Preset;

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
    /// Mean squared error of the places along the corridor over the stated variance; 1 expected.
    place_nees_along: f64,
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
    /// Fixes by landmarks: applied, of the drive with the fewest, and gated out by the filter.
    corrections: u64,
    corrections_fewest: u64,
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
    /// Drives that came to the end of their path, and how far true poses were beside it.
    arrived: usize,
    off_path_m: Option<Errors>,
    /// The pipeline, and which modalities were fused.
    preset: Preset,
    fusion: FusionMode,
    /// Reference runs that the robots had learnt from.
    runs: usize,
    /// The robots went by their own estimate, in a map of their own.
    closed: bool,
    survey_drives: Option<usize>,
    /// Outcomes of the kidnapped robots.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    kidnapped: Vec<KidnapOutcome>,
}

impl Report {
    pub(super) fn new(world: &World, journeys: &[Journey], (laser, runs): (bool, usize)) -> Self {
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
            seed: world.course.seed,
            length_m: world.course.length_m,
            posters: world.course.posters,
            taught: world.map.landmarks.len(),
            landmarks: world.map.models.len(),
            place_error_m: Errors::of(world.place_errors.iter().map(|(m, _)| *m)),
            place_nees_along: world.place_errors.iter().map(|(_, square)| square).sum::<f64>()
                / world.place_errors.len().max(1) as f64,
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
            corrections_fewest: journeys
                .iter()
                .map(|j| of(&j.log, "landmarks", &APPLIED))
                .min()
                .unwrap_or_default(),
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
            arrived: journeys.iter().filter(|j| j.arrived).count(),
            off_path_m: Errors::of(moments().filter_map(|m| m.off_path_m)),
            preset: world.course.preset,
            fusion: world.map.modalities.mode(),
            runs,
            closed: world.course.first_map != FirstMapBy::Truth,
            survey_drives: world.course.first_map.survey_drives(),
            kidnapped: journeys.iter().filter_map(|j| j.kidnapped.clone()).collect(),
        }
    }

    /// For people.
    pub(super) fn lines(&self) -> Vec<String> {
        let mut lines = vec![
            format!(
                "navigation: corridor of {} m, {} posters; {} landmarks taught, {} active; {} drives, seed {}; preset {}",
                self.length_m,
                self.posters,
                self.taught,
                self.landmarks,
                self.drives,
                self.seed,
                self.preset.word()
            ),
            format!("  fusion          {:?}, learnt from {} runs", self.fusion, self.runs),
            format!("  frames          {}", self.frames),
            format!("  recognitions    {} of {} full views of active landmarks", self.recognised, self.shown),
            format!(
                "  false matches   {}, {} more by guided recognition",
                self.false_matches, self.guided_false
            ),
            format!(
                "  by landmarks    {} corrections, {} in the drive with the fewest, {} more gated out; {} by guided names",
                self.corrections, self.corrections_fewest, self.gated, self.guided_corrections
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
        ];
        lines.extend(self.errors_in_words());
        lines.extend([
            if self.closed {
                format!(
                    "  Closed loop: map by {}, camera and wheels by the estimate; {} drives arrived.",
                    match self.survey_drives {
                        None => "SLAM and a lesson".to_owned(),
                        Some(1) => "a survey of one drive".to_owned(),
                        Some(drives) => format!("a survey of {drives} drives"),
                    },
                    self.arrived
                )
            } else {
                "  Open loop: true path, aim and survey poses; intrinsics and extrinsics are exact."
                    .to_owned()
            },
            "  Errors from the first fix on.".to_owned(),
            "  named rightly                      by the picture    with a known pose".to_owned(),
        ]);
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
    fn errors_in_words(&self) -> Vec<String> {
        let words = |e: &Option<Errors>| Errors::in_words(e.as_ref());
        vec![
            "  errors                        median  95 %   worst".to_owned(),
            format!(
                "  places of landmarks, m        {}; {:.2} along (1 expected)",
                words(&self.place_error_m),
                self.place_nees_along
            ),
            format!("  along the corridor, m         {}", words(&self.along_m)),
            format!("  across it, m                  {}", words(&self.across_m)),
            format!("  heading, rad                  {}", words(&self.heading_rad)),
            format!("  true pose beside the path, m  {}", words(&self.off_path_m)),
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
        ]
    }

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
        let moment = Moment {
            time_s: 0.0,
            truth,
            odometry: truth,
            fused: Some(fused),
            corrected: false,
            off_path_m: None,
        };
        // Two sigma along, one in heading.
        assert!((nees(&moment, &fused).unwrap() - 5.0).abs() < 1e-9);
        let sure = Pose2Covariance { covariance: Matrix3::zeros(), ..fused };
        assert!(nees(&moment, &sure).is_none());
    }
}
