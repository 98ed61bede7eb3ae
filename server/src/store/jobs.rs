//! Jobs as rows: an accepted job survives a crash and is run again.

use super::{
    CommittedChange, StoreError, Tx,
    db::{self, Executor, Row},
    kind::Kind,
    maps, now_ms,
    statements::statements,
    within,
};
use serde_json::Value;

statements! {
    COUNT_OPEN = "SELECT count(*) FROM jobs WHERE state IN ('queued', 'running')";
    INSERT = "INSERT INTO jobs (kind, map, request, state, created_ms, author, why) \
              VALUES ($1, $2, $3, 'queued', $4, $5, $6) RETURNING id";
    GET = "SELECT id, kind, map, request, state, message, result, attempts, author, why, created_ms, started_ms, ended_ms FROM jobs WHERE id = $1";
    LIST = "SELECT id, kind, map, request, state, message, result, attempts, author, why, created_ms, started_ms, ended_ms FROM jobs WHERE id < $1 \
            AND (CAST($2 AS TEXT) IS NULL OR state = $2) AND (CAST($3 AS TEXT) IS NULL OR map IN (SELECT value FROM json_each($3))) ORDER BY id DESC LIMIT $4";
    COUNT = "SELECT count(*) FROM jobs WHERE (CAST($1 AS TEXT) IS NULL OR state = $1) AND (CAST($2 AS TEXT) IS NULL OR map IN (SELECT value FROM json_each($2)))";
    OPEN = "SELECT id, kind, map, request, state, message, result, attempts, author, why, created_ms, started_ms, ended_ms FROM jobs \
            WHERE state IN ('queued', 'running') ORDER BY id";
    BEGIN = "UPDATE jobs SET state = 'running', attempts = attempts + 1, started_ms = $2 \
             WHERE id = $1 AND state IN ('queued', 'running')";
    PUT_BACK = "UPDATE jobs SET state = 'queued', attempts = attempts - 1, started_ms = NULL WHERE id = $1 AND state = 'running'";
    END = "UPDATE jobs SET state = $2, message = $3, result = $4, ended_ms = $5 \
           WHERE id = $1 AND state IN ('queued', 'running')";
    OPEN_REQUESTS = "SELECT id, request FROM jobs WHERE map = $1 AND state IN ('queued', 'running') ORDER BY id";
    SET_REQUEST = "UPDATE jobs SET request = $2 WHERE id = $1";
    DELETE_OLD = "DELETE FROM jobs WHERE ended_ms IS NOT NULL AND id NOT IN \
              (SELECT id FROM jobs WHERE ended_ms IS NOT NULL ORDER BY id DESC LIMIT $1)";
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct JobRow {
    pub(crate) id: i64,
    pub(crate) kind: String,
    /// Name of its map.
    pub(crate) map: String,
    /// What was asked for, JSON.
    pub(crate) request: String,
    /// queued, running, done, failed, cancelled.
    pub(crate) state: String,
    pub(crate) message: String,
    /// JSON, once done.
    pub(crate) result: Option<String>,
    /// How often it was begun, less those times that a stop of the server put it back.
    pub(crate) attempts: u32,
    /// Who asked for it.
    pub(crate) author: String,
    /// The reason given then.
    pub(crate) why: Option<String>,
    pub(crate) created_ms: i64,
    /// When it was begun last; absent while it waits.
    pub(crate) started_ms: Option<i64>,
    pub(crate) ended_ms: Option<i64>,
}

/// How a job ended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Ended {
    /// done, failed, cancelled.
    pub(crate) state: &'static str,
    pub(crate) message: String,
    /// JSON.
    pub(crate) result: Option<String>,
}

fn job_row(row: &Row) -> Result<JobRow, db::Error> {
    Ok(JobRow {
        id: row.try_get("id")?,
        kind: row.try_get("kind")?,
        map: row.try_get("map")?,
        request: row.try_get("request")?,
        state: row.try_get("state")?,
        message: row.try_get("message")?,
        result: row.try_get("result")?,
        attempts: row.try_get("attempts")?,
        author: row.try_get("author")?,
        why: row.try_get("why")?,
        created_ms: row.try_get("created_ms")?,
        started_ms: row.try_get("started_ms")?,
        ended_ms: row.try_get("ended_ms")?,
    })
}

/// Gives a landmark its new name in what open jobs are asked for.
pub(super) async fn rename_landmark(tx: &mut Tx, map: &str, name: &str, new: &str) -> Result<(), StoreError> {
    let at = || StoreError::during("rename landmark in jobs");
    let open = db::query_as::<(i64, String)>(OPEN_REQUESTS).bind(map).fetch_all(&mut tx.conn).await;
    for (id, request) in open.map_err(at())? {
        let damaged =
            |e: serde_json::Error| StoreError::Damaged { what: format!("job {id}"), reason: e.to_string() };
        let mut request: Value = serde_json::from_str(&request).map_err(damaged)?;
        let Some(Value::Array(landmarks)) = request.get_mut("landmarks") else { continue };
        for landmark in landmarks.iter_mut().filter(|landmark| **landmark == name) {
            *landmark = new.into();
        }
        let set = db::query(SET_REQUEST).bind(id).bind(request.to_string());
        set.execute(&mut tx.conn).await.map_err(at())?;
    }
    Ok(())
}

