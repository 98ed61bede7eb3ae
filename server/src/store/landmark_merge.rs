//! Two landmarks that are one object become one. In: the names of both. Out: the kept one, with the
//! views of the other.

use super::{
    Store, StoreError, Tx, db,
    landmark_placement::{self, PlacementOutcome},
    landmarks::{self, LandmarkGeometry, LandmarkRow},
    maps,
    revisions::{self, Precondition, Subject},
    statements::statements,
    teaching::{self, ATTEMPTS, Stamp},
    within,
};
use crate::store::kind::Kind;
use std::sync::Arc;

statements! {
    // Numbers of views are not used again: each gets a new one. The same quad of the same picture
    // counts once.
    COPY_VIEWS = "INSERT INTO views (landmark_id, image_sha256, image_kind, width_px, height_px, corners_px, created_ms, \
                  icon_side, icon_scale, capture, icon) SELECT $2, v.image_sha256, v.image_kind, v.width_px, v.height_px, \
                  v.corners_px, v.created_ms, v.icon_side, v.icon_scale, v.capture, v.icon FROM views v \
                  WHERE v.landmark_id = $1 AND NOT EXISTS (SELECT 1 FROM views k WHERE k.landmark_id = $2 \
                  AND k.image_sha256 = v.image_sha256 AND k.corners_px = v.corners_px) ORDER BY v.id";
    COUNT = "SELECT count(*) FROM views WHERE landmark_id = $1";
}

/// Two landmarks of a map to be made one.
#[derive(Debug)]
pub(crate) struct Merge {
    /// Name of the map.
    pub(crate) map: String,
    /// Name of the landmark that stays.
    pub(crate) into: String,
    /// Name of the landmark that goes.
    pub(crate) from: String,
    /// The revisions of `into` that it is meant for.
    pub(crate) is: Precondition,
    /// Most views of a landmark.
    pub(crate) max: usize,
}

/// What was computed for a merge, and what it rests on.
struct Prepared {
    into: Stamp,
    from: Stamp,
    /// The geometry of `into`; what it lacks is that of `from`.
    geometry: LandmarkGeometry,
    placement: PlacementOutcome,
}

/// Moves the views of `from` to `into`, gives it the size and place that it lacks, places it anew
/// unless its place is by hand, and deletes `from`, all in one transaction. Its model stays until
/// it is learnt again. Errors: `ChangedMeanwhile`, `TooMany`.
pub(crate) async fn merge(store: &Store, merge: Merge) -> Result<LandmarkRow, StoreError> {
    let merge = Arc::new(merge);
    let _turn = store.preparing().await;
    for _ in 0..ATTEMPTS {
        let (prepared, asked) = (prepare(store, &merge).await?, merge.clone());
        let done = store.write(move |tx| Box::pin(async move { write(tx, &asked, prepared).await }));
        match done.await {
            Err(StoreError::Changed) => {}
            done => return done,
        }
    }
    Err(StoreError::Busy)
}

async fn stamp_of(store: &Store, map: &str, landmark: &str) -> Result<Stamp, StoreError> {
    let stamp = teaching::stamp(store.reads(), map, landmark).await?;
    stamp.ok_or_else(|| StoreError::NotFound { what: Kind::Landmark, name: landmark.to_owned() })
}

async fn prepare(store: &Store, Merge { map, into, from, .. }: &Merge) -> Result<Prepared, StoreError> {
    let number = maps::get(store.reads(), map).await?.id;
    // They are read first, so that the write notices whatever changes after it.
    let (into, from) = (stamp_of(store, map, into).await?, stamp_of(store, map, from).await?);
    let mut captures = landmark_placement::captures(store.reads(), into.landmark()).await?;
    captures.extend(landmark_placement::captures(store.reads(), from.landmark()).await?);
    let walls = teaching::wall_segments(store, number).await?;
    let geometry = into.geometry.or(&from.geometry);
    let work = move || Prepared {
        placement: landmark_placement::place_landmark(&captures, &walls, &geometry),
        into,
        from,
        geometry,
    };
    teaching::computed(store, "a merge", work).await
}

async fn write(tx: &mut Tx, asked: &Merge, prepared: Prepared) -> Result<LandmarkRow, StoreError> {
    let Merge { map, into, from, is, max } = asked;
    revisions::check(tx, map, &Subject::Landmark(into.clone()), is).await?;
    for (name, was) in [(into, &prepared.into), (from, &prepared.from)] {
        if teaching::stamp(&mut tx.conn, map, name).await?.as_ref() != Some(was) {
            return Err(StoreError::Changed);
        }
    }
    let at = || StoreError::during("move views");
    let (kept, gone) = (prepared.into.landmark(), prepared.from.landmark());
    db::query(COPY_VIEWS).bind(gone).bind(kept).execute(&mut tx.conn).await.map_err(at())?;
    let count = db::query_scalar(COUNT).bind(kept).fetch_one(&mut tx.conn).await.map_err(at())?;
    within(count, *max, "views of a landmark")?;
    landmarks::update(tx, map, into, |_| prepared.geometry).await?;
    landmark_placement::put(tx, map, into, prepared.placement).await?;
    landmarks::delete(tx, map, from).await?;
    landmarks::get(&mut tx.conn, map, into).await
}
