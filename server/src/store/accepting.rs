//! A person's decision on what a robot gathered: tracks become landmarks with their views, or more views of the landmarks
//! they are of; the landmarks are placed and the lesson is queued. All of it in one transaction, or nothing.

use super::{
    StoreError, Tx, gatherings,
    jobs::{self, JobRow},
    landmarks::{self, Measures},
    laser, load, maps,
    placing::{self, Placing},
    statements::statements,
    within,
};
use map::segments::LaserSegment;
use std::collections::BTreeMap;

statements! {
    MOVE = "INSERT INTO views (landmark_id, image_sha256, image_kind, image, width_px, height_px, corners_px, icon_side, \
            icon, icon_scale, created_ms, capture) SELECT ?3, image_sha256, image_kind, image, width_px, height_px, \
            corners_px, icon_side, icon, icon_scale, created_ms, capture FROM track_views \
            WHERE gathering_id = ?1 AND track = ?2 ORDER BY id ON CONFLICT DO NOTHING";
    COUNT = "SELECT count(*) FROM views WHERE landmark_id = ?1";
    DROP_VIEWS = "DELETE FROM track_views WHERE gathering_id = ?1 AND track = ?2";
    DROP_VIEW = "DELETE FROM track_views WHERE id = ?1";
    ACCEPTED = "UPDATE tracks SET state = 'accepted', landmark_id = ?3 WHERE gathering_id = ?1 AND number = ?2";
}

/// One decision.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Pick {
    /// Which track.
    pub(crate) number: u32,
    /// Name of the landmark; `None` for views of one that is known: its own.
    pub(crate) name: Option<String>,
}

/// What came of it.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Accepted {
    /// By landmark: how many views it got, and whether they place it.
    pub(crate) landmarks: BTreeMap<String, (u64, Placing)>,
    /// The lesson.
    pub(crate) job: Option<JobRow>,
}

/// What an acceptance may come to.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Bounds {
    /// Landmarks of a map.
    pub(crate) landmarks: usize,
    /// Views of a landmark.
    pub(crate) views: usize,
    /// Jobs that wait or run, and finished ones that are kept.
    pub(crate) jobs: (usize, usize),
}

/// Accepts. `lesson` makes the request of the lesson from the names of the landmarks; without it none is queued.
pub(crate) async fn accept(
    tx: &mut Tx,
    (map, id): (&str, i64),
    picks: &[Pick],
    lesson: Option<fn(&[String]) -> String>,
    bounds: Bounds,
) -> Result<Accepted, StoreError> {
    gatherings::get(&mut tx.conn, map, id).await?;
    // By name: the landmark's number and the views it got.
    let mut taken: BTreeMap<String, (i64, u64)> = BTreeMap::new();
    for pick in picks {
        let (name, landmark) = landmark_of(tx, (map, id), pick, &taken, bounds.landmarks).await?;
        leave_out(tx, (map, id), pick.number).await?;
        let moved = sqlx::query(MOVE).bind(id).bind(pick.number).bind(landmark).execute(&mut tx.conn).await;
        let moved = moved.map_err(StoreError::at("accept views"))?.rows_affected();
        let count = sqlx::query_scalar(COUNT).bind(landmark).fetch_one(&mut tx.conn).await;
        within(count.map_err(StoreError::at("count views"))?, bounds.views, "views of a landmark")?;
        let dropped = sqlx::query(DROP_VIEWS).bind(id).bind(pick.number).execute(&mut tx.conn).await;
        dropped.map_err(StoreError::at("accept track"))?;
        let decided = sqlx::query(ACCEPTED).bind(id).bind(pick.number).bind(landmark);
        decided.execute(&mut tx.conn).await.map_err(StoreError::at("accept track"))?;
        taken.entry(name).or_insert((landmark, 0)).1 += moved;
    }
    let mut landmarks = BTreeMap::new();
    for (name, (_, views)) in taken {
        let placing = placing::by_views(tx, map, &name).await?;
        landmarks.insert(name, (views, placing));
    }
    let job = match lesson {
        Some(request) if !landmarks.is_empty() => {
            let names: Vec<String> = landmarks.keys().cloned().collect();
            Some(jobs::create(tx, "learn", map, &request(&names), bounds.jobs).await?)
        }
        _ => None,
    };
    Ok(Accepted { landmarks, job })
}

/// Views that do not agree on the thing's place would spoil its model: another border of it was found, or something else
/// (rectangle consistency, method 7.1).
async fn leave_out(tx: &mut Tx, (map, id): (&str, i64), number: u32) -> Result<(), StoreError> {
    let views = gatherings::track_views(&mut tx.conn, id, number).await?;
    let map = maps::get(&mut tx.conn, map).await?;
    let ends = laser::all_of(&mut tx.conn, map.id).await?;
    let walls: Vec<LaserSegment> = ends.iter().filter_map(|ends| load::wall(ends).ok()).collect();
    let looks = views.iter().map(|v| (&v.cut.corners_px, v.capture.as_deref()));
    // Without a place nothing speaks against any view.
    let apart = placing::preview(looks, &walls).map(|made| made.apart).unwrap_or_default();
    for view in apart.iter().filter_map(|i| views.get(*i)) {
        sqlx::query(DROP_VIEW)
            .bind(view.id)
            .execute(&mut tx.conn)
            .await
            .map_err(StoreError::at("leave out view"))?;
    }
    Ok(())
}

/// The landmark a track's views go to: its own; or a new one; or one of that name that has no views yet, or was made by
/// this very decision.
async fn landmark_of(
    tx: &mut Tx,
    (map, id): (&str, i64),
    pick: &Pick,
    taken: &BTreeMap<String, (i64, u64)>,
    max: usize,
) -> Result<(String, i64), StoreError> {
    let track = gatherings::track(&mut tx.conn, id, pick.number).await?;
    if let Some((own, landmark)) = track.landmark.zip(track.landmark_id) {
        return match &pick.name {
            Some(name) if *name != own => {
                Err(StoreError::InUse(format!("candidate {} shows landmark `{own}`", track.number)))
            }
            _ => Ok((own, landmark)),
        };
    }
    let name = pick.name.clone().ok_or_else(|| {
        StoreError::InUse(format!("candidate {} is no landmark yet: it needs a name", track.number))
    })?;
    if let Some((landmark, _)) = taken.get(&name) {
        return Ok((name, *landmark));
    }
    match landmarks::get(&mut tx.conn, map, &name).await {
        Ok(row) if row.views == 0 => Ok((name, row.id)),
        Ok(_) => Err(StoreError::Exists { what: "landmark", name }),
        Err(StoreError::NotFound { .. }) => {
            let made = landmarks::create(tx, map, &name, Measures::default(), max).await?;
            Ok((name, made.id))
        }
        Err(error) => Err(error),
    }
}
