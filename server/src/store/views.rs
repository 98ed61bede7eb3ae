//! Training views of landmarks with their pictures, and the distractors beside the landmarks in
//! those pictures.

use super::{
    StoreError, Tx,
    db::{self, Executor, Row},
    kind::Kind,
    landmarks, now_ms,
    pictures::{self, Digest},
    statements::statements,
    within,
};
use vision::{geometry::Corners, icon::Icon, model::LandmarkId};

statements! {
    COUNT = "SELECT count(*) FROM views WHERE landmark_id = $1";
    SAME = "SELECT id, image_kind, width_px, height_px, corners_px, created_ms FROM views \
            WHERE landmark_id = $1 AND image_sha256 = $2 AND corners_px = $3";
    INSERT = "INSERT INTO views (landmark_id, image_sha256, image_kind, width_px, height_px, corners_px, \
              icon_side, icon, icon_scale, created_ms, capture) \
              VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9, $10, $11) \
              RETURNING id";
    PAGE = "SELECT id, image_kind, width_px, height_px, corners_px, created_ms FROM views \
            WHERE landmark_id = $1 AND id > $2 AND id < $3 AND (CAST($4 AS BIGINT) IS NULL OR (capture IS NOT NULL) = ($4 = 1)) \
            AND (CAST($5 AS BIGINT) IS NULL OR created_ms >= $5) \
            AND (CAST($6 AS BIGINT) IS NULL OR created_ms < $6) ORDER BY CASE WHEN $7 = 1 THEN -id ELSE id END LIMIT $8";
    COUNT_FILTERED = "SELECT count(*) FROM views WHERE landmark_id = $1 \
                      AND (CAST($2 AS BIGINT) IS NULL OR (capture IS NOT NULL) = ($2 = 1)) \
                      AND (CAST($3 AS BIGINT) IS NULL OR created_ms >= $3) \
                      AND (CAST($4 AS BIGINT) IS NULL OR created_ms < $4)";
    ICON = "SELECT v.icon_side, v.icon, v.icon_scale FROM views v JOIN landmarks l ON l.id = v.landmark_id \
            JOIN maps m ON m.id = l.map_id WHERE m.name = $1 AND l.name = $2 AND v.id = $3";
    DELETE = "DELETE FROM views WHERE id = $1 AND landmark_id = $2";
    GET = "SELECT id, image_kind, width_px, height_px, corners_px, created_ms FROM views WHERE id = $1";
    CROPS = "SELECT id, corners_px, icon_side, icon, icon_scale FROM views WHERE landmark_id = $1 ORDER BY id";
    OF_MAP = "SELECT v.id, v.landmark_id, v.image_sha256, v.width_px, v.height_px, v.corners_px, v.icon_side, v.icon, \
              v.icon_scale FROM views v JOIN landmarks l ON l.id = v.landmark_id WHERE l.map_id = $1 ORDER BY v.id";
    PICTURE = "SELECT v.image_sha256, v.image_kind FROM views v JOIN landmarks l ON l.id = v.landmark_id \
               JOIN maps m ON m.id = l.map_id WHERE m.name = $1 AND l.name = $2 AND v.id = $3";
    COUNT_DISTRACTORS = "SELECT count(*) FROM strangers WHERE map_id = $1";
    INSERT_DISTRACTOR = "INSERT INTO strangers (map_id, image_sha256, corners_px, icon_side, icon, icon_scale) \
                       VALUES ($1, $2, $3, $4, $5, $6) ON CONFLICT DO NOTHING";
    DISTRACTORS = "SELECT image_sha256, corners_px, icon_side, icon, icon_scale FROM strangers \
                 WHERE map_id = $1 ORDER BY id";
}

/// Distractors of one map; further ones are not stored.
pub(crate) const MAX_DISTRACTORS: usize = 1_000;

/// A quad of a picture: its corners (px) and its icon.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct QuadCrop {
    pub(crate) corners_px: Corners,
    pub(crate) icon: Icon,
}

/// A view to be stored.
#[derive(Debug, Clone)]
pub(crate) struct NewView {
    pub(crate) image: Vec<u8>,
    pub(crate) image_sha256: Digest,
    /// `png` or `jpeg`.
    pub(crate) image_kind: &'static str,
    pub(crate) size_px: [usize; 2],
    pub(crate) crop: QuadCrop,
    /// Quads of the picture that do not overlap the landmark.
    pub(crate) distractors: Vec<QuadCrop>,
    /// How it was taken: JSON of a checked `landmark_placement::StoredCapture`.
    pub(crate) capture: Option<String>,
}

