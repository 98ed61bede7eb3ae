//! Why settings cannot be used.

use std::borrow::Cow;

/// Why the settings cannot be used. The text names the setting.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    /// The file, a variable or their types are wrong.
    #[error("the settings cannot be read: {0}")]
    Read(#[source] Box<figment::Error>),
    /// A setting has a value that cannot be.
    #[error("setting `{field}`: {reason}")]
    Invalid {
        /// Name of the setting.
        field: Cow<'static, str>,
        /// What is wrong with it.
        reason: String,
    },
    /// A listener would be reachable from other machines without encryption.
    #[error(
        "setting `{field}` = {value} is reachable from other machines in plain text; use encryption (docs/guides/deploy.md) \
         or a loopback address, or give --insecure if the network itself is trusted"
    )]
    NotLoopback {
        /// Name of the setting.
        field: &'static str,
        /// Its value.
        value: String,
    },
}
