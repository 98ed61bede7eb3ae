//! Which answers are worth storing, and what they rest on: the icons of their quads, matched
//! points, the prior pose. In: the answers of the workers. Out: some of them, queued for whoever
//! stores them: of each camera the first of every kind and one in [`LONGEST`], at most one in
//! [`SHORTEST`].

use super::{
    kept_frames::{KeptFrame, KeptFrames},
    prior_check::{PriorCheck, prior_check},
};
use crate::{
    frame::{
        analysis::{AnalysedFrame, FoundQuad, found_quads},
        slots::SlotKey,
        workers::{AnsweredFrame, FrameObserver},
    },
    snapshot::MapSnapshot,
};
use protos::{CheckedFrame, v1};
use std::{
    collections::BTreeMap,
    sync::{Arc, Mutex, PoisonError},
    time::{Duration, Instant},
};
use tokio::sync::mpsc::{Receiver, Sender, channel, error::TrySendError};
use vision::{
    frame::GrayImage,
    geometry::Corners,
    icon::icon,
    model::LandmarkId,
    points::shown_matches::{ShownMatch, shown_matches},
};

/// Answers that wait to be stored. More are dropped.
pub const QUEUE: usize = 64;
/// Quads of one answer whose icons are stored, the detector's best first.
pub const MAX_ICONS: usize = 8;
/// Matches of a quad with a landmark that are stored, those that agree first.
pub const MAX_MATCHES: usize = 100;
/// Least time between two stored answers of a camera.
pub const SHORTEST: Duration = Duration::from_secs(1);
/// An answer of the same kind as the stored one before is stored after this time.
pub const LONGEST: Duration = Duration::from_secs(10);
/// Cameras that are remembered; a further one replaces the one with the oldest stored answer.
pub const MAX_CAMERAS: usize = 2048;

/// Points of a quad that are like points of a landmark.
#[derive(Debug, Clone, PartialEq)]
pub struct QuadMatches {
    /// Name of the landmark: the one that is named, else the nearest candidate.
    pub landmark: String,
    /// At most [`MAX_MATCHES`].
    pub matches: Vec<ShownMatch>,
}

/// The icon of a quad.
#[derive(Debug, Clone, PartialEq)]
pub struct QuadIcon {
    /// Index of the quad in the answer.
    pub quad: usize,
    /// Side, in icon pixels.
    pub size: usize,
    /// Row-major grey levels; row 0 is the top.
    pub pixels: Vec<u8>,
    /// Its matches with the best candidate; `None` without a candidate that has points.
    pub matched: Option<QuadMatches>,
}

/// What an answer rests on.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct AnswerBasis {
    /// The icons of its quads, by index; those too small or outside of the frame have none.
    pub icons: Vec<QuadIcon>,
    /// The pose that was known without the frame, against that by the frame.
    pub prior_check: Option<PriorCheck>,
}

/// An answer to be stored.
#[derive(Debug, Clone)]
pub struct AnswerRecord {
    /// Robot and camera.
    pub key: SlotKey,
    /// What was answered.
    pub answer: Arc<v1::Answer>,
    /// What it rests on.
    pub basis: AnswerBasis,
}

/// What tells answers of one camera apart: status, names, and the reason of a refusal.
#[derive(Debug, Clone, PartialEq, Eq)]
struct AnswerKind {
    map: String,
    status: i32,
    names: Vec<String>,
    refusal: Option<String>,
}

/// Takes answers from workers, and keeps the frames of those that are stored. Never waits.
#[derive(Debug)]
pub struct AnswerRecorder {
    records: Sender<AnswerRecord>,
    last: Mutex<BTreeMap<SlotKey, (Instant, AnswerKind)>>,
    kept: Arc<KeptFrames>,
}

/// A queue of answers: both ends.
pub fn answer_records(kept: Arc<KeptFrames>) -> (AnswerRecorder, Receiver<AnswerRecord>) {
    let (records, receiver) = channel(QUEUE);
    (AnswerRecorder { records, last: Mutex::default(), kept }, receiver)
}

/// Why a frame gave no pose of the robot: the code of a rejection, the refusal of the pose, or
/// where no landmark was named the gate that refused the nearest candidate. `None` where there is a
/// pose, or nothing to refuse.
pub fn refusal_of(answer: &v1::Answer) -> Option<&str> {
    if let Some(rejection) = &answer.rejection {
        return Some(&rejection.code);
    }
    if answer.map_from_robot.is_some() {
        return None;
    }
    let candidates = answer.quads.iter().flat_map(|quad| &quad.candidates);
    let ratio = |c: &&v1::Candidate| c.ratio.unwrap_or(f64::INFINITY);
    let refused = candidates.filter(|c| !c.refusal.is_empty());
    let nearest = refused.min_by(|a, b| ratio(a).total_cmp(&ratio(b)));
    let is_named = answer.status() == v1::Status::Matched;
    let of_candidate = nearest.filter(|_| !is_named).map(|c| c.refusal.as_str());
    of_candidate.or(Some(answer.pose_refusal.as_str())).filter(|code| !code.is_empty())
}