/// A stored view without picture and icon.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ViewRow {
    pub(crate) id: i64,
    pub(crate) image_kind: String,
    pub(crate) size_px: [u32; 2],
    pub(crate) corners_px: [[f64; 2]; 4],
    pub(crate) created_ms: i64,
}

/// A training view without its picture, as learning needs it.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct TrainingViewRow {
    pub(crate) view: i64,
    pub(crate) landmark: LandmarkId,
    pub(crate) image_sha256: Digest,
    pub(crate) size_px: [usize; 2],
    pub(crate) crop: QuadCrop,
}

pub(super) fn corners_bytes(corners: &Corners) -> Vec<u8> {
    point_bytes(&corners.points().map(|c| [c.x, c.y]))
}

/// The column of four points.
pub(super) fn point_bytes(corners_px: &[[f64; 2]; 4]) -> Vec<u8> {
    corners_px.iter().flatten().flat_map(|v| v.to_le_bytes()).collect()
}

fn corners_of(bytes: &[u8]) -> Option<[[f64; 2]; 4]> {
    let numbers: Vec<f64> = bytes.as_chunks::<8>().0.iter().map(|b| f64::from_le_bytes(*b)).collect();
    let [ax, ay, bx, by, cx, cy, dx, dy] = numbers.try_into().ok()?;
    Some([[ax, ay], [bx, by], [cx, cy], [dx, dy]])
}

/// Grey levels as learning takes them: whole numbers.
pub(super) fn icon_bytes(icon: &Icon) -> Vec<u8> {
    icon.pixels.iter().map(|g| g.round().clamp(0.0, 255.0) as u8).collect()
}

fn damaged(what: &str) -> impl Fn(String) -> StoreError {
    move |reason| StoreError::Damaged { what: what.to_owned(), reason }
}

/// The corners of a view.
pub(super) fn corners_in(row: &Row) -> Result<Corners, StoreError> {
    let bytes: &[u8] = row.try_get("corners_px").map_err(StoreError::during("read corners"))?;
    let corners = corners_of(bytes).ok_or_else(|| damaged("corners")("not four points".into()))?;
    Corners::try_from(corners).map_err(|e| damaged("corners")(e.to_string()))
}

pub(super) fn crop_of(row: &Row) -> Result<QuadCrop, StoreError> {
    Ok(QuadCrop { corners_px: corners_in(row)?, icon: icon_of(row)? })
}

fn icon_of(row: &Row) -> Result<Icon, StoreError> {
    let at = || StoreError::during("read icon");
    let side: i64 = row.try_get("icon_side").map_err(at())?;
    let bytes: &[u8] = row.try_get("icon").map_err(at())?;
    let scale = row.try_get("icon_scale").map_err(at())?;
    let pixels = bytes.iter().map(|g| f32::from(*g)).collect();
    Icon::new(side as usize, pixels, scale).map_err(|e| damaged("icon")(e.to_string()))
}

pub(super) fn digest_of(row: &Row) -> Result<Digest, StoreError> {
    let bytes: &[u8] = row.try_get("image_sha256").map_err(StoreError::during("read digest"))?;
    bytes.try_into().map_err(|_length| damaged("digest")("not 32 bytes".into()))
}

fn view_row(row: &Row) -> Result<ViewRow, StoreError> {
    let at = || StoreError::during("read view");
    let corners: &[u8] = row.try_get("corners_px").map_err(at())?;
    Ok(ViewRow {
        id: row.try_get("id").map_err(at())?,
        image_kind: row.try_get("image_kind").map_err(at())?,
        size_px: [row.try_get("width_px").map_err(at())?, row.try_get("height_px").map_err(at())?],
        corners_px: corners_of(corners).ok_or_else(|| damaged("corners")("not four points".into()))?,
        created_ms: row.try_get("created_ms").map_err(at())?,
    })
}

/// What became of an uploaded view.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum UploadOutcome {
    /// Stored.
    New,
    /// A duplicate: the same quad of the same picture is stored already.
    Duplicate,
    /// A near-duplicate of a stored view: not stored, since learning would gain nothing by it.
    NearDuplicate,
}

