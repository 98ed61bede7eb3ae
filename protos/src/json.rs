//! Enumerations of the wire as lower-case words in JSON (`"matched"`, `"three_sided"`), the way HTTP shows them.

use serde::de::Error;
use serde::{Deserialize, Deserializer, Serializer};

/// One module per enumeration, for `#[serde(with = ...)]`; the prefix is what Protocol Buffers puts before a value.
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

#[cfg(test)]
mod tests {
    use crate::v1::{Answer, QuadAnswer, QuadKind, Status, Verdict};

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
    fn an_unknown_word_is_refused() {
        assert!(serde_json::from_str::<Answer>(r#"{"status":"perhaps"}"#).is_err());
    }
}
