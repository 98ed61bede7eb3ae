//! Closures by landmarks: right ones are kept, wrong ones refused, and drives laid on each other.

use super::{super::*, golden::Golden};
use crate::pose2::Pose2;

/// The golden drive with every track of four views or more cut in two, and the pairs.
fn cut(golden: &Golden) -> (Survey, Vec<[usize; 2]>) {
    let mut survey = golden.survey();
    let (mut tracks, mut pairs) = (Vec::new(), Vec::new());
    for mut track in std::mem::take(&mut survey.drives[0].tracks) {
        if track.views.len() >= 4 {
            let later = track.views.split_off(track.views.len() / 2);
            pairs.push([tracks.len(), tracks.len() + 1]);
            tracks.push(Track { views: later, ..track.clone() });
        }
        tracks.push(track);
    }
    survey.drives[0].tracks = tracks;
    (survey, pairs)
}

#[test]
fn right_closures_are_kept_and_wrong_ones_refused() {
    let golden = Golden::read();
    let (mut survey, right) = cut(&golden);
    assert!(right.len() >= 2, "{right:?}");
    survey.candidates = right.clone();
    // The first halves of two objects, both ways round.
    survey.candidates.extend([[right[0][0], right[1][0]], [right[1][1], right[0][1]]]);
    let map = surveyed(&survey, &JointParams { min_views: 2, ..golden.params() }).unwrap();
    for (closure, pair) in map.closures.iter().zip(&survey.candidates) {
        assert_eq!(closure.tracks, *pair);
        assert_eq!(closure.weight > 0.5, right.contains(pair), "{closure:?}");
    }
    let [a, b] = right[0].map(|track| map.problem.state.landmarks[map.landmark_of[track].unwrap()]);
    assert!((a.centre - b.centre).norm() < 0.01, "{a:?} {b:?}");
}

#[test]
fn views_of_another_object_lose_their_weight() {
    let golden = Golden::read();
    let mut survey = golden.survey();
    let plain = surveyed(&survey, &golden.params()).unwrap();
    survey.drives[0].tracks[0].views[1].corners_px.iter_mut().for_each(|p| p.x += 90.0);
    let map = surveyed(&survey, &golden.params()).unwrap();
    let views = map.problem.factors.iter().zip(map.problem.weights());
    let weights: Vec<f64> =
        views.filter(|(f, _)| matches!(f, Factor::View(v) if v.landmark == 0)).map(|(_, w)| w).collect();
    assert!(weights[1] < 0.2 && weights.iter().filter(|w| **w > 0.9).count() >= 2, "{weights:?}");
    let moved = map.problem.state.landmarks[0].centre - plain.problem.state.landmarks[0].centre;
    assert!(moved.norm() < 0.1, "{moved}");
}

/// The same drive twice, the second in a frame of its own: it is laid on the first.
#[test]
fn a_second_drive_is_laid_on_the_first() {
    let golden = Golden::read();
    let mut survey = golden.survey();
    let tracks = survey.drives[0].tracks.len();
    let (walls, mut second) = (survey.same_wall.len(), survey.drives[0].clone());
    // Its walls are known by no number of the first.
    second.lines.iter_mut().for_each(|line| line.wall += walls);
    second.tracks.iter_mut().for_each(|track| track.wall = track.wall.map(|wall| wall + walls));
    survey.same_wall = (0..2 * walls).collect();
    survey.drives.push(second);
    survey.candidates = (0..tracks).map(|track| [track, tracks + track]).collect();
    let map = surveyed(&survey, &golden.params()).unwrap();
    assert!(map.closures.iter().all(|c| c.weight > 0.9), "{:?}", map.closures);
    let poses = &map.problem.state.keyframes;
    let between: Pose2 = poses[20].between(&poses[map.first_keyframe[1] + 20]);
    assert!(between.position().norm() < 0.02 && between.theta_rad.abs() < 0.01, "{between:?}");
}

/// Drive 2 on the summary of drive 1, beside both drives at once.
#[test]
fn a_summary_stands_for_its_drive() {
    let golden = Golden::read();
    let (first, params) = (golden.survey(), golden.params());
    let tracks = first.drives[0].tracks.len();
    let mut second = first.clone();
    // Other noise, and a frame of its own.
    second.start = Pose2::default();
    for (i, track) in second.drives[0].tracks.iter_mut().enumerate() {
        for (k, view) in track.views.iter_mut().enumerate() {
            let shift = if (i + k) % 2 == 0 { 0.4 } else { -0.4 };
            view.corners_px.iter_mut().for_each(|p| p.x += shift);
        }
    }
    let mut both = first.clone();
    both.drives.push(second.drives[0].clone());
    both.candidates = (0..tracks).map(|track| [track, tracks + track]).collect();
    let batch = surveyed(&both, &params).unwrap();
    let alone = surveyed(&first, &params).unwrap();
    let all: Vec<usize> = (0..tracks).collect();
    let known = KnownMap::of(&alone, &all).unwrap();
    let same: Vec<[usize; 2]> = all.iter().map(|track| [*track, *track]).collect();
    let later = refined(&second, &known, &same, &params).unwrap();
    assert!(later.closures.iter().all(|closure| closure.weight > 0.9), "{:?}", later.closures);
    let sigma = |map: &SurveyMap, landmark| {
        let of = Variable::Landmark(landmark);
        let block = Marginals::of(&map.problem, &[of]).unwrap().block(of, of).unwrap();
        (block[(0, 0)] + block[(1, 1)]).sqrt()
    };
    for track in 0..tracks {
        let (a, b) = (batch.landmark_of[tracks + track].unwrap(), later.landmark_of[track].unwrap());
        let (one, two) = (&batch.problem.state.landmarks[a], &later.problem.state.landmarks[b]);
        let (apart, sigma_batch) = ((one.centre - two.centre).xy().norm(), sigma(&batch, a));
        assert!(apart < (0.2 * sigma_batch).max(0.002), "{track}: {apart} of {sigma_batch}");
        let ratio = sigma(&later, b) / sigma_batch;
        assert!((0.9..1.1).contains(&ratio), "{track}: {ratio}");
        // The second drive says something that the first did not.
        let before = alone.landmark_of[track].unwrap();
        assert!(sigma(&later, b) < 0.98 * sigma(&alone, before), "{track}");
    }
}
