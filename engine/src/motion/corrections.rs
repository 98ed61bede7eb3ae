//! What became of each fix of a robot: the latest in a bounded log, all of them in counters. In
//! memory only.

use map::{fuse::FixOutcome, laser_fix::LaserRefusal, localise::FixSource, pose2::Pose2};
use std::collections::{BTreeMap, VecDeque};

/// Corrections in the log of each robot and modality: the latest.
pub const MAX_CORRECTIONS: usize = 200;

/// A fix, what became of it, and by how much it moved the pose.
#[derive(Debug, Clone, PartialEq)]
pub struct Correction {
    /// Echo of the frame or scan.
    pub epoch: u64,
    /// Echo of the frame or scan, robot's clock.
    pub captured_ns: i64,
    /// The map it is a pose in.
    pub map: String,
    /// `landmarks` (named without the pose), `guided` (landmarks named by the pose), `laser` or
    /// `relocalisation`; `by_hand` when a person said where it is; `map_change` when the robot came
    /// from another map.
    pub modality: &'static str,
    /// Names of the landmarks it rests on; empty for the laser.
    pub landmarks: Vec<String>,
    /// `started` (it gave the first pose), `applied`, `gated_out` (it contradicts the pose and was
    /// left out), `reset` (the last of several that contradict the pose and agree with one another,
    /// or a person: it replaced the pose), `excluded_by_mode` (it agrees, but reference runs have
    /// shown another modality to be better here, and the map's fusion mode leaves this one out),
    /// `too_old`, `waiting` (newer than the last odometry), `carried_over` (the pose on another
    /// map, in the frame of this one).
    pub outcome: &'static str,
    /// Squared Mahalanobis distance of the fix from the pose before it, 3 degrees of freedom; for
    /// `applied`, `excluded_by_mode` and `gated_out`.
    pub chi2: Option<f64>,
    /// By how much it moved the pose, in the robot frame before the fix: forwards, m.
    pub along_m: Option<f64>,
    /// To the left, m.
    pub across_m: Option<f64>,
    /// Turn to the left, rad.
    pub turn_rad: Option<f64>,
}

/// The log of one robot.
#[derive(Debug, Clone, Default)]
pub(super) struct CorrectionLog {
    latest: BTreeMap<&'static str, VecDeque<(u64, Correction)>>,
    totals: BTreeMap<&'static str, BTreeMap<&'static str, u64>>,
    taken: u64,
}

/// The log, for readers.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Corrections {
    /// What the pose rests on now: `odometry`, `landmarks`, `guided`, `laser`, `relocalisation`,
    /// `by_hand`; empty without a pose.
    pub modalities: Vec<String>,
    /// For each modality how many fixes had which outcome. For the laser also why scans gave no
    /// fix: `no_pose` (there is none to correct), `no_walls` (the map has none), `few_points`,
    /// `poor_match` (it shows something else than the map), `gate_prior` (it contradicts the pose),
    /// `ambiguous` (several poses fit), `superseded` (a newer one came first).
    pub totals: BTreeMap<&'static str, BTreeMap<&'static str, u64>>,
    /// The latest 200 of each modality, oldest first; without `repeated` ones, which tell nothing
    /// new.
    pub corrections: Vec<Correction>,
}

impl CorrectionLog {
    pub(super) fn count(&mut self, modality: &'static str, outcome: &'static str) {
        *self.totals.entry(modality).or_default().entry(outcome).or_default() += 1;
    }

    /// Counts a correction and adds it to the log.
    pub(super) fn add(&mut self, correction: Correction) {
        self.count(correction.modality, correction.outcome);
        let latest = self.latest.entry(correction.modality).or_default();
        if latest.len() == MAX_CORRECTIONS {
            latest.pop_front();
        }
        self.taken += 1;
        latest.push_back((self.taken, correction));
    }

    /// Notes by how much the last correction of a modality moved the pose.
    pub(super) fn moved(&mut self, modality: &'static str, step: Option<Pose2>) {
        let Some((_, last)) = self.latest.get_mut(modality).and_then(VecDeque::back_mut) else { return };
        last.along_m = step.map(|s| s.x_m);
        last.across_m = step.map(|s| s.y_m);
        last.turn_rad = step.map(|s| s.theta_rad);
    }

    /// Everything, in the order of arrival.
    pub(super) fn read(&self, modalities: Vec<String>) -> Corrections {
        let mut all: Vec<&(u64, Correction)> = self.latest.values().flatten().collect();
        all.sort_by_key(|(number, _)| *number);
        let corrections = all.into_iter().map(|(_, correction)| correction.clone()).collect();
        Corrections { modalities, totals: self.totals.clone(), corrections }
    }
}

/// The change of a pose, in the robot frame before it.
pub(super) fn pose_change(before: Option<&Pose2>, after: Option<&Pose2>) -> Option<Pose2> {
    Some(before?.between(after?))
}

/// The word for a modality.
pub(super) fn modality_word(source: FixSource) -> &'static str {
    match source {
        FixSource::Landmarks => "landmarks",
        FixSource::Laser => "laser",
    }
}

/// The word for an outcome, and its chi2.
pub(super) fn outcome_word(outcome: FixOutcome) -> (&'static str, Option<f64>) {
    // JSON has no infinity.
    let finite = |d: f64| d.is_finite().then_some(d);
    match outcome {
        FixOutcome::Started => ("started", None),
        FixOutcome::Applied { distance2 } => ("applied", finite(distance2)),
        FixOutcome::ExcludedByMode { distance2 } => ("excluded_by_mode", finite(distance2)),
        FixOutcome::GatedOut { distance2, .. } => ("gated_out", finite(distance2)),
        FixOutcome::Reset => ("reset", None),
        FixOutcome::Repeated => ("repeated", None),
        FixOutcome::NoPose => ("no_pose", None),
        FixOutcome::TooOld => ("too_old", None),
        FixOutcome::Waiting => ("waiting", None),
    }
}

/// The word for the reason why a scan gives no fix.
pub(super) fn refusal_word(refusal: LaserRefusal) -> &'static str {
    match refusal {
        LaserRefusal::FewPoints { .. } => "few_points",
        LaserRefusal::PoorMatch { .. } => "poor_match",
        LaserRefusal::GatePrior { .. } => "gate_prior",
        LaserRefusal::Ambiguous => "ambiguous",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_log_is_bounded_and_scans_do_not_push_out_landmarks() {
        let mut log = CorrectionLog::default();
        let made = |modality, captured_ns| Correction {
            epoch: 1,
            captured_ns,
            map: "hall".into(),
            modality,
            landmarks: Vec::new(),
            outcome: "applied",
            chi2: Some(1.0),
            along_m: None,
            across_m: None,
            turn_rad: None,
        };
        log.add(made("landmarks", 0));
        for i in 1..=MAX_CORRECTIONS as i64 + 1 {
            log.add(made("laser", i));
        }
        log.count("laser", "poor_match");
        let read = log.read(vec!["odometry".into()]);
        assert_eq!(read.corrections.len(), MAX_CORRECTIONS + 1);
        assert_eq!((read.corrections[0].modality, read.corrections[1].captured_ns), ("landmarks", 2));
        assert_eq!(read.totals["laser"], [("applied", MAX_CORRECTIONS as u64 + 1), ("poor_match", 1)].into());
    }
}
