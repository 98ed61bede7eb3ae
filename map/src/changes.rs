//! Moved, changed, gone: what the map says should be seen, against what is seen (docs/method/27-landmark-health.md).
//!
//! In: sightings with the pose that the robot has without them, and what should have been in the picture. Out: which
//! landmarks to flag, to quarantine and to trust again. A landmark is only judged by a pose that rests on others, and only
//! quarantined once another has agreed with that pose afterwards: a robot that was carried away must not condemn a room.
//! Moves nothing and forgets nothing by itself: a person decides.

mod expected;
mod judge;

pub use expected::{Expectation, Eye, expected};
pub use judge::{Judged, Verdict, judge, sift};

use crate::{gate::CHI2_3_999, pose2::Pose2};
use nalgebra::Point2;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use vision::model::LandmarkId;

/// Most landmarks that one robot keeps evidence on; the longest unseen go first.
pub const MAX_WATCHED: usize = 1024;

/// Knobs of the watch.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ChangeParams {
    /// Squared Mahalanobis distance from which on a landmark is seen elsewhere: 99.9 % of chi2 with 3 degrees of freedom.
    pub moved_chi2: f64,
    /// A look tells that a landmark is in place when a move of this much would stand out.
    pub told_m: f64,
    /// On how many other landmarks the pose must rest for a flag at once. By a pose that rests on one other it may be
    /// either that has moved: then a third must agree first.
    pub supporters: usize,
    /// Sightings elsewhere count together when the landmark appears within this of the same place.
    pub agree_m: f64,
    /// So many sightings elsewhere flag a landmark...
    pub flag_sightings: u32,
    /// ...so many quarantine it, once another landmark has agreed since.
    pub quarantine_sightings: u32,
    /// So many looks in a row without it flag a landmark...
    pub flag_misses: u32,
    /// ...and so many quarantine it.
    pub quarantine_misses: u32,
    /// So many sightings in place clear a flag.
    pub clear_sightings: u32,
    /// A sighting is new only after the robot has moved this far...
    pub sighting_move_m: f64,
    /// ...and a look without the landmark after this: whoever stands before it walks on.
    pub miss_move_m: f64,
    /// What is seen less probably is not missed.
    pub expected_probability: f64,
    /// Nor what would be seen more obliquely.
    pub expected_incidence_rad: f64,
    /// Share of the image left free all round what is expected in it.
    pub image_margin: f64,
}

impl Default for ChangeParams {
    fn default() -> Self {
        Self {
            moved_chi2: CHI2_3_999,
            told_m: 1.0,
            supporters: 2,
            agree_m: 0.5,
            flag_sightings: 3,
            quarantine_sightings: 5,
            flag_misses: 6,
            quarantine_misses: 20,
            clear_sightings: 3,
            sighting_move_m: 0.05,
            miss_move_m: 0.25,
            expected_probability: 0.95,
            expected_incidence_rad: 60.0_f64.to_radians(),
            image_margin: 0.1,
        }
    }
}

/// How far a landmark is trusted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Standing {
    /// Nothing speaks against it.
    #[default]
    Sound,
    /// Something does; it is still used, and whoever looks after the map is told.
    Flagged,
    /// It corrects no pose until a person has decided.
    Quarantined,
}

/// What speaks against a landmark.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Finding {
    /// It is seen elsewhere.
    Moved {
        /// Where it appears: centre on the floor and direction of its normal.
        apparent: Pose2,
        /// How far that is from its place.
        by_m: f64,
        /// How many sightings say so.
        sightings: u32,
    },
    /// It should be seen and is not.
    Missing {
        /// How many looks in a row.
        looks: u32,
    },
}

/// A landmark's standing should change.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Change {
    /// Which landmark.
    pub landmark: LandmarkId,
    /// To what.
    pub standing: Standing,
    /// Why; nothing speaks against a sound one.
    pub finding: Option<Finding>,
}

#[derive(Debug, Clone, Default)]
struct Evidence {
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
    told: Standing,
    touched: u64,
}

/// One robot's evidence on the landmarks of its map.
#[derive(Debug, Clone)]
pub struct Watch {
    params: ChangeParams,
    landmarks: BTreeMap<LandmarkId, Evidence>,
    frames: u64,
}

impl Watch {
    /// Knows nothing.
    pub fn new(params: ChangeParams) -> Self {
        Self { params, landmarks: BTreeMap::new(), frames: 0 }
    }

    /// The robot's pose has proved wrong, or the map is another one: nothing that was judged by it counts. Gives the
    /// landmarks whose flags were raised by it.
    pub fn clear(&mut self) -> Vec<Change> {
        let cleared = std::mem::take(&mut self.landmarks);
        let raised = cleared.into_iter().filter(|(_, e)| e.told == Standing::Flagged && e.elsewhere > 0);
        raised.map(|(landmark, _)| Change { landmark, standing: Standing::Sound, finding: None }).collect()
    }

    /// Takes what one frame says, seen from `from`: judged sightings and what should have been seen and was not.
    /// `standing` gives the present standing of a landmark in the map. Gives what should change, by landmark.
    pub fn frame(
        &mut self,
        from: Point2<f64>,
        judged: &[Judged],
        missed: &[LandmarkId],
        standing: impl Fn(LandmarkId) -> Standing,
    ) -> Vec<Change> {
        self.frames += 1;
        for judged in judged {
            self.sighting(from, judged);
        }
        let agreeing = |id: LandmarkId| {
            judged.iter().any(|j| j.landmark != id && matches!(j.verdict, Verdict::InPlace { .. }))
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

    fn sighting(&mut self, from: Point2<f64>, judged: &Judged) {
        let p = &self.params;
        let evidence = self.landmarks.entry(judged.landmark).or_default();
        evidence.touched = self.frames;
        // Recognised is not missing, wherever it hangs.
        evidence.misses = 0;
        let new = evidence.seen_from.is_none_or(|last| (last - from).norm() >= p.sighting_move_m);
        match judged.verdict {
            Verdict::Undecided | Verdict::Unsure => {}
            _ if !new => {}
            Verdict::InPlace { .. } => {
                (evidence.elsewhere, evidence.confirmed) = (0, false);
                evidence.in_place = evidence.in_place.saturating_add(1);
                evidence.seen_from = Some(from);
            }
            Verdict::Elsewhere { apparent, by_m, supporters, .. } => {
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

impl Evidence {
    /// What should become of a landmark of this standing; each thing is said once.
    fn change(&mut self, landmark: LandmarkId, now: Standing, p: &ChangeParams) -> Option<Change> {
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
            self.told = Standing::Sound;
            let clear = now == Standing::Flagged && self.in_place >= p.clear_sightings;
            // Said again only after as many sightings again, should nobody have heard it.
            self.in_place = if clear { 0 } else { self.in_place };
            return clear.then_some(Change { landmark, standing: Standing::Sound, finding: None });
        };
        let standing = if sure { Standing::Quarantined } else { Standing::Flagged };
        // What is in quarantine is for a person; what was said is not repeated.
        let news = standing > now && standing != self.told;
        self.told = standing;
        news.then_some(Change { landmark, standing, finding: Some(finding) })
    }
}

#[cfg(test)]
mod tests;
