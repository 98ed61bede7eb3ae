//! Operations that add data are refused while the disk of the data directory is nearly full; all
//! others go on.

use super::{API, AppState, error::ApiError};
use axum::{
    extract::{MatchedPath, Request},
    middleware::Next,
    response::{IntoResponse, Response},
};

/// What adds data that may be large or many: method and path below [`API`]. Whatever else changes
/// something is small, bounded, takes away or mends.
const ADDING: &[(&str, &str)] = &[
    ("POST", "/backups"),
    ("POST", "/bundles"),
    ("POST", "/maps"),
    ("POST", "/maps/{map}/copies"),
    ("PUT", "/maps/{map}/walls"),
    ("PUT", "/maps/{map}/underlay"),
    ("POST", "/maps/{map}/drafts"),
    ("POST", "/maps/{map}/drafts/{draft}/publish"),
    ("POST", "/maps/{map}/mapping"),
    ("POST", "/maps/{map}/landmarks"),
    ("POST", "/maps/{map}/bulk/create-landmarks"),
    ("POST", "/maps/{map}/landmarks/{landmark}/views"),
    ("POST", "/maps/{map}/landmarks/{landmark}/learn"),
    ("POST", "/maps/{map}/learn"),
    ("POST", "/maps/{map}/gatherings"),
    ("POST", "/maps/{map}/gatherings/{gathering}/accept"),
    ("POST", "/robots/{robot}/recording/reference"),
];

/// Runs the operation if there is room for what it adds.
pub(super) async fn run(app: &AppState, request: Request, next: Next) -> Response {
    let path = request.extensions().get::<MatchedPath>().and_then(|path| path.as_str().strip_prefix(API));
    let adds = path.is_some_and(|path| ADDING.contains(&(request.method().as_str(), path)));
    match app.store.disk().check() {
        Err(error) if adds => ApiError::from(error).into_response(),
        _ => next.run(request).await,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::identity::authorisation::TABLE;
    use std::collections::BTreeSet;

    /// What changes something and goes on without room: small, bounded, in memory, or taking away.
    const GOING_ON: &[&str] = &[
        "POST /session/links",
        "POST /tokens",
        "PATCH /maps/{map}",
        "POST /maps/{map}/commits/{commit}/undo",
        "POST /maps/{map}/rollback",
        "POST /maps/{map}/drafts/{draft}/replay",
        "POST /maps/{map}/walls/read",
        "POST /maps/{map}/mapping/finish",
        "PUT /maps/{map}/visibility-settings",
        "POST /maps/{map}/bulk/delete-landmarks",
        "PATCH /maps/{map}/landmarks/{landmark}",
        "POST /maps/{map}/landmarks/{landmark}/merge",
        "POST /maps/{map}/visible",
        "POST /maps/{map}/coverage",
        "POST /maps/{map}/gaze",
        "POST /maps/{map}/recognise",
        "POST /maps/{map}/localise",
        "PUT /maps/{map}/modalities",
        "POST /maps/{map}/gatherings/{gathering}/stop",
        "PUT /robots/{robot}",
        "PUT /robots/{robot}/pose",
        "POST /robots/{robot}/certificates",
        "POST /robots/{robot}/recording",
        "POST /robots/{robot}/cameras/{camera}/calibrate",
    ];

    #[test]
    fn of_every_operation_it_is_decided_whether_it_needs_room() {
        let adds: BTreeSet<String> = ADDING.iter().map(|(method, path)| format!("{method} {path}")).collect();
        let goes_on: BTreeSet<String> = GOING_ON.iter().map(|row| (*row).to_owned()).collect();
        assert_eq!(adds.intersection(&goes_on).count(), 0);
        let changes = TABLE.iter().filter(|rule| !["GET", "DELETE"].contains(&rule.method));
        let changes: BTreeSet<String> =
            changes.map(|rule| format!("{} {}", rule.method, rule.path)).collect();
        assert_eq!(adds.union(&goes_on).cloned().collect::<BTreeSet<_>>(), changes);
    }
}
