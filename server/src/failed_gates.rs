//! Failed quality gates in words. In: the gates that a model failed, as learning gives or the store
//! holds them. Out: one sentence and one advice for each reason, each reason once.

use protos::api::{FailedGate, GateBody, LookAlikeBody};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::BTreeMap;
use vision::model::{Gate, GateFailure, LandmarkId, SeenFrom, ThresholdError};

/// A look-alike as it is stored. Its name is that of the time of learning; the number is what
/// holds.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct StoredLookAlike {
    id: u64,
    landmark: String,
    gradient_similarity: f64,
}

impl StoredLookAlike {
    pub(crate) fn new(id: LandmarkId, name: &str, gradient_similarity: f64) -> Self {
        Self { id: id.0, landmark: name.to_owned(), gradient_similarity }
    }

    /// With the present name; `None` if that landmark is gone.
    pub(crate) fn shown(self, name_of: impl Fn(LandmarkId) -> Option<String>) -> Option<LookAlikeBody> {
        let landmark = name_of(LandmarkId(self.id))?;
        Some(LookAlikeBody { landmark, gradient_similarity: self.gradient_similarity })
    }
}

/// A stored text with the numbers that landmarks have in another map: of a refusal, or of facts
/// that name look-alikes. A landmark that is not among them is gone there: it gets 0, which is the
/// number of none.
pub(crate) fn renumbered(text: &str, numbers: &BTreeMap<LandmarkId, LandmarkId>) -> String {
    let Ok(mut value) = serde_json::from_str::<Value>(text) else { return text.to_owned() };
    let mut changed = false;
    let mut change = |of: &mut Value| {
        if let Some(id) = of.get_mut("id")
            && let Some(old) = id.as_u64()
        {
            *id = numbers.get(&LandmarkId(old)).map_or(0, |new| new.0).into();
            changed = true;
        }
    };
    change(&mut value);
    value.get_mut("look_alikes").and_then(Value::as_array_mut).into_iter().flatten().for_each(change);
    // A text without numbers stays as it is, byte for byte.
    if changed { value.to_string() } else { text.to_owned() }
}

/// A failed gate as it is stored.
#[derive(Debug, Serialize, Deserialize)]
struct StoredFailure {
    gate: Gate,
    value: f64,
    limit: f64,
}

/// Failed gates as JSON for the store.
pub(crate) fn stored(failures: &[GateFailure]) -> String {
    let stored = |f: &GateFailure| StoredFailure { gate: f.gate, value: f.value, limit: f.limit };
    serde_json::to_string(&failures.iter().map(stored).collect::<Vec<_>>()).unwrap_or_default()
}

/// Reads [`stored`]; what is not readable is left out.
pub(crate) fn from_stored(reasons: &str) -> Vec<GateFailure> {
    let read: Vec<Value> = serde_json::from_str(reasons).unwrap_or_default();
    let failure = |value| {
        let StoredFailure { gate, value, limit } = serde_json::from_value(value).ok()?;
        Some(GateFailure { gate, value, limit })
    };
    read.into_iter().filter_map(failure).collect()
}

/// Why a landmark is refused.
#[derive(Debug)]
pub(crate) enum Refusal {
    /// It looks like this one, which is in use.
    LooksLike(LookAlikeBody),
    /// The one that it looked like is gone.
    OtherIsGone,
}

/// What is known besides the gates.
#[derive(Debug, Default)]
pub(crate) struct Evidence {
    /// The landmark that is most like it.
    pub(crate) look_alike: Option<LookAlikeBody>,
    /// It is refused, whatever its gates say.
    pub(crate) refusal: Option<Refusal>,
    /// Least and greatest angle between its normal and the directions that it was seen from, rad.
    pub(crate) angle_rad: Option<[f64; 2]>,
}

/// The gates in words, each reason once.
pub(crate) fn in_words(failures: &[GateFailure], about: &Evidence) -> Vec<FailedGate> {
    let mut made: Vec<FailedGate> = about.refusal.iter().map(refused).collect();
    // A refused landmark has no threshold for the same reason.
    let is_refused = !made.is_empty();
    for failure in failures.iter().filter(|f| !(is_refused && is_threshold(f.gate))) {
        let failed = of_failure(failure, about);
        if made.iter().all(|m| m.gate != failed.gate) {
            made.push(failed);
        }
    }
    made
}

fn is_threshold(gate: Gate) -> bool {
    matches!(gate, Gate::CorrelationThreshold(_) | Gate::HausdorffThreshold(_) | Gate::LikenessThreshold(_))
}

