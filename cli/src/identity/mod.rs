//! Who asks: `waymark login`, `waymark logout`, `waymark open`, `waymark token`, and the
//! credentials that the other commands use.

pub(crate) mod credentials;
pub(crate) mod login;
pub(crate) mod open;
mod prompt;
pub(crate) mod token;

use serde::Deserialize;
use std::{convert::Infallible, fmt, str::FromStr};

/// The text of a token, not shown.
#[derive(Clone, PartialEq, Eq, Deserialize)]
#[serde(transparent)]
pub(crate) struct TokenArg(pub(crate) String);

impl FromStr for TokenArg {
    type Err = Infallible;

    fn from_str(text: &str) -> Result<Self, Infallible> {
        Ok(Self(text.trim().to_owned()))
    }
}

impl fmt::Debug for TokenArg {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("…")
    }
}
