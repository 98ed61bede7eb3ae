//! Operations of the API: method and path with the client's method for them. In: a path with names
//! in braces and the values for them. Out: the path as it is sent, percent-encoded.

use crate::ClientError;
use protos::Name;
use reqwest::Method;
use serde::Serialize;
use serde_json::Value;
use std::fmt::Display;

/// An operation of the API and the method of [`crate::MapClient`] that asks for it.
#[derive(Debug, Clone)]
pub struct Operation {
    /// `GET`, `POST`, `PUT`, `PATCH` or `DELETE`.
    pub method: Method,
    /// Path below `/api/v1`, with its parameters in braces, as in the OpenAPI document.
    pub path: &'static str,
    /// Name of the client's method.
    pub call: &'static str,
}

/// Operations that create, and take a key.
const CREATIONS: [&str; 13] = [
    "/maps/{map}/bulk/create-landmarks",
    "/maps",
    "/maps/{map}/copies",
    "/maps/{map}/drafts",
    "/bundles",
    "/maps/{map}/landmarks",
    "/maps/{map}/landmarks/{landmark}/views",
    "/maps/{map}/landmarks/{landmark}/learn",
    "/maps/{map}/learn",
    "/maps/{map}/gatherings",
    "/maps/{map}/gatherings/{gathering}/accept",
    "/robots/{robot}/recording/reference",
    "/robots/{robot}/certificates",
];

/// Paths of what has a revision: their changes say which one they are meant for.
const REVISED: [&str; 10] = [
    "/maps/{map}",
    "/maps/{map}/walls",
    "/maps/{map}/underlay",
    "/maps/{map}/visibility-settings",
    "/maps/{map}/modalities",
    "/maps/{map}/landmarks/{landmark}",
    "/maps/{map}/landmarks/{landmark}/merge",
    "/maps/{map}/rollback",
    "/maps/{map}/commits/{commit}/undo",
    "/maps/{map}/drafts/{draft}/publish",
];

impl Operation {
    /// Whether it asks for an `If-Match`: the client sends `*` unless
    /// [`crate::MapClient::if_match`] says another.
    pub fn takes_revision(&self) -> bool {
        REVISED.contains(&self.path) && self.method != Method::GET
    }

    /// Whether it creates and takes an `Idempotency-Key`: the client sends a fresh one each time.
    pub fn takes_key(&self) -> bool {
        self.method == Method::POST && CREATIONS.contains(&self.path)
    }
}

/// Declares the operations of a file, and their list. A call that is no method of
/// [`crate::MapClient`] does not compile.
macro_rules! operations {
    ($($name:ident: $method:ident $path:literal => $call:ident),+ $(,)?) => {
        $(const $name: $crate::http::operation::Operation = $crate::http::operation::Operation {
            method: ::reqwest::Method::$method,
            path: $path,
            call: stringify!($call),
        };)+
        /// The operations of this file.
        pub(super) const OPERATIONS: &[$crate::http::operation::Operation] = &[$($name),+];
        const _: () = {
            $(let _ = $crate::MapClient::$call;)+
        };
    };
}
pub(super) use operations;

/// A value of a path.
pub(super) type PathValue<'a> = &'a (dyn Display + Sync);

/// The path with these values in its braces, in order.
pub(super) fn path_of(path: &'static str, at: &[PathValue<'_>]) -> Result<String, ClientError> {
    let mut values = at.iter();
    let mut made = String::new();
    for segment in path.split('/').skip(1) {
        made.push('/');
        match segment.strip_prefix('{').and_then(|s| s.strip_suffix('}')) {
            None => made.push_str(segment),
            Some(field) => {
                let text = values.next().map(ToString::to_string).unwrap_or_default();
                // Not a segment of a path, or one that URLs take for another path.
                if matches!(text.as_str(), "" | "." | "..")
                    && let Err(error) = Name::new(text.as_str())
                {
                    return Err(ClientError::Name { field, text, error });
                }
                made.push_str(&escaped(&text));
            }
        }
    }
    debug_assert!(values.next().is_none(), "too many values for {path}");
    Ok(made)
}

/// The fields of an object as a query; those that are null are left out. Empty if nothing is left.
pub(super) fn query_of(fields: &impl Serialize) -> String {
    let Ok(Value::Object(fields)) = serde_json::to_value(fields) else { return String::new() };
    let pair = |(name, value)| {
        let text = match value {
            Value::Null => return None,
            Value::String(text) => text,
            other => other.to_string(),
        };
        Some(format!("{name}={}", escaped(&text)))
    };
    let pairs: Vec<String> = fields.into_iter().filter_map(pair).collect();
    if pairs.is_empty() { String::new() } else { format!("?{}", pairs.join("&")) }
}

/// Percent-encodes all but unreserved characters (RFC 3986).
pub(super) fn escaped(text: &str) -> String {
    let plain = |b: u8| b.is_ascii_alphanumeric() || b"-_.~".contains(&b);
    text.bytes().map(|b| if plain(b) { char::from(b).to_string() } else { format!("%{b:02X}") }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use protos::api::{PageQuery, VisibilitySettingsBody};

    #[test]
    fn values_of_a_path_are_escaped_and_stay_in_their_segment() {
        let path = "/maps/{map}/landmarks/{landmark}/views/{view}";
        assert_eq!(
            path_of(path, &[&"hall", &"a/b?#é", &3]).unwrap(),
            "/maps/hall/landmarks/a%2Fb%3F%23%C3%A9/views/3"
        );
        for other in ["", ".", ".."] {
            let error = path_of(path, &[&"hall", &other, &3]).unwrap_err();
            assert!(matches!(&error, ClientError::Name { field: "landmark", .. }), "{error}");
        }
    }

    #[test]
    fn queries_are_escaped_and_leave_out_what_is_absent() {
        let page = PageQuery { limit: Some(2), cursor: Some("a-1/é&=".into()) };
        assert_eq!(query_of(&page), "?cursor=a-1%2F%C3%A9%26%3D&limit=2");
        assert_eq!(query_of(&PageQuery::default()), "");
        let settings =
            VisibilitySettingsBody { tilt_low_rad: Some(-0.25), ..VisibilitySettingsBody::default() };
        assert_eq!(query_of(&settings), "?tilt_low_rad=-0.25");
    }
}
