//! Weights and gates of a landmark's own, as JSON of `LearningSettings`.

use super::{
    StoreError, Tx, db,
    landmarks::{self, LandmarkRow},
    maps,
    statements::statements,
};

statements! {
    SET = "UPDATE landmarks SET learning = $2 WHERE id = $1";
}

/// Sets weights and gates of a landmark's own, for the reason that the history names unless the
/// request gives another one; `None` forgets them.
pub(crate) async fn set(
    tx: &mut Tx,
    (map, name): (&str, &str),
    learning: Option<&str>,
    reason: Option<String>,
) -> Result<LandmarkRow, StoreError> {
    tx.author.why = tx.author.why.take().or(reason);
    let map = maps::get(&mut tx.conn, map).await?;
    let landmark = landmarks::get(&mut tx.conn, &map.name, name).await?;
    put(tx, landmark.id, learning).await?;
    maps::bump(tx, map.id).await?;
    landmarks::get(&mut tx.conn, &map.name, name).await
}

pub(super) async fn put(tx: &mut Tx, id: i64, learning: Option<&str>) -> Result<(), StoreError> {
    let done = db::query(SET).bind(id).bind(learning).execute(&mut tx.conn).await;
    done.map_err(StoreError::during("set weights and gates of a landmark")).map(drop)
}
