//! The administrator's pages, embedded in the program.

use super::{AppState, error::not_found};
use crate::store::pictures::hex;
use axum::{
    Router,
    body::Bytes,
    http::{HeaderMap, HeaderValue, Method, StatusCode, header},
    response::{IntoResponse, Response},
    routing::get,
};
use sha2::{Digest as _, Sha256};

/// Path below `/`, content, content compressed by gzip.
type File = (&'static str, &'static [u8], &'static [u8]);

/// Made by `build.rs` of `web/dist`.
static FILES: &[File] = &include!(concat!(env!("OUT_DIR"), "/pages.rs"));
const INDEX: &str = "index.html";
/// Addresses that the pages themselves understand (`web/src/routes.svelte.ts`).
const ADDRESSES: [&str; 9] = [
    "/",
    "/maps/{*rest}",
    "/robots",
    "/robots/{*rest}",
    "/answers",
    "/answers/{*rest}",
    "/admin",
    "/help",
    "/help/{*rest}",
];
/// Files with the digest of their content in their name never change.
const FOREVER: HeaderValue = HeaderValue::from_static("public, max-age=31536000, immutable");
/// A new program brings new pages: the browser asks again each time.
const ASK_AGAIN: HeaderValue = HeaderValue::from_static("no-cache");

pub(super) fn router() -> Router<AppState> {
    let mut router = Router::new();
    if let Some(index) = FILES.iter().find(|(name, ..)| *name == INDEX) {
        router = ADDRESSES.iter().fold(router, |router, address| router.route(address, served(index)));
    }
    for file in FILES.iter().filter(|(path, ..)| *path != INDEX) {
        router = router.route(&format!("/{}", file.0), served(file));
    }
    router
}

/// What is at no address: to a browser the pages, which say so; to a program the refusal.
pub(super) fn unknown(method: &Method, path: &str, asked: &HeaderMap) -> Response {
    let accepts = |kind: &str| {
        let accept = asked.get(header::ACCEPT).and_then(|value| value.to_str().ok());
        accept.is_some_and(|accept| accept.contains(kind))
    };
    let is_address = *method == Method::GET && !["/api/", "/assets/"].iter().any(|of| path.starts_with(of));
    match FILES.iter().find(|(name, ..)| *name == INDEX) {
        Some(index) if is_address && accepts("text/html") => {
            (StatusCode::NOT_FOUND, answer(index, &etag(index.1), &HeaderMap::new())).into_response()
        }
        _ => not_found().into_response(),
    }
}

fn served(file: &'static File) -> axum::routing::MethodRouter<AppState> {
    let tag = etag(file.1);
    get(move |headers: HeaderMap| async move { answer(file, &tag, &headers) })
}

/// The digest of a content, in quotes.
fn etag(content: &[u8]) -> String {
    format!("\"{}\"", hex(&Sha256::digest(content)[..12]))
}

fn answer(&(path, content, packed): &File, tag: &str, asked: &HeaderMap) -> Response {
    let has = |name: header::HeaderName, text: &str| {
        asked.get(name).and_then(|value| value.to_str().ok()).is_some_and(|value| value.contains(text))
    };
    let mut headers = HeaderMap::with_capacity(12);
    let lifetime = if path.starts_with("assets/") { FOREVER } else { ASK_AGAIN };
    headers.insert(header::CACHE_CONTROL, lifetime);
    headers.insert(header::VARY, HeaderValue::from_static("accept-encoding"));
    headers.extend(HeaderValue::from_str(tag).ok().map(|tag| (header::ETAG, tag)));
    if has(header::IF_NONE_MATCH, tag) {
        return (StatusCode::NOT_MODIFIED, headers).into_response();
    }
    headers.insert(header::CONTENT_TYPE, media_type(path));
    if !takes_gzip(asked) {
        return (headers, Bytes::from_static(content)).into_response();
    }
    headers.insert(header::CONTENT_ENCODING, HeaderValue::from_static("gzip"));
    (headers, Bytes::from_static(packed)).into_response()
}

/// Whether `Accept-Encoding` names gzip with a weight above 0 (RFC 9110, 12.5.3).
fn takes_gzip(asked: &HeaderMap) -> bool {
    let lists = asked.get_all(header::ACCEPT_ENCODING).iter().filter_map(|list| list.to_str().ok());
    lists.flat_map(|list| list.split(',')).any(|coding| {
        let (name, weight) = coding.split_once(';').unwrap_or((coding, "q=1"));
        let weight = weight.trim().trim_start_matches(['q', 'Q']).trim_start_matches('=');
        name.trim().eq_ignore_ascii_case("gzip") && weight.parse().is_ok_and(|q: f32| q > 0.0)
    })
}

fn media_type(path: &str) -> HeaderValue {
    HeaderValue::from_static(match path.rsplit('.').next() {
        Some("html") => "text/html; charset=utf-8",
        Some("js") => "text/javascript; charset=utf-8",
        Some("css") => "text/css; charset=utf-8",
        Some("svg") => "image/svg+xml",
        Some("woff2") => "font/woff2",
        Some("txt") => "text/plain; charset=utf-8",
        Some("md") => "text/markdown; charset=utf-8",
        _ => "application/octet-stream",
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::{collections::BTreeSet, fs, path::Path};

    fn web() -> std::path::PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../web")
    }

    /// What the pages are built of; the same list is in `web/tools/stamp.js`.
    const BUILT_OF: [&str; 9] = [
        "index.html",
        "package-lock.json",
        "package.json",
        "public",
        "src",
        "svelte.config.js",
        "tools/licences.js",
        "tsconfig.json",
        "vite.config.ts",
    ];

    fn files(path: &str, all: &mut BTreeSet<String>) {
        let full = web().join(path);
        if full.is_dir() {
            for entry in fs::read_dir(full).unwrap() {
                files(&format!("{path}/{}", entry.unwrap().file_name().to_str().unwrap()), all);
            }
        } else {
            all.insert(path.to_owned());
        }
    }

    #[test]
    fn the_pages_that_are_served_are_built_of_their_sources() {
        let mut all = BTreeSet::new();
        for path in BUILT_OF {
            files(path, &mut all);
        }
        let line = |path: &String| {
            format!("{}  {path}\n", hex(&Sha256::digest(fs::read(web().join(path)).unwrap())))
        };
        let lines: String = all.iter().map(line).collect();
        let built = fs::read_to_string(web().join("dist/sources.sha256")).unwrap();
        assert_eq!(
            built.trim(),
            hex(&Sha256::digest(lines)),
            "web/dist is older than its sources: npm run build in web, and commit web/dist"
        );
    }

    /// A file that a page asks for and that is not embedded leaves the whole page dead.
    #[test]
    fn every_file_that_a_page_asks_for_is_served() {
        let served: BTreeSet<String> = FILES.iter().map(|(path, ..)| format!("/{path}")).collect();
        for (page, content, _) in FILES {
            let Ok(text) = std::str::from_utf8(content) else { continue };
            let is_file = |text: &&str| {
                text.starts_with('/')
                    && [".js", ".css", ".svg", ".woff2"].iter().any(|ending| text.ends_with(ending))
            };
            for asked in text.split(['"', '(', ')']).filter(is_file) {
                assert!(served.contains(asked), "{page} asks for {asked}");
            }
        }
    }

    #[test]
    fn the_licences_of_what_the_pages_are_made_of_are_served_as_text() {
        let file = FILES.iter().find(|(path, ..)| *path == "licences.txt").expect("npm run build writes it");
        let served = answer(file, "\"a\"", &HeaderMap::new());
        assert_eq!(served.headers()[header::CONTENT_TYPE], "text/plain; charset=utf-8");
        let text = std::str::from_utf8(file.1).unwrap();
        for package in ["@fontsource-variable/inter", "@lucide/svelte", "ol", "svelte", "uplot"] {
            assert!(text.contains(&format!("\n{package} ")), "{package}");
        }
        let health = fs::read_to_string(web().join("src/pages/admin/Health.svelte")).unwrap();
        assert!(health.contains("href=\"/licences.txt\""), "a page has a link to them");
    }

    #[test]
    fn every_guide_is_served_as_text() {
        let guides = web().join("../docs/guides");
        for entry in fs::read_dir(guides).unwrap() {
            let entry = entry.unwrap();
            let name = format!("guides/{}", entry.file_name().to_str().unwrap());
            let file = FILES.iter().find(|(path, ..)| *path == name).expect("build.rs embeds it");
            assert_eq!(file.1, fs::read(entry.path()).unwrap(), "{name}");
            let served = answer(file, "\"a\"", &HeaderMap::new());
            assert_eq!(served.headers()[header::CONTENT_TYPE], "text/markdown; charset=utf-8");
        }
    }

    #[test]
    fn every_address_of_the_pages_is_served() {
        let routes = fs::read_to_string(web().join("src/routes.svelte.ts")).unwrap();
        let patterns: Vec<&str> =
            routes.split("route(\"").skip(1).filter_map(|rest| rest.split('"').next()).collect();
        assert!(patterns.len() > 10, "{patterns:?}");
        for pattern in patterns {
            let first = pattern.split('/').nth(1).unwrap_or_default();
            let is_served = ADDRESSES.iter().any(|address| {
                *address == pattern
                    || *address == format!("/{first}/{{*rest}}") && pattern.matches('/').count() > 1
            });
            assert!(is_served, "{pattern}");
        }
    }

    #[test]
    fn an_address_that_is_none_shows_the_pages_to_a_browser_and_a_refusal_to_a_program() {
        let html = HeaderMap::from_iter([(header::ACCEPT, HeaderValue::from_static("text/html,*/*;q=0.8"))]);
        let kind = |method: Method, path: &str, headers: &HeaderMap| {
            let response = unknown(&method, path, headers);
            assert_eq!(response.status(), StatusCode::NOT_FOUND, "{method} {path}");
            response.headers()[header::CONTENT_TYPE].to_str().unwrap().to_owned()
        };
        assert_eq!(kind(Method::GET, "/wiki", &html), "text/html; charset=utf-8");
        for (method, path, headers) in [
            (Method::GET, "/wiki", &HeaderMap::new()),
            (Method::POST, "/wiki", &html),
            (Method::GET, "/api/v1/wiki", &html),
            (Method::GET, "/assets/old.js", &html),
        ] {
            assert_eq!(kind(method, path, headers), "application/problem+json");
        }
    }

    #[test]
    fn files_are_compressed_kept_and_asked_for_again() {
        let file = FILES.iter().find(|(path, ..)| path.starts_with("assets/index-")).unwrap();
        let asked = |name: header::HeaderName, value: &str| {
            let headers = HeaderMap::from_iter([(name, HeaderValue::from_str(value).unwrap())]);
            answer(file, &etag(file.1), &headers)
        };
        let packed = asked(header::ACCEPT_ENCODING, "br, gzip");
        assert_eq!(packed.headers()[header::CONTENT_ENCODING], "gzip");
        for (list, gzip) in [
            ("gzip", true),
            ("br;q=1.0, GZIP; q=0.5", true),
            ("gzip;q=0", false),
            ("br, gzip;q=0.0", false),
            ("x-gzip2", false),
            ("identity", false),
        ] {
            let answer = asked(header::ACCEPT_ENCODING, list);
            assert_eq!(answer.headers().contains_key(header::CONTENT_ENCODING), gzip, "{list}");
        }
        assert_eq!(packed.headers()[header::CACHE_CONTROL], FOREVER);
        assert!(file.2.len() < file.1.len() / 2);
        let plain = asked(header::ACCEPT_ENCODING, "br");
        assert!(!plain.headers().contains_key(header::CONTENT_ENCODING));
        let same = asked(header::IF_NONE_MATCH, &etag(file.1));
        assert_eq!(same.status(), StatusCode::NOT_MODIFIED);
        let index = FILES.iter().find(|(path, ..)| *path == INDEX).unwrap();
        assert_eq!(answer(index, "\"a\"", &HeaderMap::new()).headers()[header::CACHE_CONTROL], ASK_AGAIN);
    }
}
