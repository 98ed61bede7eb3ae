//! From rows to the immutable snapshot of a map. Models are taken over from the previous version where the digest is
//! the same; a damaged or outdated model is named and left out, never matched.
//!
//! A map that cannot be made ready ends nothing: its previous version stays in use, at the start none, the map is named in
//! the log and at `/readyz`, and the next write to it tries again.

use super::{
    StoreError, areas, landmarks, laser, maps,
    models::{self, ModelDigest},
    robots, seen, sights, sites,
    statements::statements,
};
use crate::{
    engine::{
        doubles::{self, Doubles},
        panics::{Edge, Panics},
        snapshot::{LandmarkInfo, Learnt, MapSnapshot, Snapshots},
    },
    vitals::Vitals,
};
use futures::FutureExt;
use map::{
    check::OutOfRange,
    laser_fix::WallIndex,
    place::{LandmarkPlace, PlaceSigmas},
    segments::LaserSegment,
};
use nalgebra::{Matrix2, Point2, Vector3};
use sqlx::{Row, SqliteConnection};
use std::{collections::BTreeMap, panic::AssertUnwindSafe, sync::Arc};
use vision::{
    learn::model::LandmarkModel,
    params::Params,
    recognise::{DistanceKind, LandmarkId, models::ModelSet},
};

statements! {
    MAP = "SELECT name, version, distance, sight FROM maps WHERE id = ?1";
    NAME = "SELECT name FROM maps WHERE id = ?1";
    MAP_IDS = "SELECT id FROM maps ORDER BY id";
    LANDMARKS = "SELECT id, name, width_m, height_m, x_m, y_m, z_m, theta_rad, roll_rad, tilt_rad, place_covariance, \
                 size_from_views, standing FROM landmarks WHERE map_id = ?1 ORDER BY id";
}

/// Standard deviation of a wall given by hand, across it.
const WALL_SIGMA_M: f64 = 0.01;
/// Robots read at a time.
const PAGE: usize = 500;

/// Publishes every map and robot. For the start.
pub(super) async fn all(
    conn: &mut SqliteConnection,
    snapshots: &Snapshots,
    params: &Arc<Params>,
    vitals: &Vitals,
) -> Result<(), StoreError> {
    let ids: Vec<i64> =
        sqlx::query_scalar(MAP_IDS).fetch_all(&mut *conn).await.map_err(StoreError::at("list maps"))?;
    for id in ids {
        match publish(conn, id, snapshots, params, vitals).await {
            Ok(()) | Err(StoreError::NotPublished { .. }) => {}
            Err(error) => return Err(error),
        }
    }
    snapshots.set_links(sites::links(&sites::all(&mut *conn).await?));
    let mut after = String::new();
    loop {
        let page = robots::page(&mut *conn, &after, PAGE).await?;
        let Some(last) = page.last() else { return Ok(()) };
        after.clone_from(&last.name);
        for robot in page {
            snapshots.set_robot(&robot.name, Some(&robot.map));
        }
    }
}

/// Makes the current version of a map the one that is used. `NotPublished` if it cannot be made ready; any other error
/// means that the database cannot be read.
pub(super) async fn publish(
    conn: &mut SqliteConnection,
    id: i64,
    snapshots: &Snapshots,
    params: &Arc<Params>,
    vitals: &Vitals,
) -> Result<(), StoreError> {
    // What a panic leaves behind is thrown away: the snapshot is whole or there is none.
    let made = AssertUnwindSafe(map(&mut *conn, id, snapshots, params, vitals.panics())).catch_unwind().await;
    let reason = match made {
        Ok(Ok(None)) => return Ok(()),
        Ok(Ok(Some(map))) => {
            vitals.published(&map.name);
            snapshots.publish(map);
            return Ok(());
        }
        Ok(Err(error)) if error.is_fatal() => return Err(error),
        Ok(Err(error)) => {
            tracing::error!(map = id, error = &error as &dyn std::error::Error, "a map cannot be made ready");
            error.to_string()
        }
        Err(cause) => {
            let (what, follows) = (format!("map number {id}"), "its previous version stays in use");
            vitals.panics().caught(Edge::Publication, cause.as_ref(), &what, follows);
            "the server failed on it; see its log".to_owned()
        }
    };
    let name = sqlx::query_scalar(NAME).bind(id).fetch_one(conn).await;
    let name: String = name.map_err(StoreError::at("read the name of a map"))?;
    tracing::error!(map = name, reason, "the stored version of this map is not in use");
    vitals.unpublished(&name, &reason);
    Err(StoreError::NotPublished { map: name })
}

