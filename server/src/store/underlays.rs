//! The picture that is shown under a map: at most one, replaced as a whole.

use super::{
    StoreError, Tx,
    db::{self, Executor},
    kind::Kind,
    maps, now_ms,
    pictures::{self, Digest},
    statements::statements,
    views,
};

statements! {
    PUT = "INSERT INTO underlays (map_id, image_sha256, image_kind, width_px, height_px, metres_per_pixel, x_m, y_m, \
           theta_rad, created_ms) VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9, $10) ON CONFLICT (map_id) DO UPDATE SET \
           image_sha256 = excluded.image_sha256, image_kind = excluded.image_kind, width_px = excluded.width_px, \
           height_px = excluded.height_px, metres_per_pixel = excluded.metres_per_pixel, x_m = excluded.x_m, \
           y_m = excluded.y_m, theta_rad = excluded.theta_rad, created_ms = excluded.created_ms";
    GET = "SELECT image_sha256, image_kind, width_px, height_px, metres_per_pixel, x_m, y_m, theta_rad, created_ms FROM underlays \
           WHERE map_id = $1";
    DELETE = "DELETE FROM underlays WHERE map_id = $1";
}

/// An underlay without its picture.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct UnderlayRow {
    pub(crate) image_sha256: Digest,
    /// `png` or `jpeg`.
    pub(crate) image_kind: String,
    /// Width and height of the upright picture.
    pub(crate) size_px: [u32; 2],
    pub(crate) metres_per_pixel: f64,
    /// `map_from_picture`: x, y (m) and heading (rad) of the lower left corner, x to the right, y
    /// up.
    pub(crate) map_from_picture: [f64; 3],
    pub(crate) created_ms: i64,
}

fn none_of(map: &str) -> StoreError {
    StoreError::NotFound { what: Kind::Underlay, name: map.to_owned() }
}

/// Replaces the underlay of a map.
pub(crate) async fn put(
    tx: &mut Tx,
    map: &str,
    mut row: UnderlayRow,
    image: &[u8],
) -> Result<UnderlayRow, StoreError> {
    let map = maps::get(&mut tx.conn, map).await?;
    row.created_ms = now_ms();
    pictures::put(tx, &row.image_sha256, image).await?;
    insert(tx, map.id, &row).await?;
    maps::bump(tx, map.id).await?;
    Ok(row)
}

/// Stores the row of an underlay whose picture is there.
pub(super) async fn insert(tx: &mut Tx, map: i64, row: &UnderlayRow) -> Result<(), StoreError> {
    let ([width_px, height_px], [x_m, y_m, theta_rad]) = (row.size_px, row.map_from_picture);
    let done = db::query(PUT)
        .bind(map)
        .bind(&row.image_sha256[..])
        .bind(&row.image_kind)
        .bind(width_px)
        .bind(height_px)
        .bind(row.metres_per_pixel)
        .bind(x_m)
        .bind(y_m)
        .bind(theta_rad)
        .bind(row.created_ms)
        .execute(&mut tx.conn)
        .await;
    done.map_err(StoreError::during("store underlay")).map(drop)
}

/// The underlay of a map.
pub(crate) async fn get(db: impl Executor<'_>, (map, name): (i64, &str)) -> Result<UnderlayRow, StoreError> {
    let at = || StoreError::during("read underlay");
    let row = db::query(GET).bind(map).fetch_optional(db).await.map_err(at())?;
    let row = row.ok_or_else(|| none_of(name))?;
    let image_sha256 = views::digest_of(&row)?;
    let read = || {
        Ok(UnderlayRow {
            image_sha256,
            image_kind: row.try_get("image_kind")?,
            size_px: [row.try_get("width_px")?, row.try_get("height_px")?],
            metres_per_pixel: row.try_get("metres_per_pixel")?,
            map_from_picture: [row.try_get("x_m")?, row.try_get("y_m")?, row.try_get("theta_rad")?],
            created_ms: row.try_get("created_ms")?,
        })
    };
    read().map_err(at())
}

/// Deletes the underlay of a map.
pub(crate) async fn delete(tx: &mut Tx, map: &str) -> Result<(), StoreError> {
    let map = maps::get(&mut tx.conn, map).await?;
    let done = db::query(DELETE).bind(map.id).execute(&mut tx.conn).await;
    if done.map_err(StoreError::during("delete underlay"))?.rows_affected() == 0 {
        return Err(none_of(&map.name));
    }
    maps::bump(tx, map.id).await
}
