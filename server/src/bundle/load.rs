//! From a bundle to a new map: checked as a whole first, then written in one transaction, which is
//! one commit of its history.

use super::{
    BundleError,
    unpack::{Unpacked, unpack},
};
use crate::{
    config::Limits,
    store::{
        Store, StoreError,
        contents::{self, Written},
        pictures,
    },
};
use std::fs::File;

/// How a bundle becomes a map.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Request {
    /// Name of the map; `None` for that of the bundle.
    pub(crate) name: Option<String>,
    /// The link to another map is left out.
    pub(crate) without_link: bool,
}

/// Makes a map of a bundle. Nothing is left of one that is refused. Errors: `Refused`; `Exists`,
/// `Limit`, `NotFound` of the map that it lies in.
pub(crate) async fn load(
    store: &Store,
    file: File,
    request: Request,
    limits: &Limits,
) -> Result<Written, BundleError> {
    let bounds = limits.clone();
    let unpacked = tokio::task::spawn_blocking(move || unpack(file, &bounds)).await;
    let Unpacked { name, mut contents, pictures } = unpacked.map_err(std::io::Error::other)??;
    if request.without_link {
        contents.settings.location.link = None;
    }
    let (name, limits) = (request.name.unwrap_or(name), limits.clone());
    let written = store.write(move |tx| {
        Box::pin(async move {
            let mut rest = pictures;
            loop {
                let read = tokio::task::spawn_blocking(move || (rest.next(), rest)).await;
                let (next, left) = read.map_err(|e| unreadable(&e))?;
                rest = left;
                let Some(picture) = next else { break };
                let (sha256, bytes) = picture.map_err(|e| unreadable(&e))?;
                pictures::put(tx, &sha256, &bytes).await?;
            }
            contents::write(tx, &name, &contents, &limits).await
        })
    });
    Ok(written.await?)
}

/// The file was read as a whole before; now it cannot be.
fn unreadable(error: &impl std::fmt::Display) -> StoreError {
    StoreError::Damaged { what: "the bundle".to_owned(), reason: error.to_string() }
}
