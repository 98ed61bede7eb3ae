//! The stored photographs of landmarks, and the points in them.

use super::negatives::spread;
use crate::{
    config::Config,
    publication::Catalogue,
    store::views::{self, Lesson},
};
use engine::{decode::ImageLimits, picture};
use vision::{
    frame::GrayImage,
    points::taught::{MAX_POINT_VIEWS, TaughtPoint, view_points},
};

/// The stored pictures, for threads that are not the runtime's.
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

    /// The picture of a view; `None`, with a word in the log, if it cannot be read.
    pub(super) fn of(&self, lesson: &Lesson) -> Option<GrayImage> {
        let image = self.runtime.block_on(views::image(self.store.reads(), lesson.view));
        let decoded = image
            .map_err(|e| e.to_string())
            .and_then(|bytes| picture::decode(&bytes, self.upload).map_err(|e| e.to_string()));
        let skipped = |reason: &String| {
            let what = "this picture cannot be read: no views are generated and no points taken from it";
            tracing::warn!(view = lesson.view, reason, "{what}");
        };
        decoded.inspect_err(skipped).ok()
    }
}

/// The photographs of a landmark that give it points.
pub(super) fn point_views(lessons: &[Lesson]) -> impl Iterator<Item = &Lesson> {
    spread(lessons, MAX_POINT_VIEWS)
}

/// The points of a landmark's photographs; those that cannot be read are left out.
pub(super) fn points_of(lessons: &[Lesson], pictures: &Pictures) -> Vec<Vec<TaughtPoint>> {
    let of = |lesson: &Lesson| Some(view_points(&pictures.of(lesson)?, &lesson.cut.corners_px));
    point_views(lessons).filter_map(of).collect()
}