fn of_failure(failure: &GateFailure, about: &Evidence) -> FailedGate {
    let GateFailure { gate, value, limit } = failure;
    match gate {
        Gate::Views => failed(
            GateBody::Views,
            format!("It has {value:.0} views; {limit:.0} are needed."),
            "Add photographs, or have views generated from them.",
        ),
        Gate::Saliency => failed(
            GateBody::Saliency,
            "It is nearly blank, or its photographs do not show the same thing.",
            "Check the corners of its views, or choose something with a richer picture.",
        ),
        Gate::StablePoints => failed(
            GateBody::StablePoints,
            "Too few of its details are found again in all views.",
            "Photograph it sharper and from nearer.",
        ),
        Gate::Content => failed(
            GateBody::Content,
            "Inside its frame there is so little that a blank board would look the same.",
            "Choose something with a picture on it.",
        ),
        Gate::VisibilityConfidence(from) => seen_from_one_side(*from, about.angle_rad),
        Gate::CorrelationThreshold(error)
        | Gate::HausdorffThreshold(error)
        | Gate::LikenessThreshold(error) => without_threshold(*error, about.look_alike.as_ref()),
    }
}

fn refused(refusal: &Refusal) -> FailedGate {
    let Refusal::LooksLike(other) = refusal else {
        let sentence = "Not in use: it looked like a landmark that is gone now.";
        return failed(GateBody::LooksLike, sentence, "Learn it again.");
    };
    let sentence = format!("Not in use: it looks like {}.", likeness(other));
    let advice = "Delete one, or photograph what differs. If they are two objects, give both a place, and learn again.";
    FailedGate { look_alike: Some(other.clone()), ..failed(GateBody::LooksLike, sentence, advice) }
}

/// 40 degrees beside a view from the front pass the gate.
fn seen_from_one_side(from: SeenFrom, angle_rad: Option<[f64; 2]>) -> FailedGate {
    let gate = GateBody::VisibilityConfidence;
    match angle_rad.map(|range| range.map(|a| a.to_degrees().round())) {
        Some([least, most]) if least < most => {
            let sentence = format!("Seen only from {least:.0}-{most:.0} degrees.");
            failed(gate, sentence, "Drive past from the other side.")
        }
        Some([only, _]) => {
            failed(gate, format!("Seen only from {only:.0} degrees."), "Drive past from the other side.")
        }
        None => {
            let (seen, missing) = match from {
                SeenFrom::Front => ("the front", "the left or the right"),
                SeenFrom::Left => ("the left", "the right"),
                SeenFrom::Right => ("the right", "the left"),
            };
            let sentence = format!("Seen from one side: all its photographs are from {seen}.");
            failed(
                gate,
                sentence,
                &format!("Photograph it from {missing}, too, about 40 degrees off its front."),
            )
        }
    }
}

fn without_threshold(error: ThresholdError, look_alike: Option<&LookAlikeBody>) -> FailedGate {
    match (error, look_alike) {
        (ThresholdError::Overlap, Some(other)) => FailedGate {
            look_alike: Some(other.clone()),
            ..failed(
                GateBody::ByPoseOnly,
                format!("Its picture alone does not name it: it looks like {}.", likeness(other)),
                "Give both a place: a robot that knows its pose tells them apart. Or delete one.",
            )
        },
        (ThresholdError::Overlap, None) => failed(
            GateBody::NotDistinct,
            "It cannot be told from other things in its photographs.",
            "Photograph it from nearer, or choose something that differs more from what is beside it.",
        ),
        _ => failed(
            GateBody::NotDistinct,
            "Its own views are too different from one another.",
            "Check the corners of its views, and delete those that show something else.",
        ),
    }
}

/// A stored model that is out of use.
pub(crate) fn stored_model(reason: &str) -> FailedGate {
    failed(GateBody::StoredModel, format!("Its stored model cannot be used: {reason}."), "Learn it again.")
}

/// Nothing to learn from.
pub(crate) fn no_views() -> FailedGate {
    failed(GateBody::Views, "None of its views can be used.", "Drive past once more.")
}

/// Tracks that look like a track, or are at its place.
pub(crate) fn similar_tracks(numbers: &[u32]) -> FailedGate {
    let numbers: Vec<String> = numbers.iter().map(ToString::to_string).collect();
    let (tracks, look) = if numbers.len() == 1 { ("Track", "looks") } else { ("Tracks", "look") };
    let verb = if numbers.len() == 1 { "is" } else { "are" };
    let sentence = format!("{tracks} {} {look} like it or {verb} at its place.", numbers.join(", "));
    let advice = "Give them one name if they are one object; else accept one of them.";
    failed(GateBody::SimilarTracks, sentence, advice)
}

