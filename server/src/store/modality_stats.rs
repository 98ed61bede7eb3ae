//! Modality statistics of a map's reference runs, the areas that people named, and the fusion mode.

use super::{
    StoreError, Tx,
    db::{self, Executor, Row},
    kind::Kind,
    maps, now_ms,
    statements::statements,
    text_revision, within,
};
use map::modality_stats::{FusionMode, MAX_AREAS, NamedArea, PoseCell, StatsByModality};
use sha2::{Digest as _, Sha256};
use std::collections::BTreeMap;

/// Reference runs of a map.
pub(crate) const MAX_RUNS: usize = 200;

statements! {
    SETTINGS = "SELECT fusion, areas FROM maps WHERE id = $1";
    SET = "UPDATE maps SET fusion = $2, areas = $3 WHERE id = $1";
    RUNS = "SELECT id, robot, created_ms, way_m, cells FROM runs WHERE map_id = $1 ORDER BY id";
    COUNT = "SELECT count(*) FROM runs WHERE map_id = $1";
    NUMBERS = "SELECT id FROM runs WHERE map_id = $1 ORDER BY id";
    INSERT = "INSERT INTO runs (map_id, robot, created_ms, way_m, cells) VALUES ($1, $2, $3, $4, $5) RETURNING id";
    DELETE = "DELETE FROM runs WHERE map_id = $1 AND id = $2";
}

/// A reference run with its modality statistics by pose cell.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ReferenceRunRow {
    pub(crate) id: i64,
    pub(crate) robot: String,
    pub(crate) created_ms: i64,
    pub(crate) way_m: f64,
    pub(crate) cells: BTreeMap<PoseCell, StatsByModality>,
}

/// The settings of a map: fusion mode and named areas.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct ModalitySettings {
    pub(crate) mode: FusionMode,
    pub(crate) named: Vec<NamedArea>,
}

/// The word of the column.
pub(super) fn mode_word(mode: FusionMode) -> &'static str {
    match mode {
        FusionMode::All => "all",
        FusionMode::NearBest => "near_best",
        FusionMode::Best => "best",
    }
}

pub(super) fn mode_of(word: &str) -> FusionMode {
    match word {
        "near_best" => FusionMode::NearBest,
        "best" => FusionMode::Best,
        _ => FusionMode::All,
    }
}

fn json<T: serde::Serialize>(what: &'static str, value: &T) -> Result<String, StoreError> {
    let damaged = |e: serde_json::Error| StoreError::Damaged { what: what.to_owned(), reason: e.to_string() };
    serde_json::to_string(value).map_err(damaged)
}

/// Modality statistics of a run; cells out of range (a file of another program) are left out.
fn cells_of(text: &str) -> BTreeMap<PoseCell, StatsByModality> {
    let read: Vec<(PoseCell, StatsByModality)> = serde_json::from_str(text).unwrap_or_else(|error| {
        tracing::warn!(%error, "run_statistics_unreadable: not used");
        Vec::new()
    });
    read.into_iter()
        .filter(|(_, by_modality)| by_modality.iter().all(|stats| stats.check().is_ok()))
        .collect()
}

fn run_row(row: &Row) -> Result<ReferenceRunRow, db::Error> {
    Ok(ReferenceRunRow {
        id: row.try_get("id")?,
        robot: row.try_get("robot")?,
        created_ms: row.try_get("created_ms")?,
        way_m: row.try_get("way_m")?,
        cells: cells_of(&row.try_get::<String, _>("cells")?),
    })
}

/// The settings of a map.
pub(crate) async fn settings(db: impl Executor<'_>, map_id: i64) -> Result<ModalitySettings, StoreError> {
    let at = || StoreError::during("read areas");
    let row = db::query(SETTINGS).bind(map_id).fetch_one(db).await.map_err(at())?;
    let mode = mode_of(&row.try_get::<String, _>("fusion").map_err(at())?);
    let named: String = row.try_get("areas").map_err(at())?;
    let named: Vec<NamedArea> = serde_json::from_str(&named).unwrap_or_default();
    Ok(ModalitySettings { mode, named: named.into_iter().filter(|area| area.check().is_ok()).collect() })
}

