//! `map/{map}/version`: answers queries for the version of a map, for robots that missed a change.
//! Runs on zenoh's thread: one look-up of a snapshot a map.

use super::{BusError, Receivers, caught};
use protos::{Key, Keys, Name, prost::Message, v1};
use zenoh::{
    Session, Wait,
    key_expr::KeyExpr,
    query::{Query, Queryable},
};

/// Answers `map/{map}/version` with one `MapChanged` for each map that the query's key expression
/// names.
pub(super) async fn answer_versions(
    session: &Session,
    keys: &Keys,
    to: &Receivers,
) -> Result<Queryable<()>, BusError> {
    let answer = {
        let (keys, to) = (keys.clone(), to.clone());
        move |query: Query| reply(&keys, &to, &query)
    };
    let declared = session
        .declare_queryable(keys.all_map_versions())
        .callback(caught(&to.vitals, "a version query", answer))
        .await;
    declared.map_err(|e| BusError::Declare { action: "answer version queries", detail: e.to_string() })
}

fn reply(keys: &Keys, to: &Receivers, query: &Query) {
    for map in to.intake.snapshots.all().into_iter().filter(|map| !map.is_draft) {
        let Ok(name) = Name::new(map.name.as_str()) else { continue };
        let name_of = name.clone();
        let key = keys.build(&Key::MapVersion(name));
        let asked = KeyExpr::new(key.as_str()).is_ok_and(|key| query.key_expr().intersects(&key));
        if !asked || !to.serves(&name_of) {
            continue;
        }
        let message =
            v1::MapChanged { map: map.name.clone(), version: map.version, server: to.server.to_string() };
        if let Err(error) = query.reply(key, message.encode_to_vec()).wait() {
            tracing::debug!(map = map.name, %error, "version_not_sent");
            return;
        }
    }
}
