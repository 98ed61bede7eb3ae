//! `/maps/{map}/landmarks/{landmark}/refused-views`: photographs that were not taken, and why.
//! Uploads and lessons keep them.

use super::{
    API, App, AppState,
    error::ApiError,
    extract::PathParams,
    pictures::{FOREVER, IfNoneMatch, PictureHead},
};
use crate::store::{
    landmarks, maps,
    pictures::digest,
    refused_views::{self, MAX_PICTURE_PX, RefusedUpload, RefusedViewRow, SmallPicture},
};
use axum::{Json, extract::State, response::Response};
use engine::picture;
use protos::api::{Page, Problem, RefusedBy, RefusedView};
use utoipa_axum::{router::OpenApiRouter, routes};
use vision::{frame::GrayImage, icon::Icon, model::MAX_VIEWS};

pub(super) fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(list)).routes(routes!(icon))
}

/// Refusals of an upload that say something of the photograph.
const ABOUT_PHOTOGRAPHS: [&str; 7] =
    ["bad_image", "wrong_encoding", "too_large", "too_small", "outside", "quad_not_found", "quad_ambiguous"];

/// A refused upload, with the photograph where it could be decoded.
#[derive(Debug)]
pub(super) struct Refused {
    pub(super) error: ApiError,
    pub(super) picture: Option<Box<SmallPicture>>,
}

impl From<ApiError> for Refused {
    fn from(error: ApiError) -> Self {
        Self { error, picture: None }
    }
}

/// A photograph, each side at most [`MAX_PICTURE_PX`]: the means of its parts.
pub(super) fn small(image: &GrayImage) -> SmallPicture {
    let step = image.width().max(image.height()).div_ceil(MAX_PICTURE_PX).max(1);
    let [width, height] = [image.width(), image.height()].map(|side| (side / step).max(1));
    let mean = |i: usize| {
        let (u, v) = (i % width * step, i / width * step);
        let (right, bottom) = ((u + step).min(image.width()), (v + step).min(image.height()));
        let part = (v..bottom).flat_map(|v| (u..right).map(move |u| u32::from(image.at(u, v))));
        let (sum, count) = part.fold((0, 0), |(sum, count), grey| (sum + grey, count + 1));
        (sum / count.max(1)) as u8
    };
    SmallPicture { size_px: [width, height], grey: (0..width * height).map(mean).collect() }
}

/// The landmark as a view shows it.
pub(super) fn of_icon(icon: &Icon) -> SmallPicture {
    let grey = icon.pixels.iter().map(|grey| grey.round().clamp(0.0, 255.0) as u8).collect();
    SmallPicture { size_px: [icon.size; 2], grey }
}

/// Keeps a refused photograph of a landmark. A refusal that says nothing of it is not kept.
pub(super) async fn keep_refused(
    app: &App,
    at: (String, String),
    error: &ApiError,
    picture: Option<Box<SmallPicture>>,
) {
    if let Some(reason) = ABOUT_PHOTOGRAPHS.into_iter().find(|code| *code == error.code) {
        keep(app, at, RefusedUpload { reason, view: None, picture: picture.map(|boxed| *boxed) }).await;
    }
}

/// Keeps a photograph that was not added. What fails is logged: the upload is answered all the
/// same.
pub(super) async fn keep(app: &App, (map, landmark): (String, String), refused: RefusedUpload) {
    let store = app.store.clone();
    // In a task of its own: it is no change in anybody's name, and no answer to a creation.
    let kept = tokio::spawn(async move {
        let write = store.write(move |tx| {
            Box::pin(async move { refused_views::add(tx, (&map, &landmark), &refused).await })
        });
        write.await
    });
    match kept.await {
        Ok(Ok(())) => {}
        Ok(Err(error)) => tracing::warn!(%error, "refused_view_not_kept"),
        Err(error) => tracing::warn!(%error, "refused_view_not_kept"),
    }
}

/// Why a photograph was not taken, and what to do.
fn in_words(reason: &str, view: Option<i64>) -> (String, &'static str) {
    let other = view.map_or_else(|| "one that is gone now".to_owned(), |view| format!("photograph {view}"));
    match reason {
        "near_duplicate" => (
            format!("It shows nothing that {other} does not: the same side, distance and light."),
            "Photograph it from another side, from nearer or farther, or in other light.",
        ),
        "duplicate" => (format!("It is {other} once more."), "Choose another photograph."),
        "bad_image" => ("The file is damaged.".into(), "Save it as JPEG or PNG, and add it again."),
        "wrong_encoding" => {
            ("It is neither a JPEG nor a PNG picture.".into(), "Save it as JPEG or PNG, and add it again.")
        }
        "too_large" => {
            ("The picture is larger than the server takes.".into(), "Make it smaller, and add it again.")
        }
        "too_small" => {
            ("The landmark is too small in it.".into(), "Go nearer, or take a picture with more pixels.")
        }
        "outside" => {
            ("The corners lie outside of the picture.".into(), "Set the corners inside of the picture.")
        }
        "quad_not_found" => (
            "No four edges were found in it.".into(),
            "Set the corners yourself, or photograph the whole of it, sharper and more from the front.",
        ),
        "quad_ambiguous" => (
            "Several framed things are in it, and which is meant is not said.".into(),
            "Choose one of the proposed quads, or set the corners yourself.",
        ),
        "beyond_limit" => (
            format!("A lesson takes {MAX_VIEWS} photographs at most, the oldest first."),
            "Remove photographs that add little, and learn again.",
        ),
        "picture_unreadable" => (
            "Its stored file cannot be read any more: only its small picture was learnt.".into(),
            "Remove it, and add the photograph again.",
        ),
        other => (format!("It was refused: {other}."), "Try another photograph."),
    }
}