/// The revision of a fusion mode and named areas.
pub(crate) fn revision(settings: &ModalitySettings) -> String {
    text_revision(&json("areas", &(mode_word(settings.mode), &settings.named)).unwrap_or_default())
}

/// Changes the settings of a map; `change` gets the present ones.
pub(crate) async fn set(
    tx: &mut Tx,
    map: &str,
    change: impl FnOnce(ModalitySettings) -> ModalitySettings + Send,
) -> Result<(), StoreError> {
    let map = maps::get(&mut tx.conn, map).await?;
    let new = change(settings(&mut tx.conn, map.id).await?);
    within(new.named.len() as i64, MAX_AREAS, "areas")?;
    db::query(SET)
        .bind(map.id)
        .bind(mode_word(new.mode))
        .bind(json("areas", &new.named)?)
        .execute(&mut tx.conn)
        .await
        .map_err(StoreError::during("store areas"))?;
    maps::bump(tx, map.id).await
}

/// The runs of a map, oldest first.
pub(crate) async fn runs(db: impl Executor<'_>, map_id: i64) -> Result<Vec<ReferenceRunRow>, StoreError> {
    let rows = db::query(RUNS).bind(map_id).fetch_all(db).await.map_err(StoreError::during("read runs"))?;
    rows.iter().map(run_row).collect::<Result<_, _>>().map_err(StoreError::during("read runs"))
}

/// Stores a reference run; gives it as it is read.
pub(crate) async fn add(
    tx: &mut Tx,
    map: &str,
    robot: &str,
    way_m: f64,
    cells: &BTreeMap<PoseCell, StatsByModality>,
) -> Result<ReferenceRunRow, StoreError> {
    let map = maps::get(&mut tx.conn, map).await?;
    let (text, created_ms) = (json("a run", &cells.iter().collect::<Vec<_>>())?, now_ms());
    let id = db::query_scalar(INSERT)
        .bind(map.id)
        .bind(robot)
        .bind(created_ms)
        .bind(way_m)
        .bind(&text)
        .fetch_one(&mut tx.conn)
        .await
        .map_err(StoreError::during("store run"))?;
    let count = db::query_scalar(COUNT).bind(map.id).fetch_one(&mut tx.conn).await;
    within(count.map_err(StoreError::during("count runs"))?, MAX_RUNS, "runs")?;
    maps::bump(tx, map.id).await?;
    // Through the text: its numbers have fewer digits.
    Ok(ReferenceRunRow { id, robot: robot.to_owned(), created_ms, way_m, cells: cells_of(&text) })
}

/// Deletes a reference run with its statistics.
pub(crate) async fn delete(tx: &mut Tx, map: &str, id: i64) -> Result<(), StoreError> {
    let map = maps::get(&mut tx.conn, map).await?;
    let deleted = db::query(DELETE).bind(map.id).bind(id).execute(&mut tx.conn).await;
    if deleted.map_err(StoreError::during("delete run"))?.rows_affected() == 0 {
        return Err(StoreError::NotFound { what: Kind::ReferenceRun, name: id.to_string() });
    }
    maps::bump(tx, map.id).await
}

