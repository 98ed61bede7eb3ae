//! Errors as `application/problem+json` (RFC 9457).

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

/// An error as sent.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Problem {
    /// `/problems/{code}`.
    #[serde(rename = "type")]
    pub kind: String,
    /// The status in words.
    pub title: String,
    /// The HTTP status.
    pub status: u16,
    /// Stable name of the error, for programs.
    pub code: String,
    /// The input at fault: a path into the JSON body, a part of the form, a parameter.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub field: Option<String>,
    /// A sentence for a person.
    pub detail: String,
    /// More, by code: `quads` with `quad_not_found` and `quad_ambiguous`; `may_be_done` (true) with
    /// `timeout` and `not_published`, if the change that was asked for may have been made; `part`
    /// with `part_ended`; `stored` and `given` with `size_differs`.
    #[serde(flatten)]
    pub more: Map<String, Value>,
}
