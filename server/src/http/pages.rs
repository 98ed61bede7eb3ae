//! The administrator's pages, embedded in the program.

use super::Shared;
use axum::{Router, http::header, response::IntoResponse, routing::get};

/// Path, media type, content.
const FILES: [(&str, &str, &str); 7] = [
    ("/", "text/html; charset=utf-8", include_str!("../../../web/index.html")),
    ("/app.js", "text/javascript; charset=utf-8", include_str!("../../../web/app.js")),
    ("/gather.js", "text/javascript; charset=utf-8", include_str!("../../../web/gather.js")),
    ("/modalities.js", "text/javascript; charset=utf-8", include_str!("../../../web/modalities.js")),
    ("/hypotheses.js", "text/javascript; charset=utf-8", include_str!("../../../web/hypotheses.js")),
    ("/setting.js", "text/javascript; charset=utf-8", include_str!("../../../web/setting.js")),
    ("/style.css", "text/css; charset=utf-8", include_str!("../../../web/style.css")),
];

pub(super) fn router() -> Router<Shared> {
    FILES.into_iter().fold(Router::new(), |router, (path, kind, content)| {
        // A new program brings new pages: the browser asks again each time.
        let headers = [(header::CONTENT_TYPE, kind), (header::CACHE_CONTROL, "no-cache")];
        router.route(path, get(move || async move { (headers, content).into_response() }))
    })
}
