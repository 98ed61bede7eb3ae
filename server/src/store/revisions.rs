//! Revisions of what people edit. In: what it is. Out: a word that is another one after every edit
//! or lesson, and never comes back for something else of the same name. What robots do by
//! themselves changes none.

use super::{
    StoreError, Tx,
    db::{self, Conn},
    landmarks, maps, modality_stats,
    statements::statements,
    visibility_settings,
};

statements! {
    OF_MAP = "SELECT id || '.' || walls_version AS walls, id || '.' || underlay_revision AS underlay, sight \
              FROM maps WHERE name = $1";
}

/// What has a revision.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Subject {
    /// The map with all that is in it: where it lies, walls, settings, underlay, runs, landmarks.
    Map,
    /// Name, size, place, views, model of a landmark, and a person's word on its health.
    Landmark(String),
    Walls,
    VisibilitySettings,
    /// The fusion mode and the named areas.
    Modalities,
    Underlay,
}

/// Which revisions a change is meant for.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Precondition {
    /// Whatever is there.
    Any,
    /// One of these.
    OneOf(Vec<String>),
}

/// The present revision. Errors: `NotFound`.
pub(crate) async fn present(conn: &mut Conn, map: &str, of: &Subject) -> Result<String, StoreError> {
    let row = maps::get(&mut *conn, map).await?;
    match of {
        Subject::Map => return Ok(row.revision),
        Subject::Landmark(name) => return Ok(landmarks::get(conn, map, name).await?.revision),
        Subject::Modalities => {
            return Ok(modality_stats::revision(&modality_stats::settings(conn, row.id).await?));
        }
        Subject::Walls | Subject::VisibilitySettings | Subject::Underlay => {}
    }
    let at = || StoreError::during("read a revision");
    let row = db::query(OF_MAP).bind(map).fetch_one(conn).await.map_err(at())?;
    if *of == Subject::VisibilitySettings {
        let text: Option<String> = row.try_get("sight").map_err(at())?;
        return Ok(visibility_settings::revision(&visibility_settings::read(map, text.as_deref())));
    }
    row.try_get(if *of == Subject::Walls { "walls" } else { "underlay" }).map_err(at())
}

/// Lets a change go on only if it is meant for what is there. Errors: `NotFound`,
/// `ChangedMeanwhile`.
pub(crate) async fn check(tx: &mut Tx, map: &str, of: &Subject, is: &Precondition) -> Result<(), StoreError> {
    let present = present(&mut tx.conn, map, of).await?;
    match is {
        Precondition::OneOf(known) if !known.contains(&present) => {
            Err(StoreError::ChangedMeanwhile { present })
        }
        _ => Ok(()),
    }
}

/// The revision after a change.
pub(crate) async fn after(tx: &mut Tx, map: &str, of: &Subject) -> Result<String, StoreError> {
    present(&mut tx.conn, map, of).await
}

impl super::Store {
    /// The present revision. What is read after it may be newer, never older. Errors: `NotFound`.
    pub(crate) async fn revision(&self, map: &str, of: &Subject) -> Result<String, StoreError> {
        let mut conn = self.reads.acquire().await.map_err(StoreError::during("read a revision"))?;
        present(&mut conn, map, of).await
    }
}
