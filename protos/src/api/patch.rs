//! Fields of a PATCH: absent stays, null is forgotten.

use serde::{Deserialize, Deserializer};

/// Reads a field of a PATCH: null is `Some(None)`, a value `Some(Some(value))`. Absent is `None` by
/// `serde(default)`.
#[expect(clippy::option_option, reason = "absent and null differ in a PATCH")]
pub(super) fn null_or_value<'de, D: Deserializer<'de>, T: Deserialize<'de>>(
    from: D,
) -> Result<Option<Option<T>>, D::Error> {
    Option::deserialize(from).map(Some)
}
