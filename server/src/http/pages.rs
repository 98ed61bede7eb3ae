//! The administrator's pages, embedded in the program.

use super::AppState;
use axum::{Router, http::header, response::IntoResponse, routing::get};

/// Path, media type, content.
const FILES: [(&str, &str, &str); 12] = [
    ("/", "text/html; charset=utf-8", include_str!("../../../web/index.html")),
    ("/app.js", "text/javascript; charset=utf-8", include_str!("../../../web/app.js")),
    ("/first-map.js", "text/javascript; charset=utf-8", include_str!("../../../web/first-map.js")),
    ("/frame.js", "text/javascript; charset=utf-8", include_str!("../../../web/frame.js")),
    ("/naming.js", "text/javascript; charset=utf-8", include_str!("../../../web/naming.js")),
    ("/corrections.js", "text/javascript; charset=utf-8", include_str!("../../../web/corrections.js")),
    ("/gather.js", "text/javascript; charset=utf-8", include_str!("../../../web/gather.js")),
    ("/modalities.js", "text/javascript; charset=utf-8", include_str!("../../../web/modalities.js")),
    ("/hypotheses.js", "text/javascript; charset=utf-8", include_str!("../../../web/hypotheses.js")),
    ("/session.js", "text/javascript; charset=utf-8", include_str!("../../../web/session.js")),
    ("/setting.js", "text/javascript; charset=utf-8", include_str!("../../../web/setting.js")),
    ("/style.css", "text/css; charset=utf-8", include_str!("../../../web/style.css")),
];

pub(super) fn router() -> Router<AppState> {
    FILES.into_iter().fold(Router::new(), |router, (path, kind, content)| {
        // A new program brings new pages: the browser asks again each time.
        let headers = [(header::CONTENT_TYPE, kind), (header::CACHE_CONTROL, "no-cache")];
        router.route(path, get(move || async move { (headers, content).into_response() }))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    /// A file that a page asks for and that is not embedded leaves the whole page dead.
    #[test]
    fn every_file_that_the_page_asks_for_is_served() {
        let served: BTreeSet<&str> = FILES.iter().map(|(path, ..)| *path).collect();
        let quoted = FILES.iter().flat_map(|(_, _, content)| content.split('"'));
        let is_file = |text: &&str| {
            text.starts_with('/') && [".js", ".css"].into_iter().any(|ending| text.ends_with(ending))
        };
        let asked: BTreeSet<&str> = quoted.filter(is_file).collect();
        assert!(asked.is_subset(&served), "{:?}", asked.difference(&served));
        let pages: BTreeSet<&str> = served.into_iter().filter(|path| *path != "/").collect();
        assert_eq!(asked, pages, "a file is served that nothing asks for");
    }
}