/// The view of a landmark that shows the same quad of the same picture.
pub(super) async fn same(tx: &mut Tx, landmark: i64, new: &NewView) -> Result<Option<ViewRow>, StoreError> {
    let corners = corners_bytes(&new.crop.corners_px);
    let same = db::query(SAME).bind(landmark).bind(&new.image_sha256[..]).bind(&corners);
    let row = same.fetch_optional(&mut tx.conn).await.map_err(StoreError::during("look for view"))?;
    row.as_ref().map(view_row).transpose()
}

/// One view.
pub(super) async fn get(db: impl Executor<'_>, view: i64) -> Result<ViewRow, StoreError> {
    let row = db::query(GET).bind(view).fetch_optional(db).await.map_err(StoreError::during("read view"))?;
    view_row(&row.ok_or_else(|| StoreError::NotFound { what: Kind::View, name: view.to_string() })?)
}

/// The crops of a landmark's views, by number.
pub(super) async fn crops(db: impl Executor<'_>, landmark: i64) -> Result<Vec<(i64, QuadCrop)>, StoreError> {
    let rows = db::query(CROPS).bind(landmark).fetch_all(db).await;
    let rows = rows.map_err(StoreError::during("read views"))?;
    let crop = |row: &Row| Ok((row.try_get("id").map_err(StoreError::during("read views"))?, crop_of(row)?));
    rows.iter().map(crop).collect()
}

/// Stores a new view of a landmark (numbers of map and landmark). Errors: more than `max` views.
pub(super) async fn add(
    tx: &mut Tx,
    (map, landmark): (i64, i64),
    new: &NewView,
    max: usize,
) -> Result<ViewRow, StoreError> {
    pictures::put(tx, &new.image_sha256, &new.image).await?;
    let corners = corners_bytes(&new.crop.corners_px);
    let created_ms = now_ms();
    let id = db::query_scalar(INSERT)
        .bind(landmark)
        .bind(&new.image_sha256[..])
        .bind(new.image_kind)
        .bind(new.size_px[0] as i64)
        .bind(new.size_px[1] as i64)
        .bind(&corners)
        .bind(new.crop.icon.size as i64)
        .bind(icon_bytes(&new.crop.icon))
        .bind(new.crop.icon.source_scale)
        .bind(created_ms)
        .bind(&new.capture)
        .fetch_one(&mut tx.conn)
        .await
        .map_err(StoreError::during("store view"))?;
    let count = db::query_scalar(COUNT).bind(landmark).fetch_one(&mut tx.conn).await;
    within(count.map_err(StoreError::during("count views"))?, max, "views of a landmark")?;
    add_distractors(tx, map, new).await?;
    Ok(ViewRow {
        id,
        image_kind: new.image_kind.to_owned(),
        size_px: new.size_px.map(|s| s as u32),
        corners_px: new.crop.corners_px.into(),
        created_ms,
    })
}

async fn add_distractors(tx: &mut Tx, map_id: i64, new: &NewView) -> Result<(), StoreError> {
    let count: i64 = db::query_scalar(COUNT_DISTRACTORS)
        .bind(map_id)
        .fetch_one(&mut tx.conn)
        .await
        .map_err(StoreError::during("count distractors"))?;
    for distractor in new.distractors.iter().take(MAX_DISTRACTORS.saturating_sub(count as usize)) {
        db::query(INSERT_DISTRACTOR)
            .bind(map_id)
            .bind(&new.image_sha256[..])
            .bind(corners_bytes(&distractor.corners_px))
            .bind(distractor.icon.size as i64)
            .bind(icon_bytes(&distractor.icon))
            .bind(distractor.icon.source_scale)
            .execute(&mut tx.conn)
            .await
            .map_err(StoreError::during("store distractor"))?;
    }
    Ok(())
}

/// Which views are listed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct ViewFilter {
    /// With a capture, or without one.
    pub(crate) has_capture: Option<bool>,
    /// ms since the Unix epoch, included.
    pub(crate) since_ms: Option<i64>,
    /// Not included.
    pub(crate) until_ms: Option<i64>,
}

