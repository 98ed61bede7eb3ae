//! Views of a landmark as the ratio of its sides needs them (method 16.7).

use super::{
    StoreError,
    db::{self, Executor},
    landmark_placement,
    statements::statements,
    views::corners_in,
};
use vision::learn::aspect::AspectView;

statements! {
    ASPECTS = "SELECT width_px, height_px, corners_px, capture FROM views WHERE landmark_id = $1 ORDER BY id DESC LIMIT 64";
}

/// Corners, sizes and cameras of the newest views of a landmark.
pub(crate) async fn aspect_views(
    db: impl Executor<'_>,
    landmark: i64,
) -> Result<Vec<AspectView>, StoreError> {
    let at = || StoreError::during("read the corners of views");
    let rows = db::query(ASPECTS).bind(landmark).fetch_all(db).await.map_err(at())?;
    let view = |row: &db::Row| -> Result<AspectView, StoreError> {
        let side = |column: &str| row.try_get::<u32, _>(column).map_err(at());
        let capture: Option<&str> = row.try_get("capture").map_err(at())?;
        Ok(AspectView {
            corners_px: corners_in(row)?,
            size_px: [side("width_px")? as usize, side("height_px")? as usize],
            camera: capture.and_then(landmark_placement::camera_of),
        })
    };
    rows.iter().map(view).collect()
}
