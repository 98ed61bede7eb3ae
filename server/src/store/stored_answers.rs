//! Answers to frames as rows: what was said, the icons of the quads with matched points, the pose
//! before the frame. Only the newest stay.

use super::{
    StoreError, Tx,
    db::{self, Executor, Row},
    kind::Kind,
    now_ms,
    statements::statements,
};
use engine::{
    answer_records::{AnswerBasis, AnswerRecord, named_landmarks, refusal_of},
    prior_check,
};
use protos::{
    api::{PointMatch, PriorCheck, PriorSource, QuadMatches},
    convert::geometry::pose2_covariance_wire,
    json,
    prost::Message as _,
    v1,
};
use std::collections::{BTreeMap, BTreeSet};
use vision::points::shown_matches::ShownMatch;

statements! {
    INSERT = "INSERT INTO stored_answers (map_id, robot, camera, stored_ms, status, has_pose, refusal, landmarks, candidates, \
              answer, prior_check) SELECT id, $2, $3, $4, $5, $6, $7, $8, $9, $10, $11 FROM maps WHERE name = $1 \
              RETURNING id";
    INSERT_ICON = "INSERT INTO stored_answer_icons (answer_id, quad, icon_side, icon, matched, matches) \
                   VALUES ($1, $2, $3, $4, $5, $6)";
    FORGET = "DELETE FROM stored_answers WHERE id <= (SELECT max(id) FROM stored_answers) - $1";
    GET = "SELECT a.id, m.name AS map, a.robot, a.camera, a.stored_ms, a.status, a.has_pose, a.refusal, a.landmarks, \
           a.candidates, a.answer, a.prior_check FROM stored_answers a JOIN maps m ON m.id = a.map_id WHERE a.id = $1";
    MAP_OF = "SELECT m.name FROM stored_answers a JOIN maps m ON m.id = a.map_id WHERE a.id = $1";
    ICONS = "SELECT quad, matched, matches FROM stored_answer_icons WHERE answer_id = $1 ORDER BY quad";
    ICON = "SELECT icon_side, icon FROM stored_answer_icons WHERE answer_id = $1 AND quad = $2";
    LIST = "SELECT a.id, m.name AS map, a.robot, a.camera, a.stored_ms, a.status, a.has_pose, a.refusal, a.landmarks, \
            a.candidates FROM stored_answers a JOIN maps m ON m.id = a.map_id WHERE a.id < $9 \
            AND (CAST($1 AS TEXT) IS NULL OR m.name IN (SELECT value FROM json_each($1))) AND (CAST($2 AS TEXT) IS NULL OR a.robot = $2) \
            AND (CAST($3 AS TEXT) IS NULL OR a.camera = $3) AND (CAST($4 AS TEXT) IS NULL OR a.status = $4) AND (CAST($5 AS TEXT) IS NULL OR a.refusal = $5) \
            AND (CAST($6 AS TEXT) IS NULL OR $6 IN (SELECT value FROM json_each(a.landmarks)) \
                 OR $6 IN (SELECT value FROM json_each(a.candidates))) \
            AND (CAST($7 AS BIGINT) IS NULL OR a.stored_ms >= $7) AND (CAST($8 AS BIGINT) IS NULL OR a.stored_ms < $8) ORDER BY a.id DESC LIMIT $10";
    ABOUT = "SELECT a.answer FROM stored_answers a JOIN maps m ON m.id = a.map_id WHERE m.name = $1 \
             AND ($2 IN (SELECT value FROM json_each(a.landmarks)) OR $2 IN (SELECT value FROM json_each(a.candidates))) \
             ORDER BY a.id DESC LIMIT $3";
    COUNT = "SELECT count(*) FROM stored_answers a JOIN maps m ON m.id = a.map_id \
             WHERE (CAST($1 AS TEXT) IS NULL OR m.name IN (SELECT value FROM json_each($1))) AND (CAST($2 AS TEXT) IS NULL OR a.robot = $2) \
             AND (CAST($3 AS TEXT) IS NULL OR a.camera = $3) AND (CAST($4 AS TEXT) IS NULL OR a.status = $4) AND (CAST($5 AS TEXT) IS NULL OR a.refusal = $5) \
             AND (CAST($6 AS TEXT) IS NULL OR $6 IN (SELECT value FROM json_each(a.landmarks)) \
                  OR $6 IN (SELECT value FROM json_each(a.candidates))) \
             AND (CAST($7 AS BIGINT) IS NULL OR a.stored_ms >= $7) AND (CAST($8 AS BIGINT) IS NULL OR a.stored_ms < $8)";
}