/// A track that was taken for a landmark of the map in so many frames.
pub(crate) fn known_landmark(frames: u32) -> FailedGate {
    let pictures = if frames == 1 { "1 picture".to_owned() } else { format!("{frames} pictures") };
    let sentence = format!("In {pictures} it was taken for a landmark of the map, or nearly.");
    failed(GateBody::KnownLandmark, sentence, "Throw it away if it is that landmark.")
}

/// `name` (97 %).
fn likeness(other: &LookAlikeBody) -> String {
    format!("`{}` ({:.0} %)", other.landmark, 100.0 * other.gradient_similarity)
}

fn failed(gate: GateBody, sentence: impl Into<String>, advice: &str) -> FailedGate {
    FailedGate { gate, sentence: sentence.into(), advice: advice.to_owned(), look_alike: None }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn failure(gate: Gate) -> GateFailure {
        GateFailure { gate, value: 3.0, limit: 20.0 }
    }

    #[test]
    fn a_reason_is_said_once_with_the_name_of_the_look_alike() {
        let overlap = ThresholdError::Overlap;
        let all = [
            Gate::LikenessThreshold(overlap),
            Gate::CorrelationThreshold(overlap),
            Gate::HausdorffThreshold(overlap),
            Gate::Views,
        ]
        .map(failure);
        let other = LookAlikeBody { landmark: "first".into(), gradient_similarity: 0.974 };
        let about = Evidence { look_alike: Some(other.clone()), ..Evidence::default() };
        let words = in_words(&all, &about);
        assert_eq!(words.iter().map(|w| w.gate).collect::<Vec<_>>(), [GateBody::ByPoseOnly, GateBody::Views]);
        assert_eq!(words[0].sentence, "Its picture alone does not name it: it looks like `first` (97 %).");
        assert_eq!(words[0].look_alike, Some(other));
        assert_eq!(words[1].sentence, "It has 3 views; 20 are needed.");
        assert_eq!(in_words(&all, &Evidence::default())[0].gate, GateBody::NotDistinct);
        // A refusal stands for the missing thresholds.
        let refusal = about.look_alike.map(Refusal::LooksLike);
        let refused = in_words(&all, &Evidence { refusal, ..Evidence::default() });
        assert_eq!(
            refused.iter().map(|w| w.gate).collect::<Vec<_>>(),
            [GateBody::LooksLike, GateBody::Views]
        );
        assert_eq!(refused[0].sentence, "Not in use: it looks like `first` (97 %).");
        let refusal = Some(Refusal::OtherIsGone);
        let gone = in_words(&[], &Evidence { refusal, ..Evidence::default() });
        assert_eq!((gone[0].gate, gone[0].advice.as_str()), (GateBody::LooksLike, "Learn it again."));
    }

    #[test]
    fn views_from_one_side_are_told_with_their_angles() {
        let words = |angle_rad| {
            let about = Evidence { angle_rad, ..Evidence::default() };
            in_words(&[failure(Gate::VisibilityConfidence(SeenFrom::Front))], &about)[0].to_string()
        };
        let range = [62.2_f64, 63.6].map(f64::to_radians);
        assert_eq!(words(Some(range)), "Seen only from 62-64 degrees. Drive past from the other side.");
        assert!(words(Some([range[0]; 2])).starts_with("Seen only from 62 degrees."));
        let without_angles = [
            (SeenFrom::Front, "from the front. Photograph it from the left or the right, too, about 40"),
            (SeenFrom::Left, "from the left. Photograph it from the right, too, about 40"),
            (SeenFrom::Right, "from the right. Photograph it from the left, too, about 40"),
        ];
        for (from, missing) in without_angles {
            let failure = failure(Gate::VisibilityConfidence(from));
            let said = in_words(&[failure], &Evidence::default())[0].to_string();
            assert_eq!(
                said,
                format!("Seen from one side: all its photographs are {missing} degrees off its front.")
            );
        }
    }

    #[test]
    fn gates_are_stored_and_read() {
        let all =
            [Gate::VisibilityConfidence(SeenFrom::Left), Gate::LikenessThreshold(ThresholdError::Overlap)];
        let all = all.map(failure);
        assert_eq!(from_stored(&stored(&all)), all);
        let unknown = stored(&all).replace("visibility_confidence", "unheard_of");
        assert_eq!(from_stored(&unknown), all[1..]);
    }

    #[test]
    fn a_look_alike_has_the_present_name_of_its_number() {
        let stored = StoredLookAlike::new(LandmarkId(7), "first", 0.97);
        let renamed = |id: LandmarkId| (id.0 == 7).then(|| "second".to_owned());
        assert_eq!(stored.clone().shown(renamed).unwrap().landmark, "second");
        assert_eq!(stored.shown(|_| None), None, "it is gone");
    }
}
