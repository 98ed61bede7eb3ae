//! `/events`: what changes on the server, as a stream that a reader resumes where it was cut.

use super::{AppState, authorise::Caller, error::ApiError, extract::QueryParams};
use crate::{
    events::{EventLog, Since},
    identity::Principal,
    store::{maps, now_ms},
};
use axum::{
    Extension,
    extract::State,
    http::HeaderMap,
    response::{
        Sse,
        sse::{Event, KeepAlive},
    },
};
use futures::{Stream, StreamExt, stream};
use protos::api::{EventQuery, Problem, Role, ServerEvent, ServerEventBody};
use std::{collections::VecDeque, convert::Infallible, sync::Arc};
use tokio::sync::watch;
use utoipa_axum::{router::OpenApiRouter, routes};

pub(super) fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(events))
}

/// Which events a reader gets.
#[derive(Debug)]
struct EventFilter {
    principal: Principal,
    map: Option<String>,
    kinds: Option<Vec<String>>,
}

impl EventFilter {
    fn new(principal: Principal, query: &EventQuery) -> Result<Self, ApiError> {
        let kinds: Option<Vec<String>> =
            query.kind.as_ref().map(|text| text.split(',').map(|kind| kind.trim().to_owned()).collect());
        if let Some(other) =
            kinds.iter().flatten().find(|kind| !ServerEventBody::KINDS.contains(&kind.as_str()))
        {
            let detail = format!("`{other}` is none of {}", ServerEventBody::KINDS.join(", "));
            return Err(ApiError::invalid("invalid_value", "kind", detail));
        }
        Ok(Self { principal, map: query.map.clone(), kinds })
    }

    fn lets_through(&self, what: &ServerEventBody) -> bool {
        let is_wanted = self.kinds.as_ref().is_none_or(|kinds| kinds.iter().any(|kind| kind == what.kind()))
            && self.map.as_deref().is_none_or(|map| what.map() == Some(map));
        is_wanted && may_hear(&self.principal, what)
    }
}

/// Whether an event is shown to whoever reads: those about a map to those who may see that map, the
/// others to tokens for all maps, and of the server itself only to administrators.
fn may_hear(principal: &Principal, what: &ServerEventBody) -> bool {
    let sees_all = principal.maps.is_none();
    match what {
        ServerEventBody::Ready | ServerEventBody::Reset => true,
        ServerEventBody::Backup { .. } | ServerEventBody::TokensChanged => {
            sees_all && principal.role >= Role::Admin
        }
        other => other.map().map_or(sees_all, |map| principal.may_see(map)),
    }
}

/// Where a reader is.
struct Reader {
    log: Arc<EventLog>,
    changes: watch::Receiver<u64>,
    filter: EventFilter,
    /// Number of the last event that was looked at.
    last: u64,
    ready: VecDeque<(u64, i64, ServerEventBody)>,
}

impl Reader {
    /// The next event for this reader; waits for it.
    async fn next(&mut self) -> Option<Event> {
        loop {
            if let Some((number, at_ms, what)) = self.ready.pop_front() {
                let (id, kind) = (self.log.id(number), what.kind());
                let event = ServerEvent { id: id.clone(), at_ms, what };
                return Event::default().id(id).event(kind).json_data(event).ok();
            }
            // Seen from before the look: what comes after it wakes.
            self.changes.mark_unchanged();
            match self.log.since(self.last) {
                Since::Forgotten(newest) => {
                    self.last = newest;
                    self.ready.push_back((newest, now_ms(), ServerEventBody::Reset));
                }
                Since::Events(events) => {
                    self.last = events.last().map_or(self.last, |event| event.number);
                    let wanted = events.iter().filter(|event| self.filter.lets_through(&event.what));
                    self.ready.extend(wanted.map(|event| (event.number, event.at_ms, event.what.clone())));
                    if self.ready.is_empty() && self.changes.changed().await.is_err() {
                        return None;
                    }
                }
            }
        }
    }
}

