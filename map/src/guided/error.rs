//! Why guided recognition refuses its input.

use crate::check::OutOfRange;

/// An input of guided recognition was refused.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum GuidedError {
    /// A number is out of range.
    #[error(transparent)]
    OutOfRange(#[from] OutOfRange),
    /// A list is longer than its limit.
    #[error("{field} has {count} entries, at most {limit} are accepted")]
    TooMany {
        /// Name of the list.
        field: &'static str,
        /// Number of its entries.
        count: usize,
        /// Largest accepted number.
        limit: usize,
    },
}
