//! The cookie of a session of the page. In: the headers of a request. Out: its value, and the
//! header that sets it.

use axum::http::{HeaderMap, HeaderValue, header};
use protos::credentials;

/// Begins the name of the cookie; the port follows: a browser keeps cookies of all servers of a
/// host in one place.
const COOKIE: &str = "waymark_session_";

/// Name of the cookie on this host and port.
fn cookie_name(headers: &HeaderMap) -> String {
    let host = headers.get(header::HOST).and_then(|host| host.to_str().ok()).unwrap_or_default();
    let port = host.rsplit_once(':').map_or("", |(_, port)| port);
    // `[::1]` without a port ends in no number.
    let port = if port.bytes().all(|b| b.is_ascii_digit()) { port } else { "" };
    format!("{COOKIE}{port}")
}

/// Sets the cookie; an age of 0 removes it. One that was set over an encrypted connection is sent
/// over such ones alone.
pub(super) fn set_cookie(
    headers: &HeaderMap,
    is_encrypted: bool,
    value: &str,
    max_age_s: u64,
) -> HeaderValue {
    let (name, secure) = (cookie_name(headers), if is_encrypted { "; Secure" } else { "" });
    let text = format!("{name}={value}; HttpOnly; SameSite=Strict; Path=/; Max-Age={max_age_s}{secure}");
    // Digits, and the alphabet of base64url.
    HeaderValue::from_str(&text).unwrap_or(HeaderValue::from_static(""))
}

/// The value of the session's cookie.
pub(super) fn session_cookie(headers: &HeaderMap) -> Option<&str> {
    let name = cookie_name(headers);
    let mut lines = headers.get_all(header::COOKIE).iter().filter_map(|value| value.to_str().ok());
    lines.find_map(|line| credentials::cookie(line, &name))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cookie_belongs_to_a_port() {
        let headers = |host: &str| {
            let mut headers = HeaderMap::new();
            headers.insert(header::HOST, host.parse().unwrap());
            let pairs = "waymark_session_80=a; waymark_session_=b;waymark_session_81=c";
            headers.insert(header::COOKIE, pairs.parse().unwrap());
            headers
        };
        for (host, value) in [
            ("x:80", Some("a")),
            ("localhost", Some("b")),
            ("[::1]:81", Some("c")),
            ("[::1]", Some("b")),
            ("x:82", None),
        ] {
            assert_eq!(session_cookie(&headers(host)), value, "{host}");
        }
        let set = set_cookie(&headers("x:80"), false, "v", 5);
        assert_eq!(set, "waymark_session_80=v; HttpOnly; SameSite=Strict; Path=/; Max-Age=5");
        let set = set_cookie(&headers("x:80"), true, "v", 5);
        assert_eq!(set, "waymark_session_80=v; HttpOnly; SameSite=Strict; Path=/; Max-Age=5; Secure");
    }
}
