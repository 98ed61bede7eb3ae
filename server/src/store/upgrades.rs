//! Databases of every earlier schema open, and every row is there. Each is made by the steps up to its own, with the rows that
//! a server of each step's time wrote after it.

use super::{
    gatherings, history, jobs, landmarks, maps,
    migrations::migrator,
    modality_stats, open,
    pictures::{self, digest, hex},
    robots, underlays, views, walls,
};
use crate::publication::{Catalogue, tests::config};
use map::landmark_health::LandmarkHealth;
use sqlx::{ConnectOptions as _, Connection as _, migrate::Migrator, sqlite::SqliteConnectOptions};
use std::path::Path;

const PICTURE: &[u8] = b"picture";
const UNDERLAY: &[u8] = b"floor plan";

/// By step. `DIGEST`, `PICTURE`, `UNDERLAY` and `CORNERS` stand for blobs.
const ROWS: [(i64, &str); 6] = [
    (
        1,
        "INSERT INTO maps (name, distance, created_ms) VALUES ('office', 'both', 1), ('attic', 'hausdorff', 2);
         INSERT INTO landmarks (map_id, name, width_m, height_m, x_m, y_m, z_m, theta_rad, created_ms)
             VALUES (1, 'door', 0.9, 2.0, 4.5, 0.25, 1.0, 1.5, 3), (1, 'poster', NULL, NULL, NULL, NULL, NULL, NULL, 4);
         INSERT INTO views (landmark_id, image_sha256, image_kind, image, width_px, height_px, corners_px, icon_side, icon,
             icon_scale, created_ms) VALUES
             (1, DIGEST, 'jpeg', PICTURE, 640, 480, CORNERS, 20, zeroblob(400), 0.5, 5),
             (2, DIGEST, 'jpeg', PICTURE, 640, 480, CORNERS, 20, zeroblob(400), 0.5, 6);
         INSERT INTO strangers (map_id, image_sha256, corners_px, icon_side, icon, icon_scale)
             VALUES (1, DIGEST, CORNERS, 20, zeroblob(400), 0.5);
         INSERT INTO models (landmark_id, model, sha256, params_hash, active, reasons, facts, views, generated_views, learnt_ms)
             VALUES (1, x'00', zeroblob(32), zeroblob(8), 0, '[]', '{}', 1, 0, 7);
         INSERT INTO laser_segments VALUES (1, 0, 0.0, 0.0, 6.5, 0.0), (1, 1, 6.5, 0.0, 6.5, 4.0);
         INSERT INTO robots VALUES ('r1', 1, 8);
         INSERT INTO jobs (kind, map, request, state, created_ms, ended_ms) VALUES ('learn', 'office', '{}', 'done', 9, 10);",
    ),
    (5, "UPDATE landmarks SET standing = 'flagged' WHERE name = 'door';"),
    (
        6,
        "INSERT INTO gatherings (map_id, robot, known, open, created_ms, ended_ms) VALUES (1, 'r1', 0, 0, 11, 12);
         INSERT INTO tracks (gathering_id, number, sightings, known) VALUES (1, 1, 3, 0);
         INSERT INTO track_views (gathering_id, track, image_sha256, image_kind, image, width_px, height_px, corners_px,
             icon_side, icon, icon_scale, created_ms)
             VALUES (1, 1, DIGEST, 'jpeg', PICTURE, 640, 480, CORNERS, 20, zeroblob(400), 0.5, 13);",
    ),
    (
        8,
        "UPDATE maps SET fusion = 'fuse' WHERE name = 'office';
         INSERT INTO runs (map_id, robot, created_ms, way_m, cells) VALUES (1, 'r1', 14, 12.5, '[]');",
    ),
    (
        15,
        "INSERT INTO underlays (map_id, image, image_kind, width_px, height_px, metres_per_pixel, x_m, y_m, theta_rad, created_ms)
             VALUES (1, UNDERLAY, 'png', 8, 6, 0.05, 1.0, 2.0, 0.5, 15);",
    ),
    (16, "UPDATE views SET capture = '{}' WHERE id = 2;"),
];

fn blob(bytes: &[u8]) -> String {
    format!("x'{}'", hex(bytes))
}

