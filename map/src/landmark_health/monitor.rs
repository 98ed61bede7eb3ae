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
use vision::recognise::LandmarkId;

/// Most landmarks that one robot keeps evidence on; the longest unseen go first.
pub const MAX_WATCHED: usize = 1024;

#[derive(Debug, Clone, Default)]
pub(super) struct LandmarkEvidence {
    /// Sightings elsewhere in a row, and the sum of where.
    elsewhere: u32,
    apparent: Option<Pose2>,
    by_m: f64,
    /// The pose rested on enough others.
    firm: bool,
    /// Another landmark has agreed with the pose since the first of them.
    confirmed: bool,
    misses: u32,
    in_place: u32,
    /// Where the robot was at the last sighting and the last miss.
    seen_from: Option<Point2<f64>>,
    missed_from: Option<Point2<f64>>,
    /// What was last said of it.
    told: LandmarkHealth,
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
    /// Knows nothing.
    pub fn new(params: HealthParams) -> Self {
        Self { params, landmarks: BTreeMap::new(), frames: 0 }
    }

    /// The robot's pose has proved wrong, or the map is another one: nothing that was judged by it counts. Gives the
    /// landmarks whose flags were raised by it.
    pub fn clear(&mut self) -> Vec<HealthChange> {
        let cleared = std::mem::take(&mut self.landmarks);
        let raised =
            cleared.into_iter().filter(|(_, e)| e.told == LandmarkHealth::Flagged && e.elsewhere > 0);
        raised
            .map(|(landmark, _)| HealthChange { landmark, standing: LandmarkHealth::Sound, finding: None })
            .collect()
    }

    /// Takes what one frame says, seen from `from`: judged sightings and what should have been seen and was not.
    /// `standing` gives the present standing of a landmark in the map. Gives what should change, by landmark.
    pub fn frame(
        &mut self,
        from: Point2<f64>,
        judged: &[PlaceCheck],
        missed: &[LandmarkId],
        standing: impl Fn(LandmarkId) -> LandmarkHealth,
    ) -> Vec<HealthChange> {
        self.frames += 1;
        for judged in judged {
            self.sighting(from, judged);
        }
        let agreeing = |id: LandmarkId| {
            judged.iter().any(|j| j.landmark != id && matches!(j.verdict, PlaceVerdict::InPlace { .. }))
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
        ids.filter_map(|(id, evidence)| evidence.change(*id, standing(*id), p)).collect()
    }

    fn sighting(&mut self, from: Point2<f64>, judged: &PlaceCheck) {
        let p = &self.params;
        let evidence = self.landmarks.entry(judged.landmark).or_default();
        evidence.touched = self.frames;
        // Recognised is not missing, wherever it hangs.
        evidence.misses = 0;
        let new = evidence.seen_from.is_none_or(|last| (last - from).norm() >= p.sighting_move_m);
        match judged.verdict {
            PlaceVerdict::Undecided | PlaceVerdict::Unsure => {}
            _ if !new => {}
            PlaceVerdict::InPlace { .. } => {
                (evidence.elsewhere, evidence.confirmed) = (0, false);
                evidence.in_place = evidence.in_place.saturating_add(1);
                evidence.seen_from = Some(from);
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
                evidence.seen_from = Some(from);
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
    /// What should become of a landmark of this standing; each thing is said once.
    fn change(
        &mut self,
        landmark: LandmarkId,
        now: LandmarkHealth,
        p: &HealthParams,
    ) -> Option<HealthChange> {
        let often = self.elsewhere >= p.flag_sightings && (self.firm || self.confirmed);
        let moved = self.apparent.filter(|_| often).map(|apparent| Finding::Moved {
            apparent,
            by_m: self.by_m,
            sightings: self.elsewhere,
        });
        let missing = (self.misses >= p.flag_misses).then_some(Finding::Missing { looks: self.misses });
        let sure = (self.elsewhere >= p.quarantine_sightings && self.confirmed)
            || self.misses >= p.quarantine_misses;
        let Some(finding) = moved.or(missing) else {
            self.told = LandmarkHealth::Sound;
            let clear = now == LandmarkHealth::Flagged && self.in_place >= p.clear_sightings;
            // Said again only after as many sightings again, should nobody have heard it.
            self.in_place = if clear { 0 } else { self.in_place };
            return clear.then_some(HealthChange {
                landmark,
                standing: LandmarkHealth::Sound,
                finding: None,
            });
        };
        let standing = if sure { LandmarkHealth::Quarantined } else { LandmarkHealth::Flagged };
        // What is in quarantine is for a person; what was said is not repeated.
        let news = standing > now && standing != self.told;
        self.told = standing;
        news.then_some(HealthChange { landmark, standing, finding: Some(finding) })
    }
}