/// Views of a landmark after the one with the number `last`, in order or the newest first.
pub(crate) async fn page(
    db: impl Executor<'_>,
    landmark_id: i64,
    filter: ViewFilter,
    (last, newest_first): (Option<i64>, bool),
    limit: usize,
) -> Result<Vec<ViewRow>, StoreError> {
    let (above, below) = if newest_first { (None, last) } else { (last, None) };
    let rows = db::query(PAGE)
        .bind(landmark_id)
        .bind(above.unwrap_or(0))
        .bind(below.unwrap_or(i64::MAX))
        .bind(filter.has_capture)
        .bind(filter.since_ms)
        .bind(filter.until_ms)
        .bind(newest_first)
        .bind(limit as i64);
    let rows = rows.fetch_all(db).await.map_err(StoreError::during("list views"))?;
    rows.iter().map(view_row).collect()
}

/// How many views a list has.
pub(crate) async fn count(
    db: impl Executor<'_>,
    landmark_id: i64,
    filter: ViewFilter,
) -> Result<u64, StoreError> {
    let count = db::query_scalar::<i64>(COUNT_FILTERED)
        .bind(landmark_id)
        .bind(filter.has_capture)
        .bind(filter.since_ms)
        .bind(filter.until_ms);
    count.fetch_one(db).await.map(|n| n as u64).map_err(StoreError::during("count views"))
}

/// The icon of a view.
pub(crate) async fn icon(
    db: impl Executor<'_>,
    map: &str,
    landmark: &str,
    view: i64,
) -> Result<Icon, StoreError> {
    let row = db::query(ICON).bind(map).bind(landmark).bind(view).fetch_optional(db).await;
    let row = row.map_err(StoreError::during("read icon"))?;
    icon_of(&row.ok_or_else(|| StoreError::NotFound { what: Kind::View, name: view.to_string() })?)
}

/// Deletes a view. What was learnt from it stays until the landmark is learnt again.
pub(crate) async fn delete(tx: &mut Tx, map: &str, landmark: &str, view: i64) -> Result<(), StoreError> {
    let landmark = landmarks::get(&mut tx.conn, map, landmark).await?;
    let done = db::query(DELETE).bind(view).bind(landmark.id).execute(&mut tx.conn).await;
    match done.map_err(StoreError::during("delete view"))?.rows_affected() {
        0 => Err(StoreError::NotFound { what: Kind::View, name: view.to_string() }),
        _ => Ok(()),
    }
}

/// Every view of a map, without pictures.
pub(crate) async fn of_map(db: impl Executor<'_>, map_id: i64) -> Result<Vec<TrainingViewRow>, StoreError> {
    let at = || StoreError::during("read views");
    let rows = db::query(OF_MAP).bind(map_id).fetch_all(db).await.map_err(at())?;
    let view = |row: &Row| {
        let pixels = |column: &str| row.try_get::<i64, _>(column).map(|s| s as usize).map_err(at());
        Ok(TrainingViewRow {
            view: row.try_get("id").map_err(at())?,
            landmark: LandmarkId(row.try_get::<i64, _>("landmark_id").map_err(at())? as u64),
            image_sha256: digest_of(row)?,
            size_px: [pixels("width_px")?, pixels("height_px")?],
            crop: crop_of(row)?,
        })
    };
    rows.iter().map(view).collect()
}

/// Digest and kind (`png` or `jpeg`) of the picture of a view.
pub(crate) async fn picture(
    db: impl Executor<'_>,
    map: &str,
    landmark: &str,
    view: i64,
) -> Result<(Digest, String), StoreError> {
    let at = || StoreError::during("read view");
    let row = db::query(PICTURE).bind(map).bind(landmark).bind(view).fetch_optional(db).await;
    let row = row.map_err(at())?;
    let row = row.ok_or_else(|| StoreError::NotFound { what: Kind::View, name: view.to_string() })?;
    Ok((digest_of(&row)?, row.try_get("image_kind").map_err(at())?))
}

/// The distractors of a map, each with the digest of its picture.
pub(crate) async fn distractors(
    db: impl Executor<'_>,
    map_id: i64,
) -> Result<Vec<(Digest, QuadCrop)>, StoreError> {
    let rows = db::query(DISTRACTORS)
        .bind(map_id)
        .fetch_all(db)
        .await
        .map_err(StoreError::during("read distractors"))?;
    rows.iter().map(|row| Ok((digest_of(row)?, crop_of(row)?))).collect()
}
