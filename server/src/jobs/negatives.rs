//! Negatives of a lesson: icons of every other landmark, evenly chosen, and distractors of the
//! pictures. They are collected once for the whole lesson, ordered by landmark, so that the icons
//! of one landmark are one range.

use crate::store::{
    pictures::Digest,
    views::{QuadCrop, TrainingViewRow},
};
use std::{collections::BTreeSet, ops::Range};
use vision::{
    geometry::{Corners, polygon::intersection_area},
    icon::Icon,
    learn::add_negatives,
    model::{LandmarkId, LandmarkModel},
    params::Params,
    recognise::IconFeatures,
};

/// Other landmarks' icons compared with each model, about. 300 are needed to speak of 1 % (method
/// 8).
const WANTED: usize = 2_000;
/// Icons of one landmark at least, however many landmarks there are.
const EACH_MIN: usize = 3;
/// Icons of one landmark at most, however few landmarks there are.
const EACH_MAX: usize = 30;

/// Share of the smaller quad above which two quads of a picture show the same object.
const OVERLAP: f64 = 0.25;

/// How many icons of each landmark stand for it.
pub(super) fn each(landmarks: usize) -> usize {
    (WANTED / landmarks.max(1)).clamp(EACH_MIN, EACH_MAX)
}

/// At most `count` of `items`, evenly spread, the first always among them.
pub(super) fn spread<T>(items: &[T], count: usize) -> impl Iterator<Item = &T> {
    let taken = count.min(items.len());
    (0..taken).map(move |i| &items[i * items.len() / taken])
}

/// Icons with their features, by landmark.
#[derive(Debug, Default)]
pub(super) struct Negatives {
    icons: Vec<IconFeatures>,
    owners: Vec<(LandmarkId, Range<usize>)>,
    distractors: Vec<IconFeatures>,
}

impl Negatives {
    /// Adds the icons of one landmark.
    pub(super) fn add(&mut self, owner: LandmarkId, icons: Vec<IconFeatures>) {
        let start = self.icons.len();
        self.icons.extend(icons);
        self.owners.push((owner, start..self.icons.len()));
    }

    /// Removes the icons of these landmarks.
    pub(super) fn remove(&mut self, landmarks: &BTreeSet<LandmarkId>) {
        let (icons, owners) = (std::mem::take(&mut self.icons), std::mem::take(&mut self.owners));
        let mut icons = icons.into_iter();
        for (owner, range) in owners {
            let own: Vec<IconFeatures> = icons.by_ref().take(range.len()).collect();
            if !landmarks.contains(&owner) {
                self.add(owner, own);
            }
        }
    }

    /// Sets the icons of no landmark.
    pub(super) fn set_distractors(&mut self, distractors: Vec<IconFeatures>) {
        self.distractors = distractors;
    }

    /// The icons of `landmark`.
    pub(super) fn of(&self, landmark: LandmarkId) -> &[IconFeatures] {
        self.owners
            .iter()
            .find(|(owner, _)| *owner == landmark)
            .map_or(&[], |(_, range)| &self.icons[range.clone()])
    }

    /// Every landmark with its icons.
    pub(super) fn by_owner(&self) -> impl Iterator<Item = (LandmarkId, &[IconFeatures])> {
        self.owners.iter().map(|(owner, range)| (*owner, &self.icons[range.clone()]))
    }

    /// The icons of all other landmarks, in two parts: before and after its own.
    pub(super) fn others(&self, landmark: LandmarkId) -> (&[IconFeatures], &[IconFeatures]) {
        match self.owners.iter().find(|(owner, _)| *owner == landmark) {
            Some((_, own)) => (&self.icons[..own.start], &self.icons[own.end..]),
            None => (&self.icons, &[]),
        }
    }

    /// `model` with the distractors as negatives, except those that are as near as its own views
    /// are to one another: those show the landmark itself, in the background of another landmark's
    /// picture.
    pub(super) fn with_distractors(&self, model: &LandmarkModel, p: &Params) -> LandmarkModel {
        let own = &model.correlation_evidence.own;
        let near = own.get(own.len() / 2).map_or(0.0, |d| f64::from(*d));
        let distractors: Vec<IconFeatures> = self
            .distractors
            .iter()
            .filter(|s| model.distances(s, &p.recognise).correlation > near)
            .cloned()
            .collect();
        add_negatives(model, &distractors, p)
    }
}

/// Distractors that do not overlap a training view of the same picture.
pub(super) fn untaught_distractors(
    distractors: Vec<(Digest, QuadCrop)>,
    views: &[TrainingViewRow],
) -> Vec<Icon> {
    let taught = |digest: &Digest, corners: &Corners| {
        views.iter().any(|l| l.image_sha256 == *digest && overlaps(&l.crop.corners_px, corners))
    };
    distractors
        .into_iter()
        .filter(|(digest, crop)| !taught(digest, &crop.corners_px))
        .map(|(_, crop)| crop.icon)
        .collect()
}

/// Whether two quads of one picture share more than a border.
fn overlaps(a: &Corners, b: &Corners) -> bool {
    intersection_area(a.points(), b.points()) > OVERLAP * a.area_px2().min(b.area_px2())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(x: f64, y: f64, side: f64) -> Corners {
        Corners::try_from([[x, y], [x + side, y], [x + side, y + side], [x, y + side]]).unwrap()
    }

    #[test]
    fn a_choice_is_even_and_bounded() {
        let items: Vec<usize> = (0..10).collect();
        assert_eq!(spread(&items, 5).copied().collect::<Vec<_>>(), [0, 2, 4, 6, 8]);
        assert_eq!(spread(&items, 20).count(), 10);
        assert_eq!(spread(&items[..0], 3).count(), 0);
        assert_eq!((each(0), each(10), each(287), each(10_000)), (30, 30, 6, 3));
    }

    #[test]
    fn nested_and_shifted_quads_overlap_and_neighbours_do_not() {
        let frame = square(0.0, 0.0, 100.0);
        assert!(overlaps(&frame, &square(30.0, 30.0, 40.0)));
        assert!(overlaps(&square(30.0, 30.0, 40.0), &frame));
        assert!(overlaps(&frame, &square(20.0, 0.0, 100.0)));
        assert!(!overlaps(&frame, &square(101.0, 0.0, 100.0)));
        assert!(overlaps(&frame, &square(74.0, 0.0, 100.0)));
        assert!(!overlaps(&frame, &square(76.0, 0.0, 100.0)));
    }

    #[test]
    fn a_landmark_is_not_its_own_negative() {
        let icon = |grey: f32| {
            let icon = Icon::new(75, vec![grey; 75 * 75], 1.0).unwrap();
            vision::recognise::features(icon, &Params::default().recognise)
        };
        let mut negatives = Negatives::default();
        for (id, count) in [(1, 2), (5, 1), (9, 3)] {
            negatives.add(LandmarkId(id), vec![icon(id as f32); count]);
        }
        let (before, after) = negatives.others(LandmarkId(5));
        assert_eq!((before.len(), after.len(), negatives.of(LandmarkId(5)).len()), (2, 3, 1));
        let (before, after) = negatives.others(LandmarkId(7));
        assert_eq!((before.len(), after.len(), negatives.of(LandmarkId(7)).len()), (6, 0, 0));
        negatives.remove(&[LandmarkId(1), LandmarkId(7)].into());
        let (before, after) = negatives.others(LandmarkId(9));
        assert_eq!((before.len(), after.len(), negatives.of(LandmarkId(1)).len()), (1, 0, 0));
    }
}