/// Follows what changes on the server: maps, landmarks, jobs, robots that come and go, gatherings;
/// for administrators backups and tokens, too. The first event is `ready`. A reader that was cut
/// off gives the id of its last event (`Last-Event-ID`) and gets what it has missed; where that is
/// more than is remembered (1024 events), an event `reset` says to read anew. Only what the token
/// may see is sent.
#[utoipa::path(get, path = "/events", operation_id = "followEvents", tag = "maps", params(EventQuery,
    ("Last-Event-ID" = Option<String>, Header, description = "Id of the last event that was received.")),
    responses((status = 200, content_type = "text/event-stream", body = ServerEvent),
    (status = 404, body = Problem, description = "unknown_map"),
    (status = 422, body = Problem, description = "invalid_value"),
    (status = 503, body = Problem, description = "too_many_streams")))]
async fn events(
    State(app): State<AppState>,
    QueryParams(query): QueryParams<EventQuery>,
    headers: HeaderMap,
    Extension(asker): Extension<Caller>,
) -> Result<Sse<impl Stream<Item = Result<Event, Infallible>>>, ApiError> {
    let filter = EventFilter::new(asker.principal.clone(), &query)?;
    if let Some(map) = &query.map {
        super::authorise::check_map(&asker.principal, map)?;
        maps::get(app.store.reads(), map).await?;
    }
    let place = app.stream_place()?;
    let log = app.store.events().clone();
    let header = headers.get("last-event-id").and_then(|id| id.to_str().ok().map(str::to_owned));
    let last_id = header.or(query.last_event_id).filter(|id| !id.is_empty());
    let newest = log.newest();
    let (last, ready) = match last_id.map(|id| log.number(&id)) {
        None => (newest, Some((newest, ServerEventBody::Ready))),
        Some(None) => (newest, Some((newest, ServerEventBody::Reset))),
        // It may be forgotten, which the first look tells.
        Some(Some(number)) => (number, None),
    };
    let ready = ready.into_iter().map(|(number, what)| (number, now_ms(), what)).collect();
    let reader = Reader { changes: log.changes(), log, filter, last, ready };
    let events = stream::unfold((reader, place), async |(mut reader, place)| {
        let event = reader.next().await?;
        Some((Ok(event), (reader, place)))
    });
    Ok(Sse::new(events.take_until(app.ended_for(asker)).boxed()).keep_alive(KeepAlive::default()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::identity::TokenId;
    use protos::api::BackupState;

    #[test]
    fn a_token_hears_only_of_its_maps_and_only_administrators_of_the_server() {
        let principal = |role, maps: Option<&str>| Principal {
            token: TokenId::Stored(1),
            name: "x".into(),
            role,
            maps: maps.map(|map| Arc::new([map.to_owned()].into())),
            expires_ms: None,
        };
        let of = |map: &str| ServerEventBody::MapChanged { map: map.into(), version: Some(1) };
        let nobody = ServerEventBody::Presence { map: None, robot: "r9".into(), present: true };
        let backup = ServerEventBody::Backup { backup: "b".into(), state: BackupState::Complete };
        for (role, maps, what, heard) in [
            (Role::Viewer, Some("hall"), of("hall"), true),
            (Role::Viewer, Some("hall"), of("yard"), false),
            (Role::Admin, Some("hall"), of("yard"), false),
            (Role::Viewer, None, of("yard"), true),
            (Role::Viewer, Some("hall"), nobody.clone(), false),
            (Role::Viewer, None, nobody, true),
            (Role::Operator, None, backup.clone(), false),
            (Role::Admin, Some("hall"), backup.clone(), false),
            (Role::Admin, None, backup, true),
            (Role::Operator, None, ServerEventBody::TokensChanged, false),
            (Role::Admin, None, ServerEventBody::TokensChanged, true),
        ] {
            assert_eq!(may_hear(&principal(role, maps), &what), heard, "{role:?} {maps:?} {what:?}");
        }
    }
}
