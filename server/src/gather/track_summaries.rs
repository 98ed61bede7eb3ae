//! Summaries of tracks, for a person's decision. In: tracks with their views, and the walls. Out:
//! number and spread of the views, the place, the quality gates that a model of them would fail,
//! and similar tracks.

use crate::{
    failed_gates::{self, Evidence},
    store::{
        gatherings::{TrackRow, TrackView},
        landmark_placement,
    },
};
use map::segments::LaserSegment;
use protos::api::{EstimatedPlace, FailedGate, TrackSummary};
use vision::{
    learn::{TrainingView, gates::v_c, learn, unlikeness_of},
    model::{Gate, GateFailure, LandmarkId, LandmarkModel, ModelStatus},
    params::Params,
};

/// The summary of each track. It learns a model of each: not for an async thread.
pub(crate) fn track_summaries(
    tracks: &[(TrackRow, Vec<TrackView>)],
    walls: &[LaserSegment],
    params: &Params,
) -> Vec<TrackSummary> {
    let mut made: Vec<(TrackSummary, Option<LandmarkModel>)> =
        tracks.iter().map(|(track, views)| summary(track, views, walls, params)).collect();
    let rivals: Vec<Vec<u32>> = made
        .iter()
        .map(|(a, own)| {
            let others = made.iter().filter(|(b, _)| b.number != a.number);
            let rival = |(b, other): &&(TrackSummary, Option<LandmarkModel>)| {
                // The threshold that a landmark without look-alikes would have.
                let is_near = |x: &LandmarkModel, y: &LandmarkModel| {
                    unlikeness_of(x, &y.features(&params.recognise), params) < params.learn.likeness_cap
                };
                let looks_alike =
                    own.as_ref().zip(other.as_ref()).is_some_and(|(x, y)| is_near(x, y) || is_near(y, x));
                looks_alike || overlap(a, b)
            };
            others.filter(rival).map(|(b, _)| b.number).collect()
        })
        .collect();
    for ((candidate, _), rivals) in made.iter_mut().zip(rivals) {
        if !rivals.is_empty() {
            candidate.failed_gates.push(failed_gates::similar_tracks(&rivals));
            (candidate.passes, candidate.similar_tracks) = (false, rivals);
        }
    }
    made.into_iter().map(|(candidate, _)| candidate).collect()
}

fn overlap(a: &TrackSummary, b: &TrackSummary) -> bool {
    let Some((a, b)) = a.place.as_ref().zip(b.place.as_ref()) else { return false };
    let reach = |h: &EstimatedPlace| 0.5 * h.width_m.max(h.height_m);
    (a.x_m - b.x_m).hypot(a.y_m - b.y_m).hypot(a.z_m - b.z_m) < reach(a).max(reach(b))
}

fn summary(
    track: &TrackRow,
    all: &[TrackView],
    walls: &[LaserSegment],
    params: &Params,
) -> (TrackSummary, Option<LandmarkModel>) {
    let preview =
        landmark_placement::preview(all.iter().map(|v| (&v.crop.corners_px, v.capture.as_deref())), walls);
    let inconsistent = preview.as_ref().map_or(&[][..], |p| &p.inconsistent);
    let views: Vec<&TrackView> =
        all.iter().enumerate().filter(|(i, _)| !inconsistent.contains(i)).map(|(_, v)| v).collect();
    let taught: Vec<TrainingView> = views
        .iter()
        .map(|v| TrainingView {
            icon: v.crop.icon.clone(),
            corners_px: v.crop.corners_px,
            image_size_px: v.size_px,
            exact: None,
            generated: false,
        })
        .collect();
    let model = learn(LandmarkId(0), &taught, &[], params).ok();
    let sides = views.iter().map(|v| v.crop.corners_px.area_px2().sqrt());
    let (place, not_placed) = match &preview {
        Ok(preview) => (Some(estimated_place(preview)), None),
        Err(reason) => (None, Some(reason.clone())),
    };
    let mut failed = failed(model.as_ref(), place.as_ref());
    if track.landmark.is_none() && track.known > 0 {
        failed.push(failed_gates::known_landmark(track.known));
    }
    let exemplar = model.as_ref().and_then(|m| m.exemplars.first());
    let best = exemplar.and_then(|e| views.iter().find(|v| v.crop.icon.pixels == e.icon().pixels));
    let corners: Vec<_> =
        views.iter().map(|v| (*v.crop.corners_px.points(), v.size_px.map(|side| side as f64))).collect();
    let candidate = TrackSummary {
        number: track.number,
        landmark: track.landmark.clone(),
        sightings: track.sightings,
        known: track.known,
        views: views.iter().map(|v| v.id).collect(),
        inconsistent_views: inconsistent.len(),
        best_view: best.or(views.first()).map(|v| v.id),
        side_px: range(sides),
        v_c: v_c(&corners),
        place,
        not_placed,
        passes: failed.is_empty(),
        failed_gates: failed,
        similar_tracks: vec![],
    };
    (candidate, model)
}

/// The failed quality gates. The gate on the number of views is left out: a lesson generates views
/// where there are few.
fn failed(model: Option<&LandmarkModel>, place: Option<&EstimatedPlace>) -> Vec<FailedGate> {
    let Some(model) = model else { return vec![failed_gates::no_views()] };
    let failures = match &model.status {
        ModelStatus::Active => &[][..],
        ModelStatus::Candidate(failures) => failures,
    };
    // Nothing is generated yet: views of a drive from one side speak against it.
    let sides = model.waived.iter().filter(|f| matches!(f.gate, Gate::VisibilityConfidence(_)));
    let all = failures.iter().chain(sides);
    let measured: Vec<GateFailure> = all.filter(|f| f.gate != Gate::Views).copied().collect();
    let about = Evidence { angle_rad: place.map(|p| p.angle_rad), ..Evidence::default() };
    failed_gates::in_words(&measured, &about)
}

fn estimated_place(preview: &landmark_placement::PlacementPreview) -> EstimatedPlace {
    let place = &preview.place;
    EstimatedPlace {
        x_m: place.x_m,
        y_m: place.y_m,
        z_m: place.z_m,
        theta_rad: place.theta_rad,
        width_m: place.size.width_m,
        height_m: place.size.height_m,
        views: preview.angles_rad.len(),
        angle_rad: range(preview.angles_rad.iter().copied()),
    }
}

/// Least and greatest value; zeros if there is none.
fn range(values: impl Iterator<Item = f64>) -> [f64; 2] {
    values
        .fold(None, |r: Option<[f64; 2]>, v| Some(r.map_or([v, v], |[a, b]| [a.min(v), b.max(v)])))
        .unwrap_or_default()
}