/// The landmarks that an answer names, globally or guided, each once and sorted.
pub fn named_landmarks(answer: &v1::Answer) -> Vec<&str> {
    let names = answer.quads.iter().flat_map(|quad| [quad.landmark.as_str(), quad.guided_landmark.as_str()]);
    let mut names: Vec<&str> = names.filter(|name| !name.is_empty()).collect();
    names.sort_unstable();
    names.dedup();
    names
}

impl FrameObserver for AnswerRecorder {
    fn answered(&self, answered: &AnsweredFrame<'_>) {
        let AnsweredFrame { key, frame, analysed, answer } = *answered;
        if !self.is_due(key, answer, Instant::now()) {
            return;
        }
        if let Some(found) = analysed {
            self.kept.keep(KeptFrame { key: key.clone(), map: found.map.name.clone(), frame: frame.clone() });
        }
        let basis = analysed.map(|found| answer_basis(found, frame)).unwrap_or_default();
        self.send(AnswerRecord { key: key.clone(), answer: answer.clone(), basis });
    }
}

impl AnswerRecorder {
    fn is_due(&self, key: &SlotKey, answer: &v1::Answer, now: Instant) -> bool {
        let kind = AnswerKind {
            map: answer.map.clone(),
            status: answer.status,
            names: named_landmarks(answer).into_iter().map(str::to_owned).collect(),
            refusal: refusal_of(answer).map(str::to_owned),
        };
        // Every change is one insertion or removal: nothing can be left half done.
        let mut last = self.last.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((at, stored)) = last.get(key) {
            let since = now.saturating_duration_since(*at);
            if since < SHORTEST || (since < LONGEST && *stored == kind) {
                return false;
            }
        }
        last.insert(key.clone(), (now, kind));
        if last.len() > MAX_CAMERAS {
            let oldest = last.iter().min_by_key(|(_, (at, _))| *at).map(|(key, _)| key.clone());
            oldest.map(|key| last.remove(&key));
        }
        true
    }

    /// Queues an answer, or drops it if the queue is full.
    fn send(&self, record: AnswerRecord) {
        if let Err(TrySendError::Full(record)) = self.records.try_send(record) {
            tracing::debug!(key = ?record.key, seq = record.answer.seq, "answer_not_stored");
        }
    }
}

fn answer_basis(found: &AnalysedFrame, frame: &CheckedFrame) -> AnswerBasis {
    let limit = found.map.poses.localise.prior_gate;
    AnswerBasis {
        icons: quad_icons(&found_quads(&found.analysis, &found.guided), found.picture.grey(), &found.map),
        prior_check: prior_check(&found.evaluation, frame.prior.as_ref(), limit),
    }
}