/// Queues a job and deletes the oldest finished ones beyond `retained`. Errors: more than `max`
/// open jobs.
pub(crate) async fn create(
    tx: &mut Tx,
    kind: &'static str,
    map: &str,
    request: &str,
    (max, retained): (usize, usize),
) -> Result<JobRow, StoreError> {
    maps::get(&mut tx.conn, map).await?;
    db::query(DELETE_OLD)
        .bind(retained as i64)
        .execute(&mut tx.conn)
        .await
        .map_err(StoreError::during("delete old jobs"))?;
    let created_ms = now_ms();
    let id = db::query_scalar(INSERT)
        .bind(kind)
        .bind(map)
        .bind(request)
        .bind(created_ms)
        .bind(&tx.author.name)
        .bind(&tx.author.why)
        .fetch_one(&mut tx.conn)
        .await;
    let id = id.map_err(StoreError::during("queue job"))?;
    let open = db::query_scalar(COUNT_OPEN)
        .fetch_one(&mut tx.conn)
        .await
        .map_err(StoreError::during("count jobs"))?;
    within(open, max, "jobs waiting or running")?;
    tx.changed(CommittedChange::Jobs);
    Ok(JobRow {
        id,
        kind: kind.to_owned(),
        map: map.to_owned(),
        request: request.to_owned(),
        state: "queued".to_owned(),
        message: String::new(),
        result: None,
        attempts: 0,
        author: tx.author.name.clone(),
        why: tx.author.why.clone(),
        created_ms,
        started_ms: None,
        ended_ms: None,
    })
}

/// One job.
pub(crate) async fn get(db: impl Executor<'_>, id: i64) -> Result<JobRow, StoreError> {
    let row = db::query(GET).bind(id).fetch_optional(db).await.map_err(StoreError::during("read job"))?;
    let row = row.ok_or_else(|| StoreError::NotFound { what: Kind::Job, name: id.to_string() })?;
    job_row(&row).map_err(StoreError::during("read job"))
}

/// Which jobs are listed.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(crate) struct JobFilter {
    /// As in [`JobRow`].
    pub(crate) state: Option<&'static str>,
    /// JSON list of names of maps; `None` for all.
    pub(crate) maps: Option<String>,
}

/// Jobs with numbers below `before`, newest first.
pub(crate) async fn page(
    db: impl Executor<'_>,
    filter: &JobFilter,
    before: i64,
    limit: usize,
) -> Result<Vec<JobRow>, StoreError> {
    let rows = db::query(LIST).bind(before).bind(filter.state).bind(&filter.maps).bind(limit as i64);
    let rows = rows.fetch_all(db).await.map_err(StoreError::during("list jobs"))?;
    rows.iter().map(job_row).collect::<Result<_, _>>().map_err(StoreError::during("list jobs"))
}

/// How many jobs a list has.
pub(crate) async fn count(db: impl Executor<'_>, filter: &JobFilter) -> Result<u64, StoreError> {
    let count = db::query_scalar::<i64>(COUNT).bind(filter.state).bind(&filter.maps).fetch_one(db).await;
    count.map(|n| n as u64).map_err(StoreError::during("count jobs"))
}

/// Jobs not ended, oldest first.
pub(crate) async fn open(db: impl Executor<'_>) -> Result<Vec<JobRow>, StoreError> {
    let rows = db::query(OPEN).fetch_all(db).await.map_err(StoreError::during("list jobs"))?;
    rows.iter().map(job_row).collect::<Result<_, _>>().map_err(StoreError::during("list jobs"))
}

/// Begins with an open job and counts the attempt. False when it has ended meanwhile.
pub(crate) async fn begin(tx: &mut Tx, id: i64) -> Result<bool, StoreError> {
    let done = db::query(BEGIN).bind(id).bind(now_ms()).execute(&mut tx.conn).await;
    Ok(done.map_err(StoreError::during("begin job"))?.rows_affected() == 1)
}

/// Puts a running job back into the queue without an attempt, because the server stops.
pub(crate) async fn put_back(tx: &mut Tx, id: i64) -> Result<(), StoreError> {
    let done = db::query(PUT_BACK).bind(id).execute(&mut tx.conn).await;
    done.map_err(StoreError::during("put job back")).map(drop)
}

/// Ends a job. False when it had ended already; then nothing changed.
pub(crate) async fn end(tx: &mut Tx, id: i64, ended: &Ended) -> Result<bool, StoreError> {
    let done = db::query(END)
        .bind(id)
        .bind(ended.state)
        .bind(&ended.message)
        .bind(&ended.result)
        .bind(now_ms())
        .execute(&mut tx.conn)
        .await
        .map_err(StoreError::during("end job"))?;
    Ok(done.rows_affected() == 1)
}
