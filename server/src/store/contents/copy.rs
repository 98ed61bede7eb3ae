//! A map as a new one, beside the writer: the contents are read first, and written only if they are
//! still those.

use super::{MapContents, Written, read, write};
use crate::{
    config::Limits,
    store::{
        Store, StoreError,
        maps::{self, MapRow},
        teaching::ATTEMPTS,
    },
};

/// A map and its contents, in one state of the database.
pub(crate) async fn contents_of(store: &Store, map: &str) -> Result<(MapRow, MapContents), StoreError> {
    let mut reading = store.reads().begin().await.map_err(StoreError::during("read a map"))?;
    read(&mut reading, map).await
}

/// Copies a map with all that is in it. Robots stay where they are, and the copy begins a history
/// of its own. Errors: `NotFound`, `Exists`, `Limit`; `Busy` while others keep changing the map.
pub(crate) async fn copy(
    store: &Store,
    from: &str,
    name: &str,
    limits: &Limits,
) -> Result<Written, StoreError> {
    let _turn = store.preparing().await;
    for _ in 0..ATTEMPTS {
        let (source, contents) = contents_of(store, from).await?;
        let (name, limits) = (name.to_owned(), limits.clone());
        let written = store.write(move |tx| {
            Box::pin(async move {
                let was = source.revision.clone();
                if maps::recheck(tx, source).await?.revision != was {
                    return Err(StoreError::Changed);
                }
                write(tx, &name, &contents, &limits).await
            })
        });
        match written.await {
            Err(StoreError::Changed) => {}
            done => return done,
        }
    }
    Err(StoreError::Busy)
}
