//! Photographs that were not taken for a landmark, or not in its last lesson: why, with a small
//! picture. Only the newest of each landmark stay. They are no part of the map: no history has
//! them, and no bundle.

use super::{
    StoreError, Tx,
    db::{self, Executor},
    kind::Kind,
    now_ms,
    statements::statements,
};

statements! {
    INSERT = "INSERT INTO refused_views (landmark_id, refused_ms, refused_by, reason, view_id, width_px, height_px, grey) \
              SELECT l.id, $3, 'upload', $4, $5, $6, $7, $8 FROM landmarks l JOIN maps m ON m.id = l.map_id \
              WHERE m.name = $1 AND l.name = $2 RETURNING landmark_id";
    INSERT_OF_LESSON = "INSERT INTO refused_views (landmark_id, refused_ms, refused_by, reason, view_id) \
                        SELECT landmark_id, $2, 'lesson', $3, id FROM views WHERE id = $1 AND landmark_id = $4";
    FORGET = "DELETE FROM refused_views WHERE landmark_id = $1 AND id NOT IN \
              (SELECT id FROM refused_views WHERE landmark_id = $1 ORDER BY id DESC LIMIT $2)";
    FORGET_LESSON = "DELETE FROM refused_views WHERE landmark_id = $1 AND refused_by = 'lesson'";
    LIST = "SELECT r.id, r.refused_ms, r.refused_by = 'lesson' AS of_lesson, r.reason, v.id AS view_id, \
            r.grey IS NOT NULL AS has_picture FROM refused_views r LEFT JOIN views v ON v.id = r.view_id \
            WHERE r.landmark_id = $1 AND (r.refused_by = 'upload' OR v.id IS NOT NULL) ORDER BY r.id DESC";
    PICTURE = "SELECT r.width_px, r.height_px, r.grey FROM refused_views r JOIN landmarks l ON l.id = r.landmark_id \
               JOIN maps m ON m.id = l.map_id WHERE m.name = $1 AND l.name = $2 AND r.id = $3 AND r.grey IS NOT NULL";
}

/// Refused photographs of one landmark that stay.
pub(crate) const MAX_REFUSED: usize = 50;
/// Longest side of a small picture, px.
pub(crate) const MAX_PICTURE_PX: usize = 96;

/// A small grey picture: width and height, and grey levels row by row.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct SmallPicture {
    pub(crate) size_px: [usize; 2],
    pub(crate) grey: Vec<u8>,
}

/// A photograph that an upload did not add.
#[derive(Debug, Clone)]
pub(crate) struct RefusedUpload {
    /// A code.
    pub(crate) reason: &'static str,
    /// The view that it repeats.
    pub(crate) view: Option<i64>,
    pub(crate) picture: Option<SmallPicture>,
}

/// A view that a lesson left out, or did not use as a whole.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct SkippedView {
    pub(crate) view: i64,
    /// A code.
    pub(crate) reason: &'static str,
}

/// What is listed of a refused photograph.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct RefusedViewRow {
    pub(crate) id: i64,
    pub(crate) refused_ms: i64,
    pub(crate) of_lesson: bool,
    pub(crate) reason: String,
    /// The view that it repeats or is; `None` where that is gone.
    pub(crate) view: Option<i64>,
    pub(crate) has_picture: bool,
}

async fn forget(tx: &mut Tx, landmark: i64) -> Result<(), StoreError> {
    let oldest = db::query(FORGET).bind(landmark).bind(MAX_REFUSED as i64).execute(&mut tx.conn).await;
    oldest.map_err(StoreError::during("delete old refused views")).map(drop)
}

/// Keeps a photograph that an upload did not add. Nothing if the landmark is gone.
pub(crate) async fn add(
    tx: &mut Tx,
    (map, landmark): (&str, &str),
    refused: &RefusedUpload,
) -> Result<(), StoreError> {
    let size = refused.picture.as_ref().map(|picture| picture.size_px);
    let row = db::query_scalar::<i64>(INSERT)
        .bind(map)
        .bind(landmark)
        .bind(now_ms())
        .bind(refused.reason)
        .bind(refused.view)
        .bind(size.map(|[width, _]| width as i64))
        .bind(size.map(|[_, height]| height as i64))
        .bind(refused.picture.as_ref().map(|picture| &picture.grey));
    let landmark = row.fetch_optional(&mut tx.conn).await.map_err(StoreError::during("keep refused view"))?;
    match landmark {
        Some(landmark) => forget(tx, landmark).await,
        None => Ok(()),
    }
}

/// Replaces what the lesson before left out of a landmark.
pub(crate) async fn replace_of_lesson(
    tx: &mut Tx,
    landmark: i64,
    left_out: &[SkippedView],
) -> Result<(), StoreError> {
    let at = || StoreError::during("keep what a lesson left out");
    db::query(FORGET_LESSON).bind(landmark).execute(&mut tx.conn).await.map_err(at())?;
    for SkippedView { view, reason } in left_out.iter().take(MAX_REFUSED) {
        let row = db::query(INSERT_OF_LESSON).bind(view).bind(now_ms()).bind(reason).bind(landmark);
        row.execute(&mut tx.conn).await.map_err(at())?;
    }
    forget(tx, landmark).await
}

/// The refused photographs of a landmark, newest first: at most [`MAX_REFUSED`].
pub(crate) async fn list(db: impl Executor<'_>, landmark: i64) -> Result<Vec<RefusedViewRow>, StoreError> {
    let at = || StoreError::during("list refused views");
    let of = |row: &db::Row| -> Result<RefusedViewRow, db::Error> {
        Ok(RefusedViewRow {
            id: row.try_get("id")?,
            refused_ms: row.try_get("refused_ms")?,
            of_lesson: row.try_get("of_lesson")?,
            reason: row.try_get("reason")?,
            view: row.try_get("view_id")?,
            has_picture: row.try_get("has_picture")?,
        })
    };
    let rows = db::query(LIST).bind(landmark).fetch_all(db).await.map_err(at())?;
    rows.iter().map(of).collect::<Result<_, _>>().map_err(at())
}

/// The small picture of a refused photograph.
pub(crate) async fn picture(
    db: impl Executor<'_>,
    (map, landmark, refused): (&str, &str, i64),
) -> Result<SmallPicture, StoreError> {
    let at = || StoreError::during("read refused view");
    let row = db::query(PICTURE).bind(map).bind(landmark).bind(refused).fetch_optional(db).await;
    let row = row.map_err(at())?;
    let row = row.ok_or_else(|| StoreError::NotFound { what: Kind::View, name: refused.to_string() })?;
    let side = |column: &str| row.try_get::<i64, _>(column).map(|px| px as usize).map_err(at());
    Ok(SmallPicture {
        size_px: [side("width_px")?, side("height_px")?],
        grey: row.try_get("grey").map_err(at())?,
    })
}
