//! Where maps are stored, if not in the data directory.

use super::{ConfigError, invalid};
use std::fmt;

/// The address of a database of PostgreSQL. It is shown without its password.
#[derive(Clone, PartialEq, Eq)]
pub struct PostgresAddress(String);

impl PostgresAddress {
    /// Of the setting `store`; `None` if it is empty.
    pub fn checked(text: String) -> Result<Option<Self>, ConfigError> {
        match text.split_once("://") {
            None if text.is_empty() => Ok(None),
            Some(("postgres" | "postgresql", _)) => Ok(Some(Self(text))),
            _ => Err(invalid("store", "neither empty nor postgres://USER@HOST/NAME".to_owned())),
        }
    }

    /// As the driver reads it, with its password.
    pub(crate) fn secret(&self) -> &str {
        &self.0
    }
}

impl fmt::Display for PostgresAddress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let after = self.0.split_once("://").map_or("", |(_, after)| after);
        let after = after.split(['?', '#']).next().unwrap_or_default();
        let (authority, name) = after.split_once('/').unwrap_or((after, ""));
        let (user, host) = authority.rsplit_once('@').unwrap_or(("", authority));
        let user = user.split(':').next().unwrap_or_default();
        // In an address that is none, this could be of the password.
        let host = host
            .rsplit_once(':')
            .filter(|(_, port)| port.parse::<u16>().is_err())
            .map_or(host, |(host, _)| host);
        let name = if name.contains(['@', ':']) { "" } else { name };
        let at = if user.is_empty() { "" } else { "@" };
        write!(f, "postgres://{user}{at}{host}/{name}")
    }
}

impl fmt::Debug for PostgresAddress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{self}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_is_shown_without_its_password() {
        let shown = |text: &str| PostgresAddress::checked(text.to_owned()).unwrap().unwrap().to_string();
        for (text, expected) in [
            ("postgres://kim:secret@db:5433/maps", "postgres://kim@db:5433/maps"),
            ("postgresql://db/maps?password=secret&host=/run", "postgres://db/maps"),
            ("postgres://kim@[::1]:5432/maps", "postgres://kim@[::1]:5432/maps"),
            ("postgres://kim:sec@ret@db/maps", "postgres://kim@db/maps"),
            ("postgres:///maps", "postgres:///maps"),
        ] {
            assert_eq!(shown(text), expected);
            let debug = format!("{:?}", PostgresAddress::checked(text.to_owned()).unwrap());
            assert!(!debug.contains("secret"), "{debug}");
        }
        for none in
            ["postgres://kim:sec/ret@db/maps", "postgres://kim:sec?ret@db/maps", "postgres://kim:sec#ret@db"]
        {
            assert!(!shown(none).contains("ret") && !shown(none).contains("sec"), "{}", shown(none));
        }
        assert_eq!(PostgresAddress::checked(String::new()).unwrap(), None);
        for wrong in ["mysql://db/maps", "maps.sqlite", "postgres:db"] {
            let error = PostgresAddress::checked(wrong.to_owned()).unwrap_err().to_string();
            assert!(error.contains("`store`"), "{error}");
        }
    }
}
