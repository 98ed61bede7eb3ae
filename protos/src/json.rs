//! Enumerations of the wire as lower-case words in JSON (`"matched"`, `"three_sided"`), as in the
//! HTTP API.

use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// One module per enumeration, for `#[serde(with = ...)]`; the prefix is what Protocol Buffers puts
/// before a value.
macro_rules! word {
    ($module:ident, $type:path, $prefix:literal, $doc:literal) => {
        #[doc = $doc]
        pub mod $module {
            use super::{Deserialize, Deserializer, Error, Serializer};
            use $type as Wire;

            /// The word of a wire value; an unknown number counts as unspecified.
            pub fn word(value: i32) -> String {
                let name = Wire::try_from(value).unwrap_or_default().as_str_name();
                name.strip_prefix($prefix).unwrap_or(name).to_lowercase()
            }

            /// Writes the word.
            pub fn serialize<S: Serializer>(value: &i32, to: S) -> Result<S::Ok, S::Error> {
                to.serialize_str(&word(*value))
            }

            /// Reads the word; refuses others.
            pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<i32, D::Error> {
                let text = String::deserialize(from)?;
                let name = format!("{}{}", $prefix, text.to_uppercase());
                let value = Wire::from_str_name(&name);
                value.map(i32::from).ok_or_else(|| D::Error::custom(format!("unknown word {text:?}")))
            }
        }
    };
}

word!(status, crate::v1::Status, "STATUS_", "Words of [`crate::v1::Status`].");
word!(quad_kind, crate::v1::QuadKind, "QUAD_KIND_", "Words of [`crate::v1::QuadKind`].");
word!(verdict, crate::v1::Verdict, "VERDICT_", "Words of [`crate::v1::Verdict`].");
word!(sighting, crate::v1::Sighting, "SIGHTING_", "Words of [`crate::v1::Sighting`].");
word!(pose_trust, crate::v1::PoseTrust, "POSE_TRUST_", "Words of [`crate::v1::PoseTrust`].");
word!(fix_quantity, crate::v1::FixQuantity, "FIX_QUANTITY_", "Words of [`crate::v1::FixQuantity`].");
word!(part, crate::v1::PartAgreement, "PART_AGREEMENT_", "Words of [`crate::v1::PartAgreement`].");

/// A list of words of [`crate::v1::PartAgreement`].
pub mod part_agreement {
    use super::{Deserialize, Deserializer, Serialize, Serializer, part};

    #[derive(Serialize, Deserialize)]
    struct Part(#[serde(with = "part")] i32);

    /// Writes the words.
    pub fn serialize<S: Serializer>(values: &[i32], to: S) -> Result<S::Ok, S::Error> {
        to.collect_seq(values.iter().map(|value| Part(*value)))
    }

    /// Reads the words; refuses others.
    pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<i32>, D::Error> {
        Ok(Vec::<Part>::deserialize(from)?.into_iter().map(|part| part.0).collect())
    }
}

#[cfg(test)]
mod tests {
    use crate::v1::{
        Answer, PartAgreement, PointEvidence, PoseTrust, QuadAnswer, QuadKind, RobotPose, Sighting, Status,
        Verdict,
    };

    #[test]
    fn an_answer_reads_and_comes_back() {
        let quad = QuadAnswer {
            kind: QuadKind::ThreeSided.into(),
            verdict: Verdict::Unique.into(),
            landmark: "door-3".into(),
            ..QuadAnswer::default()
        };
        let answer =
            Answer { seq: 7, status: Status::NoMatch.into(), quads: vec![quad], ..Answer::default() };
        let text = serde_json::to_string(&answer).unwrap();
        assert!(text.contains(r#""status":"no_match""#), "{text}");
        assert!(text.contains(r#""kind":"three_sided""#), "{text}");
        assert_eq!(serde_json::from_str::<Answer>(&text).unwrap(), answer);
    }

    #[test]
    fn parts_are_words() {
        let agreement =
            vec![PartAgreement::Silent.into(), PartAgreement::Disagrees.into(), PartAgreement::Agrees.into()];
        let points = PointEvidence { inliers: 9, agreement, ..PointEvidence::default() };
        let quad = QuadAnswer { points: Some(points), ..QuadAnswer::default() };
        let text = serde_json::to_string(&quad).unwrap();
        assert!(text.contains(r#""agreement":["silent","disagrees","agrees"]"#), "{text}");
        assert_eq!(serde_json::from_str::<QuadAnswer>(&text).unwrap(), quad);
        assert!(serde_json::from_str::<PointEvidence>(r#"{"agreement":["perhaps"]}"#).is_err());
    }

    /// What a server sends that knows nothing of points.
    #[test]
    fn a_quad_without_points_reads() {
        let quad: QuadAnswer = serde_json::from_str(r#"{"verdict":"unique","landmark":"door-3"}"#).unwrap();
        assert_eq!((quad.points, quad.doubtful_landmark.as_str()), (None, ""));
    }

    #[test]
    /// What a server sends that knows nothing of guided recognition.
    fn a_quad_without_its_sighting_reads() {
        let quad: QuadAnswer = serde_json::from_str(r#"{"verdict":"unique","landmark":"door-3"}"#).unwrap();
        assert_eq!((quad.sighting(), quad.guided_landmark.as_str()), (Sighting::Unspecified, ""));
        let pose: RobotPose = serde_json::from_str(r#"{"map":"hall","trust":"contradicted"}"#).unwrap();
        assert_eq!(pose.trust(), PoseTrust::Contradicted);
    }

    #[test]
    fn an_unknown_word_is_refused() {
        assert!(serde_json::from_str::<Answer>(r#"{"status":"perhaps"}"#).is_err());
    }
}
