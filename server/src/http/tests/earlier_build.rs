//! A database of the previous build, with its words: the schema is brought up to date, stored JSON reads, and answers
//! have the words of now.

use super::*;
use serde_json::json;
use sqlx::{ConnectOptions, Connection, migrate::Migrator, sqlite::SqliteConnectOptions};
use std::path::Path;

/// The last migration of the previous build.
const LAST_MIGRATION: i64 = 12;

const ROWS: &str = r#"
INSERT INTO maps (id, name, distance, created_ms, fusion, sight) VALUES
    (1, 'office', 'both', 0, 'fuse', NULL), (2, 'attic', 'both', 0, 'single', NULL);
INSERT INTO landmarks (id, map_id, name, created_ms, standing, finding) VALUES
    (1, 1, 'moved', 0, 'flagged',
     '{"kind":"moved","by_m":1.25,"sightings":3,"apparent":{"x_m":1.5,"y_m":2.0,"theta_rad":0.5}}'),
    (2, 1, 'missing', 0, 'quarantined', '{"kind":"missing","looks":20}'),
    (3, 1, 'new', 0, 'sound', NULL);
INSERT INTO models (landmark_id, model, sha256, params_hash, active, reasons, facts, views, generated_views, learnt_ms)
    VALUES (1, x'00', zeroblob(32), zeroblob(8), 0, '[{"gate":"saliency"}]',
    '{"likeness":{"tau":0.55},"look_alikes":[{"landmark":"missing","likeness":0.75}]}', 1, 0, 0);
INSERT INTO robots (name, map_id, created_ms) VALUES ('r1', 1, 0);
INSERT INTO gatherings (id, map_id, robot, known, open, created_ms, ended_ms, counts) VALUES (1, 1, 'r1', 0, 0, 0, 1,
    '{"frames":99,"elsewhere":1,"alike":2,"too_new":3,"known":4,"unwanted":5,"unlike":6,"too_many":7,"refused":8}');
INSERT INTO tracks (gathering_id, number, sightings, known) VALUES (1, 1, 3, 0);
INSERT INTO runs (id, map_id, robot, created_ms, way_m, cells) VALUES (1, 1, 'r1', 0, 12.5, '[]');
"#;

/// Writes the database as the previous build has left it.
async fn leave_behind(data: &Path) {
    let options = SqliteConnectOptions::new().filename(data.join("waymark.sqlite")).create_if_missing(true);
    let mut file = options.connect().await.unwrap();
    let all = crate::store::migrations::migrator();
    let earlier = all.iter().filter(|m| m.version <= LAST_MIGRATION).cloned().collect();
    Migrator::with_migrations(earlier).run(&mut file).await.unwrap();
    sqlx::raw_sql(ROWS).execute(&mut file).await.unwrap();
    file.close().await.unwrap();
}

#[tokio::test]
async fn rows_of_the_previous_build_read_and_are_answered_in_the_words_of_now() {
    let data = tempfile::tempdir().unwrap();
    leave_behind(data.path()).await;
    let service = Service::on(data, Limits::default()).await;
    let get = async |path: &str| {
        let (status, body) = service.get(&format!("/api/v1/maps/{path}")).await;
        assert_eq!(status, 200, "{path}: {body}");
        body
    };

    let moved = get("office/landmarks/moved").await;
    assert_eq!((&moved["health"], &moved["status"]), (&json!("flagged"), &json!("inactive")), "{moved}");
    let place = json!({ "x_m": 1.5, "y_m": 2.0, "theta_rad": 0.5 });
    assert_eq!(
        moved["finding"],
        json!({ "kind": "moved", "observed_place": place, "offset_m": 1.25, "sightings": 3 })
    );
    assert_eq!(moved["failed_gates"][0]["gate"], "stored_model", "its model does not read: {moved}");
    assert_eq!(moved["model"]["gradient_similarity"], json!({ "threshold": 0.55 }));
    assert_eq!(moved["model"]["look_alikes"][0]["gradient_similarity"], 0.75);
    let missing = get("office/landmarks/missing").await;
    assert_eq!(missing["finding"], json!({ "kind": "missing", "missed_frames": 20 }));
    assert_eq!((&missing["health"], &missing["status"]), (&json!("quarantined"), &json!("not_learnt")));
    assert_eq!(get("office/landmarks/new").await["health"], "sound");

    assert_eq!(get("office/modalities").await["fusion_mode"], "near_best");
    assert_eq!(get("attic/modalities").await["fusion_mode"], "best");
    let runs = get("office/reference-runs").await;
    assert_eq!((&runs["runs"][0]["distance_m"], &runs["runs"][0]["robot"]), (&json!(12.5), &json!("r1")));

    let counts = get("office/gatherings/1").await["counts"].clone();
    let expected = [
        ("frames", 99),
        ("other_map", 1),
        ("near_duplicate", 2),
        ("too_few_observations", 3),
        ("known_landmark", 4),
        ("not_requested", 5),
        ("appearance_mismatch", 6),
        ("track_limit", 7),
        ("not_stored", 8),
    ];
    for (key, count) in expected {
        assert_eq!(counts[key], count, "{key}: {counts}");
    }
    assert_eq!(get("office/gatherings/1/tracks").await["tracks"][0]["number"], 1);
}

#[tokio::test]
async fn a_mode_is_stored_in_the_words_of_the_column() {
    let service = Service::start(Limits::default()).await;
    for mode in ["near_best", "best", "all"] {
        let body = json!({ "fusion_mode": mode }).to_string();
        let (status, set) =
            read(service.ask(request("PUT", "/api/v1/maps/hall/modalities", body)).await).await;
        assert_eq!((status, &set["fusion_mode"]), (200, &json!(mode)), "{set}");
    }
    let body = r#"{ "fusion_mode": "fuse" }"#;
    let (status, problem) =
        read(service.ask(request("PUT", "/api/v1/maps/hall/modalities", body)).await).await;
    assert_eq!((status, &problem["code"]), (422, &json!("invalid_value")), "{problem}");
}