/// A database of this schema.
async fn write(data: &Path, schema: i64) {
    let corners: Vec<u8> =
        [1.0, 1.0, 9.0, 1.0, 9.0, 9.0, 1.0, 9.0_f64].iter().flat_map(|c| c.to_le_bytes()).collect();
    let options = SqliteConnectOptions::new().filename(data.join(open::FILE)).create_if_missing(true);
    let mut file = options.connect().await.unwrap();
    for step in migrator().iter().map(|step| step.version).filter(|version| *version <= schema) {
        let until = migrator().iter().filter(|other| other.version <= step).cloned().collect();
        Migrator::with_migrations(until).run(&mut file).await.unwrap();
        if let Some((_, rows)) = ROWS.iter().find(|(version, _)| *version == step) {
            let rows = rows.replace("DIGEST", &blob(&digest(PICTURE)));
            let rows = rows.replace("PICTURE", &blob(PICTURE)).replace("UNDERLAY", &blob(UNDERLAY));
            let rows = rows.replace("CORNERS", &blob(&corners));
            sqlx::raw_sql(sqlx::AssertSqlSafe(rows)).execute(&mut file).await.unwrap();
        }
    }
    file.close().await.unwrap();
}

#[tokio::test]
async fn a_database_of_every_schema_opens_with_all_its_rows() {
    let schemas: Vec<i64> = migrator().iter().map(|step| step.version).collect();
    assert!(ROWS.iter().all(|(step, _)| schemas.contains(step)));
    for schema in schemas {
        let dir = tempfile::tempdir().unwrap();
        write(dir.path(), schema).await;
        let (store, tasks) = Catalogue::open(&config(dir.path())).await.unwrap();
        let db = store.reads();
        let names: Vec<_> = maps::page(db, "", 9).await.unwrap().into_iter().map(|map| map.name).collect();
        assert_eq!(names, ["attic", "office"], "schema {schema}");
        let door = landmarks::get(db, "office", "door").await.unwrap();
        assert_eq!(door.geometry.size.map(|size| size.height_m), Some(2.0));
        assert!(door.geometry.landmark_place().is_some() && door.model.is_some());
        assert_eq!(door.health == LandmarkHealth::Flagged, schema >= 5, "schema {schema}");
        assert_eq!(landmarks::get(db, "office", "poster").await.unwrap().views, 1);
        for landmark in 1..=2 {
            let rows =
                views::page(db, landmark, views::ViewFilter::default(), (None, false), 9).await.unwrap();
            assert_eq!(
                (rows[0].id, rows[0].size_px, rows[0].corners_px[2]),
                (landmark, [640, 480], [9.0, 9.0])
            );
            let name = ["door", "poster"][landmark as usize - 1];
            let (sha256, kind) = views::picture(db, "office", name, landmark).await.unwrap();
            assert_eq!(
                (pictures::read(&store, &sha256).await.unwrap(), kind),
                (PICTURE.to_vec(), "jpeg".into())
            );
        }
        assert_eq!(views::distractors(db, 1).await.unwrap().len(), 1);
        let segments = [[0.0, 0.0, 6.5, 0.0], [6.5, 0.0, 6.5, 4.0]].map(walls::StoredWall::from);
        assert_eq!(walls::all_of(db, 1).await.unwrap(), segments);
        assert_eq!(robots::get(db, "r1").await.unwrap().map, "office");
        assert_eq!(jobs::get(db, 1).await.unwrap().state, "done");
        if schema >= 6 {
            assert_eq!(gatherings::tracks(db, 1).await.unwrap()[0].sightings, 3, "schema {schema}");
            assert_eq!(gatherings::track_views(db, 1, 1).await.unwrap()[0].image_sha256, digest(PICTURE));
        }
        if schema >= 8 {
            let run = &modality_stats::runs(db, 1).await.unwrap()[0];
            assert_eq!((run.robot.as_str(), run.way_m), ("r1", 12.5));
        }
        if schema >= 15 {
            let row = underlays::get(db, (1, "office")).await.unwrap();
            assert_eq!(pictures::read(&store, &row.image_sha256).await.unwrap(), UNDERLAY, "schema {schema}");
        }
        // The state that the upgrade found can be gone back to.
        let found = history::newest(db, 1).await.unwrap();
        store.write(|tx| Box::pin(landmarks::delete(tx, "office", "door"))).await.unwrap();
        store.write(move |tx| Box::pin(history::roll_back(tx, "office", found))).await.unwrap();
        assert_eq!(landmarks::get(db, "office", "door").await.unwrap().model, door.model, "schema {schema}");
        assert_eq!(
            views::page(db, 1, views::ViewFilter::default(), (None, false), 9).await.unwrap()[0].id,
            1,
            "schema {schema}"
        );
        tasks.close().await;
    }
}