/// Largest message that is stored, bytes; a larger answer is left out.
const MAX_ANSWER_BYTES: usize = 262_144;

/// What is listed of an answer.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct AnswerRow {
    pub(crate) id: i64,
    pub(crate) map: String,
    pub(crate) robot: String,
    pub(crate) camera: String,
    pub(crate) stored_ms: i64,
    /// Word of a [`v1::Status`].
    pub(crate) status: String,
    pub(crate) has_pose: bool,
    pub(crate) refusal: Option<String>,
    /// Names as they were then.
    pub(crate) landmarks: Vec<String>,
    /// The other landmarks that it was compared with.
    pub(crate) candidates: Vec<String>,
}

/// Which answers are listed.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(crate) struct AnswerFilter {
    /// JSON list of names of maps; `None` for all.
    pub(crate) maps: Option<String>,
    pub(crate) robot: Option<String>,
    pub(crate) camera: Option<String>,
    pub(crate) status: Option<String>,
    pub(crate) refusal: Option<String>,
    /// Named or compared with.
    pub(crate) landmark: Option<String>,
    /// ms since the Unix epoch, included.
    pub(crate) since_ms: Option<i64>,
    /// Not included.
    pub(crate) until_ms: Option<i64>,
}

fn damaged(reason: String) -> StoreError {
    StoreError::Damaged { what: "a stored answer".into(), reason }
}

fn answer_row(row: &Row) -> Result<AnswerRow, StoreError> {
    let at = || StoreError::during("read answer");
    let names = |column: &str| {
        let text: &str = row.try_get(column).map_err(at())?;
        serde_json::from_str(text).map_err(|e| damaged(e.to_string()))
    };
    Ok(AnswerRow {
        id: row.try_get("id").map_err(at())?,
        map: row.try_get("map").map_err(at())?,
        robot: row.try_get("robot").map_err(at())?,
        camera: row.try_get("camera").map_err(at())?,
        stored_ms: row.try_get("stored_ms").map_err(at())?,
        status: row.try_get("status").map_err(at())?,
        has_pose: row.try_get("has_pose").map_err(at())?,
        refusal: row.try_get("refusal").map_err(at())?,
        landmarks: names("landmarks")?,
        candidates: names("candidates")?,
    })
}

/// Places of matches are stored in parts of a side.
const PARTS_OF_A_SIDE: f64 = 10_000.0;
/// Bytes of a match: four numbers of 16 bits, and whether it agrees.
const MATCH_BYTES: usize = 9;

fn matches_bytes(matches: &[ShownMatch]) -> Vec<u8> {
    // Saturates: places far outside of an icon are not drawn.
    let part = |at: f32| ((f64::from(at) * PARTS_OF_A_SIDE).round() as i16).to_le_bytes();
    let bytes = |m: &ShownMatch| {
        let places = [m.seen, m.taught].into_iter().flatten().flat_map(part);
        places.chain([u8::from(m.agrees)]).collect::<Vec<u8>>()
    };
    matches.iter().flat_map(bytes).collect()
}

fn matches_of(bytes: &[u8]) -> Vec<PointMatch> {
    let of = |bytes: &[u8; MATCH_BYTES]| {
        let parts = bytes.as_chunks::<2>().0;
        let at = |i: usize| f64::from(i16::from_le_bytes(parts[i])) / PARTS_OF_A_SIDE;
        let agrees = bytes[MATCH_BYTES - 1] != 0;
        PointMatch { seen: [at(0), at(1)], taught: [at(2), at(3)], agrees }
    };
    bytes.as_chunks::<MATCH_BYTES>().0.iter().map(of).collect()
}

