//! A seeded sequence of changes in SQL that SQLite and PostgreSQL take alike, and the rows that it
//! leaves. Each step is a transaction on one map, so that numbers are given in one order.

use crate::store::db::{self, Conn};

pub(super) const STEPS: u64 = 900;

/// The tables that are compared.
pub(super) const TABLES: [&str; 19] = [
    "commits",
    "laser_segments",
    "landmarks",
    "maps",
    "model_contents",
    "models",
    "past_landmarks",
    "past_maps",
    "past_models",
    "past_runs",
    "past_strangers",
    "past_underlays",
    "past_views",
    "past_walls",
    "pictures",
    "runs",
    "strangers",
    "underlays",
    "views",
];

/// Columns of a table, and whether each holds bytes.
pub(super) type Columns = Vec<(String, String)>;

/// The tables with their columns, without times.
pub(super) async fn tables(conn: &mut Conn) -> Vec<(&'static str, Columns)> {
    let mut tables = Vec::new();
    for table in TABLES {
        let columns = "SELECT name, type FROM pragma_table_info($1) WHERE name <> 'changed_ms' ORDER BY cid";
        tables.push((table, db::query_as(columns).bind(table).fetch_all(&mut *conn).await.unwrap()));
    }
    tables
}

/// Selects every row of a table as one text, in the order of these texts.
pub(super) fn rows(table: &str, columns: &Columns, hex: &str, end: &str) -> String {
    let text = columns.iter().map(|(name, kind)| {
        let text = if kind == "BLOB" { format!("{hex}{name}{end}") } else { format!("CAST({name} AS TEXT)") };
        format!("CASE WHEN {name} IS NULL THEN '-' ELSE {text} END")
    });
    let text = text.collect::<Vec<_>>().join(" || '|' || ");
    format!("SELECT {text} AS row FROM {table} ORDER BY 1")
}

/// `bytes` bytes that begin with a number, in hexadecimal.
fn hex(number: u64, bytes: usize) -> String {
    format!("x'{number:016x}{}'", "00".repeat(bytes - 8))
}

/// One transaction. What it changes lies on one map.
pub(super) fn step(number: u64) -> String {
    // The constants of Knuth's MMIX generator.
    let random = (number + 1).wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    let (kind, n) = ((random >> 33) % 23, (random >> 33) / 23 % 7);
    let change = change(number, if number < 5 { 0 } else { kind }, n);
    format!("BEGIN; {change}; UPDATE commits SET open = 0 WHERE open = 1; COMMIT")
}

/// One of 23 kinds of changes, of the rows whose numbers have the rest `n` by some number.
fn change(number: u64, kind: u64, n: u64) -> String {
    let map = format!("(SELECT coalesce(min(id), 1) FROM maps WHERE id % 5 = {})", n % 5);
    let of_map = format!("map_id = {map}");
    let landmark = format!("FROM landmarks WHERE {of_map} AND id % 7 = {n}");
    let (sha, square) = (hex(number, 32), hex(n, 64));
    let picture = format!("INSERT INTO pictures (sha256, bytes) VALUES ({sha}, {sha})");
    let content = format!("INSERT INTO model_contents (sha256, bytes) VALUES ({sha}, {sha})");
    match kind {
        0 => format!("INSERT INTO maps (name, distance, created_ms) VALUES ('m{number}', 'both', {number})"),
        1..=4 => format!(
            "INSERT INTO landmarks (map_id, name, created_ms) SELECT id, 'l{number}', {number} FROM maps WHERE id = {map}"
        ),
        5 => format!("UPDATE landmarks SET name = 'r{number}-' || id WHERE {of_map} AND id % 7 = {n}"),
        6 => format!(
            "UPDATE landmarks SET width_m = {n}.25, height_m = 0.75, size_from_views = 1 WHERE {of_map} AND id % 3 = {}",
            n % 3
        ),
        7 | 8 => format!(
            "{picture}; INSERT INTO views (landmark_id, image_sha256, image_kind, width_px, height_px, corners_px, \
             created_ms, icon_side, icon_scale, icon) SELECT id, {sha}, 'png', 1, 1, {square}, {number}, 1, 0.25, x'0{n}' \
             {landmark} ORDER BY id; DELETE FROM pictures WHERE sha256 = {sha} \
             AND NOT EXISTS (SELECT 1 FROM views WHERE image_sha256 = {sha})"
        ),
        9 => format!(
            "DELETE FROM views WHERE landmark_id IN (SELECT id FROM landmarks WHERE {of_map}) AND id % 5 = {}",
            n % 5
        ),
        10 | 11 => format!(
            "{content}; INSERT INTO models (landmark_id, sha256, params_hash, active, reasons, facts, views, generated_views, \
             learnt_ms) SELECT id, {sha}, x'0000000000000000', 1, '[]', '{{}}', {n}, 0, {number} FROM landmarks WHERE {of_map} \
             AND true ON CONFLICT (landmark_id) DO UPDATE SET sha256 = excluded.sha256, views = excluded.views; \
             DELETE FROM model_contents WHERE sha256 = {sha} AND NOT EXISTS (SELECT 1 FROM models WHERE sha256 = {sha})"
        ),
        12 => format!(
            "UPDATE models SET active = 1 - active, looks_like = 'l{number}' WHERE landmark_id IN (SELECT id {landmark})"
        ),
        13 => format!(
            "INSERT INTO strangers (map_id, image_sha256, corners_px, icon_side, icon_scale, icon) \
             SELECT id, {sha}, {square}, 1, 0.5, x'0{n}' FROM maps WHERE id = {map}"
        ),
        14 => format!("DELETE FROM strangers WHERE {of_map} AND id % 3 = {}", n % 3),
        15 => format!(
            "INSERT INTO runs (map_id, robot, created_ms, way_m, cells) SELECT id, 'r', {number}, 0.5, '[]' FROM maps WHERE id = {map}"
        ),
        16 => format!("DELETE FROM runs WHERE {of_map} AND id % 3 = {}", n % 3),
        17 => format!(
            "{picture}; INSERT INTO underlays (map_id, image_sha256, image_kind, width_px, height_px, metres_per_pixel, x_m, \
             y_m, theta_rad, created_ms) SELECT id, {sha}, 'png', 1, 1, 0.25, {n}.5, 0.25, 0.75, {number} FROM maps \
             WHERE id = {map} ON CONFLICT (map_id) DO UPDATE SET image_sha256 = excluded.image_sha256, x_m = excluded.x_m; \
             DELETE FROM pictures WHERE sha256 = {sha} AND NOT EXISTS (SELECT 1 FROM underlays WHERE image_sha256 = {sha})"
        ),
        18 => format!(
            "DELETE FROM laser_segments WHERE {of_map}; INSERT INTO laser_segments (map_id, ordinal, ax_m, ay_m, bx_m, by_m) \
             SELECT id, {n}, 0.25, 0.5, 0.75, {n}.5 FROM maps WHERE id = {map}; \
             UPDATE maps SET walls_version = walls_version + 1 WHERE id = {map}"
        ),
        19 => format!("UPDATE maps SET site = 's{n}', fusion = 'best' WHERE id = {map}"),
        20 => format!("DELETE FROM landmarks WHERE {of_map} AND id % 11 = {n}"),
        21 => format!(
            "UPDATE landmarks SET health = 'flagged', finding = 'f{number}' WHERE {of_map} AND id % 2 = {}",
            n % 2
        ),
        _ if n == 6 => format!("DELETE FROM maps WHERE id = {map} AND id > 2"),
        _ => format!("DELETE FROM commits WHERE {of_map} AND id < {}", number / 4),
    }
}