fn shown(at: &str, row: RefusedViewRow) -> RefusedView {
    let RefusedViewRow { id, refused_ms, of_lesson, reason, view, has_picture } = row;
    let (sentence, advice) = in_words(&reason, view);
    let icon = match view {
        _ if has_picture => Some(format!("{at}/refused-views/{id}/icon")),
        Some(view) if of_lesson => Some(format!("{at}/views/{view}/icon")),
        _ => None,
    };
    let by = if of_lesson { RefusedBy::Lesson } else { RefusedBy::Upload };
    RefusedView { id, refused_ms, by, reason, sentence, advice: advice.to_owned(), view, icon }
}

/// Lists the photographs of a landmark that uploads refused or its last lesson left out, newest
/// first, each with the reason and what to do. The newest 50 stay.
#[utoipa::path(get, path = "/maps/{map}/landmarks/{landmark}/refused-views", operation_id = "listRefusedViews",
    tag = "landmarks",
    params(("map" = String, Path), ("landmark" = String, Path)),
    responses((status = 200, body = Page<RefusedView>), (status = 404, body = Problem)))]
async fn list(
    State(app): State<AppState>,
    PathParams((map, landmark)): PathParams<(String, String)>,
) -> Result<Json<Page<RefusedView>>, ApiError> {
    maps::get(app.store.reads(), &map).await?;
    let row = landmarks::get(app.store.reads(), &map, &landmark).await?;
    let rows = refused_views::list(app.store.reads(), row.id).await?;
    let (total, at) = (rows.len() as u64, format!("{API}/maps/{map}/landmarks/{landmark}"));
    let items = rows.into_iter().map(|row| shown(&at, row)).collect();
    Ok(Json(Page { items, next: None, total }))
}

/// A small picture of a refused photograph, PNG. `ETag` is the digest of its grey levels.
#[utoipa::path(get, path = "/maps/{map}/landmarks/{landmark}/refused-views/{refused}/icon",
    operation_id = "getRefusedViewIcon", tag = "landmarks",
    params(("map" = String, Path), ("landmark" = String, Path), ("refused" = i64, Path)),
    responses((status = 200, content_type = "image/png"), (status = 304, description = "`If-None-Match` has it"),
    (status = 404, body = Problem)))]
async fn icon(
    State(app): State<AppState>,
    PathParams((map, landmark, refused)): PathParams<(String, String, i64)>,
    known: IfNoneMatch,
) -> Result<Response, ApiError> {
    let small = refused_views::picture(app.store.reads(), (&map, &landmark, refused)).await?;
    let [width, height] = small.size_px;
    let png = async { picture::png(width, height, &small.grey).map_err(|e| ApiError::internal(&e)) };
    // It never changes; its number never comes to mean another.
    PictureHead::new("png", &digest(&small.grey), FOREVER).answer(&known, png).await
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_small_picture_has_the_shape_of_the_photograph_and_its_means() {
        let image = GrayImage::from_fn(400, 200, |u, _| if u % 2 == 0 { 100 } else { 200 });
        let picture = small(&image);
        assert_eq!(picture.size_px, [80, 40]);
        assert_eq!(picture.grey.len(), 3200);
        assert!(picture.grey.iter().all(|grey| (139..=160).contains(grey)), "{:?}", &picture.grey[..9]);
        let tiny = small(&GrayImage::from_fn(3, 2, |u, v| (10 * u + v) as u8));
        assert_eq!((tiny.size_px, tiny.grey), ([3, 2], vec![0, 10, 20, 1, 11, 21]));
    }

    #[test]
    fn every_reason_has_a_sentence_and_an_advice() {
        for reason in ABOUT_PHOTOGRAPHS.into_iter().chain([
            "near_duplicate",
            "duplicate",
            "beyond_limit",
            "picture_unreadable",
        ]) {
            let (sentence, advice) = in_words(reason, Some(7));
            assert!(
                sentence.ends_with('.') && advice.ends_with('.') && !sentence.starts_with("It was refused"),
                "{reason}: {sentence}"
            );
        }
        assert!(in_words("near_duplicate", Some(7)).0.contains("photograph 7"));
        assert!(in_words("near_duplicate", None).0.contains("gone"));
    }
}
