//! What a panic said.

use std::any::Any;

/// The message of a panic.
pub(crate) fn panic_text(cause: &(dyn Any + Send)) -> &str {
    let literal = cause.downcast_ref::<&'static str>().copied();
    literal.or_else(|| cause.downcast_ref::<String>().map(String::as_str)).unwrap_or("no message")
}
