//! Robots, and the map of each.

use super::{
    CommittedChange, StoreError, Tx,
    db::{self, Executor, Row},
    kind::Kind,
    maps, now_ms,
    statements::statements,
    within,
};

statements! {
    COUNT = "SELECT count(*) FROM robots";
    PUT = "INSERT INTO robots (name, map_id, created_ms) VALUES ($1, $2, $3) \
           ON CONFLICT (name) DO UPDATE SET map_id = excluded.map_id";
    GET = "SELECT r.name, m.name AS map FROM robots r JOIN maps m ON m.id = r.map_id WHERE r.name = $1";
    PAGE = "SELECT r.name, m.name AS map FROM robots r JOIN maps m ON m.id = r.map_id \
            WHERE r.name > $1 ORDER BY r.name LIMIT $2";
    TOUCH = "UPDATE robots SET map_id = map_id WHERE name = $1";
    DELETE = "DELETE FROM robots WHERE name = $1";
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct RobotRow {
    pub(crate) name: String,
    /// Name of its map.
    pub(crate) map: String,
}

fn robot_row(row: &Row) -> Result<RobotRow, db::Error> {
    Ok(RobotRow { name: row.try_get("name")?, map: row.try_get("map")? })
}

/// Registers a robot, or moves it to another map.
pub(crate) async fn put(tx: &mut Tx, name: &str, map: &str, max: usize) -> Result<RobotRow, StoreError> {
    let map = maps::get(&mut tx.conn, map).await?;
    if let Some(of) = &map.draft_of {
        let why = format!("map `{}` is a draft of map `{of}`: robots stand on that one", map.name);
        return Err(StoreError::InUse(why));
    }
    let put = db::query(PUT).bind(name).bind(map.id).bind(now_ms()).execute(&mut tx.conn).await;
    put.map_err(StoreError::during("register robot"))?;
    let count =
        db::query_scalar(COUNT).fetch_one(&mut tx.conn).await.map_err(StoreError::during("count robots"))?;
    within(count, max, "robots")?;
    tx.changed(CommittedChange::Robot { name: name.to_owned(), map: Some(map.name.clone()) });
    Ok(RobotRow { name: name.to_owned(), map: map.name })
}

/// One robot.
pub(crate) async fn get(db: impl Executor<'_>, name: &str) -> Result<RobotRow, StoreError> {
    let row = db::query(GET).bind(name).fetch_optional(db).await.map_err(StoreError::during("read robot"))?;
    let row = row.ok_or_else(|| StoreError::NotFound { what: Kind::Robot, name: name.to_owned() })?;
    robot_row(&row).map_err(StoreError::during("read robot"))
}

/// Robots with names after `after`, in order.
pub(crate) async fn page(
    db: impl Executor<'_>,
    after: &str,
    limit: usize,
) -> Result<Vec<RobotRow>, StoreError> {
    let rows = db::query(PAGE).bind(after).bind(limit as i64).fetch_all(db).await;
    let rows = rows.map_err(StoreError::during("list robots"))?;
    rows.iter().map(robot_row).collect::<Result<_, _>>().map_err(StoreError::during("list robots"))
}

/// Notes in the audit log that a person says where a robot is. Poses are not stored: the row stays
/// as it is.
pub(crate) async fn note_pose(tx: &mut Tx, name: &str) -> Result<(), StoreError> {
    get(&mut tx.conn, name).await?;
    db::query(TOUCH).bind(name).execute(&mut tx.conn).await.map_err(StoreError::during("note a pose"))?;
    Ok(())
}

/// Deletes a robot.
pub(crate) async fn delete(tx: &mut Tx, name: &str) -> Result<(), StoreError> {
    get(&mut tx.conn, name).await?;
    db::query(DELETE).bind(name).execute(&mut tx.conn).await.map_err(StoreError::during("delete robot"))?;
    tx.changed(CommittedChange::Robot { name: name.to_owned(), map: None });
    Ok(())
}
