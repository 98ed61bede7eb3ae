//! Matches of a quad with one landmark, to be shown to a person. In: the image, the corners of the
//! quad, the landmark's points. Out: pairs of places in landmark coordinates, those that agree
//! first. It decides nothing: the same matches as in a search, also where they are too few for
//! evidence.

use crate::{
    frame::GrayImage,
    geometry::corners::Corners,
    points::{
        matching::{Match, matches},
        patch::{Patch, inner_px},
        point::{Point, SeenPatch},
        taught::TaughtPoint,
        verify::{GLOBAL_GATE, Hypothesis, MAX_PATCH_POINTS, Target, global_hypothesis, verified},
    },
};

/// A match of a point of the quad with one of the landmark.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShownMatch {
    /// Place in the quad as its corners lie, in landmark coordinates.
    pub seen: [f32; 2],
    /// Place on the landmark, in landmark coordinates.
    pub taught: [f32; 2],
    /// Whether it agrees with the homography that the matches determine.
    pub agrees: bool,
}

/// log10 of the false alarms below which matches are shown as agreeing.
const LOG10_BELIEVED: f64 = -1.0;

/// At most `most` matches of the quad `corners_px` with the points `taught`; none where the quad
/// gives no patch. A quad may be turned by quarters: the turn with most matches that agree counts.
pub fn shown_matches(
    image: &GrayImage,
    corners_px: &Corners,
    taught: &[TaughtPoint],
    most: usize,
) -> Vec<ShownMatch> {
    let patch = (!taught.is_empty()).then(|| Patch::new(image, corners_px, inner_px(corners_px))).flatten();
    let Some(patch) = patch else { return Vec::new() };
    let seen = SeenPatch::new(patch, MAX_PATCH_POINTS);
    let target = Target::new(taught);
    let of_turn = |turn: usize| {
        let turned: Vec<Point> = seen.points.iter().map(|point| point.rotated(turn)).collect();
        let is_believed =
            |h: &Hypothesis| verified(&seen, h, &target).is_some_and(|e| e.log10_nfa <= LOG10_BELIEVED);
        let (found, inliers) = match global_hypothesis(&turned, turn, &target).filter(is_believed) {
            Some(hypothesis) => (hypothesis.matches, hypothesis.consensus.inliers),
            None => (matches(&turned, target.points(), &GLOBAL_GATE), Vec::new()),
        };
        (inliers.len(), found, inliers)
    };
    let better = |best: (usize, Vec<Match>, Vec<usize>), other: (usize, Vec<Match>, Vec<usize>)| {
        // Of equal turns the first, as the corners say.
        if (other.0, other.1.len()) > (best.0, best.1.len()) { other } else { best }
    };
    let Some((_, found, inliers)) = (0..4).map(of_turn).reduce(better) else { return Vec::new() };
    let shown = |i: usize, agrees: bool| {
        let Match { seen: s, taught: t, .. } = found[i];
        ShownMatch { seen: seen.points[s].at, taught: target.points()[t].at, agrees }
    };
    let others = (0..found.len()).filter(|i| !inliers.contains(i)).map(|i| shown(i, false));
    inliers.iter().map(|&i| shown(i, true)).chain(others).take(most).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        points::taught::view_points,
        recognise::fixture::{oblique, photograph, poster, whole},
    };

    fn agreeing(shown: &[ShownMatch]) -> usize {
        shown.iter().filter(|m| m.agrees).count()
    }

    #[test]
    fn agreeing_matches_come_first_and_lie_at_the_same_places_of_both_pictures() {
        let (image, taught) =
            (photograph(&poster(1), &oblique(), 0.8, 20.0), view_points(&poster(1), &whole()));
        let shown = shown_matches(&image, &oblique(), &taught, usize::MAX);
        assert!(agreeing(&shown) >= 10, "{shown:?}");
        let is_near = |m: &ShownMatch| (0..2).all(|i| (m.seen[i] - m.taught[i]).abs() < 0.05);
        assert!(shown.iter().filter(|m| m.agrees).all(is_near), "{shown:?}");
        let few = shown_matches(&image, &oblique(), &taught, 5);
        assert_eq!(few, shown[..5]);
        assert_eq!(agreeing(&few), 5);
        // The corners begin with another one of the quad: places are those of its corners.
        let turned = shown_matches(&image, &oblique().rotated(1), &taught, usize::MAX);
        assert!(agreeing(&turned) >= 10, "{turned:?}");
        let is_turned = |m: &ShownMatch| {
            (m.seen[0] - m.taught[1]).abs() < 0.05 && (m.seen[1] - 1.0 + m.taught[0]).abs() < 0.05
        };
        assert!(turned.iter().filter(|m| m.agrees).all(is_turned), "{turned:?}");
    }

    #[test]
    fn matches_with_another_landmark_agree_on_nothing() {
        let image = photograph(&poster(1), &oblique(), 0.8, 20.0);
        let shown = shown_matches(&image, &oblique(), &view_points(&poster(5), &whole()), usize::MAX);
        assert_eq!(agreeing(&shown), 0, "{shown:?}");
        assert!(shown_matches(&image, &oblique(), &[], 9).is_empty());
    }
}
