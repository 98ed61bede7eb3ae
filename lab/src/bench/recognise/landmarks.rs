//! Landmarks of the benchmark's maps: the first few learnt by a lesson against each other; each of
//! the others, up to thousands, with three icons and points of its own and the thresholds of one of
//! the first.

use cli::screen;
use sim::posters;
use std::sync::{Arc, Mutex, PoisonError};
use vision::{
    frame::{FrameError, GrayImage},
    geometry::Corners,
    icon::icon,
    learn::{TrainingView, learn, refit_thresholds, synthesis},
    model::{Exemplar, LandmarkId, LandmarkModel},
    params::Params,
    points::taught::view_points,
    recognise::IconFeatures,
};

/// Width of the posters' pictures, in pixels; also what SIFT learns from.
const WIDTH: usize = 200;
/// Width of the pictures of landmarks beyond the first [`LARGE`]: drawing would take longer than
/// all else.
const SMALL_WIDTH: usize = 120;
/// Landmarks with large pictures.
const LARGE: usize = 1000;
/// Generated views of a lesson, besides the poster itself.
const VIEWS: usize = 20;
/// Offset of the corners of the other icons from the poster's, as a share of its width.
const BESIDE: f64 = 0.02;

/// The picture of landmark `index`.
pub(super) fn picture(first: u64, index: usize) -> Result<GrayImage, FrameError> {
    let width = if index < LARGE { WIDTH } else { SMALL_WIDTH };
    let texture = posters::poster_of_size(first.wrapping_add(index as u64), width, 1.4);
    GrayImage::new(texture.width(), texture.height(), texture.data().to_vec())
}

/// Corners of a whole picture.
pub(super) fn whole(image: &GrayImage) -> anyhow::Result<Corners> {
    let (right, bottom) = (image.width() as f64 - 0.5, image.height() as f64 - 0.5);
    Ok(Corners::try_from([[-0.5, -0.5], [right, -0.5], [right, bottom], [-0.5, bottom]])?)
}

/// `count` models with the ids 1 to `count`, of which `taught` are learnt, on `threads` threads.
pub(in crate::bench) fn models(
    first: u64,
    count: usize,
    taught: usize,
    threads: usize,
    p: &Params,
) -> anyhow::Result<Vec<Arc<LandmarkModel>>> {
    let taught = taught.clamp(1, count.max(1));
    let alone = each_of(taught, threads, "learning", |i| lesson(first, i, p))?;
    let fitted = each_of(taught, threads, "thresholds", |i| {
        let others: Vec<IconFeatures> =
            alone.iter().filter(|m| m.id != alone[i].id).flat_map(|m| m.features(&p.recognise)).collect();
        Ok(Arc::new(refit_thresholds(&alone[i], &others, p)))
    })?;
    let rest = each_of(count.saturating_sub(taught), threads, "drawing", |i| {
        let exemplars = icons(first, taught + i, p)?;
        let id = LandmarkId((taught + i + 1) as u64);
        let like = LandmarkModel { id, exemplars, ..LandmarkModel::clone(&fitted[i % taught]) };
        with_points(like, first, taught + i).map(Arc::new)
    })?;
    Ok(fitted.into_iter().take(count).chain(rest).collect())
}

/// The poster and views generated from it, without negatives.
fn lesson(first: u64, index: usize, p: &Params) -> anyhow::Result<LandmarkModel> {
    let views = views(first, index, VIEWS, p)?;
    let model = learn(LandmarkId(index as u64 + 1), &views, &[], p)?;
    with_points(model, first, index)
}

/// The model with the points of its poster.
fn with_points(model: LandmarkModel, first: u64, index: usize) -> anyhow::Result<LandmarkModel> {
    let image = picture(first, index)?;
    let corners = whole(&image)?;
    Ok(model.with_points(&[view_points(&image, &corners)]))
}

/// The poster itself and `count` views generated from it.
pub(super) fn views(first: u64, index: usize, count: usize, p: &Params) -> anyhow::Result<Vec<TrainingView>> {
    let image = picture(first, index)?;
    let corners = whole(&image)?;
    let mut views = vec![TrainingView::photographed(&image, &corners, p)?];
    views.extend(synthesis::views(&image, &corners, count, p, index as u64));
    Ok(views)
}

/// Three icons of the poster: cut exactly, and with two small offsets.
fn icons(first: u64, index: usize, p: &Params) -> anyhow::Result<Vec<Exemplar>> {
    let image = picture(first, index)?;
    let corners = whole(&image)?;
    let beside = BESIDE * image.width() as f64;
    let cuts = [[0.0; 4], [1.0, 0.0, 0.0, 1.0], [0.0, 1.0, 1.0, 0.0]];
    let mut all = Vec::with_capacity(cuts.len());
    for cut in cuts {
        let mut inset = *corners.points();
        for (point, share) in inset.iter_mut().zip(cut) {
            let middle = nalgebra::Point2::new(image.width() as f64 / 2.0, image.height() as f64 / 2.0);
            *point += (middle - *point).normalize() * share * beside;
        }
        let mut icon = icon(&image, &Corners::new(inset)?, &p.icon)?;
        // As a lesson stores them.
        icon.pixels.iter_mut().for_each(|g| *g = g.round());
        all.push(Exemplar::new(&icon));
    }
    Ok(all)
}

/// `work` on 0 to `count`, over `threads` threads, results in order, with a progress bar.
pub(super) fn each_of<R: Send>(
    count: usize,
    threads: usize,
    what: &'static str,
    work: impl Fn(usize) -> anyhow::Result<R> + Sync,
) -> anyhow::Result<Vec<R>> {
    let progress = screen::progress(count, what);
    let (next, done) = (Mutex::new(0..count), Mutex::new(Vec::with_capacity(count)));
    std::thread::scope(|scope| {
        for _ in 0..threads.min(count) {
            scope.spawn(|| {
                while let Some(i) = next.lock().unwrap_or_else(PoisonError::into_inner).next() {
                    let result = work(i);
                    done.lock().unwrap_or_else(PoisonError::into_inner).push((i, result));
                    progress.inc(1);
                }
            });
        }
    });
    progress.finish_and_clear();
    let mut done = done.into_inner().unwrap_or_else(PoisonError::into_inner);
    done.sort_by_key(|(i, _)| *i);
    done.into_iter().map(|(_, result)| result).collect()
}