/// Count of a map's reference runs, and the beginning of the digest of their numbers: runs never
/// change and their numbers are never used for others.
pub(crate) async fn run_numbers(conn: &mut db::Conn, map_id: i64) -> Result<(i64, i64), StoreError> {
    let at = || StoreError::during("count runs");
    let numbers: Vec<i64> = db::query_scalar(NUMBERS).bind(map_id).fetch_all(conn).await.map_err(at())?;
    let mut digest = Sha256::new();
    for number in &numbers {
        digest.update(number.to_le_bytes());
    }
    let first = digest.finalize().first_chunk::<8>().copied().unwrap_or_default();
    Ok((numbers.len() as i64, i64::from_le_bytes(first)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::publication::{Catalogue, tests::config};
    use map::modality_stats::ModalityMap;
    use std::sync::Arc;
    use vision::recognise::DistanceKind;

    crate::store::tests::cluster::on_each_store! {
        runs_and_areas_survive_and_are_published,
        runs_are_bounded,
    }

    fn statistics(x: i32) -> BTreeMap<PoseCell, StatsByModality> {
        [(PoseCell { x, y: -2, heading: 3 }, StatsByModality::default())].into()
    }

    async fn put(store: &Catalogue, x: i32) -> Result<i64, StoreError> {
        let write =
            store.write(move |tx| Box::pin(async move { add(tx, "a", "r1", 12.5, &statistics(x)).await }));
        write.await.map(|run| run.id)
    }

    fn known(store: &Catalogue) -> (u64, Arc<ModalityMap>) {
        let map = store.snapshots().get("a").unwrap();
        (map.version, map.modalities.clone())
    }

    async fn runs_and_areas_survive_and_are_published() {
        let dir = tempfile::tempdir().unwrap();
        let config = config(dir.path());
        let (store, task) = Catalogue::open(&config).await.unwrap();
        store.write(|tx| Box::pin(maps::create(tx, "a", DistanceKind::Both, 3))).await.unwrap();
        let first = put(&store, 1).await.unwrap();
        let second = put(&store, 2).await.unwrap();
        assert_eq!(known(&store).1.cells().count(), 2);
        let hall = NamedArea { name: "hall".into(), corners_m: vec![[0.0, 0.0], [4.0, 0.0], [4.0, 3.0]] };
        let named = vec![hall.clone()];
        let settings = ModalitySettings { mode: FusionMode::Best, named };
        store.write(|tx| Box::pin(async move { set(tx, "a", |_| settings).await })).await.unwrap();
        let (version, areas) = known(&store);
        assert_eq!((areas.mode(), areas.named().count(), areas.cells().count()), (FusionMode::Best, 1, 2));
        // An unrelated edit makes a new version and keeps the same statistics.
        store
            .write(|tx| {
                Box::pin(async { crate::store::walls::replace(tx, "a", &[[0.0, 0.0, 1.0, 0.0]]).await })
            })
            .await
            .unwrap();
        let after = known(&store);
        assert!(after.0 > version && Arc::ptr_eq(&after.1, &areas));
        store.write(move |tx| Box::pin(async move { delete(tx, "a", first).await })).await.unwrap();
        assert_eq!(known(&store).1.cells().map(|(cell, ..)| cell.x).collect::<Vec<_>>(), [2]);
        let again = store.write(move |tx| Box::pin(async move { delete(tx, "a", first).await })).await;
        assert!(matches!(again, Err(StoreError::NotFound { what: Kind::ReferenceRun, .. })));
        task.close().await;
        let (store, task) = Catalogue::open(&config).await.unwrap();
        let areas = known(&store).1;
        assert_eq!((areas.mode(), areas.named().next().unwrap().0), (FusionMode::Best, &hall));
        let id = maps::get(store.reads(), "a").await.unwrap().id;
        let kept = runs(store.reads(), id).await.unwrap();
        assert_eq!(
            (kept.len(), kept[0].id, kept[0].way_m, &kept[0].cells),
            (1, second, 12.5, &statistics(2))
        );
        task.close().await;
    }

    async fn runs_are_bounded() {
        let dir = tempfile::tempdir().unwrap();
        let (store, task) = Catalogue::open(&config(dir.path())).await.unwrap();
        store.write(|tx| Box::pin(maps::create(tx, "a", DistanceKind::Both, 3))).await.unwrap();
        for x in 0..MAX_RUNS {
            put(&store, x as i32).await.unwrap();
        }
        assert!(matches!(put(&store, 0).await, Err(StoreError::Limit { what: "runs", max: MAX_RUNS })));
        assert_eq!(known(&store).1.cells().count(), MAX_RUNS);
        task.close().await;
    }
}