fn prior_check_text(check: &prior_check::PriorCheck) -> String {
    let source = match check.source {
        prior_check::PriorSource::Robot => PriorSource::Robot,
        prior_check::PriorSource::Server => PriorSource::Server,
    };
    let shown = PriorCheck {
        source,
        prior: pose2_covariance_wire(&check.prior),
        seen: check.seen.as_ref().map(pose2_covariance_wire),
        distance2: check.distance2,
        limit: check.limit,
        refused: check.is_refused,
    };
    serde_json::to_string(&shown).unwrap_or_default()
}

/// Stores answers with their icons, and deletes the oldest beyond `max`. Those of maps that are
/// gone are left out.
pub(crate) async fn add(tx: &mut Tx, records: &[AnswerRecord], max: usize) -> Result<(), StoreError> {
    let at = || StoreError::during("store answer");
    for AnswerRecord { key, answer, basis: AnswerBasis { icons, prior_check } } in records {
        let message = answer.encode_to_vec();
        if message.len() > MAX_ANSWER_BYTES {
            continue;
        }
        let named = named_landmarks(answer);
        let compared = answer.quads.iter().flat_map(|quad| &quad.candidates);
        let others: BTreeSet<&str> =
            compared.map(|c| c.landmark.as_str()).filter(|name| !named.contains(name)).collect();
        let row = db::query_scalar::<i64>(INSERT)
            .bind(&answer.map)
            .bind(key.robot.as_str())
            .bind(key.camera.as_str())
            .bind(now_ms())
            .bind(json::status::word(answer.status))
            .bind(answer.map_from_robot.is_some())
            .bind(refusal_of(answer))
            .bind(serde_json::json!(named).to_string())
            .bind(serde_json::json!(others).to_string())
            .bind(&message)
            .bind(prior_check.as_ref().map(prior_check_text))
            .fetch_optional(&mut tx.conn)
            .await;
        let Some(id) = row.map_err(at())? else { continue };
        for icon in icons {
            let matched = icon.matched.as_ref();
            let stored = db::query(INSERT_ICON)
                .bind(id)
                .bind(icon.quad as i64)
                .bind(icon.size as i64)
                .bind(&icon.pixels)
                .bind(matched.map(|matched| matched.landmark.as_str()))
                .bind(matched.map(|matched| matches_bytes(&matched.matches)))
                .execute(&mut tx.conn)
                .await;
            stored.map_err(at())?;
        }
    }
    let oldest = db::query(FORGET).bind(max as i64).execute(&mut tx.conn).await;
    oldest.map_err(StoreError::during("delete old answers")).map(drop)
}

/// The newest answers on a map that name a landmark or were compared with it.
pub(crate) async fn about(
    db: &db::Pool,
    map: &str,
    landmark: &str,
    limit: usize,
) -> Result<Vec<v1::Answer>, StoreError> {
    let at = || StoreError::during("read answers");
    let rows =
        db::query(ABOUT).bind(map).bind(landmark).bind(limit as i64).fetch_all(db).await.map_err(at())?;
    let answer = |row: &Row| {
        let message: &[u8] = row.try_get("answer").map_err(at())?;
        v1::Answer::decode(message).map_err(|e| damaged(e.to_string()))
    };
    rows.iter().map(answer).collect()
}

/// An answer with what it rests on.
#[derive(Debug)]
pub(crate) struct OpenedAnswer {
    pub(crate) row: AnswerRow,
    pub(crate) answer: v1::Answer,
    /// By the indices of the quads whose icons are stored: their matches, if they have any.
    pub(crate) icons: BTreeMap<usize, Option<QuadMatches>>,
    pub(crate) prior_check: Option<PriorCheck>,
}

