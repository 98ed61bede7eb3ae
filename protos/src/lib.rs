//! The wire: messages, key expressions and checked conversions.