/// The current version of a map as it is in the database; `None` if it is gone.
async fn map(
    conn: &mut SqliteConnection,
    id: i64,
    snapshots: &Snapshots,
    params: &Arc<Params>,
    panics: &Panics,
) -> Result<Option<Arc<MapSnapshot>>, StoreError> {
    let at = || StoreError::at("read map");
    let Some(row) = sqlx::query(MAP).bind(id).fetch_optional(&mut *conn).await.map_err(at())? else {
        return Ok(None);
    };
    let distance = maps::distance_of(&row.try_get::<String, _>("distance").map_err(at())?);
    let rows = sqlx::query(LANDMARKS).bind(id).fetch_all(&mut *conn).await.map_err(at())?;
    let mut infos = BTreeMap::new();
    for row in &rows {
        let id: i64 = row.try_get("id").map_err(at())?;
        let name = row.try_get("name").map_err(at())?;
        let measures = landmarks::measures(row).map_err(at())?;
        let standing = landmarks::standing_of(&row.try_get::<String, _>("standing").map_err(at())?);
        let info = LandmarkInfo { name, size: measures.size, place: place(&measures), standing };
        infos.insert(LandmarkId(id as u64), info);
    }
    let walls: Vec<_> =
        laser::all_of(&mut *conn, id).await?.iter().filter_map(|ends| wall(ends).ok()).collect();
    let name: String = row.try_get("name").map_err(at())?;
    let before = snapshots.get(&name);
    let wall_index = wall_index(&walls, before.as_deref(), panics).await;
    let areas = areas::all(&mut *conn, id, before.as_deref().map(|map| &map.areas)).await?;
    let sight = sights::read(&name, row.try_get::<Option<&str>, _>("sight").map_err(at())?);
    let visibility = seen::areas(&infos, &walls, &sight, before.clone(), panics).await;
    #[cfg(test)]
    tests::planted(&name);
    let (learnt, quarantined) = models(conn, id, before.as_deref(), params, panics).await?;
    for (id, reason) in &quarantined {
        let landmark = infos.get(id).map_or("", |l: &LandmarkInfo| l.name.as_str());
        tracing::warn!(map = name, landmark, reason, "model not used");
    }
    let models = ModelSet::in_use(learnt.values().map(|l| l.model.clone()), params)
        .map_err(|e| StoreError::Damaged { what: format!("map `{name}`"), reason: e.to_string() })?;
    let doubles = doubles(&learnt, before.as_deref(), (distance, params), panics).await;
    Ok(Some(Arc::new(MapSnapshot {
        name,
        models,
        doubles,
        version: row.try_get::<i64, _>("version").map_err(at())? as u64,
        sizes: infos.iter().filter_map(|(id, l)| Some((*id, l.size?))).collect(),
        landmarks: infos,
        learnt,
        quarantined,
        walls,
        wall_index,
        areas,
        sight,
        visibility,
        distance,
        params: params.clone(),
    })))
}

/// The walls made ready for scans, off the runtime; taken over from the version before where they are the same.
async fn wall_index(walls: &[LaserSegment], before: Option<&MapSnapshot>, panics: &Panics) -> Arc<WallIndex> {
    if let Some(before) = before.filter(|before| before.walls == walls) {
        return before.wall_index.clone();
    }
    let walls = walls.to_vec();
    let made = tokio::task::spawn_blocking(move || WallIndex::new(&walls)).await;
    let made = panics.joined(Edge::Publication, "the index of the walls", "scans correct nothing here", made);
    Arc::new(made.unwrap_or_else(|_ended| WallIndex::new([])))
}

/// Landmarks that have look-alikes, off the runtime; taken over from the version before where no model is another.
async fn doubles(
    learnt: &BTreeMap<LandmarkId, Learnt>,
    before: Option<&MapSnapshot>,
    (kind, params): (DistanceKind, &Arc<Params>),
    panics: &Panics,
) -> Arc<Doubles> {
    let digests =
        |of: &BTreeMap<LandmarkId, Learnt>| of.iter().map(|(id, l)| (*id, l.digest)).collect::<Vec<_>>();
    if let Some(before) = before.filter(|b| b.distance == kind && digests(&b.learnt) == digests(learnt)) {
        return before.doubles.clone();
    }
    let (learnt, params) = (learnt.clone(), params.clone());
    let made = tokio::task::spawn_blocking(move || doubles::doubles(&learnt, kind, &params)).await;
    let made = panics.joined(Edge::Publication, "look-alikes for searches", "searches do without", made);
    Arc::new(made.unwrap_or_default())
}