/// The icons of the first quads that have one, upright as their corners say.
fn quad_icons(quads: &[FoundQuad<'_>], image: &GrayImage, map: &MapSnapshot) -> Vec<QuadIcon> {
    let of_quad = |(quad, found): (usize, &FoundQuad<'_>)| {
        let corners = found.corners_px()?;
        let icon = icon(image, &corners, &map.params.icon).ok()?;
        let pixels = icon.pixels.iter().map(|grey| grey.round().clamp(0.0, 255.0) as u8).collect();
        let matched = found.best_candidate().and_then(|id| quad_matches(image, &corners, map, id));
        Some(QuadIcon { quad, size: icon.size, pixels, matched })
    };
    quads.iter().enumerate().filter_map(of_quad).take(MAX_ICONS).collect()
}

fn quad_matches(
    image: &GrayImage,
    corners: &Corners,
    map: &MapSnapshot,
    id: LandmarkId,
) -> Option<QuadMatches> {
    let landmark = map.landmarks.get(&id)?.name.clone();
    let model = map.models.get(id).filter(|model| !model.points.is_empty())?;
    let matches = shown_matches(image, corners, &model.points, MAX_MATCHES);
    Some(QuadMatches { landmark, matches })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        frame::analysis::{StageTimes, analyse_frame, frame_camera},
        scene::Scene,
    };
    use protos::Name;
    use vision::{
        pipeline::{FrameAnalysis, QuadAnalysis},
        recognise::Verdict,
    };

    fn key(camera: usize) -> SlotKey {
        SlotKey { robot: Name::new("r1").unwrap(), camera: Name::new(format!("c{camera}")).unwrap() }
    }

    fn answer(status: v1::Status, landmark: &str) -> v1::Answer {
        let quad = v1::QuadAnswer { landmark: landmark.into(), ..v1::QuadAnswer::default() };
        v1::Answer { status: status.into(), quads: vec![quad], ..v1::Answer::default() }
    }

    #[test]
    fn of_each_camera_the_first_of_every_kind_and_one_in_ten_seconds_is_stored() {
        let (recorder, _queue) = answer_records(Arc::new(KeptFrames::new(0)));
        let start = Instant::now();
        let (none, door) = (answer(v1::Status::NoMatch, ""), answer(v1::Status::Matched, "door"));
        let cases = [
            (0, 0, &none, true),
            (0, 500, &door, false),
            (1, 500, &none, true),
            (0, 1000, &none, false),
            (0, 1100, &door, true),
            (0, 2100, &answer(v1::Status::Matched, "sign"), true),
            (0, 12_099, &answer(v1::Status::Matched, "sign"), false),
            (0, 12_100, &answer(v1::Status::Matched, "sign"), true),
        ];
        for (camera, ms, answer, wanted) in cases {
            let now = start + Duration::from_millis(ms);
            assert_eq!(recorder.is_due(&key(camera), answer, now), wanted, "camera {camera} at {ms} ms");
        }
    }

    #[test]
    fn cameras_and_the_queue_are_bounded() {
        let (recorder, mut queue) = answer_records(Arc::new(KeptFrames::new(0)));
        let none = answer(v1::Status::NoMatch, "");
        let start = Instant::now();
        for camera in 0..=MAX_CAMERAS {
            assert!(recorder.is_due(&key(camera), &none, start + Duration::from_millis(camera as u64)));
        }
        assert_eq!(recorder.last.lock().unwrap().len(), MAX_CAMERAS);
        assert!(recorder.is_due(&key(0), &none, start), "the oldest is forgotten");
        for seq in 0..=QUEUE as u64 {
            let answer = Arc::new(v1::Answer { seq, ..none.clone() });
            recorder.send(AnswerRecord { key: key(0), answer, basis: AnswerBasis::default() });
        }
        let stored: Vec<u64> =
            std::iter::from_fn(|| queue.try_recv().ok()).map(|record| record.answer.seq).collect();
        assert_eq!(stored, (0..QUEUE as u64).collect::<Vec<_>>());
    }

    #[test]
    fn the_reason_is_that_of_the_nearest_candidate_unless_something_says_more() {
        let candidate = |ratio, refusal: &str| v1::Candidate {
            ratio: Some(ratio),
            refusal: refusal.into(),
            ..v1::Candidate::default()
        };
        let mut said = answer(v1::Status::NoMatch, "");
        assert_eq!(refusal_of(&said), None);
        said.quads[0].candidates = vec![candidate(1.4, "hausdorff"), candidate(1.2, "correlation")];
        said.pose_refusal = "no_extrinsics".into();
        assert_eq!(refusal_of(&said), Some("correlation"));
        said.status = v1::Status::Matched.into();
        assert_eq!(refusal_of(&said), Some("no_extrinsics"));
        said.map_from_robot = Some(v1::Pose2Covariance::default());
        assert_eq!(refusal_of(&said), None);
        said.rejection = Some(v1::Rejection { code: "bad_image".into(), ..v1::Rejection::default() });
        assert_eq!(refusal_of(&said), Some("bad_image"));
    }

    #[test]
    fn a_quad_is_stored_with_its_matches_with_the_landmark_that_it_is_named_after() {
        let mut scene = Scene::new();
        let map = scene.taught();
        let (name, readings) = scene.stops(2, 1).into_iter().next().unwrap();
        let image = &readings.frame.image;
        let camera = frame_camera(None, None, &map);
        let FrameAnalysis { quads } = analyse_frame(image, camera, &map, &mut StageTimes::start());
        let is_named = |quad: &QuadAnalysis| {
            let named = FoundQuad { detected: Some(quad), guided: None }.best_candidate();
            named.is_some_and(|id| map.landmarks[&id].name == name)
        };
        let mut quad = quads.into_iter().find(is_named).unwrap();
        quad.border_px = Some(readings.frame.truth.landmark(&name).unwrap().corners_px);
        let matched = |quad: &QuadAnalysis| {
            let icons = quad_icons(&[FoundQuad { detected: Some(quad), guided: None }], image, &map);
            icons.into_iter().next().and_then(|icon| icon.matched)
        };
        let found = matched(&quad).unwrap();
        assert_eq!(found.landmark, name);
        assert!(found.matches.len() <= MAX_MATCHES, "{}", found.matches.len());
        assert!(found.matches.iter().filter(|m| m.agrees).count() >= 10, "{found:?}");
        // Without a name, the nearest candidate.
        let candidates = {
            let recognition = quad.recognition.as_mut().unwrap();
            recognition.verdict = Verdict::Unknown;
            std::mem::take(&mut recognition.candidates)
        };
        assert_eq!(matched(&quad), None);
        quad.recognition.as_mut().unwrap().candidates = candidates;
        assert_eq!(matched(&quad), Some(found));
        quad.recognition.as_mut().unwrap().candidates[0].landmark = LandmarkId(99);
        assert_eq!(matched(&quad), None);
    }
}