/// The matches that are stored with an icon.
fn matches_in(row: &Row) -> Result<(usize, Option<QuadMatches>), db::Error> {
    let quad: i64 = row.try_get("quad")?;
    let landmark: Option<String> = row.try_get("matched")?;
    let bytes: Option<Vec<u8>> = row.try_get("matches")?;
    let matched = landmark.map(|landmark| QuadMatches {
        landmark,
        matches: bytes.as_deref().map(matches_of).unwrap_or_default(),
    });
    Ok((quad as usize, matched))
}

/// One answer with what is stored of it.
pub(crate) async fn get(db: &db::Pool, id: i64) -> Result<OpenedAnswer, StoreError> {
    let at = || StoreError::during("read answer");
    let row = db::query(GET).bind(id).fetch_optional(db).await.map_err(at())?;
    let row = row.ok_or_else(|| unknown(id))?;
    let message: &[u8] = row.try_get("answer").map_err(at())?;
    let answer = v1::Answer::decode(message).map_err(|e| damaged(e.to_string()))?;
    let check: Option<&str> = row.try_get("prior_check").map_err(at())?;
    let prior_check = check.map(serde_json::from_str).transpose().map_err(|e| damaged(e.to_string()))?;
    let icons = db::query(ICONS).bind(id).fetch_all(db).await.map_err(at())?;
    let icons = icons.iter().map(matches_in).collect::<Result<_, _>>().map_err(at())?;
    Ok(OpenedAnswer { row: answer_row(&row)?, answer, icons, prior_check })
}

/// The map of an answer.
pub(crate) async fn map_of(db: impl Executor<'_>, id: i64) -> Result<String, StoreError> {
    let name = db::query_scalar(MAP_OF).bind(id).fetch_optional(db).await;
    name.map_err(StoreError::during("read answer"))?.ok_or_else(|| unknown(id))
}

/// Side and grey levels of the icon of a quad.
pub(crate) async fn icon(db: impl Executor<'_>, id: i64, quad: i64) -> Result<(usize, Vec<u8>), StoreError> {
    let at = || StoreError::during("read icon");
    let row = db::query(ICON).bind(id).bind(quad).fetch_optional(db).await.map_err(at())?;
    let row = row.ok_or_else(|| unknown(id))?;
    let side: i64 = row.try_get("icon_side").map_err(at())?;
    Ok((side as usize, row.try_get("icon").map_err(at())?))
}

/// The refusal for an answer that is not stored.
pub(crate) fn unknown(id: i64) -> StoreError {
    StoreError::NotFound { what: Kind::Answer, name: id.to_string() }
}

/// Answers with numbers below `before`, newest first.
pub(crate) async fn page(
    db: impl Executor<'_>,
    filter: &AnswerFilter,
    before: i64,
    limit: usize,
) -> Result<Vec<AnswerRow>, StoreError> {
    let rows = db::query(LIST)
        .bind(&filter.maps)
        .bind(&filter.robot)
        .bind(&filter.camera)
        .bind(&filter.status)
        .bind(&filter.refusal)
        .bind(&filter.landmark)
        .bind(filter.since_ms)
        .bind(filter.until_ms)
        .bind(before)
        .bind(limit as i64);
    let rows = rows.fetch_all(db).await.map_err(StoreError::during("list answers"))?;
    rows.iter().map(answer_row).collect()
}

/// How many answers a list has.
pub(crate) async fn count(db: impl Executor<'_>, filter: &AnswerFilter) -> Result<u64, StoreError> {
    let count = db::query_scalar::<i64>(COUNT)
        .bind(&filter.maps)
        .bind(&filter.robot)
        .bind(&filter.camera)
        .bind(&filter.status)
        .bind(&filter.refusal)
        .bind(&filter.landmark)
        .bind(filter.since_ms)
        .bind(filter.until_ms);
    let count = count.fetch_one(db).await.map_err(StoreError::during("count answers"))?;
    Ok(count as u64)
}
