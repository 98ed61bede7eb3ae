//! Stored photographs of landmarks, and those that give points.

use super::negatives::spread;
use crate::{
    config::Config,
    publication::Catalogue,
    store::{pictures as stored, views::TrainingViewRow},
};
use engine::{decode::ImageLimits, picture, threads::wait_for};
use vision::{
    frame::{GrayImage, Picture},
    points::taught::MAX_POINT_VIEWS,
};

/// The stored pictures, for threads outside of the runtime.
pub(super) struct Pictures {
    store: Catalogue,
    runtime: tokio::runtime::Handle,
    upload: ImageLimits,
}

impl Pictures {
    pub(super) fn new(store: &Catalogue, config: &Config) -> Self {
        let runtime = tokio::runtime::Handle::current();
        Self { store: store.clone(), runtime, upload: config.limits.upload() }
    }

    /// The picture of a view in grey; `None`, with a log entry, if it cannot be read.
    pub(super) fn of(&self, view: &TrainingViewRow) -> Option<GrayImage> {
        let (store, sha256) = ((*self.store).clone(), view.image_sha256);
        let read = wait_for(&self.runtime, async move { stored::read(&store, &sha256).await });
        let image = read.ok_or_else(|| "the server stops".to_owned());
        let decoded = image
            .and_then(|read| read.map_err(|e| e.to_string()))
            .and_then(|bytes| picture::decode(&bytes, self.upload).map_err(|e| e.to_string()));
        let skipped = |reason: &String| {
            let follows = "no views are generated and no points taken from it";
            tracing::warn!(view = view.view, reason, follows, "picture_unreadable");
        };
        decoded.inspect_err(skipped).ok().map(Picture::into_grey)
    }
}

/// The photographs of a landmark that give it points.
pub(super) fn point_views(views: &[TrainingViewRow]) -> impl Iterator<Item = &TrainingViewRow> {
    spread(views, MAX_POINT_VIEWS)
}
