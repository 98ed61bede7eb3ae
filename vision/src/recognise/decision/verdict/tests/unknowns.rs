//! Claim: the icons accept at most 1 % of pictures that are no landmark but a third of one shows
//! through them. The bound is near to what is measured, so thresholds that are a tenth too loose
//! break it.

use super::*;

/// Pictures of each kind of distance.
const PICTURES: u64 = 240;
/// The landmark's share in the grey levels of a picture.
const SHARE: f64 = 0.35;
/// Largest share of accepted pictures (false positive identification rate).
const MOST_ACCEPTED: f64 = 0.01;

/// A poster that nobody has learnt, through which a landmark shows.
fn shown_through(landmark: u64, other: u64) -> GrayImage {
    let (landmark, other) = (poster(landmark), poster(other));
    GrayImage::from_fn(other.width(), other.height(), |u, v| {
        (SHARE * f64::from(landmark.at(u, v)) + (1.0 - SHARE) * f64::from(other.at(u, v))) as u8
    })
}

#[test]
fn few_pictures_that_resemble_a_landmark_are_accepted() {
    let mut accepted = [0_usize; KINDS.len()];
    for i in 0..PICTURES {
        let image = photograph(&shown_through(1 + i % 6, 1000 + i), &oblique(), 0.8, 20.0);
        for (count, kind) in accepted.iter_mut().zip(KINDS) {
            let v = recognise(&image, &quad(oblique()), &SIX, kind, &PARAMS);
            *count += usize::from(matches!(v.verdict, Verdict::Unique(_)));
        }
    }
    let all = KINDS.len() as f64 * PICTURES as f64;
    let share = accepted.iter().sum::<usize>() as f64 / all;
    assert!(share <= MOST_ACCEPTED, "{accepted:?} of {PICTURES} each: {share}");
    // Pictures at the edge of what is accepted are among them.
    assert!(share > 0.1 * MOST_ACCEPTED, "{accepted:?} of {PICTURES} each say nothing of the thresholds");
}