type Models = (BTreeMap<LandmarkId, Learnt>, BTreeMap<LandmarkId, String>);

/// Models of a map, read only where the digest is not that of the previous snapshot; and those that must not be used.
async fn models(
    conn: &mut SqliteConnection,
    map_id: i64,
    before: Option<&MapSnapshot>,
    params: &Params,
    panics: &Panics,
) -> Result<Models, StoreError> {
    let (mut learnt, mut quarantined) = Models::default();
    for (id, digest) in models::digests(&mut *conn, map_id).await? {
        let same = before.and_then(|map| map.learnt.get(&id)).filter(|l| l.digest == digest);
        if let Some(same) = same {
            learnt.insert(id, same.clone());
            continue;
        }
        let bytes = models::get(&mut *conn, id).await?;
        let what = format!("the model of landmark number {}", id.0);
        let read = panics.catch(Edge::Publication, &what, "it is not used", || {
            #[cfg(test)]
            tests::planted(&what);
            read_model(&bytes, digest, id, params)
        });
        match read.unwrap_or_else(|| Err("the server failed on the stored model; see its log".to_owned())) {
            Ok(model) => {
                learnt.insert(id, Learnt { digest, model: Arc::new(model) });
            }
            Err(reason) => {
                quarantined.insert(id, reason);
            }
        }
    }
    Ok((learnt, quarantined))
}

fn read_model(
    bytes: &[u8],
    digest: ModelDigest,
    id: LandmarkId,
    p: &Params,
) -> Result<LandmarkModel, String> {
    if models::digest(bytes) != digest {
        return Err("the stored model is damaged: its digest does not fit".to_owned());
    }
    let model = LandmarkModel::from_bytes(bytes, p).map_err(|e| e.to_string())?;
    if model.id == id {
        Ok(model)
    } else {
        Err(format!("the stored model is that of landmark {}", model.id.0))
    }
}

/// A landmark has a usable place only with a size; out of range (a file from elsewhere) counts as not placed.
pub(crate) fn place(measures: &landmarks::Measures) -> Option<LandmarkPlace> {
    let (size, place) = measures.size.zip(measures.place)?;
    let centre = Vector3::new(place.x_m, place.y_m, place.z_m);
    let by_hand = LandmarkPlace::by_hand(centre, place.theta_rad, size, PlaceSigmas::default()).ok()?;
    let (roll_rad, tilt_rad) = (place.roll_rad, place.tilt_rad);
    let covariance = place.covariance.unwrap_or(by_hand.covariance);
    let made = LandmarkPlace { roll_rad, tilt_rad, covariance, ..by_hand };
    made.check().is_ok().then_some(made)
}

/// A wall from its ends, each known to [`WALL_SIGMA_M`] across the wall.
pub(crate) fn wall(&[ax, ay, bx, by]: &laser::Ends) -> Result<LaserSegment, OutOfRange> {
    let (a, b) = (Point2::new(ax, ay), Point2::new(bx, by));
    let length = (b - a).norm().max(map::segments::MIN_SEGMENT_M);
    let variance = WALL_SIGMA_M * WALL_SIGMA_M;
    let covariance = Matrix2::new(2.0 * variance / (length * length), 0.0, 0.0, variance);
    LaserSegment::from_ends(a, b, covariance)
}

#[cfg(test)]
pub(super) mod tests {
    use std::cell::RefCell;

    thread_local! {
        /// Where the loading of a map panics on this thread: the name of a map, or what is read of it.
        static PLANTED: RefCell<Option<String>> = const { RefCell::new(None) };
    }

    /// Plants a panic, or takes it away.
    pub(in crate::store) fn plant(what: Option<&str>) {
        PLANTED.set(what.map(str::to_owned));
    }

    pub(super) fn planted(what: &str) {
        let hit = PLANTED.with_borrow(|planted| planted.as_deref() == Some(what));
        assert!(!hit, "planted: {what}");
    }
}
