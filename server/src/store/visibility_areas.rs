//! Visibility areas as they were computed, by landmark: derived data, so that a start computes none
//! again. In: digests of inputs, areas as bytes. Out: the bytes of the areas whose inputs are the
//! same.

use super::{
    Store, StoreError,
    db::{self, Pool},
    statements::statements,
};
use vision::model::LandmarkId;

statements! {
    GET = "SELECT area FROM visibility_areas WHERE landmark_id = $1 AND inputs_sha256 = $2";
    PUT = "INSERT INTO visibility_areas (landmark_id, inputs_sha256, area) SELECT $1, $2, $3 \
           WHERE EXISTS (SELECT 1 FROM landmarks WHERE id = $1) \
           ON CONFLICT (landmark_id) DO UPDATE SET inputs_sha256 = excluded.inputs_sha256, area = excluded.area";
}

/// Largest area that is stored; of the column, too. A larger one is computed at every start.
const MAX_AREA_BYTES: usize = 256 << 10;
/// Most bytes of areas that are read at a time; what is beyond is computed.
const MAX_READ_BYTES: usize = 64 << 20;
/// Most areas in one transaction: other writes wait for it.
const MAX_BATCH: usize = 200;

/// An area with the digest of what it depends on.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct StoredArea {
    pub(crate) landmark: LandmarkId,
    /// SHA-256.
    pub(crate) inputs: [u8; 32],
    pub(crate) area: Vec<u8>,
}

/// The areas of these landmarks that are stored for these inputs.
pub(crate) async fn get(db: &Pool, wanted: &[(LandmarkId, [u8; 32])]) -> Result<Vec<StoredArea>, StoreError> {
    let at = || StoreError::during("read visibility areas");
    let (mut found, mut bytes) = (Vec::new(), 0);
    for (landmark, inputs) in wanted {
        let row = db::query(GET).bind(landmark.0 as i64).bind(inputs.as_slice()).fetch_optional(db).await;
        let Some(row) = row.map_err(at())? else { continue };
        let area: Vec<u8> = row.try_get("area").map_err(at())?;
        bytes += area.len();
        if bytes > MAX_READ_BYTES {
            break;
        }
        found.push(StoredArea { landmark: *landmark, inputs: *inputs, area });
    }
    Ok(found)
}

/// Stores areas of landmarks that are still there. No version of a map follows from it.
pub(crate) async fn put(store: &Store, areas: Vec<StoredArea>) -> Result<(), StoreError> {
    let mut areas = areas.into_iter().filter(|area| area.area.len() <= MAX_AREA_BYTES);
    loop {
        let batch: Vec<StoredArea> = areas.by_ref().take(MAX_BATCH).collect();
        if batch.is_empty() {
            return Ok(());
        }
        let write = store.write(move |tx| {
            Box::pin(async move {
                for StoredArea { landmark, inputs, area } in batch {
                    let put = db::query(PUT).bind(landmark.0 as i64).bind(inputs.to_vec()).bind(area);
                    put.execute(&mut tx.conn).await.map_err(StoreError::during("store visibility areas"))?;
                }
                Ok(())
            })
        });
        write.await?;
    }
}
