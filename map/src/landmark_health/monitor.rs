//! One robot's evidence on the landmarks of its map, frame by frame.

use crate::{
    landmark_health::{
        health::{Finding, HealthChange, LandmarkHealth},
        params::HealthParams,
        place_check::{PlaceCheck, PlaceVerdict},
    },
    pose2::Pose2,
};
use nalgebra::Point2;
use std::collections::BTreeMap;
use vision::model::LandmarkId;

/// Most landmarks that one robot keeps evidence on; those unobserved for longest are dropped first.
pub const MAX_WATCHED: usize = 1024;

#[derive(Debug, Clone, Default)]
pub(super) struct LandmarkEvidence {
    /// Consecutive observations elsewhere, and where.
    elsewhere: u32,
    apparent: Option<Pose2>,
    by_m: f64,
    /// The pose rested on enough other landmarks.
    firm: bool,
    /// Another landmark has agreed with the pose since the first observation elsewhere.
    confirmed: bool,
    misses: u32,
    in_place: u32,
    /// Robot position at the last observation and at the last miss.
    observed_from: Option<Point2<f64>>,
    missed_from: Option<Point2<f64>>,
    /// The health last reported.
    reported: LandmarkHealth,
    touched: u64,
}

/// One robot's evidence on the landmarks of its map.
#[derive(Debug, Clone)]
pub struct HealthMonitor {
    params: HealthParams,
    pub(super) landmarks: BTreeMap<LandmarkId, LandmarkEvidence>,
    frames: u64,
}

impl HealthMonitor {
    /// A monitor without evidence.
    pub fn new(params: HealthParams) -> Self {
        Self { params, landmarks: BTreeMap::new(), frames: 0 }
    }

    /// Drops all evidence, since the robot's pose was wrong or the map is another one. Gives the
    /// landmarks whose flags were raised by it.
    pub fn clear(&mut self) -> Vec<HealthChange> {
        let cleared = std::mem::take(&mut self.landmarks);
        let raised =
            cleared.into_iter().filter(|(_, e)| e.reported == LandmarkHealth::Flagged && e.elsewhere > 0);
        raised
            .map(|(landmark, _)| HealthChange { landmark, health: LandmarkHealth::Sound, finding: None })
            .collect()
    }

    /// Adds one frame taken from `from`: place checks of the observed landmarks, and the expected
    /// landmarks that were missed. `health` gives the present health of a landmark. Gives the
    /// changes, by landmark.
    pub fn frame(
        &mut self,
        from: Point2<f64>,
        checks: &[PlaceCheck],
        missed: &[LandmarkId],
        health: impl Fn(LandmarkId) -> LandmarkHealth,
    ) -> Vec<HealthChange> {
        self.frames += 1;
        for check in checks {
            self.observation(from, check);
        }
        let agreeing = |id: LandmarkId| {
            checks.iter().any(|j| j.landmark != id && matches!(j.verdict, PlaceVerdict::InPlace { .. }))
        };
        for (id, evidence) in &mut self.landmarks {
            evidence.confirmed |= evidence.elsewhere > 0 && agreeing(*id);
        }
        for id in missed {
            self.miss(from, *id);
        }
        self.prune();
        let p = &self.params;
        let ids = self.landmarks.iter_mut();
        ids.filter_map(|(id, evidence)| evidence.change(*id, health(*id), p)).collect()
    }

    fn observation(&mut self, from: Point2<f64>, check: &PlaceCheck) {
        let p = &self.params;
        let evidence = self.landmarks.entry(check.landmark).or_default();
        evidence.touched = self.frames;
        // An observation elsewhere ends a row of misses, too.
        evidence.misses = 0;
        let new = evidence.observed_from.is_none_or(|last| (last - from).norm() >= p.sighting_move_m);
        match check.verdict {
            PlaceVerdict::Undecided | PlaceVerdict::Unsure => {}
            _ if !new => {}
            PlaceVerdict::InPlace { .. } => {
                (evidence.elsewhere, evidence.confirmed) = (0, false);
                evidence.in_place = evidence.in_place.saturating_add(1);
                evidence.observed_from = Some(from);
            }
            PlaceVerdict::Elsewhere { apparent, by_m, supporters, .. } => {
                let same = evidence
                    .apparent
                    .is_some_and(|a| (a.position() - apparent.position()).norm() < p.agree_m);
                if evidence.elsewhere == 0 || !same {
                    (evidence.elsewhere, evidence.confirmed) = (0, false);
                    (evidence.apparent, evidence.by_m) = (Some(apparent), by_m);
                }
                evidence.firm = supporters >= p.supporters;
                evidence.elsewhere = evidence.elsewhere.saturating_add(1);
                evidence.in_place = 0;
                evidence.observed_from = Some(from);
            }
        }
    }

    fn miss(&mut self, from: Point2<f64>, id: LandmarkId) {
        let evidence = self.landmarks.entry(id).or_default();
        evidence.touched = self.frames;
        if evidence.missed_from.is_none_or(|last| (last - from).norm() >= self.params.miss_move_m) {
            evidence.misses = evidence.misses.saturating_add(1);
            evidence.missed_from = Some(from);
            evidence.in_place = 0;
        }
    }

    fn prune(&mut self) {
        while self.landmarks.len() > MAX_WATCHED {
            let oldest = self.landmarks.iter().min_by_key(|(id, e)| (e.touched, **id)).map(|(id, _)| *id);
            let Some(oldest) = oldest else { return };
            self.landmarks.remove(&oldest);
        }
    }
}

impl LandmarkEvidence {
    /// The change for a landmark of this health; each change is reported once.
    fn change(
        &mut self,
        landmark: LandmarkId,
        now: LandmarkHealth,
        p: &HealthParams,
    ) -> Option<HealthChange> {
        let often = self.elsewhere >= p.flag_sightings && (self.firm || self.confirmed);
        let moved = self.apparent.filter(|_| often).map(|observed_place| Finding::Moved {
            observed_place,
            offset_m: self.by_m,
            sightings: self.elsewhere,
        });
        let missing =
            (self.misses >= p.flag_misses).then_some(Finding::Missing { missed_frames: self.misses });
        let sure = (self.elsewhere >= p.quarantine_sightings && self.confirmed)
            || self.misses >= p.quarantine_misses;
        let Some(finding) = moved.or(missing) else {
            self.reported = LandmarkHealth::Sound;
            let clear = now == LandmarkHealth::Flagged && self.in_place >= p.clear_sightings;
            // Reported again only after as many observations, in case the report was lost.
            self.in_place = if clear { 0 } else { self.in_place };
            return clear.then_some(HealthChange { landmark, health: LandmarkHealth::Sound, finding: None });
        };
        let health = if sure { LandmarkHealth::Quarantined } else { LandmarkHealth::Flagged };
        // Only a person ends a quarantine; a report is not repeated.
        let news = health > now && health != self.reported;
        self.reported = health;
        news.then_some(HealthChange { landmark, health, finding: Some(finding) })
    }
}
